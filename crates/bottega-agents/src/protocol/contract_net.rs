//! The contract net protocol (FIPA00029): a call for proposals, proposals until a deadline, awards, results.

use std::collections::BTreeMap;

use super::OutOfSequence;
use crate::{AclMessage, AgentId, Performative, Time};

/// The name of the protocol in messages.
const PROTOCOL: &str = "fipa-contract-net";

/// Maximum number of open calls of a responder; further ones are refused.
pub const RESPONSES_MAX: usize = 1024;

/// A call for proposals: a task, and the agents that may propose to carry it out.
#[derive(Clone, Debug, PartialEq)]
pub struct Call<C> {
    /// The agent that calls for proposals.
    pub initiator: AgentId,
    /// The agents called.
    pub participants: Vec<AgentId>,
    /// The task to award.
    pub content: C,
    /// The language of the content.
    pub language: &'static str,
    /// The ontology of the content.
    pub ontology: &'static str,
    /// The number of the conversation, unique among the calls of the initiator.
    pub conversation_id: u64,
    /// The deadline of proposals. An agent without a proposal by then counts as having refused.
    pub reply_by: Time,
}

/// A proposal to carry out a called task.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal<C> {
    /// The agent that proposes.
    pub from: AgentId,
    /// The terms on which the agent offers to do the task.
    pub content: C,
}

/// The outcome of an awarded task.
#[derive(Clone, Debug, PartialEq)]
pub enum TaskOutcome<C> {
    /// The task is done, with this result.
    Done(C),
    /// The task failed, for this reason.
    Failed(C),
    /// There was no result by the deadline, or the contractor does not know the task (any more).
    Lost,
}

/// An event for the agent that called for proposals.
#[derive(Clone, Debug, PartialEq)]
pub enum InitiatorEvent<C> {
    /// Every agent has answered, or the deadline of proposals has passed: call [`ContractNetInitiator::award`]. Holds
    /// the proposals in order of arrival; there may be none.
    Collected(Vec<Proposal<C>>),
    /// An awarded task ended.
    Ended {
        /// The agent that had the task.
        contractor: AgentId,
        /// The result of the task, the reason why it failed, or that it is lost.
        outcome: TaskOutcome<C>,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Participant {
    Called,
    Refused,
    Proposed,
    Rejected,
    /// The task was awarded to it.
    Accepted,
    Ended,
}

impl Participant {
    fn describe(self) -> &'static str {
        match self {
            Self::Called => "awaiting a proposal",
            Self::Refused => "closed by a refusal",
            Self::Proposed => "awaiting the award",
            Self::Rejected => "closed by a rejection",
            Self::Accepted => "awaiting a result",
            Self::Ended => "closed by a result",
        }
    }
}

/// The initiator of one call for proposals.
#[derive(Clone, Debug)]
pub struct ContractNetInitiator<C> {
    call: Call<C>,
    participants: BTreeMap<AgentId, Participant>,
    /// The proposals, in order of arrival.
    proposals: Vec<Proposal<C>>,
    collecting: bool,
    /// The deadline of results.
    results_by: Option<Time>,
}

impl<C: Clone> ContractNetInitiator<C> {
    /// Begins a negotiation: appends the call for proposals to `send`. Returns the initiator, which collects the
    /// proposals.
    pub fn call(call: Call<C>, send: &mut Vec<AclMessage<C>>) -> Self {
        let participants: BTreeMap<_, _> =
            call.participants.iter().map(|agent| (agent.clone(), Participant::Called)).collect();
        send.push(AclMessage {
            performative: Performative::CallForProposal,
            sender: call.initiator.clone(),
            receivers: participants.keys().cloned().collect(),
            content: call.content.clone(),
            language: call.language,
            ontology: call.ontology,
            protocol: PROTOCOL,
            conversation_id: call.conversation_id,
            reply_with: call.conversation_id,
            in_reply_to: 0,
            reply_by: Some(call.reply_by),
        });
        Self { call, participants, proposals: Vec::new(), collecting: true, results_by: None }
    }

    /// Returns the call of this negotiation.
    pub fn the_call(&self) -> &Call<C> {
        &self.call
    }

