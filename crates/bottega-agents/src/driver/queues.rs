//! Message queues whose members take turns.

use std::collections::{BTreeMap, VecDeque};

use crate::{AclMessage, AgentId, Key};

/// Maximum number of messages in a queue without members; the oldest is dropped.
pub(crate) const QUEUED_MESSAGES_MAX: usize = 1 << 16;

struct Queue<C> {
    members: VecDeque<AgentId>,
    waiting: VecDeque<AclMessage<C>>,
}

/// All queues of a platform.
pub(crate) struct Queues<C>(BTreeMap<Key, Queue<C>>);

impl<C> Default for Queues<C> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<C> Queues<C> {
    fn queue(&mut self, name: &Key) -> &mut Queue<C> {
        self.0.entry(name.clone()).or_insert_with(|| Queue { members: VecDeque::new(), waiting: VecDeque::new() })
    }

    /// Addresses the message to the next member in turn; keeps it if there is none.
    pub(crate) fn enqueue(&mut self, name: &Key, mut message: AclMessage<C>) -> Option<AclMessage<C>> {
        let queue = self.queue(name);
        let Some(next) = queue.members.pop_front() else {
            if queue.waiting.len() == QUEUED_MESSAGES_MAX {
                queue.waiting.pop_front();
            }
            queue.waiting.push_back(message);
            return None;
        };
        message.receivers = vec![next.clone()];
        queue.members.push_back(next);
        Some(message)
    }

    /// Adds a member. Returns the messages that waited for one.
    pub(crate) fn join(&mut self, name: &Key, agent: &AgentId) -> Vec<AclMessage<C>> {
        let queue = self.queue(name);
        if !queue.members.contains(agent) {
            queue.members.push_back(agent.clone());
        }
        let mut waiting: Vec<_> = queue.waiting.drain(..).collect();
        for message in &mut waiting {
            message.receivers = vec![agent.clone()];
        }
        waiting
    }

    /// Removes an agent from all queues.
    pub(crate) fn forget(&mut self, agent: &AgentId) {
        for queue in self.0.values_mut() {
            queue.members.retain(|member| member != agent);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Performative;

    #[test]
    fn a_queue_gives_each_message_to_one_agent_in_turn() {
        let mut queues = Queues::default();
        let (name, a, b) = (Key::from("jobs"), AgentId::new("a"), AgentId::new("b"));
        let message = |number| AclMessage::new(Performative::Request, AgentId::new("c"), AgentId::new("c"), number);
        assert!(queues.enqueue(&name, message(1)).is_none());
        assert_eq!(queues.join(&name, &a).len(), 1);
        assert!(queues.join(&name, &b).is_empty());
        let takers: Vec<_> = (0..4).map(|n| queues.enqueue(&name, message(n)).unwrap().receivers[0].clone()).collect();
        assert_eq!(takers, [a.clone(), b.clone(), a.clone(), b.clone()]);
        queues.forget(&a);
        assert_eq!(queues.enqueue(&name, message(9)).unwrap().receivers, [b]);
    }
}
