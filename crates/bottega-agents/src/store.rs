//! The shared key-value store: every entry has a revision, on which writes can be conditional.
//!
//! The revision is also the *fencing token* of whatever the entry awards: it grows with every write to the store, so a
//! later award always has the greater token.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use rustc_hash::FxHashMap;

pub use crate::key::Key;
use crate::{key::EntryName, number_map::NumberMap};

/// The number of a write to the store. Increases over all keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Revision(pub u64);

impl Revision {
    /// The revision of an absent entry: a write that expects it creates the entry.
    pub const ABSENT: Self = Self(0);
}

/// The number that links a reply to its request. Chosen by the client; unique among its open requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Ticket(pub u64);

/// An entry of a store: a key, its latest value and the revision of the write.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry<V> {
    /// The key under which the value is stored.
    pub key: Key,
    /// The revision of the entry's last write.
    pub revision: Revision,
    /// The latest value.
    pub value: V,
}

/// A request to the store. The answer to each may also be [`StoreReply::Unavailable`], and on a network it may be lost.
#[derive(Clone, Debug, PartialEq)]
pub enum StoreRequest<V> {
    /// Reads an entry; answered by [`StoreReply::Got`].
    Get {
        /// The key of the entry.
        key: Key,
    },
    /// Writes an entry unconditionally; answered by [`StoreReply::Written`].
    Put {
        /// The key of the entry.
        key: Key,
        /// The new value.
        value: V,
    },
    /// Writes an entry if it still has a given revision; answered by [`StoreReply::Written`] or
    /// [`StoreReply::Conflict`].
    CompareAndSet {
        /// The key of the entry.
        key: Key,
        /// The revision that the entry must have: [`Revision::ABSENT`] if it must not exist.
        expected_revision: Revision,
        /// The new value.
        value: V,
    },
    /// Reports all entries whose key starts with a prefix by [`StoreReply::Changed`], then [`StoreReply::CaughtUp`],
    /// then every write to one of them. Replaces an earlier watch of the same client with the same ticket.
    Watch {
        /// The prefix of the keys.
        prefix: Key,
    },
}

impl<V> StoreRequest<V> {
    /// Returns the key, or the prefix of a watch.
    pub fn key(&self) -> &Key {
        match self {
            Self::Get { key } | Self::Put { key, .. } | Self::CompareAndSet { key, .. } => key,
            Self::Watch { prefix } => prefix,
        }
    }

    /// Returns the value to write; `None`: the request does not write.
    pub fn value(&self) -> Option<&V> {
        match self {
            Self::Put { value, .. } | Self::CompareAndSet { value, .. } => Some(value),
            Self::Get { .. } | Self::Watch { .. } => None,
        }
    }

    /// Returns the request with its value, if it has one, replaced by `change` of it.
    pub fn map<T>(self, change: impl FnOnce(V) -> T) -> StoreRequest<T> {
        match self {
            Self::Get { key } => StoreRequest::Get { key },
            Self::Put { key, value } => StoreRequest::Put { key, value: change(value) },
            Self::CompareAndSet { key, expected_revision, value } => {
                StoreRequest::CompareAndSet { key, expected_revision, value: change(value) }
            }
            Self::Watch { prefix } => StoreRequest::Watch { prefix },
        }
    }
}

/// A reply of the store to a request, or a report of a watch.
#[derive(Clone, Debug, PartialEq)]
pub enum StoreReply<V> {
    /// The requested entry, if it exists.
    Got {
        /// The key of the entry.
        key: Key,
        /// The entry, if it exists.
        entry: Option<Entry<V>>,
    },
    /// The entry was written.
    Written {
        /// The key of the entry.
        key: Key,
        /// The new revision: the fencing token.
        revision: Revision,
    },
    /// The entry was not written: it has another revision than expected.
    Conflict {
        /// The key of the entry.
        key: Key,
        /// The current entry; `None`: it does not exist.
        entry: Option<Entry<V>>,
    },
    /// The current or new state of a watched entry.
    Changed(Entry<V>),
    /// A watch has reported all entries that existed at its start.
    CaughtUp,
    /// The store did not answer. It is unknown whether the write took place.
    Unavailable,
}

