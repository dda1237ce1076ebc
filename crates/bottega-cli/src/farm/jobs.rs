//! `bottega jobs`: lists and controls the jobs of a farm.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use bottega::{request::PRIORITY_MAX, text::duration};
use bottega_cluster::{
    Job, JobBoard, JobState,
    jobs::{fetch, known, remove, set_priority, steer},
    names::host_name,
    presence::PresenceState,
    refusals::RefusalWatch,
    room::{MAKE_ROOM, bytes_said},
    society::Society,
    unix_seconds,
    view::JobView,
};
use bottega_image::printable;
use clap::{Args, Subcommand, ValueHint};
use serde_json::json;

use super::energy;
use crate::{config, error::CliError, farm_args::FarmArgs};

/// See and steer the jobs of a farm.
#[derive(Debug, Args)]
#[command(
    after_help = "For example:\n  bottega jobs list\n  bottega jobs priority 3 30\n  bottega jobs fetch 3 -o picture.exr"
)]
pub(crate) struct JobsArgs {
    #[command(subcommand)]
    command: JobsCommand,
    #[command(flatten)]
    farm: FarmArgs,
}

#[derive(Debug, Subcommand)]
enum JobsCommand {
    /// List all jobs with their progress.
    List,
    /// Show a job: its agents and its progress.
    Show { number: u32 },
    /// Pause a job until it is resumed. Painted zones are kept.
    Pause { number: u32 },
    /// Resume a paused job.
    Resume { number: u32 },
    /// Cancel a job.
    Cancel { number: u32 },
    /// Set the priority of a job: jobs get machines in proportion to their priorities.
    Priority {
        number: u32,
        #[arg(value_parser = clap::value_parser!(u32).range(1..=i64::from(PRIORITY_MAX)))]
        priority: u32,
    },
    /// Print the log of a job.
    Log { number: u32 },
    /// Write the picture of a finished job to a file.
    Fetch {
        number: u32,
        /// The file to write; default: the output file of the request.
        #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
        output: Option<PathBuf>,
    },
    /// Delete a job that is over, with its picture, and its scene if no other job needs it.
    Remove { number: u32 },
}

