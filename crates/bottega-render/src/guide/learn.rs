//! From the vertices of paths to a guide.

use glam::Vec3;
use rayon::prelude::*;

use super::directions::{Directions, Pyramid, solid_angle};
use super::tree::{FACES, Guide, Node, Region, Tree};

/// Vertices from which one region learns, at most.
const VERTICES_PER_REGION: usize = 1200;
/// Shares of the guide that a region may choose between.
const SHARES: [f32; 6] = [0.0, 0.2, 0.35, 0.5, 0.65, 0.8];
/// By what factor the mean square must fall for the guide to be worth its time.
const GAIN_MIN: f32 = 1.05;

/// A vertex of a path where it could have gone elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vertex {
    pub(super) p: Vec3,
    /// See [`face_of`](super::tree::face_of).
    pub(super) face: u8,
    /// Whether the path went on from here to the next vertex of the list.
    pub(super) has_next: bool,
    /// Radiance found to leave towards where the path came from.
    pub(super) leaving: f32,
    /// What a unit of radiance from the next vertex counts for here: f cos over the density.
    pub(super) weight: f32,
    /// What was found in that direction before the next vertex, times the same.
    pub(super) emitted: f32,
    /// The direction taken; `None`: the path ended.
    pub(super) taken: Option<Taken>,
}

/// A direction taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Taken {
    /// Where on the square of directions it is.
    pub(super) cell: u16,
    /// What a density over the square is to be divided by for one per solid angle.
    pub(super) cube: f32,
    /// Density with which it was drawn.
    pub(super) pdf: f32,
    /// Density with which the BSDF alone draws it.
    pub(super) bsdf_pdf: f32,
}

/// A direction taken, and what it was worth: the mean square that it stands for, per solid angle.
#[derive(Clone, Copy)]
struct Sample {
    taken: Taken,
    square: f32,
}

/// Learns from the vertices of paths, each path's in its order.
pub(super) fn learn(vertices: &[Vertex]) -> Guide {
    let of_face: Vec<Vec<u32>> = (0..FACES)
        .map(|face| (0..vertices.len() as u32).filter(|&v| usize::from(vertices[v as usize].face) == face).collect())
        .collect();
    let grown: Vec<(Tree, Vec<(u32, f32)>)> = of_face.par_iter().map(|part| grow(vertices, part.clone())).collect();
    // What leaves a vertex is known from one path, and badly; what leaves its region, from many, but blurred.
    let mut leaving = vec![0.0; vertices.len()];
    for &(vertex, mean) in grown.iter().flat_map(|(_, leaving)| leaving) {
        leaving[vertex as usize] = 0.5 * (mean + vertices[vertex as usize].leaving);
    }
    let sample = |(index, vertex): (usize, &Vertex)| {
        let next = if vertex.has_next { leaving[index + 1] } else { 0.0 };
        let found = vertex.emitted + vertex.weight * next;
        let taken = vertex.taken?;
        let square = found * found * taken.pdf;
        square.is_finite().then_some(Sample { taken, square })
    };
    let samples: Vec<Option<Sample>> = vertices.iter().enumerate().map(sample).collect();
    let mut trees = grown.into_iter().map(|(tree, _)| tree).zip(of_face).collect::<Vec<_>>();
    trees.par_iter_mut().for_each(|(tree, part)| {
        if !tree.nodes.is_empty() {
            fill(tree, 0, vertices, &samples, std::mem::take(part), &Learnt::nothing());
        }
    });
    let mut guide = Guide::default();
    for (place, (tree, _)) in guide.trees.iter_mut().zip(trees) {
        *place = tree;
    }
    guide
}

/// Cuts space until each part has few vertices. Also returns for each vertex the mean of what leaves its part.
fn grow(vertices: &[Vertex], part: Vec<u32>) -> (Tree, Vec<(u32, f32)>) {
    let (mut tree, mut leaving) = (Tree::default(), Vec::with_capacity(part.len()));
    if !part.is_empty() {
        tree.nodes.push(Node::Unguided);
        split(&mut tree, 0, vertices, part, &mut leaving);
    }
    (tree, leaving)
}

fn split(tree: &mut Tree, at: usize, vertices: &[Vertex], part: Vec<u32>, leaving: &mut Vec<(u32, f32)>) {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &vertex in &part {
        let p = vertices[vertex as usize].p;
        (low, high) = (low.min(p), high.max(p));
    }
    let axis = (high - low).max_position();
    if part.len() > VERTICES_PER_REGION && low[axis] < high[axis] {
        let mut places: Vec<f32> = part.iter().map(|&vertex| vertices[vertex as usize].p[axis]).collect();
        let middle = places.len() / 2;
        let (_, &mut median, _) = places.select_nth_unstable_by(middle, f32::total_cmp);
        // Where half of them lie in one plane, it is the others that are cut off.
        let plane = if median > low[axis] { median } else { 0.5 * (low[axis] + high[axis]) };
        let (before, after) = halves(vertices, part, axis, plane);
        let first = tree.nodes.len();
        tree.nodes[at] = Node::Split { axis: axis as u8, plane, first: first as u32 };
        tree.nodes.extend([Node::Unguided; 2]);
        if !before.is_empty() {
            split(tree, first, vertices, before, leaving);
        }
        split(tree, first + 1, vertices, after, leaving);
        return;
    }
    let sum: f64 = part.iter().map(|&vertex| f64::from(vertices[vertex as usize].leaving)).sum();
    let mean = (sum / part.len() as f64) as f32;
    leaving.extend(part.into_iter().map(|vertex| (vertex, mean)));
}