impl<V> StoreReply<V> {
    /// Returns the reply with its value, if it has one, replaced by `change` of it.
    pub fn map<T>(self, change: impl FnOnce(V) -> T) -> StoreReply<T> {
        let entry = |Entry { key, revision, value }: Entry<V>| Entry { key, revision, value: change(value) };
        match self {
            Self::Got { key, entry: found } => StoreReply::Got { key, entry: found.map(entry) },
            Self::Written { key, revision } => StoreReply::Written { key, revision },
            Self::Conflict { key, entry: found } => StoreReply::Conflict { key, entry: found.map(entry) },
            Self::Changed(changed) => StoreReply::Changed(entry(changed)),
            Self::CaughtUp => StoreReply::CaughtUp,
            Self::Unavailable => StoreReply::Unavailable,
        }
    }
}

/// A store in memory: used by drivers within one process, and the reference for all other stores. `V` is the type of
/// the values; `W` identifies a client.
#[derive(Clone, Debug)]
pub struct MemoryStore<V, W = ()> {
    folders: BTreeMap<Arc<str>, Folder<V>>,
    /// The watches, in order of their requests.
    watches: Vec<(Key, Ticket, W)>,
    last: Revision,
}

/// All entries with the same key up to the last `/`.
#[derive(Clone, Debug)]
struct Folder<V> {
    numbered: NumberMap<Entry<V>>,
    /// A hash map for speed; iteration uses `names`.
    named: FxHashMap<Arc<str>, Entry<V>>,
    names: BTreeSet<Arc<str>>,
}

impl<V> Default for Folder<V> {
    fn default() -> Self {
        Self { numbered: NumberMap::default(), named: FxHashMap::default(), names: BTreeSet::new() }
    }
}

impl<V> Folder<V> {
    fn get(&self, name: &EntryName) -> Option<&Entry<V>> {
        match name {
            EntryName::Number(number) => self.numbered.get(*number),
            EntryName::Text(name) => self.named.get(name),
        }
    }

    fn insert(&mut self, entry: Entry<V>) {
        match &entry.key.name {
            EntryName::Number(number) => _ = self.numbered.insert(*number, entry),
            EntryName::Text(name) => {
                let name = Arc::clone(name);
                if self.named.insert(Arc::clone(&name), entry).is_none() {
                    self.names.insert(name);
                }
            }
        }
    }

    /// Returns all entries: numbered ones first, then named ones.
    fn iter(&self) -> impl Iterator<Item = &Entry<V>> {
        self.numbered.values().chain(self.names.iter().filter_map(|name| self.named.get(name)))
    }
}

/// A reply of the store, with its receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct AddressedStore<V, W> {
    /// The watcher or requester that gets the reply.
    pub to: W,
    /// The ticket of the receiver's request.
    pub ticket: Ticket,
    /// The reply of the store.
    pub reply: StoreReply<V>,
}

impl<V, W> Default for MemoryStore<V, W> {
    fn default() -> Self {
        Self { folders: BTreeMap::new(), watches: Vec::new(), last: Revision::ABSENT }
    }
}

impl<V, W: PartialEq> MemoryStore<V, W> {
    /// Ends all watches of a client that is gone.
    pub fn forget(&mut self, who: &W) {
        self.watches.retain(|(_, _, other)| other != who);
    }
}

impl<V: Clone, W: Clone + PartialEq> MemoryStore<V, W> {
    /// Executes a request of client `from` and appends the replies: first to the client, then to the watchers.
    pub fn handle(
        &mut self,
        from: W,
        ticket: Ticket,
        request: StoreRequest<V>,
        replies: &mut Vec<AddressedStore<V, W>>,
    ) {
        match request {
            StoreRequest::Get { key } => {
                let entry = self.get(&key).cloned();
                replies.push(AddressedStore { to: from, ticket, reply: StoreReply::Got { key, entry } });
            }
            StoreRequest::Put { key, value } => self.write(from, ticket, key, value, replies),
            StoreRequest::CompareAndSet { key, expected_revision, value } => {
                if self.get(&key).map_or(Revision::ABSENT, |entry| entry.revision) == expected_revision {
                    self.write(from, ticket, key, value, replies);
                } else {
                    let entry = self.get(&key).cloned();
                    replies.push(AddressedStore { to: from, ticket, reply: StoreReply::Conflict { key, entry } });
                }
            }
            StoreRequest::Watch { prefix } => {
                let say = |reply| AddressedStore { to: from.clone(), ticket, reply };
                replies.extend(self.with_prefix(&prefix).map(|entry| say(StoreReply::Changed(entry.clone()))));
                replies.push(say(StoreReply::CaughtUp));
                self.watches.retain(|(_, other, who)| *other != ticket || *who != from);
                self.watches.push((prefix, ticket, from));
            }
        }
    }

