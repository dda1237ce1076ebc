//! The learning of a guide from the vertices of paths.

use std::{cmp::Ordering, ops::Range};

use glam::Vec3;
use rayon::prelude::*;

use super::agent::{DepartingLight, RegionAgent};
use super::directions::{Directions, Pyramid, solid_angle};
use super::tree::{FACES, Guide, GuideNode, LONE, Lattice, Region, Tree};
use crate::lights::{Lights, RequestedLight};

/// Greatest number of vertices per region.
const VERTICES_PER_REGION: usize = 3000;
/// Least number of directions that a region learns from.
const SAMPLES_MIN: usize = 64;
/// Candidate shares of the guide in a region. At most one half: unseen light is then weighted at most twice as much as
/// by the BSDF alone. With 0.8, rare samples five times as bright multiplied the variance
/// (`bench/runs/2026-11-21-transport.txt`).
const SHARES: [f32; 4] = [0.0, 0.2, 0.35, 0.5];
/// Least factor by which mean square times work must fall for a region to be guided.
const GAIN_MIN: f64 = 1.1;
/// Work of a path in vertices: before a vertex, on average; from the next one on; of a ray that misses the scene; and
/// of a guide lookup.
const WORK_BEFORE: f64 = 1.5;
const WORK_AFTER: f64 = 2.0;
const WORK_OF_MISS: f64 = 0.4;
const WORK_OF_GUIDE: f64 = 0.2;

/// A vertex of a learning path on a surface that is not specular.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vertex {
    /// Position, in world space.
    pub(super) p: Vec3,
    /// Facing of the surface; see [`face_of`](super::tree::face_of).
    pub(super) face: u8,
    /// `true`: the next vertex of the list continues the path.
    pub(super) has_next: bool,
    /// Radiance that leaves towards the previous vertex, as this path found it.
    pub(super) leaving: f32,
    /// Factor of radiance from the next vertex: f cos over the density.
    pub(super) weight: f32,
    /// Light found in the direction taken, before the next vertex, times the same factor.
    pub(super) emitted: f32,
    /// Direction taken; `None`: the path ended.
    pub(super) taken: Option<DirectionSample>,
    /// Greatest channel of the light that leaves, relative to the throughput on arrival.
    pub(super) brightness: f32,
    /// Number of vertices from here to the end of the path, including this one.
    pub(super) work: f32,
    /// The light that was sampled here; `None`: none was.
    pub(super) light_sample: Option<RequestedLight>,
}

/// A direction taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DirectionSample {
    /// Cell of the octahedral square.
    pub(super) cell: u16,
    /// Factor by which a density over the square is divided for one per solid angle.
    pub(super) cube: f32,
    /// Density with which the direction was drawn, in sr⁻¹.
    pub(super) pdf: f32,
    /// Density by the BSDF alone, in sr⁻¹.
    pub(super) bsdf_pdf: f32,
}

/// A direction taken, with the mean square of incident light that it represents, per solid angle.
#[derive(Clone, Copy)]
struct WeighedSample {
    taken: DirectionSample,
    square: f32,
    /// `true`: the direction led to another vertex.
    has_next: bool,
}

/// A vertex with its position.
#[derive(Clone, Copy)]
struct VertexPlace {
    p: Vec3,
    vertex: u32,
}

/// A tree over the vertices of one facing.
struct RegionTree {
    nodes: Vec<GuideNode>,
    /// Range of each node in `places`.
    ranges: Vec<Range<usize>>,
    /// Vertices, region by region; within a region in the order of the paths.
    places: Vec<VertexPlace>,
    lattice: Lattice,
}

