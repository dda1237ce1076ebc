//! The short help: `-h` shows the most used options on one screen; `--help` shows everything, in sections.

use clap::{Arg, Command, builder::StyledStr};

use crate::command_groups::grouped;

/// A command and the options that its `-h` shows, the most used first, for commands with more options than fit a screen. An empty
/// text stands for the first sentence of the long help.
type ShownOptions = (&'static str, &'static [(&'static str, &'static str)]);

const OPTIONS: &[ShownOptions] = &[
    (
        "render",
        &[
            ("scene_file", "The scene: .glb, .gltf, .usd, .usdz, .xml (Mitsuba), .pbrt, .obj, .ply, .vdb"),
            ("output", "The picture to write: .exr (linear light) or .png (tone-mapped)"),
            ("size", ""),
            ("spp", "Samples per pixel; default: the scene file's, or 64"),
            ("error", "Paint until the estimated relative error is at most this, such as 0.05"),
            ("time", "The best picture within this time, such as 90s, 10m or 1.5h"),
            ("optimize", ""),
            ("denoise", "Denoise the finished picture"),
            ("camera", ""),
            ("max_depth", "Bounces of light; default: the scene file's, or 16"),
            ("env", "Environment light: a picture, a radiance or the sky"),
            ("exposure", ""),
            ("farm", "Paint with all machines of a farm"),
            ("engine", "Another renderer, if it is installed"),
            ("devices", "Devices that paint: auto, cpu, or names of GPUs"),
            ("threads", ""),
            ("frames", "Frames of an animation, such as 1..24"),
            ("resume", ""),
            ("preview", "Show the picture in this file while it is painted"),
            ("verbose", "Also report how the work was divided"),
        ],
    ),
    (
        "analyze",
        &[("scene_file", ""), ("output", ""), ("size", ""), ("fields", ""), ("verify", ""), ("ludd", ""), ("json", "")],
    ),
    (
        "simulate",
        &[
            ("record", ""),
            ("synthetic", ""),
            ("agents", "Agents: `8`, `4x1.0,4x0.25` (how many x how fast), `agent-3@fail=12s`, …"),
            ("fail", ""),
            ("auction", ""),
            ("latency", ""),
            ("loss", ""),
            ("seed", ""),
            ("output", ""),
            ("validate", ""),
            ("json", ""),
        ],
    ),
];

/// Returns the program for this command line: with short help if `-h` is given, or no arguments.
pub(crate) fn fitting(program: Command) -> Command {
    let mut words = std::env::args_os().skip(1).take_while(|word| word != "--").peekable();
    let is_short = words.peek().is_none() || words.any(|word| word == "-h");
    let program = grouped(program, is_short);
    if is_short { shortened(program) } else { program }
}

/// Adds the short help to the program's commands.
fn shortened(mut program: Command) -> Command {
    for (name, options) in OPTIONS {
        program = program.mut_subcommand(name, |command| {
            let more = format!("All options, in sections: bottega {name} --help");
            command.after_help(more).mut_args(|option| shown(option, options))
        });
    }
    program
}

/// Returns an option for the short help: in one list, with a short text; or hidden.
fn shown(option: Arg, options: &[(&str, &str)]) -> Arg {
    let Some(order) = options.iter().position(|(name, _)| *name == option.get_id().as_str()) else {
        return option.hide(true);
    };
    let text = option.get_help().map(StyledStr::to_string).unwrap_or_default();
    let text = if options[order].1.is_empty() { first_sentence(&text) } else { options[order].1 }.to_owned();
    let option = if option.is_positional() { option } else { option.help_heading(None::<&str>) };
    option.help(text).display_order(order)
}

fn first_sentence(text: &str) -> &str {
    let end = [". ", "; "].iter().filter_map(|end| text.find(end)).min().unwrap_or(text.len());
    text[..end].trim_end_matches('.')
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    /// The height of a small terminal, in lines.
    const SCREEN: usize = 32;

    #[test]
    fn the_short_help_of_a_command_fits_a_screen_and_names_what_exists() {
        let mut program = shortened(Cli::command()).term_width(100);
        program.build();
        for (name, options) in OPTIONS {
            let command = program.find_subcommand_mut(name).expect("it exists");
            for (option, _) in *options {
                assert!(command.get_arguments().any(|known| known.get_id() == option), "{name} has no {option}");
            }
            let mut command = command.clone().term_width(100);
            let text = command.render_help().to_string();
            assert!(text.lines().count() <= SCREEN, "{} lines: {text}", text.lines().count());
        }
    }

    #[test]
    fn the_first_sentence_ends_where_it_ends() {
        assert_eq!(first_sentence("Samples a pixel; default: 64"), "Samples a pixel");
        assert_eq!(first_sentence("A file such as a.png"), "A file such as a.png");
        assert_eq!(first_sentence("One. Two."), "One");
    }
}
