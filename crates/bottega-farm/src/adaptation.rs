//! V_cp: the relative speed of an agent, and the rules that adapt it.
//!
//! Source: MAGarRO, section 3.4, "Adaptation". Times on the blackboard are in reference-machine time, own time / V_cp.

use std::{collections::VecDeque, time::Duration};

/// The paper's k.
const PAPER_K: f64 = 0.1;
/// Number of ratios that the default rule keeps. Three new ones outvote the rest, so a change of speed is known after
/// three zones, and two outliers are ignored.
const RATIOS_KEPT: usize = 5;

/// The paper's V_cp, dimensionless: 1 is the reference machine, 0.5 is twice as fast.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct RelativePower(f64);

impl RelativePower {
    /// The power of the reference machine: 1.
    pub const REFERENCE: Self = Self(1.0);
    const RANGE: (f64, f64) = (1e-4, 1e4);

    /// Makes a power, clamped to 10⁻⁴..=10⁴; NaN gives the reference.
    pub fn new(value: f64) -> Self {
        if value.is_nan() { Self::REFERENCE } else { Self(value.clamp(Self::RANGE.0, Self::RANGE.1)) }
    }

    /// Returns the value, dimensionless.
    pub fn get(self) -> f64 {
        self.0
    }

    /// Returns the reference-machine time of a time on this machine: own time / V_cp.
    pub fn to_reference(self, own: Duration) -> Duration {
        scaled(own, 1.0 / self.0)
    }

    /// Returns the time on this machine of a reference-machine time: reference time · V_cp.
    pub fn to_own(self, reference: Duration) -> Duration {
        scaled(reference, self.0)
    }
}

/// Returns a duration times a factor; 2³⁴ s if the product is negative, not finite or too large.
pub(crate) fn scaled(duration: Duration, factor: f64) -> Duration {
    Duration::try_from_secs_f64(duration.as_secs_f64() * factor).unwrap_or(Duration::from_secs(1 << 34))
}

/// The rule by which an agent learns its V_cp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AdaptationRule {
    /// V_cp ← (1 − k)·V_cp + k·(T − T_est) with k = 0.1 and both times in seconds of the agent, equation (1) as
    /// printed. Drifts to zero if every estimate is right.
    Paper,
    /// V_cp ← the median of the last five ratios of T, in own time, to T_est, in reference-machine time. The
    /// benchmark's V_cp counts as the first of them.
    #[default]
    MedianRatio,
}

/// An agent's estimate of its own V_cp.
#[derive(Clone, Debug, PartialEq)]
pub struct Adaptation {
    rule: AdaptationRule,
    power: RelativePower,
    ratios: VecDeque<f64>,
}

impl Adaptation {
    /// Makes the estimate of an agent before its first zone.
    ///
    /// - `benchmark`: V_cp by the agent's benchmark, from which it starts.
    pub fn new(rule: AdaptationRule, benchmark: RelativePower) -> Self {
        Self { rule, power: benchmark, ratios: VecDeque::from([benchmark.get()]) }
    }

    /// Returns the current V_cp.
    pub fn power(&self) -> RelativePower {
        self.power
    }

    /// Updates V_cp after a finished zone. [`AdaptationRule::MedianRatio`] ignores times of zero.
    ///
    /// - `measured`: T, own time.
    /// - `estimated`: T_est, in reference-machine time.
    pub fn learn(&mut self, measured: Duration, estimated: Duration) {
        match self.rule {
            AdaptationRule::Paper => {
                let expected = self.power.to_own(estimated);
                let difference = measured.as_secs_f64() - expected.as_secs_f64();
                self.power = RelativePower::new((1.0 - PAPER_K) * self.power.get() + PAPER_K * difference);
            }
            AdaptationRule::MedianRatio => {
                if estimated.is_zero() || measured.is_zero() {
                    return;
                }
                let ratio = measured.as_secs_f64() / estimated.as_secs_f64();
                if self.ratios.len() == RATIOS_KEPT {
                    self.ratios.pop_front();
                }
                self.ratios.push_back(RelativePower::new(ratio).get());
                self.power = RelativePower::new(median(self.ratios.iter().copied().collect()));
            }
        }
    }
}

/// Returns the median; of an even count the geometric mean of the middle two.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { (values[middle - 1] * values[middle]).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn the_papers_own_example_comes_out() {
        assert_eq!(RelativePower::new(0.5).to_reference(5 * SECOND), 10 * SECOND);
        assert_eq!(RelativePower::new(2.0).to_reference(2 * SECOND), SECOND);
        assert_eq!(RelativePower::new(0.5).to_own(SECOND), SECOND / 2);
    }

    #[test]
    fn the_papers_rule_drifts_to_zero_when_every_estimate_is_right() {
        let mut adaptation = Adaptation::new(AdaptationRule::Paper, RelativePower::new(1.0));
        for _ in 0..50 {
            let own = adaptation.power().to_own(SECOND);
            adaptation.learn(own, SECOND);
        }
        assert!(adaptation.power().get() < 0.01);
    }

    #[test]
    fn a_machine_that_becomes_four_times_slower_is_known_after_three_zones() {
        let mut adaptation = Adaptation::new(AdaptationRule::MedianRatio, RelativePower::new(3.0));
        for _ in 0..8 {
            adaptation.learn(SECOND, SECOND);
        }
        assert_eq!(adaptation.power().get(), 1.0);
        adaptation.learn(90 * SECOND, SECOND);
        assert_eq!(adaptation.power().get(), 1.0, "one outlier is forgiven");
        for _ in 0..3 {
            adaptation.learn(4 * SECOND, SECOND);
        }
        assert_eq!(adaptation.power().get(), 4.0);
    }

    #[test]
    fn nonsense_is_bounded() {
        for value in [f64::NAN, f64::INFINITY, 0.0, -3.0] {
            let power = RelativePower::new(value);
            assert!(power.to_own(SECOND) > Duration::ZERO && power.to_reference(Duration::MAX) > Duration::ZERO);
        }
    }
}
