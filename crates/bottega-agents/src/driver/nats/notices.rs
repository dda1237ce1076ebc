//! Notices of a farm, which all members may read and change: jobs, their leaders, members present.

use std::{
    collections::BTreeMap,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use async_nats::{
    Client,
    connection::State,
    jetstream::kv::{self, CreateErrorKind, Operation, UpdateErrorKind},
};
use tokio::{runtime::Handle, sync::oneshot};

use super::{
    blobs::BlobError,
    names,
    options::ANSWER_TIME,
    watch::{WatchUpdate, WrittenEntry, follow},
};
use crate::Key;

/// The last known state of a notice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// The name of the notice.
    pub name: String,
    /// The number of the notice's last write, unique among the notices of the farm.
    pub revision: u64,
    /// The bytes of the notice, as written.
    pub text: Arc<[u8]>,
    /// Time since this process received its last change, or since it last reconnected to the server if that was later.
    pub unchanged: Duration,
}

/// The notices of a farm by name. Reading uses a local copy. Methods that write block, and so do [`Self::was_ever`] and
/// [`Self::wait`]: call them from threads that may wait, not from asynchronous code.
#[derive(Clone)]
pub struct NatsNotices {
    client: Client,
    store: kv::Store,
    handle: Handle,
    seen: Arc<Mutex<KnownNotices>>,
    /// Notified after each change of `seen`.
    changed: Arc<Condvar>,
}

/// The local copy of the notices.
struct KnownNotices {
    notices: BTreeMap<String, ReceivedNote>,
    /// Number of listings begun by the server. A listing overrides the local copy: a server that has lost its last
    /// writes reuses their numbers.
    listing: u64,
    /// Number of changes per folder: the part before the first `/`.
    changes: BTreeMap<String, u64>,
    /// Number of all changes.
    all_changes: u64,
    /// Number of connections to the server, and the time of the last one.
    connects: u64,
    connected: Instant,
}

struct ReceivedNote {
    revision: u64,
    text: Arc<[u8]>,
    at: Instant,
    /// The last listing that contained it.
    listing: u64,
}

impl NatsNotices {
    /// Opens the notices. Returns when all are read, or after [`ANSWER_TIME`] at the latest.
    pub(super) async fn open(client: Client, store: kv::Store, handle: Handle) -> Self {
        let seen = Arc::new(Mutex::new(KnownNotices::new()));
        let board = Self { client, store, handle, seen, changed: Arc::default() };
        let (read, is_read) = oneshot::channel();
        let (follower, store, seen) = (board.client.clone(), board.store.clone(), Arc::downgrade(&board.seen));
        let changed = Arc::clone(&board.changed);
        let mut read = Some(read);
        board.handle.spawn(async move {
            let tell = |update| {
                let Some(seen) = seen.upgrade() else { return false };
                match update {
                    WatchUpdate::Begins => lock(&seen).listing += 1,
                    WatchUpdate::Entry(entry) => lock(&seen).record(&entry),
                    WatchUpdate::CaughtUp => {
                        lock(&seen).forget_unlisted();
                        // The opener may have given up
                        _ = read.take().map(|read| read.send(()));
                    }
                    WatchUpdate::Nothing => {}
                }
                changed.notify_all();
                true
            };
            follow(&follower, &store, ">", tell).await;
        });
        _ = tokio::time::timeout(ANSWER_TIME, is_read).await;
        board
    }

    /// Writes a notice unconditionally. Returns the number of the write.
    ///
    /// # Errors
    /// The server does not confirm it: whether it accepted the notice is unknown.
    pub fn put(&self, name: &str, text: &[u8]) -> Result<u64, BlobError> {
        let put = self.handle.block_on(self.store.put(names::key(&Key::from(name.to_owned())), text.to_vec().into()));
        put.inspect(|revision| self.wrote(name, *revision, text)).map_err(|error| BlobError::passing(name, &error))
    }

