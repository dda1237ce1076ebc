//! Random numbers for the built-in scenes and their rays.

use bottega_kernels::math;
use glam::Vec3;

/// A stream of pseudo-random numbers in [0, 1): PCG (O'Neill 2014).
pub(crate) struct Random(u64);

impl Random {
    /// Creates the stream of a seed.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(1))
    }

    /// Returns the next number.
    pub(crate) fn unit(&mut self) -> f32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let bits = (((old >> 18) ^ old) >> 27) as u32;
        (bits.rotate_right((old >> 59) as u32) >> 8) as f32 / 16_777_216.0
    }

    /// Returns a number between two.
    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Samples a direction around `n`, with a density proportional to its cosine.
    pub(crate) fn cosine(&mut self, n: Vec3) -> Vec3 {
        let (t, b) = n.any_orthonormal_pair();
        let (s, c) = math::sin_cos(std::f32::consts::TAU * self.unit());
        let r2 = self.unit();
        let r = r2.sqrt();
        t * (r * c) + b * (r * s) + n * (1.0 - r2).max(0.0).sqrt()
    }
}
