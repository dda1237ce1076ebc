//! Time in the policy: nanoseconds since the allocator was made, real or virtual.

use std::time::Duration;

/// A moment, in nanoseconds since the allocator was made; only drivers read a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(u64);

impl Time {
    /// The moment at which the allocator was made.
    pub const ZERO: Self = Self(0);
    /// A moment later than every event: about 584 years after the start.
    pub const NEVER: Self = Self(u64::MAX);

    /// Makes the moment this many nanoseconds after the allocator was made.
    pub const fn from_nanos(nanos: u64) -> Self {
        Self(nanos)
    }

    /// Returns the nanoseconds since the allocator was made.
    pub const fn nanos(self) -> u64 {
        self.0
    }

    /// Makes the moment this long after the allocator was made, at most [`Time::NEVER`].
    pub fn at(elapsed: Duration) -> Self {
        Self::ZERO.after(elapsed)
    }

    /// Returns the moment later by `delay`, at most [`Time::NEVER`].
    #[must_use]
    pub fn after(self, delay: Duration) -> Self {
        Self(u64::try_from(delay.as_nanos()).map_or(u64::MAX, |delay| self.0.saturating_add(delay)))
    }

    /// Returns the moment later by `nanos`, rounded up; numbers that are not positive count as 0.
    #[must_use]
    pub(crate) fn plus_ns(self, nanos: f64) -> Self {
        Self(self.0.saturating_add(nanos.ceil() as u64))
    }

    /// Returns the time from `earlier` to this moment; zero if `earlier` is later.
    pub fn since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }
}
