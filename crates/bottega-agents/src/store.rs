//! The shared key-value store: every entry has a revision, and a write can ask that nobody wrote in between.
//!
//! The revision is also the *fencing token* of whatever the entry awards: it grows with every write to the store, so
//! what was awarded later always carries the greater one.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use rustc_hash::FxHashMap;

pub use crate::key::Key;
use crate::{key::Name, number_map::NumberMap};

/// Counts the writes to a store. Greater is later, over all keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Revision(pub u64);

impl Revision {
    /// The revision of an entry that does not exist: what to expect in order to create one.
    pub const ABSENT: Self = Self(0);
}

/// Ties an answer to its request. Chosen by the asker; unique among its open requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Ticket(pub u64);

/// One entry.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry<V> {
    /// Its name.
    pub key: Key,
    /// The write that made it what it is.
    pub revision: Revision,
    /// What it holds.
    pub value: V,
}

/// A request to the store.
#[derive(Clone, Debug, PartialEq)]
pub enum StoreRequest<V> {
    /// Reads an entry; answered by [`StoreReply::Got`].
    Get {
        /// Which.
        key: Key,
    },
    /// Writes an entry, whatever was there; answered by [`StoreReply::Written`].
    Put {
        /// Which.
        key: Key,
        /// What it shall hold.
        value: V,
    },
    /// Writes an entry only if nobody wrote it since; answered by [`StoreReply::Written`] or [`StoreReply::Conflict`].
    CompareAndSet {
        /// Which.
        key: Key,
        /// The revision it must have: [`Revision::ABSENT`] where it must not exist yet.
        expected_revision: Revision,
        /// What it shall hold.
        value: V,
    },
    /// Reports all entries whose name begins so, then [`StoreReply::CaughtUp`], then every write to one of them.
    Watch {
        /// How the names begin.
        prefix: Key,
    },
}

/// A reply of the store.
#[derive(Clone, Debug, PartialEq)]
pub enum StoreReply<V> {
    /// The entry asked for, if there is one.
    Got {
        /// Which was asked for.
        key: Key,
        /// What is there.
        entry: Option<Entry<V>>,
    },
    /// Written.
    Written {
        /// Which.
        key: Key,
        /// By which write: the fencing token.
        revision: Revision,
    },
    /// Not written: the entry has another revision than expected.
    Conflict {
        /// Which.
        key: Key,
        /// What is there.
        entry: Option<Entry<V>>,
    },
    /// A watched entry as it is now.
    Changed(Entry<V>),
    /// A watch has reported all that was there when it began.
    CaughtUp,
    /// The store could not be asked. Whether a write took place is not known.
    Unavailable,
}

/// A store in memory: what the drivers of one process hold, and what every other store must behave like.
#[derive(Clone, Debug)]
pub struct MemoryStore<V, W = ()> {
    folders: BTreeMap<Arc<str>, Folder<V>>,
    /// Who watches which prefix, in order of asking.
    watches: Vec<(Key, Ticket, W)>,
    last: Revision,
}

/// All entries whose names are equal up to the last stroke.
#[derive(Clone, Debug)]
struct Folder<V> {
    numbered: NumberMap<Entry<V>>,
    /// A hash map, for speed; what goes through several entries goes by `names`.
    named: FxHashMap<Arc<str>, Entry<V>>,
    names: BTreeSet<Arc<str>>,
}

impl<V> Default for Folder<V> {
    fn default() -> Self {
        Self { numbered: NumberMap::default(), named: FxHashMap::default(), names: BTreeSet::new() }
    }
}

impl<V> Folder<V> {
    fn get(&self, name: &Name) -> Option<&Entry<V>> {
        match name {
            Name::Number(number) => self.numbered.get(*number),
            Name::Text(name) => self.named.get(name),
        }
    }

    fn insert(&mut self, entry: Entry<V>) {
        match &entry.key.name {
            Name::Number(number) => _ = self.numbered.insert(*number, entry),
            Name::Text(name) => {
                let name = Arc::clone(name);
                if self.named.insert(Arc::clone(&name), entry).is_none() {
                    self.names.insert(name);
                }
            }
        }
    }

    /// Numbers first, then names.
    fn iter(&self) -> impl Iterator<Item = &Entry<V>> {
        self.numbered.values().chain(self.names.iter().filter_map(|name| self.named.get(name)))
    }
}

/// A reply and to whom it goes.
#[derive(Clone, Debug, PartialEq)]
pub struct AddressedStore<V, W> {
    /// Who asked.
    pub to: W,
    /// With which ticket.
    pub ticket: Ticket,
    /// What is said.
    pub reply: StoreReply<V>,
}

impl<V, W> Default for MemoryStore<V, W> {
    fn default() -> Self {
        Self { folders: BTreeMap::new(), watches: Vec::new(), last: Revision::ABSENT }
    }
}

impl<V, W: PartialEq> MemoryStore<V, W> {
    /// Ends all watches of one who is gone.
    pub fn forget(&mut self, who: &W) {
        self.watches.retain(|(_, _, other)| other != who);
    }
}

impl<V: Clone, W: Clone + PartialEq> MemoryStore<V, W> {
    /// Carries out a request of `from` and appends the replies, to the asker first, to those who watch after it.
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

    /// Reads an entry.
    pub fn get(&self, key: &Key) -> Option<&Entry<V>> {
        self.folders.get(&key.folder)?.get(&key.name)
    }

    /// All entries whose name begins so, in the order of their keys: by folder, and there by number, then by name.
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
