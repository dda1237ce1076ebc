//! The rules for vertices, by the sharpness of the vertices and of their edges.
//!
//! Between the rule of a level and that of the next one weights change with the sharpness that ends there, as in OpenSubdiv
//! (`sdc/crease`).

use super::sharpness::{decayed, is_sharp};
use super::topology::HalfEdges;

/// The rule for a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum VertexRule {
    /// At most one edge is sharp.
    Smooth,
    /// Two edges are sharp: the vertex lies on a curve.
    Crease,
    /// The vertex itself is sharp, or more than two of its edges.
    Corner,
}

impl VertexRule {
    fn new(vertex_sharpness: f32, sharp_edge_count: u32) -> Self {
        match sharp_edge_count {
            _ if is_sharp(vertex_sharpness) => Self::Corner,
            0 | 1 => Self::Smooth,
            2 => Self::Crease,
            _ => Self::Corner,
        }
    }
}

/// The weights of the rules at a vertex. The rest up to 1 is the weight of the corner rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VertexMask {
    pub(super) smooth: f32,
    /// Weight of the crease along the edges that are sharp before the refinement.
    pub(super) crease: f32,
    /// Weight of the crease along the edges that are sharp after it.
    pub(super) later_crease: f32,
    /// Number of edges.
    pub(super) valence: u32,
}

/// Returns the rule for each vertex at this level, and the number of its edges.
pub(super) fn rules(topology: &HalfEdges) -> Vec<(VertexRule, u32)> {
    let mut counts = vec![[0u32; 2]; topology.vertex_count];
    for (edge, &sharpness) in topology.edge_sharpness.iter().enumerate() {
        for end in topology.ends(topology.edges[edge][0]) {
            let [edges, sharp] = &mut counts[end as usize];
            *edges += 1;
            *sharp += u32::from(is_sharp(sharpness));
        }
    }
    let rule = |(&[edges, sharp], &sharpness): (&[u32; 2], &f32)| (VertexRule::new(sharpness, sharp), edges);
    counts.iter().zip(&topology.vertex_sharpness).map(rule).collect()
}

/// Returns the weights of the rules at each vertex for the step to the next level.
pub(super) fn masks(topology: &HalfEdges) -> Vec<VertexMask> {
    #[derive(Clone, Copy, Default)]
    struct EdgeSums {
        all: u32,
        sharp: u32,
        sharp_later: u32,
        /// EdgeSums that are sharp now and smooth later, and the sum of their sharpness.
        ending: u32,
        sum: f32,
    }
    let mut edges_of = vec![EdgeSums::default(); topology.vertex_count];
    for (edge, &sharpness) in topology.edge_sharpness.iter().enumerate() {
        for end in topology.ends(topology.edges[edge][0]) {
            let edges = &mut edges_of[end as usize];
            edges.all += 1;
            if is_sharp(sharpness) {
                edges.sharp += 1;
                if is_sharp(decayed(sharpness)) {
                    edges.sharp_later += 1;
                } else {
                    (edges.ending, edges.sum) = (edges.ending + 1, edges.sum + sharpness);
                }
            }
        }
    }
    let mask = |(edges, &sharpness): (&EdgeSums, &f32)| {
        let now = VertexRule::new(sharpness, edges.sharp);
        let later = VertexRule::new(decayed(sharpness), edges.sharp_later);
        let mut mask = VertexMask { smooth: 0.0, crease: 0.0, later_crease: 0.0, valence: edges.all };
        // The share of the rule of this level falls with the sharpness that ends
        let share = if now == VertexRule::Smooth || now == later {
            1.0
        } else {
            let ends = is_sharp(sharpness) && !is_sharp(decayed(sharpness));
            let sum = edges.sum + if ends { sharpness } else { 0.0 };
            let count = edges.ending + u32::from(ends);
            if count == 0 { 0.0 } else { (sum / count as f32).min(1.0) }
        };
        match now {
            VertexRule::Smooth => mask.smooth += share,
            VertexRule::Crease => mask.crease += share,
            VertexRule::Corner => {}
        }
        match later {
            VertexRule::Smooth => mask.smooth += 1.0 - share,
            VertexRule::Crease => mask.later_crease += 1.0 - share,
            VertexRule::Corner => {}
        }
        mask
    };
    edges_of.iter().zip(&topology.vertex_sharpness).map(mask).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rule_follows_from_the_sharp_edges() {
        assert_eq!(
            [0, 1, 2, 3].map(|count| VertexRule::new(0.0, count)),
            [VertexRule::Smooth, VertexRule::Smooth, VertexRule::Crease, VertexRule::Corner]
        );
        assert_eq!(VertexRule::new(0.1, 0), VertexRule::Corner);
    }
}
