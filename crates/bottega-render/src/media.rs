//! Participating media: transmittance, sampling of distances, phase functions.
//!
//! Parameters: absorption and scattering per unit of length and channel, emission, asymmetry g in (−1, 1) of the phase
//! function. Distances are drawn by the extinction of a channel that is chosen by throughput. Media that vary in space
//! are in [`varying`].
//!
//! Source: Pharr, Jakob and Humphreys 2023, *Physically Based Rendering*, chapter 11.

mod phase;
pub(crate) mod varying;

use bottega_kernels::math;
use bottega_scene::{Medium, Spectrum};

pub(crate) use self::phase::Phase;
use self::varying::Varying;

/// A medium inside a surface, prepared for rendering.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PreparedMedium<'a> {
    Homogeneous(Homogeneous),
    Varying(Varying<'a>),
}

/// A homogeneous medium, prepared for rendering. Coefficients per unit of length.
///
/// Parameters: absorption, scattering, emission per channel; asymmetry g of the Henyey-Greenstein phase function.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Homogeneous {
    /// Extinction σ_t = σ_a + σ_s.
    extinction: Spectrum,
    /// Scattering coefficient σ_s.
    pub(crate) scattering: Spectrum,
    /// Radiance emitted per unit of length, per channel.
    emission: Spectrum,
    /// Henyey-Greenstein phase function.
    pub(crate) phase: Phase,
}

impl Homogeneous {
    /// Prepares a homogeneous medium for evaluation.
    pub(crate) fn new(medium: &Medium) -> Self {
        Self {
            extinction: medium.absorption + medium.scattering,
            scattering: medium.scattering,
            emission: medium.emission,
            phase: Phase { g: medium.g },
        }
    }

    /// Prepares a medium that does not emit, by its coefficients per unit of length and its asymmetry.
    pub(crate) fn of_coefficients(absorption: Spectrum, scattering: Spectrum, g: f32) -> Self {
        Self { extinction: absorption + scattering, scattering, emission: Spectrum::ZERO, phase: Phase { g } }
    }

    /// Returns true if the medium scatters light.
    pub(crate) fn scatters(&self) -> bool {
        self.scattering != Spectrum::ZERO
    }

    /// Returns the single-scattering albedo σ_s / σ_t.
    pub(crate) fn albedo(&self) -> Spectrum {
        self.scattering / self.extinction.max(Spectrum::splat(f32::MIN_POSITIVE))
    }

    /// Returns the transmittance over a distance, which may be infinite (Beer and Lambert).
    pub(crate) fn transmittance(&self, distance: f32) -> Spectrum {
        Spectrum::from_array(self.extinction.to_array().map(|extinction| through(extinction, distance)))
    }

    /// Returns the radiance that the medium emits along a distance. Infinite results become 0.
    pub(crate) fn emitted(&self, distance: f32) -> Spectrum {
        if self.emission == Spectrum::ZERO {
            return Spectrum::ZERO;
        }
        let along = |i: usize| {
            let extinction = self.extinction[i];
            // (1 − e^(−σ d)) / σ, without cancellation at small optical depths
            let depth = extinction * distance;
            let length =
                if depth < 1e-3 { distance * (1.0 - 0.5 * depth) } else { (1.0 - math::exp(-depth)) / extinction };
            let emitted = self.emission[i] * length;
            if emitted.is_finite() { emitted } else { 0.0 }
        };
        Spectrum::new(along(0), along(1), along(2))
    }

    /// Draws the distance to the next collision; infinite if there is none. `channels` are the probabilities of choosing
    /// the channel whose extinction is used; [`Self::distance_pdf`] sums over all channels (one-sample MIS).
    pub(crate) fn sample_distance(&self, channels: Spectrum, u_channel: f32, u: f32) -> f32 {
        let channel = if u_channel < channels.x {
            0
        } else if u_channel < channels.x + channels.y {
            1
        } else {
            2
        };
        let extinction = self.extinction[channel];
        if extinction > 0.0 { -math::ln(1.0 - u) / extinction } else { f32::INFINITY }
    }

    /// Returns the density of a distance drawn by [`Self::sample_distance`].
    pub(crate) fn distance_pdf(&self, channels: Spectrum, distance: f32) -> f32 {
        channels.dot(self.distance_pdfs(distance))
    }

    /// Returns the density of a distance drawn by the extinction of each channel.
    pub(crate) fn distance_pdfs(&self, distance: f32) -> Spectrum {
        self.extinction * self.transmittance(distance)
    }

    /// Returns the probability that [`Self::sample_distance`] exceeds a distance.
    pub(crate) fn survival(&self, channels: Spectrum, distance: f32) -> f32 {
        channels.dot(self.transmittance(distance))
    }
}

fn through(extinction: f32, distance: f32) -> f32 {
    if extinction > 0.0 { math::exp(-extinction * distance) } else { 1.0 }
}