    /// Handles a message of this conversation. Returns the event that it causes; `None`: there is none, as for
    /// duplicates. Replies are appended to `send`.
    ///
    /// # Errors
    /// The sender was not called, or the message is out of sequence; nothing has changed.
    pub fn handle_message(
        &mut self,
        now: Time,
        message: &AclMessage<C>,
        send: &mut Vec<AclMessage<C>>,
    ) -> Result<Option<InitiatorEvent<C>>, OutOfSequence> {
        use Participant as P;
        use Performative as A;
        let out_of_sequence = |state| OutOfSequence { from: message.sender.clone(), got: message.performative, state };
        let Some(&state) = self.participants.get(&message.sender) else {
            return Err(out_of_sequence("not with this agent"));
        };
        let next = match (state, message.performative) {
            (P::Called, A::Propose) if self.collecting && now < self.call.reply_by => {
                self.proposals.push(Proposal { from: message.sender.clone(), content: message.content.clone() });
                P::Proposed
            }
            // Reject a late proposal, so that its sender need not wait
            (P::Called | P::Rejected, A::Propose) => {
                send.push(self.say(A::RejectProposal, &message.sender, self.call.content.clone()));
                P::Rejected
            }
            (P::Called, A::Refuse | A::NotUnderstood) => P::Refused,
            (P::Proposed, A::NotUnderstood) => {
                self.proposals.retain(|proposal| proposal.from != message.sender);
                P::Refused
            }
            (P::Accepted, A::Inform | A::Failure | A::NotUnderstood) => {
                self.set(&message.sender, P::Ended);
                let content = || message.content.clone();
                let outcome = match message.performative {
                    A::Inform => TaskOutcome::Done(content()),
                    A::Failure => TaskOutcome::Failed(content()),
                    _ => TaskOutcome::Lost,
                };
                return Ok(Some(InitiatorEvent::Ended { contractor: message.sender.clone(), outcome }));
            }
            // Ignore duplicates, and messages that crossed ours
            (P::Proposed | P::Accepted | P::Ended, A::Propose)
            | (P::Refused, A::Refuse | A::Propose)
            | (P::Ended, A::Inform | A::Failure)
            | (_, A::NotUnderstood) => return Ok(None),
            _ => return Err(out_of_sequence(state.describe())),
        };
        self.set(&message.sender, next);
        Ok(self.collected(now))
    }

    /// Returns the events of deadlines reached at `now`: all proposals are in, or awarded tasks are lost.
    pub fn handle_time(&mut self, now: Time) -> Vec<InitiatorEvent<C>> {
        let mut events: Vec<_> = self.collected(now).into_iter().collect();
        if self.results_by.is_some_and(|by| by <= now) {
            self.results_by = None;
            for (contractor, state) in &mut self.participants {
                if *state == Participant::Accepted {
                    *state = Participant::Ended;
                    events.push(InitiatorEvent::Ended { contractor: contractor.clone(), outcome: TaskOutcome::Lost });
                }
            }
        }
        events
    }

    /// Returns the time at which [`Self::handle_time`] must be called; `None`: never.
    pub fn next_deadline(&self) -> Option<Time> {
        if self.collecting { Some(self.call.reply_by) } else { self.results_by }
    }

    /// Accepts proposals and rejects all others: appends the messages to `send`.
    ///
    /// - `accepted`: the agents whose proposals are accepted, each with the content of its acceptance. Agents without a
    ///   proposal are ignored.
    /// - `results_by`: the deadline of results.
    ///
    /// # Panics
    /// If called before [`InitiatorEvent::Collected`], or again after an award to at least one agent whose deadline
    /// [`Self::handle_time`] has not handled yet.
    pub fn award(&mut self, accepted: &[(AgentId, C)], results_by: Time, send: &mut Vec<AclMessage<C>>) {
        assert!(!self.collecting && self.results_by.is_none(), "an award follows the collection of proposals, once");
        for proposal in std::mem::take(&mut self.proposals) {
            match accepted.iter().find(|(agent, _)| *agent == proposal.from) {
                Some((agent, content)) => {
                    self.set(agent, Participant::Accepted);
                    let mut accept = self.say(Performative::AcceptProposal, agent, content.clone());
                    accept.reply_by = Some(results_by);
                    send.push(accept);
                    self.results_by = Some(results_by);
                }
                None => {
                    self.set(&proposal.from, Participant::Rejected);
                    send.push(self.say(Performative::RejectProposal, &proposal.from, proposal.content));
                }
            }
        }
    }

