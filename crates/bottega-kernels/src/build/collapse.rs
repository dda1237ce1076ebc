//! The second stage: choice of the binary nodes that become wide nodes, by dynamic programming.
//!
//! Source: Ylitie, Karras and Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
//! section 3 (the cost C(n, i) of representing the subtree of n by a forest of at most i wide trees). Here a leaf costs
//! the same for one to eight triangles, as they are tested at once.

use super::bins::Binary;
use crate::tree::WIDTH;

/// Time to visit a node, relative to that of a leaf block (measured).
const NODE_COST: f32 = 1.0;
const LEAF_COST: f32 = 1.0;

/// The choice for a binary node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CollapseChoice {
    /// Number of roots given to the first child: `[0]` if the node becomes a wide node with 8 children (0: a leaf),
    /// `[i]` if up to i + 1 roots represent it (0: i suffice).
    split: [u8; WIDTH],
}

impl CollapseChoice {
    /// Returns true if the node is a leaf when a single root represents it.
    pub(super) fn is_leaf(&self) -> bool {
        self.split[0] == 0
    }
}

/// Costs of representing a binary node by up to 1, 2 ... 7 roots.
type Costs = [f32; WIDTH - 1];

/// Least number of nodes for which a subtree is worth another thread.
const PARALLEL_NODES: usize = 1 << 15;

/// Makes the choice for every node.
///
/// - `leaf_limit`: maximal number of items in a leaf. Every leaf of the binary tree must respect it.
/// - `parallel`: use the threads of the current pool.
pub(super) fn choose(nodes: &[Binary], leaf_limit: u32, parallel: bool) -> Vec<CollapseChoice> {
    let mut costs = vec![Costs::default(); nodes.len()];
    let mut choices = vec![CollapseChoice::default(); nodes.len()];
    let least = if parallel { PARALLEL_NODES } else { usize::MAX };
    subtree(nodes, leaf_limit, &mut costs, &mut choices, least);
    choices
}

/// Makes the choices in a subtree, bottom-up: backwards through the preorder.
fn subtree(nodes: &[Binary], leaf_limit: u32, costs: &mut [Costs], choices: &mut [CollapseChoice], least: usize) {
    let mut done = nodes.len();
    if nodes.len() >= least && nodes[0].second != 0 {
        let second = nodes[0].second as usize;
        let (costs, choices) = (costs.split_at_mut(second), choices.split_at_mut(second));
        rayon::join(
            || subtree(&nodes[1..second], leaf_limit, &mut costs.0[1..], &mut choices.0[1..], least),
            || subtree(&nodes[second..], leaf_limit, costs.1, choices.1, least),
        );
        done = 1;
    }
    for index in (0..done).rev() {
        (costs[index], choices[index]) = choice(nodes, costs, index, leaf_limit);
    }
}

/// Returns costs and choice of a node whose children's costs are known.
fn choice(nodes: &[Binary], costs: &[Costs], index: usize, leaf_limit: u32) -> (Costs, CollapseChoice) {
    let node = &nodes[index];
    let area = node.bounds.half_area();
    let leaf_cost = area * LEAF_COST;
    let mut choice = CollapseChoice::default();
    if node.second == 0 {
        debug_assert!(node.count <= leaf_limit);
        return ([leaf_cost; WIDTH - 1], choice);
    }
    let (first, second) = (&costs[index + 1], &costs[index + node.second as usize]);
    let distribute = |roots: usize| {
        (1..roots).fold((f32::INFINITY, 0), |best, k| {
            let cost = first[k - 1] + second[roots - k - 1];
            if cost < best.0 { (cost, k as u8) } else { best }
        })
    };
    // One root: compare a leaf with a wide node
    let mut cost = Costs::default();
    let (below, k) = distribute(WIDTH);
    let inner_cost = area * NODE_COST + below;
    if node.count <= leaf_limit && leaf_cost <= inner_cost {
        cost[0] = leaf_cost;
    } else {
        cost[0] = inner_cost;
        choice.split[0] = k.max(1);
    }
    // Several roots: compare a forest with fewer roots
    for roots in 2..WIDTH {
        let (forest, k) = distribute(roots);
        cost[roots - 1] = cost[roots - 2];
        if forest < cost[roots - 1] {
            cost[roots - 1] = forest;
            choice.split[roots - 1] = k;
        }
    }
    (cost, choice)
}

/// Collects the children of the wide node made of binary node `index`, at most eight. Returns their number.
pub(super) fn children(nodes: &[Binary], choices: &[CollapseChoice], index: usize, out: &mut [usize; WIDTH]) -> usize {
    let mut count = 0;
    let left = choices[index].split[0] as usize;
    collect(nodes, choices, index + 1, left, out, &mut count);
    collect(nodes, choices, index + nodes[index].second as usize, WIDTH - left, out, &mut count);
    count
}

/// Collects the roots of the forest that represents a subtree by at most `roots` of them.
fn collect(
    nodes: &[Binary],
    choices: &[CollapseChoice],
    index: usize,
    mut roots: usize,
    out: &mut [usize; WIDTH],
    count: &mut usize,
) {
    while roots > 1 && choices[index].split[roots - 1] == 0 {
        roots -= 1;
    }
    if roots == 1 {
        out[*count] = index;
        *count += 1;
        return;
    }
    let left = choices[index].split[roots - 1] as usize;
    collect(nodes, choices, index + 1, left, out, count);
    collect(nodes, choices, index + nodes[index].second as usize, roots - left, out, count);
}
