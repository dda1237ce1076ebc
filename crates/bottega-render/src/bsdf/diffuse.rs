//! Light without a preferred direction: the diffuse base, and what was scattered more than once between facets.

use std::f32::consts::PI;

use bottega_scene::Spectrum;

use super::fresnel::DielectricFresnel;

/// One term color · g(μo) g(μi) / (π (1 − E̅)), g = 1 − E: with colour 1 it reflects exactly what E leaves over.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoupledDiffuse {
    /// What is reflected of the light that E leaves over.
    pub(super) color: Spectrum,
    /// 1 / (π (1 − E̅)).
    scale: f32,
    /// Whether what E leaves over is mostly near the horizon, where cosine-weighted samples are rare.
    pub(super) is_grazing: bool,
}

impl CoupledDiffuse {
    pub(super) const BLACK: Self = Self { color: Spectrum::ZERO, scale: 0.0, is_grazing: false };

    /// `mean`: E̅, the mean of E over the cosine-weighted hemisphere where the light leaves.
    pub(super) fn new(color: Spectrum, mean: f32) -> Self {
        let rest = 1.0 - mean;
        // A layer that loses next to nothing has nothing to give back.
        if rest > 1e-4 { Self { color, scale: 1.0 / (PI * rest), is_grazing: rest < 0.1 } } else { Self::BLACK }
    }

    pub(super) fn is_black(&self) -> bool {
        self.color == Spectrum::ZERO
    }

    pub(super) fn eval(&self, g_o: f32, g_i: f32) -> Spectrum {
        self.color * (self.scale * g_o * g_i)
    }
}

/// The E of a dielectric over a diffuse base, of light that it reflects once or more often, in terms of what facets reflect
/// once with F = 1 (`single`) and with F = s (`rise`).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cover {
    single: f32,
    rise: f32,
    constant: f32,
}

impl Cover {
    /// `multiple`: share that is reflected later of what the facets do not reflect once.
    pub(super) fn new(fresnel: &DielectricFresnel, multiple: f32) -> Self {
        // The strongest channel counts for all, lest the base take on the complementary colour.
        let f0 = fresnel.specular * fresnel.f0.max_element();
        Self { single: f0 - multiple, rise: fresnel.specular - f0, constant: multiple }
    }

    pub(super) fn is_constant(&self) -> bool {
        self.single == 0.0 && self.rise == 0.0
    }

    pub(super) fn at(&self, single: f32, rise: f32) -> f32 {
        (self.single * single + self.rise * rise + self.constant).clamp(0.0, 1.0)
    }
}
