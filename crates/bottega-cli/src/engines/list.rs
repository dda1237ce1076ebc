//! `bottega engines list` and `check`.

use std::{
    fs,
    path::Path,
    process::ExitCode,
    sync::Arc,
    thread,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use bottega::{
    engines::{entry, shelf},
    text::duration,
};
use bottega_engines::external::{
    EngineFault, LocatedEngine, Probe, Quarantine, ShelfEntry, install_hint, is_fenced_in, is_shut_in,
    manifest::{Determinism, EngineKind, Manifest},
    quarantine,
};
use serde_json::json;

use super::args::{CheckArgs, ListArgs, ReleaseArgs};
use crate::{
    error::{CliError, report},
    output::print_report,
};

pub(super) fn list(args: &ListArgs) -> Result<ExitCode, CliError> {
    let shelf = shelf(&args.folders);
    if !args.json {
        println!("builtin   {}   glb gltf xml pbrt obj ply   part of this program", env!("CARGO_PKG_VERSION"));
    }
    for (entry, found) in looked_at(&shelf.iter().collect::<Vec<_>>()) {
        let manifest = &entry.manifest;
        if args.json {
            let (version, problem) = match &found {
                Ok(found) => (Some(found.version.to_string()), None),
                Err(fault) => (None, Some(fault.told())),
            };
            let quarantine = found.as_ref().ok().and_then(|found| quarantine(found));
            let program = found.as_ref().ok().map(|found| found.program.display().to_string());
            println!(
                "{}",
                json!({
                    "name": manifest.name,
                    "title": manifest.title,
                    "version": version,
                    "program": program,
                    "problem": problem,
                    "quarantine": quarantine,
                    "extensions": manifest.scene.extensions,
                    "determinism": determinism(manifest),
                    "folder": entry.folder,
                })
            );
            continue;
        }
        let extensions = manifest.scene.extensions.join(" ");
        match found {
            Ok(found) => {
                println!("{:<9} {}   {extensions}   {}", manifest.name, found.version, found.program.display());
                if let Some(why) = quarantine(&found) {
                    println!("{:<9} not used here: {}", "", told(&why, &manifest.name));
                }
            }
            Err(EngineFault::NotFound { .. } | EngineFault::Version { .. }) => {
                println!("{:<9} not here   {extensions}   {}", manifest.name, install_hint(manifest));
            }
            // It is here, and nothing comes of it.
            Err(fault) => println!("{:<9} not usable   {extensions}   {}", manifest.name, fault.told()),
        }
    }
    for broken in &shelf.broken {
        print_report(&report(&bottega::Error::Manifest(Box::new(broken.clone())).into()));
    }
    if !args.json {
        unguarded().iter().for_each(|line| print!("\n{line}\n"));
    }
    Ok(ExitCode::SUCCESS)
}

/// Looks for engines, all at the same time. One that paints by a worker is there when that has answered.
fn looked_at<'a>(entries: &[&'a ShelfEntry]) -> Vec<(&'a ShelfEntry, Result<Arc<LocatedEngine>, EngineFault>)> {
    let look = |entry: &ShelfEntry| {
        let found = Arc::new(LocatedEngine::find(entry)?);
        // One that is not used here is not started either.
        if entry.manifest.kind == EngineKind::Worker && quarantine(&found).is_none() {
            Probe::start(&found)?;
        }
        Ok(found)
    };
    thread::scope(|scope| {
        let started: Vec<_> = entries.iter().map(|&entry| (entry, scope.spawn(move || look(entry)))).collect();
        let ended = started
            .into_iter()
            .map(|(entry, look)| (entry, look.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))));
        ended.collect()
    })
}

/// What the system does not keep from engines, a line each.
fn unguarded() -> Vec<&'static str> {
    let lines = [
        (is_shut_in(), "Engines have the network of this machine: the system allows no namespaces."),
        (is_fenced_in(), "Engines see all files that you may read: the system has no Landlock."),
    ];
    lines.into_iter().filter(|(holds, _)| !holds).map(|(_, line)| line).collect()
}

