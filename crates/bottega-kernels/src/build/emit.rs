//! The third stage: writing the wide tree into the arena.

use super::bins::Binary;
use super::collapse::{CollapseChoice, children};
use crate::arena::{Arena, CacheLine};
use crate::tree::{Child, MAX_DEPTH, TriangleBlock, WIDTH, WideNode};
use crate::{Aabb, BuildError, Precision};
use rayon::prelude::*;

/// A wide node to write: its binary node, and the indices of its first child node and first leaf.
#[derive(Clone, Copy)]
struct Outline {
    binary: u32,
    first_node: u32,
    first_leaf: u32,
}

impl Outline {
    /// Returns the same node in a plan with other base indices.
    fn moved(self, node_base: u32, leaf_base: u32) -> Self {
        let Self { binary, first_node, first_leaf } = self;
        Self { binary, first_node: first_node + node_base, first_leaf: first_leaf + leaf_base }
    }
}

/// The list of nodes and leaves to write. Children of a node have consecutive indices.
struct EmitPlan {
    nodes: Vec<Outline>,
    /// Binary node of each leaf.
    leaves: Vec<u32>,
}

/// Least number of items for which a subtree is worth another thread.
const PARALLEL_ITEMS: u32 = 1 << 17;

/// Plans the wide tree below a binary node that is not a leaf. Indices are relative to the node and its first leaf.
///
/// - `depth`: depth of the node.
/// - `least`: least number of items of nodes that threads share. The plan does not depend on it.
fn plan(binary: &[Binary], choices: &[CollapseChoice], top: usize, depth: usize, least: u32) -> EmitPlan {
    if binary[top].count < least {
        return plan_alone(binary, choices, top, depth);
    }
    let mut out = [0; WIDTH];
    let count = children(binary, choices, top, &mut out);
    let (leaves, inner): (Vec<_>, Vec<_>) = out[..count].iter().partition(|&&child| choices[child].is_leaf());
    let parts: Vec<EmitPlan> = inner.par_iter().map(|&child| plan(binary, choices, child, depth + 1, least)).collect();
    let mut nodes = vec![Outline { binary: top as u32, first_node: 1, first_leaf: 0 }];
    nodes.reserve_exact(parts.iter().map(|part| part.nodes.len()).sum());
    nodes.extend(parts.iter().map(|part| part.nodes[0]));
    let mut leaves: Vec<u32> = leaves.into_iter().map(|leaf| leaf as u32).collect();
    leaves.reserve_exact(parts.iter().map(|part| part.leaves.len()).sum());
    // The last child's subtree comes first, as in `plan_alone`.
    for (slot, part) in parts.iter().enumerate().rev() {
        // The first node of each part is already among its siblings.
        let (node_base, leaf_base) = (nodes.len() as u32 - 1, leaves.len() as u32);
        nodes[1 + slot] = part.nodes[0].moved(node_base, leaf_base);
        nodes.extend(part.nodes[1..].iter().map(|node| node.moved(node_base, leaf_base)));
        leaves.extend_from_slice(&part.leaves);
    }
    EmitPlan { nodes, leaves }
}

/// Plans as [`plan`] does, on one thread.
fn plan_alone(binary: &[Binary], choices: &[CollapseChoice], top: usize, depth: usize) -> EmitPlan {
    let mut nodes = vec![Outline { binary: top as u32, first_node: 0, first_leaf: 0 }];
    let mut leaves = Vec::new();
    let mut stack = vec![(0usize, depth)];
    while let Some((node, depth)) = stack.pop() {
        assert!(depth < MAX_DEPTH, "the binary tree is at most {MAX_DEPTH} deep");
        let mut out = [0; WIDTH];
        let count = children(binary, choices, nodes[node].binary as usize, &mut out);
        nodes[node].first_node = nodes.len() as u32;
        nodes[node].first_leaf = leaves.len() as u32;
        for &child in &out[..count] {
            if choices[child].is_leaf() {
                leaves.push(child as u32);
            } else {
                stack.push((nodes.len(), depth + 1));
                nodes.push(Outline { binary: child as u32, first_node: 0, first_leaf: 0 });
            }
        }
    }
    EmitPlan { nodes, leaves }
}

/// A tree written into the arena.
pub(super) struct EmittedTree<'a> {
    /// Root, with indices into the arena.
    pub(super) root: Child,
    pub(super) bounds: Aabb,
    /// Range of items of each leaf.
    pub(super) leaves: Vec<(u32, u32)>,
    /// Lines reserved for the leaves.
    pub(super) lines: &'a mut [CacheLine],
}

