//! A node: a complete platform in one process, with services, gateway and transport.

use std::{
    collections::hash_map::RandomState,
    hash::{BuildHasher, Hasher},
    io,
    net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs},
    sync::{Arc, atomic::AtomicU64, mpsc},
    thread,
    time::Duration,
};

use tokio::sync::{broadcast, mpsc as lanes, oneshot};

pub use super::fitted::{Anything, NodeMachine, Reports};
use super::{
    asker::Asker,
    fitted::{Fitted, own},
    http::{
        PATH, client,
        server::{self, HttpService},
    },
    local::{LocalPlatform, Mailbox, NameTaken},
};
use crate::{
    AclMessage, AgentId, Bus, Performative, StateMachine, StoreRequest, Ticket,
    acc::{Letter, Outbound},
    entry_store::EntryStore,
    gateway::{ChannelEffect, ChannelReport, FirstForms, Gateway, GatewayConfig, Passage, PlainContent},
    platform::{
        Ams, AmsConfig, Df, DfConfig, Function, LifeCycleRequest, ManagementContent, ONTOLOGY, Outcome, Service,
        ServiceEntry, StandardAgent, StartService,
    },
    wire::Calendar,
};

/// Maximum number of concurrent outgoing messages; those to one address are sent in order.
const LANES: usize = 8;
/// Maximum number of messages waiting in a lane; further ones count as lost.
const LANE_MAX: usize = 256;
/// Maximum number of incoming messages waiting for the gateway.
const ARRIVED_MAX: usize = 1024;
/// Maximum number of trace lines waiting for an observer.
const TRACE_MAX: usize = 1024;
/// Interval of polling the store for writes of other processes.
const POLL_EVERY: Duration = Duration::from_millis(50);
/// Number of threads for agents.
const THREADS: usize = 2;
/// Maximum time to wait at the end for other directories to remove this one's entry.
const FAREWELL_WAIT: Duration = Duration::from_secs(4);
/// Maximum time to wait for another process of the platform to show that it is present.
const OTHER_WAIT: Duration = Duration::from_millis(300);

/// Reports of the transport to the gateway.
type GatewayReports = Reports<ChannelReport>;

/// A function that formats a passing message as a line of the trace, without line end.
pub type TraceLine = fn(&Passage, Calendar) -> String;

/// The configuration of a node: its names, its store, and the rights of other agents.
pub struct NodeConfig {
    /// The name of the platform, the part after `@` in the names of its agents: at most 200 letters, digits and `-._:`.
    pub name: String,
    /// The public address as `host:port`; `None`: the address on which the node listens.
    pub public: Option<String>,
    /// The store of the services. Nodes with the same entries serve one platform.
    pub store: Box<dyn EntryStore<String, usize> + Send>,
    /// Maximum lease that the DF grants; `None`: any, including unlimited.
    pub lease_max: Option<Duration>,
    /// Directories of other platforms, at which the DF registers, and which it asks in federated searches.
    pub federates: Vec<AgentId>,
    /// Agents of this platform that may change all entries; messages from outside cannot use these names.
    pub administrators: Vec<AgentId>,
    /// Agents of other platforms that may change all entries. Their identity is not verified.
    pub trusted: Vec<AgentId>,
    /// Agents of this platform whose entries in the white pages are read-only, like those of its services.
    pub permanent: Vec<AgentId>,
    /// Formats passing messages for the trace.
    pub trace_line: TraceLine,
    /// The representations of messages to other platforms that do not answer one.
    pub first_forms: FirstForms,
}

/// An error in starting a node.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// The listener cannot be used, or a thread cannot be started.
    #[error("cannot start the platform")]
    Start(#[from] io::Error),
    /// The name is empty, longer than 200 bytes, or contains characters not allowed in names of agents.
    #[error("`{0}` cannot be the name of a platform: use letters, digits and `-._:`")]
    Name(String),
}

