//! `bottega platform`: runs a FIPA agent platform, and queries other ones.

mod args;
mod ask;
mod diagram;
pub(crate) mod passed;
mod peer;
mod serve;
mod steer;
mod trace;

use std::process::ExitCode;

pub(crate) use args::PlatformArgs;
use args::PlatformCommand;
pub(crate) use args::parse_agent;

use bottega_cluster::directories::AgentOrder;

use crate::error::CliError;

pub(crate) fn run(args: &PlatformArgs) -> Result<ExitCode, CliError> {
    match &args.command {
        PlatformCommand::Serve(args) => serve::run(args),
        PlatformCommand::Agents(args) => ask::agents(args),
        PlatformCommand::Services(args) => ask::services(args),
        PlatformCommand::Trace(args) => trace::run(args),
        PlatformCommand::Suspend(args) => steer::run(args, AgentOrder::Suspend),
        PlatformCommand::Resume(args) => steer::run(args, AgentOrder::Resume),
        PlatformCommand::Terminate(args) => steer::run(args, AgentOrder::Quit),
    }
}
