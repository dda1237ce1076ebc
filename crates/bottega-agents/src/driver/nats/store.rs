//! The store as a key-value bucket.

use std::{sync::Arc, time::Duration};

use async_nats::{
    Client,
    jetstream::{
        Context,
        kv::{self, Operation, UpdateErrorKind},
        stream::{self, DiscardPolicy, StorageType},
    },
};

use super::{
    error::NatsError,
    frame, names,
    watch::{WatchUpdate, WrittenEntry, follow},
};
use crate::{
    Entry, Event, Key, Revision, StateMachine, StoreReply, StoreRequest, Ticket, codec::Codec, driver::Mailbox,
};

/// Maximum size of an entry's value, in bytes.
const VALUE_BYTES_MAX: i32 = 1 << 20;
/// Delay after a refusal by the server.
const AGAIN_AFTER: Duration = Duration::from_millis(250);

/// Opens a bucket of a farm, or creates it. Compares the server's description with the request: older servers silently
/// ignore what they do not support.
///
/// A bucket is a stream of this shape, and is created as a stream, because the library's own function cannot read the
/// account information of servers before 2.10.
pub(super) async fn open(
    context: &Context,
    bucket: String,
    what: &'static str,
    may_make: bool,
) -> Result<kv::Store, NatsError> {
    let keep = |reason: String| NatsError::Keep { what, reason, is_lasting: false };
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
        Some((other, _)) => Err(NatsError::Keep {
            what,
            reason: format!("the {other} of its stream KV_{bucket} differs from the requested one"),
            is_lasting: true,
        }),
    }
}

/// A report to a follower of the store, see [`NatsUplink::follow_entries`](super::NatsUplink::follow_entries).
#[derive(Clone, Debug, PartialEq)]
pub enum EntryUpdate<V> {
    /// The current or new state of an entry.
    Entry(Entry<V>),
    /// All existing entries have been reported; said once.
    CaughtUp,
    /// Nothing to report, for example because an entry was removed, or none was written for some time.
    Nothing,
}

/// The bucket with its codec.
pub(super) struct Bucket<K> {
    client: Client,
    store: kv::Store,
    codec: Arc<K>,
}

impl<K> Clone for Bucket<K> {
    fn clone(&self) -> Self {
        Self { client: self.client.clone(), store: self.store.clone(), codec: Arc::clone(&self.codec) }
    }
}

impl<K: Codec> Bucket<K> {
    pub(super) fn new(client: Client, store: kv::Store, codec: Arc<K>) -> Self {
        Self { client, store, codec }
    }

    /// Executes a request other than a watch. Waits after an immediate refusal by the server.
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
        frame::write_entry(&*self.codec, value).into()
    }

    async fn entry(&self, key: &Key) -> Result<Option<Entry<K::Value>>, ()> {
        let found = self.store.entry(names::key(key)).await.map_err(|error| {
            tracing::debug!(%error, "the store does not answer");
        })?;
        let found = found.filter(|found| found.operation == Operation::Put);
        Ok(found.and_then(|found| self.read(&found.key, found.revision, &found.value)))
    }

    /// Decodes an entry; `None`: it is invalid.
    fn read(&self, key: &str, revision: u64, value: &[u8]) -> Option<Entry<K::Value>> {
        let Some(read_key) = names::entry(key) else {
            tracing::warn!(key, "cannot read the name of an entry");
            return None;
        };
        match frame::read_entry(&*self.codec, value) {
            Ok(value) => Some(Entry { key: read_key, revision: Revision(revision), value }),
            Err(error) => {
                tracing::warn!(key, %error, "cannot read an entry");
                None
            }
        }
    }

    /// Reports all entries under `prefix`, and then every write to one, until the agent is gone. After an interruption
    /// everything is reported again: watchers compare revisions.
    pub(super) async fn watch<M>(&self, prefix: &Key, ticket: Ticket, mailbox: &Mailbox<M>)
    where
        M: StateMachine<Content = K::Content, Value = K::Value>,
    {
        let tell = |reply| mailbox.deliver(Event::Store { ticket, reply });
        self.follow(prefix, |update| {
            match update {
                EntryUpdate::Entry(entry) => tell(StoreReply::Changed(entry)),
                EntryUpdate::CaughtUp => tell(StoreReply::CaughtUp),
                EntryUpdate::Nothing => {}
            }
            !mailbox.is_closed()
        })
        .await;
    }

    /// Reports all entries under `prefix`, and then every write to one, until `tell` returns false. After an
    /// interruption all are reported again.
    pub(super) async fn follow(&self, prefix: &Key, mut tell: impl FnMut(EntryUpdate<K::Value>) -> bool) {
        let mut caught_up = false;
        follow(&self.client, &self.store, &names::below(prefix), |update| match update {
            WatchUpdate::Entry(WrittenEntry { key, revision, value: Some(value) }) => {
                let entry = self.read(&key, revision, &value).filter(|it| it.key.starts_with(prefix));
                tell(entry.map_or(EntryUpdate::Nothing, EntryUpdate::Entry))
            }
            WatchUpdate::CaughtUp if !std::mem::replace(&mut caught_up, true) => tell(EntryUpdate::CaughtUp),
            WatchUpdate::Entry(_) | WatchUpdate::Begins | WatchUpdate::CaughtUp | WatchUpdate::Nothing => {
                tell(EntryUpdate::Nothing)
            }
        })
        .await;
    }

    /// Deletes all entries under a prefix.
    pub(super) async fn forget(&self, prefix: &Key) {
        let subject = format!("{}{}", self.store.prefix, names::below(prefix));
        if let Err(error) = self.store.stream.purge().filter(subject).await {
            tracing::warn!(%error, "cannot delete entries");
        }
    }
}

fn unavailable<V>(error: &impl std::fmt::Display) -> StoreReply<V> {
    tracing::debug!(%error, "the store did not accept an entry");
    StoreReply::Unavailable
}
