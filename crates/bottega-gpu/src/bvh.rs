//! A two-child tree for the shader: binned by the surface area heuristic, and never deeper than the shader's stack.
//!
//! Nodes of 64 bytes hold the boxes of both children (Aila and Laine, *Understanding the Efficiency of Ray Traversal
//! on GPUs*, 2009). Splits by Wald, *On fast Construction of SAH-based Bounding Volume Hierarchies*, 2007.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// As in the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Node {
    left_min: Vec3,
    left: u32,
    left_max: Vec3,
    padding_0: u32,
    right_min: Vec3,
    right: u32,
    right_max: Vec3,
    padding_1: u32,
}

/// Inner nodes on the longest way down; one child a node waits on the stack.
pub(crate) const DEPTH_MAX: u32 = 32;
/// Shapes in a leaf at most.
const LEAF_MAX: usize = 4;
/// Shapes that a leaf's index can name.
pub(crate) const SHAPES_MAX: u64 = 1 << COUNT_SHIFT;
const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 28;
const BINS: usize = 16;
/// Cost of a node against that of a shape.
const NODE_COST: f32 = 1.0;

/// A box. Empty: nothing is inside, and the shader never enters.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    min: Vec3,
    max: Vec3,
}

impl Bounds {
    /// Beyond all that is in a scene, yet not so far that the shader's products overflow.
    const EMPTY: Self = Self { min: Vec3::splat(1e13), max: Vec3::splat(-1e13) };

    fn union(self, (min, max): (Vec3, Vec3)) -> Self {
        Self { min: self.min.min(min), max: self.max.max(max) }
    }

    fn half_area(self) -> f32 {
        if self.min.x > self.max.x {
            return 0.0;
        }
        let d = self.max - self.min;
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// Part of the shapes that is still to be given a node or a leaf, and where its parent wants to know.
struct Task {
    start: usize,
    end: usize,
    depth: u32,
    parent: u32,
    is_right: bool,
}

/// Builds the tree over boxes (min, max), all finite, fewer than [`SHAPES_MAX`]. Returns the nodes, the root first, and
/// the order in which leaves name the shapes. The root is always a node; a child that is not there has an empty box.
pub(crate) fn build(bounds: &[(Vec3, Vec3)]) -> (Vec<Node>, Vec<u32>) {
    let mut order: Vec<u32> = (0..bounds.len() as u32).collect();
    let mut nodes = vec![Node::zeroed()];
    set_child(&mut nodes[0], false, 0, Bounds::EMPTY);
    set_child(&mut nodes[0], true, 0, Bounds::EMPTY);
    let mut tasks = Vec::new();
    if bounds.len() <= LEAF_MAX {
        if !bounds.is_empty() {
            let all = bounds.iter().fold(Bounds::EMPTY, |all, &one| all.union(one));
            set_child(&mut nodes[0], false, leaf(0, bounds.len()), all);
        }
        return (nodes, order);
    }
    split_into(bounds, &mut order, 0..bounds.len(), 1, 0, &mut tasks);
    while let Some(Task { start, end, depth, parent, is_right }) = tasks.pop() {
        let all = order[start..end].iter().fold(Bounds::EMPTY, |all, &index| all.union(bounds[index as usize]));
        if end - start <= LEAF_MAX && !worth_splitting(bounds, &mut order[start..end], all, depth) {
            set_child(&mut nodes[parent as usize], is_right, leaf(start, end - start), all);
            continue;
        }
        let index = nodes.len() as u32;
        nodes.push(Node::zeroed());
        set_child(&mut nodes[parent as usize], is_right, index, all);
        split_into(bounds, &mut order, start..end, depth + 1, index, &mut tasks);
    }
    (nodes, order)
}

/// Whether a few shapes are better off in two leaves than in one.
fn worth_splitting(bounds: &[(Vec3, Vec3)], order: &mut [u32], all: Bounds, depth: u32) -> bool {
    depth < DEPTH_MAX
        && best_split(bounds, order)
            .is_some_and(|split| NODE_COST * all.half_area() + split.cost < order.len() as f32 * all.half_area())
}

/// Divides a part in two and puts both on the list. `depth` counts the nodes from the root to `parent`, included.
fn split_into(
    bounds: &[(Vec3, Vec3)],
    order: &mut [u32],
    part: std::ops::Range<usize>,
    depth: u32,
    parent: u32,
    tasks: &mut Vec<Task>,
) {
    let range = &mut order[part.clone()];
    let count = range.len();
    // What a subtree can still hold below this node if it is split evenly from here on.
    let capacity = (LEAF_MAX as u64) << (DEPTH_MAX.saturating_sub(depth)).min(40);
    let by_area = best_split(bounds, range).map(|split| partition(bounds, range, &split));
    let middle = by_area
        .filter(|&left| left > 0 && left < count && left.max(count - left) as u64 <= capacity)
        .unwrap_or_else(|| halve(bounds, range));
    let middle = part.start + middle;
    tasks.push(Task { start: middle, end: part.end, depth, parent, is_right: true });
    tasks.push(Task { start: part.start, end: middle, depth, parent, is_right: false });
}

/// A plane between bins.
struct Split {
    axis: usize,
    /// Lower edge of the first bin, and bins a unit of length.
    origin: f32,
    scale: f32,
    /// First bin of the right side.
    bin: usize,
    /// Σ half area × shapes of both sides.
    cost: f32,
}

fn center2((min, max): (Vec3, Vec3)) -> Vec3 {
    min + max
}

fn bin_of(center: f32, origin: f32, scale: f32) -> usize {
    (((center - origin) * scale) as usize).min(BINS - 1)
}

/// The cheapest of the planes between bins on the axes; none where all centers are the same.
fn best_split(bounds: &[(Vec3, Vec3)], range: &[u32]) -> Option<Split> {
    let centers = range.iter().fold(Bounds::EMPTY, |all, &index| {
        let center = center2(bounds[index as usize]);
        all.union((center, center))
    });
    let mut best: Option<Split> = None;
    for axis in 0..3 {
        let (origin, extent) = (centers.min[axis], centers.max[axis] - centers.min[axis]);
        let scale = BINS as f32 / extent;
        if !(extent > 0.0 && scale.is_finite()) {
            continue;
        }
        let mut bins = [(Bounds::EMPTY, 0_u32); BINS];
        for &index in range {
            let shape = bounds[index as usize];
            let (all, count) = &mut bins[bin_of(center2(shape)[axis], origin, scale)];
            *all = all.union(shape);
            *count += 1;
        }
        let mut right_costs = [0.0; BINS];
        let (mut all, mut count) = (Bounds::EMPTY, 0);
        for bin in (1..BINS).rev() {
            all = all.union((bins[bin].0.min, bins[bin].0.max));
            count += bins[bin].1;
            right_costs[bin] = all.half_area() * count as f32;
        }
        let (mut all, mut count) = (Bounds::EMPTY, 0);
        for bin in 1..BINS {
            all = all.union((bins[bin - 1].0.min, bins[bin - 1].0.max));
            count += bins[bin - 1].1;
            let cost = all.half_area() * count as f32 + right_costs[bin];
            if best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Split { axis, origin, scale, bin, cost });
            }
        }
    }
    best
}

