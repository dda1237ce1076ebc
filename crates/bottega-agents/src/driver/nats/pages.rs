//! The entries of a platform's directories (Start Service, AMS and DF), its *pages*, stored as notices of a farm, so
//! that every process with a link to the farm can serve the platform.

use std::collections::BTreeMap;

use super::notices::{NatsNotices, Notice};
use crate::{
    Entry, Key, Revision, StoreReply, StoreRequest, Ticket, entry_store::EntryStore, machine_of, store::AddressedStore,
};

/// The folder of the notices.
const FOLDER: &str = "page";
/// The part of an entry's key before the agent's name.
const OF_AGENT: &str = "/agent/";

/// A store of directory entries in notices. Writes block until the server confirms them.
pub struct NoticePages {
    notices: NatsNotices,
    /// Prefix of the names of this platform's notices.
    folder: String,
    watches: Vec<PageWatch>,
    /// The change count of the folder at the last report to watches.
    changes: Option<u64>,
}

struct PageWatch {
    prefix: Key,
    ticket: Ticket,
    who: usize,
    /// The last reported write of each entry.
    reported: BTreeMap<String, u64>,
}

type Replies = Vec<AddressedStore<String, usize>>;

impl NoticePages {
    /// Makes the store for the entries of the platform with this name; nothing is read yet.
    pub fn new(notices: NatsNotices, platform: &str) -> Self {
        Self { notices, folder: folder(platform), watches: Vec::new(), changes: None }
    }

    /// Returns the revision of an entry.
    pub(super) fn revision(&self, key: &Key) -> Option<Revision> {
        self.get(key).map(|entry| entry.revision)
    }

    fn name(&self, key: &Key) -> String {
        format!("{}{}", self.folder, notice_name(&key.to_string()))
    }

    fn get(&self, key: &Key) -> Option<Entry<String>> {
        self.notices.get(&self.name(key)).and_then(|notice| self.entry(&notice))
    }

    /// Returns the entry in a notice; `None`: it is not a page.
    fn entry(&self, notice: &Notice) -> Option<Entry<String>> {
        let key = entry_name(notice.name.strip_prefix(&self.folder)?)?;
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
        match self.notices.update(&self.name(&key), value.as_bytes(), expected.0) {
            Ok(Some(revision)) => StoreReply::Written { key, revision: Revision(revision) },
            Ok(None) => {
                let entry = self.get(&key);
                StoreReply::Conflict { key, entry }
            }
            Err(error) => unavailable(&error),
        }
    }

    /// Appends changes that watches have not received.
    fn tell(&mut self, replies: &mut Replies) {
        let changes = self.notices.changes(FOLDER);
        if self.watches.is_empty() || self.changes == Some(changes) {
            return;
        }
        self.changes = Some(changes);
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
        let mut gone = std::mem::take(&mut self.reported);
        let mut reported = BTreeMap::new();
        for entry in entries.iter().filter(|entry| entry.key.starts_with(&self.prefix)) {
            let name = entry.key.to_string();
            let before = gone.remove(&name).unwrap_or(0);
            if before < entry.revision.0 {
                replies.push(self.say(StoreReply::Changed(entry.clone())));
            }
            reported.insert(name, before.max(entry.revision.0));
        }
        // A deleted notice had no text before; report it in any case
        for (name, revision) in gone {
            let entry = Entry { key: name.into(), revision: Revision(revision), value: String::new() };
            replies.push(self.say(StoreReply::Changed(entry)));
        }
        self.reported = reported;
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
                self.changes = None;
                self.watches.push(PageWatch { prefix, ticket, who: from, reported: BTreeMap::new() });
                StoreReply::CaughtUp
            }
        };
        // Report earlier events first, and this request's write after its reply
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

/// The entry of an agent in a directory of a platform (AMS or DF), with the notice that stores it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AgentPage {
    /// The name of the agent, in lower case.
    pub agent: String,
    /// The notice that stores the entry.
    pub notice: Notice,
}

impl AgentPage {
    /// Returns all known entries of agents in the directories of a platform, including removed ones, whose text is
    /// empty.
    pub fn all(notices: &NatsNotices, platform: &str) -> Vec<Self> {
        let folder = folder(platform);
        let page = |notice: Notice| {
            let key = entry_name(notice.name.strip_prefix(&folder)?)?;
            let (_, agent) = key.split_once(OF_AGENT)?;
            Some(Self { agent: agent.to_owned(), notice })
        };
        notices.all(&folder).into_iter().filter_map(page).collect()
    }

    /// Returns true if the entry was removed.
    pub fn is_empty(&self) -> bool {
        self.notice.text.is_empty()
    }
}

/// Returns the prefix of a platform's notices.
fn folder(platform: &str) -> String {
    format!("{FOLDER}/{}/", platform.to_lowercase())
}

/// Returns the name of an entry's notice: an agent's is below its machine, so that a server can restrict each machine
/// to its own agents.
fn notice_name(key: &str) -> String {
    match key.split_once(OF_AGENT) {
        Some((which, agent)) => format!("{which}{OF_AGENT}{}/{agent}", machine_of(agent)),
        None => key.to_owned(),
    }
}

/// Returns the key of a notice's entry; `None`: the agent is of another machine than the notice.
fn entry_name(name: &str) -> Option<String> {
    let Some((which, rest)) = name.split_once(OF_AGENT) else { return Some(name.to_owned()) };
    let agent = rest.match_indices('/').map(|(at, _)| rest.split_at(at));
    let agent = agent.map(|(machine, agent)| (machine, &agent[1..]));
    let (_, agent) = agent.into_iter().find(|(machine, agent)| machine_of(agent) == *machine)?;
    Some(format!("{which}{OF_AGENT}{agent}"))
}

fn unavailable(error: &super::BlobError) -> StoreReply<String> {
    tracing::debug!(%error, "cannot write a page");
    StoreReply::Unavailable
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_name_of_an_entry_comes_back(agent in "[a-z/@.]{0,12}") {
            for key in [format!("ams/agent/{agent}"), format!("start/{agent}")] {
                prop_assert_eq!(entry_name(&notice_name(&key)), Some(key));
            }
        }
    }

    #[test]
    fn an_agent_stands_below_its_machine_and_below_no_other() {
        assert_eq!(notice_name("df/agent/render-1@vm-3f.07"), "df/agent/vm-3f/render-1@vm-3f.07");
        assert_eq!(notice_name("df/subscription/a@b/7"), "df/subscription/a@b/7");
        assert_eq!(entry_name("df/agent/vm-3f/render-1@vm-4a.07"), None);
        assert_eq!(entry_name("df/agent/render-1@vm-3f.07"), None);
    }
}
