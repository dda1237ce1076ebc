//! The farm as a FIPA platform: Start Service, AMS, DF and message transport over the pages of the farm, with its jobs and
//! machines as agents.
//!
//! The pages are notices of the farm, so any process of it may serve the platform, and several may at once. The agents of
//! the farm live in the first of them; the others are views of the same pages.

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
    host::HostSeat,
    strangers::Strangers,
};

use crate::{
    JobBoard,
    cache::Cache,
    error::Error,
    ports::{Port, bind, bind_near},
};

/// The name of a farm's platform where nobody says.
pub const NAME: &str = bottega_farm::PLATFORM;
/// Where it listens where nobody says.
pub const LISTEN: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 7779);

/// The options of a served platform.
#[derive(Clone)]
pub struct PlatformOptions {
    /// Its name: what stands behind `@` in the names of its agents.
    pub name: String,
    /// Where to listen; none: [`LISTEN`], or where that is taken any free port of this machine.
    pub listen: Option<SocketAddr>,
    /// What others connect to, as `host:port`, where that is not where it listens.
    pub public: Option<String>,
    /// Directories of other platforms with which its own searches together.
    pub federates: Vec<AgentId>,
    /// The longest lease that its DF grants.
    pub lease_max: Option<Duration>,
    /// Agents of other platforms that may change things.
    pub trusted: Vec<AgentId>,
    /// How to tell what passes.
    pub trace_line: TraceLine,
    /// In which form others are written to who have not written themselves.
    pub first_forms: FirstForms,
}

impl PlatformOptions {
    /// Whether others can connect to what they are told.
    ///
    /// # Errors
    /// It listens everywhere, and nobody says by what name others reach it.
    pub fn validate(&self) -> Result<(), Error> {
        match self.listen.filter(|listen| listen.ip().is_unspecified() && self.public.is_none()) {
            Some(listen) => Err(Error::usage(
                format!("nobody can connect to {listen}"),
                "say what others shall connect to: the address of this machine, or with `platform serve` --public HOST:PORT",
            )),
            None => Ok(()),
        }
    }

    /// Binds the port on which it listens.
    ///
    /// - `port`: who serves the platform, for errors.
    ///
    /// # Errors
    /// The port is taken, or others cannot connect to it.
    pub fn bind(&self, port: Port) -> Result<TcpListener, Error> {
        self.validate()?;
        self.listen.map_or_else(|| bind_near(port, LISTEN, 0), |listen| bind(port, listen))
    }
}

/// A platform of a farm, served by this process.
pub struct FarmPlatform {
    node: Arc<Node>,
    /// The agents of the farm, if they live here.
    agents: Option<FarmAgents>,
    /// What admits agents of other platforms, where they do.
    strangers: Option<Strangers>,
    jobs: AgentId,
}

impl FarmPlatform {
    /// Serves the platform over the pages of a farm.
    ///
    /// - `listener`: where: see [`PlatformOptions::bind`].
    ///
    /// # Errors
    /// This machine is a guest of the farm, the name is none, or the operating system gives no thread.
    pub fn serve(listener: TcpListener, board: JobBoard, options: &PlatformOptions) -> Result<Self, Error> {
        // It shows all machines and jobs of the farm.
        board.refuse_guests()?;
        // The agent of the jobs speaks for the farm: it resumes machines, which only the platform may.
        let jobs = jobs_id(&options.name);
        let seat = HostSeat::claim(&board, &options.name);
        let node = Arc::new(start_node(listener, &board, options, &jobs, seat.is_some())?);
        let Some(seat) = seat else { return Ok(Self { agents: None, strangers: None, node, jobs }) };
        let seat = seat.at(node.address());
        let agents = FarmAgents::begin(&node, &options.name, board.clone(), seat, &options.trusted)?;
        let strangers = Strangers::begin(strangers::StrangersConfig {
            node: Arc::clone(&node),
            board,
            platform: options.name.clone(),
            cache: Cache::of_user(),
        })?;
        Ok(Self { agents: Some(agents), strangers: Some(strangers), node, jobs })
    }

    /// The services and the transport.
    pub fn node(&self) -> &Node {
        &self.node
    }

    /// The agent of the jobs.
    pub fn jobs(&self) -> &AgentId {
        &self.jobs
    }

    /// Whether the agents of the farm live here: else this is a view of their pages.
    pub fn has_agents(&self) -> bool {
        self.agents.is_some()
    }

    /// Says farewell, and ends.
    pub fn stop(self) {
        drop((self.agents, self.strangers));
        // They were the last others who held it.
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
