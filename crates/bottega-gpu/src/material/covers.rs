//! Curves of rough boundaries over matte bases in the layout of `cover.wgsl`, for the roughness that a surface can have.

use bottega_render::bsdf::ggx::SMOOTH_ALPHA;
use bottega_render::bsdf::precomputed::{COVER_NODES, CoverBoundary, cover_alpha, cover_node};
use bottega_scene::{Facets, RoughnessScale};

use super::word_buffer::WordBuffer;
use crate::shared::materials::{CoverBlock, FACETS_ALPHA_MAX};

/// Writes the curves for every roughness that these facets can have. Returns the place of the block.
pub(super) fn add_cover(words: &mut WordBuffer, facets: &Facets, boundaries: &[CoverBoundary], first_step: i32) -> u32 {
    let nodes = match constant_alpha(facets) {
        Some(alpha) => cover_node(alpha)..cover_node(alpha) + 2,
        None => 0..COVER_NODES,
    };
    let place = words.record(&CoverBlock {
        first_node: nodes.start as u32,
        node_count: nodes.len() as u32,
        first_step,
        slot_count: boundaries.len() as u32,
    });
    for boundary in boundaries {
        for node in nodes.clone() {
            // Of two neighbouring curves, use the one of the node itself.
            let [this, next] = boundary.curves(cover_alpha(node));
            words.numbers(if cover_node(cover_alpha(node)) == node { &this } else { &next });
        }
    }
    place
}

/// Returns the mean α of facets whose roughness is constant; `None`: it is textured.
fn constant_alpha(facets: &Facets) -> Option<f32> {
    let [x, y] = facets.roughness.each_ref().map(|roughness| {
        let factor = if roughness.factor.is_finite() { roughness.factor } else { 0.0 };
        let alpha = match facets.scale {
            RoughnessScale::Alpha => factor,
            RoughnessScale::SquareRoot => factor.max(0.0).sqrt(),
            RoughnessScale::Square => factor * factor,
        };
        roughness.texture.is_none().then_some(alpha)
    });
    let (x, y) = (x?, y?);
    if x.max(y) < SMOOTH_ALPHA {
        return Some(0.0);
    }
    let [x, y] = [x, y].map(|alpha| alpha.clamp(SMOOTH_ALPHA, FACETS_ALPHA_MAX));
    Some((x * y).sqrt())
}

/// Returns true if the roughness may vary over the surface.
pub(super) fn is_textured(facets: &Facets) -> bool {
    constant_alpha(facets).is_none()
}

/// Returns true if the facets are smooth everywhere.
pub(super) fn is_smooth(facets: &Facets) -> bool {
    constant_alpha(facets) == Some(0.0)
}
