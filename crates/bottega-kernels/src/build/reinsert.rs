//! Between the first and the second stage: subtrees that lie badly are taken out and put where they cost least.
//!
//! Source: Bittner, Hapala and Havran 2013, "Fast Insertion-Based Optimization of Bounding Volume Hierarchies". Nodes are
//! taken by decreasing area; the best place is found by branch and bound over the whole tree, then the tree is refitted.
//! A top-down build decides near the root with little knowledge of what is below; this repairs it.

use super::bins::{Binary, Item};
use crate::Aabb;
use crate::tree::MAX_DEPTH;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

const NONE: u32 = u32::MAX;
/// One node in so many is taken out in each round.
const SHARE: usize = 6;
const ROUNDS: usize = 2;
/// And no more than this, so that the time is bounded: the largest matter most.
const MOST: usize = 20_000;
/// Nodes looked at for one insertion, at most.
const PATIENCE: usize = 4096;

#[derive(Clone, Copy)]
struct Link {
    bounds: Aabb,
    parent: u32,
    /// For a leaf [`LEAF`] | number of items, and the first of them.
    children: [u32; 2],
}

/// No node has this bit in its number.
const LEAF: u32 = 1 << 31;

impl Link {
    fn is_leaf(&self) -> bool {
        self.children[0] & LEAF != 0
    }
}

struct Links {
    nodes: Vec<Link>,
    root: u32,
}

/// A place that may be worth a look: what inserting below it costs at least.
struct Candidate {
    least: f32,
    index: u32,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    /// The heap gives the largest; the cheapest shall come first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.least.total_cmp(&self.least).then(other.index.cmp(&self.index))
    }
}

impl Links {
    fn new(binary: &[Binary]) -> Self {
        let leaf =
            |node: &Binary| Link { bounds: node.bounds, parent: NONE, children: [LEAF | node.count, node.first] };
        let mut nodes: Vec<Link> = binary.iter().map(leaf).collect();
        for (index, node) in binary.iter().enumerate().filter(|(_, node)| node.second != 0) {
            let children = [index as u32 + 1, index as u32 + node.second];
            nodes[index].children = children;
            for child in children {
                nodes[child as usize].parent = index as u32;
            }
        }
        Self { nodes, root: 0 }
    }

    fn at(&mut self, index: u32) -> &mut Link {
        &mut self.nodes[index as usize]
    }

    /// Puts `new` where `old` hangs.
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

    /// Takes a subtree out, with its parent, and puts both where they add the least area.
    fn reinsert(&mut self, index: u32, heap: &mut BinaryHeap<Candidate>) {
        let parent = self.nodes[index as usize].parent;
        if parent == NONE || self.nodes[parent as usize].parent == NONE {
            return;
        }
        let grandparent = self.nodes[parent as usize].parent;
        let [a, b] = self.nodes[parent as usize].children;
        let sibling = if a == index { b } else { a };
        self.replace(grandparent, parent, sibling);
        self.refit(grandparent);
        let place = self.best_place(&self.nodes[index as usize].bounds, sibling, heap);
        let above = self.nodes[place as usize].parent;
        self.replace(above, place, parent);
        let bounds = self.nodes[index as usize].bounds.union(&self.nodes[place as usize].bounds);
        *self.at(parent) = Link { bounds, parent: above, children: [place, index] };
        self.at(place).parent = parent;
        self.at(index).parent = parent;
        self.refit(above);
    }

