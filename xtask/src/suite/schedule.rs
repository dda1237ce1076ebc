//! A scheduler that runs test programs concurrently, as many as keep the processors busy.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
    process::{ExitStatus, Stdio},
    sync::mpsc,
    thread,
    time::Instant,
};

use anyhow::{Context, Result};

use super::{job::TestJob, summary::Summary};
use crate::cost::{self, Cost};

/// A run that has ended.
struct EndedJob {
    name: String,
    load: f64,
    outcome: Result<(ExitStatus, Cost)>,
    log: PathBuf,
}

/// Runs all jobs, and adds their output to the summary. A job starts as soon as enough processors are free, in the order of the
/// list; if it does not fit, a later, smaller one starts before it.
///
/// - `logs`: the folder for the output of each job.
pub(crate) fn run(jobs: Vec<TestJob>, logs: &Path, summary: &mut Summary) -> Result<()> {
    let processors = thread::available_parallelism().map_or(1, usize::from) as f64;
    let (sender, ended) = mpsc::channel();
    let mut waiting = jobs;
    let (mut running, mut load) = (0, 0.0);
    while running > 0 || !waiting.is_empty() {
        while let Some(next) = waiting.iter().position(|job| running == 0 || load + job.load <= processors) {
            let job = waiting.remove(next);
            (running, load) = (running + 1, load + job.load);
            let (sender, log) = (sender.clone(), logs.join(job.name.replace(' ', "-")));
            thread::spawn(move || {
                let outcome = run_one(job.command, &job.name, &log);
                // The receiver is gone only if another job could not be started.
                _ = sender.send(EndedJob { name: job.name, load: job.load, outcome, log });
            });
        }
        let job = ended.recv().context("a test program is waited for")?;
        (running, load) = (running - 1, load - job.load);
        report(&job, summary)?;
    }
    Ok(())
}

fn run_one(mut command: std::process::Command, name: &str, log: &Path) -> Result<(ExitStatus, Cost)> {
    let begun = Instant::now();
    let file = |kind: &str| File::create(log.with_extension(kind));
    command.stdin(Stdio::null()).stdout(file("out")?).stderr(file("err")?);
    let mut child = command.spawn().with_context(|| format!("cannot start {name}"))?;
    cost::wait(&format!("test {name}"), &mut child, begun)
}

/// Adds the output of a job to the summary, and prints one line, and the failures.
fn report(job: &EndedJob, summary: &mut Summary) -> Result<()> {
    let read =
        |kind: &str| fs::read(job.log.with_extension(kind)).map(|text| String::from_utf8_lossy(&text).into_owned());
    let (output, errors) = (read("out")?, read("err")?);
    let before = (summary.passed, summary.failed);
    let shown = summary.add(&job.name, &output);
    let (passed, mut failed) = (summary.passed - before.0, summary.failed - before.1);
    let cost = match &job.outcome {
        Ok((status, cost)) => {
            if !status.success() && failed == 0 {
                summary.add_failure(format!("{}: {status}", job.name));
                failed = 1;
            }
            cost.to_string()
        }
        Err(error) => {
            summary.add_failure(format!("{}: {error:#}", job.name));
            failed = 1;
            String::new()
        }
    };
    println!(
        "{cost}  {}: {passed} passed{}",
        job.name,
        if failed > 0 { format!(", {failed} FAILED") } else { String::new() }
    );
    if failed > 0 {
        shown.iter().for_each(|line| println!("{line}"));
        println!("{errors}");
    }
    Ok(())
}
