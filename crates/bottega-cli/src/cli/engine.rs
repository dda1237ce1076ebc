//! The options of engines.

use std::path::PathBuf;

use bottega::request::EngineOptions;
use clap::{Args, ValueHint};

use super::{fields::help, scene::set, values::parse_define};

/// Options that select engines and configure them.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Engine")]
pub(crate) struct EngineArgs {
    #[arg(long, value_name = "NAME", value_delimiter = ',', help = help("engine.names"))]
    engine: Option<Vec<String>>,
    #[arg(long = "engines", value_name = "FOLDER", value_hint = ValueHint::DirPath, help = help("engine.manifests"))]
    folders: Vec<PathBuf>,
    #[arg(long = "engine-option", value_name = "NAME=VALUE", value_parser = parse_define, help = help("engine.options"))]
    options: Vec<(String, String)>,
    #[arg(long, help = help("engine.trust"))]
    trust: bool,
    #[arg(long, value_name = "N", conflicts_with = "frames", allow_negative_numbers = true, help = help("engine.frame"))]
    frame: Option<i32>,
}

impl EngineArgs {
    pub(super) fn apply(&self, engine: &mut EngineOptions) {
        if let Some(names) = &self.engine {
            engine.names.clone_from(names);
        }
        engine.manifests.extend(self.folders.iter().cloned());
        engine.options.extend(self.options.iter().cloned());
        engine.trust |= self.trust;
        set(&mut engine.frame, self.frame);
    }
}
