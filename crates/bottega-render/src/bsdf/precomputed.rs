//! Tables of scattering for devices that shade by themselves.

use bottega_scene::{Distribution, Shadowing};

use super::cover::{self, Mean, RoughCover};
use super::tables::{self, Tables};

/// Number of values of an albedo curve: by cosine (nodes uniform in its root), the mean over the cosine-weighted
/// hemisphere, the peak.
pub const ALBEDO_CURVE: usize = tables::CURVE;

/// Returns the directional albedos of the layered material, curve by curve; roughness (nodes uniform in its root) varies
/// faster than index of refraction. In order: facets with F = 1, with Schlick's weight, with the rise of the exact
/// Fresnel term by index, the boundary of a solid by index from outside and from within, and sheen.
pub fn albedo_curves() -> impl Iterator<Item = [f32; ALBEDO_CURVE]> {
    Tables::get().curves()
}

/// Number of values of a cover curve: share that reaches the base by cosine (uniform nodes), share that returns to the
/// base.
pub const COVER_CURVE: usize = cover::COSINES + 1;
/// Number of nodes over the roughness α of a cover, uniform in √α from 0 to 1.
pub const COVER_NODES: usize = cover::ROUGHNESS;

/// A rough dielectric boundary over a matte base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoverBoundary {
    /// Distribution of the facets' normals.
    pub distribution: Distribution,
    /// Masking and shadowing of the facets.
    pub shadowing: Shadowing,
    /// Index of refraction of the layer over that of the outside.
    pub eta: f32,
    /// Thickness of the layer, in mean free paths.
    pub thickness: f32,
    /// `true`: the mean of the returned light is Mitsuba's (plastic); `false`: an accurate integral (coats).
    pub is_plastic: bool,
}

impl CoverBoundary {
    /// Returns the curves of the node at or below a roughness, and of the next one.
    ///
    /// - `alpha`: roughness α of the boundary; clamped to [0, 1].
    pub fn curves(&self, alpha: f32) -> [[f32; COVER_CURVE]; 2] {
        let mean = if self.is_plastic { Mean::Nodes } else { Mean::Exact };
        RoughCover::new(self.distribution, self.shadowing, self.eta, alpha, self.thickness, mean).curves()
    }
}

/// Returns the index of the node at or below a roughness `alpha`, from 0 to [`COVER_NODES`] − 2, so that there is a
/// next one.
pub fn cover_node(alpha: f32) -> usize {
    cover::place(alpha).0
}

/// Returns the roughness α of the node with an index from 0 to [`COVER_NODES`] − 1.
pub fn cover_alpha(node: usize) -> f32 {
    cover::alpha_of(node)
}