    /// Returns true if the negotiation is over: proposals were collected, all are answered, and no awarded task is
    /// open.
    pub fn is_finished(&self) -> bool {
        !self.collecting
            && self.proposals.is_empty()
            && !self.participants.values().any(|state| *state == Participant::Accepted)
    }

    fn collected(&mut self, now: Time) -> Option<InitiatorEvent<C>> {
        let awaited = self.participants.values().any(|state| *state == Participant::Called);
        if !self.collecting || (awaited && now < self.call.reply_by) {
            return None;
        }
        self.collecting = false;
        Some(InitiatorEvent::Collected(self.proposals.clone()))
    }

    fn set(&mut self, agent: &AgentId, state: Participant) {
        let before = self.participants.insert(agent.clone(), state);
        assert!(before.is_some(), "only who was called has a state");
    }

    fn say(&self, performative: Performative, to: &AgentId, content: C) -> AclMessage<C> {
        AclMessage {
            language: self.call.language,
            ontology: self.call.ontology,
            protocol: PROTOCOL,
            conversation_id: self.call.conversation_id,
            in_reply_to: self.call.conversation_id,
            ..AclMessage::new(performative, self.call.initiator.clone(), to.clone(), content)
        }
    }
}

/// An event for an agent that is called for proposals.
#[derive(Clone, Debug, PartialEq)]
pub enum ResponderEvent<C> {
    /// A call: answer it by [`ContractNetResponder::propose`] or [`ContractNetResponder::refuse`] before its
    /// `reply_by`.
    Called(AclMessage<C>),
    /// The task was awarded to this agent. End it by [`ContractNetResponder::done`] or [`ContractNetResponder::fail`].
    Accepted(AclMessage<C>),
    /// The task was awarded to another agent, or to none.
    Rejected(AclMessage<C>),
    /// The call or the award is void: the initiator has cancelled it, or has not understood this agent's message.
    Cancelled(AclMessage<C>),
    /// The call was not answered by its `reply_by`, or the proposal had no answer for so long that it is void.
    Expired {
        /// The conversation of the call.
        conversation: Conversation,
    },
}

/// A conversation of a responder: the initiator and its conversation id.
pub type Conversation = (AgentId, u64);

#[derive(Clone, Debug)]
enum Response<C> {
    Called(AclMessage<C>),
    /// The call, and the time until which the proposal is valid.
    Proposed(AclMessage<C>, Time),
    Working(AclMessage<C>),
}

/// The responder: all open calls of one agent.
#[derive(Clone, Debug)]
pub struct ContractNetResponder<C> {
    me: AgentId,
    open: BTreeMap<Conversation, Response<C>>,
}

impl<C: Clone> ContractNetResponder<C> {
    /// Makes a responder without open calls.
    pub fn new(me: AgentId) -> Self {
        Self { me, open: BTreeMap::new() }
    }

