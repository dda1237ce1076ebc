//! Child processes of a measurement, each with some of its agents: they exchange lines, and end with their parent.

use std::{
    env,
    io::{self, BufRead, BufReader, Read, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    thread,
};

use bottega_farm::StopSwitch;
use serde::de::DeserializeOwned;

use crate::error::Error;

/// The line of a process whose agents are all connected.
const READY: &str = "ready";

/// Writes a line to the process with the Master. An error means that the process is gone.
pub(crate) fn say(output: &mut dyn Write, line: &str) -> Result<(), Error> {
    output.write_all(format!("{line}\n").as_bytes()).and_then(|()| output.flush()).map_err(|_| Error::MasterGone)
}

/// Reports that all agents of this process are connected.
pub(crate) fn say_ready(output: &mut dyn Write) -> Result<(), Error> {
    say(output, READY)
}

/// Stops the work when the parent process closes this process's input.
pub(crate) fn end_with_parent(stops: Vec<StopSwitch>) -> Result<(), Error> {
    let watch = move || {
        _ = io::stdin().lock().read_to_end(&mut Vec::new());
        stops.iter().for_each(StopSwitch::request);
    };
    thread::Builder::new().spawn(watch).map(drop).map_err(Error::Thread)
}

/// Returns a command that starts this program again.
pub(crate) fn this_program() -> Result<Command, Error> {
    env::current_exe().map(Command::new).map_err(Error::Process)
}

/// A child process.
pub(crate) struct PartProcess {
    child: Child,
    /// The child's input; the child ends when it is closed.
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

    /// Waits until all agents of the child are connected.
    pub(crate) fn until_ready(&mut self) -> Result<(), Error> {
        (self.hear()?.trim() == READY).then_some(()).ok_or(Error::PartEnded)
    }

    /// Returns the child's report at the end of the work. Closing its input also ends agents that the Master never knew.
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
        // The child may have ended already.
        _ = self.child.kill();
        _ = self.child.wait();
    }
}
