//! Suggestions by meaning: the option or command that corresponds to a word of another program.

use std::ffi::OsString;

use clap::{
    Command,
    builder::StyledStr,
    error::{ContextKind, ContextValue, ErrorKind},
};

use crate::cli::SET_FIELDS;

/// Words of other programs, and the corresponding option. An option that the command does not have is not suggested, so a word
/// may stand in several rows.
const OPTIONS: &[(&str, &[&str])] = &[
    ("spp", &["samples", "sample", "samples-per-pixel", "passes", "iterations", "aa"]),
    ("size", &["resolution", "res", "width", "height", "dimensions", "geometry"]),
    ("max-depth", &["bounces", "max-bounces", "depth", "ray-depth", "recursion"]),
    ("output", &["out", "file", "save", "write", "dest", "destination", "picture", "image"]),
    ("threads", &["cores", "cpus", "processors", "jobs", "parallel", "workers", "nthreads", "num-threads"]),
    ("devices", &["gpu", "gpus", "device", "cuda", "cpu", "vulkan", "backend"]),
    ("gpu", &["device", "devices"]),
    ("error", &["noise", "noise-threshold", "quality", "threshold", "tolerance", "accuracy"]),
    ("time", &["timeout", "time-limit", "limit", "seconds", "duration", "budget"]),
    ("env", &["environment", "hdri", "hdr", "background", "sky", "envmap", "world", "ibl"]),
    ("denoise", &["denoiser", "oidn", "filter-noise"]),
    ("camera", &["cam", "view"]),
    ("frames", &["frame", "animate", "range"]),
    ("at", &["second", "timestamp"]),
    ("fps", &["rate", "frame-rate", "framerate"]),
    ("crop", &["region", "window", "rect", "tile"]),
    ("resume", &["continue", "restart"]),
    ("engine", &["renderer", "with"]),
    ("integrator", &["method", "algorithm", "technique"]),
    ("verbose", &["debug", "log", "info", "stats", "statistics", "report"]),
    ("quiet", &["silent"]),
    ("preview", &["show", "live", "watch"]),
    ("dashboard", &["web", "serve", "browser"]),
    ("farm", &["cluster", "network", "distributed", "server", "remote"]),
    ("listen", &["port", "address", "bind", "host"]),
    ("exposure", &["ev", "brightness", "gain"]),
    ("tonemap", &["tone", "tone-mapping", "view-transform"]),
    ("filter", &["reconstruction", "pixel-filter", "rfilter"]),
    ("aov", &["aovs", "layers", "passes", "channels"]),
    ("agents", &["painters"]),
    ("on", &["notify", "hook"]),
    ("define", &["set", "param", "parameter"]),
];

/// Words of other programs, and the corresponding command.
const COMMANDS: &[(&str, &[&str])] = &[
    ("render", &["paint", "draw", "trace", "image", "picture"]),
    ("info", &["show", "inspect", "describe", "stat", "print"]),
    ("diff", &["compare", "flip", "rmse"]),
    ("analyze", &["analyse", "survey", "zones", "importance"]),
    ("up", &["start", "serve", "server", "master", "farm", "cluster"]),
    ("join", &["worker", "node", "connect", "client"]),
    ("jobs", &["status", "queue", "list", "ls", "job", "cancel", "submit"]),
    ("machines", &["nodes", "workers", "hosts", "machine"]),
    ("devices", &["gpu", "gpus", "cpus", "hardware", "device"]),
    ("engines", &["renderers", "plugins", "engine"]),
    ("config", &["settings", "preferences", "configure"]),
    ("manual", &["man", "docs"]),
    ("simulate", &["replay", "simulation"]),
    ("completions", &["completion"]),
    ("web", &["dashboard", "ui", "page", "api"]),
];

/// Returns the option of a command that an unknown one stands for; `None`: no such option is known.
pub(crate) fn option_meant(command: &Command, word: &str) -> Option<&'static str> {
    let word = word.trim_start_matches('-').to_lowercase();
    let has = |option: &str| command.get_arguments().any(|known| known.get_long() == Some(option));
    OPTIONS.iter().find(|(option, words)| words.contains(&&*word) && has(option)).map(|(option, _)| *option)
}

/// Returns the command that an unknown one stands for; `None`: no such command is known.
pub(crate) fn command_meant(command: &Command, word: &str) -> Option<&'static str> {
    let word = word.to_lowercase();
    let has = |name: &str| command.find_subcommand(name).is_some();
    COMMANDS.iter().find(|(name, words)| words.contains(&&*word) && has(name)).map(|(name, _)| *name)
}

