//! The errors of other people's engines.

use std::{io, path::PathBuf};

use bottega_image::{ImageError, Rect};

/// Why an engine could not be used, or gave no picture.
#[derive(Debug, thiserror::Error)]
pub enum EngineFault {
    /// It is not here.
    #[error("{title} is not installed here ({tried}); {install}")]
    NotFound {
        /// What people call it.
        title: String,
        /// What was tried.
        tried: String,
        /// How it is installed.
        install: String,
    },
    /// It is here in a version that is not known to work.
    #[error("{title} is here as version {found}, and {wanted} is needed; {install}")]
    Version {
        /// What people call it.
        title: String,
        /// What is here.
        found: String,
        /// What would do.
        wanted: String,
        /// How it is installed.
        install: String,
    },
    /// A script of its manifest is missing.
    #[error("a file of its manifest cannot be put in place: `{}`", .path.display())]
    Files {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// No scratch folder.
    #[error("there is no folder for its temporary files")]
    Scratch(#[source] io::Error),
    /// It could not be started.
    #[error("`{program}` cannot be started")]
    Start {
        /// The program.
        program: String,
        /// Why.
        source: io::Error,
    },
    /// It refuses the scene, or a zone: in its own words.
    #[error("it says: {reason}")]
    Refused {
        /// What it said.
        reason: String,
        /// Whether it is of no use any more.
        fatal: bool,
    },
    /// It ended.
    #[error("it ended by itself: {status}{}", last_words(.log))]
    Ended {
        /// How.
        status: String,
        /// The end of its log.
        log: String,
    },
    /// It took too long.
    #[error("it was ended after {seconds:.0} s without {what}{}", last_words(.log))]
    TimeOut {
        /// How long it had.
        seconds: f64,
        /// What was waited for.
        what: &'static str,
        /// The end of its log.
        log: String,
    },
    /// It says more than it may.
    #[error("it was ended: it wrote more than {kib} KiB to {what}")]
    Flood {
        /// How much it may write.
        kib: u64,
        /// Whereto.
        what: &'static str,
    },
    /// It takes more memory than it may.
    #[error("it was ended: it took more than {mib} MiB of memory")]
    Memory {
        /// How much it may take.
        mib: u64,
    },
    /// It starts more processes than it may.
    #[error("it was ended: it had more than {most} processes")]
    Processes {
        /// How many it may.
        most: usize,
    },
    /// It does not keep to the protocol.
    #[error("its worker does not keep to the protocol: {problem}")]
    Protocol {
        /// What it did.
        problem: String,
    },
    /// It wrote no picture.
    #[error("it wrote no picture{}", last_words(.log))]
    NoPicture {
        /// The end of its log.
        log: String,
    },
    /// What it wrote cannot be read.
    #[error("the picture that it wrote cannot be read")]
    Picture(#[source] ImageError),
    /// The picture does not have the size that it should have.
    #[error("its picture has {found:?} pixels where {wanted:?} are needed for the window {window}")]
    Size {
        /// Width and height of the picture.
        found: (u32, u32),
        /// Width and height that it should have.
        wanted: (u32, u32),
        /// The window.
        window: Rect,
    },
    /// The picture holds values that are no numbers.
    #[error("{count} values of its picture are no finite numbers")]
    NotFinite {
        /// How many.
        count: usize,
    },
    /// A layer that it announced is not there.
    #[error("its picture lacks the channel `{channel}`, which it announced when it opened the scene")]
    Layer {
        /// The channel.
        channel: String,
    },
    /// Layers that no picture can have.
    #[error("the layers that it announces cannot be kept")]
    Layers(#[source] bottega_image::LayersError),
    /// Nothing but black.
    #[error("its picture of the window {window} is all black, and the whole picture is not there")]
    Black {
        /// The window.
        window: Rect,
    },
    /// Whoever asked does not want it any more.
    #[error("nobody wants it any more")]
    Cancelled,
    /// It failed too often on this machine.
    #[error("it is not used here any more: it failed {failures} times in a row, the last time so: {last}{}", remedy(.name))]
    Quarantined {
        /// How often.
        failures: u32,
        /// The last failure.
        last: String,
        /// Its name, where later processes know of it.
        name: Option<String>,
    },
}

impl EngineFault {
    /// Whether the process is of no use any more.
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

    /// With all that it is due to, in one line.
    pub fn told(&self) -> String {
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
        format!("; install another version of it, or let it in again by `bottega engines release {name}`")
    })
}

fn last_words(log: &str) -> String {
    if log.is_empty() { String::new() } else { format!("; its last words:\n{log}") }
}
