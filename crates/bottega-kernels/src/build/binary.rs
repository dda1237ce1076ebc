//! Binary trees over shapes in world space, for callers with their own node format, such as a GPU.

use super::bins::{self, Binary};
use super::item::Item;
use super::{SPLIT_BUDGET, is_flat, presplit, reinsert, with_threads};
use crate::Aabb;
use glam::Vec3;

/// A shape in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A triangle, by its corners.
    Triangle([Vec3; 3]),
    /// Any other shape, by its bounds.
    Within(Aabb),
}

/// A binary tree, built like [`Accel`](crate::Accel)'s: surface area heuristic over bins, with long triangles split
/// before and badly placed subtrees reinserted after. Independent of the number of threads.
#[derive(Clone, Debug, Default)]
pub struct BinaryTree {
    /// Nodes in preorder, the root first; empty without shapes.
    pub nodes: Vec<Binary>,
    /// Indices of the shapes in the order of the leaves. A split shape occurs several times.
    pub items: Vec<u32>,
}

impl BinaryTree {
    /// Builds the tree over `shapes`, all finite, fewer than 2³¹. Triangles without area are in no leaf.
    ///
    /// - `leaf_size`: maximal number of shapes in a leaf.
    /// - `threads`: number of CPU threads; 0: all.
    pub fn build(shapes: &[Shape], leaf_size: usize, threads: usize) -> Self {
        with_threads(threads, |parallel| {
            let corners = |id: u32| match shapes[id as usize] {
                Shape::Triangle(corners) => corners.map(|corner| corner.to_array()),
                Shape::Within(bounds) => [bounds.min, bounds.max, bounds.max].map(|corner| corner.to_array()),
            };
            // Reserve capacity for splits.
            let (mut items, mut others) = (Vec::with_capacity(shapes.len() + shapes.len() / SPLIT_BUDGET), Vec::new());
            for (shape, id) in shapes.iter().zip(0..) {
                match shape {
                    Shape::Triangle([a, b, c]) if !is_flat(&corners(id)) => {
                        items.push(Item::new(&Aabb::EMPTY.with(*a).with(*b).with(*c), id));
                    }
                    Shape::Triangle(_) => {}
                    Shape::Within(bounds) => others.push(Item::new(bounds, id)),
                }
            }
            let budget = items.len() / SPLIT_BUDGET;
            presplit::presplit(&mut items, budget, parallel, corners);
            items.append(&mut others);
            let nodes = bins::build(&mut items, leaf_size, parallel);
            let items: Vec<u32> = items.iter().map(Item::id).collect();
            let better = if nodes.is_empty() { None } else { reinsert::optimize(&nodes, &items, parallel) };
            let (nodes, items) = better.unwrap_or((nodes, items));
            Self { nodes, items }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vec3(size: f32) -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-size..size).prop_map(Vec3::from)
    }

    fn shape() -> impl Strategy<Value = Shape> {
        let triangle = (vec3(100.0), vec3(20.0), vec3(1.0)).prop_map(|(a, u, v)| Shape::Triangle([a, a + u, a + v]));
        let within =
            (vec3(100.0), 0.01_f32..9.0).prop_map(|(center, radius)| Shape::Within(Aabb::around(center, radius)));
        prop_oneof![4 => triangle, 1 => within]
    }

    proptest! {
        #[test]
        fn every_shape_is_covered_by_the_leaves_that_name_it(shapes in prop::collection::vec(shape(), 0..300), threads in 1_usize..3) {
            let tree = BinaryTree::build(&shapes, 3, threads);
            let mut covered = vec![Aabb::EMPTY; shapes.len()];
            for (index, node) in tree.nodes.iter().enumerate() {
                let items = &tree.items[node.first as usize..][..node.count as usize];
                if node.second == 0 {
                    prop_assert!(items.len() <= 3 && !items.is_empty());
                    for &item in items {
                        covered[item as usize] = covered[item as usize].union(&node.bounds);
                    }
                } else {
                    let children = [&tree.nodes[index + 1], &tree.nodes[index + node.second as usize]];
                    for child in children {
                        prop_assert_eq!(node.bounds.union(&child.bounds), node.bounds);
                    }
                    prop_assert_eq!(children[0].count + children[1].count, node.count);
                }
            }
            for (shape, covered) in shapes.iter().zip(covered) {
                let bounds = match shape {
                    Shape::Triangle([a, b, c]) => Aabb::EMPTY.with(*a).with(*b).with(*c),
                    Shape::Within(bounds) => *bounds,
                };
                // The bounds of cut triangles are rounded outwards.
                prop_assert_eq!(covered.union(&bounds), covered);
            }
        }
    }
}