    fn write(&mut self, from: W, ticket: Ticket, key: Key, value: V, replies: &mut Vec<AddressedStore<V, W>>) {
        self.last = Revision(self.last.0 + 1);
        let revision = self.last;
        replies.push(AddressedStore { to: from, ticket, reply: StoreReply::Written { key: key.clone(), revision } });
        let entry = Entry { key: key.clone(), revision, value };
        for (prefix, ticket, who) in &self.watches {
            if key.starts_with(prefix) {
                replies.push(AddressedStore {
                    to: who.clone(),
                    ticket: *ticket,
                    reply: StoreReply::Changed(entry.clone()),
                });
            }
        }
        match self.folders.get_mut(&key.folder) {
            Some(folder) => folder.insert(entry),
            None => self.folders.entry(key.folder).or_default().insert(entry),
        }
    }

    /// Returns the entry of a key; `None`: there is none.
    pub fn get(&self, key: &Key) -> Option<&Entry<V>> {
        self.folders.get(&key.folder)?.get(&key.name)
    }

    /// Returns all entries whose key starts with a prefix, by folder; within a folder numbered ones by number, then
    /// named ones by name.
    pub fn with_prefix<'a>(&'a self, prefix: &'a Key) -> impl Iterator<Item = &'a Entry<V>> {
        let folders = self.folders.iter().filter(|(folder, _)| folder.starts_with(&*prefix.folder));
        folders.flat_map(|(_, folder)| folder.iter()).filter(|entry| entry.key.starts_with(prefix))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(
        store: &mut MemoryStore<u32, &'static str>,
        from: &'static str,
        request: StoreRequest<u32>,
    ) -> Vec<(&'static str, StoreReply<u32>)> {
        let mut replies = Vec::new();
        store.handle(from, Ticket(1), request, &mut replies);
        replies.into_iter().map(|reply| (reply.to, reply.reply)).collect()
    }

    #[test]
    fn of_two_who_saw_the_same_revision_one_writes() {
        let mut store = MemoryStore::default();
        let cas =
            |value| StoreRequest::CompareAndSet { key: "zone/1".into(), expected_revision: Revision::ABSENT, value };
        assert!(matches!(ask(&mut store, "a", cas(1))[..], [("a", StoreReply::Written { revision: Revision(1), .. })]));
        match &ask(&mut store, "b", cas(2))[..] {
            [("b", StoreReply::Conflict { entry: Some(entry), .. })] => assert_eq!(entry.value, 1),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_watch_reports_what_is_there_and_then_what_changes_under_its_prefix_only() {
        let mut store = MemoryStore::default();
        ask(&mut store, "a", StoreRequest::Put { key: "zone/1".into(), value: 1 });
        ask(&mut store, "a", StoreRequest::Put { key: "agent/1".into(), value: 2 });
        let seen = ask(&mut store, "w", StoreRequest::Watch { prefix: "zone/".into() });
        assert!(
            matches!(&seen[..], [("w", StoreReply::Changed(entry)), ("w", StoreReply::CaughtUp)] if entry.value == 1)
        );
        let seen = ask(&mut store, "a", StoreRequest::Put { key: "zone/2".into(), value: 3 });
        assert!(matches!(&seen[..], [("a", StoreReply::Written { .. }), ("w", StoreReply::Changed(entry))]
            if entry.value == 3 && entry.revision == Revision(3)));
        store.forget(&"w");
        assert_eq!(ask(&mut store, "a", StoreRequest::Put { key: "zone/3".into(), value: 4 }).len(), 1);
    }
}