    /// The node to pair with: the new pair's area plus the growth of everything above is the least.
    fn best_place(&self, bounds: &Aabb, first: u32, heap: &mut BinaryHeap<Candidate>) -> u32 {
        let area = bounds.half_area();
        let (mut best, mut best_cost) = (first, self.cost(bounds, first));
        heap.clear();
        heap.push(Candidate { least: 0.0, index: self.root });
        for _ in 0..PATIENCE {
            let Some(Candidate { least, index }) = heap.pop() else { break };
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
                heap.extend(node.children.map(|index| Candidate { least: grown, index }));
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

/// Improves a tree; items are reordered along with it. `None` when the result would be too deep: the items are then as
/// they were.
pub(super) fn optimize(binary: Vec<Binary>, items: &mut Vec<Item>) -> Option<Vec<Binary>> {
    if binary.len() < 8 || binary.len() >= LEAF as usize {
        return Some(binary);
    }
    let mut links = Links::new(&binary);
    drop(binary);
    let mut heap = BinaryHeap::new();
    for _ in 0..ROUNDS {
        let mut order: Vec<u32> = (0..links.nodes.len() as u32).filter(|&i| i != links.root).collect();
        let area = |i: &u32| links.nodes[*i as usize].bounds.half_area();
        let larger = |a: &u32, b: &u32| area(b).total_cmp(&area(a)).then(a.cmp(b));
        let count = (order.len() / SHARE).min(MOST);
        order.select_nth_unstable_by(count, larger);
        order.truncate(count);
        order.sort_unstable_by(larger);
        for index in order {
            links.reinsert(index, &mut heap);
        }
    }
    links.rebuild(items)
}

impl Links {
    /// The tree in preorder again.
    fn rebuild(self, items: &mut Vec<Item>) -> Option<Vec<Binary>> {
        let mut nodes: Vec<Binary> = Vec::with_capacity(self.nodes.len());
        let mut order: Vec<u32> = Vec::with_capacity(items.len());
        // Node, depth, and the parent where it is a second child.
        let mut stack = vec![(self.root, 0, NONE)];
        while let Some((index, depth, parent)) = stack.pop() {
            if depth + 2 >= MAX_DEPTH {
                return None;
            }
            let this = nodes.len() as u32;
            if parent != NONE {
                nodes[parent as usize].second = this - parent;
            }
            let Link { bounds, children, .. } = self.nodes[index as usize];
            let first = order.len() as u32;
            if children[0] & LEAF != 0 {
                order.extend(children[1]..children[1] + (children[0] & !LEAF));
            } else {
                stack.push((children[1], depth + 1, this));
                stack.push((children[0], depth + 1, NONE));
            }
            nodes.push(Binary { bounds, first, count: order.len() as u32 - first, second: 0 });
        }
        for index in (0..nodes.len()).rev() {
            if nodes[index].second != 0 {
                nodes[index].count = nodes[index + 1].count + nodes[index + nodes[index].second as usize].count;
            }
        }
        drop(self); // Before the copy of the items, which is as large.
        *items = order.iter().map(|&index| items[index as usize]).collect();
        Some(nodes)
    }
}

#[cfg(test)]
mod tests {
    use super::super::bins;
    use super::*;
    use crate::bench::Random;
    use glam::Vec3;

    #[test]
    fn the_tree_gets_cheaper_and_keeps_every_item_in_its_box() {
        let mut random = Random::new(5);
        let mut boxes = Vec::new();
        for id in 0..3000 {
            let center = Vec3::new(random.unit(), random.unit() * 0.1, random.unit());
            boxes.push(Aabb::around(center, if id % 9 == 0 { 0.2 * random.unit() } else { 0.005 }));
        }
        let mut items: Vec<Item> = boxes.iter().enumerate().map(|(id, b)| Item::new(b, id as u32)).collect();
        let before = bins::build(&mut items, 4, false);
        let area = |nodes: &[Binary]| nodes.iter().map(|node| node.bounds.half_area()).sum::<f32>();
        let cost = area(&before);
        let after = optimize(before, &mut items).expect("not too deep");
        assert!(area(&after) < 0.98 * cost, "{} against {cost}", area(&after));
        let mut ids: Vec<u32> = items.iter().map(Item::id).collect();
        ids.sort_unstable();
        assert!(ids.iter().copied().eq(0..3000));
        for node in &after {
            for item in &items[node.first as usize..(node.first + node.count) as usize] {
                let b = boxes[item.id() as usize];
                assert!(b.min.cmpge(node.bounds.min).all() && b.max.cmple(node.bounds.max).all());
            }
        }
        assert_eq!(after[0].count, 3000);
    }
}
