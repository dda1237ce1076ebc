//! The photon map: a balanced kd-tree without pointers. Its leaves are buckets of sixteen photons, tested at once.
//!
//! Sources: Bentley 1975, *Multidimensional binary search trees*; buckets and incremental distances to cells as in Arya
//! and Mount 1993, *Algorithms for fast vector quantization*.

use glam::Vec3;
use rayon::prelude::*;

use super::record::{Mark, Photon};

/// Photons per leaf.
const BUCKET: usize = 16;
/// Size of the traversal stack: greater than the depth of any tree.
const DEPTH_MAX: usize = 40;
/// Greatest number of photons that [`Nearest`] holds.
pub const NEAREST_MAX: usize = 512;

/// Photons in a kd-tree, each with a number from 0. The tree depends only on the photons and their order, not on the
/// number of threads.
#[derive(Clone, Debug, Default)]
pub struct PhotonMap {
    /// Inner nodes, starting at index 1; the children of node i are 2i and 2i + 1.
    nodes: Vec<PhotonPlane>,
    /// Positions: x, y and z of each bucket; unused entries of the last bucket are infinite.
    places: Vec<[[f32; BUCKET]; 3]>,
    /// Data of the photons, in the order of their numbers.
    marks: Vec<Mark>,
    /// Index of the first node of the deepest level.
    deepest: usize,
}

/// A splitting plane.
#[derive(Clone, Copy, Debug, Default)]
struct PhotonPlane {
    plane: f32,
    axis: u32,
}

impl PhotonMap {
    /// Builds the tree on the current thread pool. Photons are numbered in the order of the tree's leaves; those whose
    /// position is not finite are dropped.
    pub fn new(mut photons: Vec<Photon>) -> Self {
        photons.retain(|photon| photon.p.is_finite());
        let leaves = photons.len().div_ceil(BUCKET);
        if leaves == 0 {
            return Self::default();
        }
        let mut nodes = vec![PhotonPlane::default()];
        // Split level by level, from left to right: the order of the node indices
        let mut level = vec![(photons.as_mut_slice(), leaves)];
        while level.iter().any(|&(_, leaves)| leaves > 1) {
            let cut = level.into_par_iter().map(split).collect::<Vec<_>>();
            level = Vec::with_capacity(2 * cut.len());
            for (node, parts) in cut {
                nodes.extend(node);
                level.extend(parts);
            }
        }
        let at: Vec<Vec3> = photons.iter().map(|photon| photon.p).collect();
        Self::laid_out(nodes, &at, photons.iter().map(Photon::mark).collect())
    }

