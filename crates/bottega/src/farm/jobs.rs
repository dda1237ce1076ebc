//! `bottega jobs`: what a farm is asked for, and what becomes of it.

use std::{
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use clap::{Args, Subcommand, ValueHint};
use serde_json::json;

use super::{
    client::{unfetched, write_picture},
    job::{Job, JobState, PRIORITY_MAX, unix_seconds},
    job_board::{JobBoard, no_such},
    link::FarmArgs,
    machine::Standing,
    refusals::RefusalWatch,
    room::{MAKE_ROOM, bytes_said},
    view::JobView,
};
use crate::{
    error::CliError,
    keeping::{is_journal_of, journal_of},
    reporter::duration,
};

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
    /// All jobs and how far they are.
    List,
    /// One job: who paints it, and how far it is.
    Show { number: u32 },
    /// Have nobody paint a job until it is resumed. What is painted is kept.
    Pause { number: u32 },
    /// Go on with a job that was paused.
    Resume { number: u32 },
    /// Call a job off.
    Cancel { number: u32 },
    /// Say how urgent a job is: jobs have machines in proportion to their priorities.
    Priority {
        number: u32,
        #[arg(value_parser = clap::value_parser!(u32).range(1..=i64::from(PRIORITY_MAX)))]
        priority: u32,
    },
    /// What has happened to a job.
    Log { number: u32 },
    /// Write the picture of a job that the farm has finished.
    Fetch {
        number: u32,
        /// Default: as it was asked for.
        #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
        output: Option<PathBuf>,
    },
    /// Forget a job that is over, its picture, and its scene if no other job needs it.
    Remove { number: u32 },
}

