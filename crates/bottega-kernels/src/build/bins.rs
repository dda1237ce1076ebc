//! The first stage: a binary tree by the surface area heuristic over bins (Wald 2007, "On fast Construction of
//! SAH-based Bounding Volume Hierarchies").
//!
//! Deterministic for any number of threads: minima, maxima and counts do not depend on their order, and each node is
//! partitioned serially.

use super::item::{Item, ItemSpan, half_area};
use crate::Aabb;
use crate::compiled::{self, LaneTask};
use crate::memory::prefetch;
use crate::traverse::lanes::Lanes;
use crate::tree::MAX_DEPTH;
use rayon::prelude::*;

/// A node of the binary tree. Nodes are in preorder: the first child follows its parent.
#[derive(Clone, Copy, Debug)]
pub struct Binary {
    /// Bounds of all items below.
    pub bounds: Aabb,
    /// Index of the first item below; they are consecutive.
    pub first: u32,
    /// Number of items below.
    pub count: u32,
    /// Index of the second child minus that of this node; 0 for a leaf.
    pub second: u32,
}

/// Depth from which nodes are halved by count, so that 30 more levels suffice for any number of items.
const SAH_DEPTH: usize = MAX_DEPTH - 32;
const BINS: usize = 16;
/// Prefetch distance in items: the hardware prefetcher stops at page boundaries.
const AHEAD: usize = 16;
/// Least number of items for which a node is worth another thread; and at least this fraction of a thread's share.
const PARALLEL_ITEMS: usize = 16 * 1024;
const PARALLEL_SHARE: usize = 8;
/// Items per thread where several threads process the items of one node.
const SHARED_ITEMS: usize = 1 << 16;

/// Builds the tree and sorts the items so that each node has a range of them.
///
/// - `leaf_size`: maximal number of items in a leaf.
/// - `parallel`: use the threads of the current pool.
pub(super) fn build(items: &mut [Item], leaf_size: usize, parallel: bool) -> Vec<Binary> {
    if items.is_empty() {
        return Vec::new();
    }
    let share = items.len() / (PARALLEL_SHARE * rayon::current_num_threads());
    let builder =
        BinaryBuilder { leaf_size, parallel_items: if parallel { share.max(PARALLEL_ITEMS) } else { usize::MAX } };
    let extent = if parallel { Extent::of_many(items) } else { Extent::of(items) };
    joined(builder.pieces(items, &extent, 0, 0))
}

/// Concatenates the pieces.
fn joined(mut pieces: Vec<Vec<Binary>>) -> Vec<Binary> {
    if pieces.len() == 1 {
        return pieces.swap_remove(0);
    }
    let (mut starts, mut count) = (Vec::with_capacity(pieces.len()), 0);
    for piece in &pieces {
        starts.push(count);
        count += piece.len();
    }
    let at = |index: usize| {
        let piece = starts.partition_point(|&start| start <= index) - 1;
        pieces[piece][index - starts[piece]]
    };
    (0..count).into_par_iter().with_min_len(4096).map(at).collect()
}

/// The bounds of items, and the bounds of their (doubled) centers.
#[derive(Clone, Copy)]
struct Extent {
    items: ItemSpan,
    centers: ItemSpan,
}

impl Extent {
    const EMPTY: Self = Self { items: ItemSpan::EMPTY, centers: ItemSpan::EMPTY };

    fn of(items: &[Item]) -> Self {
        struct ExtentTask<'a>(&'a [Item]);
        impl LaneTask for ExtentTask<'_> {
            type Output = Extent;