    /// Returns plane position and axis of all inner nodes, in the order of their indices.
    pub(crate) fn planes(&self) -> impl Iterator<Item = (f32, u32)> + '_ {
        self.nodes.iter().skip(1).map(|node| (node.plane, node.axis))
    }

    /// Returns the number of planes for a number of photons.
    pub(crate) fn plane_count(photons: usize) -> usize {
        photons.div_ceil(BUCKET).saturating_sub(1)
    }

    /// Builds a map from planes and photons in its order; `None`: not valid.
    pub(crate) fn from_parts(planes: Vec<(f32, u32)>, photons: Vec<(Vec3, [u32; 3])>) -> Option<Self> {
        let is_sound = planes.iter().all(|&(_, axis)| axis < 3) && planes.len() == Self::plane_count(photons.len());
        if !is_sound || photons.is_empty() {
            return is_sound.then(Self::default);
        }
        let nodes = planes.into_iter().map(|(plane, axis)| PhotonPlane { plane, axis });
        let nodes = std::iter::once(PhotonPlane::default()).chain(nodes).collect();
        let (at, marks): (Vec<Vec3>, Vec<Mark>) =
            photons.into_iter().map(|(p, numbers)| (p, Mark::from_numbers(numbers))).unzip();
        Some(Self::laid_out(nodes, &at, marks))
    }

    /// Creates a map from a balanced tree.
    ///
    /// - `at`: positions in the order of the photons' numbers; at least one.
    fn laid_out(nodes: Vec<PhotonPlane>, at: &[Vec3], marks: Vec<Mark>) -> Self {
        let leaves = at.len().div_ceil(BUCKET);
        let mut places = vec![[[f32::INFINITY; BUCKET]; 3]; leaves];
        for (i, p) in at.iter().enumerate() {
            for (along, place) in places[i / BUCKET].iter_mut().zip(p.to_array()) {
                along[i % BUCKET] = place;
            }
        }
        Self { nodes, places, marks, deepest: 1 << (2 * leaves - 1).ilog2() }
    }

    /// Returns the number of photons.
    pub fn len(&self) -> usize {
        self.marks.len()
    }

    /// Returns `true` if there are no photons.
    pub fn is_empty(&self) -> bool {
        self.marks.is_empty()
    }

    /// Returns the memory of the tree and its photons, in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.places) + size_of_val(&*self.marks)
    }

    /// Returns the photon with a number from 0.
    ///
    /// # Panics
    ///
    /// If there is no such photon.
    #[inline(always)]
    pub fn photon(&self, index: u32) -> Photon {
        let (bucket, lane) = (index as usize / BUCKET, index as usize % BUCKET);
        Photon::of(Vec3::from_array(self.places[bucket].map(|along| along[lane])), self.marks[index as usize])
    }

    /// Returns the data of the photon with a number from 0, without the position.
    ///
    /// # Panics
    ///
    /// If there is no such photon.
    #[inline(always)]
    pub fn mark(&self, index: u32) -> Mark {
        self.marks[index as usize]
    }

    /// Returns this map with other tags.
    #[must_use]
    pub(crate) fn retagged(mut self, tag: impl Fn(u32) -> u32) -> Self {
        self.marks.iter_mut().for_each(|mark| *mark = mark.with_tag(tag(mark.tag())));
        self
    }

    /// Returns an iterator over all photons, in the order of their numbers.
    pub fn iter(&self) -> impl Iterator<Item = Photon> + '_ {
        (0..self.len() as u32).map(|index| self.photon(index))
    }

    /// Finds the photons nearest to a point within a radius, as many as `found` holds.
    ///
    /// - `p`: the point, in world space.
    /// - `radius_squared`: squared radius; photons at exactly this distance do not count.
    /// - `found`: overwritten.
    #[inline(always)]
    pub fn nearest(&self, p: Vec3, radius_squared: f32, found: &mut Nearest) {
        found.clear();
        if found.limit == 0 {
            return;
        }
        self.visit(p, radius_squared, |first, distances, bound| {
            let mut bound = bound;
            let mut near = below(distances, bound);
            while near != 0 {
                let lane = near.trailing_zeros();
                near &= near - 1;
                let distance = distances[lane as usize];
                if distance < bound {
                    bound = found.push(first + lane, distance, bound);
                }
            }
            bound
        });
    }

    /// Calls `take` with the number and the squared distance of each photon within a radius around `p`; photons at
    /// exactly this distance do not count.
    #[inline(always)]
    pub fn within(&self, p: Vec3, radius_squared: f32, mut take: impl FnMut(u32, f32)) {
        self.visit(p, radius_squared, |first, distances, bound| {
            let mut near = below(distances, bound);
            while near != 0 {
                let lane = near.trailing_zeros();
                near &= near - 1;
                take(first + lane, distances[lane as usize]);
            }
            bound
        });
    }

    /// Returns the number of the photon nearest to `p` within a radius for which `accept`, called with numbers, returns
    /// `true`; `None`: there is none.
    #[inline(always)]
    pub fn nearest_where(&self, p: Vec3, radius_squared: f32, mut accept: impl FnMut(u32) -> bool) -> Option<u32> {
        let mut best = None;
        self.visit(p, radius_squared, |first, distances, bound| {
            let mut bound = bound;
            let mut near = below(distances, bound);
            while near != 0 {
                let lane = near.trailing_zeros();
                near &= near - 1;
                if distances[lane as usize] < bound && accept(first + lane) {
                    bound = distances[lane as usize];
                    best = Some(first + lane);
                }
            }
            bound
        });
        best
    }

    /// Visits the buckets within a radius, nearer sides first. `look` receives the number of a bucket's first photon,
    /// the squared distances and the squared radius, and returns the squared radius from then on.
    #[inline(always)]
    fn visit(&self, p: Vec3, radius_squared: f32, mut look: impl FnMut(u32, &[f32; BUCKET], f32) -> f32) {
        let leaves = self.places.len();
        if leaves == 0 {
            return;
        }
        let mut bound = radius_squared;
        let mut waiting = [(0_u32, [0.0_f32; 3]); DEPTH_MAX];
        let mut waiting_count = 0;
        let (mut number, mut off) = (1_usize, [0.0_f32; 3]);
        loop {
            // Descend to the nearer leaf; push far children within the radius
            while number < leaves {
                let PhotonPlane { plane, axis } = self.nodes[number];
                let axis = axis as usize;
                let beyond = p[axis] - plane;
                let near = 2 * number + usize::from(beyond >= 0.0);
                let mut far_off = off;
                far_off[axis] = beyond * beyond;
                if far_off[0] + far_off[1] + far_off[2] < bound {
                    waiting[waiting_count] = ((near ^ 1) as u32, far_off);
                    waiting_count += 1;
                }
                number = near;
            }
            // Test the bucket; leaves of the deepest level come first from the left
            let order = if number >= self.deepest { number - self.deepest } else { number + leaves - self.deepest };
            bound = look((order * BUCKET) as u32, &distances(&self.places[order], p), bound);
            loop {
                // Pop the next node that is still within the radius
                if waiting_count == 0 {
                    return;
                }
                waiting_count -= 1;
                let (next, next_off) = waiting[waiting_count];
                if next_off[0] + next_off[1] + next_off[2] < bound {
                    (number, off) = (next as usize, next_off);
                    break;
                }
            }
        }
    }
}

