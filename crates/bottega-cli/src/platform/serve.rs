//! `bottega platform serve`: a platform until Ctrl-C.

use std::{
    process::ExitCode,
    sync::{Arc, mpsc},
};

use bottega_agents::{
    AgentId,
    driver::node::{Node, NodeConfig},
    entry_store::EntryStore,
    file_store::FileStore,
    gateway::FirstForms,
    store::MemoryStore,
};
use serde_json::json;

use super::{
    args::{FirstForm, ServeArgs},
    farm::{FarmAgents, jobs_id},
    passed,
};
use bottega_cluster::{JobBoard, link};

use crate::error::CliError;

pub(super) fn run(args: &ServeArgs) -> Result<ExitCode, CliError> {
    if args.listen.ip().is_unspecified() && args.public.is_none() {
        return Err(CliError::usage(
            format!("nobody can connect to {}", args.listen),
            "say what others shall connect to: --public HOST:PORT",
        ));
    }
    let federates = args.federate.iter().map(|peer| peer.service("df")).collect::<Result<_, _>>()?;
    let board = match &args.farm {
        Some(farm) => Some(JobBoard { uplink: link(farm.as_ref(), &args.login.credentials())?.uplink }),
        None => None,
    };
    // The agent of the jobs speaks for the farm: it resumes machines, which only the platform may.
    let jobs: Vec<AgentId> = board.iter().map(|_| jobs_id(&args.name)).collect();
    let trusted: Vec<AgentId> = args.trust.iter().map(|name| AgentId::new(name.as_str())).collect();
    let node = Node::start(NodeConfig {
        name: args.name.clone(),
        listen: args.listen,
        public: args.public.clone(),
        store: store(args)?,
        lease_max: args.lease_max,
        federates,
        administrators: jobs.clone(),
        trusted: trusted.clone(),
        permanent: jobs,
        trace_line: passed::line,
        first_forms: first_forms(&args.first_representation),
    })
    .map_err(CliError::Node)?;
    let node = Arc::new(node);
    let agents = board.map(|board| FarmAgents::begin(&node, &args.name, board, &trusted)).transpose()?;
    // Whoever wants to end it must be heard from the first line on.
    let (interrupt, interrupted) = mpsc::channel();
    let handler = ctrlc::set_handler(move || {
        // A second Ctrl-C finds nobody who listens.
        _ = interrupt.send(());
    });
    handler
        .map_err(|error| CliError::failed(format!("cannot hear Ctrl-C: {error}"), "this machine does not allow it"))?;
    tell(args, &node);
    // The sender lives as long as the program.
    _ = interrupted.recv();
    drop(agents);
    // They were the last others who held it.
    if let Some(node) = Arc::into_inner(node) {
        node.stop();
    }
    Ok(ExitCode::SUCCESS)
}

/// What was said for all platforms, and for single ones; of several words for one the last counts.
fn first_forms(said: &[FirstForm]) -> FirstForms {
    let mut forms = FirstForms::default();
    for FirstForm { platform, form } in said {
        match platform {
            Some(platform) => _ = forms.by_platform.insert(platform.clone(), *form),
            None => forms.default = *form,
        }
    }
    forms
}

fn store(args: &ServeArgs) -> Result<Box<dyn EntryStore<String, usize> + Send>, CliError> {
    match &args.state {
        None => Ok(Box::new(MemoryStore::default())),
        Some(path) => {
            let store = FileStore::<String, usize>::open(path);
            store
                .map(|store| Box::new(store) as Box<dyn EntryStore<String, usize> + Send>)
                .map_err(|source| CliError::State { path: path.clone(), source })
        }
    }
}

fn tell(args: &ServeArgs, node: &Node) {
    if args.json {
        let ids = [node.ams(), node.df(), node.start_service()].map(ToString::to_string);
        let jobs = args.farm.as_ref().map(|_| jobs_id(&args.name).to_string());
        println!(
            "{}",
            json!({ "event": "serving", "platform": args.name, "address": node.address(), "services": ids, "farm": jobs })
        );
        return;
    }
    println!("platform `{}` at {}", args.name, node.address());
    println!("  white pages   {}", node.ams());
    println!("  yellow pages  {}", node.df());
    println!("  service root  {}", node.start_service());
    match &args.state {
        Some(path) => println!("  kept in       {}", path.display()),
        None => println!("  kept in memory only; --state FILE keeps it"),
    }
    if args.farm.is_some() {
        println!("  farm          {}", jobs_id(&args.name));
    }
    for agent in &args.trust {
        println!("  trusts        {agent}");
    }
    for peer in &args.federate {
        println!("  searches with {}", peer.url);
    }
    println!("Ctrl-C ends it.");
}
