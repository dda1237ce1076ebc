//! The link over NATS: messages on subjects, the store in a key-value bucket of JetStream, blobs in an object store,
//! payloads in a stream.
//!
//! A message from A to B has the subject `bottega.FARM.to.HOME.B.from.HOME.A`: an agent subscribes to messages
//! addressed to it, and a server that lets each member publish `from` its own home only makes senders certain
//! ([`Rights`]). A conditional write is a publication with the expected last sequence of its subject: the bucket's
//! revision, and our fencing token. A write that the server did not confirm counts as unknown, never as done.

mod blobs;
mod enrolment;
mod error;
mod frame;
mod live;
mod names;
mod notices;
mod options;
mod paged;
mod pages;
mod payloads;
mod pin;
mod reload;
mod rights;
mod store;
mod watch;

use std::{
    sync::{Arc, atomic::Ordering},
    thread,
    time::Duration,
};

use async_nats::{
    Client, Request, RequestErrorKind,
    jetstream::{self, kv},
};
use tokio::{
    runtime::{Builder, Handle},
    sync::{mpsc, oneshot},
};
use tokio_stream::StreamExt;

pub use self::{
    blobs::{BlobError, NatsBlobs, StoredBlob},
    enrolment::{MemberKey, enrol, is_public_key, newcomer},
    error::NatsError,
    live::{LIVE_BYTES_MAX, LiveSubscription, NatsLive},
    notices::{NatsNotices, Notice},
    options::{Login, NatsOptions, Tls},
    paged::PagedUplink,
    pages::{AgentPage, NoticePages},
    payloads::NatsPayloads,
    pin::Pin,
    reload::reload_server,
    rights::Rights,
    store::EntryUpdate,
};
use self::{options::ANSWER_TIME, store::Bucket};
use super::{Mailbox, Uplink};
use crate::{AclMessage, AgentId, Event, Key, StateMachine, StoreRequest, Ticket, Time, codec::Codec};

/// Maximum number of outgoing messages waiting; further ones are lost, as on any network.
const OUTBOX_MAX: usize = 1 << 14;
/// Interval of checks whether an agent without messages is still there.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// The subject of requests for the server's storage state.
const STORE_INFO: &str = "$JS.API.INFO";
/// The oldest supported version of the server.
const OLDEST: (i64, i64, i64) = (2, 9, 0);

/// A link to a farm over NATS: messages, store, blobs, payloads, notices and live messages. `K` is the [`Codec`] of
/// messages and store. Methods that wait for the server block their thread; on a thread that runs asynchronous code
/// they panic.
pub struct NatsUplink<K> {
    codec: Arc<K>,
    client: Client,
    bucket: Bucket<K>,
    blobs: NatsBlobs,
    payloads: NatsPayloads,
    notices: NatsNotices,
    live: NatsLive,
    member: String,
    is_guest: bool,
    /// Outgoing messages in order, with their subjects.
    outbox: mpsc::Sender<(String, Vec<u8>)>,
    farm: String,
    handle: Handle,
    /// The thread that runs the link.
    _thread: Arc<NatsThread>,
}

/// A thread that runs links; several may share it. It ends when the last link on it and the last clone of its `Arc` are
/// dropped.
pub struct NatsThread {
    handle: Handle,
    _end: oneshot::Sender<()>,
}

impl NatsThread {
    /// Starts a thread, on which links can be opened by [`NatsUplink::connect_on`].
    ///
    /// # Errors
    /// The thread or its runtime cannot be started.
    pub fn start() -> Result<Arc<Self>, NatsError> {
        let runtime = Builder::new_current_thread().enable_all().build()?;
        let handle = runtime.handle().clone();
        let (end, ended) = oneshot::channel::<()>();
        thread::Builder::new().name("nats".to_owned()).spawn(move || {
            // Either by a message or by a dropped sender
            _ = runtime.block_on(ended);
        })?;
        Ok(Arc::new(Self { handle, _end: end }))
    }
}

impl<K: Codec> NatsUplink<K> {
    /// Connects to a farm, and creates its buckets and streams if they are missing; a guest does not create them.
    /// Blocks until done.
    ///
    /// - `codec`: encodes contents of messages and values of the store.
    ///
    /// # Errors
    /// The server is unreachable, too old, rejects the login, or has no suitable storage; an address, the name of the
    /// farm or the credentials are invalid; or a thread cannot be started.
    pub fn connect(options: &NatsOptions, codec: K) -> Result<Self, NatsError> {
        Self::connect_on(&NatsThread::start()?, options, codec)
    }

