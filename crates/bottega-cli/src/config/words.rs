//! The words that the configuration file adds to a command line.
//!
//! The file's options are inserted as if typed, before the user's own, so they follow the same rules and give the same errors.
//! The user's options win: an option of the file is omitted if it is set on the command line or in the environment, or if it
//! conflicts with one that is.

use std::ffi::OsString;

use clap::{Arg, ArgAction, ArgMatches, Command, parser::ValueSource};
use toml::{
    Spanned,
    de::{DeString, DeTable, DeValue},
};

use super::{ConfigFile, FARM, PROFILE, PROFILE_VARIABLE, kind};
use crate::{
    error::CliError,
    suggestions::{command_meant, field_meant, option_meant},
};

/// The prefix of environment variables that stand for options: `BOTTEGA_RENDER_SPP`.
pub(crate) const OPTION_VARIABLE: &str = "BOTTEGA";

/// Options of `render` that give a complete request: the file's options do not apply to it.
const WHOLE_REQUESTS: [&str; 2] = ["request", "from"];

type NamedValue<'a> = (&'a Spanned<DeString<'a>>, &'a Spanned<DeValue<'a>>);

/// Returns the command line with the options of the configuration file added.
///
/// - `words`: the command line, with the program's name first.
/// - `program`: the options of the program.
pub(crate) fn with_config(words: Vec<OsString>, program: &Command) -> Result<Vec<OsString>, CliError> {
    let typed = Typed::of(&words, program);
    // `bottega config` must run with an invalid file, to report its errors.
    if typed.path.first().is_some_and(|command| command == "config") {
        return Ok(words);
    }
    let Some(file) = ConfigFile::read()? else {
        return match typed.profile() {
            Some(name) => Err(no_profile(&name, &super::path().display().to_string(), &[])),
            None => Ok(words),
        };
    };
    let tables = file.tables()?;
    file.take_farm(&tables)?;
    check_names(&file, &tables, program)?;
    if typed.is_whole_request() {
        return if typed.names_profile() { Err(whole_and_profile()) } else { Ok(words) };
    }
    let profile = typed.profile();
    let mut said = Vec::new();
    if let Some(name) = &profile {
        let profiles = tables.iter().find(|(key, _)| key.get_ref() == PROFILE).and_then(|(_, value)| table(value));
        let found = profiles.and_then(|profiles| profiles.iter().find(|(key, _)| key.get_ref() == name));
        let Some((_, profile)) = found else {
            let known = profiles.into_iter().flatten().map(|(key, _)| format!("`{}`", key.get_ref()));
            return Err(no_profile(name, &file.path.display().to_string(), &known.collect::<Vec<_>>()));
        };
        said.extend(typed.options(table(profile)));
    }
    // The profile's options win over the file's, and come first.
    said.extend(typed.options(Some(&tables)));
    typed.with(&file, said, words)
}

fn whole_and_profile() -> CliError {
    CliError::usage("a request is complete and uses no profile", "leave out --profile, or --request and --from")
}

fn no_profile(name: &str, file: &str, known: &[String]) -> CliError {
    let remedy = if known.is_empty() {
        format!("write one into `{file}`: [profile.{name}.render], and below it spp = 16")
    } else {
        format!("there are {}", known.join(", "))
    };
    CliError::usage(format!("there is no profile `{name}` in `{file}`"), remedy)
}

fn table<'a>(value: &'a Spanned<DeValue<'a>>) -> Option<&'a DeTable<'a>> {
    value.get_ref().as_table()
}

/// A command line parsed as far as possible: required options may still be missing, because the file provides them.
struct Typed<'a> {
    /// The path of the command, starting below the program.
    path: Vec<String>,
    command: &'a Command,
    matches: ArgMatches,
    program: ArgMatches,
}

impl<'a> Typed<'a> {
    fn of(words: &[OsString], program: &'a Command) -> Self {
        let lenient = program.clone().ignore_errors(true);
        let all = lenient.try_get_matches_from(words).unwrap_or_default();
        let (mut path, mut command, mut matches) = (Vec::new(), program, &all);
        while let Some((name, inner)) = matches.subcommand() {
            let Some(found) = command.find_subcommand(name) else { break };
            path.push(name.to_owned());
            (command, matches) = (found, inner);
        }
        Self { path, command, matches: matches.clone(), program: all.clone() }
    }