/// Moves what is left of the plane to the front; returns how many that are.
fn partition(bounds: &[(Vec3, Vec3)], range: &mut [u32], split: &Split) -> usize {
    let mut left = 0;
    for at in 0..range.len() {
        let center = center2(bounds[range[at] as usize])[split.axis];
        if bin_of(center, split.origin, split.scale) < split.bin {
            range.swap(left, at);
            left += 1;
        }
    }
    left
}

/// Puts the lower half by center along the longest axis in front; returns how many that are.
fn halve(bounds: &[(Vec3, Vec3)], range: &mut [u32]) -> usize {
    let centers = range.iter().fold(Bounds::EMPTY, |all, &index| {
        let center = center2(bounds[index as usize]);
        all.union((center, center))
    });
    let axis = (centers.max - centers.min).max_position();
    let middle = range.len() / 2;
    let key = |index: &u32| center2(bounds[*index as usize])[axis];
    range.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    middle
}

fn leaf(first: usize, count: usize) -> u32 {
    LEAF | (count as u32 - 1) << COUNT_SHIFT | first as u32
}

fn set_child(node: &mut Node, is_right: bool, child: u32, bounds: Bounds) {
    if is_right {
        (node.right, node.right_min, node.right_max) = (child, bounds.min, bounds.max);
    } else {
        (node.left, node.left_min, node.left_max) = (child, bounds.min, bounds.max);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Walks the tree; checks that boxes enclose, and returns the depth and the shapes in leaf order.
    fn walk(nodes: &[Node], order: &[u32], bounds: &[(Vec3, Vec3)]) -> (u32, Vec<u32>) {
        let (mut deepest, mut seen) = (0, Vec::new());
        let mut todo = vec![(0_u32, 1_u32, Vec3::splat(-3e38), Vec3::splat(3e38))];
        while let Some((index, depth, outer_min, outer_max)) = todo.pop() {
            deepest = deepest.max(depth);
            let node = &nodes[index as usize];
            for (child, min, max) in
                [(node.left, node.left_min, node.left_max), (node.right, node.right_min, node.right_max)]
            {
                if min.x > max.x {
                    continue;
                }
                assert!(min.cmpge(outer_min).all() && max.cmple(outer_max).all(), "a box leaves its parent");
                if child & LEAF == 0 {
                    todo.push((child, depth + 1, min, max));
                    continue;
                }
                let first = (child & ((1 << COUNT_SHIFT) - 1)) as usize;
                let count = (child >> COUNT_SHIFT & 7) as usize + 1;
                for &shape in &order[first..first + count] {
                    let (low, high) = bounds[shape as usize];
                    assert!(low.cmpge(min).all() && high.cmple(max).all(), "a shape leaves its leaf");
                    seen.push(shape);
                }
            }
        }
        seen.sort_unstable();
        (deepest, seen)
    }

    fn check(bounds: &[(Vec3, Vec3)]) {
        let (nodes, order) = build(bounds);
        let (depth, seen) = walk(&nodes, &order, bounds);
        assert!(depth <= DEPTH_MAX, "{depth} nodes deep");
        assert_eq!(seen, (0..bounds.len() as u32).collect::<Vec<_>>());
    }

    #[test]
    fn shapes_that_shrink_towards_a_point_do_not_make_the_tree_too_deep() {
        let bounds: Vec<_> = (0..4_000).map(|n| Vec3::splat(0.98_f32.powi(n))).map(|p| (p, p * 1.001)).collect();
        check(&bounds);
    }

    #[test]
    fn shapes_in_one_place_are_divided_all_the_same() {
        check(&vec![(Vec3::ZERO, Vec3::ONE); 1_000]);
    }

    proptest! {
        #[test]
        fn every_shape_is_in_one_leaf_and_within_its_box(
            boxes in prop::collection::vec((prop::array::uniform3(-1e3_f32..1e3), prop::array::uniform3(0_f32..50.0)), 0..200),
        ) {
            let bounds: Vec<_> = boxes
                .into_iter()
                .map(|(min, size)| (Vec3::from(min), Vec3::from(min) + Vec3::from(size)))
                .collect();
            check(&bounds);
        }
    }
}
