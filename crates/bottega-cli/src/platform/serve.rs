//! `bottega platform serve`: runs a platform until Ctrl-C.

use std::{net::TcpListener, process::ExitCode, sync::mpsc};

use bottega_agents::{
    AgentId,
    driver::node::{Node, NodeConfig},
    entry_store::EntryStore,
    file_store::FileStore,
    gateway::FirstForms,
    store::MemoryStore,
};
use serde_json::json;

use bottega_cluster::{
    JobBoard,
    platform::{self, FarmPlatform, PlatformOptions},
    ports::{Port, bind},
};

use super::{
    args::{FirstForm, ServeArgs},
    passed,
};

use crate::error::CliError;

pub(super) fn run(args: &ServeArgs) -> Result<ExitCode, CliError> {
    let federates = args.federate.iter().map(|peer| peer.service("df")).collect::<Result<_, _>>()?;
    let options = PlatformOptions {
        name: args.name.clone(),
        listen: args.listen,
        public: args.public.clone(),
        federates,
        lease_max: args.lease_max,
        trusted: args.trust.iter().map(|name| AgentId::new(name.as_str())).collect(),
        trace_line: passed::line,
        first_forms: first_forms(&args.first_representation),
    };
    options.validate()?;
    let listener = match &args.farm {
        Some(_) => options.bind(Port::OwnPlatform)?,
        None => bind(Port::OwnPlatform, options.listen.unwrap_or(platform::LISTEN))?,
    };
    let served = match &args.farm {
        Some(farm) => {
            let board = JobBoard { uplink: args.login.link(farm.as_ref())?.uplink };
            ServedPages::Farm(FarmPlatform::serve(listener, board.clone(), &options)?, board)
        }
        None => ServedPages::Alone(alone(listener, options, store(args)?)?),
    };
    // Handle Ctrl-C before the first line is printed.
    let (interrupt, interrupted) = mpsc::channel();
    let handler = ctrlc::set_handler(move || {
        // A second Ctrl-C finds no receiver.
        _ = interrupt.send(());
    });
    handler.map_err(|error| {
        CliError::failed(format!("cannot watch for Ctrl-C: {error}"), "this machine does not allow it")
    })?;
    tell(args, &served);
    // The sender lives as long as the program.
    _ = interrupted.recv();
    match served {
        ServedPages::Farm(platform, _) => platform.stop(),
        ServedPages::Alone(node) => node.stop(),
    }
    Ok(ExitCode::SUCCESS)
}

/// The platform that is served.
enum ServedPages {
    /// The platform of a farm.
    Farm(FarmPlatform, JobBoard),
    /// A platform without a farm.
    Alone(Node),
}

impl ServedPages {
    fn node(&self) -> &Node {
        match self {
            Self::Farm(platform, _) => platform.node(),
            Self::Alone(node) => node,
        }
    }
}

/// Starts a platform without a farm.
fn alone(
    listener: TcpListener,
    options: PlatformOptions,
    store: Box<dyn EntryStore<String, usize> + Send>,
) -> Result<Node, CliError> {
    let config = NodeConfig {
        name: options.name,
        public: options.public,
        store,
        lease_max: options.lease_max,
        federates: options.federates,
        administrators: Vec::new(),
        trusted: options.trusted,
        permanent: Vec::new(),
        trace_line: options.trace_line,
        first_forms: options.first_forms,
    };
    Node::start(listener, config).map_err(CliError::Node)
}

/// Collects the encodings for all platforms and for single ones; the last one given wins.
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

fn tell(args: &ServeArgs, served: &ServedPages) {
    let node = served.node();
    let farm = match served {
        ServedPages::Farm(platform, board) => Some((platform, board)),
        ServedPages::Alone(_) => None,
    };
    if args.json {
        let ids = [node.ams(), node.df(), node.start_service()].map(ToString::to_string);
        let jobs = farm.map(|(platform, _)| platform.jobs().to_string());
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
    match (&args.state, farm) {
        (Some(path), _) => println!("  kept in       {}", path.display()),
        (None, Some(_)) => println!("  kept in       the farm"),
        (None, None) => println!("  stored in memory only; --state FILE stores it in a file"),
    }
    match farm {
        Some((platform, _)) if platform.has_agents() => println!("  farm          {}", platform.jobs()),
        Some((platform, board)) => {
            let host = platform::host_of(board, &args.name).map(|host| host.address).unwrap_or_default();
            println!("  farm          {}, which lives at {host}", platform.jobs());
        }
        None => {}
    }
    for agent in &args.trust {
        println!("  trusts        {agent}");
    }
    for peer in &args.federate {
        println!("  searches with {}", peer.url);
    }
    println!("Ctrl-C ends it.");
}
