//! A farm on this machine, with a NATS server as a child process.

use std::{
    fs,
    io::Write,
    net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket},
    path::{Path, PathBuf},
    sync::Arc,
    thread,
    time::Duration,
};

use bottega_agents::driver::nats::{Login, NatsOptions, NatsUplink, Pin};
use bottega_farm::{FarmCodec, StopSwitch};
use bottega_platform::{
    disk::{self, DiskSpace},
    folders::state_folder,
    processes,
};
use rustls::pki_types::{CertificateDer, pem::PemObject};

use crate::{
    error::Error,
    job::board::JobBoard,
    server::{
        address::{FarmAddress, Group, JoinWord, LocalAddresses, address_file},
        admission::Admission,
        discovery::Beacon,
        link::{pinned, private_folder, write_secret},
        members::Members,
        ports::{Port, bind},
        process::{Server, Setup, program, reload},
        room::{bytes_below, bytes_said, fitting_limit},
        supervisor::ServerSupervisor,
        web_secrets::WebSecrets,
    },
};

/// The most attempts to connect to a starting server.
const BEGIN_TRIES: u32 = 100;
const BETWEEN_TRIES: Duration = Duration::from_millis(100);
/// The default address of a farm's server.
const LISTEN: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::UNSPECIFIED), 4222);
/// The file that the process running a farm holds locked.
const LOCK: &str = "up.lock";

/// The options of a new farm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UpOptions {
    /// The address to listen on; none: 0.0.0.0:4222.
    pub listen: Option<SocketAddr>,
    /// The folder for jobs, pixels and secrets; `None`: the folder `server` in Bottega's state folder.
    pub state: Option<PathBuf>,
    /// The most that is stored there, in bytes; `None`: the stored bytes and the free space of its disk, except a reserve.
    pub store_bytes: Option<u64>,
    /// The path of `nats-server`; `None`: the one beside this program, or else the installed one.
    pub server: Option<PathBuf>,
    /// `true`: does not announce the farm on the local network (mDNS).
    pub hidden: bool,
}

/// The state of the farm's folder on this machine.
pub enum LocalFarm {
    /// No process runs it: this process may start the farm.
    Free(FarmStart),
    /// Another process of this user runs it; nothing is changed.
    Elsewhere {
        /// The ID of that process.
        process: String,
        /// The address of the farm's server.
        listen: SocketAddr,
        /// The addresses by which others join it.
        invitation: Box<Invitation>,
    },
}

/// The right to start a farm: a lock on its folder.
pub struct FarmStart {
    options: UpOptions,
    folder: PathBuf,
    alone: fs::File,
}

/// The addresses by which others join a farm.
#[derive(Clone, Debug)]
pub struct Invitation {
    /// The address for machines that may do everything.
    pub trusted: FarmAddress,
    /// The address for machines that may only render.
    pub guest: FarmAddress,
}

/// The process that runs a farm: the farm is up while it [keeps it up](Self::keep_up).
pub struct Host {
    /// The addresses by which others join it.
    pub invitation: Invitation,
    /// The tokens and certificate of its HTTP server.
    pub web_secrets: WebSecrets,
    supervisor: ServerSupervisor,
    board: JobBoard,
    /// The farm's address for this machine.
    here: String,
    /// The pin and port of the server, if they are announced on the local network.
    shown: Option<(Pin, u16)>,
    /// The text of the published address file, once it is written.
    announced: Option<String>,
    beacon: Option<Beacon>,
    _alone: fs::File,
}

impl LocalFarm {
    /// Locks the folder of a farm. Starts nothing. Returns the right to start the farm, or the farm if another process runs it.
    ///
    /// # Errors
    /// The folder cannot be used, or another process runs the farm at another address than the one requested or is about to start
    /// it.
    pub fn claim(options: &UpOptions) -> Result<Self, Error> {
        let folder = options.state.clone().unwrap_or_else(|| state_folder().join("server"));
        match lock(&folder)? {
            Some(alone) => Ok(Self::Free(FarmStart { options: options.clone(), folder, alone })),
            None => up_already(options, folder),
        }
    }
}

