//! `bottega render --frames 1..240 --farm`: each frame is a job, so a machine has a frame of its own as long as there are enough,
//! and the last ones are painted by all together.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    process::ExitCode,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use bottega_farm::StopSwitch;
use bottega_image::check_writable;

use super::{
    address::state_folder,
    cache::Cache,
    client::{new_job, order, unfetched, write_picture},
    job::{JobState, Order},
    job_board::{JobBoard, ended_badly},
    link::{FarmLink, link},
    part::Member,
    patience::patiently,
    refusals::{RefusalWatch, Refusals},
    studio::Own,
    worker::{CACHE_BYTES, Worker},
};
use crate::{
    cli::RenderArgs, denoise, engines::Material, error::CliError, frames::Frames, parting, render, reporter::Reporter,
    scene::threads,
};

/// How often is looked for frames that are painted.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// A frame that is asked for.
struct Wanted {
    frame: i32,
    /// The number of the work.
    work: u64,
    output: PathBuf,
}

/// Asks a farm for an animation, paints with the others, and has the pictures in the end.
pub(crate) fn animate(args: &RenderArgs, frames: &Frames, stop: &StopSwitch) -> Result<ExitCode, CliError> {
    let reporter = Arc::new(render::reporter(args, None)?);
    if !args.detach {
        // This machine takes part, and is the one whose user can do something about it.
        denoise::ready(args)?;
    }
    let FarmLink { uplink, name, .. } = link(args.farm.as_ref().and_then(Option::as_ref), &args.login)?;
    let board = JobBoard { uplink };
    let wanted = submit(args, frames, &board, &name, stop, &reporter)?;
    if args.detach {
        return Ok(ExitCode::SUCCESS);
    }
    let (threads, refusals) = (threads(&args.scene), Refusals::default());
    let member = Member { board: board.clone(), name, threads, stop: stop.clone(), refusals };
    let only = wanted.keys().copied().collect();
    let over = Arc::new(AtomicBool::new(false));
    let collector = {
        let (args, board, reporter) = (args.clone(), board.clone(), Arc::clone(&reporter));
        let (stop, over) = (stop.clone(), Arc::clone(&over));
        thread::Builder::new().name("frames".to_owned()).spawn(move || {
            let collected = collect(&args, &board, wanted, &reporter, &stop);
            over.store(true, Ordering::Relaxed);
            collected
        })
    };
    let collector = collector.map_err(|error| {
        CliError::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
    })?;
    let say = {
        let reporter = Arc::clone(&reporter);
        move |line: &str| reporter.say(line)
    };
    let cache = Cache::new(state_folder().join("cache"), CACHE_BYTES);
    let own = Own { threads: args.scene.threads, devices: args.devices.clone() };
    let mut worker = Worker::new(member, cache, own, Some(only), Box::new(say));
    while !stop.is_requested() && !over.load(Ordering::Relaxed) {
        worker.work_once();
    }
    worker.leave();
    match collector.join() {
        Ok(collected) => collected,
        // It was told where it happened.
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

/// Asks for the frames. Whatever is wrong is found out with the first of them.
fn submit(
    args: &RenderArgs,
    frames: &Frames,
    board: &JobBoard,
    me: &str,
    stop: &StopSwitch,
    reporter: &Reporter,
) -> Result<BTreeMap<u32, Wanted>, CliError> {
    board.refuse_guests()?;
    let missing = args.missing_frames(frames)?;
    let Some(&first) = missing.first() else { return Ok(BTreeMap::new()) };
    let first = args.at_frame(first)?;
    check_writable(&first.output)?;
    let material = Material::gather(&first)?;
    for warning in &material.warnings {
        reporter.warn(warning.clone());
    }
    board.sweep();
    let (order, sent) = order(board, me, &first, &material, stop, reporter)?;
    let mut wanted = BTreeMap::new();
    for frame in missing {
        let of_frame = args.at_frame(frame)?;
        let mut job = new_job(&of_frame, &material, me);
        job.scene = format!("{}, frame {frame}", job.scene);
        let number = board.submit(&job, &Order { frame: Some(frame), ..order.clone() })?;
        wanted.insert(number, Wanted { frame, work: job.work, output: of_frame.output });
    }
    sent.keep();
    if let (Some((first, _)), Some((last, _))) = (wanted.first_key_value(), wanted.last_key_value()) {
        parting::say_if_ended_at_once(format!(
            "jobs {first} to {last} stay with the farm: `bottega jobs list` shows them, `bottega jobs fetch N` has a picture \
             that is done, `bottega jobs cancel N` calls one off"
        ));
        reporter.say(&match wanted.len() {
            1 => format!("1 frame is job {first} of the farm"),
            count => format!("{count} frames are jobs {first} to {last} of the farm"),
        });
    }
    Ok(wanted)
}

/// Writes the pictures as they come, until all are there or the user wants to stop.
fn collect(
    args: &RenderArgs,
    board: &JobBoard,
    mut wanted: BTreeMap<u32, Wanted>,
    reporter: &Reporter,
    stop: &StopSwitch,
) -> Result<ExitCode, CliError> {
    let (all, say) = (wanted.len(), |line: &str| reporter.say(line));
    let (mut failure, mut watch) = (None, RefusalWatch::default());
    while !wanted.is_empty() && !stop.is_requested() {
        let mut over = Vec::new();
        let seats = board.seats();
        for (seat, refusal) in watch.news(&seats, |work| wanted.values().any(|frame| frame.work == work)) {
            reporter.warn(format!("{} leaves frames out: {}", seat.name, refusal.reason));
        }
        for (&number, Wanted { frame, output, .. }) in &wanted {
            let Some(job) = board.get(number) else {
                over.push(number);
                failure = Some(CliError::failed(format!("frame {frame} is gone"), "somebody has removed its job"));
                continue;
            };
            if let Some(error) = ended_badly(number, &job.state) {
                over.push(number);
                failure = Some(error);
            } else if let JobState::Done { .. } = job.state
                && let Some(picture) = patiently(stop, say, || board.picture(&job))?
            {
                if let Err(error) = write_picture(output, &picture) {
                    failure = Some(unfetched(number, &error));
                    over.push(number);
                    continue;
                }
                if let Some(lacking) = denoise::lacking(args, &picture) {
                    reporter.warn(lacking);
                }
                patiently(stop, say, || board.remove(number))?;
                over.push(number);
                let done = all - wanted.len() + over.len();
                reporter.say(&format!("{} ({done} of {all})", output.display()));
            }
        }
        over.iter().for_each(|number| _ = wanted.remove(number));
        thread::sleep(LOOK_EVERY);
    }
    for &number in wanted.keys() {
        board.change(number, |job| {
            job.say("called off by the one who asked");
            job.state = JobState::Cancelled;
            true
        })?;
    }
    match failure {
        Some(error) => Err(error),
        None if stop.is_requested() => Ok(render::interrupted()),
        None => Ok(ExitCode::SUCCESS),
    }
}