pub(crate) fn run(args: &JobsArgs) -> Result<ExitCode, CliError> {
    let board = args.farm.board()?;
    match &args.command {
        JobsCommand::List => list(&board, args.farm.json),
        JobsCommand::Show { number } => show(&board, *number, args.farm.json)?,
        JobsCommand::Pause { number } => steer(&board, *number, &JobState::Paused, &by())?,
        JobsCommand::Resume { number } => steer(&board, *number, &JobState::Active, &by())?,
        JobsCommand::Cancel { number } => steer(&board, *number, &JobState::Cancelled, &by())?,
        JobsCommand::Priority { number, priority } => set_priority(&board, *number, *priority, &by())?,
        JobsCommand::Log { number } => log(&known(&board, *number)?, args.farm.json),
        JobsCommand::Fetch { number, output } => {
            println!("{}", fetch(&board, *number, output.clone())?.display());
        }
        JobsCommand::Remove { number } => remove(&board, *number)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the origin of a command, for the log of the job.
fn by() -> String {
    format!("`bottega jobs` on {}", host_name())
}

fn list(board: &JobBoard, as_json: bool) {
    let present = board.shown_machines(board.presences());
    if !as_json {
        println!(
            "{:>4}  {:<9} {:>5}  {:>8}  {:>8}  {:>8}  {:<24} scene",
            "job", "state", "done", "priority", "machines", "holds", "from"
        );
    }
    let jobs = board.shown_jobs();
    let held = board.held(&jobs);
    for (number, job) in jobs {
        let machines = present.iter().filter(|machine| machine.job == Some(number)).count();
        let view = JobView::of(number, &job, &board.lead(number).unwrap_or_default(), machines);
        let held = held.get(&number).copied().unwrap_or_default();
        if as_json {
            let mut json_view = json!(view);
            json_view["holds_bytes"] = held.all().into();
            println!("{json_view}");
        } else {
            println!(
                "{number:>4}  {:<9} {:>4.0}%  {:>8}  {:>8}  {:>8}  {:<24} {}",
                view.state,
                100.0 * view.done,
                job.priority,
                view.machines,
                bytes_said(held.all()),
                printable(&job.from),
                job.scene
            );
        }
    }
    if !as_json {
        tell_room(board);
    }
    let idle =
        |standing| present.iter().filter(|machine| machine.job.is_none() && machine.standing == standing).count();
    if !as_json {
        let kinds = [
            (PresenceState::Active, ["waits for work", "wait for work"]),
            (PresenceState::Suspended, ["is suspended", "are suspended"]),
        ];
        for (standing, [one, several]) in kinds {
            match idle(standing) {
                0 => {}
                1 => println!("1 machine {one}"),
                count => println!("{count} machines {several}"),
            }
        }
    }
}

/// Prints the storage used by the farm's server and by transfers, and a remedy if it is too full.
fn tell_room(board: &JobBoard) {
    let transfers = if board.uplink.is_guest() { Vec::new() } else { board.transfers() };
    for (process, sent) in transfers {
        println!("{process} sends a scene: {} of {}", bytes_said(sent.sent), bytes_said(sent.bytes));
    }
    if let Some(room) = board.room() {
        println!("the farm's server keeps {} of at most {}", bytes_said(room.used), bytes_said(room.limit));
        if room.is_scarce() {
            println!("the store is nearly full: {MAKE_ROOM}");
        }
    }
}

fn show(board: &JobBoard, number: u32, as_json: bool) -> Result<(), CliError> {
    let job = known(board, number)?;
    let lead = board.lead(number).unwrap_or_default();
    let present = board.shown_machines(board.presences());
    // A machine that was killed cannot announce that it left.
    let working: Vec<_> =
        present.iter().filter(|machine| machine.job == Some(number) && !job.state.is_over()).collect();
    let view = JobView::of(number, &job, &lead, working.len());
    let society = board.society(number).unwrap_or_default();
    let mut tariff = board.tariff();
    tariff.price = config::energy_price().or(tariff.price);
    let energy = board.energy(number, &job, &tariff)?;
    if as_json {
        let mut json_view = json!(view);
        json_view["society"] = json!(society);
        json_view["agents"] = json!(board.job_agents(number));
        json_view["energy"] = json!(energy);
        println!("{json_view}");
        return Ok(());
    }
    println!("job {number}: {} -> {}", job.scene, job.output);
    println!("submitted by {}, {} ago", job.from, ago(job.submitted));
    println!(
        "{}, {:.1} % done, {} of {} zones; priority {}",
        view.state,
        100.0 * view.done,
        view.zones_done,
        view.zones,
        job.priority
    );
    if !job.require.is_empty() {
        let fit = present.iter().filter(|machine| job.require.iter().all(|tag| machine.tags.contains(tag))).count();
        println!("for machines tagged {}: {fit} of {} present", job.require.join(" and "), present.len());
    }
    println!("led by {}", lead.leader.as_deref().unwrap_or("nobody"));
    for machine in working {
        println!("  {} ({} processors)", machine.name, machine.threads);
    }
    tell_society(&society);
    for agent in board.job_agents(number) {
        let services: Vec<&str> = agent.services.iter().map(|kind| kind.trim_start_matches("bottega-job-")).collect();
        println!("  {}: {}, in the directories as {}", agent.agent, agent.state, services.join(", "));
    }
    job.log.iter().filter(|line| line.text.starts_with("learnt: ")).for_each(|line| println!("{}", line.text));
    energy::lines(&energy).iter().for_each(|line| println!("{line}"));
    for (machine, refusal) in RefusalWatch::default().new_refusals(&present, |work| work == job.work) {
        println!("  {} is left out: {}", machine.name, refusal.reason);
    }
    if let JobState::Failed { reason } = &job.state {
        println!("failed: {reason}");
    }
    if job.kept {
        let which = if job.state == JobState::Done { "the picture" } else { "the picture of the previous painting" };
        println!("the farm has {which}: bottega jobs fetch {number}");
    }
    Ok(())
}

/// Prints the agents, and the result of the auction.
fn tell_society(society: &Society) {
    let auction = &society.auction;
    if auction.rounds > 0 {
        println!(
            "auction: {} awards in {} rounds, {} with several bidders, {} zones outbid, \
             {} rounds decided by credit; {:.1} bids a round",
            auction.awards,
            auction.rounds,
            auction.contested,
            auction.outbid,
            auction.credit_decided,
            auction.bids as f64 / auction.rounds as f64
        );
    }
    if auction.thefts > 0 {
        println!("stealing: {} zones changed hands in {} thefts", auction.stolen, auction.thefts);
    }
    for agent in &society.agents {
        println!(
            "  {}: V_cp {:.3}, credit {:.2} s, promises held {:.2}",
            agent.agent, agent.power, agent.credit, agent.reliability
        );
    }
}

pub(super) fn ago(at: u64) -> String {
    duration(Duration::from_secs(unix_seconds().saturating_sub(at)))
}

fn log(job: &Job, as_json: bool) {
    for line in &job.log {
        if as_json {
            println!("{}", json!({ "at": line.at, "text": line.text }));
        } else {
            println!("{:>10} ago  {}", ago(line.at), line.text);
        }
    }
}
