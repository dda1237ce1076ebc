//! Random numbers from a seed.

use bottega_kernels::SplitMix64;

/// A generator of pseudo-random numbers for loads and faults.
#[derive(Clone, Debug)]
pub struct LoadRandom(SplitMix64);

impl LoadRandom {
    /// Makes a generator from a seed; equal seeds give equal numbers.
    pub fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.bits()
    }

    /// Returns a number uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0.unit()
    }

    /// Returns a number uniform in [from, to).
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.uniform()
    }

    /// Returns a log-uniform number in [from, to): as likely between 1 and 10 as between 10 and 100. Both ends must be
    /// positive.
    pub fn by_magnitude(&mut self, from: f64, to: f64) -> f64 {
        from * (to / from).powf(self.uniform())
    }

    /// Returns a whole number from 0 to `end` − 1, uniform for small `end`.
    ///
    /// # Panics
    /// `end` is 0.
    pub fn below(&mut self, end: u64) -> u64 {
        self.bits() % end
    }

    /// Returns true with this probability, 0..=1.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Returns an exponentially distributed number with this mean: the time to the next random event.
    pub fn exponential(&mut self, mean: f64) -> f64 {
        -mean * (1.0 - self.uniform()).ln()
    }
}