/// Learns a guide from the vertices of paths, in the order of each path.
///
/// - `lights`: lights of the scene, if agents are learned, too.
pub(super) fn learn(vertices: &[Vertex], lights: Option<&Lights>) -> Guide {
    let mut of_face: [Vec<VertexPlace>; FACES] = Default::default();
    for (vertex, index) in vertices.iter().zip(0..) {
        of_face[usize::from(vertex.face)].push(VertexPlace { p: vertex.p, vertex: index });
    }
    // Grow a tree for each facing
    let lattice = Lattice::over(&vertices.iter().map(|vertex| vertex.p).collect::<Vec<_>>());
    let grown: Vec<RegionTree> = of_face.into_par_iter().map(|places| RegionTree::new(places, lattice)).collect();
    // Average radiance over each region: a single path's value is noisy, the mean of a region blurred
    let mut leaving = vec![0.0; vertices.len()];
    for region in grown.iter().flat_map(RegionTree::regions) {
        let own = |place: &VertexPlace| vertices[place.vertex as usize].leaving;
        let mean = region.iter().map(|place| f64::from(own(place))).sum::<f64>() / region.len() as f64;
        for place in region {
            leaving[place.vertex as usize] = 0.5 * (mean as f32 + own(place));
        }
    }
    // Fill the leaves with directions and agents
    let sample = |place: &VertexPlace| {
        let index = place.vertex as usize;
        let vertex = &vertices[index];
        let next = if vertex.has_next { leaving[index + 1] } else { 0.0 };
        let found = vertex.emitted + vertex.weight * next;
        let taken = vertex.taken?;
        let square = found * found * taken.pdf;
        square.is_finite().then_some(WeighedSample { taken, square, has_next: vertex.has_next })
    };
    let agent = |places: &[VertexPlace]| {
        let all = || places.iter().map(|place| &vertices[place.vertex as usize]);
        let light_samples: Vec<RequestedLight> = all().filter_map(|vertex| vertex.light_sample).collect();
        let left = all().map(|vertex| DepartingLight { brightness: vertex.brightness, work: vertex.work });
        RegionAgent::new(left, lights?.learn(&light_samples))
    };
    Guide::new(lattice, grown.into_par_iter().map(|grown| grown.filled(sample, agent)).collect())
}

impl RegionTree {
    /// Splits space until each part has few vertices.
    fn new(places: Vec<VertexPlace>, lattice: Lattice) -> Self {
        let mut grown = Self { nodes: Vec::new(), ranges: Vec::new(), places, lattice };
        if !grown.places.is_empty() {
            let all = 0..grown.places.len();
            grown.push(all.clone());
            grown.split(0, all, &mut Vec::new());
        }
        grown
    }

    fn push(&mut self, range: Range<usize>) {
        self.nodes.push(GuideNode::UNGUIDED);
        self.ranges.push(range);
    }

    /// Splits a node recursively, near the median of its longest axis.
    fn split(&mut self, at: usize, range: Range<usize>, scratch: &mut Vec<VertexPlace>) {
        /// Number of vertices that the median is estimated from.
        const MEDIAN_OF: usize = 511;
        let part = &mut self.places[range.clone()];
        let (low, high) = bounds(part.iter().map(|place| place.p));
        let axis = (high - low).max_position();
        // The second condition: NaN, or all at one position
        if part.len() <= VERTICES_PER_REGION || low[axis].partial_cmp(&high[axis]) != Some(Ordering::Less) {
            return;
        }
        let mut some: Vec<f32> = part.iter().step_by(part.len() / MEDIAN_OF + 1).map(|place| place.p[axis]).collect();
        let middle = some.len() / 2;
        let (_, &mut median, _) = some.select_nth_unstable_by(middle, f32::total_cmp);
        // Where half of the vertices lie in one plane, split off the others
        let plane = if median > low[axis] { median } else { 0.5 * (low[axis] + high[axis]) };
        let snapped = self.lattice.nearest(axis, plane);
        let plane = if snapped > low[axis] && snapped <= high[axis] { snapped } else { plane };
        // Keep the order: sums must not depend on how the parts were found
        scratch.clear();
        let mut before = 0;
        for i in 0..part.len() {
            if part[i].p[axis] < plane {
                part[before] = part[i];
                before += 1;
            } else {
                scratch.push(part[i]);
            }
        }
        part[before..].copy_from_slice(scratch);
        let (middle, first) = (range.start + before, self.nodes.len());
        self.nodes[at] = GuideNode::split(axis, plane, first);
        self.push(range.start..middle);
        self.push(middle..range.end);
        self.split(first, range.start..middle, scratch);
        self.split(first + 1, middle..range.end, scratch);
    }

    /// Returns the vertices of each leaf.
    fn regions(&self) -> impl Iterator<Item = &[VertexPlace]> {
        let leaves = self.nodes.iter().zip(&self.ranges).filter(|(node, _)| node.as_split().is_none());
        leaves.map(|(_, range)| &self.places[range.clone()]).filter(|places| !places.is_empty())
    }