impl FarmStart {
    /// Starts the farm, with a NATS server as a child process, or adopts the server that an earlier process left running. Returns
    /// the host of the farm, which is not announced before [`Host::announce`].
    ///
    /// # Errors
    /// There is no `nats-server`, it does not start, the folder or address cannot be used, or the farm's secrets are damaged.
    pub fn begin(self) -> Result<Host, Error> {
        let Self { options: up, folder, alone } = self;
        // Find the program, the members and the storage limit
        let program = program(up.server.as_deref())?;
        let members = Members::open(folder.join("members.json"))?;
        let listen = up.listen.unwrap_or(LISTEN);
        let words = words(&members)?;
        let options = |listen| options(&members, listen, &words[0]);
        let mut setup = Setup { folder, listen, store_bytes: None };
        setup.store_bytes = store_bytes(&up, &setup, &options)?;
        // Start the server, or adopt the one left running
        let config = setup.write(&members)?;
        let (server, uplink) = begin(&program, &config, &setup, &options(listen), members.system_login())?;
        let board = JobBoard { uplink: Arc::new(uplink) };
        let here = FarmAddress::of_up(reachable_here(listen), words[0].clone()).to_string();
        // Supervise it, and admit machines
        let supervisor = ServerSupervisor::new(server, &program, config, &setup, board.clone());
        let web_secrets = WebSecrets::of_host(&members)?;
        let system = NatsOptions { login: members.system_login(), ..options(listen) };
        let admission = Admission::new(members, setup, system);
        let groups = Group::ALL.map(Group::word);
        board.uplink.answer_newcomers(&groups, move |group, request| admission.answer(group, request));
        let shown = (!up.hidden && !listen.ip().is_loopback()).then(|| (words[0].pin, listen.port()));
        let invitation = Invitation::new(listen, &words);
        let (announced, beacon) = (None, None);
        Ok(Host { invitation, web_secrets, supervisor, board, here, shown, announced, beacon, _alone: alone })
    }
}

impl Host {
    /// Announces the farm to other processes of this machine, and on the local network; a failure of the latter is only logged.
    ///
    /// - `page`, `platform`: the URLs of the web page and the FIPA platform, if this process serves them.
    ///
    /// # Errors
    /// The file with the addresses cannot be written.
    pub fn announce(&mut self, page: Option<String>, platform: Option<String>) -> Result<(), Error> {
        let text = LocalAddresses { farm: self.here.clone(), page, platform }.to_string();
        write_secret(&address_file(), text.as_bytes())?;
        self.announced = Some(text);
        self.beacon = self.shown.and_then(|(pin, port)| {
            let lit = Beacon::light(pin, port);
            lit.inspect_err(|error| tracing::warn!(%error, "cannot announce the farm on the local network")).ok()
        });
        Ok(())
    }

    /// Returns the version of the NATS server.
    pub fn server_version(&self) -> String {
        self.board.uplink.server_version().to_string()
    }

    /// Returns a sentence for display: the folder in which the server stores its data, and the limit if there is one.
    pub fn room_said(&self) -> String {
        self.supervisor.room_said()
    }

    /// Returns the job records of the farm.
    pub fn board(&self) -> &JobBoard {
        &self.board
    }

    /// Keeps the farm up until the user stops.
    ///
    /// - `before_end`: called after that, while the server is still running.
    ///
    /// # Errors
    /// The server fails and cannot be restarted.
    pub fn keep_up(mut self, stop: &StopSwitch, before_end: impl FnOnce()) -> Result<(), Error> {
        let kept = self.supervisor.keep_up(stop);
        before_end();
        kept
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        drop(self.beacon.take());
        let Some(announced) = self.announced.take() else { return };
        // Another farm may have started in another folder.
        if fs::read_to_string(address_file()).is_ok_and(|text| text == announced)
            && let Err(error) = fs::remove_file(address_file())
        {
            tracing::debug!(%error, "cannot remove the file of the address");
        }
    }
}

