//! The speed of a Render Agent: its V_cp and its processors.

use std::time::Duration;

use crate::{Adaptation, AdaptationRule, RelativePower, adaptation::scaled};

/// The speed, which adapts to measured times.
#[derive(Clone, Debug)]
pub(super) struct Speed {
    rule: AdaptationRule,
    /// V_cp; `None` until the benchmark is done.
    adaptation: Option<Adaptation>,
    /// Number of processors that work on the agent's zones at once.
    lanes: f64,
}

impl Speed {
    /// Makes a speed before the benchmark.
    pub(super) fn unknown(rule: AdaptationRule) -> Self {
        Self { rule, adaptation: None, lanes: 1.0 }
    }

    /// Takes in the result of the benchmark.
    pub(super) fn set(&mut self, power: RelativePower, lanes: f64) {
        self.adaptation = Some(Adaptation::new(self.rule, power));
        self.lanes = if lanes.is_finite() { lanes.clamp(1e-3, 1e6) } else { 1.0 };
    }

    /// Replaces V_cp, if the benchmark is done.
    pub(super) fn restart_from(&mut self, power: RelativePower) {
        if let Some(adaptation) = &mut self.adaptation {
            *adaptation = Adaptation::new(self.rule, power);
        }
    }

    /// Adapts V_cp to a measured time.
    pub(super) fn learn(&mut self, busy: Duration, estimated: Duration) {
        if let Some(adaptation) = &mut self.adaptation {
            adaptation.learn(busy, estimated);
        }
    }

    /// Returns true if the benchmark is done.
    pub(super) fn is_known(&self) -> bool {
        self.adaptation.is_some()
    }

    /// Returns the current V_cp.
    pub(super) fn power(&self) -> RelativePower {
        self.adaptation.as_ref().map_or(RelativePower::REFERENCE, Adaptation::power)
    }

    /// Returns the number of processors that work on its zones at once.
    pub(super) fn lanes(&self) -> f64 {
        self.lanes
    }

    /// Returns the agent's own seconds per second of the reference machine, with all its processors together.
    pub(super) fn own_seconds(&self) -> f64 {
        self.power().get() / self.lanes
    }

    /// Converts reference-machine time to this agent's time, with all its processors together.
    pub(super) fn own(&self, reference: Duration) -> Duration {
        scaled(reference, self.own_seconds())
    }
}
