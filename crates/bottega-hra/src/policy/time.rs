//! Time as the policy knows it: nanoseconds since the allocator was made, real or virtual.

use std::time::Duration;

/// A moment, in nanoseconds since the start of an allocator; nobody but a driver reads it from a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(u64);

impl Time {
    /// When the allocator was made.
    pub const ZERO: Self = Self(0);
    /// Later than every event; after some 584 years.
    pub const NEVER: Self = Self(u64::MAX);

    /// So many nanoseconds after the start.
    pub const fn from_nanos(nanos: u64) -> Self {
        Self(nanos)
    }

    /// Nanoseconds since the start.
    pub const fn nanos(self) -> u64 {
        self.0
    }

    /// So much time after the start.
    pub fn at(elapsed: Duration) -> Self {
        Self::ZERO.after(elapsed)
    }

    /// Later by `delay`; [`Time::NEVER`] where that is beyond what can be said.
    #[must_use]
    pub fn after(self, delay: Duration) -> Self {
        Self(u64::try_from(delay.as_nanos()).map_or(u64::MAX, |delay| self.0.saturating_add(delay)))
    }

    /// Later by `nanos`, rounded up; a number that is not positive is none.
    #[must_use]
    pub(crate) fn plus_ns(self, nanos: f64) -> Self {
        Self(self.0.saturating_add(nanos.ceil() as u64))
    }

    /// Time since `earlier`; zero if that is not earlier.
    pub fn since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}
