//! Cosine lobes of the layered material: the diffuse base, and multiple scattering between facets.

use std::f32::consts::PI;

use bottega_scene::Spectrum;

use super::fresnel::DielectricFresnel;

/// The lobe color · g(μo) g(μi) / (π (1 − E̅)), g = 1 − E: with a white colour it reflects exactly what E leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoupledDiffuse {
    /// Reflected share of the light that E leaves.
    pub(super) color: Spectrum,
    /// 1 / (π (1 − E̅)).
    scale: f32,
    /// `true`: the lobe's light is mostly near the horizon, where cosine-weighted samples are rare.
    pub(super) is_grazing: bool,
}

impl CoupledDiffuse {
    /// A lobe that reflects nothing.
    pub(super) const BLACK: Self = Self { color: Spectrum::ZERO, scale: 0.0, is_grazing: false };

    /// Creates a lobe; `mean`: E̅, the mean of E over the cosine-weighted hemisphere on the side where the light leaves.
    pub(super) fn new(color: Spectrum, mean: f32) -> Self {
        let rest = 1.0 - mean;
        // A layer that loses almost nothing returns nothing
        if rest > 1e-4 { Self { color, scale: 1.0 / (PI * rest), is_grazing: rest < 0.1 } } else { Self::BLACK }
    }

    /// Returns true if the lobe reflects nothing.
    pub(super) fn is_black(&self) -> bool {
        self.color == Spectrum::ZERO
    }

    /// Returns f in sr⁻¹, given 1 − E for both directions.
    pub(super) fn eval(&self, g_o: f32, g_i: f32) -> Spectrum {
        self.color * (self.scale * g_o * g_i)
    }
}

/// The albedo E of a dielectric over a diffuse base, including multiple scattering, as a linear function of the
/// single-scattering albedos with F = 1 (`single`) and with F = s (`rise`).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CoverAlbedo {
    single: f32,
    rise: f32,
    constant: f32,
}

impl CoverAlbedo {
    /// Creates the albedo; `multiple`: share of the light not reflected once that is reflected by multiple scattering.
    pub(super) fn new(fresnel: &DielectricFresnel, multiple: f32) -> Self {
        // Use the strongest channel for all, so that the base does not take on the complementary colour
        let f0 = fresnel.specular * fresnel.f0.max_element();
        Self { single: f0 - multiple, rise: fresnel.specular - f0, constant: multiple }
    }

    /// Returns true if E is the same for all directions.
    pub(super) fn is_constant(&self) -> bool {
        self.single == 0.0 && self.rise == 0.0
    }

    /// Returns E, in [0, 1], given the single-scattering albedos with F = 1 and F = s.
    pub(super) fn at(&self, single: f32, rise: f32) -> f32 {
        (self.single * single + self.rise * rise + self.constant).clamp(0.0, 1.0)
    }
}