/// A running platform. Dropping it ends it without notice, like a crash of its process; [`Node::stop`] deregisters
/// first.
pub struct Node {
    platform: Arc<LocalPlatform<NodeMachine>>,
    address: String,
    local: SocketAddr,
    ids: Ids,
    is_federated: bool,
    trace: broadcast::Sender<Arc<str>>,
    end: Option<oneshot::Sender<()>>,
    network: Option<thread::JoinHandle<()>>,
}

/// The identifiers of a platform's services.
#[derive(Clone, Debug)]
struct Ids {
    ams: AgentId,
    df: AgentId,
    start: AgentId,
    acc: AgentId,
    /// Two agents that send requests at the end of the node.
    leavers: [AgentId; 2],
}

impl Ids {
    fn new(platform: &str, address: &str) -> Self {
        let id = |local: &str| AgentId {
            name: format!("{local}@{platform}").into(),
            addresses: Arc::new([address.to_owned()]),
        };
        let leavers = [id("leaving-1"), id("leaving-2")];
        Self { ams: id("ams"), df: id("df"), start: id("start"), acc: id("acc"), leavers }
    }
}

impl Node {
    /// Starts a platform with its services, gateway and transport. Returns it; it runs on threads of its own.
    ///
    /// - `listener`: the socket at which other platforms reach it.
    ///
    /// # Errors
    /// The name is invalid, the listener cannot be used, or a thread cannot be started.
    pub fn start(listener: TcpListener, config: NodeConfig) -> Result<Self, NodeError> {
        let fits = |byte: u8| byte.is_ascii_alphanumeric() || b"-._:".contains(&byte);
        if config.name.is_empty() || config.name.len() > 200 || !config.name.bytes().all(fits) {
            return Err(NodeError::Name(config.name));
        }
        listener.set_nonblocking(true)?;
        let local = listener.local_addr()?;
        let host = config.public.clone().unwrap_or_else(|| local.to_string());
        let address = format!("http://{host}{PATH}");
        let ids = Ids::new(&config.name, &address);
        let platform = Arc::new(LocalPlatform::with_store(THREADS, config.store)?);
        let (trace, _) = broadcast::channel(TRACE_MAX);
        let setup = Setup {
            name: config.name,
            address: address.clone(),
            ids: ids.clone(),
            calendar: platform.calendar(),
            salt: random(),
            lease_max: config.lease_max,
            federates: config.federates,
            administrators: config.administrators,
            trusted: config.trusted,
            permanent: config.permanent,
            trace_line: config.trace_line,
            first_forms: config.first_forms,
        };
        let is_federated = !setup.federates.is_empty();
        let (lanes, queues) = (0..LANES).map(|_| lanes::channel(LANE_MAX)).unzip();
        let gateway = setup.people(&platform, lanes, trace.clone());
        let network = NodeNetwork { listener, gateway, queues, platform: Arc::clone(&platform), trace: trace.clone() };
        let (end, ended) = oneshot::channel();
        let about = about(&setup.name, &address);
        let network = thread::Builder::new().name("transport".to_owned()).spawn(move || network.run(about, ended))?;
        Ok(Self { platform, address, local, ids, is_federated, trace, end: Some(end), network: Some(network) })
    }

    /// Returns the public address of this node, such as `http://host:port/acc`.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Returns the address on which the node listens.
    pub fn local_address(&self) -> SocketAddr {
        self.local
    }

    /// Returns the AMS, with its address.
    pub fn ams(&self) -> &AgentId {
        &self.ids.ams
    }

    /// Returns the DF, with its address.
    pub fn df(&self) -> &AgentId {
        &self.ids.df
    }

    /// Returns the Start Service, with its address.
    pub fn start_service(&self) -> &AgentId {
        &self.ids.start
    }

