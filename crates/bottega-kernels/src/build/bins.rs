//! The first stage: a binary tree by the surface area heuristic over bins (Wald 2007, "On fast Construction of
//! SAH-based Bounding Volume Hierarchies").
//!
//! Deterministic whatever the number of threads: minima, maxima and counts do not depend on the order in which they
//! are taken, and the partition of one node is serial.

use crate::Aabb;
use crate::tree::MAX_DEPTH;
use glam::Vec4;

/// A primitive while the tree is built: its box, and its number in the bits of `lower.w` (see [`NUMBER`]).
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    lower: Vec4,
    upper: Vec4,
}

/// Turned over in a number that lies in the fourth lane, which takes part in all that is computed: makes it a float between 1 and 2.
/// By itself a small number would be a denormal float, and each product with one would take a hundred times as long.
const NUMBER: u32 = 1f32.to_bits();

impl Item {
    pub(super) fn new(bounds: &Aabb, id: u32) -> Self {
        Self { lower: bounds.min.extend(f32::from_bits(id ^ NUMBER)), upper: bounds.max.extend(0.0) }
    }

    pub(super) fn id(&self) -> u32 {
        self.lower.w.to_bits() ^ NUMBER
    }

    pub(super) fn bounds(&self) -> Aabb {
        Aabb { min: self.lower.truncate(), max: self.upper.truncate() }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.lower.truncate().is_finite() && self.upper.truncate().is_finite()
    }

    /// Twice its center.
    #[inline(always)]
    fn center(&self) -> Vec4 {
        self.lower + self.upper
    }
}

/// A node of the binary tree. Nodes lie in preorder: the first child follows its parent.
#[derive(Clone, Copy, Debug)]
pub struct Binary {
    /// Around all that is below.
    pub bounds: Aabb,
    /// The first of the items below, which follow each other.
    pub first: u32,
    /// How many there are.
    pub count: u32,
    /// Distance to the second child; 0 for a leaf.
    pub second: u32,
}

/// Below this depth nodes are halved by count, so that 30 more levels suffice for any number of items.
const SAH_DEPTH: usize = MAX_DEPTH - 32;
const BINS: usize = 16;
/// Smaller nodes are not worth another thread, nor are those with less than a part of all that many threads would share: each
/// joint copies the nodes below it.
const PARALLEL_ITEMS: usize = 16 * 1024;
const PARALLEL_SHARE: usize = 8;

/// Builds the tree and sorts the items so that each node has a range of them.
///
/// - `leaf_size`: nodes of at most so many items are not divided.
/// - `parallel`: whether to use the threads of the current pool.
pub(super) fn build(items: &mut [Item], leaf_size: usize, parallel: bool) -> Vec<Binary> {
    let mut nodes = Vec::new();
    let share = items.len() / (PARALLEL_SHARE * rayon::current_num_threads());
    let builder = Builder { leaf_size, parallel_items: if parallel { share.max(PARALLEL_ITEMS) } else { usize::MAX } };
    if !items.is_empty() {
        nodes.reserve(items.len().min(PARALLEL_ITEMS));
        builder.node(items, &Extent::of(items), 0, 0, &mut nodes);
    }
    nodes
}

/// A box over items and one over (doubled) centers.
#[derive(Clone, Copy)]
struct Extent {
    lower: Vec4,
    upper: Vec4,
    center_lower: Vec4,
    center_upper: Vec4,
}

impl Extent {
    const EMPTY: Self = {
        let (low, high) = (Vec4::INFINITY, Vec4::NEG_INFINITY);
        Self { lower: low, upper: high, center_lower: low, center_upper: high }
    };

    fn of(items: &[Item]) -> Self {
        let mut all = Self::EMPTY;
        for item in items {
            all.add(item);
        }
        all
    }

    #[inline(always)]
    fn add(&mut self, item: &Item) {
        self.lower = self.lower.min(item.lower);
        self.upper = self.upper.max(item.upper);
        let center = item.center();
        self.center_lower = self.center_lower.min(center);
        self.center_upper = self.center_upper.max(center);
    }