    fn profile(&self) -> Option<String> {
        let typed = |matches: &ArgMatches| matches.try_get_one::<String>("profile").ok().flatten().cloned();
        // If the command line cannot be parsed completely, clap has not read the variable.
        let variable = || std::env::var(PROFILE_VARIABLE).ok();
        let named = typed(&self.matches).or_else(|| typed(&self.program)).or_else(variable);
        named.filter(|name| !name.is_empty())
    }

    /// Returns true if the profile is set on the command line.
    fn names_profile(&self) -> bool {
        [&self.matches, &self.program].into_iter().any(|matches| {
            matches.try_contains_id("profile").is_ok()
                && matches.value_source("profile") == Some(ValueSource::CommandLine)
        })
    }

    /// Returns true if an option is set on the command line or in the environment.
    fn is_said(&self, option: &str) -> bool {
        let known = self.command.get_arguments().any(|known| known.get_id() == option);
        let source = known.then(|| self.matches.value_source(option)).flatten();
        matches!(source, Some(ValueSource::CommandLine | ValueSource::EnvVariable))
    }

    fn is_whole_request(&self) -> bool {
        self.path == ["render"] && WHOLE_REQUESTS.iter().any(|option| self.is_said(option))
    }

    /// Returns the options for this command in some tables.
    fn options<'t>(&self, tables: Option<&'t DeTable<'t>>) -> Vec<NamedValue<'t>> {
        let mut found = tables;
        for name in &self.path {
            let inner = found.and_then(|tables| tables.iter().find(|(key, _)| key.get_ref() == name));
            found = inner.and_then(|(_, value)| table(value));
        }
        let is_option = |(_, value): &NamedValue<'t>| table(value).is_none();
        if self.path.is_empty() { Vec::new() } else { found.into_iter().flatten().filter(is_option).collect() }
    }

    /// Returns the command line with these options before the user's. Of conflicting options the first one wins.
    fn with(
        &self,
        file: &ConfigFile,
        said: Vec<NamedValue<'_>>,
        mut words: Vec<OsString>,
    ) -> Result<Vec<OsString>, CliError> {
        let (mut taken, mut added) = (Vec::<&Arg>::new(), Vec::new());
        for (name, value) in said {
            let options = || self.command.get_arguments();
            let Some(option) = options().find(|known| known.get_long() == Some(name.get_ref())) else { continue };
            let stands =
                |other: &&Arg| self.is_said(other.get_id().as_str()) || taken.iter().any(|known| known == other);
            if options().filter(stands).any(|other| other == option || self.exclude(other, option)) {
                continue;
            }
            let is_flag = matches!(option.get_action(), ArgAction::SetTrue);
            added.extend(option_words(file, (name, value), is_flag)?);
            taken.push(option);
        }
        let place = 1 + self.place(&words);
        words.splice(place..place, added.into_iter().map(OsString::from));
        Ok(words)
    }

    /// Returns true if two options conflict.
    fn exclude(&self, one: &Arg, other: &Arg) -> bool {
        let excludes = |a: &Arg, b: &Arg| self.command.get_arg_conflicts_with(a).contains(&b);
        excludes(one, other) || excludes(other, one)
    }

    /// Returns the index of the last word of the command.
    fn place(&self, words: &[OsString]) -> usize {
        let mut names = self.path.iter().peekable();
        let (mut last, mut is_value) = (0, false);
        for (index, word) in words.iter().enumerate().skip(1) {
            if !is_value && names.peek().is_some_and(|name| word == name.as_str()) {
                names.next();
                last = index;
            }
            // `--profile` is the only option with a value before a command.
            is_value = word == "--profile";
        }
        last
    }
}