/// Appends the wide nodes, and reserves lines for the leaves behind them.
///
/// - `leaf_lines`: lines per leaf.
/// - `leaf`: makes the reference to a leaf, from its first line and its binary node.
pub(super) fn nodes<'a>(
    binary: &[Binary],
    choices: &[CollapseChoice],
    arena: &'a mut Arena,
    parallel: bool,
    leaf_lines: usize,
    leaf: impl Fn(usize, &Binary) -> Child + Sync,
) -> Result<EmittedTree<'a>, BuildError> {
    let Some(top) = binary.first() else {
        return Ok(EmittedTree { root: Child::EMPTY, bounds: Aabb::EMPTY, leaves: Vec::new(), lines: &mut [] });
    };
    let plan = if choices[0].is_leaf() {
        EmitPlan { nodes: Vec::new(), leaves: vec![0] }
    } else {
        plan(binary, choices, 0, 1, if parallel { PARALLEL_ITEMS } else { u32::MAX })
    };
    let base = arena.len();
    let leaf_base = base + plan.nodes.len() * WideNode::LINES;
    let end = leaf_base + plan.leaves.len() * leaf_lines;
    check("cache lines of tree", end)?;
    let (written, lines) = arena.grow(end - base).split_at_mut(leaf_base - base);
    let written: &mut [WideNode] = bytemuck::cast_slice_mut(written);
    let write = |(node, outline): (&mut WideNode, &Outline)| {
        *node = WideNode::EMPTY;
        let mut out = [0; WIDTH];
        let count = children(binary, choices, outline.binary as usize, &mut out);
        let (mut next_node, mut next_leaf) = (outline.first_node as usize, outline.first_leaf as usize);
        let mut references = [Child::EMPTY; WIDTH];
        for (reference, &child) in references.iter_mut().zip(&out[..count]) {
            *reference = if choices[child].is_leaf() {
                next_leaf += 1;
                leaf(leaf_base + (next_leaf - 1) * leaf_lines, &binary[child])
            } else {
                next_node += 1;
                Child::node(base + (next_node - 1) * WideNode::LINES)
            };
        }
        for (slot, place) in along_longest_axis(binary, &out[..count]).into_iter().enumerate().take(count) {
            node.set(slot, &binary[out[place]].bounds, references[place]);
        }
        node.sort_octants(count);
    };
    if parallel {
        written.par_iter_mut().with_min_len(256).zip(&plan.nodes).for_each(write);
    } else {
        written.iter_mut().zip(&plan.nodes).for_each(write);
    }
    let root = if plan.nodes.is_empty() { leaf(leaf_base, top) } else { Child::node(base) };
    let range = |&node: &u32| (binary[node as usize].first, binary[node as usize].count);
    let leaves = if parallel {
        plan.leaves.par_iter().with_min_len(4096).map(range).collect()
    } else {
        plan.leaves.iter().map(range).collect()
    };
    Ok(EmittedTree { root, bounds: top.bounds, leaves, lines })
}

/// Returns the indices of boxes sorted by their centers along the axis on which these are farthest apart.
fn along_longest_axis(binary: &[Binary], boxes: &[usize]) -> [usize; WIDTH] {
    let center = |place: usize| binary[boxes[place]].bounds.min + binary[boxes[place]].bounds.max;
    let all = (0..boxes.len()).fold(Aabb::EMPTY, |all, place| all.with(center(place)));
    let size = all.max - all.min;
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    let mut places: [usize; WIDTH] = std::array::from_fn(|place| place);
    places[..boxes.len()].sort_by(|&a, &b| center(a)[axis].total_cmp(&center(b)[axis]));
    places
}

/// Writes the leaf blocks of a triangle tree.
///
/// - `lines`: destination.
/// - `leaves`: ranges of `items`, which are triangle numbers; one block each.
/// - `vertices`: corners of a triangle.
pub(super) fn blocks(
    lines: &mut [CacheLine],
    leaves: &[(u32, u32)],
    items: &[u32],
    precision: Precision,
    parallel: bool,
    vertices: impl Fn(u32) -> [[f32; 3]; 3] + Sync,
) {
    let make = |&(first, count): &(u32, u32)| {
        let mut ids = [u32::MAX; WIDTH];
        ids[..count as usize].copy_from_slice(&items[first as usize..(first + count) as usize]);
        // Remove duplicates: parts of a split triangle may end up in one leaf.
        ids[..count as usize].sort_unstable();
        let mut distinct = 1;
        for lane in 1..count as usize {
            if ids[lane] != ids[distinct - 1] {
                ids[distinct] = ids[lane];
                distinct += 1;
            }
        }
        ids[distinct..].fill(u32::MAX);
        let mut block = TriangleBlock { p: [[[0.0; WIDTH]; 3]; 3], id: ids };
        for (lane, &id) in ids.iter().enumerate() {
            let corners = if lane < distinct { vertices(id) } else { [[f32::NAN; 3]; 3] };
            block.set(lane, &corners, precision);
        }
        block
    };
    let written: &mut [TriangleBlock] = bytemuck::cast_slice_mut(lines);
    if parallel {
        written.par_iter_mut().with_min_len(256).zip(leaves).for_each(|(block, leaf)| *block = make(leaf));
    } else {
        written.iter_mut().zip(leaves).for_each(|(block, leaf)| *block = make(leaf));
    }
}

/// Checks that a [`Child`] can number that many.
pub(super) fn check(what: &'static str, count: usize) -> Result<(), BuildError> {
    if count > Child::LIMIT { Err(BuildError::TooMany { what, count, limit: Child::LIMIT }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::super::bins;
    use super::super::collapse;
    use super::super::item::Item;
    use super::*;
    use crate::SplitMix64;
    use glam::Vec3;

    #[test]
    fn a_plan_does_not_depend_on_the_order_of_its_parts() {
        let mut random = SplitMix64::new(3);
        let mut place = || Vec3::new(random.unit_f32(), random.unit_f32(), random.unit_f32());
        let mut items: Vec<Item> = (0..5000).map(|id| Item::new(&Aabb::around(place(), 0.01), id)).collect();
        let binary = bins::build(&mut items, 4, false);
        let choices = collapse::choose(&binary, WIDTH as u32, false);
        let alone = plan_alone(&binary, &choices, 0, 1);
        assert!(alone.nodes.len() > 100);
        for least in [1, 50, 700] {
            let shared = plan(&binary, &choices, 0, 1, least);
            assert_eq!(shared.leaves, alone.leaves);
            let parts = |node: &Outline| (node.binary, node.first_node, node.first_leaf);
            assert!(shared.nodes.iter().map(parts).eq(alone.nodes.iter().map(parts)), "least {least}");
        }
    }
}
