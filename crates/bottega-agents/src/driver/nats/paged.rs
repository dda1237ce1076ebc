//! A link with a platform's pages among the entries of its store: each process has its own Start Service, AMS and DF
//! over the same notices.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use super::{NatsUplink, NoticePages};
use crate::{
    AclMessage, AgentId, Event, Key, Mailbox, Revision, StateMachine, StoreReply, StoreRequest, Ticket, Time, Uplink,
    codec::Codec, entry_store::EntryStore, platform::PAGE_FOLDERS, store::AddressedStore,
};

/// Interval of checks for writes of other processes.
const POLL_EVERY: Duration = Duration::from_millis(50);
/// Prefix of subscriptions to directories, which the processes with public addresses handle, not this one.
const OF_SUBSCRIBERS: &str = "df/subscription/";
/// The client number of this link itself, for removing entries.
const NOBODY: usize = usize::MAX;

/// A store request of an agent of this process.
struct PageRequest<M: StateMachine> {
    mailbox: Mailbox<M>,
    ticket: Ticket,
    request: StoreRequest<M::Value>,
}

/// A [`NatsUplink`] whose store also contains the entries of a platform's directories (Start Service, AMS and DF),
/// until it is [closed](Self::close).
pub struct PagedUplink<K, M: StateMachine> {
    link: Arc<NatsUplink<K>>,
    /// Not announced to others: each process has its own.
    services: Vec<AgentId>,
    /// The agents of this process, in lower case.
    residents: Arc<Mutex<BTreeSet<String>>>,
    /// `None` after it is closed.
    wishes: Mutex<Option<Sender<PageRequest<M>>>>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl<K, M> PagedUplink<K, M>
where
    K: Codec,
    M: StateMachine + Send + 'static,
    M::Content: Send + 'static,
    M::Value: From<String> + AsRef<str> + Send + 'static,
    M::Effect: Send + 'static,
    M::Completion: Send + 'static,
{
    /// Starts the thread that reads and writes the entries of the directories.
    ///
    /// - `platform`: the name of the platform.
    /// - `process`: the part after `@` in the names of agents that exist in this process only.
    /// - `services`: the Start Service, AMS and DF of this process, which no other process reaches over the link.
    ///
    /// # Errors
    /// A thread cannot be started.
    pub fn begin(
        link: Arc<NatsUplink<K>>,
        platform: &str,
        process: &str,
        services: Vec<AgentId>,
    ) -> std::io::Result<Self> {
        let residents = Arc::<Mutex<BTreeSet<String>>>::default();
        let keeper = PageKeeper {
            pages: NoticePages::new(link.notices().clone(), platform),
            at_process: format!("@{process}").to_lowercase(),
            mailboxes: BTreeMap::new(),
            residents: Arc::clone(&residents),
            entered: BTreeMap::new(),
        };
        let (wishes, wished) = channel();
        let thread = thread::Builder::new().name("pages".to_owned()).spawn(move || keeper.run(&wished))?;
        Ok(Self { link, services, residents, wishes: Mutex::new(Some(wishes)), thread: Mutex::new(Some(thread)) })
    }

    /// Removes the entries of this process's agents from the directories, as far as the server accepts it, and blocks
    /// meanwhile. Requests about entries get no answer afterwards.
    pub fn close(&self) {
        self.wishes.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // The thread has reported its own panic
            _ = thread.join();
        }
    }
}

impl<K, M> Uplink<M> for PagedUplink<K, M>
where
    K: Codec,
    M: StateMachine<Content = K::Content, Value = K::Value> + Send + 'static,
    M::Effect: Send + 'static,
    M::Completion: Send + 'static,
{
    fn add(&self, agent: &AgentId, mailbox: Mailbox<M>) {
        if !self.services.contains(agent) {
            self.residents.lock().unwrap_or_else(PoisonError::into_inner).insert(agent.name.to_lowercase());
            self.link.add(agent, mailbox);
        }
    }

    fn publish(&self, now: Time, message: &AclMessage<K::Content>, receiver: &AgentId) {
        if !self.services.contains(receiver) {
            Uplink::<M>::publish(&*self.link, now, message, receiver);
        }
    }

    fn ask_store(&self, mailbox: Mailbox<M>, ticket: Ticket, request: StoreRequest<K::Value>) {
        if !is_page(request.key()) {
            return self.link.ask_store(mailbox, ticket, request);
        }
        if let Some(wishes) = &*self.wishes.lock().unwrap_or_else(PoisonError::into_inner) {
            // The keeper ends after this
            _ = wishes.send(PageRequest { mailbox, ticket, request });
        }
    }
}