/// Returns the squared distances of a bucket's photons to a point.
#[inline(always)]
fn distances([x, y, z]: &[[f32; BUCKET]; 3], p: Vec3) -> [f32; BUCKET] {
    std::array::from_fn(|i| {
        let (dx, dy, dz) = (x[i] - p.x, y[i] - p.y, z[i] - p.z);
        dx * dx + dy * dy + dz * dz
    })
}

/// Returns a bit mask of the distances below a bound.
#[inline(always)]
fn below(distances: &[f32; BUCKET], bound: f32) -> u32 {
    let bits: [u32; BUCKET] = std::array::from_fn(|i| u32::from(distances[i] < bound) << i);
    bits.iter().fold(0, |all, bit| all | bit)
}

/// Returns the number of leaves in the left subtree of a node with `leaves` leaves. All levels are full but the
/// deepest, which is filled from the left.
fn left_leaves(leaves: usize) -> usize {
    if leaves <= 2 {
        return 1;
    }
    let full = 1 << (leaves - 1).ilog2();
    full / 2 + (leaves - full).min(full / 2)
}

/// The photons of a node, and its number of leaves.
type PhotonRun<'a> = (&'a mut [Photon], usize);

/// Splits a node's photons across their longest extent.
fn split((photons, leaves): PhotonRun<'_>) -> (Option<PhotonPlane>, Vec<PhotonRun<'_>>) {
    if leaves <= 1 {
        return (None, Vec::new());
    }
    let (low, high) = photons.iter().fold((photons[0].p, photons[0].p), |(l, h), it| (l.min(it.p), h.max(it.p)));
    let size = high - low;
    let axis = size.max_position();
    let left = left_leaves(leaves);
    let middle = left * BUCKET;
    photons.select_nth_unstable_by(middle, |a, b| a.p[axis].total_cmp(&b.p[axis]));
    let node = PhotonPlane { plane: photons[middle].p[axis], axis: axis as u32 };
    let (first, second) = photons.split_at_mut(middle);
    (Some(node), vec![(first, left), (second, leaves - left)])
}

/// The nearest photons found so far, in a max-heap of fixed size.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// Keys: the bits of the squared distance, which have the same order as the distances, then the number of the photon.
    heap: [u64; NEAREST_MAX],
    count: usize,
    limit: usize,
}

impl Nearest {
    /// Creates a buffer for the `limit` nearest photons; larger limits than [`NEAREST_MAX`] count as [`NEAREST_MAX`].
    pub fn new(limit: usize) -> Self {
        Self { heap: [0; NEAREST_MAX], count: 0, limit: limit.min(NEAREST_MAX) }
    }

    fn clear(&mut self) {
        self.count = 0;
    }

    /// Returns the number of photons found.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns `true` if none was found.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns `true` if the buffer is full; there may be more photons within the radius.
    pub fn is_full(&self) -> bool {
        self.count == self.limit
    }

