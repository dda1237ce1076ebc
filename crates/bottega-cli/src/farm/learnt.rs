//! `bottega machines show`, `export` and `forget`: the timing experience of machines.

use std::process::ExitCode;

use bottega_agents::machine_of;
use bottega_cluster::{ALL_MACHINES, JobBoard};
use bottega_farm::{Experience, LearntFactor, MachineSpeed};
use serde_json::json;

use crate::{error::CliError, farm_args::FarmArgs};

/// Shows the experience of a machine: one of the farm by name, or this one.
pub(super) fn show(machine: Option<&str>, farm: &FarmArgs) -> Result<ExitCode, CliError> {
    let Some(name) = machine else {
        tell("this machine", bottega::experience::kept_benchmark(), None, &own()?, farm.json);
        return Ok(ExitCode::SUCCESS);
    };
    // Processes of a machine share its experience.
    let (board, name) = (farm.board()?, machine_of(name));
    let experience = board.experience(name);
    let reliability = board.reliabilities().get(name).copied();
    if !is_shown(&board, name) || experience.is_empty() && reliability.is_none() {
        return Err(unknown(&board, name));
    }
    tell(name, None, reliability, &experience, farm.json);
    Ok(ExitCode::SUCCESS)
}

/// Prints the experience of a machine as the JSON in which it is kept.
pub(super) fn export(machine: Option<&str>, farm: &FarmArgs) -> Result<ExitCode, CliError> {
    let experience = match machine {
        Some(name) => {
            let (board, name) = (farm.board()?, machine_of(name));
            let experience = board.experience(name);
            if !is_shown(&board, name) || experience.is_empty() {
                return Err(unknown(&board, name));
            }
            experience
        }
        None => own()?,
    };
    println!("{}", experience.to_json());
    Ok(ExitCode::SUCCESS)
}

/// Returns the experience of this machine by itself.
fn own() -> Result<Experience, CliError> {
    match bottega::experience::read() {
        (experience, None) => Ok(experience),
        (_, Some(warning)) => Err(CliError::failed(warning, "`bottega machines forget` removes it")),
    }
}

/// Returns true if the user of this board may see a machine. The summary of all machines has no owner.
fn is_shown(board: &JobBoard, name: &str) -> bool {
    name == ALL_MACHINES || board.shows_machine(name)
}

/// Deletes the experience of a machine: one of the farm by name, or this one.
pub(super) fn forget(machine: Option<&str>, farm: &FarmArgs) -> Result<ExitCode, CliError> {
    let (name, is_forgotten) = match machine {
        Some(name) => {
            let (board, name) = (farm.board()?, machine_of(name));
            if !board.forget_machine(name)? {
                return Err(unknown(&board, name));
            }
            (name, true)
        }
        None => {
            let forgotten = bottega::experience::forget().map_err(|error| {
                let what = format!("cannot forget {}: {error}", bottega::experience::path().display());
                CliError::failed(what, "remove the file by hand")
            })?;
            ("this machine", forgotten)
        }
    };
    match (farm.json, is_forgotten) {
        (true, _) => println!("{}", json!({ "machine": name, "forgotten": is_forgotten })),
        (false, true) => println!("{name} starts learning again"),
        (false, false) => println!("{name} has learnt nothing yet"),
    }
    Ok(ExitCode::SUCCESS)
}

fn unknown(board: &JobBoard, name: &str) -> CliError {
    let mut known = board.experienced();
    known.retain(|machine| board.shows_machine(machine));
    let remedy = match known.is_empty() {
        true => "machines learn in the jobs that they paint for a farm".to_owned(),
        false => format!("there is experience of {}", known.join(", ")),
    };
    CliError::failed(format!("there is no experience of a machine `{name}`"), remedy)
}

/// - `speed`: by the benchmark; `None`: unknown.
/// - `reliability`: by the machine's credit, 0 to 1; `None`: unknown.
fn tell(name: &str, speed: Option<MachineSpeed>, reliability: Option<f64>, experience: &Experience, as_json: bool) {
    let factors = experience.factors();
    if as_json {
        let report = json!({ "machine": name, "benchmark": speed.map(|speed| speed.power.get()),
            "load": speed.map(|speed| speed.load), "reliability": reliability,
            "jobs": experience.jobs(), "factors": factors });
        println!("{report}");
        return;
    }
    println!("{name}: learnt in {} jobs", experience.jobs());
    if let Some(speed) = speed {
        println!("V_cp by the benchmark, in processor time: {:.3}", speed.power.get());
        let remark = if speed.is_quiet() { "" } else { "; the machine was busy, so the next job measures again" };
        println!("load meanwhile, clock by processor time: {:.2}{remark}", speed.load);
    }
    if let Some(reliability) = reliability {
        println!("its promises held: {:.0} %", 100.0 * reliability);
    }
    if factors.is_empty() {
        return;
    }
    println!("{:<8} {:>7} {:>6} {:>6} {:>5}  tasks", "of", "factor", "error", "zones", "age");
    for LearntFactor { of, tasks, factor, error, zones, age } in factors {
        let error = error.map_or_else(|| "–".to_owned(), |error| format!("{:.0} %", 100.0 * error));
        println!("{of:<8} {factor:>7.3} {error:>6} {zones:>6.1} {age:>5}  {tasks}");
    }
}
