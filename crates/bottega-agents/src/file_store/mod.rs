//! A store in a file, shared by several processes: each sees the others' writes, and any of them may crash.
//!
//! All entries are in memory; the file is a log of writes (`log.rs`). A writing process locks the file, reads the
//! others' new records, compares, appends its record, syncs it to disk, and unlocks. A log much longer than its live
//! entries is rewritten. An entry with empty text counts as removed.

mod error;
mod log;

use std::{collections::BTreeMap, path::Path};

pub use error::FileStoreError;
use log::{LogRecord, LogUpdate, RecordLog};

use crate::{Entry, Key, Revision, StoreReply, StoreRequest, Ticket, entry_store::EntryStore, store::AddressedStore};

/// Maximum length of a key, in bytes.
pub const KEY_BYTES_MAX: usize = 1 << 12;
/// Maximum length of a value, in bytes.
pub const VALUE_BYTES_MAX: usize = 1 << 20;
/// Maximum length of all keys and values together, in bytes.
pub const STORE_BYTES_MAX: usize = 1 << 28;
/// Minimum length of a log to compact, in bytes.
const COMPACT_BYTES_MIN: u64 = 1 << 20;
/// Ratio of a log's length to that of its live entries at which it is compacted.
const COMPACT_RATIO: u64 = 4;
/// Maximum length of a record without key and value, in bytes.
const RECORD_BYTES: u64 = 36;

/// A store in a file. `V` is a text type, `W` identifies clients. A write that fails or exceeds a limit of this module
/// is answered by [`StoreReply::Unavailable`].
#[derive(Debug)]
pub struct FileStore<V, W> {
    log: RecordLog,
    entries: BTreeMap<Key, Entry<V>>,
    /// Length of all keys and values, in bytes.
    live_bytes: usize,
    last: Revision,
    watches: Vec<(Key, Ticket, W)>,
}

impl<V, W> FileStore<V, W>
where
    V: Clone + From<String> + AsRef<str>,
    W: Clone + PartialEq,
{
    /// Opens the store in the file `path`, or creates it; beside it a file whose name has `.lock` appended serves as
    /// the lock. Blocks while another process holds the lock.
    ///
    /// # Errors
    /// The file or its lock is inaccessible, or the file is not a store of this version.
    pub fn open(path: &Path) -> Result<Self, FileStoreError> {
        let log = RecordLog::open(path)?;
        let mut store =
            Self { log, entries: BTreeMap::new(), live_bytes: 0, last: Revision::ABSENT, watches: Vec::new() };
        store.alone(&mut Vec::new(), |_| Ok(()))?;
        Ok(store)
    }

    /// Returns an entry, as last read by this process; `None`: there is none.
    pub fn get(&self, key: &Key) -> Option<&Entry<V>> {
        self.entries.get(key)
    }

    /// Returns the length of the log that this process has read, in bytes.
    pub fn log_bytes(&self) -> u64 {
        self.log.bytes()
    }

    fn take_over(&mut self, update: LogUpdate, replies: &mut Vec<AddressedStore<V, W>>) {
        let before = if update.is_rewritten { std::mem::take(&mut self.entries) } else { BTreeMap::new() };
        if update.is_rewritten {
            self.live_bytes = 0;
        }
        let known = self.last;
        for LogRecord { revision, key, value } in update.records {
            let revision = Revision(revision);
            self.last = self.last.max(revision);
            if !key.is_empty() {
                let entry = Entry { key: key.into(), revision, value: V::from(value) };
                if revision > known {
                    self.tell(&entry, replies);
                }
                self.keep(entry);
            }
        }
        // A rewritten log does not contain entries that were removed
        for (key, entry) in before {
            if !self.entries.contains_key(&key) && entry.revision <= known {
                let gone = Entry { key, revision: self.last, value: V::from(String::new()) };
                self.tell(&gone, replies);
            }
        }
    }

    fn keep(&mut self, entry: Entry<V>) {
        let bytes = |entry: &Entry<V>| entry.key.to_string().len() + entry.value.as_ref().len();
        let new_bytes = bytes(&entry);
        let before = if entry.value.as_ref().is_empty() {
            self.entries.remove(&entry.key)
        } else {
            self.live_bytes += new_bytes;
            self.entries.insert(entry.key.clone(), entry)
        };
        self.live_bytes -= before.as_ref().map_or(0, bytes);
    }

    fn tell(&self, entry: &Entry<V>, replies: &mut Vec<AddressedStore<V, W>>) {
        for (prefix, ticket, who) in &self.watches {
            if entry.key.starts_with(prefix) {
                let reply = StoreReply::Changed(entry.clone());
                replies.push(AddressedStore { to: who.clone(), ticket: *ticket, reply });
            }
        }
    }

    /// Runs `change` under the file's lock, after reading the others' new records.
    fn alone<T>(
        &mut self,
        replies: &mut Vec<AddressedStore<V, W>>,
        change: impl FnOnce(&mut Self) -> Result<T, FileStoreError>,
    ) -> Result<T, FileStoreError> {
        self.log.lock()?;
        let outcome = self.log.read_new(true).and_then(|update| {
            self.take_over(update, replies);
            change(self)
        });
        self.log.unlock()?;
        outcome
    }

    /// Writes an entry if it has the expected revision, if one is given. Requires the lock.
    fn write(&mut self, key: &Key, value: V, expected: Option<Revision>) -> Result<StoreWrite<V>, FileStoreError> {
        let current = self.entries.get(key);
        if expected.is_some_and(|expected| current.map_or(Revision::ABSENT, |entry| entry.revision) != expected) {
            return Ok(StoreWrite::Conflict(current.cloned()));
        }
        let (key_bytes, value_bytes) = (key.to_string().len(), value.as_ref().len());
        let full = self.live_bytes + key_bytes + value_bytes > STORE_BYTES_MAX;
        if key_bytes == 0 || key_bytes > KEY_BYTES_MAX || value_bytes > VALUE_BYTES_MAX || full {
            return Err(FileStoreError::TooLarge);
        }
        let revision = Revision(self.last.0 + 1);
        let record = LogRecord { revision: revision.0, key: key.to_string(), value: value.as_ref().to_owned() };
        self.log.append(&record)?;
        self.last = revision;
        let entry = Entry { key: key.clone(), revision, value };
        self.keep(entry.clone());
        self.compact()?;
        Ok(StoreWrite::Done(entry))
    }

    /// Rewrites the log if it is too long. Requires the lock.
    fn compact(&mut self) -> Result<(), FileStoreError> {
        let live = self.live_bytes as u64 + self.entries.len() as u64 * RECORD_BYTES;
        if self.log.bytes() < COMPACT_BYTES_MIN.max(live * COMPACT_RATIO) {
            return Ok(());
        }
        let record = |entry: &Entry<V>| LogRecord {
            revision: entry.revision.0,
            key: entry.key.to_string(),
            value: entry.value.as_ref().to_owned(),
        };
        let mut records: Vec<LogRecord> = self.entries.values().map(record).collect();
        records.push(LogRecord { revision: self.last.0, key: String::new(), value: String::new() });
        self.log.replace(records.iter())
    }
}