impl Invitation {
    fn new(listen: SocketAddr, [trusted, guest]: &[JoinWord; 2]) -> Self {
        let there = reachable_there(listen);
        let [trusted, guest] = [trusted, guest].map(|word| FarmAddress::of_up(there.clone(), word.clone()));
        Self { trusted, guest }
    }
}

/// Locks a folder until the result is dropped or this process dies. `None`: another process holds the lock.
fn lock(folder: &Path) -> Result<Option<fs::File>, Error> {
    private_folder(folder)?;
    let path = folder.join(LOCK);
    let write_error = |source| Error::write(path.clone(), source);
    let file = fs::OpenOptions::new().create(true).truncate(false).write(true).open(&path).map_err(write_error)?;
    match file.try_lock() {
        Ok(()) => {
            // Store the process ID for others to show.
            let written = file.set_len(0).and_then(|()| (&file).write_all(std::process::id().to_string().as_bytes()));
            written.map_err(write_error)?;
            Ok(Some(file))
        }
        Err(fs::TryLockError::WouldBlock) => Ok(None),
        Err(fs::TryLockError::Error(error)) => Err(write_error(error)),
    }
}

/// Returns the farm that another process of this user runs.
fn up_already(args: &UpOptions, folder: PathBuf) -> Result<LocalFarm, Error> {
    let process = fs::read_to_string(folder.join(LOCK)).unwrap_or_default();
    let file = folder.join("members.json");
    if !file.is_file() {
        let problem = format!("process {process} is about to start a farm in {}", folder.display());
        return Err(Error::failed(problem, "try again in a moment"));
    }
    let members = Members::open(file)?;
    let setup = Setup { folder, listen: args.listen.unwrap_or(LISTEN), store_bytes: None };
    let listen = setup.configured().map_or(setup.listen, |configured| configured.listen);
    if args.listen.is_some_and(|wanted| wanted != listen) {
        return Err(Error::failed(
            format!("a farm already runs in {}, at {listen}: process {process}", setup.folder.display()),
            "end it first, or start another farm in another folder: --state",
        ));
    }
    let invitation = Box::new(Invitation::new(listen, &words(&members)?));
    Ok(LocalFarm::Elsewhere { process, listen, invitation })
}

/// Returns the words for joining a farm.
fn words(members: &Members) -> Result<[JoinWord; 2], Error> {
    let pin = pin(members)?;
    Ok(Group::ALL.map(|group| JoinWord { group, secret: members.secret(group).to_owned(), pin }))
}

fn options(members: &Members, listen: SocketAddr, word: &JoinWord) -> NatsOptions {
    let here = FarmAddress::of_up(reachable_here(listen), word.clone());
    NatsOptions { login: Login::NKey(members.seed().to_owned()), ..pinned(&here, word, "up") }
}

/// Returns the most that the server may store; `None`: the server's default. A server left running stays as it is, unless
/// other options are requested: then it is stopped.
fn store_bytes(
    args: &UpOptions,
    setup: &Setup,
    options: &dyn Fn(SocketAddr) -> NatsOptions,
) -> Result<Option<u64>, Error> {
    let requested = args.store_bytes;
    if let (Some(before), Some(number)) = (setup.configured(), setup.running())
        // Only our own server has this certificate.
        && let Ok(uplink) = NatsUplink::connect(&options(before.listen), FarmCodec)
    {
        let is_as_requested =
            before.listen == setup.listen && requested.is_none_or(|requested| before.store_bytes == Some(requested));
        if is_as_requested {
            return Ok(before.store_bytes);
        }
        tracing::warn!("ending the server that an earlier farm left running at {}", before.listen);
        end_of_other(number, &uplink);
    }
    let folder = setup.store();
    let (used, disk) = (bytes_below(&folder), disk::space(&setup.folder));
    let limit = requested.or_else(|| disk.map(|disk| fitting_limit(used, disk)));
    if let (Some(requested), Some(DiskSpace { free, .. })) = (requested, disk)
        && requested > used + free
    {
        let free = bytes_said(used + free);
        tracing::warn!("--store-size is larger than the free space: the disk of {} has {free}", folder.display());
    }
    Ok(limit)
}