    fn bounds(&self) -> Aabb {
        Aabb { min: self.lower.truncate(), max: self.upper.truncate() }
    }
}

#[derive(Clone, Copy)]
struct Bin {
    lower: Vec4,
    upper: Vec4,
    count: u32,
}

const EMPTY_BIN: Bin = Bin { lower: Vec4::INFINITY, upper: Vec4::NEG_INFINITY, count: 0 };

#[inline(always)]
fn half_area(lower: Vec4, upper: Vec4) -> f32 {
    let d = upper - lower;
    d.x * d.y + d.y * d.z + d.z * d.x
}

/// Which bin a center falls into.
#[derive(Clone, Copy)]
struct Binning {
    /// Where the first bin has its middle.
    base: Vec4,
    scale: Vec4,
    bins: usize,
}

impl Binning {
    /// Added to a small number, leaves its integral part, rounded, in the lowest bits: cheaper than a conversion.
    const ROUND: f32 = 12_582_912.0;

    fn new(extent: &Extent, count: usize) -> Self {
        let bins = (4 + count / 2).min(BINS);
        let size = extent.center_upper - extent.center_lower;
        let scale = |d: f32| if d > 0.0 { (bins as f32 * 0.9999 / d).min(f32::MAX) } else { 0.0 };
        let scale = Vec4::new(scale(size.x), scale(size.y), scale(size.z), 0.0);
        // Beyond the scale of floats an axis is as good as flat.
        let half = |scale: f32| if scale > f32::MIN_POSITIVE { 0.5 / scale } else { 0.0 };
        let half = Vec4::new(half(scale.x), half(scale.y), half(scale.z), 0.0);
        Self { base: extent.center_lower + half, scale, bins }
    }

    #[inline(always)]
    fn of(&self, center: Vec4) -> [usize; 3] {
        let b = (center - self.base) * self.scale + Vec4::splat(Self::ROUND);
        let last = self.bins as i32 - 1;
        [b.x, b.y, b.z].map(|b| (b.to_bits() as i32 - Self::ROUND.to_bits() as i32).min(last).max(0) as usize)
    }

    /// Whether an item falls into a bin before `bin`, which is neither the first nor beyond the last, on one axis.
    #[inline(always)]
    fn before(axis: usize, bin: usize, base: f32, scale: f32) -> impl Fn(&Item) -> bool {
        let bin = bin as i32 + Self::ROUND.to_bits() as i32;
        move |item| (((item.lower[axis] + item.upper[axis] - base) * scale + Self::ROUND).to_bits() as i32) < bin
    }
}

struct Builder {
    leaf_size: usize,
    /// How many items a node must have to be shared among threads.
    parallel_items: usize,
}

impl Builder {
    fn node(&self, items: &mut [Item], extent: &Extent, first: u32, depth: usize, nodes: &mut Vec<Binary>) {
        let this = nodes.len();
        let count = items.len() as u32;
        nodes.push(Binary { bounds: extent.bounds(), first, count, second: 0 });
        if items.len() <= self.leaf_size {
            return;
        }
        let (middle, extents) = self.divide(items, extent, depth);
        let (left, right) = items.split_at_mut(middle);
        let first_right = first + middle as u32;
        if count as usize >= self.parallel_items {
            let subtree = |items: &mut [Item], extent: &Extent, first| {
                let mut nodes = Vec::with_capacity(items.len() * 2 / self.leaf_size);
                self.node(items, extent, first, depth + 1, &mut nodes);
                nodes
            };
            let (left, right) =
                rayon::join(|| subtree(left, &extents[0], first), || subtree(right, &extents[1], first_right));
            nodes.reserve_exact(left.len() + right.len());
            nodes.extend_from_slice(&left);
            drop(left); // What is touched next takes its memory.
            nodes[this].second = (nodes.len() - this) as u32;
            nodes.extend_from_slice(&right);
        } else {
            self.node(left, &extents[0], first, depth + 1, nodes);
            nodes[this].second = (nodes.len() - this) as u32;
            self.node(right, &extents[1], first_right, depth + 1, nodes);
        }
    }

