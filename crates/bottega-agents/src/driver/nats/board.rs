//! The notices of a farm that everybody may read and change: its jobs, their leaders, who is present.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use async_nats::{
    Client,
    connection::State,
    jetstream::kv::{self, CreateErrorKind, UpdateErrorKind},
};
use tokio::{runtime::Handle, sync::oneshot};

use super::{
    blobs::BlobError,
    names,
    options::ANSWER_TIME,
    watch::{WatchNews, WrittenEntry, follow},
};
use crate::Key;

/// A notice as it was last heard of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// Its name.
    pub name: String,
    /// The number of its last writing, which no other writing has.
    pub revision: u64,
    /// What it says.
    pub text: Arc<[u8]>,
    /// For how long it has been so, while the server was there to tell of changes.
    pub unchanged: Duration,
}

/// Notices by name. What they say is known here without asking; its methods that write block: they are for threads that
/// may wait.
#[derive(Clone)]
pub struct NoticeBoard {
    client: Client,
    store: kv::Store,
    handle: Handle,
    seen: Arc<Mutex<KnownNotices>>,
}

/// What was heard of the notices.
struct KnownNotices {
    notices: BTreeMap<String, ReceivedNote>,
    /// How often the server was reached, and when it was the last time.
    connects: u64,
    connected: Instant,
}

struct ReceivedNote {
    revision: u64,
    text: Arc<[u8]>,
    at: Instant,
}

impl NoticeBoard {
    /// The board, when all that is on it has been read.
    pub(super) async fn open(client: Client, store: kv::Store, handle: Handle) -> Self {
        let seen = KnownNotices { notices: BTreeMap::new(), connects: 0, connected: now() };
        let board = Self { client, store, handle, seen: Arc::new(Mutex::new(seen)) };
        let (read, is_read) = oneshot::channel();
        let (follower, store, seen) = (board.client.clone(), board.store.clone(), Arc::downgrade(&board.seen));
        let mut read = Some(read);
        board.handle.spawn(async move {
            let tell = |news| {
                let Some(seen) = seen.upgrade() else { return false };
                match news {
                    WatchNews::Entry(entry) => lock(&seen).told(&entry),
                    WatchNews::CaughtUp => {
                        // Who opened it may have given up.
                        _ = read.take().map(|read| read.send(()));
                    }
                    WatchNews::Nothing => {}
                }
                true
            };
            follow(&follower, &store, ">", tell).await;
        });
        _ = tokio::time::timeout(ANSWER_TIME, is_read).await;
        board
    }

    /// Puts a notice up, in the place of one of the same name. Returns the number of the writing.
    ///
    /// # Errors
    /// The server does not take it.
    pub fn put(&self, name: &str, text: &[u8]) -> Result<u64, BlobError> {
        let put = self.handle.block_on(self.store.put(names::key(&Key::from(name.to_owned())), text.to_vec().into()));
        put.inspect(|revision| self.wrote(name, *revision, text)).map_err(|error| BlobError::passing(name, &error))
    }

    /// Puts a notice up only if its last writing has this number; 0: if there has never been one of this name. Returns the
    /// number of the writing; `None`: somebody else was first.
    ///
    /// # Errors
    /// The server does not say whether it took it.
    pub fn update(&self, name: &str, text: &[u8], revision: u64) -> Result<Option<u64>, BlobError> {
        match self.handle.block_on(self.store.update(
            names::key(&Key::from(name.to_owned())),
            text.to_vec().into(),
            revision,
        )) {
            Ok(revision) => {
                self.wrote(name, revision, text);
                Ok(Some(revision))
            }
            Err(error) if error.kind() == UpdateErrorKind::WrongLastRevision => Ok(None),
            Err(error) => Err(BlobError::passing(name, &error)),
        }
    }

    /// Puts a notice up only if there is none of this name, also where there was one that was taken down. Returns the number of
    /// the writing; `None`: there is one.
    ///
    /// # Errors
    /// The server does not say whether it took it.
    pub fn create(&self, name: &str, text: &[u8]) -> Result<Option<u64>, BlobError> {
        match self.handle.block_on(self.store.create(names::key(&Key::from(name.to_owned())), text.to_vec().into())) {
            Ok(revision) => {
                self.wrote(name, revision, text);
                Ok(Some(revision))
            }
            Err(error) if error.kind() == CreateErrorKind::AlreadyExists => Ok(None),
            Err(error) => Err(BlobError::passing(name, &error)),
        }
    }

    /// Takes a notice down.
    ///
    /// # Errors
    /// The server does not do it.
    pub fn remove(&self, name: &str) -> Result<(), BlobError> {
        self.handle
            .block_on(self.store.purge(names::key(&Key::from(name.to_owned()))))
            .map_err(|error| BlobError::passing(name, &error))?;
        lock(&self.seen).notices.remove(name);
        Ok(())
    }

    /// Who has written a notice reads it so from then on, without waiting until the server tells of it.
    fn wrote(&self, name: &str, revision: u64, text: &[u8]) {
        lock(&self.seen).hear(name, revision, text);
    }

    /// A notice as it was last heard of.
    pub fn get(&self, name: &str) -> Option<Notice> {
        self.refresh();
        let seen = lock(&self.seen);
        seen.notices.get_key_value(name).map(|(name, heard)| self.notice(&seen, name, heard))
    }

    /// All notices whose names begin so, by name.
    pub fn all(&self, prefix: &str) -> Vec<Notice> {
        self.refresh();
        let seen = lock(&self.seen);
        let from = seen.notices.range(prefix.to_owned()..).take_while(|(name, _)| name.starts_with(prefix));
        from.map(|(name, heard)| self.notice(&seen, name, heard)).collect()
    }

    /// While the server was away nobody could renew anything.
    fn refresh(&self) {
        let connects = self.client.statistics().connects.load(std::sync::atomic::Ordering::Relaxed);
        let is_connected = self.client.connection_state() == State::Connected;
        let mut seen = lock(&self.seen);
        if seen.connects != connects || !is_connected {
            (seen.connects, seen.connected) = (connects, now());
        }
    }

    fn notice(&self, seen: &KnownNotices, name: &str, heard: &ReceivedNote) -> Notice {
        let unchanged = heard.at.max(seen.connected).elapsed();
        Notice { name: name.to_owned(), revision: heard.revision, text: Arc::clone(&heard.text), unchanged }
    }
}

impl KnownNotices {
    fn told(&mut self, entry: &WrittenEntry) {
        let Some(name) = names::entry(&entry.key).map(|key| key.to_string()) else { return };
        if let Some(value) = &entry.value {
            self.hear(&name, entry.revision, value);
        } else if self.notices.get(&name).is_some_and(|heard| heard.revision < entry.revision) {
            self.notices.remove(&name);
        }
    }

    fn hear(&mut self, name: &str, revision: u64, text: &[u8]) {
        if self.notices.get(name).is_none_or(|heard| heard.revision < revision) {
            let heard = ReceivedNote { revision, text: text.into(), at: now() };
            self.notices.insert(name.to_owned(), heard);
        }
    }
}

fn lock(seen: &Mutex<KnownNotices>) -> MutexGuard<'_, KnownNotices> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
}

#[allow(clippy::disallowed_methods, reason = "how long ago something was heard is no matter of protocols")]
fn now() -> Instant {
    Instant::now()
}
