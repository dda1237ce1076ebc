//! A store in a file, which several processes may share: what one writes the others see, and any of them may die.
//!
//! All is in memory; the file is a log of writes (`log.rs`). A process that writes takes the lock of the file, reads
//! what others have written meanwhile, compares, adds its record, has the disk keep it, and lets go. A log much longer
//! than what it tells is written anew. An entry whose value is empty text is gone.

mod error;
mod log;

use std::{collections::BTreeMap, path::Path};

pub use error::FileStoreError;
use log::{LogNews, LogRecord, RecordLog};

use crate::{Entry, Key, Revision, StoreReply, StoreRequest, Ticket, entry_store::EntryStore, store::AddressedStore};

/// The longest name of an entry, in bytes.
pub const KEY_BYTES_MAX: usize = 1 << 12;
/// The longest value, in bytes.
pub const VALUE_BYTES_MAX: usize = 1 << 20;
/// The most of all names and values together, in bytes.
pub const STORE_BYTES_MAX: usize = 1 << 28;
/// A log shorter than this is left as it is, in bytes.
const COMPACT_BYTES_MIN: u64 = 1 << 20;
/// How much longer than what it tells a log may be.
const COMPACT_RATIO: u64 = 4;
/// What a record takes besides name and value, at most, in bytes.
const RECORD_BYTES: u64 = 36;

/// A store in a file. `V` is text of some kind, `W` who asks.
#[derive(Debug)]
pub struct FileStore<V, W> {
    log: RecordLog,
    entries: BTreeMap<Key, Entry<V>>,
    /// Of all names and values, in bytes.
    live_bytes: usize,
    last: Revision,
    watches: Vec<(Key, Ticket, W)>,
}

impl<V, W> FileStore<V, W>
where
    V: Clone + From<String> + AsRef<str>,
    W: Clone + PartialEq,
{
    /// Opens a store, or begins one.
    ///
    /// # Errors
    /// The file cannot be used, or is something else.
    pub fn open(path: &Path) -> Result<Self, FileStoreError> {
        let log = RecordLog::open(path)?;
        let mut store =
            Self { log, entries: BTreeMap::new(), live_bytes: 0, last: Revision::ABSENT, watches: Vec::new() };
        store.alone(&mut Vec::new(), |_| Ok(()))?;
        Ok(store)
    }

    /// Reads an entry, as far as this process knows.
    pub fn get(&self, key: &Key) -> Option<&Entry<V>> {
        self.entries.get(key)
    }

    /// How long the log is, in bytes.
    pub fn log_bytes(&self) -> u64 {
        self.log.bytes()
    }

    fn take_over(&mut self, news: LogNews, replies: &mut Vec<AddressedStore<V, W>>) {
        let before = if news.anew { std::mem::take(&mut self.entries) } else { BTreeMap::new() };
        if news.anew {
            self.live_bytes = 0;
        }
        let known = self.last;
        for LogRecord { revision, key, value } in news.records {
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
        // Of what went while the log was written anew nothing stands there.
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

    /// Runs `change` while no other process writes, after all that others have written was taken over.
    fn alone<T>(
        &mut self,
        replies: &mut Vec<AddressedStore<V, W>>,
        change: impl FnOnce(&mut Self) -> Result<T, FileStoreError>,
    ) -> Result<T, FileStoreError> {
        self.log.lock()?;
        let outcome = self.log.news(true).and_then(|news| {
            self.take_over(news, replies);
            change(self)
        });
        self.log.unlock()?;
        outcome
    }

    /// Writes an entry, if it has the revision that is expected, if one is. While no other process writes.
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

    /// Writes the log anew when it has become too long. While no other process writes.
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
            // Reading needs no lock: what is being written just now comes a little later.
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
        // What cannot be read now may be later; who writes is told.
        if let Ok(news) = self.log.news(false) {
            self.take_over(news, replies);
        }
    }
}