            #[inline(always)]
            fn run<S: Lanes>(self, s: S) -> Extent {
                let (mut all, mut centers) = (s.load(&ItemSpan::EMPTY.0), s.load(&ItemSpan::EMPTY.0));
                for item in self.0 {
                    all = s.min(s.load(&item.0.0), all);
                    centers = s.min(item.centers(s), centers);
                }
                Extent { items: ItemSpan(s.store(all)), centers: ItemSpan(s.store(centers)) }
            }
        }
        compiled::run_in_lanes(ExtentTask(items))
    }

    /// Computes the extent with several threads.
    fn of_many(items: &[Item]) -> Self {
        let union = |a: Self, b: Self| Self { items: a.items.union(&b.items), centers: a.centers.union(&b.centers) };
        items.par_chunks(SHARED_ITEMS).map(Self::of).reduce(|| Self::EMPTY, union)
    }
}

/// A mapping from centers to bins.
#[derive(Clone, Copy)]
struct Binning {
    /// Middle of the first bin.
    base: [f32; 8],
    scale: [f32; 8],
    bins: usize,
}

impl Binning {
    /// Added to a small number, it leaves the rounded integer in the lowest bits: cheaper than a conversion.
    const ROUND: f32 = 12_582_912.0;

    fn new(centers: &ItemSpan, count: usize) -> Self {
        let bins = (4 + count / 2).min(BINS);
        let (mut base, mut scale) = ([0.0; 8], [0.0; 8]);
        for axis in 0..3 {
            let size = centers.upper(axis) - centers.lower(axis);
            scale[axis] = if size > 0.0 { (bins as f32 * 0.9999 / size).min(f32::MAX) } else { 0.0 };
            // An axis with an extent beyond the range of floats counts as flat.
            let half = if scale[axis] > f32::MIN_POSITIVE { 0.5 / scale[axis] } else { 0.0 };
            base[axis] = centers.lower(axis) + half;
        }
        Self { base, scale, bins }
    }

    #[inline(always)]
    fn in_lanes<S: Lanes>(&self, s: S) -> BinningLanes<S> {
        BinningLanes {
            base: s.load(&self.base),
            scale: s.load(&self.scale),
            first: s.splat(Self::ROUND),
            last: s.splat(Self::ROUND + (self.bins - 1) as f32),
        }
    }
}

/// A [`Binning`] in vector registers.
///
/// (Not a closure: only functions can be forced inline, and without inlining they are compiled without the vector
/// unit.)
struct BinningLanes<S: Lanes> {
    base: S::F,
    scale: S::F,
    first: S::F,
    last: S::F,
}

impl<S: Lanes> BinningLanes<S> {
    /// Returns the bin of an item on each axis, less than `LIMIT`, a power of two.
    #[inline(always)]
    fn find<const LIMIT: usize>(&self, s: S, item: &Item) -> [usize; 3] {
        let at = s.add(s.mul(s.sub(item.centers(s), self.base), self.scale), self.first);
        let [x, y, z, ..] = s.store(s.max_bits(s.min_bits(at, self.last), self.first));
        [x.to_bits() as usize & (LIMIT - 1), y.to_bits() as usize & (LIMIT - 1), z.to_bits() as usize & (LIMIT - 1)]
    }
}

/// A split: before a bin of an axis, neither the first nor beyond the last.
struct SplitPlane {
    axis: usize,
    base: f32,
    scale: f32,
    /// The bin's number, as bits in the form of [`Binning::ROUND`].
    bin: i32,
}

impl SplitPlane {
    fn new(binning: &Binning, axis: usize, bin: usize) -> Self {
        let bin = bin as i32 + Binning::ROUND.to_bits() as i32;
        Self { axis, base: binning.base[axis], scale: binning.scale[axis], bin }
    }

    /// Returns true if an item is before the plane.
    #[inline(always)]
    fn follows(&self, item: &Item) -> bool {
        let at = (item.center(self.axis) - self.base) * self.scale + Binning::ROUND;
        (at.to_bits() as i32) < self.bin
    }
}

const _: () = assert!(Binning::ROUND.to_bits().is_multiple_of(BINS as u32));

struct BinaryBuilder {
    leaf_size: usize,
    /// Least number of items of a node that threads share.
    parallel_items: usize,
}

