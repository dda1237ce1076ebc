//! The memory layout of the 8-wide tree.

use crate::arena::{Arena, lines_of};
use crate::moving_tree::TreeMotion;
use crate::{Aabb, Precision};
use bytemuck::{Pod, Zeroable};

/// Number of children of a node, and of triangles in a leaf block.
pub(crate) const WIDTH: usize = 8;

/// Maximal depth, respected by the builder (see `build::bins`), so that stacks have a fixed size.
pub(crate) const MAX_DEPTH: usize = 71;

/// A reference to a child: two bits of kind, thirty of index. Nodes and triangle blocks are indexed by their first
/// cache line, spheres and instances one by one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Child(pub(crate) u32);

impl Child {
    /// Exclusive limit of an index.
    pub(crate) const LIMIT: usize = (1 << 30) - 1;
    const SPHERE: u32 = 1 << 30;
    const TRIANGLES: u32 = 2 << 30;
    const INSTANCE: u32 = 3 << 30;
    /// No child: an empty slot, whose box is inverted and never hit, and the end of a traversal.
    pub(crate) const EMPTY: Self = Self(u32::MAX);

    /// Makes a reference to the node at a cache line.
    pub(crate) fn node(index: usize) -> Self {
        Self(index as u32)
    }
    /// Makes a reference to the triangle block at a cache line.
    pub(crate) fn triangles(index: usize) -> Self {
        Self(index as u32 | Self::TRIANGLES)
    }
    /// Makes a reference to a sphere.
    pub(crate) fn sphere(index: usize) -> Self {
        Self(index as u32 | Self::SPHERE)
    }
    /// Makes a reference to an instance.
    pub(crate) fn instance(index: usize) -> Self {
        Self(index as u32 | Self::INSTANCE)
    }
    /// Returns true for a node.
    #[inline(always)]
    pub(crate) fn is_node(self) -> bool {
        self.0 < Self::SPHERE
    }
    /// Returns true for a triangle block.
    #[inline(always)]
    pub(crate) fn is_triangles(self) -> bool {
        self.0 & Self::INSTANCE == Self::TRIANGLES
    }
    /// Returns true for a sphere.
    #[inline(always)]
    pub(crate) fn is_sphere(self) -> bool {
        self.0 & Self::INSTANCE == Self::SPHERE
    }
    /// Returns the index: a cache line, sphere or instance.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & !Self::INSTANCE) as usize
    }
}

/// Eight boxes, their children, and the orders to visit them in: 256 bytes, four cache lines.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct WideNode {
    /// Planes: `[2 · axis + side]`, side 0 lower and 1 upper. Empty slots are inverted: +∞, −∞.
    pub(crate) planes: [[f32; WIDTH]; 6],
    /// Child of each slot.
    pub(crate) children: [Child; WIDTH],
    /// Slots from far to near for each octant of directions (bit `axis` set: negative), three bits each, the farthest
    /// lowest (Fuetterling et al. 2017, "Accelerated Single Ray Tracing for Wide Vector Units"). The highest bit is set
    /// if slots run from far to near by their number rather than from near to far.
    pub(crate) order: [u32; 8],
}

impl WideNode {
    /// Size in cache lines.
    pub(crate) const LINES: usize = lines_of::<Self>();
    /// A node without children.
    pub(crate) const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self { planes: [low, high, low, high, low, high], children: [Child::EMPTY; WIDTH], order: [0o76543210; 8] }
    };

    /// Sets the bounds and the child of a slot, 0 to 7.
    pub(crate) fn set(&mut self, slot: usize, bounds: &Aabb, child: Child) {
        for axis in 0..3 {
            self.planes[2 * axis][slot] = bounds.min[axis];
            self.planes[2 * axis + 1][slot] = bounds.max[axis];
        }
        self.children[slot] = child;
    }

    /// Computes [`Self::order`] from the centers of the first `count` slots; call it when all are set.
    pub(crate) fn sort_octants(&mut self, count: usize) {
        let centers: [[f32; WIDTH]; 3] = std::array::from_fn(|axis| {
            std::array::from_fn(|slot| self.planes[2 * axis][slot] + self.planes[2 * axis + 1][slot])
        });
        let (axis, falling) = slot_axis(&centers, count);
        // Far in one octant is near in the opposite one.
        for octant in 0..4 {
            let mut keys: [(i64, usize); WIDTH] = std::array::from_fn(|slot| {
                let sum = (0..3).fold(0.0, |sum, axis| {
                    if octant >> axis & 1 == 1 { sum - centers[axis][slot] } else { sum + centers[axis][slot] }
                });
                (if slot < count { -total_order(sum) } else { i64::MAX }, slot)
            });
            keys[..count].sort_unstable();
            let pack = |packed: u32, slot: usize| packed << 3 | slot as u32;
            let empty = (count..WIDTH).rev().fold(0, pack);
            self.order[octant] = keys[..count].iter().rev().fold(empty, |packed, key| pack(packed, key.1));
            self.order[octant ^ 7] = keys[..count].iter().fold(empty, |packed, key| pack(packed, key.1));
        }
        for (octant, order) in self.order.iter_mut().enumerate() {
            *order |= u32::from((octant >> axis & 1 == 1) != falling) << 31;
        }
    }
}

/// Returns the axis along which the slots are best sorted, and true if they are descending.
fn slot_axis(centers: &[[f32; WIDTH]; 3], count: usize) -> (usize, bool) {
    let trend = centers.map(|axis| {
        let middle = axis[..count].iter().sum::<f32>() / count as f32;
        axis[..count]
            .iter()
            .zip(0..)
            .map(|(x, slot): (&f32, i32)| (x - middle) * (2 * slot + 1 - count as i32) as f32)
            .sum::<f32>()
    });
    let steeper = |a: usize, b: usize| if trend[b].abs() > trend[a].abs() { b } else { a };
    let axis = steeper(steeper(0, 1), 2);
    (axis, trend[axis] < 0.0)
}