    /// Adds an agent, which the AMS registers. The agent obeys the life-cycle requests of the AMS; its effects are
    /// ignored.
    ///
    /// # Errors
    /// The name was used by another agent, running or stopped.
    pub fn add<M>(&self, id: &AgentId, machine: M) -> Result<(), NameTaken>
    where
        M: StateMachine<Content = PlainContent, Value = String> + Send + 'static,
        M::Effect: Send + 'static,
        M::Completion: Send + 'static,
    {
        let machine = StandardAgent::new(id.clone(), self.ids.ams.clone(), machine);
        self.add_worldly(id, machine, |_| {}).map(drop)
    }

    /// Adds an agent that handles the requests of the AMS itself and has effects. Returns the channel for the
    /// completions of its effects.
    ///
    /// - `perform`: begins an effect; must return quickly.
    ///
    /// # Errors
    /// The name was used by another agent, running or stopped.
    pub fn add_worldly<M>(
        &self,
        id: &AgentId,
        machine: M,
        perform: impl FnMut(M::Effect) + Send + 'static,
    ) -> Result<Reports<M::Completion>, NameTaken>
    where
        M: StateMachine<Content = PlainContent, Value = String> + Send + 'static,
        M::Effect: Send + 'static,
        M::Completion: Send + 'static,
    {
        let (mut perform, fitted) = (perform, Box::new(Fitted(machine)));
        let performer = move |effect, _: &Mailbox<NodeMachine>| own(effect).map_or((), &mut perform);
        Ok(Reports::new(self.platform.add(id, fitted, Box::new(performer))?))
    }

    /// Sends a request to an agent of this or another platform, and returns performative and content of the answer; an
    /// agree does not count. Blocks until then. `None`: there was no answer in time.
    ///
    /// - `from`: the name of the sender, which no agent here may have or have had.
    /// - `wait`: the maximum time to the answer.
    ///
    /// # Errors
    /// The name `from` was used by another agent, running or stopped.
    pub fn ask(
        &self,
        from: &AgentId,
        to: &AgentId,
        content: ManagementContent,
        wait: Duration,
    ) -> Result<Option<(Performative, PlainContent)>, NameTaken> {
        let (heard, hear) = mpsc::channel();
        // Numbers of foreign conversations are greater
        let conversation = random() >> 2 | 1;
        let asker = Asker { me: from.clone(), to: to.clone(), content, heard, until: None, wait, conversation };
        self.add_worldly(from, asker, |()| {})?;
        // The asker has its own timeout; it only fails with its platform
        Ok(hear.recv().ok())
    }

    /// Sends a request in the name of an agent, without waiting; that agent gets the answers if it exists here.
    pub fn say(&self, from: &AgentId, to: &AgentId, content: ManagementContent) {
        let content = PlainContent::Management(content);
        let message = AclMessage::new(Performative::Request, from.clone(), to.clone(), content);
        self.platform.bus().publish(AclMessage { ontology: ONTOLOGY, protocol: "fipa-request", ..message });
    }

    /// Subscribes to the trace of passing messages. The returned channel gets a line per message; a slow reader misses
    /// lines.
    pub fn trace(&self) -> broadcast::Receiver<Arc<str>> {
        self.trace.subscribe()
    }

    /// Ends the platform's part in this process; takes some seconds at most. Deregisters the DF from other directories,
    /// unless another process still serves the platform, and informs the platform's other processes.
    pub fn stop(self) {
        if self.is_federated && !self.is_served_elsewhere() {
            let quit = ManagementContent::LifeCycle(LifeCycleRequest::Quit);
            if let Err(error) = self.ask(&self.ids.leavers[0], &self.ids.df, quit, FAREWELL_WAIT) {
                tracing::warn!(%error, "cannot inform other directories that this one ends");
            }
        }
        let farewell = StoreRequest::Put { key: Ams::node_key(&self.address).into(), value: String::new() };
        self.platform.bus().ask_store(&self.ids.ams, Ticket(u64::MAX), farewell);
    }

