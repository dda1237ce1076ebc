//! The request protocol (FIPA00026): a request, an optional agreement, an answer.

use super::OutOfSequence;
use crate::{AclMessage, AgentId, Performative, Time};

/// The answer to a request.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer<C> {
    /// The requested action was done; holds the confirmation or the result.
    Inform(C),
    /// The request was refused and not begun; holds the reason.
    Refuse(C),
    /// The request failed; holds the reason.
    Failure(C),
    /// The request was not understood; holds the reason.
    NotUnderstood(C),
    /// There was no answer by the deadline.
    Silence,
}

/// The initiator of a request. Responders answer each request directly: see the platform's services.
#[derive(Clone, Debug)]
pub struct RequestInitiator {
    participant: AgentId,
    conversation_id: u64,
    agreed: bool,
    deadline: Option<Time>,
}

impl RequestInitiator {
    /// Appends the request to `send`, with `request` as its performative and `fipa-request` as its protocol. Returns
    /// its initiator, which waits for the answer.
    ///
    /// # Panics
    /// Unless the request has exactly one receiver and a `reply_by`.
    pub fn request<C>(request: AclMessage<C>, send: &mut Vec<AclMessage<C>>) -> Self {
        let [participant] = &request.receivers[..] else { panic!("a request has one receiver") };
        let deadline = request.reply_by;
        assert!(deadline.is_some(), "every wait has a deadline");
        let this = Self {
            participant: participant.clone(),
            conversation_id: request.conversation_id,
            agreed: false,
            deadline,
        };
        send.push(AclMessage { performative: Performative::Request, protocol: "fipa-request", ..request });
        this
    }

    /// Handles a message of this conversation. Returns the answer, which ends the conversation; `None`: the participant
    /// has only agreed, and its answer is still to come.
    ///
    /// # Errors
    /// The message belongs to another participant or conversation, the conversation is over, or the message is out of
    /// sequence; nothing has changed.
    pub fn handle_message<C: Clone>(&mut self, message: &AclMessage<C>) -> Result<Option<Answer<C>>, OutOfSequence> {
        let wrong = |state| OutOfSequence { from: message.sender.clone(), got: message.performative, state };
        if message.sender != self.participant || message.conversation_id != self.conversation_id {
            return Err(wrong("not with this agent"));
        }
        if self.deadline.is_none() {
            return Err(wrong("closed"));
        }
        let content = message.content.clone();
        let answer = match message.performative {
            Performative::Agree => {
                self.agreed = true;
                return Ok(None);
            }
            Performative::Refuse if self.agreed => return Err(wrong("awaiting a result")),
            Performative::Refuse => Answer::Refuse(content),
            Performative::Inform => Answer::Inform(content),
            Performative::Failure => Answer::Failure(content),
            Performative::NotUnderstood => Answer::NotUnderstood(content),
            _ => return Err(wrong("awaiting an answer")),
        };
        self.deadline = None;
        Ok(Some(answer))
    }

    /// Returns [`Answer::Silence`] if the deadline has passed without an answer, which ends the conversation; else
    /// `None`.
    pub fn handle_time<C>(&mut self, now: Time) -> Option<Answer<C>> {
        self.deadline.take_if(|by| *by <= now).map(|_| Answer::Silence)
    }

    /// Returns the time at which [`Self::handle_time`] must be called. `None`: the conversation is over.
    pub fn next_deadline(&self) -> Option<Time> {
        self.deadline
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_request_ends_with_one_answer_or_with_silence() {
        let by = Time::since_start(Duration::from_secs(1));
        let (a, b) = (AgentId::new("a"), AgentId::new("b"));
        let request = || AclMessage {
            reply_by: Some(by),
            conversation_id: 3,
            ..AclMessage::new(Performative::Request, a.clone(), b.clone(), 1)
        };
        let mut send = Vec::new();
        let mut initiator = RequestInitiator::request(request(), &mut send);
        let say = |performative, content| send[0].reply(performative, b.clone(), content);
        assert_eq!(initiator.handle_message(&say(Performative::Agree, 0)), Ok(None));
        assert!(initiator.handle_message(&say(Performative::Refuse, 0)).is_err());
        assert_eq!(initiator.handle_message(&say(Performative::Inform, 8)), Ok(Some(Answer::Inform(8))));
        assert!(initiator.handle_message(&say(Performative::Inform, 8)).is_err());
        assert_eq!(initiator.next_deadline(), None);

        let mut unheard = RequestInitiator::request(request(), &mut Vec::new());
        assert_eq!(unheard.handle_time::<u32>(Time::ZERO), None);
        assert_eq!(unheard.handle_time::<u32>(by), Some(Answer::Silence));
        assert_eq!(unheard.handle_time::<u32>(by), None);
    }
}