    /// Learns the regions of all leaves, each from its own samples and from the regions around it.
    fn filled(
        mut self,
        sample: impl Fn(&VertexPlace) -> Option<WeighedSample>,
        agent: impl Fn(&[VertexPlace]) -> Option<RegionAgent>,
    ) -> Tree {
        if self.nodes.is_empty() {
            return Tree::default();
        }
        let leaves = self.nodes.iter().zip(&self.ranges);
        let agents = leaves
            .map(|(node, range)| if node.as_split().is_none() { agent(&self.places[range.clone()]) } else { None })
            .collect();
        // Count the samples up to each vertex
        let (mut samples, mut counts) = (Vec::with_capacity(self.places.len()), vec![0]);
        for place in &self.places {
            samples.extend(sample(place));
            counts.push(samples.len());
        }
        for range in &mut self.ranges {
            *range = counts[range.start]..counts[range.end];
        }
        let mut filling = GrowingTree { agents, tree: Tree::default() };
        self.fill(0, &samples, &LearntRegion::nothing(), &mut filling);
        Tree { nodes: self.nodes, ..filling.tree }
    }

    /// Learns the leaves below a node; `ranges` are those of the samples now.
    fn fill(&mut self, at: usize, samples: &[WeighedSample], around: &LearntRegion, filling: &mut GrowingTree) {
        let seen = &samples[self.ranges[at].clone()];
        // On the heap: trees may be deep
        let here = Box::new(around.within(seen));
        if let Some((_, _, first)) = self.nodes[at].as_split() {
            self.fill(first, samples, &here, filling);
            self.fill(first + 1, samples, &here, filling);
        } else {
            self.nodes[at] = filling.leaf(at, region(&here, seen));
        }
    }
}

/// A tree whose leaves are being learned.
struct GrowingTree {
    /// Agents by node.
    agents: Vec<Option<RegionAgent>>,
    tree: Tree,
}

impl GrowingTree {
    /// Stores region and agent of a leaf, and returns its node.
    fn leaf(&mut self, at: usize, region: Option<Region>) -> GuideNode {
        let (agent, tree) = (self.agents[at], &mut self.tree);
        match (region, agent) {
            (Some(region), agent) => {
                tree.regions.push(region);
                tree.agents.push(agent.unwrap_or_default());
                GuideNode::region(tree.regions.len() - 1)
            }
            (None, Some(agent)) => {
                tree.lone.push(agent);
                GuideNode::region(LONE + tree.lone.len() - 1)
            }
            (None, None) => GuideNode::UNGUIDED,
        }
    }
}

/// Returns the bounds of some positions.
fn bounds(places: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    places.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// Densities of a region from all samples, and from each half of them.
struct LearntRegion {
    whole: Pyramid,
    halves: [Pyramid; 2],
}

impl LearntRegion {
    /// Returns the uniform densities, the prior of a tree's root.
    fn nothing() -> Self {
        Self { whole: Pyramid::uniform(), halves: [Pyramid::uniform(), Pyramid::uniform()] }
    }

    /// Learns a part of this region from its samples, with this region as prior.
    fn within(&self, samples: &[WeighedSample]) -> Self {
        let of_half = |which: usize| Pyramid::learnt(&self.halves[which], weights(half(samples, which)));
        Self { whole: Pyramid::learnt(&self.whole, weights(samples.iter())), halves: [of_half(0), of_half(1)] }
    }
}

/// Returns every other sample.
fn half(samples: &[WeighedSample], which: usize) -> impl Iterator<Item = &WeighedSample> {
    samples.iter().skip(which).step_by(2)
}

/// Returns cells and weights for a [`Pyramid`].
fn weights<'a>(samples: impl Iterator<Item = &'a WeighedSample>) -> impl Iterator<Item = (usize, f32)> {
    samples.map(|sample| (usize::from(sample.taken.cell), sample.square))
}

/// Returns the density that is proportional to the root of the learned mean squares, which minimizes variance.
fn directions(learnt: &Pyramid) -> Option<Directions> {
    Directions::new(&std::array::from_fn(|cell| (learnt.cell(cell) * solid_angle(cell)).sqrt()))
}

