//! Commands to jobs of a farm, and download of their pictures.

use std::{
    fs,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use bottega::journal::{is_journal_of, journal_of};

use crate::{
    client::submit::{unfetched, write_picture},
    error::Error,
    job::{
        board::JobBoard,
        record::{Job, JobState},
    },
};

/// Returns a job that this machine may see.
///
/// # Errors
/// No job has that number, or this machine is a guest that has not worked on it.
pub fn known(board: &JobBoard, number: u32) -> Result<Job, Error> {
    board.shown_job(number)
}

/// Waits until this process sees a job that another of its connections has submitted, at most 30 s: notices take a moment to
/// reach each connection, and seconds after a server lost a consumer.
pub fn wait_until_known(board: &JobBoard, number: u32) {
    const MOMENT: Duration = Duration::from_secs(30);
    let begun = Instant::now();
    while board.get(number).is_none() && begun.elapsed() < MOMENT {
        thread::sleep(Duration::from_millis(5));
    }
}

/// Pauses, resumes or cancels a job, and logs who did it.
///
/// - `to`: the new state: active, paused or cancelled.
/// - `by`: the name of the user, for the log.
///
/// # Errors
/// There is no such job, it is over, this machine is a guest, or the farm does not store the change.
pub fn steer(board: &JobBoard, number: u32, to: &JobState, by: &str) -> Result<(), Error> {
    let done = match to {
        JobState::Active => "resumed",
        JobState::Cancelled => "cancelled",
        state => state.word(),
    };
    let before = known(board, number)?.state;
    if before.is_over() {
        return Err(Error::failed(
            format!("job {number} is over: {}", before.word()),
            "`bottega jobs list` shows the other jobs",
        ));
    }
    board.change(number, |job| {
        let changes = !job.state.is_over() && job.state != *to;
        if changes {
            job.say(format!("{done} by {by}"));
            job.state = to.clone();
        }
        changes
    })?;
    Ok(())
}

/// Sets the priority of a job, and logs who did it.
///
/// - `priority`: the job's weight when jobs share the machines, 1 to 1000; not checked here.
/// - `by`: the name of the user, for the log.
///
/// # Errors
/// There is no such job, this machine is a guest, or the farm does not store the change.
pub fn set_priority(board: &JobBoard, number: u32, priority: u32, by: &str) -> Result<(), Error> {
    let change = board.change(number, |job| {
        job.say(format!("priority {priority}, says {by}"));
        job.priority = priority;
        true
    });
    change.map(drop)
}

/// Writes the stored picture of a job; while it is rendered again, its previous picture. Deletes a journal of the same picture
/// beside it. Returns the path written.
///
/// - `output`: the file to write; `None`: the output of the request, [`Job::output`].
///
/// # Errors
/// There is no such job, the farm does not store its picture or does not answer, or the file cannot be written.
pub fn fetch(board: &JobBoard, number: u32, output: Option<PathBuf>) -> Result<PathBuf, Error> {
    let job = known(board, number)?;
    let picture = if job.kept { board.picture(&job)? } else { None };
    let picture =
        picture.ok_or_else(|| Error::failed("the farm has no picture of this job", no_picture(number, &job)))?;
    let output = output.unwrap_or_else(|| PathBuf::from(&job.output));
    write_picture(&output, &picture).map_err(|error| unfetched(number, &error))?;
    forget_journal(board, &job, &output);
    Ok(output)
}

/// Returns advice for the user when the farm does not store a job's picture.
///
/// - `number`: the number of the job.
pub fn no_picture(number: u32, job: &Job) -> String {
    match &job.state {
        _ if job.kept => "somebody has removed it: submit it again".to_owned(),
        JobState::Done => format!("{} wrote it to {}", job.from, job.output),
        state => format!("the job is {}: see `bottega jobs show {number}`", state.word()),
    }
}

/// Removes the journal that a killed submitter left beside the picture, which is complete now. A journal of another picture
/// stays.
fn forget_journal(board: &JobBoard, job: &Job, output: &Path) {
    let path = journal_of(output);
    let Some(name) = board.spec(job).ok().and_then(|order| order.journal) else { return };
    if is_journal_of(&path, &name)
        && let Err(error) = fs::remove_file(&path)
    {
        tracing::warn!("cannot remove {}, which is not needed any more: {error}", path.display());
    }
}

/// Deletes a job that is over, its picture, and its scene unless a job that is not over needs it.
///
/// # Errors
/// There is no such job, it is not over, this machine is a guest, or the farm does not answer.
pub fn remove(board: &JobBoard, number: u32) -> Result<(), Error> {
    let job = known(board, number)?;
    if !job.state.is_over() {
        return Err(Error::failed(
            format!("job {number} is not over"),
            format!("cancel it first: bottega jobs cancel {number}"),
        ));
    }
    board.remove_with_scene(number)
}
