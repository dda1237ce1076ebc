//! The last messages of a job, numbered, ready for clients.

use std::collections::VecDeque;

use bottega_cluster::messages::{MessageEvent, SeenMessages};

/// Largest number of messages kept per job.
const KEPT_MAX: usize = 50_000;
/// Largest number of messages in an answer.
const ANSWER_MAX: usize = 2000;

/// The last messages of a job.
#[derive(Debug, Default)]
pub(crate) struct MessageLog {
    first: u64,
    messages: VecDeque<MessageEvent>,
    pub(crate) lost: u64,
}

impl MessageLog {
    pub(crate) fn push(&mut self, message: MessageEvent) {
        if self.messages.len() >= KEPT_MAX {
            self.messages.pop_front();
            self.first += 1;
        }
        self.messages.push_back(message);
    }

    /// Returns the messages from number `from` on, up to the limit of an answer.
    pub(crate) fn since(&self, from: u64) -> SeenMessages {
        let first = from.max(self.first);
        let skipped = usize::try_from(first - self.first).unwrap_or(usize::MAX);
        let messages = self.messages.iter().skip(skipped).take(ANSWER_MAX).cloned().collect();
        SeenMessages { first, messages, lost: self.lost }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_returned_from_a_number_on_and_the_oldest_are_dropped() {
        let mut log = MessageLog::default();
        for i in 0..KEPT_MAX + 10 {
            log.push(MessageEvent { at: i as f64, ..MessageEvent::default() });
        }
        let answer = log.since(0);
        assert_eq!((answer.first, answer.messages.len(), answer.messages[0].at), (10, ANSWER_MAX, 10.0));
        let answer = log.since(KEPT_MAX as u64 + 8);
        assert_eq!((answer.messages.len(), answer.messages[0].at), (2, (KEPT_MAX + 8) as f64));
        assert!(log.since(u64::MAX).messages.is_empty());
    }
}
