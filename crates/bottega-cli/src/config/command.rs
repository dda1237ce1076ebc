//! `bottega config`: prints the location and the contents of the configuration file.

use std::process::ExitCode;

use clap::{Args, Command, Subcommand};

use super::{ConfigFile, path, words::check};
use crate::error::CliError;

/// The configuration file.
#[derive(Debug, Args)]
#[command(after_help = "A table is called like a command and holds its options; a profile adds to them:\n\n  \
    [render]\n  threads = 6\n  preview = \"now.png\"\n\n  [profile.draft.render]\n  spp = 16\n  optimize = \"b\"\n\n  \
    [farm]\n  address = \"bottega://WORD@10.0.0.7:4222\"\n\n\
    The first of these that sets an option counts: the command line, the environment (BOTTEGA_RENDER_SPP=16), the profile (--profile draft), \
    the file, the scene. A whole request (`render --request`, `--from`) uses nothing from the file.")]
pub(crate) struct ConfigArgs {
    #[command(subcommand)]
    command: ConfigCommand,
}

#[derive(Debug, Subcommand)]
enum ConfigCommand {
    /// Print the path of the file: that of BOTTEGA_CONFIG, else one in the folder of the user's configuration.
    Path,
    /// Print the file and its errors.
    Show,
}

/// Runs `bottega config`.
///
/// - `program`: the options of the program.
pub(crate) fn run(args: &ConfigArgs, program: &Command) -> Result<ExitCode, CliError> {
    match args.command {
        ConfigCommand::Path => println!("{}", path().display()),
        ConfigCommand::Show => match ConfigFile::read()? {
            Some(file) => {
                println!("# {}", file.path.display());
                print!("{}", file.text);
                check(&file, program)?;
            }
            None => println!("# {}: no such file", path().display()),
        },
    }
    Ok(ExitCode::SUCCESS)
}