/// Returns the pin of the server's certificate.
pub(crate) fn pin(members: &Members) -> Result<Pin, Error> {
    let certificate = CertificateDer::from_pem_slice(members.certificate().0.as_bytes());
    let certificate = certificate.map_err(|error| {
        Error::failed(
            format!("the certificate of the farm is damaged: {error:?}"),
            "remove members.json from its folder; every machine must then join again",
        )
    })?;
    Ok(Pin::of(&certificate))
}

/// Returns a server and a connection to it: the one left running, if it is ours, or else a new one.
pub(crate) fn begin(
    program: &Path,
    config: &Path,
    setup: &Setup,
    options: &NatsOptions,
    system: Login,
) -> Result<(Server, NatsUplink<FarmCodec>), Error> {
    if let Some(number) = setup.running()
        && let Ok(uplink) = NatsUplink::connect(options, FarmCodec)
    {
        // Only our own server has this certificate.
        reload(setup, &NatsOptions { login: system, ..options.clone() })?;
        return Ok((Server::adopt(program, number), uplink));
    }
    // Check the port first: a server reports a taken port only in its log.
    drop(bind(Port::Server, setup.listen)?);
    let mut server = Server::start(program, config)?;
    for last in (0..BEGIN_TRIES).rev() {
        if server.ended()?.is_some() {
            return Err(Error::failed(
                format!("the NATS server ended at once: {}", server.last_words(&setup.log())),
                format!("see {}", setup.log().display()),
            ));
        }
        match NatsUplink::connect(options, FarmCodec) {
            Ok(uplink) => return Ok((server, uplink)),
            Err(source) if last == 0 => {
                let remedy = format!("see {}", setup.log().display());
                return Err(Error::Farm { source, remedy });
            }
            Err(_) => thread::sleep(BETWEEN_TRIES),
        }
    }
    Err(Error::failed("the NATS server does not answer", "see its log"))
}

/// Stops a server left running: two cannot use the same folder.
fn end_of_other(number: u32, uplink: &NatsUplink<FarmCodec>) {
    processes::end(number);
    for _ in 0..BEGIN_TRIES {
        if !uplink.is_connected() {
            return;
        }
        thread::sleep(BETWEEN_TRIES);
    }
}

/// Returns the farm's address for this machine.
fn reachable_here(listen: SocketAddr) -> String {
    let host = if listen.ip().is_unspecified() { IpAddr::from([127, 0, 0, 1]) } else { listen.ip() };
    SocketAddr::new(host, listen.port()).to_string()
}

/// Returns the farm's address for others: of the interface that routes outwards, or else of any external one.
fn reachable_there(listen: SocketAddr) -> String {
    let outwards = || {
        let socket = UdpSocket::bind("0.0.0.0:0").ok()?;
        // Connecting a UDP socket sends nothing; it only selects an interface.
        socket.connect("192.0.2.1:9").ok()?;
        socket.local_addr().ok().map(|address| address.ip())
    };
    let any = || {
        if_addrs::get_if_addrs()
            .ok()?
            .into_iter()
            .find(|interface| interface.ip().is_ipv4() && !interface.is_loopback())
    };
    let host = || outwards().or_else(|| any().map(|interface| interface.ip()));
    match listen.ip() {
        ip if ip.is_unspecified() => SocketAddr::new(host().unwrap_or(ip), listen.port()).to_string(),
        _ => listen.to_string(),
    }
}
