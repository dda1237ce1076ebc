//! An eight-wide BVH with quantized boxes: fewer bytes per ray and fewer dependent steps than a binary tree.
//!
//! Ylitie, Karras and Laine, *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs*, 2017. A node has 80
//! bytes; a child's box has six, counted in powers of two from the node's corner. Built from a binary tree by opening the largest
//! children first.

use bottega_kernels::{Aabb, Binary, BinaryTree};
use bytemuck::Zeroable as _;
use glam::Vec3;

use crate::shared::geometry::{NODE_INNER, NODE_PLACE_WIDTH, Node, WIDTH};

/// The maximum number of shapes in a tree.
pub(crate) const SHAPES_MAX: u64 = 1 << 28;
/// The largest quantized coordinate of a child's box, in steps from the node's corner.
const STEPS: f32 = 255.0;
/// The margin by which boxes are enlarged, relative to the size of the node: far above the rounding of a slab test, far below a
/// step.
const MARGIN: f32 = 1.0 / 1_048_576.0;
/// [`NODE_INNER`] as a byte.
const INNER: u8 = NODE_INNER as u8;

/// A tree in the layout of the shader.
#[derive(Debug)]
pub(crate) struct DeviceTree {
    /// All nodes, the root first; never empty.
    pub(crate) nodes: Vec<Node>,
    /// Indices of the shapes in the order of the leaves.
    pub(crate) order: Vec<u32>,
    /// The number of nodes on the longest path from the root: the bound of the shader's stack.
    pub(crate) depth: u32,
}

/// Widens a binary tree whose leaves have at most [`LEAF_MAX`](crate::shared::geometry::LEAF_MAX) shapes.
pub(crate) fn widen(binary: &BinaryTree) -> DeviceTree {
    let mut tree = DeviceTree { nodes: vec![Node::zeroed()], order: Vec::with_capacity(binary.items.len()), depth: 1 };
    // The binary node of each wide node, and its depth. Children are appended in order, so the children of a node are
    // consecutive.
    let mut sources = vec![(0, 1)];
    let mut next = 0;
    while let Some(&(source, depth)) = sources.get(next) {
        tree.depth = tree.depth.max(depth);
        let open = if binary.nodes.is_empty() { Vec::new() } else { open(&binary.nodes, source) };
        let children = tree.nodes.len() as u32;
        let inner = |inner| {
            tree.nodes.push(Node::zeroed());
            sources.push((inner, depth + 1));
        };
        tree.nodes[next] = place(binary, &open, children, &mut tree.order, inner);
        next += 1;
    }
    tree
}

/// Returns the binary nodes below `source` that become children, by opening the largest while there is room.
fn open(nodes: &[Binary], source: usize) -> Vec<usize> {
    if nodes[source].second == 0 {
        return vec![source];
    }
    let children = |index: usize| [index + 1, index + nodes[index].second as usize];
    let area = |&index: &usize| {
        let d = nodes[index].bounds.max - nodes[index].bounds.min;
        d.x * d.y + d.y * d.z + d.z * d.x
    };
    // Open the inner node with the largest area.
    let mut open = children(source).to_vec();
    while open.len() < WIDTH {
        let inner = open.iter().enumerate().filter(|(_, index)| nodes[**index].second != 0);
        let Some((at, _)) = inner.max_by(|a, b| area(a.1).total_cmp(&area(b.1))) else { break };
        let opened = open.swap_remove(at);
        open.extend(children(opened));
    }
    open
}

/// Writes a node. Calls `add` to append each child that is an inner node.
fn place(binary: &BinaryTree, open: &[usize], children: u32, order: &mut Vec<u32>, mut add: impl FnMut(usize)) -> Node {
    let mut node = Node { children, shapes: order.len() as u32, ..Node::zeroed() };
    if open.is_empty() {
        return node;
    }
    // Compute the node's box and the step size of its grid.
    let boxes: Vec<_> = open.iter().map(|&index| binary.nodes[index].bounds).collect();
    let Aabb { min, max } = boxes.iter().fold(Aabb::EMPTY, |all, it| all.union(it));
    let margin = ((max - min).max_element() * MARGIN).max(min.abs().max(max.abs()).max_element() * f32::EPSILON);
    let corner = min - margin;
    let steps = ((max + margin - corner) / STEPS).to_array().map(step);
    node.corner = corner.to_array();
    node.exponents = steps;
    let slots = slots(&boxes, (min + max) * 0.5);
    // Write the children: leaves with their shapes, inner nodes by reference.
    for (slot, child) in slots.into_iter().enumerate().filter_map(|(slot, child)| Some((slot, child?))) {
        let Binary { first, count, second, .. } = binary.nodes[open[child]];
        if second == 0 {
            let bits = (1_u8 << count) - 1;
            node.kinds[slot] = bits << NODE_PLACE_WIDTH | (order.len() as u32 - node.shapes) as u8;
            order.extend_from_slice(&binary.items[first as usize..][..count as usize]);
        } else {
            node.inner |= 1 << slot;
            node.kinds[slot] = 1 << NODE_PLACE_WIDTH | (INNER + slot as u8);
            add(open[child]);
        }
        // Quantize the child's box outwards.
        for axis in 0..3 {
            let size = f32::from_bits(u32::from(steps[axis]) << 23);
            let low = boxes[child].min[axis] - margin - corner[axis];
            let high = boxes[child].max[axis] + margin - corner[axis];
            node.low[axis][slot] = (low / size).floor().clamp(0.0, STEPS) as u8;
            node.high[axis][slot] = (high / size).ceil().clamp(0.0, STEPS) as u8;
        }
    }
    node
}