    /// Writes a notice if it is unchanged since it was read. Returns the number of the write; `None`: it has changed,
    /// and the local copy is updated.
    ///
    /// - `revision`: the number of its last write; 0: it does not exist, or was removed.
    ///
    /// # Errors
    /// The server does not confirm it: whether it accepted the notice is unknown; or the notice has changed, and cannot
    /// be read again.
    pub fn update(&self, name: &str, text: &[u8], revision: u64) -> Result<Option<u64>, BlobError> {
        let (key, bytes) = (names::key(&Key::from(name.to_owned())), text.to_vec().into());
        let written = self.handle.block_on(async {
            if revision == 0 {
                // A removed name also has a last write: that of its removal
                return match self.store.create(key, bytes).await {
                    Err(error) if error.kind() == CreateErrorKind::AlreadyExists => Ok(None),
                    written => written.map(Some).map_err(|error| BlobError::passing(name, &error)),
                };
            }
            match self.store.update(key, bytes, revision).await {
                Err(error) if error.kind() == UpdateErrorKind::WrongLastRevision => Ok(None),
                written => written.map(Some).map_err(|error| BlobError::passing(name, &error)),
            }
        })?;
        match written {
            Some(revision) => self.wrote(name, revision, text),
            None => self.read_again(name)?,
        }
        Ok(written)
    }

    /// Writes the first notice of a name. Returns the number of the write; `None`: the name exists, or did before.
    ///
    /// # Errors
    /// The server does not confirm it: whether it accepted the notice is unknown.
    pub fn put_first(&self, name: &str, text: &[u8]) -> Result<Option<u64>, BlobError> {
        let written = self.store.update(names::key(&Key::from(name.to_owned())), text.to_vec().into(), 0);
        match self.handle.block_on(written) {
            Ok(revision) => {
                self.wrote(name, revision, text);
                Ok(Some(revision))
            }
            Err(error) if error.kind() == UpdateErrorKind::WrongLastRevision => Ok(None),
            Err(error) => Err(BlobError::passing(name, &error)),
        }
    }

    /// Returns true if a notice of this name exists, or was removed; asks the server.
    ///
    /// # Errors
    /// The server does not answer.
    pub fn was_ever(&self, name: &str) -> Result<bool, BlobError> {
        let entry = self.handle.block_on(self.store.entry(names::key(&Key::from(name.to_owned()))));
        entry.map(|entry| entry.is_some()).map_err(|error| BlobError::passing(name, &error))
    }

    /// Reads a notice from the server whose local copy is outdated: a later write was not reported yet, or the server
    /// has lost the last one.
    fn read_again(&self, name: &str) -> Result<(), BlobError> {
        let before = lock(&self.seen).notices.get(name).map(|heard| heard.revision);
        let entry = self.handle.block_on(self.store.entry(names::key(&Key::from(name.to_owned()))));
        let entry = entry.map_err(|error| BlobError::passing(name, &error))?;
        let mut seen = lock(&self.seen);
        // A newer write may have been reported meanwhile
        if seen.notices.get(name).map(|heard| heard.revision) == before {
            match entry.filter(|entry| entry.operation == Operation::Put) {
                Some(entry) => seen.set(name, entry.revision, &entry.value),
                None => seen.forget(name),
            }
        }
        Ok(())
    }

    /// Removes a notice unconditionally, if it exists.
    ///
    /// # Errors
    /// The server does not confirm it: whether it removed the notice is unknown.
    pub fn remove(&self, name: &str) -> Result<(), BlobError> {
        self.handle
            .block_on(self.store.purge(names::key(&Key::from(name.to_owned()))))
            .map_err(|error| BlobError::passing(name, &error))?;
        lock(&self.seen).forget(name);
        Ok(())
    }

    /// Updates the local copy after a write, before the server reports it.
    fn wrote(&self, name: &str, revision: u64, text: &[u8]) {
        lock(&self.seen).hear(name, revision, text);
        self.changed.notify_all();
    }

    /// Waits until the number of all changes differs from `seen`. Returns the number.
    ///
    /// - `seen`: the number that an earlier call returned; 0 at first.
    /// - `limit`: the maximum time to wait.
    pub fn wait(&self, seen: u64, limit: Duration) -> u64 {
        let known = lock(&self.seen);
        let waited = self.changed.wait_timeout_while(known, limit, |known| known.all_changes == seen);
        waited.unwrap_or_else(PoisonError::into_inner).0.all_changes
    }

    /// Returns the last known state of a notice; `None`: none of this name is known.
    pub fn get(&self, name: &str) -> Option<Notice> {
        self.refresh();
        let seen = lock(&self.seen);
        seen.notices.get_key_value(name).map(|(name, heard)| self.notice(&seen, name, heard))
    }

    /// Returns the last known states of all notices whose names start with `prefix`, by name.
    pub fn all(&self, prefix: &str) -> Vec<Notice> {
        self.refresh();
        let seen = lock(&self.seen);
        let from = seen.notices.range(prefix.to_owned()..).take_while(|(name, _)| name.starts_with(prefix));
        from.map(|(name, heard)| self.notice(&seen, name, heard)).collect()
    }

