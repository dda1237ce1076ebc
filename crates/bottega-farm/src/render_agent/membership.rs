//! Membership of a Render Agent: it finds its Master in the yellow pages, and is suspended, resumed and ended by the
//! AMS.

use bottega_agents::{
    Performative, Time,
    platform::{LifeCycleRequest, LifeCycleState},
};

use super::RenderAgent;
use crate::{FarmAction, FarmContent, FarmEffect, FarmMessage, contents::message, protocol, registrant::DirectoryNews};

impl RenderAgent {
    /// Subscribes if the Master is given; otherwise searches the DF first, because the Master may have changed.
    pub(super) fn seek_master(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        match &mut self.registrant {
            Some(registrant) => registrant.seek_master(now),
            None => self.subscribe(actions),
        }
    }

    /// Processes a message of a directory.
    pub(super) fn hear_directories(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        let news = self.registrant.as_mut().and_then(|registrant| registrant.hear(now, message));
        match news {
            Some(DirectoryNews::Master(master)) => {
                self.master = Some(master);
                if !self.subscribed && !self.is_suspended && self.adaptation.is_some() {
                    self.subscribe(actions);
                }
            }
            Some(DirectoryNews::LifeCycle(request)) => self.obey(now, message, request, actions),
            // The AMS's request may have been lost, so follow the state it lists
            Some(DirectoryNews::State(LifeCycleState::Suspended)) => self.suspend(actions),
            Some(DirectoryNews::State(LifeCycleState::Active)) => self.resume(now, actions),
            Some(DirectoryNews::State(_)) => {}
            None => {}
        }
    }

    /// Carries out a request of the AMS and confirms it.
    fn obey(&mut self, now: Time, message: &FarmMessage, request: LifeCycleRequest, actions: &mut Vec<FarmAction>) {
        match request {
            LifeCycleRequest::Suspend => self.suspend(actions),
            LifeCycleRequest::Resume => self.resume(now, actions),
            LifeCycleRequest::Quit | LifeCycleRequest::Destroy => {
                self.unsubscribe(actions);
                self.hand_back(actions);
                let reason = format!("ended by {}", message.sender);
                actions.push(FarmAction::Effect(FarmEffect::Dismissed { reason }));
            }
        }
        if let Some(registrant) = &self.registrant {
            registrant.obeyed(message, request, actions);
        }
        if matches!(request, LifeCycleRequest::Quit | LifeCycleRequest::Destroy) {
            self.leave(actions);
        }
    }

    /// Leaves the Master until resumed.
    fn suspend(&mut self, actions: &mut Vec<FarmAction>) {
        if !std::mem::replace(&mut self.is_suspended, true) {
            self.unsubscribe(actions);
            self.hand_back(actions);
        }
    }

    fn resume(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        if std::mem::replace(&mut self.is_suspended, false) && self.adaptation.is_some() {
            self.seek_master(now, actions);
        }
    }

    /// Repeats the goodbye to a Master that still sends requests to a suspended agent. Returns true if it did.
    pub(super) fn says_goodbye(&self, message: &FarmMessage, actions: &mut Vec<FarmAction>) -> bool {
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

    fn unsubscribe(&self, actions: &mut Vec<FarmAction>) {
        let Some(master) = &self.master else { return };
        let (id, to) = (&self.config.id, vec![master.clone()]);
        let goodbye = message(Performative::Cancel, protocol::SUBSCRIBE, id, to, FarmContent::Unsubscription);
        actions.push(FarmAction::Send(goodbye));
    }

    /// Gives up all zones that it holds.
    pub(super) fn hand_back(&mut self, actions: &mut Vec<FarmAction>) {
        for (zone, hand) in self.hands.iter().filter(|(_, hand)| hand.begun) {
            actions.push(FarmAction::Effect(FarmEffect::Drop { zone, fence: hand.order.fence }));
        }
        self.let_go();
    }

    /// Ends the agent.
    pub(super) fn leave(&mut self, actions: &mut Vec<FarmAction>) {
        if let Some(mut registrant) = self.registrant.take() {
            registrant.leave(actions);
        }
        actions.push(FarmAction::Stop);
    }
}
