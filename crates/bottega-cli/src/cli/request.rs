//! Requests read from a file, from standard input, or from an image.

use std::{
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
};

use bottega::{Error, Request, picture::request_of, request::REQUEST_BYTES_MAX};
use clap::{Args, Subcommand, ValueHint};

use crate::error::CliError;

#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Request")]
pub(crate) struct RequestArgs {
    /// Paint a request: a JSON file as --dry-run prints it; `-` is standard input. Other options override its
    /// fields.
    #[arg(long = "request", id = "request", value_name = "FILE|-", value_hint = ValueHint::FilePath, conflicts_with = "from")]
    file: Option<PathBuf>,
    /// Paint the request that this picture holds.
    #[arg(long, value_name = "PICTURE", value_hint = ValueHint::FilePath)]
    from: Option<PathBuf>,
    /// Print the request that the options make, and paint nothing.
    #[arg(long)]
    pub(crate) dry_run: bool,
}

impl RequestArgs {
    /// Returns true if a request is given.
    pub(super) fn is_given(&self) -> bool {
        self.file.is_some() || self.from.is_some()
    }

    /// Reads the request, if one is given.
    pub(super) fn read(&self) -> Result<Option<Request>, CliError> {
        match (&self.file, &self.from) {
            (Some(file), _) => read(file).map(Some),
            (None, Some(picture)) => Ok(Some(request_of(picture)?)),
            (None, None) => Ok(None),
        }
    }
}

/// Reads a request from a file, or from standard input if the file is `-`.
pub(crate) fn read(file: &Path) -> Result<Request, CliError> {
    let is_input = file == Path::new("-");
    let origin = if is_input { "standard input".to_owned() } else { format!("`{}`", file.display()) };
    let mut text = Vec::new();
    // Read one byte more than allowed, to detect a longer text.
    let most = REQUEST_BYTES_MAX as u64 + 1;
    let read = if is_input {
        io::stdin().lock().take(most).read_to_end(&mut text)
    } else {
        File::open(file).and_then(|file| file.take(most).read_to_end(&mut text))
    };
    read.map_err(|source| Error::Read { path: file.to_owned(), source })?;
    Ok(Request::from_json(&text).map_err(|source| Error::Request { origin, source })?)
}

#[derive(Debug, Args)]
#[command(after_help = "For example:\n  bottega render scene.glb -o picture.exr --spp 16 --dry-run > request.json\n  \
                        bottega request check request.json\n  bottega render --request request.json")]
pub(crate) struct RequestCommandArgs {
    #[command(subcommand)]
    pub(crate) command: RequestCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum RequestCommand {
    /// Print the JSON Schema of requests: every field with its meaning and its range.
    Schema,
    /// Check a request, and print it with every default written out.
    Check {
        /// The request, as JSON; `-` is standard input.
        #[arg(value_name = "FILE|-", value_hint = ValueHint::FilePath)]
        file: PathBuf,
    },
    /// Print the options of `bottega render` that make a request.
    Options {
        /// The request, as JSON; `-` is standard input.
        #[arg(value_name = "FILE|-", value_hint = ValueHint::FilePath)]
        file: PathBuf,
    },
    /// Print the request that a picture holds.
    Show {
        /// The picture: .exr or .png.
        #[arg(value_hint = ValueHint::FilePath)]
        picture: PathBuf,
    },
}
