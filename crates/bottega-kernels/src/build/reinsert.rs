//! Reinsertion of badly placed subtrees where they cost least, between the first and second stage.
//!
//! Source: Bittner, Hapala and Havran 2013, "Fast Insertion-Based Optimization of Bounding Volume Hierarchies". Nodes
//! are taken by decreasing area; the best place is found by branch and bound over the whole tree, then the tree is
//! refitted. A top-down build decides near the root with little knowledge of what is below; this repairs it.
//!
//! Only the top of a large tree is changed; small subtrees stay intact.

use super::bins::Binary;
use crate::Aabb;
use crate::tree::MAX_DEPTH;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::Range;

const NONE: u32 = u32::MAX;
/// One node in this many is reinserted per round.
const SHARE: usize = 6;
const ROUNDS: usize = 2;
/// Maximal number of nodes reinserted per round, to bound the time: the largest matter most.
const MOST: usize = 20_000;
/// Maximal number of nodes visited per insertion.
const PATIENCE: usize = 4096;

/// Subtrees with at most one in this many of all items stay intact.
const TOP: usize = 1 << 16;

#[derive(Clone, Copy)]
struct TreeLink {
    bounds: Aabb,
    parent: u32,
    /// Children, or for a leaf [`LEAF`] | its binary node, and nothing.
    children: [u32; 2],
}

/// Flag of a leaf; not set in any node number.
const LEAF: u32 = 1 << 31;

impl TreeLink {
    fn is_leaf(&self) -> bool {
        self.children[0] & LEAF != 0
    }
}

struct Links {
    nodes: Vec<TreeLink>,
    root: u32,
}

/// A candidate position, with a lower bound of the cost of inserting below it.
struct InsertionPlace {
    least: f32,
    index: u32,
}

impl PartialEq for InsertionPlace {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for InsertionPlace {}
impl PartialOrd for InsertionPlace {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for InsertionPlace {
    /// Orders in reverse, because the heap returns the largest and the cheapest must come first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.least.total_cmp(&self.least).then(other.index.cmp(&self.index))
    }
}

impl Links {
    fn new(binary: &[Binary]) -> Self {
        let small = binary[0].count / TOP as u32;
        let mut nodes: Vec<TreeLink> = Vec::new();
        // Binary node, parent, and slot in the parent.
        let mut stack = vec![(0usize, NONE, 0)];
        while let Some((index, parent, slot)) = stack.pop() {
            let this = nodes.len() as u32;
            if parent != NONE {
                nodes[parent as usize].children[slot] = this;
            }
            let node = &binary[index];
            let mut children = [NONE; 2];
            if node.second == 0 || node.count <= small {
                children[0] = LEAF | index as u32;
            } else {
                stack.extend([(index + node.second as usize, this, 1), (index + 1, this, 0)]);
            }
            nodes.push(TreeLink { bounds: node.bounds, parent, children });
        }
        Self { nodes, root: 0 }
    }

    fn at(&mut self, index: u32) -> &mut TreeLink {
        &mut self.nodes[index as usize]
    }

    /// Replaces the child `old` of a parent by `new`.
    fn replace(&mut self, parent: u32, old: u32, new: u32) {
        self.at(new).parent = parent;
        if parent == NONE {
            self.root = new;
        } else {
            let slot = usize::from(self.nodes[parent as usize].children[1] == old);
            self.at(parent).children[slot] = new;
        }
    }

    /// Recomputes boxes from a node up to the root.
    fn refit(&mut self, mut index: u32) {
        while index != NONE {
            let [a, b] = self.nodes[index as usize].children;
            let bounds = self.nodes[a as usize].bounds.union(&self.nodes[b as usize].bounds);
            if bounds == self.nodes[index as usize].bounds {
                return;
            }
            self.at(index).bounds = bounds;
            index = self.nodes[index as usize].parent;
        }
    }

    /// Removes a subtree with its parent, and inserts both where they add the least area.
    fn reinsert(&mut self, index: u32, heap: &mut BinaryHeap<InsertionPlace>) {
        let parent = self.nodes[index as usize].parent;
        if parent == NONE || self.nodes[parent as usize].parent == NONE {
            return;
        }
        // Remove the subtree and its parent
        let grandparent = self.nodes[parent as usize].parent;
        let [a, b] = self.nodes[parent as usize].children;
        let sibling = if a == index { b } else { a };
        self.replace(grandparent, parent, sibling);
        self.refit(grandparent);
        // Find the best position, and insert both there
        let place = self.best_place(&self.nodes[index as usize].bounds, sibling, heap);
        let above = self.nodes[place as usize].parent;
        self.replace(above, place, parent);
        let bounds = self.nodes[index as usize].bounds.union(&self.nodes[place as usize].bounds);
        *self.at(parent) = TreeLink { bounds, parent: above, children: [place, index] };
        self.at(place).parent = parent;
        self.at(index).parent = parent;
        self.refit(above);
    }