    /// Returns true if another process serves the platform. A killed one may still be listed.
    fn is_served_elsewhere(&self) -> bool {
        let content = ManagementContent::Action(Function::GetDescription);
        let answer = self.ask(&self.ids.leavers[1], &self.ids.ams, content, FAREWELL_WAIT);
        let Ok(Some((_, PlainContent::Management(ManagementContent::Done(_, Outcome::Platform(platform)))))) = answer
        else {
            return false;
        };
        let addresses = platform.services.iter().flat_map(|service| &service.addresses);
        addresses.filter(|address| **address != self.address).any(|address| {
            let host = client::parse_address(address).ok().map(|(host, _)| host);
            let at = host.and_then(|host| host.to_socket_addrs().ok()?.next());
            at.is_some_and(|at| TcpStream::connect_timeout(&at, OTHER_WAIT).is_ok())
        })
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        if let Some(end) = self.end.take() {
            // The transport may have ended already
            _ = end.send(());
        }
        if let Some(network) = self.network.take() {
            _ = network.join();
        }
    }
}

/// Returns the response to a GET: the name of the platform and the address of its AMS.
fn about(name: &str, address: &str) -> String {
    format!(
        "(ap-description :name {name} :ap-services (set (ap-service :name fipa.mts.mtp.http.std :type fipa.mts.mtp.http.std :addresses (sequence {address}))))\n"
    )
}

/// The parameters for adding agents to a platform.
struct Setup {
    name: String,
    address: String,
    ids: Ids,
    calendar: Calendar,
    salt: u64,
    lease_max: Option<Duration>,
    federates: Vec<AgentId>,
    administrators: Vec<AgentId>,
    trusted: Vec<AgentId>,
    permanent: Vec<AgentId>,
    trace_line: TraceLine,
    first_forms: FirstForms,
}

impl Setup {
    /// Adds the services and the gateway.
    fn people(
        &self,
        platform: &LocalPlatform<NodeMachine>,
        lanes: Vec<lanes::Sender<Outbound>>,
        trace: broadcast::Sender<Arc<str>>,
    ) -> GatewayReports {
        let Ids { ams, df, start, acc, .. } = &self.ids;
        let services = vec![ams.clone(), df.clone(), start.clone(), acc.clone()];
        let entry = |id: &AgentId, kind: &str| ServiceEntry {
            id: id.name.to_string(),
            service_type: kind.to_owned(),
            addresses: vec![self.address.clone()],
        };
        let basic = vec![
            entry(acc, "fipa-mts"),
            entry(ams, "fipa-ams"),
            entry(df, "fipa-df"),
            entry(start, "bottega-start-service"),
        ];
        let gateway = Gateway::<PlainContent, String>::new(GatewayConfig {
            id: acc.clone(),
            platform: self.name.clone(),
            addresses: vec![self.address.clone()],
            calendar: self.calendar,
            services: services.clone(),
            administrators: self.administrators.clone(),
            salt: self.salt,
            first_forms: self.first_forms.clone(),
        });
        // Only within the platform is a sender's identity certain, so the gateway distinguishes these
        let administrators = [&self.administrators[..], &self.trusted].concat();
        let white = Ams::new(AmsConfig {
            id: ams.clone(),
            platform: self.name.clone(),
            services: [&services[..], &self.permanent].concat(),
            administrators: administrators.clone(),
            addresses: vec![self.address.clone()],
            enters_residents: true,
            unlisted: self.ids.leavers.to_vec(),
        });
        let yellow = Df::new(DfConfig {
            id: df.clone(),
            calendar: self.calendar,
            lease_max: self.lease_max,
            administrators,
            federates: self.federates.clone(),
            salt: self.salt,
        });
        let (calendar, line) = (self.calendar, self.trace_line);
        let perform = move |effect, mailbox: &Mailbox<NodeMachine>| match own::<ChannelEffect>(effect) {
            Some(ChannelEffect::Passed(passage)) if trace.receiver_count() > 0 => {
                _ = trace.send(line(&passage, calendar).into());
            }
            Some(ChannelEffect::Send(outbound)) => dispatch(&lanes, *outbound, &Reports::new(mailbox.clone())),
            // There are no observers
            Some(ChannelEffect::Passed(_)) | None => {}
        };
        let add = |id: &AgentId, machine: NodeMachine| {
            platform
                .add(id, machine, Box::new(|_, _| {}))
                .expect("the first agents of a platform have names of their own")
        };
        let gateway = platform
            .add(acc, Box::new(Fitted(gateway)), Box::new(perform))
            .expect("the first agent of a platform has a name of its own");
        platform.set_gateway(acc);
        add(ams, Box::new(Service::new(ams.clone(), white)));
        add(df, Box::new(Service::new(df.clone(), yellow)));
        add(start, Box::new(Service::new(start.clone(), StartService::new(basic))));
        Reports::new(gateway)
    }
}