/// Converts an option of the file to words.
fn option_words(file: &ConfigFile, (name, value): NamedValue<'_>, is_flag: bool) -> Result<Vec<String>, CliError> {
    let option = name.get_ref();
    let text = |value: &DeValue<'_>| match value {
        DeValue::String(text) => Some(text.to_string()),
        DeValue::Integer(number) => Some(number.to_string()),
        DeValue::Float(number) => Some(number.to_string()),
        _ => None,
    };
    match value.get_ref() {
        DeValue::Boolean(true) if is_flag => Ok(vec![format!("--{option}")]),
        DeValue::Boolean(false) if is_flag => Ok(Vec::new()),
        _ if is_flag => Err(file.wrong(value.span(), &format!("`{option}` is a switch: true or false"))),
        DeValue::Array(values) => {
            let words = values.iter().map(|value| {
                let text = text(value.get_ref());
                let wrong = || file.wrong(value.span(), &format!("`{option}` cannot be {}", kind(value.get_ref())));
                text.map(|text| format!("--{option}={text}")).ok_or_else(wrong)
            });
            words.collect()
        }
        single => {
            let text = text(single);
            let wrong = || file.wrong(value.span(), &format!("`{option}` cannot be {}", kind(single)));
            Ok(vec![format!("--{option}={}", text.ok_or_else(wrong)?)])
        }
    }
}

/// Checks that the file is TOML, and that its tables and options exist.
pub(super) fn check(file: &ConfigFile, program: &Command) -> Result<(), CliError> {
    let tables = file.tables()?;
    file.take_farm(&tables)?;
    check_names(file, &tables, program)
}

/// Checks that all tables and options exist.
fn check_names(file: &ConfigFile, tables: &DeTable<'_>, program: &Command) -> Result<(), CliError> {
    for (name, value) in tables {
        match &**name.get_ref() {
            FARM => {}
            PROFILE => {
                let Some(profiles) = table(value) else {
                    return Err(file.wrong(value.span(), "profiles are tables, such as [profile.draft.render]"));
                };
                for (name, profile) in profiles {
                    let Some(profile) = table(profile) else {
                        let problem =
                            format!("`{}` is not a table of options, such as [profile.draft.render]", name.get_ref());
                        return Err(file.wrong(name.span(), &problem));
                    };
                    check_table(file, profile, program)?;
                }
            }
            _ => check_entry(file, (name, value), program)?,
        }
    }
    Ok(())
}

fn check_table(file: &ConfigFile, entries: &DeTable<'_>, command: &Command) -> Result<(), CliError> {
    entries.iter().try_for_each(|entry| check_entry(file, entry, command))
}

fn check_entry(file: &ConfigFile, (name, value): NamedValue<'_>, command: &Command) -> Result<(), CliError> {
    let key = &**name.get_ref();
    if let (Some(inner), Some(entries)) = (command.find_subcommand(key), table(value)) {
        return check_table(file, entries, inner);
    }
    if table(value).is_none() && command.get_arguments().any(|option| option.get_long() == Some(key)) {
        return Ok(());
    }
    let known: Vec<&str> = if table(value).is_some() {
        command.get_subcommands().map(Command::get_name).collect()
    } else {
        command.get_arguments().filter_map(|option| option.get_long()).collect()
    };
    let field = field_meant(command, key).filter(|_| table(value).is_none());
    if let Some(field) = field {
        let problem =
            format!("`{}` has no option `{key}`: set its field, such as set = [\"{field}\"]", command.get_name());
        return Err(file.wrong(name.span(), &problem));
    }
    let meant = if table(value).is_some() { command_meant(command, key) } else { option_meant(command, key) };
    let near = known.into_iter().map(|known| (distance(known, key), known)).min().filter(|(far, _)| *far <= 2);
    let near = meant.or(near.map(|(_, known)| known)).map(|known| format!("; did you mean `{known}`?"));
    // Suggest the first command that has the option.
    let has_it =
        |command: &&Command| table(value).is_none() && command.get_arguments().any(|one| one.get_long() == Some(key));
    let elsewhere = || {
        let name = command.get_subcommands().find(has_it)?.get_name();
        Some(format!("; `{name}` has it: put it below a table `{name}`"))
    };
    let near = near.or_else(elsewhere).unwrap_or_default();
    let what = if table(value).is_some() { "command" } else { "option" };
    Err(file.wrong(name.span(), &format!("`{}` has no {what} `{key}`{near}", command.get_name())))
}