    /// Handles a message of the protocol. Returns the event that it causes; `None`: there is none, as for duplicates,
    /// late calls, and calls beyond [`RESPONSES_MAX`]. Replies are appended to `send`.
    ///
    /// # Errors
    /// The conversation is unknown, or the message is out of sequence; nothing has changed.
    pub fn handle_message(
        &mut self,
        now: Time,
        message: AclMessage<C>,
        send: &mut Vec<AclMessage<C>>,
    ) -> Result<Option<ResponderEvent<C>>, OutOfSequence> {
        use Performative as A;
        let key = (message.sender.clone(), message.conversation_id);
        let performative = message.performative;
        match (self.open.get(&key), performative) {
            (None, A::CallForProposal) if message.reply_by.is_some_and(|by| by <= now) => Ok(None),
            (None, A::CallForProposal) if self.open.len() >= RESPONSES_MAX => {
                send.push(message.reply(A::Refuse, self.me.clone(), message.content.clone()));
                Ok(None)
            }
            (None, A::CallForProposal) => {
                self.open.insert(key, Response::Called(message.clone()));
                Ok(Some(ResponderEvent::Called(message)))
            }
            (Some(Response::Proposed(call, _)), A::AcceptProposal) => {
                let call = call.clone();
                self.open.insert(key, Response::Working(call));
                Ok(Some(ResponderEvent::Accepted(message)))
            }
            (Some(Response::Proposed(..) | Response::Called(_)), A::RejectProposal) => {
                self.open.remove(&key);
                Ok(Some(ResponderEvent::Rejected(message)))
            }
            (Some(_), A::Cancel) => {
                self.open.remove(&key);
                send.push(message.reply(A::Inform, self.me.clone(), message.content.clone()));
                Ok(Some(ResponderEvent::Cancelled(message)))
            }
            (Some(_), A::NotUnderstood) => {
                self.open.remove(&key);
                Ok(Some(ResponderEvent::Cancelled(message)))
            }
            // Ignore duplicates, rejections of void or missing proposals, and complaints about ended tasks
            (Some(_), A::CallForProposal)
            | (Some(Response::Working(_)), A::AcceptProposal)
            | (None, A::RejectProposal | A::NotUnderstood | A::Cancel) => Ok(None),
            (state, _) => {
                let state = match state {
                    None => "unknown",
                    Some(Response::Called(_)) => "awaiting our proposal",
                    Some(Response::Proposed(..)) => "awaiting the award",
                    Some(Response::Working(_)) => "awaiting our result",
                };
                Err(OutOfSequence { from: message.sender, got: performative, state })
            }
        }
    }

    /// Proposes to carry out a called task: appends the proposal to `send`. Returns true if the call was open.
    ///
    /// - `content`: the terms of the proposal.
    /// - `until`: the time at which a proposal without an answer expires.
    pub fn propose(
        &mut self,
        conversation: &Conversation,
        content: C,
        until: Time,
        send: &mut Vec<AclMessage<C>>,
    ) -> bool {
        let Some(Response::Called(call)) = self.open.get(conversation) else { return false };
        let call = call.clone();
        send.push(call.reply(Performative::Propose, self.me.clone(), content));
        self.open.insert(conversation.clone(), Response::Proposed(call, until));
        true
    }

    /// Refuses a call: appends the refusal to `send`. Returns true if the call was open.
    ///
    /// - `content`: the reason.
    pub fn refuse(&mut self, conversation: &Conversation, content: C, send: &mut Vec<AclMessage<C>>) -> bool {
        let Some(Response::Called(call)) = self.open.get(conversation) else { return false };
        send.push(call.reply(Performative::Refuse, self.me.clone(), content));
        self.open.remove(conversation);
        true
    }

    /// Reports success of an accepted task: appends the report to `send`. Returns true if this agent held the task.
    ///
    /// - `content`: the result.
    pub fn done(&mut self, conversation: &Conversation, content: C, send: &mut Vec<AclMessage<C>>) -> bool {
        self.end(conversation, Performative::Inform, content, send)
    }

    /// Reports failure of an accepted task: appends the report to `send`. Returns true if this agent held the task.
    ///
    /// - `content`: the reason.
    pub fn fail(&mut self, conversation: &Conversation, content: C, send: &mut Vec<AclMessage<C>>) -> bool {
        self.end(conversation, Performative::Failure, content, send)
    }

    fn end(
        &mut self,
        conversation: &Conversation,
        how: Performative,
        content: C,
        send: &mut Vec<AclMessage<C>>,
    ) -> bool {
        let Some(Response::Working(call)) = self.open.get(conversation) else { return false };
        send.push(call.reply(how, self.me.clone(), content));
        self.open.remove(conversation);
        true
    }

