//! The manual's page of all commands with their options.

use std::fmt::Write;

use clap::{Arg, ArgAction, Command, builder::StyledStr};

const HEAD: &str = "<!-- Made by `cargo xtask manual`; do not edit. -->

# Commands

`bottega COMMAND --help` prints the same; `man bottega-COMMAND` too, where a package has installed the pages. Each option has a
variable of the environment, and may stand in the [configuration file](configuration.md).
";

/// Returns the page on commands: a section per command, a table per group of options.
pub(super) fn reference(program: Command) -> String {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    let mut page = HEAD.to_owned();
    for command in program.get_subcommands() {
        write_section(&mut page, command, 2);
    }
    // Remove repeated empty lines.
    while page.contains("\n\n\n") {
        page = page.replace("\n\n\n", "\n\n");
    }
    page
}

/// - `depth`: the level of the heading.
fn write_section(page: &mut String, command: &Command, depth: usize) {
    let name = command.get_bin_name().unwrap_or_else(|| command.get_name());
    let about = command.get_long_about().or(command.get_about());
    let usage = command.clone().render_usage().to_string();
    let usage = usage.trim_start_matches("Usage:").trim();
    // Writing to a `String` cannot fail.
    _ = write!(page, "\n{} `{name}`\n\n{}\n\n```text\n{usage}\n```\n\n", "#".repeat(depth), text_of(about));
    let shown = |option: &&Arg| !option.is_hide_set() && !is_everywhere(option);
    let mut groups: Vec<(&str, Vec<&Arg>)> = Vec::new();
    for option in command.get_arguments().filter(shown) {
        let heading = option.get_help_heading().unwrap_or_default();
        match groups.iter_mut().find(|(known, _)| *known == heading) {
            Some((_, options)) => options.push(option),
            None => groups.push((heading, vec![option])),
        }
    }
    for (heading, options) in groups {
        if !heading.is_empty() {
            _ = write!(page, "\n**{heading}**\n\n");
        }
        page.push_str("| option | what |\n|---|---|\n");
        for option in options {
            _ = writeln!(page, "| {} | {} |", names(option), cell(&description(option)));
        }
        page.push('\n');
    }
    if let Some(more) = command.get_after_long_help().or(command.get_after_help()) {
        _ = write!(page, "\n```text\n{}\n```\n\n", more.to_string().trim());
    }
    for inner in command.get_subcommands().filter(|inner| !inner.is_hide_set()) {
        write_section(page, inner, depth + 1);
    }
}

/// Returns true if every command has the option.
fn is_everywhere(option: &Arg) -> bool {
    ["help", "version", "profile"].contains(&option.get_id().as_str())
}

/// Returns the option as typed, with its value.
fn names(option: &Arg) -> String {
    let short = option.get_short().map(|short| format!("-{short}"));
    let long = option.get_long().map(|long| format!("--{long}"));
    let flags = short.into_iter().chain(long).collect::<Vec<_>>().join(", ");
    let values = option.get_value_names().unwrap_or_default().iter().map(ToString::to_string).collect::<Vec<_>>();
    let takes_value = matches!(option.get_action(), ArgAction::Set | ArgAction::Append);
    let values = if takes_value { values.join(" ") } else { String::new() };
    let may_lack = option.get_num_args().is_some_and(|range| range.min_values() == 0);
    let text = match (flags.is_empty(), values.is_empty()) {
        (true, _) => values,
        (false, true) => flags,
        (false, false) if may_lack => format!("{flags}[={values}]"),
        (false, false) => format!("{flags} {values}"),
    };
    format!("`{text}`").replace('|', "\\|")
}

/// Returns the help of an option, with the additions that clap makes.
fn description(option: &Arg) -> String {
    let mut text = text_of(option.get_long_help().or(option.get_help()));
    let possible = option.get_possible_values();
    let possible: Vec<_> = possible.iter().filter(|value| !value.is_hide_set()).collect();
    let takes_value = matches!(option.get_action(), ArgAction::Set | ArgAction::Append);
    if takes_value && !option.is_hide_possible_values_set() && !possible.is_empty() {
        let names = possible.iter().map(|value| format!("`{}`", value.get_name())).collect::<Vec<_>>();
        text += &format!(" One of {}.", names.join(", "));
    }
    let defaults = option.get_default_values().iter().map(|value| value.to_string_lossy()).collect::<Vec<_>>();
    if takes_value && !defaults.is_empty() && !option.is_hide_default_value_set() {
        text += &format!(" Default: `{}`.", defaults.join(" "));
    }
    text
}

fn text_of(text: Option<&StyledStr>) -> String {
    let text = text.map(ToString::to_string).unwrap_or_default();
    let text = text.trim();
    let ends = text.is_empty() || text.ends_with(['.', ':', ']', '!', '?']);
    let text = if ends { text.to_owned() } else { format!("{text}.") };
    // Escape `<`, which Markdown may take for HTML, except in code.
    let parts = text.split('`').enumerate();
    let parts = parts.map(|(number, part)| if number % 2 == 0 { part.replace('<', "&lt;") } else { part.to_owned() });
    parts.collect::<Vec<_>>().join("`")
}

/// Formats a text as one cell of a table.
fn cell(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_has_its_options_their_values_and_its_inner_commands() {
        let inner = Command::new("list").about("List them");
        let number = Arg::new("number").long("number").short('n').value_name("A|B").default_value("3").help("How many");
        let program =
            Command::new("p").subcommand(Command::new("jobs").about("See jobs").arg(number).subcommand(inner));
        let page = reference(program);
        assert!(page.contains("## `p jobs`\n\nSee jobs.\n"), "{page}");
        assert!(page.contains("| `-n, --number A\\|B` | How many. Default: `3`. |"), "{page}");
        assert!(page.contains("### `p jobs list`\n\nList them.\n"), "{page}");
    }
}
