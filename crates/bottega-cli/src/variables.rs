//! Environment variables that stand for options: `BOTTEGA_RENDER_SPP` for `--spp` of `bottega render`.

use clap::{Arg, ArgAction, Command, builder::FalseyValueParser};

use crate::config::OPTION_VARIABLE;

/// Returns the program with a variable for each option that has none yet.
pub(crate) fn with_variables(program: Command) -> Command {
    of_commands(program, OPTION_VARIABLE)
}

fn of_commands(mut command: Command, prefix: &str) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|inner| inner.get_name().to_owned()).collect();
    for name in names {
        command = command.mut_subcommand(&name, |inner| {
            let prefix = format!("{prefix}_{}", variable(&name));
            of_commands(inner.mut_args(|option| with_variable(option, &prefix)), &prefix)
        });
    }
    command
}

fn with_variable(option: Arg, prefix: &str) -> Arg {
    let named = option.get_long().map(variable);
    match (named, option.get_action()) {
        (Some(name), ArgAction::Set | ArgAction::Append) if option.get_env().is_none() => {
            option.env(format!("{prefix}_{name}")).hide_env(true)
        }
        // Any value except `0`, `no`, `false` and `off` turns it on.
        (Some(name), ArgAction::SetTrue) if option.get_env().is_none() => {
            option.env(format!("{prefix}_{name}")).hide_env(true).value_parser(FalseyValueParser::new())
        }
        _ => option,
    }
}

fn variable(name: &str) -> String {
    name.replace('-', "_").to_ascii_uppercase()
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_option_of_every_command_has_a_variable() {
        let program = with_variables(Cli::command());
        let mut count = 0;
        let mut commands: Vec<&Command> = program.get_subcommands().collect();
        while let Some(command) = commands.pop() {
            commands.extend(command.get_subcommands());
            for option in command.get_arguments().filter(|option| option.get_long().is_some()) {
                let is_help = matches!(
                    option.get_action(),
                    ArgAction::Help | ArgAction::Version | ArgAction::HelpLong | ArgAction::HelpShort
                );
                assert!(is_help || option.get_env().is_some(), "{}: {option}", command.get_name());
                count += 1;
            }
        }
        assert!(count > 200, "{count}");
        let render = program.find_subcommand("render").unwrap();
        let spp = render.get_arguments().find(|option| option.get_long() == Some("max-depth")).unwrap();
        assert_eq!(spp.get_env().and_then(|name| name.to_str()), Some("BOTTEGA_RENDER_MAX_DEPTH"));
    }
}
