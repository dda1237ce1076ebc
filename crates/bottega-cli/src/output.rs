//! Output to standard output and standard error.
//!
//! Output contains names of files, jobs, machines and materials that others chose, so characters that move the cursor, change
//! colours or reverse the writing direction are escaped. `println!` prints one line, newlines escaped; text of several lines is
//! printed by `print!`.
//!
//! `println!`, `print!` and `eprintln!` of this crate are the macros below. Unlike those of the standard library they never
//! panic: a full disk or a closed pipe loses output, but no image. The first failure of a stream is reported once on the other
//! one; later output to the failed stream is dropped. Clippy forbids the standard library's macros (`main.rs`) and stream handles
//! (`clippy.toml`) everywhere else.

use std::{
    borrow::Cow,
    env, fmt,
    io::{self, ErrorKind, IsTerminal, Write},
    process::{self, ExitCode},
    sync::{Mutex, OnceLock, PoisonError},
    thread,
    time::Duration,
};

use bottega_image::{printable, printable_lines};

macro_rules! print {
    ($($text:tt)*) => { $crate::output::print(format_args!($($text)*)) };
}

macro_rules! println {
    () => { $crate::output::print(format_args!("\n")) };
    ($($text:tt)*) => { $crate::output::print_line(format_args!($($text)*)) };
}

macro_rules! eprintln {
    ($($text:tt)*) => { $crate::output::print_error_line(format_args!($($text)*)) };
}

/// Exit code when the reader of the result has gone, as in shells: 128 plus SIGPIPE.
const NO_READER: u8 = 141;
/// Exit code when the result could not be written.
const LOST: u8 = 1;

/// The retry interval for a non-blocking stream.
const TRY_AGAIN_AFTER: Duration = Duration::from_millis(5);

/// The purpose of standard output in this run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// The result of the command. If it cannot be written the command still finishes, and its exit code is [`LOST`].
    Result,
    /// A continuous result: the command ends when its reader has gone.
    Stream,
    /// Messages for people; the result is a file or a service. Losing them does not change the exit code.
    Log,
    /// Events for programs, one per line; the result is a file. Losing them does not change the exit code.
    Events,
}

#[derive(Clone, Copy)]
enum Stream {
    Output,
    Error,
}

static PURPOSE: OnceLock<Purpose> = OnceLock::new();
/// The error after which nothing is written to standard output.
static OUTPUT_LOSS: OnceLock<ErrorKind> = OnceLock::new();
/// The error after which nothing is written to standard error.
static ERROR_LOSS: OnceLock<ErrorKind> = OnceLock::new();
/// Held while a line is written, so that lines of several threads do not mix.
static LINES: Mutex<()> = Mutex::new(());

impl Stream {
    fn name(self) -> &'static str {
        match self {
            Self::Output => "standard output",
            Self::Error => "standard error",
        }
    }

    fn loss(self) -> &'static OnceLock<ErrorKind> {
        match self {
            Self::Output => &OUTPUT_LOSS,
            Self::Error => &ERROR_LOSS,
        }
    }

    #[allow(clippy::disallowed_methods, reason = "the one place")]
    fn write(self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Output => write_whole(&mut io::stdout().lock(), bytes),
            Self::Error => write_whole(&mut io::stderr().lock(), bytes),
        }
    }
}

