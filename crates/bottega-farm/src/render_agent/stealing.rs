//! Stealing: an agent begins the zones dealt to it one after the other, and takes waiting zones from its neighbors when
//! it has none.
//!
//! Source: Blumofe and Leiserson, *Scheduling Multithreaded Computations by Work Stealing* (1999): idle workers ask,
//! busy ones are not interrupted by a master. A neighbor gives as much as makes both finish together, since agents
//! differ in speed. The Master records the new holder, but does not choose it.

use std::time::Duration;

use bottega_agents::{Performative, Time};

use super::{RenderAgent, hand::ZoneInHand};
use crate::{
    FarmAction, FarmContent, FarmMessage, PassedOrder, ZoneId, ZoneState,
    adaptation::scaled,
    contents::{asking, message},
    protocol,
};

/// Maximum number of zones given at a time.
const YIELDED_MAX: usize = 16;
/// Minimum share for each side when a zone is divided.
const SHARE_MIN: f64 = 0.2;

impl RenderAgent {
    /// Begins waiting zones: all profiles, and all awards too unless zones are dealt; of dealt zones the oldest, up to
    /// `prefetch`.
    pub(super) fn begin_waiting(&mut self, actions: &mut Vec<FarmAction>) {
        if !self.fetched {
            return;
        }
        let (power, expert) = (self.power(), &self.config.expert);
        let is_free = |hand: &&mut ZoneInHand| !self.config.steals || hand.order.row.state == ZoneState::Profiling;
        let free = self.hands.values_mut().filter(|hand| !hand.begun).filter(is_free);
        free.for_each(|hand| hand.begin(power, expert, actions));
        while self.may_begin() {
            let waiting = self.hands.values_mut().filter(|hand| !hand.begun);
            let Some(oldest) = waiting.min_by_key(|hand| hand.order.fence) else { return };
            oldest.begin(power, &self.config.expert, actions);
        }
    }

    /// True if the agent may begin another of the zones dealt to it.
    fn may_begin(&self) -> bool {
        let is_begun = |hand: &&ZoneInHand| hand.begun && hand.order.row.state == ZoneState::Awarded;
        self.config.steals && self.hands.values().filter(is_begun).count() < self.config.prefetch as usize
    }

    /// Asks a neighbor for zones, if the agent has room and is not waiting for an answer.
    pub(super) fn steal(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let is_ready = self.config.steals && self.fetched && self.subscribed && !self.is_suspended;
        if !is_ready || self.room() == 0 {
            return;
        }
        let content = FarmContent::Steal { own: self.power().get() / self.lanes, load: self.load(now) };
        let Some(neighbor) = self.thief.whom() else { return };
        let to = vec![neighbor.clone()];
        let plea = message(Performative::Request, protocol::STEALING, &self.config.id, to, content);
        actions.push(FarmAction::Send(asking(plea, 0, Some(now + self.config.heartbeat))));
    }

    /// Processes a neighbor's request or answer.
    pub(super) fn hear_neighbor(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        match (message.performative, &message.content) {
            (Performative::Request, FarmContent::Steal { own, load }) => {
                let is_late = message.reply_by.is_some_and(|reply_by| reply_by < now);
                if !is_late {
                    self.yield_to(now, message, *own, *load, actions);
                }
            }
            // The zones come from the Master
            (Performative::Agree, FarmContent::Yielded(_)) => self.thief.refusals = 0,
            (Performative::Refuse, _) if self.thief.neighbors.contains(&message.sender) => {
                self.thief.waits = false;
                self.thief.refusals += 1;
                if self.thief.refusals == self.thief.neighbors.len() && self.hands.is_empty() {
                    // Send a heartbeat: the Master may have something
                    self.beat(now, actions);
                }
            }
            (Performative::NotUnderstood | Performative::Agree | Performative::Refuse, _) => {}
            _ => self.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions),
        }
    }

    /// Gives waiting zones to a neighbor, the last first, while the neighbor finishes them before this agent finishes
    /// everything. Of the next zone it offers such a part that both finish together.
    fn yield_to(&mut self, now: Time, message: &FarmMessage, own: f64, load: Duration, actions: &mut Vec<FarmAction>) {
        let own = if own.is_finite() { own.clamp(1e-6, 1e6) } else { 1.0 };
        let (mut mine, mut theirs) = (self.load(now), load);
        // List the waiting zones, the last first
        let waiting = self.hands.iter().filter(|(_, hand)| !hand.begun && hand.order.row.state == ZoneState::Awarded);
        let mut waiting: Vec<(ZoneId, &ZoneInHand)> = waiting.collect();
        waiting.sort_unstable_by_key(|(_, hand)| std::cmp::Reverse(hand.order.fence));
        let mut orders = Vec::new();
        // Give whole zones while the neighbor would finish first
        for (zone, hand) in waiting.into_iter().take(YIELDED_MAX) {
            let time = hand.time(&self.config.expert).unwrap_or_default();
            let (fence, here, there) = (hand.order.fence, self.own(time), scaled(time, own));
            if theirs.saturating_add(there) < mine {
                (mine, theirs) = (mine.saturating_sub(here), theirs.saturating_add(there));
                orders.push(PassedOrder { zone, fence, kept: 0.0 });
                continue;
            }
            // Keep so much of the next zone that both finish together
            let begins = mine.saturating_sub(here).as_secs_f64();
            let kept = theirs.saturating_add(there).as_secs_f64() - begins;
            let kept = kept / here.saturating_add(there).as_secs_f64().max(1e-9);
            if kept > SHARE_MIN && kept < 1.0 - SHARE_MIN {
                orders.push(PassedOrder { zone, fence, kept });
            }
            break;
        }
        let Some(master) = self.master.clone().filter(|_| !orders.is_empty()) else {
            return self.answer(message, Performative::Refuse, FarmContent::Nothing, actions);
        };
        // Remove the given zones and tell the neighbor and the Master
        for order in &orders {
            self.hands.remove(order.zone);
        }
        self.answer(message, Performative::Agree, FarmContent::Yielded(orders.len() as u32), actions);
        let content = FarmContent::HandedOver { to: message.sender.clone(), orders };
        let to = vec![master];
        let inform = crate::contents::message(Performative::Inform, protocol::STEALING, &self.config.id, to, content);
        actions.push(FarmAction::Send(inform));
    }
}
