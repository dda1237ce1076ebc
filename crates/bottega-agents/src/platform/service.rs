//! What the platform's services have in common: a request comes, an answer goes.

use std::marker::PhantomData;

use super::management::{
    CarriesManagement, FailureReason, Function, ManagementContent, NotUnderstoodReason, Outcome, RefuseReason,
};
use crate::{AclMessage, Action, ActionOf, AgentId, Event, EventOf, Performative, StateMachine, Time};

/// Why a function has no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoResult {
    /// It was not begun.
    Refuse(RefuseReason),
    /// It went wrong.
    Failure(FailureReason),
}

impl From<RefuseReason> for NoResult {
    fn from(reason: RefuseReason) -> Self {
        Self::Refuse(reason)
    }
}

impl From<FailureReason> for NoResult {
    fn from(reason: FailureReason) -> Self {
        Self::Failure(reason)
    }
}

/// What a service does, without the talk around it.
pub trait Functions {
    /// Carries out `function` as `asker` wants it. Requests to agents that come of it are appended to `requests`.
    ///
    /// # Errors
    /// It is refused or fails. In both cases nothing has changed.
    fn perform(
        &mut self,
        now: Time,
        asker: &AgentId,
        function: &Function,
        requests: &mut Vec<(AgentId, ManagementContent)>,
    ) -> Result<Outcome, NoResult>;

    /// Does what is due.
    fn tick(&mut self, _now: Time) {}

    /// When [`Self::tick`] has something to do.
    fn next_deadline(&self) -> Option<Time> {
        None
    }
}

/// A service as an agent: takes requests, answers them.
///
/// `C` is the platform's content type; `V`, `E` and `R` are the types of its store, effects and completions, none of
/// which a service uses.
pub struct Service<F, C, V, E, R> {
    id: AgentId,
    functions: F,
    #[allow(clippy::type_complexity, reason = "a marker")]
    vocabulary: PhantomData<fn() -> (C, V, E, R)>,
}

impl<F: Functions, C: CarriesManagement, V, E, R> Service<F, C, V, E, R> {
    /// The service as the agent `id`.
    pub fn new(id: AgentId, functions: F) -> Self {
        Self { id, functions, vocabulary: PhantomData }
    }

    /// What it does, to look at.
    pub fn functions(&self) -> &F {
        &self.functions
    }

    fn answer(&mut self, now: Time, message: &AclMessage<C>, send: &mut Vec<AclMessage<C>>) {
        // Reports of agents that were asked to suspend, resume or quit, and complaints: nothing to answer.
        use Performative as P;
        if matches!(message.performative, P::Inform | P::Agree | P::Refuse | P::Failure | P::NotUnderstood) {
            return;
        }
        let reply =
            |performative, content: ManagementContent| message.reply(performative, self.id.clone(), C::from(content));
        if message.performative != P::Request {
            let reason = NotUnderstoodReason::UnsupportedAct(message.performative);
            send.push(reply(P::NotUnderstood, ManagementContent::NotUnderstood(reason)));
            return;
        }
        let Some(ManagementContent::Action(function)) = message.content.management() else {
            let reason = NotUnderstoodReason::UnrecognisedValue("content");
            send.push(reply(P::NotUnderstood, ManagementContent::NotUnderstood(reason)));
            return;
        };
        let mut requests = Vec::new();
        let function = function.clone();
        let answer = match self.functions.perform(now, &message.sender, &function, &mut requests) {
            // The answer is at once, so there is no agree before it.
            Ok(outcome) => reply(P::Inform, ManagementContent::Done(function, outcome)),
            Err(NoResult::Refuse(reason)) => reply(P::Refuse, ManagementContent::Refused(function, reason)),
            Err(NoResult::Failure(reason)) => reply(P::Failure, ManagementContent::Failed(function, reason)),
        };
        for (agent, content) in requests {
            let request = AclMessage::new(P::Request, self.id.clone(), agent, C::from(content));
            send.push(AclMessage { ontology: super::ONTOLOGY, protocol: "fipa-request", ..request });
        }
        send.push(answer);
    }
}

impl<F: Functions, C: CarriesManagement, V, E, R> StateMachine for Service<F, C, V, E, R> {
    type Content = C;
    type Value = V;
    type Effect = E;
    type Completion = R;

    fn handle(&mut self, now: Time, event: EventOf<Self>, actions: &mut Vec<ActionOf<Self>>) {
        self.functions.tick(now);
        if let Event::Message(message) = event {
            let mut send = Vec::new();
            self.answer(now, &message, &mut send);
            actions.extend(send.into_iter().map(Action::Send));
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        self.functions.next_deadline()
    }
}