    /// Like [`Self::connect`], on a thread shared with other links.
    ///
    /// # Errors
    /// As for [`Self::connect`].
    pub fn connect_on(thread: &Arc<NatsThread>, options: &NatsOptions, codec: K) -> Result<Self, NatsError> {
        let handle = thread.handle.clone();
        let Opened { client, context, blackboard, notices, objects, payloads } = handle.block_on(open(options))?;
        let (outbox, mail) = mpsc::channel(OUTBOX_MAX);
        handle.spawn(post(client.clone(), mail));
        let codec = Arc::new(codec);
        let bucket = Bucket::new(client.clone(), blackboard, Arc::clone(&codec));
        let notices = handle.block_on(NatsNotices::open(client.clone(), notices, handle.clone()));
        let blobs = NatsBlobs::new(context.clone(), objects, names::objects(&options.farm), handle.clone());
        let payloads = NatsPayloads::new(context, payloads, &options.farm, handle.clone());
        let live = NatsLive::new(client.clone(), &options.farm, handle.clone());
        let (farm, member, is_guest) = (options.farm.clone(), options.member.clone(), options.is_guest);
        Ok(Self {
            codec,
            client,
            bucket,
            blobs,
            payloads,
            notices,
            live,
            member,
            is_guest,
            outbox,
            farm,
            handle,
            _thread: Arc::clone(thread),
        })
    }

    /// Returns the blobs of the farm, for large data: the input of jobs, their orders and their results.
    pub fn blobs(&self) -> &NatsBlobs {
        &self.blobs
    }

    /// Returns the payloads of the farm, for results: small blobs, each written once.
    pub fn payloads(&self) -> &NatsPayloads {
        &self.payloads
    }

    /// Returns the name of the member that is linked: all processes of a machine are one member.
    pub fn member(&self) -> &str {
        &self.member
    }

    /// Returns true if this member is a guest, see [`Rights::of_guest`].
    pub fn is_guest(&self) -> bool {
        self.is_guest
    }

    /// Returns the notices of the farm, which all members may read and change.
    pub fn notices(&self) -> &NatsNotices {
        &self.notices
    }

    /// Returns the live messages of the farm, which are sent to all current listeners.
    pub fn live(&self) -> &NatsLive {
        &self.live
    }

    /// Returns the version of the NATS server, such as `2.10.4`.
    pub fn server_version(&self) -> String {
        self.client.server_info().version
    }

    /// Returns the traffic over the link since it was opened.
    pub fn traffic(&self) -> Traffic {
        let statistics = self.client.statistics();
        Traffic {
            messages_out: statistics.out_messages.load(Ordering::Relaxed),
            messages_in: statistics.in_messages.load(Ordering::Relaxed),
            bytes_out: statistics.out_bytes.load(Ordering::Relaxed),
            bytes_in: statistics.in_bytes.load(Ordering::Relaxed),
        }
    }

    /// Returns true if the link is connected to a server now.
    pub fn is_connected(&self) -> bool {
        self.client.connection_state() == async_nats::connection::State::Connected
    }

    /// Asks the server for the state of its storage, and returns it; blocks at most two seconds, after which it is
    /// [`ServerState::Silent`].
    pub fn server_state(&self) -> ServerState {
        let request = Request::new().timeout(Some(ANSWER_TIME));
        match self.handle.block_on(self.client.send_request(STORE_INFO, request)) {
            Ok(answer) => ServerState::read(&answer.payload),
            Err(error) if error.kind() == RequestErrorKind::NoResponders => {
                ServerState::StoresNothing { reason: error.to_string() }
            }
            Err(_) => ServerState::Silent,
        }
    }

    /// Reports all entries of the store whose keys start with `prefix`, and then every write to one; after an
    /// interruption all are reported again. Removals are not reported. Blocks meanwhile.
    ///
    /// - `tell`: gets the reports, at least one every few seconds; it returns false to end them.
    pub fn follow_entries(&self, prefix: &Key, tell: impl FnMut(EntryUpdate<K::Value>) -> bool) {
        self.handle.block_on(self.bucket.follow(prefix, tell));
    }

    /// Deletes all entries of the store below a prefix. Failure is only logged.
    ///
    /// - `prefix`: ends with `/`. What follows its last `/` is not compared; without any `/` all entries are deleted.
    pub fn forget(&self, prefix: &Key) {
        self.handle.block_on(self.bucket.forget(prefix));
    }

    /// Returns the address of an agent over this link, which starts with `nats:`; for directories.
    pub fn address_of(&self, agent: &AgentId) -> String {
        names::address(&self.farm, &agent.name)
    }

    /// Waits until all waiting messages are sent, at most two seconds.
    pub fn flush(&self) {
        let wait = async {
            // Send the outbox first
            while self.outbox.capacity() < OUTBOX_MAX {
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
            _ = self.client.flush().await;
        };
        _ = self.handle.block_on(async { tokio::time::timeout(ANSWER_TIME, wait).await });
    }
}

/// The state of a server's storage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ServerState {
    /// The server does not answer.
    Silent,
    /// The server answers, but has no storage, for example because its disk was full.
    StoresNothing {
        /// The server's message.
        reason: String,
    },
    /// The server has storage.
    Stores {
        /// Number of bytes stored for all farms together.
        bytes: u64,
    },
}

