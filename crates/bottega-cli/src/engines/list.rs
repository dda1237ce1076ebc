//! `bottega engines list` and `check`.

use std::{
    fs,
    path::Path,
    process::ExitCode,
    sync::{Arc, mpsc},
    thread,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
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

use super::args::{EngineCheckArgs, ListArgs, ReleaseArgs};
use crate::{
    error::{CliError, report},
    output::print_report,
};

/// The time after which slow engines are named.
const SAY_AFTER: Duration = Duration::from_millis(500);

/// The answer of an engine.
enum EngineAnswer {
    /// The engine is installed; its worker has not answered yet.
    Found(Arc<LocatedEngine>),
    /// The engine can be used.
    Usable(Arc<LocatedEngine>),
    /// The engine is not installed, or fails.
    Unusable(EngineFault),
}

pub(super) fn list(args: &ListArgs) -> Result<ExitCode, CliError> {
    let shelf = shelf(&args.folders);
    if !args.json {
        println!("builtin   {}   glb gltf xml pbrt obj ply   part of this program", env!("CARGO_PKG_VERSION"));
    }
    let entries: Vec<&ShelfEntry> = shelf.iter().collect();
    let answers = answers(&entries, args.wait);
    for (entry, answer) in entries.into_iter().zip(answers) {
        if args.json {
            println!("{}", described(entry, answer.as_ref(), args.wait));
        } else {
            rows(entry, answer, args.wait).iter().for_each(|row| println!("{row}"));
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

/// Asks all engines concurrently, and returns the answer of each within `wait`; `None`: the search has not finished. Prints the
/// names of slow engines. Searches that have not finished end with this process.
fn answers(entries: &[&ShelfEntry], wait: Duration) -> Vec<Option<EngineAnswer>> {
    let deadline = Instant::now() + wait;
    let (sender, receiver) = mpsc::channel();
    for (index, entry) in entries.iter().enumerate() {
        let (entry, sender) = ((*entry).clone(), sender.clone());
        thread::spawn(move || {
            // An answer that comes too late is dropped.
            ask(&entry, |answer| _ = sender.send((index, answer)));
        });
    }
    drop(sender);
    let mut known: Vec<Option<EngineAnswer>> = entries.iter().map(|_| None).collect();
    let mut say_at = Some(Instant::now() + SAY_AFTER);
    loop {
        let until = say_at.map_or(deadline, |say_at| say_at.min(deadline));
        match receiver.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok((index, answer)) => known[index] = Some(answer),
            Err(mpsc::RecvTimeoutError::Timeout) if say_at.take_if(|_| until < deadline).is_some() => {
                let names = entries.iter().zip(&known).filter(|(_, answer)| is_awaited(answer.as_ref()));
                let names: Vec<&str> = names.map(|(entry, _)| entry.manifest.name.as_str()).collect();
                eprintln!("waiting for {} to answer, {} at most", names.join(", "), duration(wait));
            }
            Err(_) => return known,
        }
    }
}

fn is_awaited(answer: Option<&EngineAnswer>) -> bool {
    matches!(answer, None | Some(EngineAnswer::Found(_)))
}

/// Searches for an engine. A worker engine is usable once its worker has answered.
fn ask(entry: &ShelfEntry, tell: impl Fn(EngineAnswer)) {
    let found = match LocatedEngine::find(entry) {
        Ok(found) => Arc::new(found),
        Err(fault) => return tell(EngineAnswer::Unusable(fault)),
    };
    // A quarantined engine is not started.
    if entry.manifest.kind == EngineKind::Worker && quarantine(&found).is_none() {
        tell(EngineAnswer::Found(Arc::clone(&found)));
        if let Err(fault) = Probe::start(&found) {
            return tell(EngineAnswer::Unusable(fault));
        }
    }
    tell(EngineAnswer::Usable(found));
}

/// Formats an engine as rows for people, with the reason if it cannot be used.
fn rows(entry: &ShelfEntry, answer: Option<EngineAnswer>, wait: Duration) -> Vec<String> {
    let manifest = &entry.manifest;
    let (name, extensions) = (&manifest.name, manifest.scene.extensions.join(" "));
    match answer {
        Some(EngineAnswer::Usable(found)) => {
            let row = format!("{name:<9} {}   {extensions}   {}", found.version, found.program.display());
            let unused =
                quarantine(&found).map(|why| format!("{:<9} not used here: {}", "", quarantine_text(&why, name)));
            [row].into_iter().chain(unused).collect()
        }
        Some(EngineAnswer::Unusable(EngineFault::NotFound { .. } | EngineFault::Version { .. })) => {
            vec![format!("{name:<9} not here   {extensions}   {}", install_hint(manifest))]
        }
        // It is installed but does not work.
        Some(EngineAnswer::Unusable(fault)) => {
            vec![format!("{name:<9} not usable   {extensions}   {}", fault.report())]
        }
        None | Some(EngineAnswer::Found(_)) => {
            vec![format!("{name:<9} starting   {extensions}   {}", late(name, answer.is_some(), wait))]
        }
    }
}

/// Describes the request that an engine has not answered in time.
fn late(name: &str, is_found: bool, wait: Duration) -> String {
    let what = if is_found { "its worker has not answered" } else { "it has not said its version" };
    format!("{what} within {}; `bottega engines check {name}` waits for it", duration(wait))
}

/// Describes an engine as JSON.
fn described(entry: &ShelfEntry, answer: Option<&EngineAnswer>, wait: Duration) -> serde_json::Value {
    let manifest = &entry.manifest;
    let (found, problem) = match answer {
        Some(EngineAnswer::Usable(found)) => (Some(found), None),
        Some(EngineAnswer::Found(found)) => (Some(found), Some(late(&manifest.name, true, wait))),
        Some(EngineAnswer::Unusable(fault)) => (None, Some(fault.report())),
        None => (None, Some(late(&manifest.name, false, wait))),
    };
    json!({
        "name": manifest.name,
        "title": manifest.title,
        "version": found.map(|found| found.version.to_string()),
        "program": found.map(|found| found.program.display().to_string()),
        "problem": problem,
        "quarantine": found.and_then(|found| quarantine(found)),
        "extensions": manifest.scene.extensions,
        "determinism": determinism(manifest),
        "folder": entry.folder,
    })
}

/// Lists the protections against engines that this system lacks, one line each.
fn unguarded() -> Vec<&'static str> {
    let lines = [
        (is_shut_in(), "Engines can use the network of this machine: the system allows no namespaces."),
        (is_fenced_in(), "Engines can read all files that you can: the system has no Landlock."),
    ];
    lines.into_iter().filter(|(holds, _)| !holds).map(|(_, line)| line).collect()
}

/// Describes the quarantine of an engine, and the remedy.
fn quarantine_text(why: &Quarantine, name: &str) -> String {
    let Quarantine { failures, reason, since, .. } = why;
    let then = UNIX_EPOCH.checked_add(Duration::from_secs(*since)).unwrap_or(UNIX_EPOCH);
    let ago = SystemTime::now().duration_since(then).unwrap_or_default();
    let first = reason.lines().next().unwrap_or_default();
    format!(
        "it failed {failures} times in a row, the last time {} ago: {first}; `bottega engines release {name}` releases it",
        duration(ago)
    )
}

/// `bottega engines release`: ends an engine's quarantine.
pub(super) fn release(args: &ReleaseArgs) -> Result<ExitCode, CliError> {
    let name = &entry(&args.folders, &args.name)?.manifest.name.clone();
    let was_quarantined = bottega_engines::external::release(name).map_err(|error| {
        CliError::failed(
            format!("cannot release {name} from quarantine: {error}"),
            "check the permissions of the state folder of bottega",
        )
    })?;
    println!(
        "{}",
        if was_quarantined { format!("{name} is used again") } else { format!("{name} is not in quarantine") }
    );
    Ok(ExitCode::SUCCESS)
}

fn determinism(manifest: &Manifest) -> &'static str {
    match manifest.determinism {
        Determinism::Frame => "frame",
        Determinism::Window => "window",
        Determinism::Statistics => "statistics",
    }
}

pub(super) fn check(args: &EngineCheckArgs) -> Result<ExitCode, CliError> {
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
            format!("{} is not used on this machine: {}", manifest.title, quarantine_text(&why, &manifest.name)),
            "install a new version of it or of its manifest; that ends the quarantine",
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
    let ranges = all.map(|(name, range)| match range {
        Some(range) => format!("{name} {}..{}", range.least, range.most),
        None => format!("no {name}"),
    });
    ranges.join(", ")
}
