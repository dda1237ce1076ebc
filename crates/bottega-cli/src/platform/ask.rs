//! `bottega platform agents | services`: queries to the directories of any FIPA platform.

use std::{net::SocketAddr, process::ExitCode};

use bottega_agents::{
    AgentId,
    driver::node::{Node, NodeConfig},
    gateway::{FirstForms, PlainContent},
    platform::{
        AmsAgentDescription, DfAgentDescription, Function, LifeCycleState, ManagementContent, Outcome,
        SearchConstraints, ServiceDescription,
    },
    sl::print_term,
    store::MemoryStore,
};
use bottega_cluster::ports::{Port, bind};
use serde_json::json;

use super::{
    args::{AskArgs, ServicesArgs},
    passed,
    peer::Peer,
};
use crate::error::CliError;

pub(super) fn agents(args: &AskArgs) -> Result<ExitCode, CliError> {
    let constraints = SearchConstraints { max_results: Some(-1), ..Default::default() };
    let function = Function::SearchAgents(AmsAgentDescription::default(), constraints);
    let at = args.at.clone().unwrap_or_else(Peer::here);
    let Outcome::Agents(agents) = ask(args, &at, "ams", function)? else { return Err(unexpected_answer(&at)) };
    if !args.json {
        println!("{:<40} {:<10} addresses", "agent", "state");
    }
    for agent in agents {
        let name = name_of(agent.name.as_ref());
        let addresses = agent.name.as_ref().map(|name| name.addresses.to_vec()).unwrap_or_default();
        let state = agent.state.map_or("-", LifeCycleState::word);
        if args.json {
            println!(
                "{}",
                json!({ "agent": name, "state": agent.state.map(LifeCycleState::word), "ownership": agent.ownership,
                    "addresses": addresses })
            );
        } else {
            println!("{name:<40} {state:<10} {}", addresses.join(" "));
        }
    }
    Ok(ExitCode::SUCCESS)
}

pub(super) fn services(args: &ServicesArgs) -> Result<ExitCode, CliError> {
    let service = ServiceDescription { service_type: args.service_type.clone(), ..Default::default() };
    let services = if args.service_type.is_some() { vec![service] } else { Vec::new() };
    let template = DfAgentDescription { services, ..Default::default() };
    let constraints = SearchConstraints {
        max_results: Some(-1),
        max_depth: (args.depth > 0).then_some(i64::from(args.depth)),
        search_id: None,
    };
    let at = args.ask.at.clone().unwrap_or_else(Peer::here);
    let Outcome::Offers(offers) = ask(&args.ask, &at, "df", Function::Search(template, constraints))? else {
        return Err(unexpected_answer(&at));
    };
    if !args.ask.json {
        println!("{:<40} {:<24} {:<20} properties", "agent", "service", "type");
    }
    for offer in offers {
        let name = name_of(offer.name.as_ref());
        for service in &offer.services {
            tell_service(args.ask.json, &name, &offer, service);
        }
        if offer.services.is_empty() && !args.ask.json {
            println!("{name:<40} -");
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn tell_service(as_json: bool, name: &str, offer: &DfAgentDescription, service: &ServiceDescription) {
    let property = |property: &bottega_agents::platform::Property| {
        let value = property.value.as_str().map_or_else(|| print_term(&property.value), str::to_owned);
        (property.name.clone(), value)
    };
    let properties: Vec<(String, String)> = service.properties.iter().map(property).collect();
    let text = |value: &Option<String>| value.clone().unwrap_or_else(|| "-".to_owned());
    if as_json {
        let addresses = offer.name.as_ref().map(|name| name.addresses.to_vec()).unwrap_or_default();
        let properties: serde_json::Map<String, serde_json::Value> =
            properties.into_iter().map(|(name, value)| (name, value.into())).collect();
        println!(
            "{}",
            json!({ "agent": name, "addresses": addresses, "service": service.name, "type": service.service_type,
                "ownership": service.ownership, "protocols": service.protocols, "ontologies": service.ontologies,
                "languages": service.languages, "properties": properties })
        );
        return;
    }
    let properties: Vec<String> = properties.into_iter().map(|(name, value)| format!("{name}={value}")).collect();
    println!("{name:<40} {:<24} {:<20} {}", text(&service.name), text(&service.service_type), properties.join(" "));
}

fn name_of(agent: Option<&AgentId>) -> String {
    agent.map_or("-".to_owned(), ToString::to_string)
}

fn unexpected_answer(at: &Peer) -> CliError {
    CliError::failed(
        format!("{} sends an answer that does not fit the request", at.url),
        "check that it is a FIPA platform",
    )
}

/// Sends a request to a service. The answer is a separate message, so this process runs a platform meanwhile.
fn ask(args: &AskArgs, at: &Peer, service: &str, function: Function) -> Result<Outcome, CliError> {
    let to = at.service(service)?;
    let listener = bind(Port::OwnPlatform, SocketAddr::new(at.own_address(), 0))?;
    let config = NodeConfig {
        name: format!("asker-{}-{}", std::process::id(), at.own_address().to_string().replace(':', "-")),
        public: None,
        store: Box::new(MemoryStore::default()),
        lease_max: None,
        federates: Vec::new(),
        administrators: Vec::new(),
        trusted: Vec::new(),
        permanent: Vec::new(),
        trace_line: passed::line,
        first_forms: FirstForms { default: args.first_representation, ..FirstForms::default() },
    };
    let node = Node::start(listener, config).map_err(CliError::Node)?;
    let me = AgentId::new(format!("asker@{}", node.ams().name.trim_start_matches("ams@")));
    let answer = node.ask(&me, &to, ManagementContent::Action(function), args.wait);
    let failed = |what: String| {
        CliError::failed(format!("{to} at {}: {what}", at.url), "check its name, and whether it runs there")
    };
    match answer {
        Err(error) => Err(failed(error.to_string())),
        Ok(None) => Err(failed(format!("no answer in {} s", args.wait.as_secs_f64()))),
        Ok(Some((act, PlainContent::Management(content)))) => match content {
            ManagementContent::Done(_, outcome) => Ok(outcome),
            ManagementContent::Undelivered { reason, .. } => Err(failed(reason)),
            ManagementContent::Refused(_, reason) => Err(failed(format!("{act}: {reason:?}"))),
            ManagementContent::Failed(_, reason) => Err(failed(format!("{act}: {reason:?}"))),
            other => Err(failed(format!("{act}: {other:?}"))),
        },
        Ok(Some((act, PlainContent::Foreign(message)))) => {
            Err(failed(format!("{act}: {}", message.content.as_deref().unwrap_or_default())))
        }
    }
}