impl ServerState {
    /// Parses an answer. The library's own type does not support all servers.
    fn read(bytes: &[u8]) -> Self {
        let answer: serde_json::Value = serde_json::from_slice(bytes).unwrap_or_default();
        match answer["storage"].as_u64() {
            Some(bytes) => Self::Stores { bytes },
            None => {
                Self::StoresNothing { reason: answer["error"]["description"].as_str().unwrap_or_default().to_owned() }
            }
        }
    }
}

/// Sends waiting messages in order.
async fn post(client: Client, mut mail: mpsc::Receiver<(String, Vec<u8>)>) {
    while let Some((subject, message)) = mail.recv().await {
        if let Err(error) = client.publish(subject, message.into()).await {
            tracing::warn!(%error, "a message was lost");
        }
    }
}

/// The traffic over a link since it was opened, including the server's answers, without the overhead of the NATS
/// protocol.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Number of messages to the server.
    pub messages_out: u64,
    /// Number of messages from the server.
    pub messages_in: u64,
    /// Number of bytes to the server.
    pub bytes_out: u64,
    /// Number of bytes from the server.
    pub bytes_in: u64,
}

/// The opened parts of a link.
struct Opened {
    client: Client,
    context: jetstream::Context,
    blackboard: kv::Store,
    notices: kv::Store,
    objects: (jetstream::object_store::ObjectStore, jetstream::stream::Stream),
    payloads: jetstream::stream::Stream,
}

/// Connects to the servers.
async fn connect(options: &NatsOptions) -> Result<Client, NatsError> {
    let mut addresses = Vec::new();
    for address in &options.servers {
        let parsed = address.parse::<async_nats::ServerAddr>();
        addresses.push(parsed.map_err(|_| NatsError::Address { address: address.clone() })?);
    }
    let servers = options.servers.join(", ");
    let connected = options.connect_options().await?.connect(addresses).await;
    connected.map_err(|source| NatsError::Connect { servers, source })
}

async fn open(options: &NatsOptions) -> Result<Opened, NatsError> {
    let client = connect(options).await?;
    let (major, minor, patch) = OLDEST;
    if !client.is_server_compatible(major, minor, patch) {
        return Err(NatsError::Version { version: client.server_info().version });
    }
    let mut context = jetstream::new(client.clone());
    context.set_timeout(ANSWER_TIME);
    let farm = &options.farm;
    let may_make = !options.is_guest;
    let blackboard = store::open(&context, names::blackboard(farm), "the blackboard", may_make).await?;
    let notices = store::open(&context, names::notices(farm), "notices", may_make).await?;
    let objects = blobs::open(&context, names::objects(farm), "blobs", may_make).await?;
    let payloads = payloads::open(&context, farm, may_make).await?;
    Ok(Opened { client, context, blackboard, notices, objects, payloads })
}

impl<M, K> Uplink<M> for NatsUplink<K>
where
    K: Codec,
    M: StateMachine<Content = K::Content, Value = K::Value> + Send + 'static,
    M::Effect: Send + 'static,
    M::Completion: Send + 'static,
{
    fn add(&self, agent: &AgentId, mailbox: Mailbox<M>) {
        let (client, codec, me) = (self.client.clone(), Arc::clone(&self.codec), agent.clone());
        let subject = names::messages_to(&self.farm, &agent.name);
        let (listens, listening) = oneshot::channel();
        self.handle.spawn(async move {
            let subscribed = client.subscribe(subject).await;
            _ = client.flush().await;
            _ = listens.send(());
            let Ok(mut messages) = subscribed else { return };
            while !mailbox.is_closed() {
                let message = match tokio::time::timeout(LOOK_EVERY, messages.next()).await {
                    Ok(Some(message)) => message,
                    Ok(None) => return,
                    Err(_) => continue,
                };
                let Some(sender) = names::sender(&message.subject).map(AgentId::new) else {
                    tracing::warn!(subject = %message.subject, "a message of nobody");
                    continue;
                };
                match frame::read_message(&*codec, mailbox.now(), sender, me.clone(), &message.payload) {
                    Ok(message) => mailbox.deliver(Event::Message(message)),
                    Err(error) => tracing::warn!(subject = %message.subject, %error, "cannot read a message"),
                }
            }
        });
        _ = self.handle.block_on(async { tokio::time::timeout(ANSWER_TIME, listening).await });
    }

    fn publish(&self, now: Time, message: &AclMessage<K::Content>, receiver: &AgentId) {
        let subject = names::message_to(&self.farm, receiver, &message.sender.name);
        let bytes = frame::write_message(&*self.codec, now, message);
        if self.outbox.try_send((subject, bytes)).is_err() {
            tracing::warn!(%receiver, "a message was lost: too many are waiting");
        }
    }

    fn ask_store(&self, mailbox: Mailbox<M>, ticket: Ticket, request: StoreRequest<K::Value>) {
        let bucket = self.bucket.clone();
        self.handle.spawn(async move {
            match request {
                StoreRequest::Watch { prefix } => bucket.watch(&prefix, ticket, &mailbox).await,
                request => {
                    let reply = bucket.ask(request).await;
                    mailbox.deliver(Event::Store { ticket, reply });
                }
            }
        });
    }
}
