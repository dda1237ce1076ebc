//! `bottega join`: makes this machine paint jobs of a farm.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use bottega::{
    StopSwitch,
    devices::DeviceChoice,
    request::{RulesSource, TAG_FORM, TAGS_MAX, is_tag},
    rule_texts::rule_texts,
    rules::experts,
};
use bottega_cluster::{
    FarmAddress,
    names::MACHINE_NAME_MAX,
    owner::{DailyHours, OwnerConditions},
    worker::{self, JoinOptions, WorkerDevices, WorkerMessage},
};
use clap::{Args, ValueHint};

use crate::{
    energy_values::parse_watts,
    error::CliError,
    farm_args::{LoginArgs, parse_gigabytes},
    option_value::{InvalidValue, parse_duration},
    output::print_report,
    signals::stop_on_signal,
};

/// Offer this machine to a farm.
#[derive(Debug, Args)]
#[command(
    after_help = "For example, with the line that `bottega up` printed:\n  bottega join bottega://WORD@10.0.0.7:4222\n\nor, in the same local network, with the word alone. \
    The machine paints for the jobs of the farm by their priorities, and leads one where nobody does. Ctrl-C hands back \
    what it has in hand. `bottega machines` may suspend, resume and end it."
)]
pub(crate) struct JoinArgs {
    /// Address of the farm; default: the one that `bottega up` runs on this machine.
    #[arg(env = "BOTTEGA_FARM", hide_env_values = true)]
    farm: Option<FarmAddress>,
    /// Processors to use; default: all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Devices that paint on this machine: `auto` (the processors, and the best GPU if there is one), or a list of `cpu` and
    /// parts of GPUs' names. Jobs with `--exact` use processors only.
    #[arg(long, value_name = "LIST", default_value = "auto")]
    devices: DeviceChoice,
    /// Memory that scenes may take on each GPU, in MiB. Default: nearly all that it has.
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u32).range(1..))]
    gpu_memory: Option<u32>,
    /// Expert rules of this machine's agents, an FCL file: they choose the settings of the zones that the agents win, in jobs
    /// with `--optimize`. May be repeated: agents carry them in turn. Default: the rules of the job.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    rules: Vec<PathBuf>,
    /// Folder that keeps scenes; default: a folder of the user's state.
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    cache: Option<PathBuf>,
    /// Size limit of --cache, in gigabytes; the least recently used files go first. [default: 20]
    #[arg(long, value_name = "GB", value_parser = parse_gigabytes)]
    cache_size: Option<u64>,
    /// Name of this machine in the farm: letters, digits and hyphens; letters of its key follow. Default: the name that the
    /// farm knows, or the host's. Processes with different names are different machines.
    #[arg(long, value_name = "NAME", value_parser = parse_name)]
    name: Option<String>,
    /// A tag of this machine, such as `gpu` or `studio-a`, that jobs may require (`render --require`). May be given several
    /// times.
    #[arg(long = "tag", value_name = "TAG", value_parser = parse_tag)]
    tags: Vec<String>,
    /// Power of this machine with all processors at work, in watts. Energy and cost of jobs follow from it if its counters
    /// (RAPL) cannot be read.
    #[arg(long, value_name = "WATTS", value_parser = parse_watts)]
    watts: Option<f64>,
    /// Paint until one job is over, and leave.
    #[arg(long)]
    once: bool,
    /// Paint only when nobody has touched this machine for this time, such as 10m. Detected by logind, `xprintidle` and
    /// terminals; if the first two are not available, by the load of other programs.
    #[arg(long, value_name = "TIME", value_parser = parse_duration, help_heading = "The machine's owner")]
    when_idle: Option<Duration>,
    /// Paint only in these hours of the day, local time, such as 20:00-08:00; separate several by commas.
    #[arg(long, value_name = "FROM-TO", value_delimiter = ',', value_parser = parse_hours, help_heading = "The machine's owner")]
    hours: Vec<DailyHours>,
    /// Paint only while other programs keep at most this many processors at work, such as 0.5.
    #[arg(long, value_name = "PROCESSORS", value_parser = parse_load, help_heading = "The machine's owner")]
    max_load: Option<f32>,
    /// Leave a job to other machines if it takes more memory than this here, in megabytes, including its engines.
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1 << 30), help_heading = "The machine's owner")]
    max_memory: Option<u64>,
    /// Lower the priority of this process by this many steps, 1 to 19.
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u8).range(1..=19), help_heading = "The machine's owner")]
    nice: Option<u8>,
    #[command(flatten)]
    login: LoginArgs,
}

