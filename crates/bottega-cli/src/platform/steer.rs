//! `bottega platform suspend | resume | terminate`: requests of a farm's AMS to an agent.

use std::process::ExitCode;

use bottega_cluster::directories::AgentOrder;
use serde_json::json;

use super::args::SteerArgs;
use crate::error::CliError;

pub(super) fn run(args: &SteerArgs, order: AgentOrder) -> Result<ExitCode, CliError> {
    let word = match order {
        AgentOrder::Suspend => "suspended",
        AgentOrder::Resume => "active",
        AgentOrder::Quit => "asked to quit",
    };
    args.farm.board()?.steer_agent(&args.agent, order)?;
    if args.farm.json {
        println!("{}", json!({ "agent": args.agent, "ordered": word }));
    } else {
        println!("{} is {word}", args.agent);
    }
    Ok(ExitCode::SUCCESS)
}
