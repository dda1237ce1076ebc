//! Timing of a farm of real processes: the overhead of the server, and the cost of killed processes.

use std::{
    fs::{self, File},
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, ensure};
use clap::Args;
use serde_json::Value;
use tempfile::TempDir;

use crate::run_head::head;

/// The number of machines, with one thread each.
const MACHINES: usize = 2;
const PATIENCE: Duration = Duration::from_secs(1800);
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Options of `cargo xtask farm`.
#[derive(Args)]
pub(crate) struct FarmArgs {
    /// The program.
    #[arg(long, default_value = "target/release/bottega")]
    program: PathBuf,
    /// The NATS server; default: the one that `bottega up` finds.
    #[arg(long)]
    server: Option<PathBuf>,
    /// The scene.
    #[arg(long, default_value = "scenes/goblets.glb")]
    scene: PathBuf,
    /// More words for `bottega render`, such as `--allow-outside`.
    #[arg(
        long,
        value_delimiter = ' ',
        allow_hyphen_values = true,
        default_value = "--size 640x480 --set work.zones=96"
    )]
    render: Vec<String>,
    /// Samples per pixel: pictures should take half a minute.
    #[arg(long, default_value_t = 512)]
    spp: u32,
    /// Seconds from one kill to the next.
    #[arg(long, default_value_t = 5.0)]
    every: f64,
    /// Number of pairs of measurements: over a server, and without.
    #[arg(long, default_value_t = 2)]
    repeat: u32,
}

/// Measures, and prints the results.
pub(crate) fn farm(args: &FarmArgs) -> Result<()> {
    let mut farm = Farm::start(args)?;
    println!("{}", head(&farm.program)?);
    let mut machines = Vec::new();
    for _ in 0..MACHINES {
        machines.push(farm.join()?);
    }
    idle(&machines[0])?;
    overhead(&mut farm, &machines)?;
    let quiet = farm.job("quiet.exr", &mut machines, |_, _, _, _| Ok(()))?;
    println!("{MACHINES} machines of one thread, nobody killed: {:.1} s", quiet.as_secs_f64());
    let every = Duration::from_secs_f64(args.every);
    let (mut next, mut turn) = (Instant::now() + every, 0);
    let chaos = farm.job("chaos.exr", &mut machines, |farm, machines, number, leader| {
        if Instant::now() >= next {
            farm.kill(turn, number, leader, machines)?;
            turn += 1;
            next = Instant::now() + every;
        }
        Ok(())
    })?;
    let ratio = chaos.as_secs_f64() / quiet.as_secs_f64();
    println!("{turn} killed, one every {:.0} s: {:.1} s, {ratio:.2} times as long", args.every, chaos.as_secs_f64());
    farm.same("quiet.exr", "chaos.exr")
}

/// A process that is killed when this is dropped.
struct Process {
    child: Child,
    log: PathBuf,
}

impl Drop for Process {
    fn drop(&mut self) {
        // The process may have ended already.
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

impl Process {
    fn said(&self) -> String {
        fs::read_to_string(&self.log).unwrap_or_default()
    }

    fn until_says(&self, words: &str) -> Result<()> {
        let begun = Instant::now();
        while !self.said().contains(words) {
            ensure!(begun.elapsed() < Duration::from_secs(30), "{} does not say `{words}`", self.log.display());
            thread::sleep(LOOK_EVERY);
        }
        Ok(())
    }

    /// Returns the process's name in the farm.
    fn name(&self) -> String {
        let said = self.said();
        said.split(" as ").nth(1).and_then(|rest| rest.split(';').next()).unwrap_or_default().to_owned()
    }

    fn signal(&self, what: &str) -> Result<()> {
        let sent = Command::new("kill").args([what, &self.child.id().to_string()]).status()?;
        ensure!(sent.success(), "kill {what} failed");
        Ok(())
    }
}

struct Farm<'a> {
    args: &'a FarmArgs,
    program: PathBuf,
    folder: TempDir,
    up: Process,
    jobs: u32,
    joined: u32,
}

impl Drop for Farm<'_> {
    fn drop(&mut self) {
        // `bottega up` stops its server when it gets a request to end.
        if self.up.signal("-TERM").is_ok() {
            _ = self.up.child.wait();
        }
    }
}