pub(crate) fn run(args: &JoinArgs) -> Result<ExitCode, CliError> {
    let sources: Vec<RulesSource> = args.rules.iter().cloned().map(RulesSource::File).collect();
    let rules = rule_texts(&sources)?;
    // Report problems of the rules before any painting.
    for note in experts(rules.clone())?.1 {
        println!("{note}");
    }
    if args.tags.len() > TAGS_MAX {
        let problem = format!("{} tags are too many", args.tags.len());
        return Err(CliError::usage(problem, format!("--tag may be given {TAGS_MAX} times")));
    }
    if let Some(steps) = args.nice {
        // Lower the priority before threads are started.
        bottega_platform::scheduling::step_back(steps).map_err(|error| {
            CliError::failed(format!("cannot lower the priority by {steps} steps: {error}"), "leave out --nice")
        })?;
    }
    let link = args.login.link_as(args.farm.as_ref(), args.name.as_deref())?;
    let stop = StopSwitch::new();
    stop_on_signal(&stop)?;
    let how = if link.uplink.is_guest() { "as a guest: " } else { "" };
    let (servers, version) = (&link.servers, link.uplink.server_version());
    println!("joined {servers} (NATS {version}) as {}; {how}waiting for work", link.name);
    let own = WorkerDevices { threads: args.threads, devices: args.devices.clone(), memory_mb: args.gpu_memory, rules };
    let owner = OwnerConditions { when_idle: args.when_idle, hours: args.hours.clone(), max_load: args.max_load };
    let (cache, cache_bytes) = (args.cache.clone(), args.cache_size);
    let (tags, memory_bytes) = (args.tags.clone(), args.max_memory.map(|megabytes| megabytes * 1_000_000));
    let (once, watts) = (args.once, args.watts);
    let options = JoinOptions { own, cache, cache_bytes, once, owner, tags, memory_bytes, watts };
    let say = |said: WorkerMessage<'_>| match said {
        WorkerMessage::Line(line) => println!("{line}"),
        WorkerMessage::Failure(error) => print_report(&crate::error::report_of(error)),
    };
    worker::join(link, options, &stop, Box::new(say));
    println!("left the farm");
    Ok(ExitCode::SUCCESS)
}

/// Parses a tag, such as `gpu`.
fn parse_tag(text: &str) -> Result<String, InvalidValue> {
    is_tag(text).then(|| text.to_owned()).ok_or_else(|| TAG_FORM.into())
}

/// Parses the name of a machine, such as `studio-a`.
fn parse_name(text: &str) -> Result<String, InvalidValue> {
    let fits = text.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    let wrong = || {
        format!("a name of letters, digits and hyphens is needed, {MACHINE_NAME_MAX} at most, such as studio-a").into()
    };
    (fits && (1..=MACHINE_NAME_MAX).contains(&text.len())).then(|| text.to_owned()).ok_or_else(wrong)
}

/// Parses a part of the day, such as `20:00-08:00`.
fn parse_hours(text: &str) -> Result<DailyHours, InvalidValue> {
    let minute = |text: &str| {
        let (hours, minutes) = text.trim().split_once(':')?;
        let (hours, minutes): (u16, u16) = (hours.parse().ok()?, minutes.parse().ok()?);
        (hours < 24 && minutes < 60 || (hours, minutes) == (24, 0)).then_some(hours * 60 + minutes)
    };
    let parts = text.split_once('-').and_then(|(from, to)| Some(DailyHours { from: minute(from)?, to: minute(to)? }));
    parts.filter(|hours| hours.from != hours.to).ok_or_else(|| "hours such as 20:00-08:00 are needed".into())
}

fn parse_load(text: &str) -> Result<f32, InvalidValue> {
    let load = text.parse().ok().filter(|load: &f32| (0.0..=4096.0).contains(load));
    load.ok_or_else(|| "a number of processors is needed, such as 0.5".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_a_name_of_letters_digits_and_hyphens() {
        assert_eq!(parse_name("studio-A2"), Ok("studio-A2".to_owned()));
        for wrong in ["", "a b", "a.b", "é", "a/b", &"a".repeat(MACHINE_NAME_MAX + 1)] {
            assert!(parse_name(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn hours_are_two_times_of_a_day() {
        assert_eq!(parse_hours("20:00-08:30"), Ok(DailyHours { from: 1200, to: 510 }));
        assert_eq!(parse_hours("0:00-24:00"), Ok(DailyHours { from: 0, to: 1440 }));
        for wrong in ["", "20-8", "25:00-08:00", "20:60-08:00", "08:00-08:00", "08:00"] {
            assert!(parse_hours(wrong).is_err(), "{wrong}");
        }
        assert!(parse_load("0.5").is_ok() && parse_load("-1").is_err() && parse_load("NaN").is_err());
    }
}