    /// Returns the node to pair with: the one with the least area of the new pair plus growth of all its ancestors.
    fn best_place(&self, bounds: &Aabb, first: u32, heap: &mut BinaryHeap<InsertionPlace>) -> u32 {
        let area = bounds.half_area();
        let (mut best, mut best_cost) = (first, self.cost(bounds, first));
        heap.clear();
        heap.push(InsertionPlace { least: 0.0, index: self.root });
        for _ in 0..PATIENCE {
            let Some(InsertionPlace { least, index }) = heap.pop() else { break };
            if least + area >= best_cost {
                break;
            }
            let node = &self.nodes[index as usize];
            let pair = node.bounds.union(bounds).half_area();
            if least + pair < best_cost {
                (best, best_cost) = (index, least + pair);
            }
            let grown = least + pair - node.bounds.half_area();
            if !node.is_leaf() && grown + area < best_cost {
                heap.extend(node.children.map(|index| InsertionPlace { least: grown, index }));
            }
        }
        best
    }

    fn cost(&self, bounds: &Aabb, index: u32) -> f32 {
        let mut cost = self.nodes[index as usize].bounds.union(bounds).half_area();
        let mut above = self.nodes[index as usize].parent;
        while above != NONE {
            let node = &self.nodes[above as usize];
            cost += node.bounds.union(bounds).half_area() - node.bounds.half_area();
            above = node.parent;
        }
        cost
    }
}

/// Returns the number of levels below a node.
fn height(binary: &[Binary], index: usize) -> usize {
    match binary[index].second {
        0 => 0,
        second => 1 + height(binary, index + 1).max(height(binary, index + second as usize)),
    }
}

/// Returns the nodes of a subtree, which are consecutive.
fn subtree(binary: &[Binary], index: usize) -> &[Binary] {
    let mut last = index;
    while binary[last].second != 0 {
        last += binary[last].second as usize;
    }
    &binary[index..=last]
}

/// Returns an improved tree, and the items' numbers in its order. `None` if the tree is too small or too large, or the
/// result too deep.
///
/// - `parallel`: use the threads of the current pool; the result does not depend on it.
pub(super) fn optimize(binary: &[Binary], ids: &[u32], parallel: bool) -> Option<(Vec<Binary>, Vec<u32>)> {
    if binary.len() < 8 || binary.len() >= LEAF as usize {
        return None;
    }
    let mut links = Links::new(binary);
    let mut heap = BinaryHeap::new();
    for _ in 0..ROUNDS {
        // Choose the nodes of largest area
        let mut order: Vec<u32> = (0..links.nodes.len() as u32).filter(|&i| i != links.root).collect();
        let area = |i: &u32| links.nodes[*i as usize].bounds.half_area();
        let larger = |a: &u32, b: &u32| area(b).total_cmp(&area(a)).then(a.cmp(b));
        let count = (order.len() / SHARE).min(MOST);
        if count < order.len() {
            order.select_nth_unstable_by(count, larger);
        }
        order.truncate(count);
        order.sort_unstable_by(larger);
        for index in order {
            links.reinsert(index, &mut heap);
        }
    }
    links.rebuild(binary, ids, parallel)
}

/// An intact subtree in the new tree.
struct MovedNode {
    /// The first node of the subtree in the old tree.
    from: u32,
    /// The nodes of the subtree in the new tree.
    nodes: Range<u32>,
    /// The first item of the subtree in the new tree.
    first: u32,
    /// Number of levels above it.
    depth: usize,
}

/// Inner nodes of the top, each with its number, and the subtrees below them; both in preorder.
#[derive(Default)]
struct SubtreeOrder {
    inner: Vec<(u32, Binary)>,
    moved: Vec<MovedNode>,
}

impl Links {
    /// Rebuilds the tree in preorder.
    fn rebuild(self, binary: &[Binary], ids: &[u32], parallel: bool) -> Option<(Vec<Binary>, Vec<u32>)> {
        let SubtreeOrder { inner, moved } = self.order(binary);
        let (mut nodes, mut order) = (Vec::new(), Vec::new());
        let pieces = pieces(&moved, &mut nodes, &mut order, (binary.len(), ids.len()), parallel);
        let copy = |(moved, nodes, order): (&MovedNode, &mut [Binary], &mut [u32])| {
            let (from, old) = (moved.from as usize, binary[moved.from as usize].first);
            for (node, old_node) in nodes.iter_mut().zip(&binary[from..]) {
                *node = Binary { first: old_node.first - old + moved.first, ..*old_node };
            }
            order.copy_from_slice(&ids[old as usize..][..order.len()]);
            moved.depth + height(nodes, 0) + 2 < MAX_DEPTH
        };
        // Stop early if one is too deep: then the result is discarded.
        let is_shallow = if parallel { pieces.into_par_iter().all(copy) } else { pieces.into_iter().all(copy) };
        if !is_shallow {
            return None;
        }
        for (at, node) in inner.into_iter().rev() {
            let at = at as usize;
            let count = nodes[at + 1].count + nodes[at + node.second as usize].count;
            nodes[at] = Binary { count, ..node };
        }
        Some((nodes, order))
    }

