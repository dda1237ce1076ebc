//! The pages of a platform as notices of a farm: every process that has a link to it can serve the platform.

use std::collections::BTreeMap;

use super::board::{Notice, NoticeBoard};
use crate::{Entry, Key, Revision, StoreReply, StoreRequest, Ticket, entry_store::EntryStore, store::AddressedStore};

/// How the names of the notices begin.
const FOLDER: &str = "page/";

/// A store of pages over notices. Its writes block until the server has them.
pub struct NoticePages {
    notices: NoticeBoard,
    /// How the names of this platform's notices begin.
    folder: String,
    watches: Vec<PageWatch>,
}

struct PageWatch {
    prefix: Key,
    ticket: Ticket,
    who: usize,
    /// Which writing of each entry was told last.
    told: BTreeMap<String, u64>,
}

type Replies = Vec<AddressedStore<String, usize>>;

impl NoticePages {
    /// The pages of the platform of this name.
    pub fn new(notices: NoticeBoard, platform: &str) -> Self {
        Self { notices, folder: format!("{FOLDER}{}/", platform.to_lowercase()), watches: Vec::new() }
    }

    fn name(&self, key: &Key) -> String {
        format!("{}{key}", self.folder)
    }

    fn get(&self, key: &Key) -> Option<Entry<String>> {
        self.notices.get(&self.name(key)).and_then(|notice| self.entry(&notice))
    }

    /// What a notice says; `None`: it is no page.
    fn entry(&self, notice: &Notice) -> Option<Entry<String>> {
        let key = notice.name.strip_prefix(&self.folder)?;
        let value = String::from_utf8(notice.text.to_vec()).ok()?;
        Some(Entry { key: key.into(), revision: Revision(notice.revision), value })
    }

    fn put(&self, key: Key, value: &str) -> StoreReply<String> {
        match self.notices.put(&self.name(&key), value.as_bytes()) {
            Ok(revision) => StoreReply::Written { key, revision: Revision(revision) },
            Err(error) => unavailable(&error),
        }
    }

    fn compare_and_set(&self, key: Key, expected: Revision, value: &str) -> StoreReply<String> {
        let name = self.name(&key);
        let written = match expected {
            // There may have been one that was let go.
            Revision::ABSENT => self.notices.create(&name, value.as_bytes()),
            Revision(revision) => self.notices.update(&name, value.as_bytes(), revision),
        };
        match written {
            Ok(Some(revision)) => StoreReply::Written { key, revision: Revision(revision) },
            Ok(None) => {
                let entry = self.get(&key);
                StoreReply::Conflict { key, entry }
            }
            Err(error) => unavailable(&error),
        }
    }

    /// Appends what those who watch have not heard.
    fn tell(&mut self, replies: &mut Replies) {
        if self.watches.is_empty() {
            return;
        }
        let notices = self.notices.all(&self.folder);
        let entries: Vec<Entry<String>> = notices.iter().filter_map(|notice| self.entry(notice)).collect();
        for watch in &mut self.watches {
            watch.tell(&entries, replies);
        }
    }
}

impl PageWatch {
    fn say(&self, reply: StoreReply<String>) -> AddressedStore<String, usize> {
        AddressedStore { to: self.who, ticket: self.ticket, reply }
    }

    fn tell(&mut self, entries: &[Entry<String>], replies: &mut Replies) {
        let mut gone = std::mem::take(&mut self.told);
        let mut told = BTreeMap::new();
        for entry in entries.iter().filter(|entry| entry.key.starts_with(&self.prefix)) {
            let name = entry.key.to_string();
            let before = gone.remove(&name).unwrap_or(0);
            if before < entry.revision.0 {
                replies.push(self.say(StoreReply::Changed(entry.clone())));
            }
            told.insert(name, before.max(entry.revision.0));
        }
        // One that was let go held no text before; to be sure it is told so.
        for (name, revision) in gone {
            let entry = Entry { key: name.into(), revision: Revision(revision), value: String::new() };
            replies.push(self.say(StoreReply::Changed(entry)));
        }
        self.told = told;
    }
}

impl EntryStore<String, usize> for NoticePages {
    fn handle(&mut self, from: usize, ticket: Ticket, request: StoreRequest<String>, replies: &mut Replies) {
        let reply = match request {
            StoreRequest::Get { key } => {
                let entry = self.get(&key);
                StoreReply::Got { key, entry }
            }
            StoreRequest::Put { key, value } => self.put(key, &value),
            StoreRequest::CompareAndSet { key, expected_revision, value } => {
                self.compare_and_set(key, expected_revision, &value)
            }
            StoreRequest::Watch { prefix } => {
                self.watches.retain(|watch| (watch.ticket, watch.who) != (ticket, from));
                self.watches.push(PageWatch { prefix, ticket, who: from, told: BTreeMap::new() });
                StoreReply::CaughtUp
            }
        };
        // What happened before comes first; what is written by this request, after its answer.
        let is_watch = matches!(reply, StoreReply::CaughtUp);
        if is_watch {
            self.tell(replies);
        }
        replies.push(AddressedStore { to: from, ticket, reply });
        if !is_watch {
            self.tell(replies);
        }
    }

    fn forget(&mut self, who: &usize) {
        self.watches.retain(|watch| watch.who != *who);
    }

    fn poll(&mut self, replies: &mut Replies) {
        self.tell(replies);
    }
}

fn unavailable(error: &super::BlobError) -> StoreReply<String> {
    tracing::debug!(%error, "a page was not written");
    StoreReply::Unavailable
}