/// Returns true if the log may use colors: on a terminal, unless NO_COLOR is set (no-color.org).
#[allow(clippy::disallowed_methods, reason = "nothing is written")]
pub(crate) fn has_colors() -> bool {
    io::stderr().is_terminal() && env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Sets the purpose of standard output; the default is the result.
pub(crate) fn begin(purpose: Purpose) {
    // A run has one command, so this is set once.
    let _ = PURPOSE.set(purpose);
}

fn purpose() -> Purpose {
    PURPOSE.get().copied().unwrap_or(Purpose::Result)
}

/// Prints text to standard output.
pub(crate) fn print(text: fmt::Arguments<'_>) {
    deliver(Stream::Output, printable_lines(&text.to_string()).as_bytes());
}

/// Prints a line to standard output.
pub(crate) fn print_line(text: fmt::Arguments<'_>) {
    deliver(Stream::Output, line(text).as_bytes());
}

/// Prints a line to standard error.
pub(crate) fn print_error_line(text: fmt::Arguments<'_>) {
    deliver(Stream::Error, line(text).as_bytes());
}

fn line(text: fmt::Arguments<'_>) -> String {
    format!("{}\n", printable(&text.to_string()))
}

/// Prints an error formatted by [`report`](crate::error::report), which is already escaped and has its own colours.
pub(crate) fn print_report(report: &str) {
    deliver(Stream::Error, format!("{report}\n").as_bytes());
}

/// Prints clap's output: help and version to standard output, errors to standard error. Returns the exit code.
pub(crate) fn print_usage(usage: &clap::Error) -> ExitCode {
    let to = if usage.use_stderr() { Stream::Error } else { Stream::Output };
    // Clap repeats arguments, which may contain file names.
    if env::args_os().any(|argument| matches!(printable(&argument.to_string_lossy()), Cow::Owned(_))) {
        deliver(to, printable_lines(&usage.render().to_string()).as_bytes());
        return finish(ExitCode::from(usage.exit_code() as u8));
    }
    // Clap uses colours on a terminal.
    if let Err(error) = usage.print() {
        lose(to, &error);
    }
    finish(ExitCode::from(usage.exit_code() as u8))
}

/// The writer of the log.
pub(crate) struct LogWriter;

impl Write for LogWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // With colours, the subscriber escapes its input itself.
        match str::from_utf8(bytes) {
            Ok(text) if !has_colors() => deliver(Stream::Error, printable_lines(text).as_bytes()),
            _ => deliver(Stream::Error, bytes),
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Returns the exit code of the command, or that of a lost result if standard output could not be written.
#[allow(clippy::disallowed_methods, reason = "the one place")]
pub(crate) fn finish(code: ExitCode) -> ExitCode {
    if OUTPUT_LOSS.get().is_none()
        && let Err(error) = io::stdout().flush()
    {
        lose(Stream::Output, &error);
    }
    match OUTPUT_LOSS.get() {
        Some(&kind) if code == ExitCode::SUCCESS && matches!(purpose(), Purpose::Result | Purpose::Stream) => {
            ExitCode::from(exit_code(kind))
        }
        _ => code,
    }
}

fn exit_code(loss: ErrorKind) -> u8 {
    if loss == ErrorKind::BrokenPipe { NO_READER } else { LOST }
}

fn deliver(to: Stream, bytes: &[u8]) {
    if to.loss().get().is_some() {
        return;
    }
    let written = {
        let _lines = LINES.lock().unwrap_or_else(PoisonError::into_inner);
        to.write(bytes)
    };
    if let Err(error) = written {
        lose(to, &error);
    }
}

/// Stops writing to this stream, and reports the reason on the other one, unless the reader has gone.
fn lose(stream: Stream, error: &io::Error) {
    if stream.loss().set(error.kind()).is_err() {
        return;
    }
    if error.kind() != ErrorKind::BrokenPipe {
        let text = format!("warning: cannot write {} ({error}): its text is lost\n", stream.name());
        match stream {
            Stream::Output => deliver(Stream::Error, text.as_bytes()),
            // A reader of a result or of events must not get other lines.
            Stream::Error if purpose() == Purpose::Log => deliver(Stream::Output, text.as_bytes()),
            Stream::Error => {}
        }
    }
    if matches!((stream, purpose()), (Stream::Output, Purpose::Stream)) {
        process::exit(exit_code(error.kind()).into());
    }
}

/// Writes all bytes, and waits for a reader that is slow.
fn write_whole(to: &mut impl Write, mut bytes: &[u8]) -> io::Result<()> {
    loop {
        let step = if bytes.is_empty() { to.flush().map(|()| 0) } else { to.write(bytes) };
        match step {
            Ok(0) if bytes.is_empty() => return Ok(()),
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => bytes = &bytes[count..],
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(TRY_AGAIN_AFTER),
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A writer that takes a few bytes at a time and fails some calls, like a slow pipe.
    struct Slow {
        taken: Vec<u8>,
        answers: Vec<ErrorKind>,
    }

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if let Some(kind) = self.answers.pop() {
                return Err(kind.into());
            }
            let count = bytes.len().min(3);
            self.taken.extend(&bytes[..count]);
            Ok(count)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.answers.pop().map_or(Ok(()), |kind| Err(kind.into()))
        }
    }

    #[test]
    fn a_slow_reader_gets_all_and_a_full_disk_is_an_error() {
        let mut slow = Slow { taken: Vec::new(), answers: vec![ErrorKind::Interrupted, ErrorKind::WouldBlock] };
        write_whole(&mut slow, b"a line\n").expect("all of it");
        assert_eq!(slow.taken, b"a line\n");
        let mut full = Slow { taken: Vec::new(), answers: vec![ErrorKind::StorageFull, ErrorKind::WouldBlock] };
        assert_eq!(write_whole(&mut full, b"a line\n").map_err(|error| error.kind()), Err(ErrorKind::StorageFull));
    }

    #[test]
    fn a_closed_reader_and_a_full_disk_have_different_exit_codes() {
        assert_eq!((exit_code(ErrorKind::BrokenPipe), exit_code(ErrorKind::StorageFull)), (141, 1));
    }
}
