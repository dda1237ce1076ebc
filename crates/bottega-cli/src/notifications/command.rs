//! Notification by a command: JSON on its standard input, the facts in its environment.

use std::{
    io::Write,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use super::{args::SECRET_VARIABLE, message::Notification};

/// The maximum run time of a command.
const PATIENCE: Duration = Duration::from_secs(60);
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Runs a command line once. The facts are not part of the command line, so the shell does not interpret them.
pub(super) fn run(line: &str, notification: &Notification) -> Result<(), String> {
    let mut command = shell(line);
    for (name, value) in facts(notification) {
        command.env(format!("BOTTEGA_ON_{name}"), value);
    }
    command.env_remove(SECRET_VARIABLE).stdin(Stdio::piped()).stdout(Stdio::null());
    let mut child = command.spawn().map_err(|error| format!("it does not start: {error}"))?;
    if let Some(mut input) = child.stdin.take() {
        // A command that ignores its input has the environment. The JSON fits into the pipe.
        _ = input.write_all(notification.to_json().as_bytes());
    }
    let begun = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(()),
            Ok(Some(status)) => return Err(format!("it ended with {status}")),
            Ok(None) if begun.elapsed() > PATIENCE => {
                // The command may have ended just now.
                _ = child.kill();
                _ = child.wait();
                return Err(format!("it did not end in {} s", PATIENCE.as_secs()));
            }
            Ok(None) => thread::sleep(LOOK_EVERY),
            Err(error) => return Err(format!("cannot wait for it: {error}")),
        }
    }
}

fn shell(line: &str) -> Command {
    let (program, option) = if cfg!(windows) { ("cmd", "/C") } else { ("sh", "-c") };
    let mut command = Command::new(program);
    command.arg(option).arg(line);
    command
}

/// Returns the facts as environment variables; unknown facts have none.
fn facts(Notification { event, at, facts, .. }: &Notification) -> Vec<(&'static str, String)> {
    let text = |name, value: &str| Some((name, value.to_owned()));
    let known = [
        text("EVENT", event),
        text("AT", &at.to_string()),
        facts.job.map(|job| ("JOB", job.to_string())),
        facts.last_job.map(|job| ("LAST_JOB", job.to_string())),
        text("SCENE", &facts.scene),
        text("OUTPUT", &facts.output),
        text("FROM", &facts.from),
        text("ZONES_DONE", &facts.zones_done.to_string()),
        text("ZONES", &facts.zones.to_string()),
        text("SECONDS", &format!("{:.1}", facts.seconds)),
        facts.reason.as_deref().and_then(|reason| text("REASON", reason)),
    ];
    // A variable cannot contain a zero byte.
    known.into_iter().flatten().map(|(name, value)| (name, value.replace('\0', ""))).collect()
}
