//! Suspension after failures.

use std::time::Duration;

use crate::HraConfig;

/// Number of consecutive failures, and the resulting suspensions.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Backoff {
    failures: u32,
}

impl Backoff {
    pub(crate) fn succeeded(&mut self) {
        self.failures = 0;
    }

    /// Returns true if the resource has failed since its last success.
    pub(crate) fn has_failed(&self) -> bool {
        self.failures > 0
    }

    /// Returns the suspension after one more failure: twice the one before. `None`: too many failures.
    pub(crate) fn failed(&mut self, config: &HraConfig) -> Option<Duration> {
        self.failures = self.failures.saturating_add(1);
        (self.failures < config.max_failures).then(|| self.pause(config))
    }

    /// Returns the suspension after one more doubt: as after a failure, but without a maximum number.
    pub(crate) fn doubted(&mut self, config: &HraConfig) -> Duration {
        self.failures = self.failures.saturating_add(1).min(config.max_failures.saturating_sub(1)).max(self.failures);
        self.pause(config)
    }

    fn pause(self, config: &HraConfig) -> Duration {
        let doublings = self.failures.saturating_sub(1).min(31);
        config.pause_min.saturating_mul(1 << doublings).min(config.pause_max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest_and_end_in_giving_up() {
        let config = HraConfig {
            pause_min: Duration::from_millis(1),
            pause_max: Duration::from_millis(6),
            max_failures: 6,
            ..HraConfig::default()
        };
        let mut backoff = Backoff::default();
        let pauses: Vec<_> = (0..6).map(|_| backoff.failed(&config).map(|pause| pause.as_millis())).collect();
        assert_eq!(pauses, [Some(1), Some(2), Some(4), Some(6), Some(6), None]);
        backoff.succeeded();
        assert_eq!(backoff.failed(&config), Some(Duration::from_millis(1)));
        // Doubts alone never do.
        let pauses: Vec<_> = (0..9).map(|_| backoff.doubted(&config).as_millis()).collect();
        assert_eq!(pauses, [2, 4, 6, 6, 6, 6, 6, 6, 6]);
    }
}
