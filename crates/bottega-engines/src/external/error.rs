//! The errors of external engines.

use std::{io, path::PathBuf};

use bottega_image::{ImageError, Rect};

/// The reason why an engine could not be used, or rendered no picture.
#[derive(Debug, thiserror::Error)]
pub enum EngineFault {
    /// The engine is not installed.
    #[error("{title} is not installed here ({tried}); {install}")]
    NotFound {
        /// The display name of the engine.
        title: String,
        /// The places searched.
        tried: String,
        /// Instructions to install it.
        install: String,
    },
    /// The installed version is not supported.
    #[error("{title} is installed in version {found}, but {wanted} is needed; {install}")]
    Version {
        /// The display name of the engine.
        title: String,
        /// The installed version.
        found: String,
        /// The supported versions.
        wanted: String,
        /// Instructions to install it.
        install: String,
    },
    /// A script of its manifest is missing or cannot be copied.
    #[error("cannot install a file of its manifest: `{}`", .path.display())]
    Files {
        /// The path of the file.
        path: PathBuf,
        /// The error of the file system.
        source: io::Error,
    },
    /// The scratch folder could not be created.
    #[error("there is no folder for its temporary files")]
    Scratch(#[source] io::Error),
    /// The engine, or a thread for it, could not be started.
    #[error("`{program}` cannot be started")]
    Start {
        /// The program, as on the command line; or `a thread`.
        program: String,
        /// The error of the system.
        source: io::Error,
    },
    /// The engine refuses the scene or a zone, with its own message.
    #[error("it says: {reason}")]
    Refused {
        /// The message of the engine.
        reason: String,
        /// True if the process must be restarted.
        fatal: bool,
    },
    /// The engine exited by itself.
    #[error("it ended by itself: {status}{}", last_words(.log))]
    Ended {
        /// The exit status of the process, for display.
        status: String,
        /// The end of the worker's log.
        log: String,
    },
    /// The engine exceeded a time limit.
    #[error("it was ended after {seconds:.0} s without {what}{}", last_words(.log))]
    TimeOut {
        /// The limit in seconds.
        seconds: f64,
        /// The missing answer, for display.
        what: &'static str,
        /// The end of the worker's log.
        log: String,
    },
    /// The engine wrote too much output.
    #[error("it was ended: it wrote more than {kib} KiB to {what}")]
    Flood {
        /// The limit in KiB.
        kib: u64,
        /// The output with the limit, for display.
        what: &'static str,
    },
    /// The engine exceeded its memory limit.
    #[error("it was ended: it took more than {mib} MiB of memory")]
    Memory {
        /// The limit in MiB.
        mib: u64,
    },
    /// The engine started too many processes.
    #[error("it was ended: it had more than {most} processes")]
    Processes {
        /// The largest number of processes that the engine may have.
        most: usize,
    },
    /// The engine's worker violates the protocol.
    #[error("its worker violates the protocol: {problem}")]
    Protocol {
        /// A description of the violation.
        problem: String,
    },
    /// The engine wrote no picture.
    #[error("it wrote no picture{}", last_words(.log))]
    NoPicture {
        /// The end of the worker's log.
        log: String,
    },
    /// The engine's picture cannot be read.
    #[error("the picture that it wrote cannot be read")]
    Picture(#[source] ImageError),
    /// The engine's picture has the wrong size.
    #[error("its picture has {found:?} pixels where {wanted:?} are needed for the window {window}")]
    Size {
        /// Width and height of the picture.
        found: (u32, u32),
        /// The expected width and height.
        wanted: (u32, u32),
        /// The window that was requested.
        window: Rect,
    },
    /// More than 1 % of the pixels of the engine's picture have non-finite values.
    #[error("{count} values of its picture are not finite numbers")]
    NotFinite {
        /// The number of such pixels in the window.
        count: usize,
    },
    /// A layer that it announced is missing.
    #[error("its picture lacks the channel `{channel}`, which it announced when it opened the scene")]
    Layer {
        /// The name of the channel.
        channel: String,
    },
    /// The layers that it announced are invalid.
    #[error("cannot store the layers that it announces")]
    Layers(#[source] bottega_image::LayersError),
    /// The engine's picture is all black, unexpectedly.
    #[error("its picture of the window {window} is all black, but the whole picture is not")]
    Black {
        /// The window that was requested.
        window: Rect,
    },
    /// The task was cancelled.
    #[error("it is not needed any more")]
    Cancelled,
    /// The engine is quarantined: it failed too often on this machine.
    #[error("it is in quarantine: it failed {failures} times in a row, the last time: {last}{}", remedy(.name))]
    Quarantined {
        /// The number of failures in a row.
        failures: u32,
        /// The last failure.
        last: String,
        /// The name of the engine, if the quarantine is stored for later processes.
        name: Option<String>,
    },
}

impl EngineFault {
    /// Returns true if the process must be restarted.
    pub(super) fn ends_process(&self) -> bool {
        match self {
            Self::Refused { fatal, .. } => *fatal,
            Self::NoPicture { .. }
            | Self::Picture(_)
            | Self::Size { .. }
            | Self::NotFinite { .. }
            | Self::Layer { .. }
            | Self::Black { .. } => false,
            _ => true,
        }
    }

    /// Returns the error and its chain of causes, separated by colons; several lines if it contains the end of a log.
    pub fn report(&self) -> String {
        use std::error::Error;
        let mut text = self.to_string();
        let mut source = self.source();
        while let Some(error) = source {
            text += &format!(": {error}");
            source = error.source();
        }
        text
    }
}

fn remedy(name: &Option<String>) -> String {
    name.as_ref().map_or_else(String::new, |name| {
        format!("; install another version of it, or release it by `bottega engines release {name}`")
    })
}

fn last_words(log: &str) -> String {
    if log.is_empty() { String::new() } else { format!("; its last words:\n{log}") }
}
