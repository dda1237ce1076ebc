//! SplitMix64, a pseudo-random number generator.

/// The golden ratio as a fraction of 2⁶⁴: the step of the state.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A generator of pseudo-random numbers (Steele, Lea and Flood 2014, *Fast Splittable Pseudorandom Number Generators*).
/// Equal seeds give equal numbers on all platforms.
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// Makes a generator from a seed.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns the next 64 bits.
    #[inline(always)]
    pub const fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix64(self.0)
    }

    /// Returns the next number in [0, 1), a multiple of 2⁻⁵³.
    #[inline(always)]
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns the next number in [0, 1), a multiple of 2⁻²⁴.
    #[inline(always)]
    pub fn unit_f32(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1_u32 << 24) as f32
    }
}

/// Returns 64 bits mixed by a bijection: the finalizer of SplitMix64.
#[inline(always)]
pub const fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_that_of_the_reference() {
        // Of Vigna's splitmix64.c with the state 1234567.
        let mut numbers = SplitMix64::new(1_234_567);
        let expected = [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423];
        assert_eq!([numbers.bits(), numbers.bits(), numbers.bits()], expected);
    }

    #[test]
    fn units_fill_the_interval_from_0_to_1() {
        let mut numbers = SplitMix64::new(7);
        let units: Vec<f64> = (0..4096).map(|_| numbers.unit()).collect();
        assert!(units.iter().all(|unit| (0.0..1.0).contains(unit)));
        assert!((units.iter().sum::<f64>() / 4096.0 - 0.5).abs() < 0.02);
        assert!((0..4096).all(|_| (0.0..1.0).contains(&numbers.unit_f32())));
    }
}
