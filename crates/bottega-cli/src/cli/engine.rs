//! The options of engines.

use std::path::PathBuf;

use bottega::request::{EngineOptions, RulesSource};
use clap::{Args, ValueHint};

use super::{scene::set, values::parse_define};

/// Options that select engines and configure them.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Engine")]
pub(crate) struct EngineArgs {
    /// Who paints: our own engine (`builtin`, the default), or another renderer that is installed here, see `bottega engines
    /// list`; or both, as `builtin,NAME` or `NAME,builtin`: who is free takes the zone that suits it best, simple ones the engine
    /// named first, complex ones the other.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    engine: Option<Vec<String>>,
    /// Which of two engines suits a zone, as FCL text; default: engine-choice, which comes with the program.
    #[arg(long = "engine-rules", value_name = "FILE", value_hint = ValueHint::FilePath)]
    choice: Option<PathBuf>,
    /// More manifests of engines: the files NAME.toml of this folder.
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    folders: Vec<PathBuf>,
    /// A parameter of the engine's own; its manifest says which there are.
    #[arg(long = "engine-option", value_name = "NAME=VALUE", value_parser = parse_define)]
    options: Vec<(String, String)>,
    /// Let scripts run that are in the scene: only for scenes of people you trust.
    #[arg(long)]
    trust: bool,
    /// Which frame of the animation, for engines that know of frames; default: the one that the scene is at.
    #[arg(long, value_name = "N", conflicts_with = "frames", allow_negative_numbers = true)]
    frame: Option<i32>,
}

impl EngineArgs {
    pub(super) fn apply(&self, engine: &mut EngineOptions) {
        if let Some(names) = &self.engine {
            engine.names.clone_from(names);
        }
        set(&mut engine.rules, self.choice.clone().map(RulesSource::File));
        engine.manifests.extend(self.folders.iter().cloned());
        engine.options.extend(self.options.iter().cloned());
        engine.trust |= self.trust;
        set(&mut engine.frame, self.frame);
    }
}