enum StoreWrite<V> {
    Done(Entry<V>),
    Conflict(Option<Entry<V>>),
}

impl<V, W> EntryStore<V, W> for FileStore<V, W>
where
    V: Clone + From<String> + AsRef<str>,
    W: Clone + PartialEq,
{
    fn handle(&mut self, from: W, ticket: Ticket, request: StoreRequest<V>, replies: &mut Vec<AddressedStore<V, W>>) {
        let (key, value, expected) = match request {
            StoreRequest::Put { key, value } => (key, value, None),
            StoreRequest::CompareAndSet { key, expected_revision, value } => (key, value, Some(expected_revision)),
            // Reading needs no lock: a write in progress is seen a little later
            StoreRequest::Get { key } => {
                self.poll(replies);
                let entry = self.entries.get(&key).cloned();
                replies.push(AddressedStore { to: from, ticket, reply: StoreReply::Got { key, entry } });
                return;
            }
            StoreRequest::Watch { prefix } => {
                self.poll(replies);
                let say = |reply| AddressedStore { to: from.clone(), ticket, reply };
                let held = self.entries.iter().filter(|(key, _)| key.starts_with(&prefix));
                replies.extend(held.map(|(_, entry)| say(StoreReply::Changed(entry.clone()))));
                replies.push(say(StoreReply::CaughtUp));
                self.watches.retain(|(_, other, who)| *other != ticket || *who != from);
                self.watches.push((prefix, ticket, from));
                return;
            }
        };
        match self.alone(replies, |store| store.write(&key, value, expected)) {
            Ok(StoreWrite::Done(entry)) => {
                let reply = StoreReply::Written { key, revision: entry.revision };
                replies.push(AddressedStore { to: from, ticket, reply });
                self.tell(&entry, replies);
            }
            Ok(StoreWrite::Conflict(entry)) => {
                replies.push(AddressedStore { to: from, ticket, reply: StoreReply::Conflict { key, entry } });
            }
            Err(_) => replies.push(AddressedStore { to: from, ticket, reply: StoreReply::Unavailable }),
        }
    }

    fn forget(&mut self, who: &W) {
        self.watches.retain(|(_, _, other)| other != who);
    }

    fn poll(&mut self, replies: &mut Vec<AddressedStore<V, W>>) {
        // A failed read may succeed later; writers get the error
        if let Ok(update) = self.log.read_new(false) {
            self.take_over(update, replies);
        }
    }
}