pub(crate) fn run(args: &JobsArgs) -> Result<ExitCode, CliError> {
    let board = args.farm.board()?;
    match &args.command {
        JobsCommand::List => list(&board, args.farm.json),
        JobsCommand::Show { number } => show(&board, *number, args.farm.json)?,
        JobsCommand::Pause { number } => steer(&board, *number, &JobState::Paused, "paused")?,
        JobsCommand::Resume { number } => steer(&board, *number, &JobState::Active, "resumed")?,
        JobsCommand::Cancel { number } => steer(&board, *number, &JobState::Cancelled, "called off")?,
        JobsCommand::Priority { number, priority } => set_priority(&board, *number, *priority)?,
        JobsCommand::Log { number } => log(&known(&board, *number)?, args.farm.json),
        JobsCommand::Fetch { number, output } => fetch(&board, *number, output.clone())?,
        JobsCommand::Remove { number } => remove(&board, *number)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn known(board: &JobBoard, number: u32) -> Result<Job, CliError> {
    board.get(number).ok_or_else(|| no_such(number))
}

fn list(board: &JobBoard, as_json: bool) {
    let seats = board.seats();
    if !as_json {
        println!(
            "{:>4}  {:<9} {:>5}  {:>8}  {:>8}  {:>8}  {:<24} scene",
            "job", "state", "done", "priority", "machines", "holds", "from"
        );
    }
    let jobs = board.all();
    let held = board.held(&jobs);
    for (number, job) in jobs {
        let machines = seats.iter().filter(|seat| seat.job == Some(number)).count();
        let view = JobView::of(number, &job, &board.lead(number).unwrap_or_default(), machines);
        let held = held.get(&number).copied().unwrap_or_default();
        if as_json {
            let mut told = json!(view);
            told["holds_bytes"] = held.all().into();
            println!("{told}");
        } else {
            println!(
                "{number:>4}  {:<9} {:>4.0}%  {:>8}  {:>8}  {:>8}  {:<24} {}",
                view.state,
                100.0 * view.done,
                job.priority,
                view.machines,
                bytes_said(held.all()),
                job.from,
                job.scene
            );
        }
    }
    if !as_json {
        tell_room(board);
    }
    let idle = |standing| seats.iter().filter(|seat| seat.job.is_none() && seat.standing == standing).count();
    if !as_json {
        for (standing, what) in [(Standing::Active, "wait for work"), (Standing::Suspended, "are suspended")] {
            match idle(standing) {
                0 => {}
                count => println!("{count} machines {what}"),
            }
        }
    }
}

/// What the farm's server keeps, what is on its way there, and what can be done when that is too much.
fn tell_room(board: &JobBoard) {
    for (process, sent) in board.transfers() {
        println!("{process} sends a scene: {} of {}", bytes_said(sent.sent), bytes_said(sent.bytes));
    }
    if let Some(room) = board.room() {
        println!("the farm's server keeps {} of at most {}", bytes_said(room.used), bytes_said(room.limit));
        if room.is_scarce() {
            println!("that is nearly all: {MAKE_ROOM}");
        }
    }
}

fn show(board: &JobBoard, number: u32, as_json: bool) -> Result<(), CliError> {
    let job = known(board, number)?;
    let lead = board.lead(number).unwrap_or_default();
    let all = board.seats();
    // A machine that was killed does not say that it has left.
    let seats: Vec<_> = all.iter().filter(|seat| seat.job == Some(number) && !job.state.is_over()).collect();
    let view = JobView::of(number, &job, &lead, seats.len());
    if as_json {
        println!("{}", json!(view));
        return Ok(());
    }
    println!("job {number}: {} -> {}", job.scene, job.output);
    println!("asked for by {}, {} ago", job.from, ago(job.submitted));
    println!(
        "{}, {:.1} % done, {} of {} zones; priority {}",
        view.state,
        100.0 * view.done,
        lead.zones_done,
        lead.zones,
        job.priority
    );
    println!("led by {}", lead.leader.as_deref().unwrap_or("nobody"));
    for seat in seats {
        println!("  {} ({} processors)", seat.name, seat.threads);
    }
    for (seat, refusal) in RefusalWatch::default().news(&all, |work| work == job.work) {
        println!("  {} is left out: {}", seat.name, refusal.reason);
    }
    if let JobState::Failed { reason } = &job.state {
        println!("it failed: {reason}");
    }
    if let JobState::Done { kept: true } = job.state {
        println!("the farm has the picture: bottega jobs fetch {number}");
    }
    Ok(())
}

fn ago(at: u64) -> String {
    duration(Duration::from_secs(unix_seconds().saturating_sub(at)))
}

/// Pauses, resumes or calls off; what is over stays as it is.
pub(crate) fn steer(board: &JobBoard, number: u32, to: &JobState, word: &str) -> Result<(), CliError> {
    let before = known(board, number)?.state;
    if before.is_over() {
        return Err(CliError::failed(
            format!("job {number} is over: {}", before.word()),
            "`bottega jobs list` shows those that are not",
        ));
    }
    board.change(number, |job| {
        let changes = !job.state.is_over() && job.state != *to;
        if changes {
            job.say(word);
            job.state = to.clone();
        }
        changes
    })?;
    Ok(())
}

pub(crate) fn set_priority(board: &JobBoard, number: u32, priority: u32) -> Result<(), CliError> {
    let change = board.change(number, |job| {
        job.say(format!("priority {priority}"));
        job.priority = priority;
        true
    });
    change.map(drop)
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

fn fetch(board: &JobBoard, number: u32, output: Option<PathBuf>) -> Result<(), CliError> {
    let job = known(board, number)?;
    let remedy = match &job.state {
        JobState::Done { kept: false } => format!("{} wrote it to {}", job.from, job.output),
        JobState::Done { kept: true } => "somebody has removed it".to_owned(),
        state => format!("the job is {}: see `bottega jobs show {number}`", state.word()),
    };
    let picture = board.picture(&job)?;
    let picture = picture.ok_or_else(|| CliError::failed("the farm has no picture of this job", remedy))?;
    let output = output.unwrap_or_else(|| PathBuf::from(&job.output));
    write_picture(&output, &picture).map_err(|error| unfetched(number, &error))?;
    println!("{}", output.display());
    forget_journal(board, &job, &output);
    Ok(())
}

/// The one who asked may have been killed, and its journal lies beside the picture: the picture is there now. A journal of another
/// picture stays.
fn forget_journal(board: &JobBoard, job: &Job, output: &Path) {
    let path = journal_of(output);
    let Some(name) = board.order(job).ok().and_then(|order| order.journal) else { return };
    if is_journal_of(&path, &name)
        && let Err(error) = fs::remove_file(&path)
    {
        tracing::warn!("cannot remove {}, which is of no more use: {error}", path.display());
    }
}

fn remove(board: &JobBoard, number: u32) -> Result<(), CliError> {
    let job = known(board, number)?;
    if !job.state.is_over() {
        return Err(CliError::failed(
            format!("job {number} is not over"),
            format!("call it off first: bottega jobs cancel {number}"),
        ));
    }
    board.remove_with_scene(number)
}