    /// Drops calls not answered by their `reply_by`, and proposals without an answer by the time given to
    /// [`Self::propose`]. Returns [`ResponderEvent::Expired`] for each.
    pub fn handle_time(&mut self, now: Time) -> Vec<ResponderEvent<C>> {
        let over = self.open.iter().filter(|(_, response)| response.ends_at().is_some_and(|by| by <= now));
        let over: Vec<Conversation> = over.map(|(conversation, _)| conversation.clone()).collect();
        let mut events = Vec::new();
        for conversation in over {
            self.open.remove(&conversation);
            events.push(ResponderEvent::Expired { conversation });
        }
        events
    }

    /// Returns the time at which [`Self::handle_time`] must be called; `None`: never.
    pub fn next_deadline(&self) -> Option<Time> {
        self.open.values().filter_map(Response::ends_at).min()
    }

    /// Returns the number of accepted tasks in progress.
    pub fn working_count(&self) -> usize {
        self.open.values().filter(|response| matches!(response, Response::Working(_))).count()
    }

    /// Returns the number of proposals that have no answer yet.
    pub fn proposed_count(&self) -> usize {
        self.open.values().filter(|response| matches!(response, Response::Proposed(..))).count()
    }
}

impl<C> Response<C> {
    fn ends_at(&self) -> Option<Time> {
        match self {
            Self::Called(call) => call.reply_by,
            Self::Proposed(_, until) => Some(*until),
            Self::Working(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn at(seconds: u64) -> Time {
        Time::since_start(Duration::from_secs(seconds))
    }

    fn ids() -> [AgentId; 4] {
        ["m", "a", "b", "c"].map(AgentId::new)
    }

    fn begin(send: &mut Vec<AclMessage<u32>>) -> ContractNetInitiator<u32> {
        let [m, a, b, c] = ids();
        let call = Call {
            initiator: m,
            participants: vec![a, b, c],
            content: 9,
            language: "n",
            ontology: "o",
            conversation_id: 5,
            reply_by: at(10),
        };
        ContractNetInitiator::call(call, send)
    }

    fn answer(from: &AgentId, performative: Performative, content: u32) -> AclMessage<u32> {
        AclMessage { conversation_id: 5, ..AclMessage::new(performative, from.clone(), AgentId::new("m"), content) }
    }

    #[test]
    fn both_sides_come_from_the_call_to_the_result() {
        let [_, a, b, c] = ids();
        let mut wire = Vec::new();
        let mut initiator = begin(&mut wire);
        let mut responders: Vec<_> = [&a, &b, &c].map(|id| ContractNetResponder::new(id.clone())).into();
        let call = wire.remove(0);
        assert_eq!(
            (call.performative, call.receivers.len(), call.reply_by),
            (Performative::CallForProposal, 3, Some(at(10)))
        );
        for (bid, responder) in [4, 3, 0].into_iter().zip(&mut responders) {
            let event = responder.handle_message(at(1), call.clone(), &mut wire).unwrap();
            assert_eq!(event, Some(ResponderEvent::Called(call.clone())));
            let conversation = (AgentId::new("m"), 5);
            if bid > 0 {
                assert!(responder.propose(&conversation, bid, at(20), &mut wire));
            } else {
                assert!(responder.refuse(&conversation, 0, &mut wire));
            }
        }
        let mut events = Vec::new();
        for message in std::mem::take(&mut wire) {
            events.extend(initiator.handle_message(at(2), &message, &mut wire).unwrap());
        }
        // All have answered: the deadline is not waited for.
        let proposals = vec![Proposal { from: a.clone(), content: 4 }, Proposal { from: b.clone(), content: 3 }];
        assert_eq!(events, [InitiatorEvent::Collected(proposals)]);
        initiator.award(&[(b.clone(), 7)], at(30), &mut wire);
        let mut heard = Vec::new();
        for message in std::mem::take(&mut wire) {
            let to = responders.iter_mut().find(|responder| responder.me == message.receivers[0]).unwrap();
            heard.extend(to.handle_message(at(3), message, &mut wire).unwrap());
        }
        assert!(
            matches!(&heard[..], [ResponderEvent::Rejected(_), ResponderEvent::Accepted(task)] if task.content == 7)
        );
        assert!(!initiator.is_finished());
        assert!(responders[1].done(&(AgentId::new("m"), 5), 70, &mut wire));
        let event = initiator.handle_message(at(4), &wire.remove(0), &mut wire).unwrap();
        assert_eq!(event, Some(InitiatorEvent::Ended { contractor: b, outcome: TaskOutcome::Done(70) }));
        assert!(initiator.is_finished() && wire.is_empty());
    }

    #[test]
    fn silence_is_refusal_and_a_late_proposal_is_rejected() {
        let [_, a, b, _] = ids();
        let mut wire = Vec::new();
        let mut initiator = begin(&mut wire);
        wire.clear();
        assert_eq!(initiator.next_deadline(), Some(at(10)));
        initiator.handle_message(at(9), &answer(&a, Performative::Propose, 1), &mut wire).unwrap();
        assert!(matches!(&initiator.handle_time(at(10))[..], [InitiatorEvent::Collected(all)] if all.len() == 1));
        let late = initiator.handle_message(at(11), &answer(&b, Performative::Propose, 1), &mut wire).unwrap();
        assert_eq!(late, None);
        assert_eq!((wire.len(), wire[0].performative), (1, Performative::RejectProposal));
        initiator.award(&[(a.clone(), 0)], at(20), &mut wire);
        assert_eq!(initiator.next_deadline(), Some(at(20)));
        let events = initiator.handle_time(at(20));
        assert_eq!(events, [InitiatorEvent::Ended { contractor: a, outcome: TaskOutcome::Lost }]);
        assert!(initiator.is_finished());
        assert_eq!(initiator.next_deadline(), None);
    }

    #[test]
    fn what_is_out_of_turn_is_an_error_and_copies_are_not() {
        let [_, a, b, _] = ids();
        let mut wire = Vec::new();
        let mut initiator = begin(&mut wire);
        let mut say = |initiator: &mut ContractNetInitiator<u32>, from: &AgentId, performative| {
            initiator.handle_message(at(1), &answer(from, performative, 1), &mut wire)
        };
        assert_eq!(
            say(&mut initiator, &AgentId::new("x"), Performative::Propose).unwrap_err().state,
            "not with this agent"
        );
        let error = say(&mut initiator, &a, Performative::Inform).unwrap_err();
        assert_eq!(error.to_string(), "`inform` from a is out of sequence: the conversation is awaiting a proposal");
        assert_eq!(say(&mut initiator, &a, Performative::Propose), Ok(None));
        assert_eq!(say(&mut initiator, &a, Performative::Propose), Ok(None));
        assert!(say(&mut initiator, &a, Performative::Refuse).is_err());
        assert_eq!(say(&mut initiator, &b, Performative::NotUnderstood), Ok(None));
        let mut responder = ContractNetResponder::new(a.clone());
        let accept = AclMessage { conversation_id: 5, ..AclMessage::new(Performative::AcceptProposal, b, a, 1) };
        assert_eq!(responder.handle_message(at(1), accept, &mut wire).unwrap_err().state, "unknown");
    }

    #[test]
    fn proposals_expire_and_calls_have_a_bound() {
        let [m, a, ..] = ids();
        let mut responder = ContractNetResponder::new(a.clone());
        let mut wire = Vec::new();
        for conversation_id in 0..=RESPONSES_MAX as u64 {
            let call = AclMessage {
                conversation_id,
                reply_by: Some(at(5)),
                ..AclMessage::new(Performative::CallForProposal, m.clone(), a.clone(), 1)
            };
            responder.handle_message(at(1), call, &mut wire).unwrap();
        }
        assert_eq!(wire.len(), 1);
        assert_eq!(wire[0].performative, Performative::Refuse);
        assert!(responder.propose(&(m.clone(), 3), 1, at(8), &mut wire));
        assert_eq!(responder.handle_time(at(5)).len(), RESPONSES_MAX - 1);
        assert_eq!(responder.next_deadline(), Some(at(8)));
        assert_eq!(responder.handle_time(at(8)), [ResponderEvent::Expired { conversation: (m, 3) }]);
    }
}
