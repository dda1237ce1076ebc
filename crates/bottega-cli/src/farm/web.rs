//! The page and the HTTP API of a farm, served by `bottega up`, or by `bottega web` in any other process.

use std::{
    net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener},
    process::ExitCode,
    sync::Arc,
    thread,
    time::Duration,
};

use bottega::StopSwitch;
use bottega_cluster::{
    Error, JobBoard,
    address::saved_address,
    deed_log::DeedLog,
    ports::{Port, bind, bind_near},
    web_secrets::WebSecrets,
};
use bottega_web::{Door, DoorOptions, LinkedFarm, ServeError};
use clap::Args;

use crate::{error::CliError, farm_args::FarmArgs, signals::stop_on_signal};

/// The default address; if its port is taken, one of the next free ports.
const LISTEN: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8080);
/// The number of further ports that are tried.
const PORTS_TRIED: u16 = 20;
/// The interval at which a request to stop is checked.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Options for serving the page.
#[derive(Debug, Args)]
pub(super) struct WebArgs {
    /// Address of the page and the HTTP API; beyond this machine only by TLS, with the farm's certificate. [default:
    /// 127.0.0.1:8080, or the next free port]
    #[arg(long, value_name = "ADDRESS:PORT")]
    web: Option<SocketAddr>,
    /// A further name by which browsers reach the page, such as that of a proxy: HOST or HOST:PORT. May be given several
    /// times.
    #[arg(long, value_name = "NAME")]
    web_name: Vec<String>,
}

/// Serve the page and the HTTP API of a farm, from any machine that may do everything in it.
#[derive(Debug, Args)]
#[command(
    after_help = "For example:\n  bottega web\n  bottega web --web 10.0.0.8:8443 --farm bottega://WORD@10.0.0.7:4222"
)]
pub(crate) struct WebCommandArgs {
    #[command(flatten)]
    web: WebArgs,
    #[command(flatten)]
    farm: FarmArgs,
}

impl WebArgs {
    /// Binds the port of the page.
    pub(super) fn bind(&self) -> Result<TcpListener, Error> {
        self.web.map_or_else(|| bind_near(Port::Page, LISTEN, PORTS_TRIED), |address| bind(Port::Page, address))
    }

    /// Serves the page of a farm until the process ends.
    pub(super) fn open(&self, listener: TcpListener, board: JobBoard, secrets: WebSecrets) -> Result<Door, ServeError> {
        let certificate = secrets.certificate.clone();
        let (names, log) = (self.web_name.clone(), Some(DeedLog::of_user()));
        let options = DoorOptions { listener, certificate, names, log };
        Door::open(Arc::new(LinkedFarm::new(board, secrets)), options)
    }
}

/// Formats the address of the page.
pub(super) fn door_said(door: &Door) -> String {
    format!(
        "See and steer the farm in a browser:\n\n  {}\n\nor, to look on only:\n\n  {}\n\n",
        door.steering_url(),
        door.seeing_url()
    )
}

pub(crate) fn run(args: &WebCommandArgs) -> Result<ExitCode, CliError> {
    let stop = StopSwitch::new();
    stop_on_signal(&stop)?;
    let secrets = WebSecrets::of_farm(&args.farm.address().map_or_else(saved_address, Ok)?)?;
    let listener = args.web.bind()?;
    let door = args.web.open(listener, args.farm.board()?, secrets)?;
    print!("{}", door_said(&door));
    while !stop.is_requested() {
        thread::sleep(LOOK_EVERY);
    }
    Ok(ExitCode::SUCCESS)
}
