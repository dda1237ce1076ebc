//! Membership of a Render Agent in a farm: its Master, its subscription, and its registration at the directories.

use bottega_agents::{AclMessage, AgentId, Performative, Time, platform::LifeCycleRequest};

use super::speed::Speed;
use crate::{
    FarmAction, FarmContent, FarmMessage,
    contents::{answer, message},
    protocol,
    registrant::{DirectoryEvent, MasterSource, Registrant},
};

/// The state of the membership.
#[derive(Clone, Debug)]
pub(super) struct FarmMembership {
    id: AgentId,
    /// The Master of the agent's work; `None` until it is found.
    master: Option<AgentId>,
    /// The registration at the directories, if there are any.
    registrant: Option<Box<Registrant>>,
    /// True if the Master has added it to its list.
    is_subscribed: bool,
    /// Suspended by the AMS: it has left its Master.
    is_suspended: bool,
    /// Excluded by its Master.
    is_excluded: bool,
}

impl FarmMembership {
    pub(super) fn new(id: AgentId, source: &MasterSource) -> Self {
        let (master, registrant) = source.of(&id);
        Self { id, master, registrant, is_subscribed: false, is_suspended: false, is_excluded: false }
    }

    /// Returns true if the Master has added the agent to its list.
    pub(super) fn is_subscribed(&self) -> bool {
        self.is_subscribed
    }

    /// Returns true if the AMS has suspended the agent.
    pub(super) fn is_suspended(&self) -> bool {
        self.is_suspended
    }

    /// Returns true if the agent's Master has excluded it.
    pub(super) fn is_excluded(&self) -> bool {
        self.is_excluded
    }

    /// Returns true if the agent belongs to no Master and may subscribe.
    pub(super) fn may_subscribe(&self) -> bool {
        !self.is_subscribed && !self.is_suspended
    }

    /// Returns the Master, if it is known.
    pub(super) fn master(&self) -> Option<&AgentId> {
        self.master.as_ref()
    }

    /// Sets the Master that a directory names.
    pub(super) fn set_master(&mut self, master: AgentId) {
        self.master = Some(master);
    }

    /// Notes that the Master has added the agent to its list.
    pub(super) fn note_subscribed(&mut self) {
        (self.is_subscribed, self.is_excluded) = (true, false);
    }

    /// Notes that the agent is no longer on the Master's list. Returns true if it was.
    pub(super) fn note_unsubscribed(&mut self) -> bool {
        std::mem::replace(&mut self.is_subscribed, false)
    }

    /// Notes that the Master has excluded the agent. Returns true if this is new.
    pub(super) fn note_excluded(&mut self) -> bool {
        !std::mem::replace(&mut self.is_excluded, true)
    }

    /// Subscribes if the Master is given; otherwise searches the DF first, because the Master may have changed.
    pub(super) fn seek_master(
        &mut self,
        now: Time,
        speed: &Speed,
        reply_by: Option<Time>,
        actions: &mut Vec<FarmAction>,
    ) {
        match &mut self.registrant {
            Some(registrant) => registrant.seek_master(now),
            None => self.subscribe(speed, reply_by, actions),
        }
    }

    /// Sends the subscription, which is repeated at `reply_by`.
    pub(super) fn subscribe(&self, speed: &Speed, reply_by: Option<Time>, actions: &mut Vec<FarmAction>) {
        let content = FarmContent::Subscription { power: speed.power(), lanes: speed.lanes() };
        let subscription = self.to_master(Performative::Subscribe, protocol::SUBSCRIBE, content);
        actions.push(FarmAction::Send(AclMessage { reply_by, ..subscription }));
    }

    /// Sends the Master a goodbye, if there is one.
    pub(super) fn unsubscribe(&self, actions: &mut Vec<FarmAction>) {
        if self.master.is_some() {
            let content = FarmContent::Unsubscription;
            let goodbye = self.to_master(Performative::Cancel, protocol::SUBSCRIBE, content);
            actions.push(FarmAction::Send(goodbye));
        }
    }

    /// Leaves the Master until resumed. Returns true if this is new.
    pub(super) fn suspend(&mut self, actions: &mut Vec<FarmAction>) -> bool {
        let is_new = !std::mem::replace(&mut self.is_suspended, true);
        if is_new {
            self.unsubscribe(actions);
        }
        is_new
    }

    /// Ends the suspension by the AMS. Returns true if there was one.
    pub(super) fn resume(&mut self) -> bool {
        std::mem::replace(&mut self.is_suspended, false)
    }

    /// Repeats the goodbye to a Master that still sends requests to a suspended agent. Returns true if it did.
    pub(super) fn repeat_goodbye(&self, message: &FarmMessage, actions: &mut Vec<FarmAction>) -> bool {
        let is_wanted = matches!(
            (message.performative, &message.content),
            (Performative::Agree, FarmContent::Subscribed)
                | (Performative::CallForProposal, _)
                | (Performative::Request, FarmContent::Profile(_))
                | (Performative::AcceptProposal, _)
        );
        if is_wanted {
            self.unsubscribe(actions);
        }
        is_wanted
    }

    /// Processes a message of a directory.
    pub(super) fn hear_directory(&mut self, now: Time, message: &FarmMessage) -> Option<DirectoryEvent> {
        self.registrant.as_mut().and_then(|registrant| registrant.hear(now, message))
    }

    /// Confirms a request of the AMS.
    pub(super) fn confirm(&self, message: &FarmMessage, request: LifeCycleRequest, actions: &mut Vec<FarmAction>) {
        if let Some(registrant) = &self.registrant {
            registrant.obeyed(message, request, actions);
        }
    }

    /// Leaves the directories, and ends the agent.
    pub(super) fn end(&mut self, actions: &mut Vec<FarmAction>) {
        if let Some(mut registrant) = self.registrant.take() {
            registrant.leave(actions);
        }
        actions.push(FarmAction::Stop);
    }

    pub(super) fn tick(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if let Some(registrant) = &mut self.registrant {
            registrant.tick(now, actions);
        }
    }

    pub(super) fn next_deadline(&self) -> Option<Time> {
        self.registrant.as_ref().and_then(|registrant| registrant.next_deadline())
    }

    /// Returns a message to the Master; without a receiver if it is unknown.
    pub(super) fn to_master(
        &self,
        performative: Performative,
        protocol: &'static str,
        content: FarmContent,
    ) -> FarmMessage {
        message(performative, protocol, &self.id, self.master.iter().cloned().collect(), content)
    }

    /// Replies to a message.
    pub(super) fn answer(
        &self,
        to: &FarmMessage,
        performative: Performative,
        content: FarmContent,
        actions: &mut Vec<FarmAction>,
    ) {
        actions.push(FarmAction::Send(answer(to, &self.id, performative, content)));
    }
}