impl BinaryBuilder {
    /// Builds a subtree as consecutive pieces: single nodes where threads share what is below.
    fn pieces(&self, items: &mut [Item], extent: &Extent, first: u32, depth: usize) -> Vec<Vec<Binary>> {
        let count = items.len();
        if count < self.parallel_items {
            let mut nodes = Vec::with_capacity(2 * count / self.leaf_size + 1);
            self.node(items, extent, first, depth, &mut nodes);
            return vec![nodes];
        }
        let (middle, extents) = self.divide(items, extent, depth, true);
        let (left, right) = items.split_at_mut(middle);
        let (left, right) = rayon::join(
            || self.pieces(left, &extents[0], first, depth + 1),
            || self.pieces(right, &extents[1], first + middle as u32, depth + 1),
        );
        let second = 1 + left.iter().map(Vec::len).sum::<usize>() as u32;
        let top = vec![Binary { bounds: extent.items.bounds(), first, count: count as u32, second }];
        std::iter::once(top).chain(left).chain(right).collect()
    }

    fn node(&self, items: &mut [Item], extent: &Extent, first: u32, depth: usize, nodes: &mut Vec<Binary>) {
        let this = nodes.len();
        let count = items.len() as u32;
        nodes.push(Binary { bounds: extent.items.bounds(), first, count, second: 0 });
        if items.len() <= self.leaf_size {
            return;
        }
        let (middle, extents) = self.divide(items, extent, depth, false);
        let (left, right) = items.split_at_mut(middle);
        self.node(left, &extents[0], first, depth + 1, nodes);
        nodes[this].second = (nodes.len() - this) as u32;
        self.node(right, &extents[1], first + middle as u32, depth + 1, nodes);
    }

    /// Partitions the items in two. Returns the size of the first part, which is neither 0 nor all, and the extents of
    /// both.
    ///
    /// - `shared`: several threads may process the items.
    fn divide(&self, items: &mut [Item], extent: &Extent, depth: usize, shared: bool) -> (usize, [Extent; 2]) {
        // Split by the surface area heuristic
        if depth < SAH_DEPTH {
            let binning = Binning::new(&extent.centers, items.len());
            let bins = shared.then(|| Bins::of_many(items, &binning));
            if let Some(parts) = compiled::run_in_lanes(Divide { items, binning, bins: bins.as_ref() }) {
                return parts;
            }
        }
        // Otherwise halve along the longest axis of the centers
        let size = |axis: usize| extent.centers.upper(axis) - extent.centers.lower(axis);
        let axis = if size(0) >= size(1) && size(0) >= size(2) { 0 } else { 1 + usize::from(size(2) > size(1)) };
        let middle = items.len() / 2;
        items
            .select_nth_unstable_by(middle, |a, b| a.center(axis).total_cmp(&b.center(axis)).then(a.id().cmp(&b.id())));
        (middle, [Extent::of(&items[..middle]), Extent::of(&items[middle..])])
    }
}

/// A split by bins; `None` if all centers coincide.
struct Divide<'a> {
    items: &'a mut [Item],
    binning: Binning,
    /// The filled bins, if already computed.
    bins: Option<&'a Bins<BINS>>,
}

impl LaneTask for Divide<'_> {
    type Output = Option<(usize, [Extent; 2])>;

    #[inline(always)]
    fn run<S: Lanes>(self, unit: S) -> Self::Output {
        let Self { items, binning, bins } = self;
        if let Some(bins) = bins {
            divide(unit, items, &binning, bins)
        // Most nodes are small, and clearing bins takes time: use fewer.
        } else if binning.bins <= BINS / 2 {
            let mut bins = Bins::<{ BINS / 2 }>::EMPTY;
            bins.fill(unit, items, &binning);
            divide(unit, items, &binning, &bins)
        } else {
            let mut bins = Bins::<BINS>::EMPTY;
            bins.fill(unit, items, &binning);
            divide(unit, items, &binning, &bins)
        }
    }
}

