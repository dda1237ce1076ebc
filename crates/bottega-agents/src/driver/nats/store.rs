//! The store as a key-value bucket.

use std::{sync::Arc, time::Duration};

use async_nats::jetstream::{
    Context,
    kv::{self, Operation, UpdateErrorKind},
    stream::{self, DiscardPolicy, StorageType},
};
use tokio_stream::StreamExt;

use super::{Codec, NatsError, names};
use crate::{Entry, Event, Key, Revision, StateMachine, StoreReply, StoreRequest, Ticket, driver::Mailbox};

/// The largest value of an entry.
const VALUE_BYTES_MAX: i32 = 1 << 20;
/// After what time a watch that broke is begun again.
const AGAIN_AFTER: Duration = Duration::from_millis(250);
/// How often one who follows entries is asked whether it is enough, when nothing happens.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Opens a bucket of a farm, or makes it. What the server then says of it is compared with what was asked: older ones
/// leave out silently what they do not know.
///
/// A bucket is a stream of this shape. It is made as one, for the library's own way of making buckets does not read what
/// servers before 2.10 say of an account.
pub(super) async fn open(
    context: &Context,
    bucket: String,
    what: &'static str,
    may_make: bool,
) -> Result<kv::Store, NatsError> {
    let keep = |reason: String| NatsError::Keep { what, reason };
    let wanted = stream::Config {
        name: format!("KV_{bucket}"),
        description: Some(what.to_owned()),
        subjects: vec![format!("$KV.{bucket}.>")],
        max_messages_per_subject: 1,
        max_message_size: VALUE_BYTES_MAX,
        storage: StorageType::File,
        discard: DiscardPolicy::New,
        num_replicas: 1,
        allow_rollup: true,
        deny_delete: true,
        allow_direct: true,
        ..stream::Config::default()
    };
    let store = match context.get_key_value(&bucket).await {
        Ok(store) => store,
        Err(error) if !may_make => return Err(keep(error.to_string())),
        Err(_) => {
            context.create_stream(wanted.clone()).await.map_err(|error| keep(error.to_string()))?;
            context.get_key_value(&bucket).await.map_err(|error| keep(error.to_string()))?
        }
    };
    let got = &store.stream.cached_info().config;
    let same = [
        ("subjects", got.subjects == wanted.subjects),
        ("history", got.max_messages_per_subject == wanted.max_messages_per_subject),
        ("size of values", got.max_message_size == wanted.max_message_size),
        ("storage", got.storage == wanted.storage),
        ("purges", got.allow_rollup && got.deny_delete),
        ("direct reads", got.allow_direct),
        ("age", got.max_age.is_zero() && got.max_bytes <= 0 && got.max_messages <= 0),
    ];
    match same.iter().find(|(_, same)| !same) {
        None => Ok(store),
        Some((other, _)) => Err(keep(format!("its stream KV_{bucket} has another {other} than was asked for"))),
    }
}

/// The bucket with its codec.
pub(super) struct Bucket<K> {
    store: kv::Store,
    codec: Arc<K>,
}

impl<K> Clone for Bucket<K> {
    fn clone(&self) -> Self {
        Self { store: self.store.clone(), codec: Arc::clone(&self.codec) }
    }
}

impl<K: Codec> Bucket<K> {
    pub(super) fn new(store: kv::Store, codec: Arc<K>) -> Self {
        Self { store, codec }
    }

    /// Anything but a watch. A server that refuses at once is not asked again at once.
    pub(super) async fn ask(&self, request: StoreRequest<K::Value>) -> StoreReply<K::Value> {
        let reply = self.ask_once(request).await;
        if matches!(reply, StoreReply::Unavailable) {
            tokio::time::sleep(AGAIN_AFTER).await;
        }
        reply
    }

    async fn ask_once(&self, request: StoreRequest<K::Value>) -> StoreReply<K::Value> {
        match request {
            StoreRequest::Get { key } => match self.entry(&key).await {
                Ok(entry) => StoreReply::Got { key, entry },
                Err(()) => StoreReply::Unavailable,
            },
            StoreRequest::Put { key, value } => match self.store.put(names::key(&key), self.bytes(&value)).await {
                Ok(revision) => StoreReply::Written { key, revision: Revision(revision) },
                Err(error) => unavailable(&error),
            },
            StoreRequest::CompareAndSet { key, expected_revision, value } => {
                let bytes = self.bytes(&value);
                match self.store.update(names::key(&key), bytes, expected_revision.0).await {
                    Ok(revision) => StoreReply::Written { key, revision: Revision(revision) },
                    Err(error) if error.kind() == UpdateErrorKind::WrongLastRevision => match self.entry(&key).await {
                        Ok(entry) => StoreReply::Conflict { key, entry },
                        Err(()) => StoreReply::Unavailable,
                    },
                    Err(error) => unavailable(&error),
                }
            }
            StoreRequest::Watch { .. } => StoreReply::Unavailable,
        }
    }

