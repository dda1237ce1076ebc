//! The tables of scattering, for devices that scatter by themselves.

use bottega_scene::{Distribution, Shadowing};

use super::cover::{self, Cover, Mean};
use super::tables::{self, Tables};

/// Numbers of an albedo curve: by the cosine (nodes even in its root), their mean over the cosine-weighted hemisphere, and
/// their peak.
pub const ALBEDO_CURVE: usize = tables::CURVE;

/// Directional albedos of the layered material, curve by curve, roughness (nodes even in its root) running faster than index
/// of refraction: facets with F = 1, with Schlick's weight, with the rise of the exact Fresnel term by index, the boundary of
/// a solid by index from outside and from within, and sheen.
pub fn albedo_curves() -> impl Iterator<Item = [f32; ALBEDO_CURVE]> {
    Tables::get().curves()
}

/// Numbers of a cover curve: what reaches the base by the cosine (nodes even in it), and what comes back to the base.
pub const COVER_CURVE: usize = cover::COSINES + 1;
/// Nodes of the roughness α of a cover, even in its root from 0 to 1.
pub const COVER_NODES: usize = cover::ROUGHNESS;

/// A rough dielectric boundary over a matte base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoverBoundary {
    /// Of its facets.
    pub distribution: Distribution,
    /// Of its facets.
    pub shadowing: Shadowing,
    /// Index of refraction of the layer over that of the outside.
    pub eta: f32,
    /// Of the layer, in mean free paths.
    pub thickness: f32,
    /// Whether the mean of what comes back is Mitsuba's (of plastic), or exact (of coats).
    pub is_plastic: bool,
}

impl CoverBoundary {
    /// The curves of the node at or below a roughness `alpha`, and of the next one.
    pub fn curves(&self, alpha: f32) -> [[f32; COVER_CURVE]; 2] {
        let mean = if self.is_plastic { Mean::Nodes } else { Mean::Exact };
        Cover::new(self.distribution, self.shadowing, self.eta, alpha, self.thickness, mean).curves()
    }
}

/// The node at or below a roughness `alpha`.
pub fn cover_node(alpha: f32) -> usize {
    cover::place(alpha).0
}

/// The roughness α of a node.
pub fn cover_alpha(node: usize) -> f32 {
    cover::alpha_of(node)
}