#[inline(always)]
fn divide<S: Lanes, const BINS: usize>(
    s: S,
    items: &mut [Item],
    binning: &Binning,
    bins: &Bins<BINS>,
) -> Option<(usize, [Extent; 2])> {
    let (axis, bin) = bins.best_split(s, binning)?;
    let (middle, centers) = partition(s, items, &SplitPlane::new(binning, axis, bin));
    let boxes = [0..bin, bin..binning.bins].map(|part| {
        let mut all = ItemSpan::EMPTY;
        for boxes in &bins.boxes[part] {
            all = all.union(&boxes[axis]);
        }
        all
    });
    let [left, right] = std::array::from_fn(|part| Extent { items: boxes[part], centers: centers[part] });
    (middle != 0 && middle != items.len()).then_some((middle, [left, right]))
}

struct Bins<const BINS: usize> {
    boxes: [[ItemSpan; 3]; BINS],
    counts: [[u32; 3]; BINS],
}

impl<const BINS: usize> Bins<BINS> {
    const EMPTY: Self = Self { boxes: [[ItemSpan::EMPTY; 3]; BINS], counts: [[0; 3]; BINS] };

    #[inline(always)]
    fn fill<S: Lanes>(&mut self, s: S, items: &[Item], binning: &Binning) {
        let lanes = binning.in_lanes(s);
        for (i, item) in items.iter().enumerate() {
            prefetch(items, i + AHEAD);
            let (at, span) = (lanes.find::<BINS>(s, item), s.load(&item.0.0));
            for (axis, at) in at.into_iter().enumerate() {
                let bin = &mut self.boxes[at][axis].0;
                *bin = s.store(s.min(span, s.load(bin)));
                self.counts[at][axis] += 1;
            }
        }
    }

    /// Fills the bins with several threads.
    fn of_many(items: &[Item], binning: &Binning) -> Self {
        struct BinsTask<'a, const BINS: usize>(&'a [Item], &'a Binning);
        impl<const BINS: usize> LaneTask for BinsTask<'_, BINS> {
            type Output = Bins<BINS>;

            #[inline(always)]
            fn run<S: Lanes>(self, unit: S) -> Bins<BINS> {
                let mut bins = Bins::EMPTY;
                bins.fill(unit, self.0, self.1);
                bins
            }
        }
        let chunks = items.par_chunks(SHARED_ITEMS);
        chunks
            .map(|items| compiled::run_in_lanes(BinsTask(items, binning)))
            .reduce(|| Self::EMPTY, |bins, other| bins.union(&other))
    }

    fn union(mut self, other: &Self) -> Self {
        let theirs = other.boxes.iter().flatten();
        self.boxes.iter_mut().flatten().zip(theirs).for_each(|(span, other)| *span = span.union(other));
        let theirs = other.counts.iter().flatten();
        self.counts.iter_mut().flatten().zip(theirs).for_each(|(count, other)| *count += other);
        self
    }

    /// Returns axis and first bin of the second part of the cheapest split; `None` if all centers coincide.
    #[inline(always)]
    fn best_split<S: Lanes>(&self, s: S, binning: &Binning) -> Option<(usize, usize)> {
        let mut best = (f32::INFINITY, 0, 0);
        for axis in 0..3 {
            if binning.scale[axis] == 0.0 {
                continue;
            }
            // Sweep from the right
            let mut right_cost = [0.0; BINS];
            let (mut right, mut count) = (s.load(&ItemSpan::EMPTY.0), 0);
            for i in (1..binning.bins).rev() {
                right = s.min(s.load(&self.boxes[i][axis].0), right);
                count += self.counts[i][axis];
                right_cost[i] = if count == 0 { f32::INFINITY } else { half_area(s, right) * count as f32 };
            }
            // Sweep from the left and compare costs
            let (mut left, mut count) = (s.load(&ItemSpan::EMPTY.0), 0);
            for (i, right_cost) in right_cost.iter().enumerate().take(binning.bins).skip(1) {
                left = s.min(s.load(&self.boxes[i - 1][axis].0), left);
                count += self.counts[i - 1][axis];
                if count != 0 {
                    let total = half_area(s, left) * count as f32 + right_cost;
                    if total < best.0 {
                        best = (total, axis, i);
                    }
                }
            }
        }
        (best.0 < f32::INFINITY).then_some((best.1, best.2))
    }
}

