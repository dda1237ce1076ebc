//! `bottega join`: this machine paints what the farm is asked for.

use std::{
    collections::BTreeSet,
    path::PathBuf,
    process::ExitCode,
    thread,
    time::{Duration, Instant},
};

use bottega_farm::StopSwitch;
use clap::{Args, ValueHint};

use super::{
    address::{FarmAddress, state_folder},
    job::{Job, JobState},
    job_board::{JobBoard, RENEW_EVERY, Seat},
    link::{FarmLink, LoginArgs, link},
    part::{Member, Part, take_part},
    shares::{Wanting, choose, should_move},
    studio::Studio,
};
use crate::{devices::processors, error::CliError, render};

/// How often is looked for work.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// A machine stays with a job for so long before it looks at others: loading a scene is not for nothing.
const STAYS: Duration = Duration::from_secs(5);

/// Offer this machine to a farm.
#[derive(Debug, Args)]
#[command(
    after_help = "For example, with the line that `bottega up` printed:\n  bottega join bottega://WORD@10.0.0.7:4222\n\nor, in the same local network, with the word alone. \
    The machine paints for the jobs of the farm by their priorities, and leads one where nobody does. Ctrl-C hands back \
    what it has in hand."
)]
pub(crate) struct JoinArgs {
    /// Where the farm is; default: the one that `bottega up` runs on this machine.
    #[arg(env = "BOTTEGA_FARM", hide_env_values = true)]
    farm: Option<FarmAddress>,
    /// Processors to use; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Where scenes are kept; default: a folder of the user's state.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    cache: Option<PathBuf>,
    /// Paint until one job is over, and leave.
    #[arg(long)]
    once: bool,
    #[command(flatten)]
    login: LoginArgs,
}

pub(crate) fn run(args: &JoinArgs) -> Result<ExitCode, CliError> {
    let FarmLink { uplink, name, servers } = link(args.farm.as_ref(), &args.login)?;
    let stop = StopSwitch::new();
    render::stop_on_signal(&stop)?;
    let how = if uplink.is_guest() { "as a guest: " } else { "" };
    println!("joined {servers} (NATS {}); {how}waiting for work", uplink.server_version());
    let member =
        Member { board: JobBoard { uplink }, name, threads: args.threads.map_or_else(processors, usize::from), stop };
    let cache = args.cache.clone().unwrap_or_else(|| state_folder().join("cache"));
    let mut worker =
        Worker { member, cache, threads: args.threads, studio: None, refused: BTreeSet::new(), helped: None };
    while !worker.member.stop.is_requested() {
        if worker.work_once() && args.once {
            break;
        }
    }
    worker.member.board.rise(&worker.member.name);
    println!("left the farm");
    Ok(ExitCode::SUCCESS)
}

/// A machine that paints for a farm.
struct Worker {
    member: Member,
    cache: PathBuf,
    threads: Option<u16>,
    /// The job that was painted last: its scene stays loaded.
    studio: Option<Studio>,
    /// Jobs that this machine cannot paint.
    refused: BTreeSet<u32>,
    /// A job that is painted, and whose picture somebody else makes safe.
    helped: Option<u32>,
}

impl Worker {
    /// Takes part in a job, or waits a moment if there is none. Returns whether one came to its end.
    fn work_once(&mut self) -> bool {
        let Member { board, name, threads, .. } = &self.member;
        let others: Vec<Seat> = board.seats().into_iter().filter(|seat| seat.name != *name).collect();
        let wanting = wanting(board, |number| !self.refused.contains(&number) && !self.is_done_with(number));
        let chosen = choose(&wanting, &others).and_then(|number| Some((number, board.get(number)?)));
        let Some((number, job)) = chosen else {
            board.sit(&Seat { name: name.clone(), threads: *threads, job: None });
            self.wait();
            return false;
        };
        match self.take_part(number, &job) {
            Ok(is_over) => is_over,
            // What is wrong with one job is no reason to leave the farm.
            Err(error) => {
                let board = &self.member.board;
                board.log(number, &format!("{} is left out: {error}", self.member.name));
                eprintln!("{:?}", miette::Report::new(error));
                self.refused.insert(number);
                true
            }
        }
    }

    /// Whether a job needs no more hands, though it is not over yet.
    fn is_done_with(&self, number: u32) -> bool {
        let is_led = || self.member.board.lead(number).is_some_and(|lead| lead.leader.is_some());
        self.helped == Some(number) && is_led()
    }

    /// Until it is time to say that this machine is there, or there may be work.
    fn wait(&self) {
        let begun = Instant::now();
        while begun.elapsed() < RENEW_EVERY && !self.member.stop.is_requested() {
            thread::sleep(LOOK_EVERY);
            if !wanting(&self.member.board, |number| !self.refused.contains(&number) && !self.is_done_with(number))
                .is_empty()
            {
                return;
            }
        }
    }

    fn take_part(&mut self, number: u32, job: &Job) -> Result<bool, CliError> {
        if self.studio.as_ref().is_none_or(|studio| studio.work != job.work) {
            // The old one goes first: two scenes may be more than there is room for.
            self.studio = None;
            self.studio = Some(Studio::open(&self.member, job, &self.cache, self.threads)?);
        }
        let Some(studio) = &self.studio else { return Ok(false) };
        let before = studio.samples_done();
        println!("job {number}: painting {}", job.scene);
        let part = take_part(&self.member, number, job, &mut studio.tools(), self.elsewhere(number))?;
        let is_over = !matches!(part, Part::Left(_));
        if let Part::Led(report, leading) = part {
            let state = match report.failed.len() {
                0 => {
                    studio.keep_picture(&self.member.board, job, &report, &self.cache)?;
                    JobState::Done { kept: true }
                }
                failed => JobState::Failed { reason: format!("{failed} zones could not be painted") },
            };
            leading.finish(&self.member.board, number, &state)?;
        } else if is_over {
            self.helped = Some(number);
        }
        let how = if is_over { "done" } else { "left" };
        println!("job {number}: {how}, {:.1} M samples here", (studio.samples_done() - before) as f64 / 1e6);
        Ok(is_over)
    }

    /// Whether another job has too few machines for its priority.
    fn elsewhere(&self, number: u32) -> impl Fn() -> bool + Send + 'static {
        let (board, me, refused) = (self.member.board.clone(), self.member.name.clone(), self.refused.clone());
        let begun = Instant::now();
        move || {
            let wanting = || wanting(&board, |number| !refused.contains(&number));
            begun.elapsed() > STAYS && should_move(&me, number, &wanting(), &board.seats())
        }
    }
}

/// Jobs that want machines.
fn wanting(board: &JobBoard, is_wanted: impl Fn(u32) -> bool) -> Vec<Wanting> {
    let all = board.all().into_iter();
    let is_led = |number: u32| board.lead(number).is_some_and(|lead| lead.leader.is_some());
    // Guests paint for somebody.
    let is_possible = |number: u32| !board.uplink.is_guest() || is_led(number);
    let active =
        all.filter(|(number, job)| job.state == JobState::Active && is_wanted(*number) && is_possible(*number));
    active.map(|(number, job)| Wanting { number, priority: job.priority }).collect()
}
