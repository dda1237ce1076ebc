//! `bottega blackboard`: the rows of a job's blackboard.

use std::{collections::BTreeMap, process::ExitCode};

use bottega::{
    StopSwitch,
    events::{AgentEvent, Event, ZoneEvent},
};
use bottega_cluster::{Job, JobBoard, blackboard::RowUpdate, jobs::known};
use bottega_image::printable;
use clap::{Args, ValueHint};
use hyper::Uri;

use super::page_rows::{PageNews, PageStream};
use crate::{error::CliError, farm_args::FarmArgs, signals};

/// See the Blackboard of a job: each zone with its size, complexity, estimated and measured time and agent; the agents with
/// their speed and credit.
#[derive(Debug, Args)]
#[command(
    after_help = "For example:\n  bottega blackboard\n  bottega blackboard 3 --json\n  bottega blackboard 3 --watch\n\n\
                  Without a farm, of the picture that this machine renders:\n  \
                  bottega render scene.glb -o picture.exr --dashboard 127.0.0.1:8080\n  \
                  bottega blackboard --watch --page 'http://127.0.0.1:8080/?token=...'"
)]
pub(crate) struct BlackboardArgs {
    /// The job; default: the newest active one, or the newest.
    job: Option<u32>,
    /// Print every change from now on, until the job is over.
    #[arg(long)]
    watch: bool,
    /// The page of a process instead of a farm: the address that `bottega render --dashboard` prints.
    #[arg(long, value_name = "URL", value_hint = ValueHint::Url)]
    page: Option<Uri>,
    #[command(flatten)]
    farm: FarmArgs,
}

pub(crate) fn run(args: &BlackboardArgs) -> Result<ExitCode, CliError> {
    if let Some(page) = &args.page {
        return of_page(page, args);
    }
    let board = args.farm.board()?;
    let (number, job) = match args.job {
        Some(number) => (number, known(&board, number)?),
        None => newest(&board)?,
    };
    let rows = board.rows(&job)?;
    if args.farm.json {
        rows.iter().for_each(|row| println!("{}", row.to_json()));
    } else {
        print!("{}", as_table(number, &rows));
    }
    if args.watch {
        watch(&board, number, &job, args.farm.json)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the rows of a process's picture, and with `--watch` each change until the picture is written.
fn of_page(page: &Uri, args: &BlackboardArgs) -> Result<ExitCode, CliError> {
    let stop = StopSwitch::new();
    signals::stop_on_signal(&stop)?;
    let number = args.job.unwrap_or(1);
    let mut stream = PageStream::open(page, number)?;
    let mut is_first = true;
    while let Some(PageNews { rows, is_over }) = stream.next(&|| stop.is_requested())? {
        if is_first && !args.farm.json {
            print!("{}", as_table(number, &rows));
        } else {
            rows.iter().for_each(|row| print_row(row, args.farm.json));
        }
        is_first = false;
        if !args.watch || is_over {
            break;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints a changed row.
fn print_row(row: &Event, as_json: bool) {
    match row {
        row if as_json => println!("{}", row.to_json()),
        Event::Zone(zone) => println!("{}", printable(&zone_line(zone))),
        Event::Agent(agent) => println!("{}", printable(&agent_line(agent))),
        _ => {}
    }
}

fn newest(board: &JobBoard) -> Result<(u32, Job), CliError> {
    let jobs = board.shown_jobs();
    let under_way = jobs.iter().rev().find(|(_, job)| !job.state.is_over());
    under_way.or(jobs.last()).cloned().ok_or_else(|| {
        CliError::usage("the farm has no jobs", "submit a picture: bottega render scene.glb -o picture.exr --farm")
    })
}

/// Prints changes as they happen.
fn watch(board: &JobBoard, number: u32, job: &Job, as_json: bool) -> Result<(), CliError> {
    let stop = StopSwitch::new();
    signals::stop_on_signal(&stop)?;
    let mut caught_up = false;
    board.watch_rows(job, |update| {
        match update {
            RowUpdate::Row(row) if caught_up => print_row(&row, as_json),
            RowUpdate::CaughtUp => caught_up = true,
            RowUpdate::Row(_) | RowUpdate::Nothing => {}
        }
        !stop.is_requested() && board.get(number).is_some_and(|job| !job.state.is_over())
    })?;
    Ok(())
}

/// Formats all rows: zones by number, agents by name.
fn as_table(number: u32, rows: &[Event]) -> String {
    let (mut zones, mut agents) = (BTreeMap::new(), BTreeMap::new());
    for row in rows {
        match row {
            Event::Zone(zone) => _ = zones.insert(zone.id, zone),
            Event::Agent(agent) => _ = agents.insert(&agent.agent, agent),
            _ => {}
        }
    }
    if zones.is_empty() && agents.is_empty() {
        return format!("job {number} has no rows: it has not begun, or they were not stored\n");
    }
    let mut text = format!(
        "{:>6} {:<10} {:>8} {:>10} {:>9} {:>9} {:>5} {:>5} {:>7}  agent\n",
        "zone", "state", "size", "complexity", "T_est", "T_real", "depth", "light", "samples"
    );
    zones.values().for_each(|zone| text += &format!("{}\n", printable(&zone_line(zone))));
    agents.values().for_each(|agent| text += &format!("{}\n", printable(&agent_line(agent))));
    text
}

fn zone_line(zone: &ZoneEvent) -> String {
    let seconds = |time: Option<f64>| time.map_or("-".to_owned(), |time| format!("{time:.3}"));
    let choice = |value: fn(&bottega::events::ZoneChoice) -> u32| {
        zone.choice.as_ref().map_or("-".to_owned(), |choice| value(choice).to_string())
    };
    format!(
        "{:>6} {:<10} {:>8} {:>10.1} {:>9} {:>9} {:>5} {:>5} {:>7}  {}{}",
        zone.id,
        zone.state,
        zone.size,
        zone.complexity,
        seconds(zone.seconds_estimated),
        seconds(zone.seconds_measured),
        choice(|choice| choice.max_depth),
        choice(|choice| choice.light_samples),
        zone.samples,
        zone.agent.as_deref().unwrap_or("-"),
        zone.reasons.as_ref().map_or(String::new(), |reasons| format!("  {reasons}"))
    )
}

fn agent_line(agent: &AgentEvent) -> String {
    let left_out = agent.left_out.as_ref().map_or(String::new(), |reason| format!("; left out: {reason}"));
    format!(
        "{}: V_cp {:.3}, {} processors, credit {:.2} s, promises held {:.2}{left_out}",
        agent.agent, agent.power, agent.lanes, agent.credit, agent.reliability
    )
}
