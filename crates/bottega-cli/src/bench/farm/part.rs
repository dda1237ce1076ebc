//! Some of the agents, in a process of their own.

use std::{
    io::{self, BufRead, BufReader, Read},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    sync::Arc,
    thread,
};

use bottega_farm::{JobError, JobSettings, Link, StopSwitch, assist};
use serde::{Deserialize, Serialize};

use super::{
    FarmBenchArgs,
    args::Share,
    idle_engine::{self, IdleEngine},
    watch::{AgentWatch, Wait},
    ways::Ways,
};
use crate::error::CliError;

/// What a process says when all its agents are linked.
const READY: &str = "ready";
/// The stack of a thread that waits.
const STACK_BYTES: usize = 256 << 10;

/// What a process has seen.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Told {
    pub(super) waits: Vec<Wait>,
    pub(super) answers: Vec<Wait>,
    pub(super) messages: u64,
    pub(super) bytes: u64,
}

/// Lives as these agents until the work is done or whoever started this process is gone.
pub(super) fn run(args: &FarmBenchArgs, share: Share) -> Result<(), CliError> {
    let ways = Ways::of(args)?;
    let settings = idle_engine::settings(args.zones);
    let links = (0..share.count).map(|i| ways.link(share.work, share.first + i)).collect::<Result<Vec<_>, _>>()?;
    println!("{READY}");
    let stops: Vec<StopSwitch> = links.iter().map(|_| StopSwitch::new()).collect();
    end_with_parent(stops.clone())?;
    let mut agents = Vec::new();
    for ((link, stop), agent) in links.into_iter().zip(stops).zip(share.first..) {
        let engine = IdleEngine::new(args.zone_time, agent).map_err(|error| no_thread(&error))?;
        let settings = settings.clone();
        let live = move || live(&settings, engine, &stop, &link);
        agents.push(thread::Builder::new().stack_size(STACK_BYTES).spawn(live).map_err(|error| no_thread(&error))?);
    }
    let mut told = Told::default();
    for agent in agents {
        let seen = agent.join().map_err(|_| CliError::failed("an agent ended in a panic", "report it"))?;
        let Told { waits, answers, messages, bytes } = seen.map_err(bottega::Error::Job)?;
        told.waits.extend(waits);
        told.answers.extend(answers);
        told.messages += messages;
        told.bytes += bytes;
    }
    println!("{}", serde_json::to_string(&told).unwrap_or_default());
    Ok(())
}

/// One agent, as a machine that has joined has it.
fn live(settings: &JobSettings, engine: IdleEngine, stop: &StopSwitch, link: &Link) -> Result<Told, JobError> {
    let watch = Arc::new(AgentWatch::default());
    assist(settings, Arc::new(engine), Arc::clone(&watch) as _, stop, link.clone())?;
    let traffic = link.uplink.traffic();
    let [waits, answers] = watch.take();
    Ok(Told {
        waits,
        answers,
        messages: traffic.messages_in + traffic.messages_out,
        bytes: traffic.bytes_in + traffic.bytes_out,
    })
}

/// Whoever started this process holds the other end of its input.
fn end_with_parent(stops: Vec<StopSwitch>) -> Result<(), CliError> {
    let watch = move || {
        _ = io::stdin().lock().read_to_end(&mut Vec::new());
        stops.iter().for_each(StopSwitch::request);
    };
    thread::Builder::new().spawn(watch).map(drop).map_err(|error| no_thread(&error))
}

fn no_thread(error: &io::Error) -> CliError {
    CliError::failed(format!("cannot start a thread: {error}"), "have fewer agents: --agents")
}

/// Such a process, as seen from the one that has started it.
pub(super) struct Part {
    child: Child,
    /// While it is open the process lives.
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Part {
    pub(super) fn start(args: &FarmBenchArgs, ways: &Ways, share: Share) -> Result<Self, CliError> {
        let wrong = |error: io::Error| {
            CliError::failed(format!("cannot start a process: {error}"), "have fewer processes: --processes")
        };
        let mut command = Command::new(std::env::current_exe().map_err(wrong)?);
        command.args(["bench", "farm", "--share", &share.to_string()]);
        command.args(["--zones", &args.zones.to_string()]);
        command.args(["--zone-time", &format!("{}s", args.zone_time.as_secs_f64())]);
        ways.tell(&mut command);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().map_err(wrong)?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let output = output.ok_or_else(|| wrong(io::Error::other("it has no output")))?;
        Ok(Self { child, input, output: BufReader::new(output) })
    }

    /// Waits until all its agents are linked.
    pub(super) fn until_ready(&mut self) -> Result<(), CliError> {
        (self.hear()?.trim() == READY).then_some(()).ok_or_else(ended)
    }

    /// What it has seen, now that the work is done. An agent that the Master has not come to know is let go by this too.
    pub(super) fn told(&mut self) -> Result<Told, CliError> {
        self.input = None;
        serde_json::from_str(&self.hear()?).map_err(|_| ended())
    }

    fn hear(&mut self) -> Result<String, CliError> {
        let mut line = String::new();
        self.output.read_line(&mut line).map_err(|_| ended())?;
        Ok(line)
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        // It may have ended by itself.
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

fn ended() -> CliError {
    CliError::failed("a process with agents ended before the work", "see what it said above")
}
