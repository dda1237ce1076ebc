//! Stealing: an agent begins what it was dealt one after the other, and takes from its neighbors what waits in their hands.
//!
//! Source: Blumofe and Leiserson, *Scheduling Multithreaded Computations by Work Stealing* (1999): who has nothing asks, who has
//! too much is not disturbed by a master. What is given is as much as makes both end together, for agents are unequal. The Master
//! writes who has a zone; it does not choose.

use std::time::Duration;

use bottega_agents::{Performative, Time};

use super::{RenderAgent, hand::ZoneInHand};
use crate::{
    FarmAction, FarmContent, FarmMessage, PassedOrder, ZoneId, ZoneState,
    adaptation::scaled,
    contents::{asking, message},
    protocol,
};

/// Zones that are given at once.
const YIELDED_MAX: usize = 16;
/// A zone is shared if each gets at least so much of it.
const SHARE_MIN: f64 = 0.2;

impl RenderAgent {
    /// Begins what waits, as far as it may: all of it, or, where it was dealt, the oldest orders.
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

    /// Whether it has begun fewer of the zones that were dealt to it than it may.
    fn may_begin(&self) -> bool {
        let is_begun = |hand: &&ZoneInHand| hand.begun && hand.order.row.state == ZoneState::Awarded;
        self.config.steals && self.hands.values().filter(is_begun).count() < self.config.prefetch as usize
    }

    /// Asks a neighbor for zones, if it has fewer than it may begin.
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

    /// A neighbor asks, or answers.
    pub(super) fn hear_neighbor(&mut self, now: Time, message: &FarmMessage, actions: &mut Vec<FarmAction>) {
        match (message.performative, &message.content) {
            (Performative::Request, FarmContent::Steal { own, load }) => {
                let is_late = message.reply_by.is_some_and(|reply_by| reply_by < now);
                if !is_late {
                    self.yield_to(now, message, *own, *load, actions);
                }
            }
            // The zones are on their way, by the Master.
            (Performative::Agree, FarmContent::Yielded(_)) => self.thief.refusals = 0,
            (Performative::Refuse, _) if self.thief.neighbors.contains(&message.sender) => {
                self.thief.waits = false;
                self.thief.refusals += 1;
                if self.thief.refusals == self.thief.neighbors.len() && self.hands.is_empty() {
                    // Its Master may know of something.
                    self.beat(now, actions);
                }
            }
            (Performative::NotUnderstood | Performative::Agree | Performative::Refuse, _) => {}
            _ => self.answer(message, Performative::NotUnderstood, FarmContent::Nothing, actions),
        }
    }

    /// Gives a neighbor what waits, the last first, as long as the neighbor ends that before this agent would have ended all;
    /// and of the next one such a part that both end together.
    fn yield_to(&mut self, now: Time, message: &FarmMessage, own: f64, load: Duration, actions: &mut Vec<FarmAction>) {
        let own = if own.is_finite() { own.clamp(1e-6, 1e6) } else { 1.0 };
        let (mut mine, mut theirs) = (self.load(now), load);
        let waiting = self.hands.iter().filter(|(_, hand)| !hand.begun && hand.order.row.state == ZoneState::Awarded);
        let mut waiting: Vec<(ZoneId, &ZoneInHand)> = waiting.collect();
        waiting.sort_unstable_by_key(|(_, hand)| std::cmp::Reverse(hand.order.fence));
        let mut orders = Vec::new();
        for (zone, hand) in waiting.into_iter().take(YIELDED_MAX) {
            let time = hand.time(&self.config.expert).unwrap_or_default();
            let (fence, here, there) = (hand.order.fence, self.own(time), scaled(time, own));
            if theirs.saturating_add(there) < mine {
                (mine, theirs) = (mine.saturating_sub(here), theirs.saturating_add(there));
                orders.push(PassedOrder { zone, fence, kept: 0.0 });
                continue;
            }
            // Kept so much that both end together.
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
        for order in &orders {
            // Should the order come again, the Master has not heard of it.
            self.hands.remove(order.zone);
        }
        self.answer(message, Performative::Agree, FarmContent::Yielded(orders.len() as u32), actions);
        let content = FarmContent::HandedOver { to: message.sender.clone(), orders };
        let to = vec![master];
        let inform = crate::contents::message(Performative::Inform, protocol::STEALING, &self.config.id, to, content);
        actions.push(FarmAction::Send(inform));
    }
}
