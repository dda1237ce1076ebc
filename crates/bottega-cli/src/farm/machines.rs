//! `bottega machines`: lists and controls the machines of a farm.

use std::process::ExitCode;

use bottega_cluster::{
    JobBoard,
    machines::MachineOrder,
    names::host_name,
    presence::{Presence, PresenceState},
    view::MachineView,
};
use bottega_image::printable;
use clap::{Args, Subcommand};
use serde_json::json;

use super::learnt;
use crate::{error::CliError, farm_args::FarmArgs};

/// See and steer the machines of a farm.
#[derive(Debug, Args)]
#[command(after_help = "For example:\n  bottega machines list\n  bottega machines suspend workshop-a1b2c3")]
pub(crate) struct MachinesArgs {
    #[command(subcommand)]
    command: MachinesCommand,
    #[command(flatten)]
    farm: FarmArgs,
}

#[derive(Debug, Subcommand)]
enum MachinesCommand {
    /// List the machines that are there, with their jobs.
    List,
    /// Suspend a machine: it hands its zones back and leaves its processors to others until it is resumed.
    Suspend { name: String },
    /// Resume a suspended machine.
    Resume { name: String },
    /// Remove a machine from the farm: its `bottega join` ends.
    Terminate { name: String },
    /// Show the times of zones that a machine of the farm has learnt; the machine need not be there. Without a name: this
    /// machine alone, without a farm. `all-machines`: all machines of the farm together.
    Show { name: Option<String> },
    /// Print all that a machine has learnt, as JSON.
    Export { name: Option<String> },
    /// Forget all that a machine has learnt, and its reliability.
    Forget { name: Option<String> },
}

pub(crate) fn run(args: &MachinesArgs) -> Result<ExitCode, CliError> {
    let (name, standing) = match &args.command {
        MachinesCommand::List => {
            list(&args.farm.board()?, args.farm.json);
            return Ok(ExitCode::SUCCESS);
        }
        MachinesCommand::Show { name } => return learnt::show(name.as_deref(), &args.farm),
        MachinesCommand::Export { name } => return learnt::export(name.as_deref(), &args.farm),
        MachinesCommand::Forget { name } => return learnt::forget(name.as_deref(), &args.farm),
        MachinesCommand::Suspend { name } => (name, PresenceState::Suspended),
        MachinesCommand::Resume { name } => (name, PresenceState::Active),
        MachinesCommand::Terminate { name } => (name, PresenceState::Terminated),
    };
    let board = args.farm.board()?;
    let present = board.shown_machines(board.present());
    let Some(machine) = present.iter().find(|machine| machine.name == *name) else {
        let remedy = "`bottega machines list` shows the machines that are present";
        return Err(CliError::failed(format!("there is no machine `{name}`"), remedy));
    };
    if !machine.takes_orders {
        let remedy = "it ends with its job: see `bottega jobs`";
        return Err(CliError::failed(
            format!("{name} takes no commands: it is the process that submitted its job"),
            remedy,
        ));
    }
    let order = MachineOrder { standing, by: format!("`bottega machines` on {}", host_name()) };
    board.tell(name, &order)?;
    if args.farm.json {
        println!("{}", json!({ "machine": name, "ordered": standing.word() }));
    }
    Ok(ExitCode::SUCCESS)
}

fn list(board: &JobBoard, as_json: bool) {
    if !as_json {
        println!("{:<32} {:<10} {:>7}  {:>4}  {:<12} tags", "machine", "state", "threads", "job", "version");
    }
    for machine in MachineView::all(board) {
        if as_json {
            println!("{}", machine.to_value());
        } else {
            let Presence { name, threads, version, job, standing, tags, .. } = &machine.presence;
            let job = job.map_or_else(|| "-".to_owned(), |job| job.to_string());
            let state = standing.word();
            let (name, version) = (printable(name), printable(version));
            let line = format!("{name:<32} {state:<10} {threads:>7}  {job:>4}  {version:<12} {}", tags.join(" "));
            println!("{}", line.trim_end());
        }
    }
}
