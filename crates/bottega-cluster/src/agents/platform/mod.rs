//! The farm as a FIPA platform: Start Service, AMS, DF and message transport over the directories of the farm, with its
//! jobs and machines as agents.
//!
//! The pages of the directories are notices of the farm, so any process of it may serve the platform, and several may at
//! once. The agents of the farm live in the first of them; the others are views of the same pages.

mod farm_agents;
mod host;
mod strangers;
mod talk;
mod terms;

use std::{
    net::{Ipv4Addr, SocketAddr, TcpListener},
    sync::Arc,
    time::Duration,
};

use bottega_agents::{
    AgentId,
    driver::{
        nats::NoticePages,
        node::{Node, NodeConfig, TraceLine},
    },
    gateway::FirstForms,
};

pub use self::host::{PlatformHost, host_of};
use self::{
    farm_agents::{FarmAgents, jobs_id},
    host::HostClaim,
    strangers::Strangers,
};

use crate::{
    error::Error,
    files::cache::Cache,
    job::board::JobBoard,
    server::ports::{Port, bind, bind_near},
};

/// The default name of a farm's platform.
pub const NAME: &str = bottega_farm::PLATFORM;
/// The default address of the platform's message transport.
pub const LISTEN: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 7779);

/// The options of a served platform.
#[derive(Clone)]
pub struct PlatformOptions {
    /// The name of the platform: the part after `@` in the names of its agents.
    pub name: String,
    /// The address to listen on; none: [`LISTEN`], or any free local port if that is taken.
    pub listen: Option<SocketAddr>,
    /// The `host:port` that other platforms connect to, if it differs from the listening address.
    pub public: Option<String>,
    /// Directories of other platforms that the platform's DF includes in searches.
    pub federates: Vec<AgentId>,
    /// The longest lease that the platform's DF grants; none: no limit.
    pub lease_max: Option<Duration>,
    /// Agents of other platforms that may change all entries of the directories, and may command jobs and machines.
    /// Their identity is not verified.
    pub trusted: Vec<AgentId>,
    /// Formats the trace line of each message that the platform handles.
    pub trace_line: TraceLine,
    /// The encoding of first messages to agents that have not written before.
    pub first_forms: FirstForms,
}

impl PlatformOptions {
    /// Checks that other platforms can connect to the address.
    ///
    /// # Errors
    /// The platform listens on all addresses, and no public one is given.
    pub fn validate(&self) -> Result<(), Error> {
        match self.listen.filter(|listen| listen.ip().is_unspecified() && self.public.is_none()) {
            Some(listen) => Err(Error::usage(
                format!("other machines cannot connect to {listen}"),
                "give the address to which others connect: that of this machine, or with `platform serve` --public HOST:PORT",
            )),
            None => Ok(()),
        }
    }

    /// Binds the listening port. Returns the listening socket.
    ///
    /// - `port`: the purpose of the port, for errors.
    ///
    /// # Errors
    /// The address cannot be bound, or other platforms cannot connect to it: see [`Self::validate`].
    pub fn bind(&self, port: Port) -> Result<TcpListener, Error> {
        self.validate()?;
        self.listen.map_or_else(|| bind_near(port, LISTEN, 0), |listen| bind(port, listen))
    }
}

/// A platform of a farm, served by this process.
pub struct FarmPlatform {
    node: Arc<Node>,
    /// The agents of the farm, if this process hosts them.
    agents: Option<FarmAgents>,
    /// The admission of agents of other platforms, if this process hosts it.
    strangers: Option<Strangers>,
    jobs: AgentId,
}

impl FarmPlatform {
    /// Starts to serve the platform over the directories of a farm, on threads of its own. Hosts the farm's agents, too, unless
    /// another process does; it waits up to 2.5 s to see one. Returns the running platform.
    ///
    /// - `listener`: the bound port: see [`PlatformOptions::bind`].
    ///
    /// # Errors
    /// This machine is a guest of the farm, the name is invalid, or a thread cannot be started.
    pub fn serve(listener: TcpListener, board: JobBoard, options: &PlatformOptions) -> Result<Self, Error> {
        // The platform shows all machines and jobs of the farm.
        board.refuse_guests()?;
        // The jobs agent acts for the farm: it resumes machines, which only the platform may do.
        let jobs = jobs_id(&options.name);
        let claim = HostClaim::claim(&board, &options.name);
        let node = Arc::new(start_node(listener, &board, options, &jobs, claim.is_some())?);
        let Some(claim) = claim else { return Ok(Self { agents: None, strangers: None, node, jobs }) };
        let claim = claim.at(node.address());
        let agents = FarmAgents::begin(&node, &options.name, board.clone(), claim, &options.trusted)?;
        let strangers = Strangers::begin(strangers::StrangersConfig {
            node: Arc::clone(&node),
            board,
            platform: options.name.clone(),
            cache: Cache::of_user(),
        })?;
        Ok(Self { agents: Some(agents), strangers: Some(strangers), node, jobs })
    }

    /// Returns the node with the services and the message transport.
    pub fn node(&self) -> &Node {
        &self.node
    }

    /// Returns the identifier of the jobs agent, which describes the farm's jobs and changes them on request.
    pub fn jobs(&self) -> &AgentId {
        &self.jobs
    }

    /// Returns true if this process hosts the farm's agents; false if it is a view of their pages.
    pub fn has_agents(&self) -> bool {
        self.agents.is_some()
    }

    /// Deregisters the agents that this process hosts, and stops the platform.
    pub fn stop(self) {
        drop((self.agents, self.strangers));
        // They held the other references to the node.
        if let Some(node) = Arc::into_inner(self.node) {
            node.stop();
        }
    }
}

fn start_node(
    listener: TcpListener,
    board: &JobBoard,
    options: &PlatformOptions,
    jobs: &AgentId,
    is_host: bool,
) -> Result<Node, Error> {
    let config = NodeConfig {
        name: options.name.clone(),
        public: options.public.clone(),
        store: Box::new(NoticePages::new(board.uplink.notices().clone(), &options.name)),
        lease_max: options.lease_max,
        federates: options.federates.clone(),
        administrators: vec![jobs.clone()],
        trusted: options.trusted.clone(),
        permanent: Some(jobs.clone()).filter(|_| is_host).into_iter().collect(),
        trace_line: options.trace_line,
        first_forms: options.first_forms.clone(),
    };
    Node::start(listener, config).map_err(Error::Platform)
}
