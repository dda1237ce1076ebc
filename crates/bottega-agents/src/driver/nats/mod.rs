//! The uplink over NATS: messages on subjects, the store in a key-value bucket of JetStream, blobs in an object store.
//!
//! A message from A to B goes out on `bottega.FARM.to.B.from.A`: an agent listens to what is addressed to it, and a server
//! that gives each agent leave to speak `from` its own name alone makes senders certain. A write that must not overtake
//! another is a publication with the sequence that its subject must have last: the bucket's revision, and our fencing token.
//! What the server did not confirm counts as unknown, never as done.

mod blobs;
mod board;
mod codec;
mod names;
mod store;

use std::{sync::Arc, thread, time::Duration};

use async_nats::{
    Client, ConnectOptions,
    jetstream::{self, kv},
};
use tokio::{
    runtime::{Builder, Handle},
    sync::{mpsc, oneshot},
};
use tokio_stream::StreamExt;

use self::store::Bucket;
pub use self::{
    blobs::{BlobError, NatsBlobs},
    board::{Notice, NoticeBoard},
    codec::{Codec, WIRE_VERSION},
};
use super::{Mailbox, Uplink};
use crate::{AclMessage, AgentId, Event, Key, StateMachine, StoreRequest, Ticket, Time};

/// Messages that wait to go out at most; what comes on top is lost, as on any network.
const OUTBOX_MAX: usize = 1 << 14;
/// How long the server may take to answer before it counts as silent.
const ANSWER_TIME: Duration = Duration::from_secs(2);
/// How long is waited for the server at first.
const CONNECT_TIME: Duration = Duration::from_secs(5);
/// How often an agent that hears nothing is asked whether it is still there.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// The oldest server that is known to work.
const OLDEST: (i64, i64, i64) = (2, 9, 0);

/// Where a farm is.
#[derive(Clone, Debug)]
pub struct NatsOptions {
    /// Addresses of its servers: `nats://host:4222`.
    pub servers: Vec<String>,
    /// The word that opens them, if they want one.
    pub token: Option<String>,
    /// The name of the farm: farms of different names on one server know nothing of each other.
    pub farm: String,
}

/// Why there is no link.
#[derive(Debug, thiserror::Error)]
pub enum NatsError {
    /// Nobody answers, or not to us.
    #[error("cannot reach a NATS server at {servers}")]
    Connect {
        /// Where it was sought.
        servers: String,
        /// Why not.
        source: async_nats::ConnectError,
    },
    /// An address that is none.
    #[error("`{address}` is no address of a NATS server, such as nats://host:4222")]
    Address {
        /// The address.
        address: String,
    },
    /// A name that cannot be one.
    #[error("`{name}` is no name of a farm: letters, digits, - and _ make one")]
    Name {
        /// The name.
        name: String,
    },
    /// The server is older than any that is known to work.
    #[error("the NATS server is of version {version}; 2.9 or newer is needed")]
    Version {
        /// Its version.
        version: String,
    },
    /// The server keeps nothing, or not what was asked for.
    #[error("the NATS server does not keep {what} for the farm: {reason}")]
    Keep {
        /// What.
        what: &'static str,
        /// Why not.
        reason: String,
    },
    /// The operating system gives no thread.
    #[error("cannot start a thread")]
    Thread(#[from] std::io::Error),
}

/// A link to a farm.
pub struct NatsUplink<K> {
    codec: Arc<K>,
    client: Client,
    bucket: Bucket<K>,
    blobs: NatsBlobs,
    notices: NoticeBoard,
    /// What waits to go out: subject and message, in order.
    outbox: mpsc::Sender<(String, Vec<u8>)>,
    farm: String,
    handle: Handle,
    /// Ends the thread on which all of it runs.
    _end: oneshot::Sender<()>,
}

impl<K: Codec> NatsUplink<K> {
    /// Links up with a farm; makes its buckets where it has none. Blocks until that is done.
    ///
    /// # Errors
    /// Nobody is there, or one who cannot serve a farm.
    pub fn connect(options: &NatsOptions, codec: K) -> Result<Self, NatsError> {
        let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if options.farm.is_empty() || options.farm.len() > 64 || !options.farm.chars().all(is_name) {
            return Err(NatsError::Name { name: options.farm.clone() });
        }
        let runtime = Builder::new_current_thread().enable_all().build()?;
        let handle = runtime.handle().clone();
        let (end, ended) = oneshot::channel::<()>();
        thread::Builder::new().name("nats".to_owned()).spawn(move || {
            // Whether it is told or forgotten, it is over.
            _ = runtime.block_on(ended);
        })?;
        let Opened { client, blackboard, notices, objects } = handle.block_on(open(options))?;
        let (outbox, mail) = mpsc::channel(OUTBOX_MAX);
        handle.spawn(post(client.clone(), mail));
        let codec = Arc::new(codec);
        let bucket = Bucket::new(blackboard, Arc::clone(&codec));
        let notices = handle.block_on(NoticeBoard::open(client.clone(), notices, handle.clone()));
        let blobs = NatsBlobs::new(objects, handle.clone());
        let farm = options.farm.clone();
        Ok(Self { codec, client, bucket, blobs, notices, outbox, farm, handle, _end: end })
    }

