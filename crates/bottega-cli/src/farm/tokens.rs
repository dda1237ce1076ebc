//! `bottega tokens`: access tokens for the page and the HTTP API of a farm.

use std::process::ExitCode;

use bottega_cluster::{
    JobBoard,
    address::{FarmAddress, LocalAddresses, saved_address},
    names::host_name,
    unix_seconds,
    web_secrets::{TokenRole, WebSecrets},
};
use clap::{Args, Subcommand, ValueEnum};
use serde_json::json;

use super::jobs::ago;
use crate::{error::CliError, farm_args::FarmArgs};

/// List, make and revoke the tokens that let people and programs in at the page and the HTTP API of a farm.
#[derive(Debug, Args)]
#[command(
    after_help = "For example:\n  bottega tokens make anna --role steer\n  bottega tokens list\n  bottega tokens revoke anna\n\n\
    `see` and `steer` are those whose addresses `bottega up` prints. The log of a job says whose token steered it, and web.log in the \
    folder of bottega's state has a line for each request that changed something."
)]
pub(crate) struct TokensArgs {
    #[command(subcommand)]
    command: TokensCommand,
    #[command(flatten)]
    farm: FarmArgs,
}

#[derive(Debug, Subcommand)]
enum TokensCommand {
    /// List all tokens: name, rights, maker and date. The tokens themselves are not shown.
    List,
    /// Make a token for one person or program. It is shown only once.
    Make {
        /// Name of the token, in lists and logs: letters, digits, `-`, `_` and `.`.
        name: String,
        /// Rights that the token gives.
        #[arg(long, value_enum, default_value_t = RoleChoice::See)]
        role: RoleChoice,
    },
    /// Revoke a token: it admits no page and no program any more. A revoked `see` or `steer` is replaced at once.
    Revoke {
        /// Name of the token, as `bottega tokens list` shows it.
        name: String,
    },
    /// Show the token `see` or `steer` again, as `bottega up` printed it, or its replacement.
    Show {
        /// The role whose token to show.
        role: RoleChoice,
    },
}

/// The rights that a token grants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum RoleChoice {
    /// See jobs and machines.
    See,
    /// May look and steer.
    Steer,
}

impl RoleChoice {
    fn role(self) -> TokenRole {
        match self {
            Self::See => TokenRole::See,
            Self::Steer => TokenRole::Steer,
        }
    }
}

pub(crate) fn run(args: &TokensArgs) -> Result<ExitCode, CliError> {
    let board = args.farm.board()?;
    let by = format!("`bottega tokens` on {}", host_name());
    let as_json = args.farm.json;
    match &args.command {
        TokensCommand::List => list(&board, as_json),
        TokensCommand::Make { name, role } => {
            let token = board.make_token(name, role.role(), &by)?;
            tell(name, role.role(), &token, as_json);
        }
        TokensCommand::Revoke { name } => {
            let own = TokenRole::ALL.into_iter().find(|role| role.word() == name);
            // Read the secrets before revoking: if there are none, the token stays.
            let secrets = own.map(|_| secrets(&args.farm)).transpose()?;
            board.revoke_token(name, &by)?;
            match own.zip(secrets) {
                Some((role, secrets)) => tell(name, role, &board.own_token(&secrets, role), as_json),
                None if as_json => println!("{}", json!({ "token": name, "revoked": true })),
                None => println!("{name} is revoked"),
            }
        }
        TokensCommand::Show { role } => {
            let token = board.own_token(&secrets(&args.farm)?, role.role());
            tell(role.role().word(), role.role(), &token, as_json);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the secrets that the `see` and `steer` tokens are derived from.
fn secrets(farm: &FarmArgs) -> Result<WebSecrets, CliError> {
    let address: FarmAddress = farm.address().map_or_else(saved_address, Ok)?;
    let secrets = WebSecrets::of_farm(&address)?;
    if secrets.is_shared() {
        return Ok(secrets);
    }
    Err(CliError::failed(
        "`see` and `steer` of this farm are not known here: each of its pages has tokens of its own, or this machine is a guest",
        "they end with the process that serves the page; make tokens with names instead: bottega tokens make NAME",
    ))
}

fn list(board: &JobBoard, as_json: bool) {
    if !as_json {
        println!("{:<32} {:<6} {:>14}  by", "token", "role", "made");
    }
    for token in board.web_tokens() {
        if as_json {
            println!("{}", json!(token));
            continue;
        }
        let made = token
            .made
            .map_or_else(|| "with the farm".to_owned(), |made| format!("{} ago", ago(made.min(unix_seconds()))));
        let line = format!("{:<32} {:<6} {made:>14}  {}", token.name, token.role.word(), token.by.unwrap_or_default());
        println!("{}", line.trim_end());
    }
}

/// Prints a token, and the page's address with the token if the page is known.
fn tell(name: &str, role: TokenRole, token: &str, as_json: bool) {
    let page = LocalAddresses::read().and_then(|addresses| addresses.page);
    let url = page.map(|page| format!("{page}/?token={token}"));
    if as_json {
        println!("{}", json!({ "name": name, "role": role, "token": token, "url": url }));
        return;
    }
    let may = match role {
        TokenRole::See => "looks on",
        TokenRole::Steer => "may do everything",
    };
    println!("the token of {name}, who {may}: {token}");
    if let Some(url) = url {
        println!("in a browser of this machine: {url}");
    }
}