impl<'a> Farm<'a> {
    fn start(args: &'a FarmArgs) -> Result<Self> {
        let program = fs::canonicalize(&args.program)
            .with_context(|| format!("{}: build it first (cargo build --release)", args.program.display()))?;
        let folder = tempfile::tempdir()?;
        let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
        let mut words = vec!["up".to_owned(), "--listen".to_owned(), format!("127.0.0.1:{port}")];
        if let Some(server) = &args.server {
            words.extend(["--server".to_owned(), server.display().to_string()]);
        }
        let up = spawn(&program, folder.path(), &words, "up.log")?;
        up.until_says("bottega join")?;
        Ok(Self { args, program, folder, up, jobs: 0, joined: 0 })
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn join(&mut self) -> Result<Process> {
        self.joined += 1;
        let cache = self.path("cache").display().to_string();
        let words = ["join", "--threads", "1", "--cache", &cache].map(str::to_owned);
        let process = spawn(&self.program, self.folder.path(), &words, &format!("join-{}.log", self.joined))?;
        process.until_says("waiting for work")?;
        Ok(process)
    }

    /// Returns the arguments that submit the job.
    fn words(&self, output: &str, more: &[&str]) -> Vec<String> {
        let scene = self.args.scene.display().to_string();
        let (output, spp) = (self.path(output).display().to_string(), format!("--spp={}", self.args.spp));
        let words = ["render", &scene, "-o", &output, &spp, "--quiet"].map(str::to_owned);
        words.into_iter().chain(self.args.render.clone()).chain(more.iter().map(|&it| it.to_owned())).collect()
    }

    fn run(&self, words: &[String]) -> Result<Duration> {
        let begun = Instant::now();
        let status = command(&self.program, self.folder.path(), words).status()?;
        ensure!(status.success(), "bottega {} failed", words.join(" "));
        Ok(begun.elapsed())
    }

    /// Measures the time from submission to the finished image, painted by the machines that have joined.
    fn job(
        &mut self,
        output: &str,
        machines: &mut [Process],
        mut meanwhile: impl FnMut(&mut Self, &mut [Process], u32, &str) -> Result<()>,
    ) -> Result<Duration> {
        let begun = Instant::now();
        self.run(&self.words(output, &["--farm", "--detach"]))?;
        self.jobs += 1;
        let number = self.jobs;
        loop {
            let show = ["jobs", "show", &number.to_string(), "--json"].map(str::to_owned);
            let shown = command(&self.program, self.folder.path(), &show).stderr(Stdio::null()).output()?;
            let job: Value = serde_json::from_slice(&shown.stdout).unwrap_or_default();
            if job["state"] == "done" {
                break;
            }
            ensure!(begun.elapsed() < PATIENCE, "job {number} does not end");
            meanwhile(self, machines, number, job["leader"].as_str().unwrap_or_default())?;
            thread::sleep(LOOK_EVERY);
        }
        let took = begun.elapsed();
        self.run(&["jobs", "fetch", &number.to_string()].map(str::to_owned))?;
        Ok(took)
    }

    /// Kills the leader, the server, or another machine in turn; a killed machine is started again.
    fn kill(&mut self, turn: u32, number: u32, leader: &str, machines: &mut [Process]) -> Result<()> {
        let leads = machines.iter().position(|machine| machine.name() == leader);
        match turn % 3 {
            1 => {
                let number = fs::read_to_string(self.path("bottega/server/server.pid"))?;
                ensure!(Command::new("kill").args(["-KILL", number.trim()]).status()?.success(), "no server to kill");
            }
            who => {
                let leads = leads.unwrap_or(0);
                let victim = if who == 0 { leads } else { (leads + 1) % machines.len() };
                let what = if who == 0 { "the one who leads" } else { "a machine" };
                println!("  job {number}: {what} is killed");
                machines[victim].child.kill()?;
                machines[victim].child.wait()?;
                machines[victim] = self.join()?;
            }
        }
        Ok(())
    }

    fn same(&self, one: &str, other: &str) -> Result<()> {
        let [one, other] = [one, other].map(|name| self.path(name).display().to_string());
        let words = ["diff", &one, &other, "--json"].map(str::to_owned);
        let said = command(&self.program, self.folder.path(), &words).output()?.stdout;
        let said: Value = serde_json::from_slice(&said).context("bottega diff says nothing")?;
        ensure!(said["rmse"] == 0.0, "the pictures differ: {said}");
        println!("  the same picture");
        Ok(())
    }
}

fn command(program: &Path, state: &Path, words: &[String]) -> Command {
    let mut command = Command::new(program);
    command.args(words).env("XDG_STATE_HOME", state).env_remove("BOTTEGA_FARM").stdin(Stdio::null());
    command
}

fn spawn(program: &Path, state: &Path, words: &[String], log: &str) -> Result<Process> {
    let log = state.join(log);
    let file = File::create(&log)?;
    let child = command(program, state, words).stdout(file.try_clone()?).stderr(file).spawn()?;
    Ok(Process { child, log })
}

/// Measures the load of a machine that waits for work (Linux).
fn idle(machine: &Process) -> Result<()> {
    const SECONDS: u64 = 20;
    let ticks = || -> Option<f64> {
        let stat = fs::read_to_string(format!("/proc/{}/stat", machine.child.id())).ok()?;
        // User and system time in hundredths of a second, after the name in parentheses.
        let numbers: Vec<f64> =
            stat.rsplit(')').next()?.split_whitespace().map(|it| it.parse().unwrap_or(0.0)).collect();
        Some(numbers.get(11)? + numbers.get(12)?)
    };
    let Some(before) = ticks() else { return Ok(()) };
    thread::sleep(Duration::from_secs(SECONDS));
    let after = ticks().context("the machine has gone")?;
    let status = fs::read_to_string(format!("/proc/{}/status", machine.child.id()))?;
    let memory = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap_or_default().trim();
    println!("a machine that waits: {:.2} % of a processor, {memory}", (after - before) / SECONDS as f64);
    Ok(())
}

/// Renders the same image by two agents of one process, by the same over a server, and by two processes.
fn overhead(farm: &mut Farm<'_>, machines: &[Process]) -> Result<()> {
    for _ in 0..farm.args.repeat {
        machines.iter().try_for_each(|machine| machine.signal("-STOP"))?;
        let alone = farm.run(&farm.words("alone.exr", &["--agents=2", "--threads=2"]))?.as_secs_f64();
        let over = farm.run(&farm.words("over.exr", &["--agents=2", "--threads=2", "--farm"]))?.as_secs_f64();
        machines[0].signal("-CONT")?;
        // Wait until it has joined again.
        thread::sleep(Duration::from_secs(2));
        let two = farm.run(&farm.words("two.exr", &["--agents=1", "--threads=1", "--farm"]))?.as_secs_f64();
        farm.jobs += 2;
        machines[1].signal("-CONT")?;
        let more = |time: f64| 100.0 * (time / alone - 1.0);
        println!("two agents of one process {alone:.2} s; over a server {over:.2} s, {:+.1} %;", more(over));
        println!("of two processes {two:.2} s, {:+.1} %", more(two));
        farm.same("alone.exr", "over.exr")?;
        farm.same("alone.exr", "two.exr")?;
    }
    Ok(())
}
