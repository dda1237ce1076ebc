//! Goals of error and time: the fuzzy rules that choose how many more samples to take.

use std::sync::{Arc, LazyLock};

use bottega_fuzzy::{FclError, FunctionBlock};

/// Input: estimated error over the requested error.
const ERROR_RATIO: &str = "error_ratio";
/// Input: remaining share of the requested time.
const TIME_LEFT: &str = "time_left";
/// Output: additional samples, as a share of those the zone has.
const MORE_SAMPLES: &str = "more_samples";
/// Output: share of the remaining time for the next pass.
const TIME_SHARE: &str = "time_share";
/// Maximum of `more_samples`: estimates from few samples do not justify more.
const MORE_SAMPLES_MAX: f64 = 8.0;
/// A zone is finished if `more_samples` is below this.
const MORE_SAMPLES_MIN: f64 = 0.01;

/// The fuzzy rules for goals of error and time; by default those in `rules/goals.fcl`.
#[derive(Clone, Debug)]
pub struct GoalRules(Arc<FunctionBlock>);

impl Default for GoalRules {
    fn default() -> Self {
        static RULES: LazyLock<GoalRules> = LazyLock::new(|| {
            let text = include_str!("../../../rules/goals.fcl");
            GoalRules::parse(text).expect("the built-in rules are valid")
        });
        RULES.clone()
    }
}

impl GoalRules {
    /// Parses rules from FCL text. If the rules lack an output or have an unknown input, defaults count: no more
    /// samples, and 0.75 of the remaining time.
    ///
    /// # Errors
    /// The text is not one valid function block of FCL.
    pub fn parse(text: &str) -> Result<Self, FclError> {
        FunctionBlock::parse(text).map(|block| Self(Arc::new(block)))
    }

    fn output(&self, name: &str, error_ratio: f64, time_left: f64) -> Option<f64> {
        let mut values = vec![(ERROR_RATIO, error_ratio), (TIME_LEFT, time_left)];
        values.retain(|(name, _)| self.0.input_index(name).is_some());
        let value = self.0.evaluate(&values).ok()?.get(name)?;
        value.is_finite().then_some(value)
    }

    /// Returns the number of samples per pixel that a zone should reach next; `samples` if the zone is finished.
    ///
    /// - `samples`, `samples_max`: samples per pixel reached so far, and their maximum.
    /// - `error`: the estimated relative error; `None`: not known yet.
    /// - `error_wanted`: the relative error of the goal.
    pub fn next_samples(&self, samples: u32, samples_max: u32, error: Option<f64>, error_wanted: f64) -> u32 {
        let more = match error {
            Some(error) => self.output(MORE_SAMPLES, error / error_wanted.max(1e-12), 1.0).unwrap_or(0.0),
            None => 1.0,
        };
        if more < MORE_SAMPLES_MIN {
            return samples;
        }
        let more = (f64::from(samples) * more.min(MORE_SAMPLES_MAX)).ceil() as u32;
        samples.saturating_add(more.max(1)).min(samples_max)
    }

    /// Returns the share of the remaining time for the next pass, 0.05..=1.
    ///
    /// - `time_left`: remaining share of the requested time, 0..=1.
    pub fn time_share(&self, time_left: f64) -> f64 {
        self.output(TIME_SHARE, 1.0, time_left).unwrap_or(0.75).clamp(0.05, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zone_is_finished_when_its_error_is_met_and_gets_more_the_further_it_is() {
        let rules = GoalRules::default();
        assert_eq!(rules.next_samples(64, 4096, Some(0.05), 0.05), 64);
        assert_eq!(rules.next_samples(64, 4096, Some(0.0), 0.05), 64);
        let steps = [0.051, 0.06, 0.07, 0.1, 0.2, 5.0].map(|error| rules.next_samples(64, 4096, Some(error), 0.05));
        assert!(steps.is_sorted() && steps[0] > 64 && steps[5] == 256, "{steps:?}");
        assert_eq!(rules.next_samples(64, 100, Some(5.0), 0.05), 100, "never above what is allowed");
        assert_eq!(rules.next_samples(8, 4096, None, 0.05), 16);
    }

    #[test]
    fn the_first_pass_keeps_half_and_the_last_takes_all() {
        let rules = GoalRules::default();
        let shares = [1.0, 0.5, 0.05].map(|left| rules.time_share(left));
        assert_eq!((shares[0], shares[2]), (0.5, 1.0));
        assert!(shares[1] > 0.5 && shares[1] < 1.0);
    }
}
