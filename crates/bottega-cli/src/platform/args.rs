//! Options of `bottega platform`.

use std::{net::SocketAddr, path::PathBuf, time::Duration};

use bottega_agents::wire::Form;
use clap::{Args, Subcommand, ValueHint};

use bottega_cluster::FarmAddress;

use super::peer::{Peer, parse_peer};
use crate::{
    farm_args::{FarmArgs, LoginArgs},
    option_value::{InvalidValue, parse_duration},
    output::Purpose,
};

#[derive(Debug, Args)]
pub(crate) struct PlatformArgs {
    #[command(subcommand)]
    pub(crate) command: PlatformCommand,
}

impl PlatformArgs {
    /// Returns the purpose of standard output.
    pub(crate) fn purpose(&self) -> Purpose {
        match self.command {
            PlatformCommand::Serve(_) => Purpose::Log,
            PlatformCommand::Agents(_)
            | PlatformCommand::Services(_)
            | PlatformCommand::Suspend(_)
            | PlatformCommand::Resume(_)
            | PlatformCommand::Terminate(_) => Purpose::Result,
            PlatformCommand::Trace(_) => Purpose::Stream,
        }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum PlatformCommand {
    /// Run a FIPA platform: white pages (AMS), yellow pages (DF), message transport over HTTP, until Ctrl-C.
    Serve(Box<ServeArgs>),
    /// List the agents that a platform's AMS knows.
    Agents(AskArgs),
    /// List the services that a platform's DF knows.
    Services(ServicesArgs),
    /// Watch the messages that pass the transport of a platform on this machine.
    Trace(TraceArgs),
    /// Suspend an agent by the AMS of a farm: a Render Agent hands its zones back to others.
    Suspend(SteerArgs),
    /// Resume a suspended agent by the AMS of a farm.
    Resume(SteerArgs),
    /// Ask an agent to quit, by the AMS of a farm.
    Terminate(SteerArgs),
}

#[derive(Debug, Args)]
pub(crate) struct SteerArgs {
    /// The agent, as `bottega platform agents` and `bottega jobs show` name it.
    pub(crate) agent: String,
    #[command(flatten)]
    pub(crate) farm: FarmArgs,
}

#[derive(Debug, Args)]
pub(crate) struct ServeArgs {
    /// The name of the platform: the part after @ in the names of its agents.
    #[arg(long, value_name = "NAME", default_value = "bottega")]
    pub(crate) name: String,
    /// Address to listen at. [default: 127.0.0.1:7779]
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) listen: Option<SocketAddr>,
    /// Address that others connect to, if it differs from the one to listen at.
    #[arg(long, value_name = "HOST:PORT", value_parser = parse_public)]
    pub(crate) public: Option<String>,
    /// Keep the state of the platform in this file. Several processes over one file serve one platform, and any of them may
    /// be killed. Default: in memory.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) state: Option<PathBuf>,
    /// Search together with the DF of another platform, such as http://host:7779/acc, or NAME=URL if that
    /// does not report its name (JADE). May be given several times.
    #[arg(long, value_name = "URL", value_parser = parse_peer)]
    pub(crate) federate: Vec<Peer>,
    /// The longest time for which the DF keeps an entry that is not renewed, such as 1h. Default: for ever.
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub(crate) lease_max: Option<Duration>,
    /// Serve the platform of a farm, whose pages the farm keeps: that of `bottega up` on this machine, or the one named. `up`
    /// serves it too; a platform of another --name has pages and agents of its own.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, conflicts_with = "state")]
    pub(crate) farm: Option<Option<FarmAddress>>,
    #[command(flatten)]
    pub(crate) login: LoginArgs,
    /// An agent of another platform that may suspend and end agents of this one, and steer the farm: NAME@PLATFORM. May be
    /// given several times. Its identity is not proved: only for networks whose members trust each other.
    #[arg(long, value_name = "AGENT", value_parser = parse_agent)]
    pub(crate) trust: Vec<String>,
    /// The representation of messages, string or xml, in which a platform is written to that has not written itself; or
    /// PLATFORM=FORM for one of them, whatever it writes. May be given several times. Default: string. Answers are in the
    /// representation of the question, and a platform that has written is written to likewise.
    #[arg(long, value_name = "FORM", value_parser = parse_first_form)]
    pub(crate) first_representation: Vec<FirstForm>,
    /// Print one JSON object per line instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

/// The encoding of the first message to a platform; `None`: to all platforms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FirstForm {
    pub(crate) platform: Option<String>,
    pub(crate) form: Form,
}

#[derive(Debug, Args)]
pub(crate) struct AskArgs {
    /// The platform, such as http://host:7779/acc, or NAME=URL if that does not report its name (JADE:
    /// jade=http://host:7778/acc). Default: that of `bottega up` on this machine, wherever it listens, or else
    /// http://127.0.0.1:7779/acc.
    #[arg(long, value_name = "URL", value_parser = parse_peer)]
    pub(crate) at: Option<Peer>,
    /// The representation of the request: string or xml. Platforms answer in the same.
    #[arg(long, value_name = "FORM", value_parser = parse_form, default_value = "string")]
    pub(crate) first_representation: Form,
    /// Time to wait for an answer.
    #[arg(long, value_name = "TIME", value_parser = parse_duration, default_value = "10s")]
    pub(crate) wait: Duration,
    /// Print one JSON object per line instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ServicesArgs {
    #[command(flatten)]
    pub(crate) ask: AskArgs,
    /// Only services of this type.
    #[arg(long = "type", value_name = "TYPE")]
    pub(crate) service_type: Option<String>,
    /// Number of hops to the directories of other platforms.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) depth: u32,
}

#[derive(Debug, Args)]
pub(crate) struct TraceArgs {
    /// The platform: one of ours, on this machine. Default: that of `bottega up`, wherever it listens, or else
    /// http://127.0.0.1:7779/acc.
    #[arg(long, value_name = "URL", value_parser = parse_peer)]
    pub(crate) at: Option<Peer>,
    /// Also draw a message-sequence diagram, updated while the trace runs.
    #[arg(short, long, value_name = "FILE.svg", value_hint = ValueHint::FilePath)]
    pub(crate) output: Option<PathBuf>,
    /// Only conversations whose name contains this.
    #[arg(long, value_name = "TEXT")]
    pub(crate) conversation: Option<String>,
    /// End after this many messages. Default: at Ctrl-C, or when the platform ends.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) count: Option<u64>,
    /// Print one JSON object per line instead of text for people.
    #[arg(long)]
    pub(crate) json: bool,
}

fn parse_form(text: &str) -> Result<Form, InvalidValue> {
    match text {
        "string" => Ok(Form::String),
        "xml" => Ok(Form::Xml),
        _ => Err("string or xml is needed".into()),
    }
}

fn parse_first_form(text: &str) -> Result<FirstForm, InvalidValue> {
    match text.rsplit_once('=') {
        Some(("", _)) => Err("a platform is needed before the =".into()),
        Some((platform, form)) => Ok(FirstForm { platform: Some(platform.to_owned()), form: parse_form(form)? }),
        None => Ok(FirstForm { platform: None, form: parse_form(text)? }),
    }
}

pub(crate) fn parse_agent(text: &str) -> Result<String, InvalidValue> {
    match text.split_once('@') {
        Some((local, platform)) if !local.is_empty() && !platform.is_empty() => Ok(text.to_owned()),
        _ => Err("the name of an agent, such as boss@jade, is needed".into()),
    }
}

fn parse_public(text: &str) -> Result<String, InvalidValue> {
    match text.rsplit_once(':') {
        Some((host, port))
            if port.parse::<u16>().is_ok()
                && !host.is_empty()
                && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-[]:".contains(&byte)) =>
        {
            Ok(text.to_owned())
        }
        _ => Err("a host and a port such as render.example.org:7779 are needed".into()),
    }
}