fn is_page(key: &Key) -> bool {
    PAGE_FOLDERS.iter().any(|folder| key.folder.starts_with(folder))
}

/// Returns the agent of an entry, if it is one of an agent.
fn agent_of(key: &str) -> Option<&str> {
    key.split_once("/agent/").map(|(_, agent)| agent)
}

/// Reads and writes the pages on its own thread, so that a slow server delays no agent.
struct PageKeeper<M: StateMachine> {
    pages: NoticePages,
    /// Suffix of the names of agents that exist in this process only.
    at_process: String,
    /// The mailboxes of agents with requests, by number.
    mailboxes: BTreeMap<usize, Mailbox<M>>,
    residents: Arc<Mutex<BTreeSet<String>>>,
    /// Entries of its agents written by this process, with their revisions.
    entered: BTreeMap<String, Revision>,
}

impl<M: StateMachine> PageKeeper<M>
where
    M::Value: From<String> + AsRef<str>,
{
    fn run(mut self, wished: &Receiver<PageRequest<M>>) {
        let mut replies = Vec::new();
        loop {
            match wished.recv_timeout(POLL_EVERY) {
                Ok(PageRequest { mailbox, ticket, request }) => self.perform(mailbox, ticket, request, &mut replies),
                Err(RecvTimeoutError::Timeout) => self.pages.poll(&mut replies),
                Err(RecvTimeoutError::Disconnected) => return self.take_out(),
            }
            self.tell(&mut replies);
        }
    }

    fn perform(
        &mut self,
        mailbox: Mailbox<M>,
        ticket: Ticket,
        request: StoreRequest<M::Value>,
        replies: &mut Vec<AddressedStore<String, usize>>,
    ) {
        let from = mailbox.number();
        self.mailboxes.insert(from, mailbox);
        let request = request.map(|value| value.as_ref().to_owned());
        let holds_text = request.value().is_some_and(|text| !text.is_empty());
        self.pages.handle(from, ticket, request, replies);
        for reply in replies.iter().filter(|reply| (reply.to, reply.ticket) == (from, ticket)) {
            let StoreReply::Written { key, revision } = &reply.reply else { continue };
            let name = key.to_string();
            let is_here = |agent: &str| self.residents.lock().unwrap_or_else(PoisonError::into_inner).contains(agent);
            if !holds_text {
                self.entered.remove(&name);
            } else if agent_of(&name).is_some_and(is_here) {
                self.entered.insert(name, *revision);
            }
        }
    }

    fn tell(&mut self, replies: &mut Vec<AddressedStore<String, usize>>) {
        for AddressedStore { to, ticket, reply } in replies.drain(..) {
            let is_of_subscriber = |entry: &crate::Entry<String>| entry.key.to_string().starts_with(OF_SUBSCRIBERS);
            if matches!(&reply, StoreReply::Changed(entry) if is_of_subscriber(entry)) {
                continue;
            }
            if let Some(mailbox) = self.mailboxes.get(&to) {
                mailbox.deliver(Event::Store { ticket, reply: reply.map(M::Value::from) });
            }
        }
    }

    /// Removes the entries of this process's agents at its end. That of an agent that may be elsewhere by now is
    /// removed only if unchanged since; another process's AMS may have changed the state of one that existed here only.
    fn take_out(mut self) {
        let mut replies = Vec::new();
        for (name, entered) in std::mem::take(&mut self.entered) {
            let expected_revision = match name.ends_with(&self.at_process) {
                true => self.pages.revision(&name.as_str().into()).unwrap_or(entered),
                false => entered,
            };
            let request = StoreRequest::CompareAndSet { key: name.into(), expected_revision, value: String::new() };
            self.pages.handle(NOBODY, Ticket(0), request, &mut replies);
            // Do not wait for an unresponsive server again and again; other processes clean up
            if replies.iter().any(|reply| reply.to == NOBODY && reply.reply == StoreReply::Unavailable) {
                return;
            }
            replies.clear();
        }
    }
}
