//! `bottega platform trace`: prints messages as they pass a platform's transport.

use std::{
    collections::BTreeMap,
    fs,
    io::{BufRead, BufReader},
    process::ExitCode,
    time::{Duration, Instant},
};

use bottega_agents::driver::http::server::TRACE_PATH;

use super::{args::TraceArgs, diagram, passed::PassedMessage, peer::Peer};
use crate::error::CliError;

/// The maximum number of messages in a diagram; older ones are dropped.
const DIAGRAM_MAX: usize = 2000;
/// The interval between writes of the diagram.
const DRAW_EVERY: Duration = Duration::from_secs(1);
/// The maximum wait for a message before other events are checked.
const LOOK_EVERY: Duration = Duration::from_millis(200);

pub(super) fn run(args: &TraceArgs) -> Result<ExitCode, CliError> {
    let at = args.at.clone().unwrap_or_else(Peer::here);
    let failed = |what: String| {
        CliError::failed(
            format!("cannot watch {}: {what}", at.url),
            "only a platform of Bottega on this machine can be watched",
        )
    };
    let stream = at.get(Some(TRACE_PATH)).map_err(|error| failed(error.to_string()))?;
    stream.set_read_timeout(Some(LOOK_EVERY)).map_err(|error| failed(error.to_string()))?;
    let mut lines = Lines { reader: BufReader::new(stream), part: Vec::new() };
    let mut in_head = true;
    let mut watch = Watch { args, numbers: BTreeMap::new(), kept: Vec::new(), drawn: None, count: 0 };
    loop {
        match lines.next().map_err(|error| failed(error.to_string()))? {
            Next::End => break,
            Next::Nothing => {}
            Next::Line(line) if in_head => {
                if line.starts_with("HTTP/1.1 ") && !line.starts_with("HTTP/1.1 200") {
                    return Err(failed(line));
                }
                in_head = !line.is_empty();
                if !in_head && !args.json {
                    println!("watching {}; Ctrl-C ends it", at.url);
                }
            }
            Next::Line(line) => watch.take(&line),
        }
        watch.draw(false)?;
        if args.count.is_some_and(|count| watch.count >= count) {
            break;
        }
    }
    watch.draw(true)?;
    Ok(ExitCode::SUCCESS)
}

struct Watch<'a> {
    args: &'a TraceArgs,
    /// Conversations by name, numbered in order of appearance.
    numbers: BTreeMap<String, usize>,
    kept: Vec<PassedMessage>,
    /// The time of the last diagram, and the number of messages at that time.
    drawn: Option<(Instant, u64)>,
    count: u64,
}

impl Watch<'_> {
    fn take(&mut self, line: &str) {
        let Ok(passed) = serde_json::from_str::<PassedMessage>(line) else {
            // The line is a message of the platform itself.
            eprintln!("{line}");
            return;
        };
        if self.args.conversation.as_ref().is_some_and(|wanted| !passed.conversation.contains(wanted)) {
            return;
        }
        self.count += 1;
        if self.args.json {
            println!("{line}");
        } else {
            let next = self.numbers.len() + 1;
            let number = *self.numbers.entry(passed.conversation.clone()).or_insert(next);
            println!("{}", diagram::row(&passed, number));
        }
        if self.args.output.is_some() {
            if self.kept.len() == DIAGRAM_MAX {
                self.kept.remove(0);
            }
            self.kept.push(passed);
        }
    }

    fn draw(&mut self, last: bool) -> Result<(), CliError> {
        let Some(path) = &self.args.output else { return Ok(()) };
        let due = self.drawn.is_none_or(|(at, count)| (last || at.elapsed() >= DRAW_EVERY) && count != self.count);
        if due {
            let written = fs::write(path, diagram::svg(&self.kept));
            written.map_err(|source| CliError::write(path.clone(), source))?;
            self.drawn = Some((Instant::now(), self.count));
        }
        Ok(())
    }
}

enum Next {
    Line(String),
    Nothing,
    End,
}

/// A line reader for a connection with a read timeout.
struct Lines<R> {
    reader: R,
    part: Vec<u8>,
}

impl<R: BufRead> Lines<R> {
    fn next(&mut self) -> std::io::Result<Next> {
        match self.reader.read_until(b'\n', &mut self.part) {
            Ok(0) => Ok(Next::End),
            Ok(_) if self.part.ends_with(b"\n") => {
                let line = String::from_utf8_lossy(&self.part).trim_end().to_owned();
                self.part.clear();
                Ok(Next::Line(line))
            }
            Ok(_) => Ok(Next::End),
            Err(error) if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {
                Ok(Next::Nothing)
            }
            Err(error) => Err(error),
        }
    }
}