/// Returns the probabilities of choosing a channel, proportional to the throughput.
pub(crate) fn channel_probabilities(throughput: Spectrum) -> Spectrum {
    throughput / throughput.element_sum()
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use glam::Vec3;

    use super::*;
    use crate::{sampler::PixelSampler, sampling::uniform_sphere};

    fn medium() -> Homogeneous {
        Homogeneous::new(&Medium {
            scattering: Spectrum::new(0.5, 2.0, 0.0),
            emission: Spectrum::new(1.0, 2.0, 3.0),
            ..Medium::absorbing(Spectrum::new(0.5, 0.0, 0.0))
        })
    }

    #[test]
    fn directions_are_drawn_by_the_phase_function() {
        const BINS: usize = 20;
        const COUNT: u32 = 40_000;
        for g in [-0.9, -0.3, 0.0, 0.5, 0.95] {
            let phase = Phase { g };
            let axis = Vec3::new(0.6, 0.0, -0.8);
            let mut found = [0.0_f64; BINS];
            let mut mean_cosine = 0.0;
            for i in 0..COUNT {
                let sampler = PixelSampler::new(1, i, 0, 0);
                let (wi, pdf) = phase.sample(axis, [sampler.hashed(1), sampler.hashed(2)]);
                let cosine = wi.dot(axis).clamp(-1.0, 1.0);
                assert!(wi.is_normalized() && (pdf / phase.eval(cosine) - 1.0).abs() < 0.02, "{g} {cosine} {pdf}");
                mean_cosine += f64::from(cosine) / f64::from(COUNT);
                found[((f64::from(cosine) + 1.0) * 0.5 * BINS as f64).min(BINS as f64 - 0.5) as usize] += 1.0;
            }
            assert!((mean_cosine - f64::from(g)).abs() < 0.015, "{g}: {mean_cosine}");
            // The share of cosines below μ, in closed form; χ² with 19 degrees of freedom stays below 56 with 1 − 2e-5.
            let g64 = f64::from(g);
            let below = |mu: f64| {
                if g == 0.0 {
                    return 0.5 * (1.0 + mu);
                }
                (1.0 - g64 * g64) / (2.0 * g64) * (1.0 / (1.0 + g64 * g64 - 2.0 * g64 * mu).sqrt() - 1.0 / (1.0 + g64))
            };
            let bound = |i: usize| -1.0 + 2.0 * i as f64 / BINS as f64;
            let chi_squared: f64 = (0..BINS)
                .map(|i| (found[i], (below(bound(i + 1)) - below(bound(i))) * f64::from(COUNT)))
                .filter(|&(_, expected)| expected > 5.0)
                .map(|(found, expected)| (found - expected).powi(2) / expected)
                .sum();
            assert!(chi_squared < 56.0, "{g}: {chi_squared}");
        }
    }

    #[test]
    fn the_phase_function_sums_up_to_one() {
        for g in [-0.7, 0.0, 0.6] {
            let phase = Phase { g };
            let steps = 40_000;
            let sum: f32 = (0..steps)
                .map(|i| uniform_sphere([(i as f32 + 0.5) / steps as f32, (i * 7919 % steps) as f32 / steps as f32]))
                .map(|d| phase.eval(d.z))
                .sum();
            assert!((sum * 4.0 * PI / steps as f32 - 1.0).abs() < 2e-3, "{g}");
        }
    }

    #[test]
    fn distances_are_drawn_by_their_density_in_all_channels() {
        let medium = medium();
        let channels = channel_probabilities(Spectrum::new(1.0, 2.0, 1.0));
        // Fraction scattered before d, by sampled distances: σ_s / σ_t (1 − e^(−σ_t d))
        let (count, end) = (1 << 16, 0.8_f32);
        let (mut scattered, mut passed) = (Spectrum::ZERO, Spectrum::ZERO);
        for i in 0..count {
            let sampler = PixelSampler::new(2, i, 0, 0);
            let distance = medium.sample_distance(channels, sampler.hashed(1), sampler.hashed(2));
            if distance < end {
                scattered +=
                    medium.transmittance(distance) * medium.scattering / medium.distance_pdf(channels, distance);
            } else {
                passed += medium.transmittance(end) / medium.survival(channels, end);
            }
        }
        let (scattered, passed) = (scattered / count as f32, passed / count as f32);
        let exact = Spectrum::new(0.5 * (1.0 - (-end).exp()), 1.0 - (-2.0 * end).exp(), 0.0);
        assert!((scattered - exact).abs().max_element() < 0.01, "{scattered} {exact}");
        let exact = Spectrum::new((-end).exp(), (-2.0 * end).exp(), 1.0);
        assert!((passed - exact).abs().max_element() < 0.02, "{passed} {exact}");
    }

    #[test]
    fn emission_of_a_medium_is_attenuated_on_its_way() {
        let emitted = medium().emitted(3.0);
        let exact = Spectrum::new(1.0 - (-3.0_f32).exp(), 1.0 - (-6.0_f32).exp(), 9.0);
        assert!((emitted - exact).abs().max_element() < 1e-4, "{emitted} {exact}");
        // Infinite distance: the results are finite
        assert_eq!(medium().emitted(f32::INFINITY), Spectrum::new(1.0, 1.0, 0.0));
        assert_eq!(medium().transmittance(f32::INFINITY), Spectrum::new(0.0, 0.0, 1.0));
    }
}