/// Those before a plane and the others; the order is kept, so that sums do not depend on how a part was found.
fn halves(vertices: &[Vertex], part: Vec<u32>, axis: usize, plane: f32) -> (Vec<u32>, Vec<u32>) {
    part.into_iter().partition(|&vertex| vertices[vertex as usize].p[axis] < plane)
}

/// Makes the regions of a tree, each from its own samples and from what is known `around`.
fn fill(tree: &mut Tree, at: usize, vertices: &[Vertex], samples: &[Option<Sample>], part: Vec<u32>, around: &Learnt) {
    let seen: Vec<Sample> = part.iter().filter_map(|&vertex| samples[vertex as usize]).collect();
    let here = around.within(&seen);
    if let Node::Split { axis, plane, first } = tree.nodes[at] {
        let (before, after) = halves(vertices, part, usize::from(axis), plane);
        fill(tree, first as usize, vertices, samples, before, &here);
        fill(tree, first as usize + 1, vertices, samples, after, &here);
    } else if let Some(region) = region(&here, &seen) {
        tree.nodes[at] = Node::Region(tree.regions.len() as u32);
        tree.regions.push(region);
    }
}

/// What is known of a region from all samples, and from each half of them.
struct Learnt {
    whole: Pyramid,
    halves: [Pyramid; 2],
}

impl Learnt {
    fn nothing() -> Self {
        Self { whole: Pyramid::uniform(), halves: [Pyramid::uniform(), Pyramid::uniform()] }
    }

    fn within(&self, samples: &[Sample]) -> Self {
        let of_half = |which: usize| Pyramid::learnt(&self.halves[which], weights(half(samples, which)));
        Self { whole: Pyramid::learnt(&self.whole, weights(samples.iter())), halves: [of_half(0), of_half(1)] }
    }
}

/// Every other sample.
fn half(samples: &[Sample], which: usize) -> impl Iterator<Item = &Sample> {
    samples.iter().skip(which).step_by(2)
}

/// What a [`Pyramid`] is made of.
fn weights<'a>(samples: impl Iterator<Item = &'a Sample>) -> impl Iterator<Item = (usize, f32)> {
    samples.map(|sample| (usize::from(sample.taken.cell), sample.square))
}

/// The density that serves best where mean squares are as in `learnt`: it goes with their root.
fn directions(learnt: &Pyramid) -> Option<Directions> {
    Directions::new(&std::array::from_fn(|cell| (learnt.cell(cell) * solid_angle(cell)).sqrt()))
}

/// `None` where the BSDF is as good a guide.
fn region(learnt: &Learnt, samples: &[Sample]) -> Option<Region> {
    // What one half has learnt is tried on the other.
    let mut squares = [0.0_f64; SHARES.len()];
    for which in 0..2 {
        let learnt = directions(&learnt.halves[which])?;
        for Sample { taken, square } in half(samples, 1 - which) {
            let guided = learnt.weight(usize::from(taken.cell)) / taken.cube;
            for (sum, share) in squares.iter_mut().zip(SHARES) {
                let pdf = taken.bsdf_pdf + share * (guided - taken.bsdf_pdf);
                *sum += f64::from(square / pdf.max(1e-20));
            }
        }
    }
    let (best, least) = squares.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
    if squares[0] < least * f64::from(GAIN_MIN) || *least <= 0.0 {
        return None;
    }
    Some(Region { share: SHARES[best], directions: directions(&learnt.whole)? })
}

#[cfg(test)]
mod tests {
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
                let taken = Some(Taken { cell, cube, pdf, bsdf_pdf: pdf });
                Vertex { p, face: 2, has_next: false, leaving: 0.0, weight: 0.0, emitted, taken }
            })
            .collect()
    }

    #[test]
    fn directions_are_learnt_where_light_comes_from_them() {
        let to = Vec3::new(0.48, 0.8, 0.36);
        let guide = learn(&vertices(to));
        let lit = guide.at(Vec3::new(-0.8, 0.0, 0.3), Vec3::Y).expect("a region");
        assert!(lit.share() >= 0.5 && lit.pdf(to) > 20.0 * lit.pdf(-to), "{} {}", lit.pdf(to), lit.pdf(-to));
        assert!(guide.at(Vec3::new(0.8, 0.0, 0.3), Vec3::Y).is_none(), "uniform light needs no guide");
        assert!(guide.at(Vec3::new(-0.8, 0.0, 0.3), Vec3::X).is_none(), "nothing was seen that faces there");
    }

    #[test]
    fn nothing_is_learnt_from_nothing() {
        assert!(learn(&[]).at(Vec3::ZERO, Vec3::Y).is_none());
        let dark = vertices(Vec3::Y).into_iter().map(|vertex| Vertex { emitted: 0.0, ..vertex });
        assert!(learn(&dark.collect::<Vec<_>>()).at(Vec3::ZERO, Vec3::Y).is_none());
        let one_place = vertices(Vec3::Y).into_iter().map(|vertex| Vertex { p: Vec3::ONE, ..vertex });
        learn(&one_place.collect::<Vec<_>>());
    }
}