    /// Returns a number that changes with every reported change in a folder: the part of names before the first `/`.
    pub(super) fn changes(&self, folder: &str) -> u64 {
        lock(&self.seen).changes.get(folder).copied().unwrap_or_default()
    }

    /// Restarts the ages of all notices after a reconnection: nothing could be renewed meanwhile.
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
    fn new() -> Self {
        let (notices, changes) = (BTreeMap::new(), BTreeMap::new());
        Self { notices, listing: 0, changes, all_changes: 0, connects: 0, connected: now() }
    }

    fn record(&mut self, entry: &WrittenEntry) {
        let Some(name) = names::entry(&entry.key).map(|key| key.to_string()) else { return };
        let known = self.notices.get(&name).map(|heard| (heard.listing, heard.revision));
        if let Some(value) = &entry.value {
            self.hear(&name, entry.revision, value);
        } else if known.is_some_and(|known| known < (self.listing, entry.revision)) {
            self.forget(&name);
        }
    }

    fn forget(&mut self, name: &str) {
        if self.notices.remove(name).is_some() {
            self.count(name);
        }
    }

    /// Removes all notices that the finished listing did not contain.
    fn forget_unlisted(&mut self) {
        let listing = self.listing;
        let unlisted = self.notices.iter().filter(|(_, heard)| heard.listing < listing).map(|(name, _)| name.clone());
        for name in unlisted.collect::<Vec<_>>() {
            self.forget(&name);
        }
    }

    fn count(&mut self, name: &str) {
        self.all_changes += 1;
        let folder = name.split('/').next().unwrap_or_default();
        match self.changes.get_mut(folder) {
            Some(count) => *count += 1,
            None => _ = self.changes.insert(folder.to_owned(), 1),
        }
    }

    fn hear(&mut self, name: &str, revision: u64, text: &[u8]) {
        match self.notices.get_mut(name) {
            // Unchanged since the last listing
            Some(heard) if heard.revision == revision => heard.listing = self.listing,
            Some(heard) if heard.listing == self.listing && heard.revision > revision => {}
            _ => self.set(name, revision, text),
        }
    }

    fn set(&mut self, name: &str, revision: u64, text: &[u8]) {
        let heard = ReceivedNote { revision, text: text.into(), at: now(), listing: self.listing };
        self.notices.insert(name.to_owned(), heard);
        self.count(name);
    }
}

fn lock(seen: &Mutex<KnownNotices>) -> MutexGuard<'_, KnownNotices> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
}

#[allow(clippy::disallowed_methods, reason = "the age of a notice does not affect protocols")]
fn now() -> Instant {
    Instant::now()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, revision: u64, value: Option<&'static str>) -> WrittenEntry {
        let value = value.map(|text| text.as_bytes().into());
        WrittenEntry { key: names::key(&Key::from(name.to_owned())), revision, value }
    }

    fn texts(known: &KnownNotices) -> Vec<(&str, u64)> {
        known.notices.iter().map(|(name, heard)| (&**name, heard.revision)).collect()
    }

    #[test]
    fn entries_never_go_back_in_time_except_if_the_server_lists_all_again() {
        let mut known = KnownNotices::new();
        known.listing += 1;
        for written in [entry("a", 3, Some("x")), entry("a", 2, Some("old")), entry("b", 9, Some("y"))] {
            known.record(&written);
        }
        known.record(&entry("b", 8, None));
        assert_eq!(texts(&known), [("a", 3), ("b", 9)]);
        // The server has lost its last writings: `b` had none, and `a` an earlier one.
        known.listing += 1;
        known.record(&entry("a", 1, Some("first")));
        known.forget_unlisted();
        assert_eq!(texts(&known), [("a", 1)]);
        known.record(&entry("a", 2, None));
        assert_eq!(texts(&known), []);
    }

    #[test]
    fn a_notice_that_is_listed_again_as_it_was_stays_as_old_as_it_is() {
        let mut known = KnownNotices::new();
        known.record(&entry("a", 3, Some("x")));
        let (at, changes) = (known.notices["a"].at, known.changes.clone());
        known.listing += 1;
        known.record(&entry("a", 3, Some("x")));
        known.forget_unlisted();
        assert_eq!((known.notices["a"].at, known.changes), (at, changes));
    }
}