    /// Assigns new positions. The item counts of inner nodes are not yet known.
    fn order(&self, binary: &[Binary]) -> SubtreeOrder {
        let mut order = SubtreeOrder::default();
        let (mut next, mut first) = (0, 0);
        // Node, depth, and the index of the parent among the inner nodes if this is its second child.
        let mut stack = vec![(self.root, 0, None::<usize>)];
        while let Some((index, depth, parent)) = stack.pop() {
            if let Some(parent) = parent {
                let (at, parent) = &mut order.inner[parent];
                parent.second = next - *at;
            }
            let TreeLink { bounds, children, .. } = self.nodes[index as usize];
            if children[0] & LEAF != 0 {
                let from = children[0] & !LEAF;
                let subtree = subtree(binary, from as usize);
                let nodes = next..next + subtree.len() as u32;
                next = nodes.end;
                order.moved.push(MovedNode { from, nodes, first, depth });
                first += subtree[0].count;
            } else {
                stack.push((children[1], depth + 1, Some(order.inner.len())));
                stack.push((children[0], depth + 1, None));
                order.inner.push((next, Binary { bounds, first, count: 0, second: 0 }));
                next += 1;
            }
        }
        order
    }
}

/// Returns for each moved subtree the destinations of its nodes and items.
///
/// - `nodes`, `items`: resized to `lengths`.
fn pieces<'a>(
    moved: &'a [MovedNode],
    nodes: &'a mut Vec<Binary>,
    items: &'a mut Vec<u32>,
    lengths: (usize, usize),
    parallel: bool,
) -> Vec<(&'a MovedNode, &'a mut [Binary], &'a mut [u32])> {
    const NOTHING: Binary = Binary { bounds: Aabb::EMPTY, first: 0, count: 0, second: 0 };
    if parallel {
        // Touch the memory in parallel: page faults take as long as the writes.
        rayon::join(
            || (0..lengths.0).into_par_iter().map(|_| NOTHING).collect_into_vec(nodes),
            || (0..lengths.1).into_par_iter().map(|_| 0).collect_into_vec(items),
        );
    } else {
        nodes.resize(lengths.0, NOTHING);
        items.resize(lengths.1, 0);
    }
    let (mut nodes, mut items, mut next) = (&mut nodes[..], &mut items[..], 0);
    let mut pieces = Vec::with_capacity(moved.len());
    for (index, piece) in moved.iter().enumerate() {
        let rest = std::mem::take(&mut nodes).split_at_mut((piece.nodes.start - next) as usize).1;
        let (own, rest) = rest.split_at_mut(piece.nodes.len());
        (nodes, next) = (rest, piece.nodes.end);
        let count = moved.get(index + 1).map_or(items.len(), |after| (after.first - piece.first) as usize);
        let (own_items, rest) = std::mem::take(&mut items).split_at_mut(count);
        items = rest;
        pieces.push((piece, own, own_items));
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::super::bins;
    use super::super::item::Item;
    use super::*;
    use crate::SplitMix64;
    use glam::Vec3;

    #[test]
    fn the_tree_gets_cheaper_and_keeps_every_item_in_its_box() {
        let mut random = SplitMix64::new(5);
        let mut boxes = Vec::new();
        for id in 0..3000 {
            let center = Vec3::new(random.unit_f32(), random.unit_f32() * 0.1, random.unit_f32());
            boxes.push(Aabb::around(center, if id % 9 == 0 { 0.2 * random.unit_f32() } else { 0.005 }));
        }
        let mut items: Vec<Item> = boxes.iter().enumerate().map(|(id, b)| Item::new(b, id as u32)).collect();
        let before = bins::build(&mut items, 4, false);
        let area = |nodes: &[Binary]| nodes.iter().map(|node| node.bounds.half_area()).sum::<f32>();
        let cost = area(&before);
        let ids: Vec<u32> = items.iter().map(Item::id).collect();
        let (shared, shared_ids) = optimize(&before, &ids, true).expect("not too deep");
        let (after, mut ids) = optimize(&before, &ids, false).expect("not too deep");
        let parts = |node: &Binary| (node.bounds, node.first, node.count, node.second);
        assert!(shared.iter().map(parts).eq(after.iter().map(parts)) && shared_ids == ids, "threads show");
        assert!(area(&after) < 0.98 * cost, "{} against {cost}", area(&after));
        for node in &after {
            for &id in &ids[node.first as usize..(node.first + node.count) as usize] {
                let b = boxes[id as usize];
                assert!(b.min.cmpge(node.bounds.min).all() && b.max.cmple(node.bounds.max).all());
            }
        }
        assert_eq!(after[0].count, 3000);
        ids.sort_unstable();
        assert!(ids.iter().copied().eq(0..3000));
    }
}