/// Returns the setting of the request field that an unknown option of a command stands for, such as `photons.count=500000`.
pub(crate) fn field_meant(command: &Command, word: &str) -> Option<&'static str> {
    let word = word.trim_start_matches('-');
    let has_set = command.get_arguments().any(|known| known.get_long() == Some("set"));
    SET_FIELDS.iter().find(|(former, _)| *former == word && has_set).map(|(_, field)| *field)
}

/// Makes an error about an unknown word suggest the corresponding option or command, if known; else the suggestion by spelling
/// stays.
///
/// - `words`: the command line, with the program's name first.
pub(crate) fn by_meaning(mut error: clap::Error, program: &Command, words: &[OsString]) -> clap::Error {
    let text = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    };
    let meant = match error.kind() {
        ErrorKind::UnknownArgument => text(ContextKind::InvalidArg).and_then(|word| {
            let command = called(program, words);
            let field = field_meant(command, &word).map(|field| format!("set its field, such as '--set {field}'"));
            field.or_else(|| Some(format!("the option for that is '--{}'", option_meant(command, &word)?)))
        }),
        ErrorKind::InvalidSubcommand => text(ContextKind::InvalidSubcommand).and_then(|word| {
            let command = called(program, words);
            let named = command_meant(command, &word).map(|name| format!("the command for that is '{name}'"));
            // A scene file without a command: suggest `render`.
            let scene = || {
                let is_scene = word.contains('.') && command.find_subcommand("render").is_some();
                is_scene.then(|| format!("to paint a scene: {} render {word} -o picture.png", command.get_name()))
            };
            named.or_else(scene)
        }),
        _ => None,
    };
    if let Some(meant) = meant {
        // Remove the suggestions by spelling; the usage line contains them, too.
        for alike in [ContextKind::SuggestedArg, ContextKind::SuggestedSubcommand, ContextKind::Usage] {
            error.remove(alike);
        }
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(meant)]));
    }
    error
}

/// Returns the command that a command line calls, as far as its words name one.
fn called<'a>(program: &'a Command, words: &[OsString]) -> &'a Command {
    words
        .iter()
        .skip(1)
        .filter_map(|word| word.to_str())
        .fold(program, |command, word| command.find_subcommand(word).unwrap_or(command))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    fn suggestion_for(line: &str) -> String {
        let words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        let error = Cli::command().try_get_matches_from(&words).expect_err(line);
        by_meaning(error, &Cli::command(), &words).render().to_string()
    }

    #[test]
    fn an_option_of_another_program_leads_to_ours() {
        for (line, option) in [
            ("bottega render a.glb -o a.png --samples 4", "--spp"),
            ("bottega render a.glb -o a.png --bounces=4", "--max-depth"),
            ("bottega render a.glb -o a.png --resolution 4x4", "--size"),
            ("bottega analyze a.glb -o a --cores 2", "--threads"),
            ("bottega render a.glb -o a.png --gpu", "--devices"),
        ] {
            let text = suggestion_for(line);
            assert!(text.contains(&format!("the option for that is '{option}'")), "{text}");
            assert!(!text.contains("similar") && !text.contains("--frames"), "{text}");
        }
        for (line, field) in [
            ("bottega render a.glb -o a.png --photons 4", "--set photons.count=500000"),
            ("bottega render a.glb -o a.png --wavefront", "--set integrator.wavefront=true"),
            ("bottega analyze a.glb -o a --importance=visual", "--set work.importance=visual"),
        ] {
            let text = suggestion_for(line);
            assert!(text.contains(&format!("set its field, such as '{field}'")), "{text}");
        }
        // Unknown words get a suggestion by spelling.
        assert!(suggestion_for("bottega render a.glb -o a.png --theads 2").contains("'--threads'"));
    }

    #[test]
    fn a_command_of_another_program_and_a_scene_alone_lead_to_ours() {
        assert!(suggestion_for("bottega compare a.png b.png").contains("the command for that is 'diff'"));
        assert!(suggestion_for("bottega worker").contains("the command for that is 'join'"));
        assert!(suggestion_for("bottega a.glb").contains("bottega render a.glb -o picture.png"));
    }

    #[test]
    fn every_suggestion_exists_and_no_word_is_an_option_itself() {
        let program = Cli::command();
        let all: Vec<&Command> =
            program.get_subcommands().flat_map(|it| std::iter::once(it).chain(it.get_subcommands())).collect();
        for (option, _) in OPTIONS {
            let has = |command: &&Command| command.get_arguments().any(|known| known.get_long() == Some(*option));
            assert!(all.iter().any(has), "no command has --{option}");
        }
        for (name, words) in COMMANDS {
            assert!(program.find_subcommand(name).is_some(), "there is no {name}");
            assert!(words.iter().all(|word| program.find_subcommand(word).is_none()), "{words:?}");
        }
    }
}
