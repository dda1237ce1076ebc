//! Threads of conversations with foreign agents: the foreign message to which an agent of this platform replies.
//!
//! Agents identify messages by number, foreign agents by text. Most threads end within seconds and are kept in memory.
//! A subscription with a service outlives its process, so its thread is an entry of the store; its number is a function
//! of the texts, so that all processes agree on it. A subscription with another agent ends with that agent, and so does
//! its thread.

use std::collections::{BTreeMap, VecDeque};

use crate::{
    AgentId, Performative,
    conversation::{NAMELESS, STRANGE},
    sl,
    sl::Term,
    wire::{STRING_FORM, WireMessage, parse_string, print_string},
};

/// Maximum number of threads in memory; the oldest end first.
const THREADS_MAX: usize = 1 << 14;
/// Maximum number of threads in the store.
const KEPT_MAX: usize = 1 << 13;
/// Maximum number of threads of subscriptions with agents; the oldest end first.
const LIVE_MAX: usize = 1 << 13;

pub(super) const PREFIX: &str = "thread/";
/// The parameter of an entry with the foreign agent's representation.
const FORM: &str = "X-form";

/// A foreign message that may be answered.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Thread {
    /// The message, without its content.
    pub(super) message: WireMessage,
    /// The first expression of the message's content, which answers repeat.
    pub(super) expression: Option<Term>,
    /// The representation that the foreign agent uses.
    pub(super) form: String,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Threads {
    next: u64,
    /// The threads in memory, by increasing number.
    short: BTreeMap<u64, Thread>,
    /// The threads of subscriptions with services, by conversation number.
    kept: BTreeMap<u64, Thread>,
    /// The threads of subscriptions with other agents, by conversation number.
    live: BTreeMap<u64, Thread>,
    /// The numbers of `live`, in the order of their beginning.
    live_order: VecDeque<u64>,
}

impl Threads {
    pub(super) fn get(&self, number: u64) -> Option<&Thread> {
        self.short.get(&number).or_else(|| self.kept.get(&number)).or_else(|| self.live.get(&number))
    }

    /// Begins a thread; returns its number, and the entry for the store, if any.
    ///
    /// - `with_service`: true if the receiver is one of the platform's services.
    pub(super) fn begin(
        &mut self,
        conversation: u64,
        thread: Thread,
        with_service: bool,
    ) -> (u64, Option<(String, String)>) {
        let subscribes = thread.message.performative == Performative::Subscribe;
        if subscribes && !with_service {
            if self.live.insert(conversation, thread).is_none() {
                self.live_order.push_back(conversation);
            }
            if self.live.len() > LIVE_MAX
                && let Some(oldest) = self.live_order.pop_front()
            {
                self.live.remove(&oldest);
            }
            return (conversation, None);
        }
        if subscribes && self.kept.len() < KEPT_MAX {
            let entry = (key(conversation), print(&thread));
            self.kept.insert(conversation, thread);
            return (conversation, Some(entry));
        }
        if self.short.len() >= THREADS_MAX {
            self.short.pop_first();
        }
        self.next += 1;
        self.short.insert(self.next, thread);
        (self.next, None)
    }

    /// Ends the thread of a subscription; returns the key of the entry to remove.
    pub(super) fn end(&mut self, conversation: u64) -> Option<String> {
        if self.live.remove(&conversation).is_some() {
            self.live_order.retain(|other| *other != conversation);
        }
        self.kept.remove(&conversation).map(|_| key(conversation))
    }

    /// Takes in an entry of the store. False if it is not a thread.
    pub(super) fn learn(&mut self, key: &str, text: &str) -> bool {
        let Some(number) = key.strip_prefix(PREFIX) else { return false };
        let Ok(number) = u64::from_str_radix(number, 16) else { return true };
        match parse(text) {
            Some(thread) if self.kept.len() < KEPT_MAX => _ = self.kept.insert(number, thread),
            Some(_) => {}
            None => _ = self.kept.remove(&number),
        }
        true
    }
}

fn key(conversation: u64) -> String {
    format!("{PREFIX}{conversation:016x}")
}

fn print(thread: &Thread) -> String {
    let mut message = thread.message.clone();
    message.content = thread.expression.as_ref().map(|expression| sl::print(std::slice::from_ref(expression)));
    message.user.insert(FORM.to_owned(), thread.form.clone());
    // The message was parsed, so it can be printed; unprintable names of parameters were ignored
    print_string(&message).unwrap_or_default()
}

fn parse(text: &str) -> Option<Thread> {
    let mut message = parse_string(text).ok()?;
    let expression = message.content.take().and_then(|content| sl::parse(&content).ok()?.into_iter().next());
    let form = message.user.remove(FORM).unwrap_or_else(|| STRING_FORM.to_owned());
    Some(Thread { message, expression, form })
}

/// Returns the number of a foreign conversation: the same in every process and after a restart. (FNV-1a.)
pub(super) fn strange_number(sender: &AgentId, conversation: &str) -> u64 {
    let name = sender.name.to_lowercase();
    let bytes = name.bytes().chain([0]).chain(conversation.bytes());
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    let hash = hash & !NAMELESS | STRANGE;
    if conversation.is_empty() { hash | NAMELESS } else { hash }
}

/// Returns a number of this platform, as text for foreign agents.
pub(super) fn print_number(salt: u64, number: u64) -> String {
    format!("b{salt:x}-{number}")
}

/// Parses a text of [`print_number`].
pub(super) fn parse_number(salt: u64, text: &str) -> Option<u64> {
    text.strip_prefix(&format!("b{salt:x}-"))?.parse().ok().filter(|number| number & STRANGE == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subscriptions_with_services_are_kept_in_the_store_and_those_with_agents_in_memory() {
        let thread = || Thread {
            message: WireMessage::new(Performative::Subscribe),
            expression: None,
            form: STRING_FORM.to_owned(),
        };
        let mut threads = Threads::default();
        let (number, entry) = threads.begin(STRANGE | 1, thread(), true);
        assert_eq!((number, entry.map(|(key, _)| key)), (STRANGE | 1, Some(key(STRANGE | 1))));
        assert_eq!(threads.begin(STRANGE | 2, thread(), false), (STRANGE | 2, None));
        assert!(threads.get(STRANGE | 2).is_some());
        assert_eq!((threads.end(STRANGE | 1), threads.end(STRANGE | 2)), (Some(key(STRANGE | 1)), None));
        assert!(threads.get(STRANGE | 1).is_none() && threads.get(STRANGE | 2).is_none());
        // Too many: the oldest goes.
        for number in 0..=LIVE_MAX as u64 {
            threads.begin(STRANGE | number, thread(), false);
        }
        assert!(threads.get(STRANGE).is_none() && threads.get(STRANGE | LIVE_MAX as u64).is_some());
        assert_eq!((threads.live.len(), threads.live_order.len()), (LIVE_MAX, LIVE_MAX));
    }
}
