//! Engines that other people wrote: listed, checked, tried, and painted with.

mod args;
mod attempt;
mod layers;
mod list;
mod material;
mod painter;
mod render;

use std::{path::PathBuf, process::ExitCode, sync::Arc};

use args::EnginesCommand;
pub(crate) use args::{EngineArgs, EnginesArgs};
pub(crate) use attempt::{Trial, absolute, parameters};
use bottega_engines::external::{self, Entry, Located, Shelf};
pub(crate) use material::Material;
pub(crate) use painter::Painter;
pub(crate) use render::one;

use crate::{
    cli::RenderArgs,
    error::CliError,
    farm::state_folder,
    rules::{RulesText, rule_texts},
};

/// The name of our own engine.
pub(crate) const BUILTIN: &str = "builtin";

pub(crate) fn run(args: &EnginesArgs) -> Result<ExitCode, CliError> {
    match &args.command {
        EnginesCommand::List(args) => list::list(args),
        EnginesCommand::Check(args) => list::check(args),
        EnginesCommand::Try(args) => attempt::run(args),
        EnginesCommand::Release(args) => list::release(args),
    }
}

/// The manifests of the program, of the user, and of these folders.
fn shelf(folders: &[PathBuf]) -> Shelf {
    let config = std::env::var_os("XDG_CONFIG_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let config = config.or_else(|| std::env::home_dir().map(|home| home.join(".config")));
    let own = config.map(|config| config.join("bottega").join("engines"));
    Shelf::open(&own.into_iter().chain(folders.iter().cloned()).collect::<Vec<_>>())
}

/// From now on it is known to later processes which engines are not used on this machine.
pub(crate) fn keep_quarantines() {
    external::keep_quarantines_in(state_folder().join("engines"));
}

/// The rules of the agents, as the user says, or else those of the engine that paints; none: those of our own.
pub(crate) fn rules(args: &RenderArgs) -> Result<Vec<RulesText>, CliError> {
    if !args.rules.is_empty() || args.engines.is_builtin() {
        return rule_texts(&args.rules);
    }
    let (name, is_mixed) = args.engines.other()?;
    // Two engines get what either of them is content with.
    let own = if is_mixed { None } else { RulesText::of_engine(&entry(&args.engines.folders, name)?)? };
    Ok(own.into_iter().collect())
}

/// The rules for who paints a zone, where several engines may.
pub(crate) fn choice(args: &RenderArgs) -> Result<Option<RulesText>, CliError> {
    let asked = args.engines.choice.as_deref();
    if args.engines.engine.len() > 1 {
        return RulesText::of_choice(asked).map(Some);
    }
    match asked {
        None => Ok(None),
        Some(_) => Err(CliError::usage(
            "--engine-rules is for pictures that two engines paint",
            "name both, as --engine builtin,NAME, or leave it out",
        )),
    }
}

/// The manifest of an engine.
fn entry(folders: &[PathBuf], name: &str) -> Result<Entry, CliError> {
    let shelf = shelf(folders);
    // A broken one is not silently replaced by another of the same name.
    if let Some(broken) = shelf.broken(name) {
        return Err(CliError::manifest(broken.clone()));
    }
    shelf.get(name).cloned().ok_or_else(|| {
        let known: Vec<&str> = shelf.iter().map(|entry| entry.manifest.name.as_str()).collect();
        CliError::usage(
            format!("there is no engine `{name}`"),
            format!("there are {BUILTIN}, {}; further manifests are read from --engines FOLDER", known.join(", ")),
        )
    })
}

/// An engine on this machine.
pub(crate) fn located(folders: &[PathBuf], name: &str) -> Result<Arc<Located>, CliError> {
    let entry = entry(folders, name)?;
    let found = Located::find(&entry).map(Arc::new);
    found.map_err(|source| CliError::External { engine: name.to_owned(), source })
}
