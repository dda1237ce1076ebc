//! Traversal of meshes whose vertices move: boxes and corners between two keys.

use super::Traversal;
use super::lanes::Lanes;
use super::setup::Planes;
use crate::tree::{Child, TriangleBlock, WIDTH, WideNode};

impl<S: Lanes, const ROBUST: bool> Traversal<'_, S, ROBUST> {
    /// Returns the node of the key before the ray's time.
    #[inline(always)]
    pub(super) fn key_node(&self, child: Child) -> &WideNode {
        self.tree.arena.at(child.index() + self.pose.offset)
    }

    /// Returns the planes of a node at the ray's time.
    #[inline(always)]
    pub(super) fn planes_between_keys(&self, child: Child) -> Planes {
        let line = child.index() + self.pose.offset;
        let (from, to): (&WideNode, &WideNode) =
            (self.tree.arena.at(line), self.tree.arena.at(line + self.pose.stride));
        let (rest, share) = (self.s.splat(1.0 - self.pose.share), self.s.splat(self.pose.share));
        let mut planes = [[0.0; WIDTH]; 6];
        for (row, plane) in planes.iter_mut().enumerate() {
            *plane = mixed(self.s, &from.planes[row], &to.planes[row], rest, share);
        }
        planes
    }

    /// Returns a block of triangles at the ray's time.
    #[inline(always)]
    pub(super) fn block_between_keys(&self, leaf: Child) -> TriangleBlock {
        let line = leaf.index() + self.pose.offset;
        let (from, to): (&TriangleBlock, &TriangleBlock) =
            (self.tree.arena.at(line), self.tree.arena.at(line + self.pose.stride));
        let (rest, share) = (self.s.splat(1.0 - self.pose.share), self.s.splat(self.pose.share));
        let mut block = *from;
        for vertex in 0..3 {
            for axis in 0..3 {
                block.p[vertex][axis] = mixed(self.s, &from.p[vertex][axis], &to.p[vertex][axis], rest, share);
            }
        }
        block
    }
}

/// Interpolates linearly. Monotone in both numbers, so the order of boxes and corners is kept.
#[inline(always)]
fn mixed<S: Lanes>(s: S, from: &[f32; WIDTH], to: &[f32; WIDTH], rest: S::F, share: S::F) -> [f32; WIDTH] {
    s.store(s.mul_add(s.load(to), share, s.mul(s.load(from), rest)))
}
