//! Processes that a measurement starts, each with some of its agents: they speak in lines, and end with the one that
//! started them.

use std::{
    env,
    io::{self, BufRead, BufReader, Read, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    thread,
};

use bottega_farm::StopSwitch;
use serde::de::DeserializeOwned;

use crate::error::Error;

/// What a process says when all its agents are linked.
const READY: &str = "ready";

/// Says something to the process with the Master. When that is gone, so is the work.
pub(crate) fn say(output: &mut dyn Write, line: &str) -> Result<(), Error> {
    output.write_all(format!("{line}\n").as_bytes()).and_then(|()| output.flush()).map_err(|_| Error::MasterGone)
}

/// Says that all agents of this process are linked.
pub(crate) fn say_ready(output: &mut dyn Write) -> Result<(), Error> {
    say(output, READY)
}

/// Whoever started this process holds the other end of its input.
pub(crate) fn end_with_parent(stops: Vec<StopSwitch>) -> Result<(), Error> {
    let watch = move || {
        _ = io::stdin().lock().read_to_end(&mut Vec::new());
        stops.iter().for_each(StopSwitch::request);
    };
    thread::Builder::new().spawn(watch).map(drop).map_err(Error::Thread)
}

/// This program, to be started once more.
pub(crate) fn this_program() -> Result<Command, Error> {
    env::current_exe().map(Command::new).map_err(Error::Process)
}

/// Such a process, as seen from the one that has started it.
pub(crate) struct PartProcess {
    child: Child,
    /// While it is open the process lives.
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl PartProcess {
    pub(crate) fn start(mut command: Command) -> Result<Self, Error> {
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().map_err(Error::Process)?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let output = output.ok_or_else(|| Error::Process(io::Error::other("it has no output")))?;
        Ok(Self { child, input, output: BufReader::new(output) })
    }

    /// Waits until all its agents are linked.
    pub(crate) fn until_ready(&mut self) -> Result<(), Error> {
        (self.hear()?.trim() == READY).then_some(()).ok_or(Error::PartEnded)
    }

    /// What it has seen, now that the work is done. An agent that the Master has not come to know is let go by this too.
    pub(crate) fn report<R: DeserializeOwned>(&mut self) -> Result<R, Error> {
        self.input = None;
        serde_json::from_str(&self.hear()?).map_err(|_| Error::PartEnded)
    }

    fn hear(&mut self) -> Result<String, Error> {
        let mut line = String::new();
        self.output.read_line(&mut line).map_err(|_| Error::PartEnded)?;
        Ok(line)
    }
}

impl Drop for PartProcess {
    fn drop(&mut self) {
        // It may have ended by itself.
        _ = self.child.kill();
        _ = self.child.wait();
    }
}