    /// Sorts the items into two parts; returns the size of the first, which is neither 0 nor all, and what both fill.
    fn divide(&self, items: &mut [Item], extent: &Extent, depth: usize) -> (usize, [Extent; 2]) {
        if depth < SAH_DEPTH {
            let binning = Binning::new(extent, items.len());
            // Most nodes are small, and clearing bins takes time.
            let split = if binning.bins <= BINS / 2 {
                best_split::<{ BINS / 2 }>(items, &binning)
            } else {
                best_split::<BINS>(items, &binning)
            };
            if let Some((axis, bin)) = split {
                let (middle, extents) =
                    partition(items, Binning::before(axis, bin, binning.base[axis], binning.scale[axis]));
                if middle != 0 && middle != items.len() {
                    return (middle, extents);
                }
            }
        }
        let size = extent.center_upper - extent.center_lower;
        let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
        let middle = items.len() / 2;
        items.select_nth_unstable_by(middle, |a, b| {
            a.center()[axis].total_cmp(&b.center()[axis]).then(a.id().cmp(&b.id()))
        });
        (middle, [Extent::of(&items[..middle]), Extent::of(&items[middle..])])
    }
}

/// Axis and first bin of the second part of the split with the least cost; `None` when all centers coincide.
fn best_split<const BINS: usize>(items: &[Item], binning: &Binning) -> Option<(usize, usize)> {
    let mut bins = [[EMPTY_BIN; 3]; BINS];
    for item in items {
        let at = binning.of(item.center());
        for axis in 0..3 {
            let bin = &mut bins[at[axis] & (BINS - 1)][axis];
            bin.lower = bin.lower.min(item.lower);
            bin.upper = bin.upper.max(item.upper);
            bin.count += 1;
        }
    }
    let mut best = (f32::INFINITY, 0, 0);
    for axis in 0..3 {
        if binning.scale[axis] == 0.0 {
            continue;
        }
        let bins = |i: usize| &bins[i][axis];
        let mut right_cost = [0.0; BINS];
        let mut right = EMPTY_BIN;
        for i in (1..binning.bins).rev() {
            right.lower = right.lower.min(bins(i).lower);
            right.upper = right.upper.max(bins(i).upper);
            right.count += bins(i).count;
            right_cost[i] = if right.count == 0 { f32::INFINITY } else { cost(&right) };
        }
        let mut left = EMPTY_BIN;
        for (i, right_cost) in right_cost.iter().enumerate().take(binning.bins).skip(1) {
            left.lower = left.lower.min(bins(i - 1).lower);
            left.upper = left.upper.max(bins(i - 1).upper);
            left.count += bins(i - 1).count;
            if left.count != 0 {
                let total = cost(&left) + right_cost;
                if total < best.0 {
                    best = (total, axis, i);
                }
            }
        }
    }
    (best.0 < f32::INFINITY).then_some((best.1, best.2))
}

#[inline(always)]
fn cost(bin: &Bin) -> f32 {
    half_area(bin.lower, bin.upper) * bin.count as f32
}

/// Moves the items for which `first` holds to the front; returns how many there are, and what both parts fill.
fn partition(items: &mut [Item], first: impl Fn(&Item) -> bool) -> (usize, [Extent; 2]) {
    let (mut left, mut right) = (Extent::EMPTY, Extent::EMPTY);
    let (mut i, mut j) = (0, items.len());
    loop {
        while i < j && first(&items[i]) {
            left.add(&items[i]);
            i += 1;
        }
        while i < j && !first(&items[j - 1]) {
            right.add(&items[j - 1]);
            j -= 1;
        }
        if i >= j {
            return (i, [left, right]);
        }
        items.swap(i, j - 1);
        left.add(&items[i]);
        right.add(&items[j - 1]);
        i += 1;
        j -= 1;
    }
}
