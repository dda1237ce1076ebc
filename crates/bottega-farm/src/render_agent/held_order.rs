//! The zones that a Render Agent holds.

use std::{sync::Arc, time::Duration};

use bottega_agents::Time;
use bottega_image::Rect;

use crate::{Choice, Expert, FarmAction, FarmEffect, Order, PaintOrder, RelativePower, ZoneState, adaptation::scaled};

/// A zone held by a Render Agent.
#[derive(Clone, Debug)]
pub(super) struct HeldOrder {
    pub(super) order: Order,
    pub(super) choice: Choice,
    /// True if T_est is of these settings, except for the number of samples.
    pub(super) is_estimated: bool,
    /// True if this agent's rules chose the settings.
    pub(super) decided: bool,
    pub(super) begun: bool,
    /// Time of the order.
    pub(super) since: Time,
    /// True if the agent had finished the preparation for all zones by then.
    pub(super) was_ready: bool,
    /// Progress as last queried: painted samples, summed over all pixels.
    pub(super) painted: u64,
    /// The conversation of the order.
    pub(super) conversation: u64,
}

impl HeldOrder {
    /// Returns T_est of the order's samples; when profiling, of the first samples.
    pub(super) fn time(&self, expert: &Expert) -> Option<Duration> {
        let (row, settings) = (&self.order.row, &self.order.work.settings);
        let time = row.time_estimated?;
        if row.state != ZoneState::Profiling {
            return Some(time);
        }
        let first = expert.first_samples(&self.choice, &settings.goal);
        Some(scaled(time, f64::from(first) / f64::from(settings.samples.max(1))))
    }

    /// Requests the painting of the order's samples.
    pub(super) fn begin(&mut self, power: RelativePower, expert: &Expert, actions: &mut Vec<FarmAction>) {
        let row = &self.order.row;
        let done = row.samples_done();
        let samples = match row.state {
            ZoneState::Profiling => 0..expert.first_samples(&self.choice, &self.order.work.settings.goal),
            _ => done..row.goal_samples(&self.choice),
        };
        let from = row.result.filter(|_| samples.start > 0);
        actions.push(FarmAction::Effect(FarmEffect::Paint(PaintOrder {
            zone: row.zone,
            fence: self.order.fence,
            rect: row.painted(&self.choice, &self.order.work.settings.frame),
            samples,
            tunables: self.choice.tunables,
            preference: expert.preference(&self.order.work, row),
            error_use: self.order.work.settings.goal.error_use(),
            samples_max: self.choice.samples,
            from,
            time_estimated: self.time(expert).map(|estimated| power.to_own(estimated)),
        })));
        self.begun = true;
    }
}

impl Order {
    /// Returns the order with the settings that this agent's rules chose.
    pub(super) fn with_choice(&self, choice: Choice) -> Self {
        Self { row: Arc::new(self.row.with_choice(choice)), ..self.clone() }
    }

    /// Returns true if the order can be carried out; orders come from peers and are not trusted.
    pub(super) fn is_sound(&self) -> bool {
        let (row, settings) = (&self.row, &self.work.settings);
        let in_work = row.work == self.work.work && row.root().0 < self.work.zone_count;
        let is_part = |rect: &Rect| !rect.is_empty() && settings.frame.encloses(rect);
        let has_pixels = is_part(&row.rect) && row.piece.as_ref().is_none_or(is_part);
        let has_samples = match (row.state, row.choice) {
            (ZoneState::Profiling, _) => row.result.is_none(),
            (ZoneState::Awarded, Some(choice)) => row.samples_done() < row.goal_samples(&choice),
            _ => false,
        };
        in_work && has_pixels && has_samples && settings.samples > 0
    }
}
