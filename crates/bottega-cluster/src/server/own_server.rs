//! A private NATS server, configured as `bottega up` does, for tests and measurements.

use std::{
    net::{SocketAddr, TcpListener},
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega_agents::driver::nats::{Login, NatsOptions, NatsThread, NatsUplink};
use bottega_farm::FarmCodec;

use crate::{
    error::Error,
    server::{
        address::{FarmAddress, Group, JoinWord},
        link::pinned,
        members::Members,
        process::{Server, Setup, program},
        up,
    },
};

/// A private NATS server for the processes of this program. It stops when this is dropped.
pub struct OwnServer {
    _server: Server,
    /// Access to the server.
    pub entry: Entry,
}

/// Access to a private server for the processes of this program, which read its secrets from its folder.
#[derive(Clone, Debug)]
pub struct Entry {
    /// The folder of the server's secrets.
    pub folder: PathBuf,
    /// The address of the server.
    pub address: SocketAddr,
}

impl OwnServer {
    /// Starts a server on a free port of 127.0.0.1. Returns it.
    ///
    /// - `server_program`: the path of `nats-server`; `None`: the installed one.
    /// - `folder`: the folder for its data and secrets.
    ///
    /// # Errors
    /// There is no `nats-server`, no port is free, or the server does not start in the folder.
    pub fn start(server_program: Option<&Path>, folder: &Path) -> Result<Self, Error> {
        let program = program(server_program)?;
        let entry = Entry { folder: folder.to_owned(), address: free_address()? };
        let setup = Setup { folder: folder.to_owned(), listen: entry.address, store_bytes: None };
        let config = setup.write(&entry.members()?)?;
        let (server, _) =
            up::begin(&program, &config, &setup, &entry.options("bench")?, entry.members()?.system_login())?;
        Ok(Self { _server: server, entry })
    }
}

impl Entry {
    /// Connects to the server as the given member. Returns the connection.
    ///
    /// - `thread`: the thread of the connection, which may serve several.
    /// - `member`: the name of the member.
    ///
    /// # Errors
    /// The secrets cannot be read, or the connection fails.
    pub fn link(&self, thread: &Arc<NatsThread>, member: &str) -> Result<NatsUplink<FarmCodec>, Error> {
        let linked = NatsUplink::connect_on(thread, &self.options(member)?, FarmCodec);
        let remedy = "use fewer agents than this machine may open files (ulimit -n)".to_owned();
        linked.map_err(|source| Error::Farm { source, remedy })
    }

    fn members(&self) -> Result<Members, Error> {
        Members::open(self.folder.join("members.json"))
    }

    fn options(&self, member: &str) -> Result<NatsOptions, Error> {
        let members = self.members()?;
        let secret = members.secret(Group::Trusted).to_owned();
        let word = JoinWord { group: Group::Trusted, secret, pin: up::pin(&members)? };
        let address = FarmAddress::of_up(self.address.to_string(), word.clone());
        Ok(NatsOptions { login: Login::NKey(members.seed().to_owned()), ..pinned(&address, &word, member) })
    }
}

/// Returns a free local port.
fn free_address() -> Result<SocketAddr, Error> {
    TcpListener::bind("127.0.0.1:0")
        .and_then(|listener| listener.local_addr())
        .map_err(|error| Error::failed(format!("no port is free: {error}"), "let fewer programs run at once"))
}
