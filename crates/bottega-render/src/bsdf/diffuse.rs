//! Light without a preferred direction: the diffuse base, and what was scattered more than once between facets.

use std::f32::consts::PI;

use bottega_scene::Spectrum;

use super::tables::{Index, Mu, Rough, Tables};

/// One term color · g(μo) g(μi) / (π (1 − E̅)), g = 1 − E: with colour 1 it reflects exactly what E leaves over.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coupled {
    /// What is reflected of the light that E leaves over.
    pub(super) color: Spectrum,
    /// 1 / (π (1 − E̅)).
    scale: f32,
}

impl Coupled {
    /// `mean`: E̅, the mean of E over the cosine-weighted hemisphere where the light leaves.
    pub(super) fn new(color: Spectrum, mean: f32) -> Self {
        let rest = 1.0 - mean;
        // A layer that loses next to nothing has nothing to give back.
        if rest > 1e-4 { Self { color, scale: 1.0 / (PI * rest) } } else { Self { color: Spectrum::ZERO, scale: 0.0 } }
    }

    pub(super) fn is_black(&self) -> bool {
        self.color == Spectrum::ZERO
    }

    pub(super) fn eval(&self, g_o: f32, g_i: f32) -> Spectrum {
        self.color * (self.scale * g_o * g_i)
    }
}

/// The E of a dielectric over a diffuse base, as a sum of tables: `single` · E₁ + `rise` · Eₛ + `constant`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cover {
    pub(super) single: f32,
    pub(super) rise: f32,
    pub(super) constant: f32,
    /// Whether s is Schlick's weight instead of the exact one (total reflection).
    pub(super) schlick: bool,
}

impl Cover {
    pub(super) fn at(&self, tables: &Tables, mu: Option<Mu>, rough: Rough, index: Index) -> f32 {
        if self.single == 0.0 && self.rise == 0.0 {
            return self.constant;
        }
        let single = self.single * tables.single(mu, rough);
        let rise = if self.schlick { tables.schlick(mu, rough) } else { tables.rise(mu, rough, index) };
        (single + self.rise * rise + self.constant).clamp(0.0, 1.0)
    }
}