/// Learns the share and the directions of a region; `None`: the BSDF alone is as good.
fn region(learnt: &LearntRegion, samples: &[WeighedSample]) -> Option<Region> {
    if samples.len() < SAMPLES_MIN {
        return None;
    }
    // Cross-validate: test the density of each half on the other. A guide that keeps paths in the scene makes them
    // longer
    let (mut squares, mut work) = ([0.0_f64; SHARES.len()], [0.0_f64; SHARES.len()]);
    for which in 0..2 {
        let learnt = directions(&learnt.halves[which])?;
        for WeighedSample { taken, square, has_next } in half(samples, 1 - which) {
            let guided = learnt.weight(usize::from(taken.cell)) / taken.cube;
            let work_after = if *has_next { WORK_AFTER } else { WORK_OF_MISS };
            for (choice, share) in SHARES.into_iter().enumerate() {
                let pdf = taken.bsdf_pdf + share * (guided - taken.bsdf_pdf);
                squares[choice] += f64::from(square / pdf.max(1e-20));
                work[choice] += f64::from(pdf / taken.pdf.max(1e-20)) * work_after;
            }
        }
    }
    // Choose the share with the least mean square times work
    let product = |choice: usize| {
        let of_guide = if choice > 0 { WORK_OF_GUIDE } else { 0.0 };
        squares[choice] * (WORK_BEFORE + of_guide + work[choice] / samples.len() as f64)
    };
    let best = (0..SHARES.len()).min_by(|&a, &b| product(a).total_cmp(&product(b)))?;
    if product(0) < product(best) * GAIN_MIN || product(best) <= 0.0 {
        return None;
    }
    Some(Region { share: SHARES[best], directions: directions(&learnt.whole)? })
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::directions::place_of;
    use super::*;
    use crate::sampling::uniform_sphere;

    /// Vertices on a floor of 2 × 2 from which uniform directions were tried: where x < 0, light comes from around `to`.
    fn vertices(to: Vec3) -> Vec<Vertex> {
        let part = |i: u32, prime: u32| (i * prime % 10_007) as f32 / 10_007.0;
        (0..10_000_u32)
            .map(|i| {
                let p = Vec3::new(2.0 * part(i, 71) - 1.0, 0.0, 2.0 * part(i, 113) - 1.0);
                let w = uniform_sphere([part(i, 1), part(i, 4999)]);
                let (cell, cube) = place_of(w);
                let pdf = 0.25 * std::f32::consts::FRAC_1_PI;
                let emitted = if p.x < 0.0 && w.dot(to) > 0.9 { 1.0 / pdf } else { 0.01 };
                let taken = Some(DirectionSample { cell, cube, pdf, bsdf_pdf: pdf });
                let dark = Vertex {
                    p,
                    face: 2,
                    has_next: false,
                    leaving: 0.0,
                    weight: 0.0,
                    emitted: 0.0,
                    taken: None,
                    brightness: 0.0,
                    work: 1.0,
                    light_sample: None,
                };
                Vertex { emitted, taken, ..dark }
            })
            .collect()
    }

    /// Returns a guide learned from some thousand directions on a floor.
    pub(in super::super) fn example(to: Vec3) -> Guide {
        learn(&vertices(to), None)
    }

    #[test]
    fn directions_are_learnt_where_light_comes_from_them() {
        let to = Vec3::new(0.48, 0.8, 0.36);
        let guide = learn(&vertices(to), None);
        let lit = guide.at(Vec3::new(-0.8, 0.0, 0.3), Vec3::Y).expect("a region");
        assert!(lit.share() >= 0.5 && lit.pdf(to) > 20.0 * lit.pdf(-to), "{} {}", lit.pdf(to), lit.pdf(-to));
        assert!(guide.at(Vec3::new(0.8, 0.0, 0.3), Vec3::Y).is_none(), "uniform light needs no guide");
        assert!(guide.at(Vec3::new(-0.8, 0.0, 0.3), Vec3::X).is_none(), "nothing was seen that faces there");
    }

    #[test]
    fn nothing_is_learnt_from_nothing() {
        assert!(learn(&[], None).at(Vec3::ZERO, Vec3::Y).is_none());
        let dark = vertices(Vec3::Y).into_iter().map(|vertex| Vertex { emitted: 0.0, ..vertex });
        assert!(learn(&dark.collect::<Vec<_>>(), None).at(Vec3::ZERO, Vec3::Y).is_none());
        let one_place = vertices(Vec3::Y).into_iter().map(|vertex| Vertex { p: Vec3::ONE, ..vertex });
        learn(&one_place.collect::<Vec<_>>(), None);
    }
}