/// Returns a number with the order of `f32::total_cmp`.
fn total_order(x: f32) -> i64 {
    let bits = x.to_bits() as i32;
    i64::from(bits ^ (bits >> 31) & i32::MAX)
}

/// Up to eight triangles, one per lane: 320 bytes, five cache lines.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct TriangleBlock {
    /// Vertices, `[vertex][axis][lane]`. In fast mode vertices 1 and 2 are replaced by the edges from vertex 0. Unused
    /// lanes hold NaN, which is never hit.
    pub(crate) p: [[[f32; WIDTH]; 3]; 3],
    /// Number of each triangle within its space, ascending by lane; `u32::MAX` in unused lanes.
    pub(crate) id: [u32; WIDTH],
}

impl TriangleBlock {
    /// Size in cache lines.
    pub(crate) const LINES: usize = lines_of::<Self>();
    /// Sets the corners of a lane.
    pub(crate) fn set(&mut self, lane: usize, corners: &[[f32; 3]; 3], precision: Precision) {
        for axis in 0..3 {
            let [a, b, c] = corners.map(|p| p[axis]);
            let values = match precision {
                Precision::Robust => [a, b, c],
                Precision::Fast => [a, b - a, c - a],
            };
            for (vertex, value) in values.into_iter().enumerate() {
                self.p[vertex][axis][lane] = value;
            }
        }
    }
}

/// A sphere, as the traversal uses it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sphere {
    /// Center, in world space.
    pub(crate) center: [f32; 3],
    /// Radius, in world space.
    pub(crate) radius: f32,
}

/// An instance of a mesh with a tree of its own.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedTree {
    /// World space to object space, by rows: x, y, z and translation.
    pub(crate) object_from_world: [[f32; 4]; 3],
    /// The root of the mesh's tree.
    pub(crate) root: Child,
    /// Index of the instance in the caller's numbering.
    pub(crate) instance: u32,
    /// Index into [`TreeMotion::placements`]; [`Self::STILL`]: nothing of it moves.
    pub(crate) motion: u32,
}

impl PlacedTree {
    /// The value of [`Self::motion`] of an instance that stands still.
    pub(crate) const STILL: u32 = u32::MAX;
}

/// All trees of a scene.
#[derive(Debug)]
pub(crate) struct SceneTrees {
    /// Nodes and blocks of all trees.
    pub(crate) arena: Arena,
    pub(crate) spheres: Vec<Sphere>,
    /// Instances whose mesh has its own tree.
    pub(crate) placed: Vec<PlacedTree>,
    /// The root of the top-level tree.
    pub(crate) root: Child,
    /// Instances flattened into world space: number of the first triangle and instance, ascending in both.
    pub(crate) flat: Vec<(u32, u32)>,
    /// Moving instances, meshes and spheres.
    pub(crate) motion: TreeMotion,
}

impl SceneTrees {
    /// Returns the node of a reference.
    #[inline(always)]
    pub(crate) fn node(&self, child: Child) -> &WideNode {
        self.arena.at(child.index())
    }

    /// Returns the triangle block of a reference.
    #[inline(always)]
    pub(crate) fn block(&self, child: Child) -> &TriangleBlock {
        self.arena.at(child.index())
    }

    /// Returns the memory of the trees, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.arena.bytes()
            + self.spheres.capacity() * size_of::<Sphere>()
            + self.placed.capacity() * size_of::<PlacedTree>()
            + self.flat.capacity() * size_of::<(u32, u32)>()
            + self.motion.memory_bytes()
    }

    /// Returns instance and primitive of a world-space triangle.
    pub(crate) fn resolve(&self, id: u32) -> (u32, u32) {
        let (start, instance) = self.flat[self.flat.partition_point(|f| f.0 <= id) - 1];
        (instance, id - start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn nodes_and_blocks_have_the_sizes_that_the_memory_budget_counts_with() {
        assert_eq!((size_of::<WideNode>(), size_of::<TriangleBlock>()), (256, 320));
    }

    #[test]
    fn children_remember_their_kind() {
        assert!(Child::node(5).is_node() && !Child::triangles(5).is_node());
        assert!(Child::triangles(7).is_triangles() && Child::sphere(7).is_sphere());
        let instance = Child::instance(9);
        assert!(!instance.is_node() && !instance.is_triangles() && !instance.is_sphere());
        assert_eq!((instance.index(), Child::triangles(7).index(), Child::sphere(3).index()), (9, 7, 3));
    }

    #[test]
    fn octant_order_starts_with_the_farthest_child() {
        let mut node = WideNode::EMPTY;
        for slot in 0..3 {
            node.set(slot, &Aabb::around(Vec3::X * slot as f32, 0.1), Child::node(slot));
        }
        node.sort_octants(3);
        assert_eq!(node.order[0] & 0o777, 0o012, "towards +x slot 2 is far and comes first (lowest)");
        assert_eq!(node.order[1] & 0o777, 0o210);
        for order in node.order {
            let seen = (0..8).fold(0u32, |seen, i| seen | 1 << (order >> (3 * i) & 7));
            assert_eq!(seen, 0xff, "a permutation");
        }
        let backwards = [false, true, false, true, false, true, false, true];
        assert_eq!(node.order.map(|order| order >> 31 == 1), backwards, "by the sign along x");
    }
}