    /// The blobs of the farm.
    pub fn blobs(&self) -> &NatsBlobs {
        &self.blobs
    }

    /// What everybody in the farm may read.
    pub fn notices(&self) -> &NoticeBoard {
        &self.notices
    }

    /// What the server says of itself.
    pub fn server_version(&self) -> String {
        self.client.server_info().version
    }

    /// Whether the server is there now.
    pub fn is_connected(&self) -> bool {
        self.client.connection_state() == async_nats::connection::State::Connected
    }

    /// Lets all entries of the store go whose names begin so.
    pub fn forget(&self, prefix: &Key) {
        self.handle.block_on(self.bucket.forget(prefix));
    }

    /// Has all that was said go out, as far as the server takes it in some seconds.
    pub fn flush(&self) {
        let wait = async {
            // What waits in the outbox goes out first.
            while self.outbox.capacity() < OUTBOX_MAX {
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
            _ = self.client.flush().await;
        };
        _ = self.handle.block_on(async { tokio::time::timeout(ANSWER_TIME, wait).await });
    }
}

/// Sends what waits, in its order.
async fn post(client: Client, mut mail: mpsc::Receiver<(String, Vec<u8>)>) {
    while let Some((subject, message)) = mail.recv().await {
        if let Err(error) = client.publish(subject, message.into()).await {
            tracing::warn!(%error, "a message was lost");
        }
    }
}

/// All that a link needs.
struct Opened {
    client: Client,
    blackboard: kv::Store,
    notices: kv::Store,
    objects: jetstream::object_store::ObjectStore,
}

async fn open(options: &NatsOptions) -> Result<Opened, NatsError> {
    let mut addresses = Vec::new();
    for address in &options.servers {
        let parsed = address.parse::<async_nats::ServerAddr>();
        addresses.push(parsed.map_err(|_| NatsError::Address { address: address.clone() })?);
    }
    let mut connect = ConnectOptions::new().name("bottega").connection_timeout(CONNECT_TIME);
    connect = connect.request_timeout(Some(ANSWER_TIME));
    if let Some(token) = &options.token {
        connect = connect.token(token.clone());
    }
    let servers = options.servers.join(", ");
    let client = connect.connect(addresses).await.map_err(|source| NatsError::Connect { servers, source })?;
    let (major, minor, patch) = OLDEST;
    if !client.is_server_compatible(major, minor, patch) {
        return Err(NatsError::Version { version: client.server_info().version });
    }
    let mut context = jetstream::new(client.clone());
    context.set_timeout(ANSWER_TIME);
    let farm = &options.farm;
    let blackboard = store::open(&context, format!("bottega-{farm}"), "the blackboard").await?;
    let notices = store::open(&context, format!("bottega-{farm}-notices"), "notices").await?;
    let objects = blobs::open(&context, farm).await?;
    Ok(Opened { client, blackboard, notices, objects })
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
        let subject = format!("bottega.{}.to.{}.from.*", self.farm, names::token(&agent.name));
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
                let sender = message.subject.rsplit('.').next().and_then(names::name).map(AgentId::new);
                let now = mailbox.now();
                let read =
                    sender.and_then(|from| codec::read_message(&*codec, now, from, me.clone(), &message.payload));
                match read {
                    Some(message) => mailbox.deliver(Event::Message(message)),
                    None => tracing::warn!(subject = %message.subject, "a message that cannot be read"),
                }
            }
        });
        _ = self.handle.block_on(async { tokio::time::timeout(ANSWER_TIME, listening).await });
    }

    fn publish(&self, now: Time, message: &AclMessage<K::Content>, receiver: &AgentId) {
        let (to, from) = (names::token(&receiver.name), names::token(&message.sender.name));
        let subject = format!("bottega.{}.to.{to}.from.{from}", self.farm);
        let bytes = codec::write_message(&*self.codec, now, message);
        if self.outbox.try_send((subject, bytes)).is_err() {
            tracing::warn!(%receiver, "a message was lost: too many wait");
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