/// Moves the items before a plane to the front. Returns their number, and the center bounds of both parts.
#[inline(always)]
fn partition<S: Lanes>(s: S, items: &mut [Item], plane: &SplitPlane) -> (usize, [ItemSpan; 2]) {
    // The side of an item is unpredictable, so avoid branches.
    const OTHER: [[f32; 8]; 2] = [[f32::INFINITY; 8], [0.0; 8]];
    let (mut left, mut right) = (s.load(&ItemSpan::EMPTY.0), s.load(&ItemSpan::EMPTY.0));
    let mut middle = 0;
    for i in 0..items.len() {
        prefetch(items, i + AHEAD);
        let part = usize::from(plane.follows(&items[i]));
        let center = items[i].centers(s);
        left = s.min(s.add(center, s.load(&OTHER[part])), left);
        right = s.min(s.add(center, s.load(&OTHER[1 - part])), right);
        items.swap(i, middle);
        middle += part;
    }
    (middle, [ItemSpan(s.store(left)), ItemSpan(s.store(right))])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;
    use crate::traverse::portable::Portable;
    use glam::Vec3;

    fn items(count: u32) -> Vec<Item> {
        let mut random = SplitMix64::new(u64::from(count));
        let mut corner = |size: f32| Vec3::from_array(std::array::from_fn(|_| size * (2.0 * random.unit_f32() - 1.0)));
        (0..count)
            .map(|id| {
                let (a, b) = (corner(50.0), corner(2.0));
                Item::new(&Aabb::EMPTY.with(a).with(a + b), id)
            })
            .collect()
    }

    fn bits(span: &ItemSpan) -> [u32; 6] {
        let lanes = span.0.map(f32::to_bits);
        std::array::from_fn(|i| lanes[i + i / 3])
    }

    /// The item numbers in their new order, the size of the first part, and the bounds of both parts.
    fn divided(count: u32, many: bool, portable: bool) -> (Vec<u32>, usize, Vec<[u32; 6]>) {
        let mut items = items(count);
        let binning = Binning::new(&Extent::of(&items).centers, items.len());
        let bins = many.then(|| Bins::of_many(&items, &binning));
        let task = Divide { items: &mut items, binning, bins: bins.as_ref() };
        let (middle, extents) = if portable { task.run(Portable) } else { compiled::run_in_lanes(task) }.unwrap();
        let spans = extents.iter().flat_map(|extent| [bits(&extent.items), bits(&extent.centers)]).collect();
        (items.iter().map(Item::id).collect(), middle, spans)
    }

    #[test]
    fn every_unit_and_any_number_of_threads_divide_alike() {
        for count in [7, 20, 1000, 200_000] {
            let one = divided(count, false, false);
            assert_eq!(one, divided(count, false, true), "{count}");
            if count > 100 {
                assert_eq!(one, divided(count, true, false), "{count}");
            }
        }
    }

    #[test]
    fn both_parts_have_the_extent_of_their_items() {
        let mut items = items(5000);
        let extent = Extent::of(&items);
        let (middle, extents) =
            BinaryBuilder { leaf_size: 4, parallel_items: usize::MAX }.divide(&mut items, &extent, 0, false);
        assert!(middle != 0 && middle != items.len());
        for (part, returned) in [&items[..middle], &items[middle..]].into_iter().zip(extents) {
            let known = Extent::of(part);
            assert_eq!((bits(&known.items), bits(&known.centers)), (bits(&returned.items), bits(&returned.centers)));
        }
    }
}
