//! `bottega manual`: man pages, and the reference pages that are generated from the program.

mod commands;
mod pages;
mod schema;

use std::{path::PathBuf, process::ExitCode};

use bottega::Request;
use clap::{Args, Command, Subcommand, ValueHint};

use crate::error::CliError;

/// Options of `bottega manual`.
#[derive(Debug, Args)]
pub(crate) struct ManualArgs {
    #[command(subcommand)]
    part: ManualPart,
}

/// The parts of the manual.
#[derive(Debug, Subcommand)]
enum ManualPart {
    /// Write the man pages: `bottega.1`, and one for each command.
    Pages {
        /// The folder; it is created if it does not exist.
        #[arg(value_hint = ValueHint::DirPath)]
        folder: PathBuf,
    },
    /// Print every command with its options, as Markdown.
    Commands,
    /// Print every field of a request, as Markdown.
    Request,
}

/// Runs `bottega manual`.
///
/// - `program`: the program with all its options.
pub(crate) fn run(args: &ManualArgs, program: Command) -> Result<ExitCode, CliError> {
    match &args.part {
        ManualPart::Pages { folder } => {
            let count = pages::write(program, folder).map_err(|error| CliError::write(folder.clone(), error))?;
            println!("{}: {count} man pages", folder.display());
        }
        ManualPart::Commands => print!("{}", commands::reference(program)),
        ManualPart::Request => print!("{}", schema::reference(Request::schema().as_value())),
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    /// Checks the generated pages of the manual.
    #[test]
    fn the_reference_is_current() {
        let pages = [
            ("commands.md", commands::reference(Cli::command())),
            ("request.md", schema::reference(Request::schema().as_value())),
        ];
        for (name, made) in pages {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference").join(name);
            let kept = fs::read_to_string(&path).unwrap_or_default();
            let first = kept.lines().zip(made.lines()).find(|(kept, made)| kept != made);
            assert!(kept == made, "docs/reference/{name} is not current: run `cargo xtask manual`; {first:?}");
        }
    }
}
