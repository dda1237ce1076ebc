//! The nodes of a tree of voxels: below the root 32³ nodes of 16³ leaves of 8³ voxels.

use glam::IVec3;

/// A level of nodes between the root and the leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeLevel {
    /// Children along each side, as a power of two.
    pub(super) children_log2: u32,
    /// Voxels along each side of a child, as a power of two.
    pub(super) child_log2: u32,
}

/// The nodes below the root.
pub(super) const UPPER: NodeLevel = NodeLevel { children_log2: 5, child_log2: 7 };
/// The nodes above the leaves.
pub(super) const LOWER: NodeLevel = NodeLevel { children_log2: 4, child_log2: 3 };
/// Voxels along each side of a child of the root, as a power of two.
pub(super) const ROOT_CHILD_LOG2: u32 = 12;

impl NodeLevel {
    /// Returns the number of children.
    pub(super) fn count(self) -> usize {
        1 << (3 * self.children_log2)
    }

    /// Returns the lowest voxel of a child, relative to that of the node. Children along z first, then y, then x.
    pub(super) fn child_origin(self, index: usize) -> IVec3 {
        let mask = (1 << self.children_log2) - 1;
        let index = index as i32;
        let place = IVec3::new(index >> (2 * self.children_log2), index >> self.children_log2 & mask, index & mask);
        place << self.child_log2 as i32
    }
}