    /// Returns the photons found, as numbers in the map and squared distances, unordered but deterministic.
    #[inline(always)]
    pub fn iter(&self) -> impl Iterator<Item = (u32, f32)> + '_ {
        self.heap[..self.count].iter().map(|&key| (key as u32, f32::from_bits((key >> 32) as u32)))
    }

    /// Returns the squared distance of the farthest photon found; 0: none was found.
    pub fn farthest(&self) -> f32 {
        self.iter().fold(0.0, |farthest, (_, distance)| distance.max(farthest))
    }

    /// Adds a photon. Returns the bound that the next squared distance must be below.
    #[inline(always)]
    fn push(&mut self, index: u32, distance: f32, bound: f32) -> f32 {
        let key = u64::from(distance.to_bits()) << 32 | u64::from(index);
        if self.count < self.limit {
            self.heap[self.count] = key;
            self.count += 1;
            if self.count < self.limit {
                return bound;
            }
            for i in (0..self.limit / 2).rev() {
                let key = self.heap[i];
                self.sink(i, key);
            }
        } else {
            self.sink(0, key);
        }
        f32::from_bits((self.heap[0] >> 32) as u32)
    }

    /// Moves the free place `i` down the heap until the key fits, and puts it there.
    #[inline(always)]
    fn sink(&mut self, mut i: usize, key: u64) {
        let heap = &mut self.heap[..self.limit];
        loop {
            let mut child = 2 * i + 1;
            if child >= heap.len() {
                break;
            }
            if child + 1 < heap.len() {
                child += usize::from(heap[child + 1] > heap[child]);
            }
            if heap[child] <= key {
                break;
            }
            heap[i] = heap[child];
            i = child;
        }
        heap[i] = key;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{sampler::PixelSampler, sampling::uniform_sphere};

    /// Photons on a sphere and on a sheet, some of them at the same place.
    fn photons(count: u32) -> Vec<Photon> {
        (0..count)
            .map(|i| {
                let sampler = PixelSampler::new(3, i, 0, 0);
                let u = [sampler.hashed(0), sampler.hashed(1)];
                let p = match i % 5 {
                    0 => Vec3::new(u[0], 0.25, u[1]),
                    1 => Vec3::new((u[0] * 8.0).floor(), 0.0, 0.0),
                    _ => uniform_sphere(u),
                };
                Photon::new(p, Vec3::Y, Vec3::Y, Vec3::splat(i as f32))
            })
            .collect()
    }

    fn squared_distances(photons: &[Photon], p: Vec3) -> Vec<f32> {
        let mut all: Vec<f32> = photons
            .iter()
            .map(|photon| {
                let d = photon.p - p;
                d.x * d.x + d.y * d.y + d.z * d.z
            })
            .collect();
        all.sort_by(f32::total_cmp);
        all
    }

    #[test]
    fn a_tree_finds_the_same_as_an_exhaustive_search() {
        for count in [0, 1, 15, 16, 17, 31, 33, 48, 49, 80, 100, 1000, 4099] {
            let all = photons(count);
            let map = PhotonMap::new(all.clone());
            assert_eq!(map.len(), count as usize);
            for i in 0..40 {
                let sampler = PixelSampler::new(4, i, 0, 0);
                let p = uniform_sphere([sampler.hashed(0), sampler.hashed(1)]) * (2.0 * sampler.hashed(2));
                let expected = squared_distances(&all, p);
                for (limit, reach) in [(1, f32::INFINITY), (7, 4.0), (50, f32::INFINITY), (50, 0.04), (512, 1.0)] {
                    let mut found = Nearest::new(limit);
                    map.nearest(p, reach, &mut found);
                    let mut distances: Vec<f32> = found.iter().map(|(_, distance)| distance).collect();
                    distances.sort_by(f32::total_cmp);
                    let expected: Vec<f32> = expected.iter().copied().filter(|&d| d < reach).take(limit).collect();
                    assert_eq!(distances, expected, "{count} {limit} {reach}");
                    let mut numbers: Vec<u32> = found.iter().map(|(number, _)| number).collect();
                    numbers.sort_unstable();
                    numbers.dedup();
                    assert_eq!(numbers.len(), expected.len(), "each is found once");
                }
                let mut sum = 0.0;
                map.within(p, 0.3, |index, distance| {
                    assert!((map.photon(index).p.distance_squared(p) - distance).abs() < 1e-5);
                    sum += map.mark(index).power().x;
                });
                let near = all.iter().filter(|photon| {
                    let d = photon.p - p;
                    d.x * d.x + d.y * d.y + d.z * d.z < 0.3
                });
                assert_eq!(sum, near.map(|photon| photon.mark().power().x).sum::<f32>());
                let nearest = map.nearest_where(p, f32::INFINITY, |_| true);
                assert_eq!(nearest.is_some(), count > 0);
                assert!(nearest.is_none_or(|index| map.photon(index).p.distance_squared(p) <= expected[0] + 1e-5));
                assert!(map.nearest_where(p, f32::INFINITY, |_| false).is_none());
            }
        }
    }

    #[test]
    fn a_tree_does_not_depend_on_threads() {
        let by = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| PhotonMap::new(photons(5000)).iter().collect::<Vec<_>>())
        };
        assert_eq!(by(1), by(3));
    }

    #[test]
    fn a_photon_takes_little_more_than_its_own_bytes_in_the_tree() {
        let map = PhotonMap::new(photons(10_000));
        assert!(map.memory_bytes() < 25 * 10_000, "{}", map.memory_bytes());
    }

    #[test]
    fn photons_without_a_position_are_left_out() {
        let nowhere = Photon::new(Vec3::new(f32::NAN, 0.0, 0.0), Vec3::Y, Vec3::Y, Vec3::ONE);
        assert_eq!(PhotonMap::new(vec![nowhere; 20]).len(), 0);
        let mut found = Nearest::new(0);
        PhotonMap::new(photons(100)).nearest(Vec3::ZERO, 1.0, &mut found);
        assert!(found.is_empty());
    }
}