/// Why an engine is not used, and what to do.
fn told(why: &Quarantine, name: &str) -> String {
    let Quarantine { failures, reason, since, .. } = why;
    let then = UNIX_EPOCH.checked_add(Duration::from_secs(*since)).unwrap_or(UNIX_EPOCH);
    let ago = SystemTime::now().duration_since(then).unwrap_or_default();
    let first = reason.lines().next().unwrap_or_default();
    format!(
        "it failed {failures} times in a row, the last time {} ago: {first}; `bottega engines release {name}` lets it in again",
        duration(ago)
    )
}

/// `bottega engines release`.
pub(super) fn release(args: &ReleaseArgs) -> Result<ExitCode, CliError> {
    let name = &entry(&args.folders, &args.name)?.manifest.name.clone();
    let was_out = bottega_engines::external::release(name).map_err(|error| {
        CliError::failed(
            format!("{name} cannot be let in again: {error}"),
            "see whose the folder of bottega's state is",
        )
    })?;
    println!("{}", if was_out { format!("{name} is used again") } else { format!("{name} was not shut out") });
    Ok(ExitCode::SUCCESS)
}

fn determinism(manifest: &Manifest) -> &'static str {
    match manifest.determinism {
        Determinism::Frame => "frame",
        Determinism::Window => "window",
        Determinism::Statistics => "statistics",
    }
}

pub(super) fn check(args: &CheckArgs) -> Result<ExitCode, CliError> {
    let path = Path::new(&args.name);
    let entry = if path.extension().is_some_and(|extension| extension == "toml") {
        let text = fs::read_to_string(path).map_err(|source| CliError::read(path.to_owned(), source))?;
        ShelfEntry::from_file(path, &text).map_err(|error| bottega::Error::Manifest(Box::new(error)))?
    } else {
        entry(&args.folders, &args.name)?
    };
    let manifest = &entry.manifest;
    println!("manifest  {}: sound, format {}", manifest.title, manifest.manifest);
    println!("scenes    {}", manifest.scene.extensions.join(" "));
    println!("tunables  {}", tunables(manifest));
    let windows = match manifest.determinism {
        Determinism::Frame => "have the bits of the whole frame",
        Determinism::Window => "are the same for the same seed, and agree with the whole frame in their statistics",
        Determinism::Statistics => "agree with the whole frame in their statistics",
    };
    println!("windows   {windows}");
    let failed = |source| bottega::Error::External { engine: manifest.name.clone(), source };
    let located = LocatedEngine::find(&entry).map_err(failed)?;
    println!("found     {}, version {}", located.program.display(), located.version);
    if let Some(why) = quarantine(&located) {
        return Err(CliError::failed(
            format!("{} is not used on this machine: {}", manifest.title, told(&why, &manifest.name)),
            "a new version of it, or of its manifest, is used again by itself",
        ));
    }
    if manifest.kind == EngineKind::Worker {
        let Probe { seconds } = Probe::start(&located.into()).map_err(failed)?;
        println!("worker    ready after {seconds:.2} s");
    }
    let shut_in = if is_shut_in() { "no network, its own processes" } else { "a process group of its own" };
    let fenced_in = if is_fenced_in() { ", no files but its own and the scene's" } else { "" };
    println!("shut in   {shut_in}{fenced_in}");
    unguarded().iter().for_each(|line| println!("          {line}"));
    Ok(ExitCode::SUCCESS)
}

fn tunables(manifest: &Manifest) -> String {
    let tunables = &manifest.tunables;
    let all = [
        ("samples", tunables.samples),
        ("maximum depth", tunables.max_depth),
        ("light samples", tunables.light_samples),
        ("time", tunables.time),
    ];
    let told = all.map(|(name, range)| match range {
        Some(range) => format!("{name} {}..{}", range.least, range.most),
        None => format!("no {name}"),
    });
    told.join(", ")
}