/// Returns the edit distance of two words (Levenshtein 1965).
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, other) in b.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    fn words_of(config: &str, line: &str) -> Result<String, String> {
        let file = ConfigFile { path: PathBuf::from("config.toml"), text: config.to_owned() };
        let tables = file.tables().map_err(|error| error.to_string())?;
        let program = Cli::command();
        check_names(&file, &tables, &program).map_err(|error| error.to_string())?;
        let words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
        let typed = Typed::of(&words, &program);
        let said = if typed.is_whole_request() { Vec::new() } else { typed.options(Some(&tables)) };
        let words = typed.with(&file, said, words).map_err(|error| error.to_string())?;
        Ok(words.into_iter().map(|word| word.into_string().unwrap()).collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn options_of_the_file_stand_before_those_of_the_user() {
        let config =
            "[render]\nspp = 16\nsize = \"64x48\"\ndenoise = true\nquiet = false\n[rules.check]\nstrict = true";
        assert_eq!(
            words_of(config, "bottega render a.glb -o a.png").as_deref(),
            Ok("bottega render --denoise --size=64x48 --spp=16 a.glb -o a.png")
        );
        assert_eq!(
            words_of(config, "bottega render a.glb -o a.png --spp 4").as_deref(),
            Ok("bottega render --denoise --size=64x48 a.glb -o a.png --spp 4")
        );
        assert_eq!(words_of(config, "bottega rules check").as_deref(), Ok("bottega rules check --strict"));
        assert_eq!(words_of(config, "bottega info a.glb").as_deref(), Ok("bottega info a.glb"));
    }

    #[test]
    fn what_excludes_an_option_of_the_user_is_left_out() {
        let config = "[render]\ntime = \"10s\"";
        assert_eq!(
            words_of(config, "bottega render a.glb -o a.png --error 0.1").as_deref(),
            Ok("bottega render a.glb -o a.png --error 0.1")
        );
        // The file's options do not apply to a complete request.
        assert_eq!(
            words_of(config, "bottega render --request r.json").as_deref(),
            Ok("bottega render --request r.json")
        );
    }

    #[test]
    fn of_options_that_exclude_each_other_the_first_counts_and_a_profile_may_be_called_like_a_command() {
        let config = "[render]\nerror = 0.1\ntime = \"10s\"";
        assert_eq!(
            words_of(config, "bottega --profile render render a.glb -o a.png").as_deref(),
            Ok("bottega --profile render render --error=0.1 a.glb -o a.png")
        );
    }

    #[test]
    fn errors_name_their_place() {
        for (config, expected) in [
            ("[render]\nssp = 16", "line 2, column 1: `render` has no option `ssp`; did you mean `spp`?"),
            ("[render]\nsamples = 16", "`render` has no option `samples`; did you mean `spp`?"),
            (
                "[render]\nzones = 16",
                "`render` has no option `zones`: set its field, such as set = [\"work.zones=64\"]",
            ),
            ("[rendr]\nspp = 16", "line 1, column 2: `bottega` has no command `rendr`; did you mean `render`?"),
            ("[render]\ndenoise = 1", "line 2, column 11: `denoise` is a switch"),
            ("[render]\nspp = 2026-01-01", "line 2, column 7: `spp` cannot be a date"),
            ("[render]\nspp = [[1]]", "`spp` cannot be a list"),
            ("[render\nspp = 16", "line 1"),
            ("[profile]\ndraft = 3", "line 2, column 1: `draft` is not a table"),
            ("profile = 3", "profiles are tables"),
            ("spp = 3", "`bottega` has no option `spp`; `render` has it: put it below a table `render`"),
            ("[profile.draft]\nsize = \"8x6\"", "`size`; `render` has"),
        ] {
            let error = words_of(config, "bottega render a.glb -o a.png").unwrap_err();
            assert!(error.contains(expected), "{config}: {error}");
        }
    }

    #[test]
    fn the_nearest_word_is_found() {
        assert_eq!((distance("spp", "ssp"), distance("", "abc"), distance("size", "size")), (1, 3, 0));
    }
}