/// Puts a message into the lane of its first address.
fn dispatch(lanes: &[lanes::Sender<Outbound>], outbound: Outbound, gateway: &GatewayReports) {
    let first = outbound.addresses.first().map_or(0, |address| {
        address.bytes().fold(0_usize, |sum, byte| sum.wrapping_mul(31).wrapping_add(usize::from(byte)))
    });
    if let Err(error) = lanes[first % lanes.len()].try_send(outbound) {
        let outbound = match error {
            lanes::error::TrySendError::Full(outbound) | lanes::error::TrySendError::Closed(outbound) => outbound,
        };
        let reason = "too many messages wait to be sent".to_owned();
        gateway.tell(ChannelReport::Failed { outbound: Box::new(outbound), reason });
    }
}

/// The sockets of a node.
struct NodeNetwork {
    listener: TcpListener,
    gateway: GatewayReports,
    queues: Vec<lanes::Receiver<Outbound>>,
    platform: Arc<LocalPlatform<NodeMachine>>,
    trace: broadcast::Sender<Arc<str>>,
}

impl NodeNetwork {
    fn run(self, about: String, ended: oneshot::Receiver<()>) {
        let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_all().build() else { return };
        runtime.block_on(async move {
            let Ok(listener) = tokio::net::TcpListener::from_std(self.listener) else { return };
            let (arrived, mut arrivals) = lanes::channel::<Letter>(ARRIVED_MAX);
            let service = HttpService {
                take: Box::new(move |letter| arrived.try_send(letter).is_ok()),
                about: Box::new(move || about.clone()),
                trace: self.trace,
            };
            tokio::spawn(server::serve(listener, Arc::new(service)));
            let gateway = self.gateway.clone();
            tokio::spawn(async move {
                while let Some(letter) = arrivals.recv().await {
                    gateway.tell(ChannelReport::Arrived(Box::new(letter)));
                }
            });
            for queue in self.queues {
                tokio::spawn(carry(queue, self.gateway.clone()));
            }
            let platform = self.platform;
            tokio::spawn(async move {
                let mut every = tokio::time::interval(POLL_EVERY);
                every.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
                loop {
                    every.tick().await;
                    platform.poll_store();
                }
            });
            // Either by a message or by a dropped sender
            _ = ended.await;
        });
        // Pending name look-ups must not delay the end
        runtime.shutdown_background();
    }
}

/// Sends the messages of a lane.
async fn carry(mut queue: lanes::Receiver<Outbound>, gateway: GatewayReports) {
    static NUMBER: AtomicU64 = AtomicU64::new(1);
    while let Some(outbound) = queue.recv().await {
        let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        if let Err(error) = client::send(&outbound, number).await {
            let reason = error_chain(&error);
            gateway.tell(ChannelReport::Failed { outbound: Box::new(outbound), reason });
        }
    }
}

/// Returns an error with its causes, as text.
fn error_chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}

/// Returns a secret random number from the operating system.
fn random() -> u64 {
    RandomState::new().build_hasher().finish()
}
