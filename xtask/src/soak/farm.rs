//! The farm of a soak test: `bottega up` with its server, machines and guests as real processes, each of which may be killed.

use std::{
    fs::{self, File},
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};
use tempfile::TempDir;

use super::doors::{Api, CommandLine};

/// The timeout for a process to become ready.
const PATIENCE: Duration = Duration::from_secs(60);
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// A process that is killed when this is dropped.
pub(super) struct FarmProcess {
    child: Child,
    log: PathBuf,
    /// The name in the farm.
    pub(super) name: String,
}

impl FarmProcess {
    fn said(&self) -> String {
        fs::read_to_string(&self.log).unwrap_or_default()
    }

    fn until_says(&mut self, words: &str) -> Result<()> {
        let begun = Instant::now();
        while !self.said().contains(words) {
            let ended = self.child.try_wait()?;
            ensure!(ended.is_none(), "{} ended ({ended:?}): {}", self.log.display(), self.said());
            ensure!(begun.elapsed() < PATIENCE, "{} does not say `{words}`", self.log.display());
            thread::sleep(LOOK_EVERY);
        }
        Ok(())
    }

    pub(super) fn kill(&mut self) {
        // The process may have ended already.
        _ = self.child.kill();
        _ = self.child.wait();
    }

    /// Asks the process to end, and waits for it.
    pub(super) fn end(&mut self) -> Result<()> {
        signal("-TERM", self.child.id())?;
        let begun = Instant::now();
        while self.child.try_wait()?.is_none() {
            ensure!(begun.elapsed() < PATIENCE, "{} does not end", self.log.display());
            thread::sleep(LOOK_EVERY);
        }
        Ok(())
    }
}

impl Drop for FarmProcess {
    fn drop(&mut self) {
        self.kill();
    }
}

fn signal(what: &str, process: u32) -> Result<()> {
    let line = format!("kill {what} {process}");
    let sent = Command::new("sh").args(["-c", &line]).stderr(Stdio::null()).status()?;
    ensure!(sent.success(), "kill {what} {process} failed");
    Ok(())
}

/// A farm on this machine, with its own state.
pub(super) struct SoakFarm {
    pub(super) cli: CommandLine,
    folder: TempDir,
    server: Option<PathBuf>,
    port: u16,
    web: u16,
    up: Option<FarmProcess>,
    pub(super) machines: Vec<FarmProcess>,
    pub(super) guests: Vec<FarmProcess>,
    started: u32,
}

impl SoakFarm {
    pub(super) fn start(program: &Path, server: Option<&Path>) -> Result<Self> {
        let program = fs::canonicalize(program)
            .with_context(|| format!("{}: build it first (cargo build -p bottega-cli)", program.display()))?;
        let folder = tempfile::tempdir()?;
        let cli = CommandLine { program, state: folder.path().join("state") };
        let [port, web] = [free_port()?, free_port()?];
        let server = server.map(Path::to_owned);
        let (machines, guests) = (Vec::new(), Vec::new());
        let mut farm = Self { cli, folder, server, port, web, up: None, machines, guests, started: 0 };
        farm.up()?;
        Ok(farm)
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn spawn(&mut self, what: &str, words: &[&str], until: &str) -> Result<FarmProcess> {
        self.started += 1;
        let log = self.path(&format!("{what}-{}.log", self.started));
        let file = File::create(&log)?;
        let child = self.cli.command(words).stdout(file.try_clone()?).stderr(file).spawn()?;
        let mut process = FarmProcess { child, log, name: String::new() };
        process.until_says(until)?;
        let said = process.said();
        let name = said.split_once(" as ").and_then(|(_, rest)| rest.split(';').next());
        process.name = name.unwrap_or_default().to_owned();
        Ok(process)
    }

    /// Starts `bottega up`, which continues with an existing server.
    pub(super) fn up(&mut self) -> Result<()> {
        let (listen, web) = (format!("127.0.0.1:{}", self.port), format!("127.0.0.1:{}", self.web));
        let mut words = vec!["up", "--listen", &listen, "--web", &web, "--hidden"];
        let server = self.server.as_ref().map(|server| server.display().to_string());
        words.extend(server.iter().flat_map(|server| ["--server", server]));
        self.up = Some(self.spawn("up", &words, "to look on only")?);
        Ok(())
    }

    pub(super) fn kill_up(&mut self) {
        self.up = None;
    }

    /// Kills the server, as in a power failure.
    pub(super) fn kill_server(&self) -> Result<()> {
        let number = fs::read_to_string(self.path("state/bottega/server/server.pid"))?;
        signal("-KILL", number.trim().parse()?)
    }

    fn said_by_up(&self) -> String {
        self.up.as_ref().map(FarmProcess::said).unwrap_or_default()
    }

    /// Returns the HTTP interface with a token that can steer, and the lines that let a machine and a guest join.
    pub(super) fn api(&self) -> Result<Api> {
        let said = self.said_by_up();
        let door = said.lines().find_map(|line| line.trim().strip_prefix("http://")?.split_once("/?token="));
        let (at, token) = door.context("`bottega up` printed no address")?;
        Ok(Api { at: at.to_owned(), token: token.to_owned() })
    }

    pub(super) fn lines(&self) -> Result<[String; 2]> {
        let said = self.said_by_up();
        let mut lines = said.lines().filter_map(|line| line.trim().strip_prefix("bottega join "));
        let mut next = || lines.next().map(str::to_owned).context("`bottega up` printed no line to join by");
        Ok([next()?, next()?])
    }

    fn join(&mut self, what: &str, line: Option<&str>) -> Result<FarmProcess> {
        let cache = self.path(&format!("cache-{what}")).display().to_string();
        let mut words = vec!["join", "--threads", "1", "--cache", &cache];
        words.extend(line);
        self.spawn(what, &words, "waiting for work")
    }

    pub(super) fn join_machine(&mut self) -> Result<()> {
        let machine = self.join("machine", None)?;
        self.machines.push(machine);
        Ok(())
    }

    pub(super) fn join_guest(&mut self) -> Result<()> {
        let [_, line] = self.lines()?;
        let guest = self.join("guest", Some(&line))?;
        self.guests.push(guest);
        Ok(())
    }

    /// Returns the last lines of output of each process, for debugging.
    pub(super) fn logs(&self) -> String {
        let files = fs::read_dir(self.folder.path()).into_iter().flatten().flatten();
        let logs = files.filter(|file| file.path().extension().is_some_and(|it| it == "log"));
        let last = |text: String| {
            text.lines().rev().take(12).collect::<Vec<_>>().into_iter().rev().collect::<Vec<_>>().join("\n")
        };
        logs.map(|file| {
            let said = fs::read_to_string(file.path()).unwrap_or_default();
            format!("--- {}\n{}\n", file.file_name().to_string_lossy(), last(said))
        })
        .collect()
    }
}

impl Drop for SoakFarm {
    fn drop(&mut self) {
        self.machines.clear();
        self.guests.clear();
        self.up = None;
        // A killed `bottega up` leaves its server running.
        _ = self.kill_server();
    }
}

fn free_port() -> Result<u16> {
    Ok(TcpListener::bind("127.0.0.1:0")?.local_addr()?.port())
}
