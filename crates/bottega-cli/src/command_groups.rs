//! The groups of commands in the program's own help.

use std::fmt::Write as _;

use clap::Command;

/// A heading with its commands: `usual` ones appear in the short help, `others` only in the long one.
struct CommandGroup {
    heading: &'static str,
    usual: &'static [&'static str],
    others: &'static [&'static str],
}

/// All groups, the most used first.
const GROUPS: [CommandGroup; 5] = [
    CommandGroup { heading: "Pictures", usual: &["render", "info", "diff", "analyze"], others: &["request"] },
    CommandGroup {
        heading: "Many machines",
        usual: &["up", "join", "jobs", "machines"],
        others: &["blackboard", "web", "tokens"],
    },
    CommandGroup { heading: "This machine", usual: &["devices", "engines", "config"], others: &["board"] },
    CommandGroup { heading: "Agents and their rules", usual: &[], others: &["rules", "simulate", "platform"] },
    CommandGroup { heading: "The program itself", usual: &[], others: &["manual", "completions"] },
];

/// The maximum width of the short help, for a terminal of 80 columns.
const COLUMNS: usize = 80;

/// Returns the program with its commands in groups: all of them, or only the most used.
pub(crate) fn grouped(program: Command, is_short: bool) -> Command {
    let text = if is_short { short(&program) } else { long(&program) };
    program.help_template(format!("{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{text}"))
}

fn short(program: &Command) -> String {
    let mut text = sections(program, |group| group.usual.to_vec());
    let mut line = String::from("More:");
    for name in GROUPS.iter().flat_map(|group| group.others) {
        if line.len() + 2 + name.len() > COLUMNS {
            _ = writeln!(text, "{line}");
            line = String::from("     ");
        }
        _ = write!(line, " {name}");
    }
    _ = write!(
        text,
        "{line}\n\n`bottega --help` describes all, `bottega COMMAND -h` the options of one.\n\
         Start with: bottega render scene.glb -o picture.png\n"
    );
    text
}

fn long(program: &Command) -> String {
    let sections = sections(program, |group| [group.usual, group.others].concat());
    format!(
        "{sections}\n{{options}}\n\n`bottega COMMAND -h` describes the most used options, `--help` all of them.\n\
         Start with: bottega render scene.glb -o picture.png\n"
    )
}

/// Returns a section per group that has commands: its heading, and one line per command.
fn sections(program: &Command, commands: impl Fn(&CommandGroup) -> Vec<&'static str>) -> String {
    let styles = program.get_styles();
    let (header, literal) = (styles.get_header(), styles.get_literal());
    let mut text = String::new();
    for group in &GROUPS {
        let names = commands(group);
        if !names.is_empty() {
            _ = writeln!(text, "{header}{}:{header:#}", group.heading);
        }
        for command in names.iter().filter_map(|name| program.find_subcommand(name)) {
            let about = command.get_about().map(ToString::to_string).unwrap_or_default();
            _ = writeln!(text, "  {literal}{:<12}{literal:#} {about}", command.get_name());
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    /// The height of a common terminal, in lines.
    const LINES: usize = 24;

    #[test]
    fn every_command_is_in_one_group_and_the_short_help_fits_a_terminal() {
        for command in Cli::command().get_subcommands().map(Command::get_name) {
            let all = GROUPS.iter().flat_map(|group| [group.usual, group.others].concat());
            assert_eq!(all.filter(|name| *name == command).count(), 1, "{command}");
        }
        let [short, long] = [true, false].map(|is_short| grouped(Cli::command(), is_short).render_help().to_string());
        assert!(short.lines().count() < LINES, "{short}");
        for text in [&short, &long] {
            assert!(text.lines().all(|line| line.chars().count() <= COLUMNS), "{text}");
            for command in Cli::command().get_subcommands() {
                assert!(text.contains(command.get_name()), "{}: {text}", command.get_name());
            }
        }
    }
}