    fn bytes(&self, value: &K::Value) -> bytes::Bytes {
        let mut bytes = Vec::new();
        self.codec.write_value(value, &mut bytes);
        bytes.into()
    }

    async fn entry(&self, key: &Key) -> Result<Option<Entry<K::Value>>, ()> {
        let found = self.store.entry(names::key(key)).await.map_err(|error| {
            tracing::debug!(%error, "the store does not answer");
        })?;
        Ok(found.and_then(|found| self.read(&found)))
    }

    /// An entry that is there and can be read.
    fn read(&self, found: &kv::Entry) -> Option<Entry<K::Value>> {
        if found.operation != Operation::Put {
            return None;
        }
        let (key, value) = (names::entry(&found.key), self.codec.read_value(&found.value));
        if key.is_none() || value.is_none() {
            tracing::warn!(key = found.key, "an entry that cannot be read");
        }
        Some(Entry { key: key?, revision: Revision(found.revision), value: value? })
    }

    /// Reports all entries under `prefix`, and from then on every write to one, until the agent is gone. After an
    /// interruption everything is reported again: who watches knows revisions.
    pub(super) async fn watch<M>(&self, prefix: &Key, ticket: Ticket, mailbox: &Mailbox<M>)
    where
        M: StateMachine<Content = K::Content, Value = K::Value>,
    {
        let tell = |reply| mailbox.deliver(Event::Store { ticket, reply });
        let mut caught_up = false;
        follow(&self.store, &names::below(prefix), |news| {
            match news {
                News::Entry(found) => {
                    if let Some(entry) = self.read(&found).filter(|entry| entry.key.starts_with(prefix)) {
                        tell(StoreReply::Changed(entry));
                    }
                }
                News::CaughtUp if !caught_up => {
                    caught_up = true;
                    tell(StoreReply::CaughtUp);
                }
                News::CaughtUp | News::Begin | News::Nothing => {}
            }
            !mailbox.is_closed()
        })
        .await;
    }

    /// Lets all entries under a prefix go.
    pub(super) async fn forget(&self, prefix: &Key) {
        let subject = format!("{}{}", self.store.prefix, names::below(prefix));
        if let Err(error) = self.store.stream.purge().filter(subject).await {
            tracing::warn!(%error, "entries were not let go");
        }
    }
}

/// What one is told who follows entries.
pub(super) enum News {
    /// From now on all is told from the beginning.
    Begin,
    /// An entry as it is, or is from now on.
    Entry(kv::Entry),
    /// All entries that there are have been told.
    CaughtUp,
    /// Nothing has happened for a while.
    Nothing,
}

/// Tells of all entries below a name, and from then on of every change, until `tell` says that it is enough. After an
/// interruption all are told again.
pub(super) async fn follow(store: &kv::Store, below: &str, mut tell: impl FnMut(News) -> bool) {
    while tell(News::Nothing) {
        if let Ok(mut watch) = store.watch_with_history(below).await {
            if !tell(News::Begin) || is_empty(store, below).await && !tell(News::CaughtUp) {
                return;
            }
            loop {
                let goes_on = match tokio::time::timeout(LOOK_EVERY, watch.next()).await {
                    Err(_) => tell(News::Nothing),
                    Ok(Some(Ok(found))) => {
                        let is_last = found.seen_current;
                        tell(News::Entry(found)) && (!is_last || tell(News::CaughtUp))
                    }
                    Ok(_) => break,
                };
                if !goes_on {
                    return;
                }
            }
        }
        tokio::time::sleep(AGAIN_AFTER).await;
    }
}

/// Whether nothing has ever been written below a name: then no entry will say that it is the last.
async fn is_empty(store: &kv::Store, below: &str) -> bool {
    match store.stream.info_with_subjects(format!("{}{below}", store.prefix)).await {
        Ok(mut subjects) => subjects.next().await.is_none(),
        Err(_) => false,
    }
}

fn unavailable<V>(error: &impl std::fmt::Display) -> StoreReply<V> {
    tracing::debug!(%error, "the store did not take an entry");
    StoreReply::Unavailable
}