/// Returns the biased exponent of the smallest power of two that is not below `size`.
fn step(size: f32) -> u8 {
    let bits = size.max(f32::MIN_POSITIVE).to_bits();
    let exponent = bits >> 23;
    (exponent + u32::from(bits & 0x007f_ffff != 0)).min(254) as u8
}

/// Assigns children to slots. A child towards a corner of the node gets the slot whose number names that corner, so that a ray's
/// direction gives the order of the children (section 3.2 of the paper; greedy).
fn slots(boxes: &[Aabb], center: Vec3) -> [Option<usize>; WIDTH] {
    let mut slots = [None; WIDTH];
    let mut left: Vec<usize> = (0..boxes.len()).collect();
    while !left.is_empty() {
        // Assign the cheapest pair of child and free slot.
        let mut best = (f32::INFINITY, 0, 0);
        for (at, &child) in left.iter().enumerate() {
            let from = (boxes[child].min + boxes[child].max) * 0.5 - center;
            for slot in (0..WIDTH).filter(|&slot| slots[slot].is_none()) {
                let sign = |bit: usize| if slot & bit == 0 { 1.0 } else { -1.0 };
                let cost = from.dot(Vec3::new(sign(4), sign(2), sign(1)));
                if cost < best.0 {
                    best = (cost, at, slot);
                }
            }
        }
        let (_, at, slot) = best;
        // All costs are infinite only if boxes are not finite, which no shape has.
        slots[slot].get_or_insert(left.swap_remove(at));
    }
    slots
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::LEAF_MAX;
    use bottega_kernels::Shape;
    use proptest::prelude::*;

    /// Walks the tree, checks that each box encloses its children, and returns all shapes of the leaves.
    fn walk(tree: &DeviceTree, bounds: &[Aabb]) -> Vec<u32> {
        let everywhere = Aabb { min: Vec3::splat(-3e38), max: Vec3::splat(3e38) };
        let (mut seen, mut todo) = (Vec::new(), vec![(0, 1, everywhere)]);
        while let Some((index, depth, outer)) = todo.pop() {
            assert!(depth <= tree.depth);
            let node: &Node = &tree.nodes[index];
            let mut inner = 0;
            for slot in 0..WIDTH {
                let at = |steps: &[[u8; WIDTH]; 3]| {
                    let axis = |axis: usize| {
                        let size = f32::from_bits(u32::from(node.exponents[axis]) << 23);
                        node.corner[axis] + f32::from(steps[axis][slot]) * size
                    };
                    Vec3::new(axis(0), axis(1), axis(2))
                };
                let own = Aabb { min: at(&node.low), max: at(&node.high) };
                if node.inner & 1 << slot != 0 {
                    assert_eq!(node.kinds[slot], 1 << NODE_PLACE_WIDTH | (INNER + slot as u8));
                    todo.push((node.children as usize + inner, depth + 1, own));
                    inner += 1;
                } else {
                    let (bits, first) = (node.kinds[slot] >> NODE_PLACE_WIDTH, node.kinds[slot] & 31);
                    for shape in 0..bits.count_ones() {
                        let shape = tree.order[(node.shapes + u32::from(first) + shape) as usize];
                        let shared = |a: &Aabb, b: &Aabb| (a.min.max(b.min), a.max.min(b.max));
                        let (min, max) = shared(&own, &bounds[shape as usize]);
                        assert!(min.cmple(max).all(), "a leaf is nowhere near its shape");
                        let (min, max) = shared(&outer, &bounds[shape as usize]);
                        assert!(min.cmple(max).all(), "a node is nowhere near its shapes");
                        seen.push(shape);
                    }
                }
            }
        }
        seen.sort_unstable();
        seen.dedup();
        seen
    }

    fn check(bounds: &[Aabb]) -> DeviceTree {
        let shapes: Vec<_> = bounds.iter().map(|&bounds| Shape::Within(bounds)).collect();
        let tree = widen(&BinaryTree::build(&shapes, LEAF_MAX as usize, 1));
        assert_eq!(walk(&tree, bounds), (0..bounds.len() as u32).collect::<Vec<_>>());
        tree
    }

    #[test]
    fn nothing_and_one_shape_have_a_root() {
        assert_eq!(check(&[]).nodes[0].kinds, [0; WIDTH]);
        assert_eq!(check(&[Aabb { min: Vec3::ZERO, max: Vec3::ONE }]).order, [0]);
    }

    #[test]
    fn shapes_that_shrink_towards_a_point_and_shapes_in_one_place_have_a_tree() {
        let around = |point: Vec3| Aabb { min: point, max: point * 1.001 };
        let bounds: Vec<_> = (0..4_000).map(|n| around(Vec3::splat(0.98_f32.powi(n)))).collect();
        assert!(check(&bounds).depth < 64);
        check(&vec![Aabb { min: Vec3::ZERO, max: Vec3::ONE }; 1_000]);
    }

    proptest! {
        #[test]
        fn every_shape_is_in_a_leaf_and_within_all_boxes_above(
            boxes in prop::collection::vec((prop::array::uniform3(-1e3_f32..1e3), prop::array::uniform3(0_f32..50.0)), 0..300),
        ) {
            let sized = |(min, size): ([f32; 3], [f32; 3])| Aabb { min: Vec3::from(min), max: Vec3::from(min) + Vec3::from(size) };
            let bounds: Vec<_> = boxes.into_iter().map(sized).collect();
            check(&bounds);
        }
    }
}
