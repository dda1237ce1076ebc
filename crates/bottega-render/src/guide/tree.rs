//! Regions of surfaces: a binary tree over space for each of six ways that a surface may face.

use glam::Vec3;

use super::directions::Directions;

/// Ways that a surface may face.
pub(super) const FACES: usize = 6;
/// Cells of an [`Entry`] along its longest side, at most.
const ENTRY_SIDE_MAX: f32 = 32.0;

/// Which of the six axes a normal is nearest to.
#[inline(always)]
pub(super) fn face_of(normal: Vec3) -> usize {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    2 * axis + usize::from(normal[axis] < 0.0)
}

/// A place in a [`Tree`]: where to go on, or where one has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    plane: f32,
    /// The axis in the two high bits, below them the first child; [`LEAF`] there, and the region.
    link: u32,
}

/// In place of an axis.
const LEAF: u32 = 3 << LINK_BITS;
const LINK_BITS: u32 = 30;
const LINK_MASK: u32 = (1 << LINK_BITS) - 1;

impl Node {
    /// A region where the BSDF is as good a guide.
    pub(super) const UNGUIDED: Self = Self { plane: 0.0, link: LEAF | LINK_MASK };

    /// Before and after a plane; the second child follows the first.
    pub(super) fn split(axis: usize, plane: f32, first: usize) -> Self {
        Self { plane, link: (axis as u32) << LINK_BITS | first as u32 & LINK_MASK }
    }

    /// The region of this number.
    pub(super) fn region(number: usize) -> Self {
        Self { plane: 0.0, link: LEAF | number as u32 & LINK_MASK }
    }

    /// Axis, plane and first child; `None`: a leaf.
    #[inline(always)]
    pub(super) fn as_split(self) -> Option<(usize, f32, usize)> {
        let axis = self.link >> LINK_BITS;
        (axis < 3).then_some((axis as usize, self.plane, (self.link & LINK_MASK) as usize))
    }

    /// The number of the region; beyond all where there is none.
    #[inline(always)]
    fn number(self) -> usize {
        (self.link & LINK_MASK) as usize
    }
}

/// Where to enter a tree: a grid, each cell of which knows the deepest node that holds all of it.
#[derive(Clone, Debug, Default)]
struct Entry {
    low: Vec3,
    /// Cells per unit of length.
    scale: Vec3,
    /// Cells along each axis.
    size: [u32; 3],
    nodes: Vec<u32>,
}

impl Entry {
    /// What lies outside the bounds counts to the cell next to it.
    fn new(nodes: &[Node], low: Vec3, high: Vec3) -> Self {
        let extent = high - low;
        let side = (nodes.len() as f32).sqrt().ceil().min(ENTRY_SIDE_MAX);
        let cell = (extent.max_element() / side).max(f32::MIN_POSITIVE);
        let size = extent.to_array().map(|extent| (extent / cell).ceil().clamp(1.0, side) as u32);
        let scale = Vec3::from_array(std::array::from_fn(|axis| size[axis] as f32 / extent[axis].max(f32::MIN_POSITIVE)));
        let edge = |axis: usize, i: u32| match i {
            0 => f32::NEG_INFINITY,
            i if i == size[axis] => f32::INFINITY,
            i => low[axis] + i as f32 / scale[axis],
        };
        let deepest = |cell: [u32; 3]| {
            let mut at = 0;
            while let Some((axis, plane, first)) = nodes[at].as_split() {
                if edge(axis, cell[axis] + 1) <= plane {
                    at = first;
                } else if edge(axis, cell[axis]) >= plane {
                    at = first + 1;
                } else {
                    break;
                }
            }
            at as u32
        };
        let count = size[0] * size[1] * size[2];
        let cell = |i: u32| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
        Self { low, scale, size, nodes: (0..count).map(|i| deepest(cell(i))).collect() }
    }

    #[inline(always)]
    fn at(&self, p: Vec3) -> Option<usize> {
        let place = (p - self.low) * self.scale;
        let along = |axis: usize| (place[axis] as u32).min(self.size[axis].wrapping_sub(1));
        let cell = (along(2) * self.size[1] + along(1)) * self.size[0] + along(0);
        self.nodes.get(cell as usize).map(|&node| node as usize)
    }
}

/// All surfaces that face one way.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    entry: Entry,
    nodes: Vec<Node>,
    regions: Vec<Region>,
}

/// The directions of one region.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// With which probability the guide is followed, not the BSDF.
    pub(super) share: f32,
    pub(super) directions: Directions,
}

impl Region {
    /// With which probability the guide is to be followed.
    #[inline(always)]
    pub(crate) fn share(&self) -> f32 {
        self.share
    }

    /// Density per solid angle with which a direction in world space is drawn by the guide.
    #[inline(always)]
    pub(crate) fn pdf(&self, w: Vec3) -> f32 {
        self.directions.pdf(w)
    }

    /// Draws a direction, with its density.
    #[inline(always)]
    pub(crate) fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        self.directions.sample(u)
    }
}

impl Tree {
    /// - `nodes`: the root first.
    /// - `low`, `high`: bounds of the places that it knows of.
    pub(super) fn new(nodes: Vec<Node>, regions: Vec<Region>, low: Vec3, high: Vec3) -> Self {
        Self { entry: Entry::new(&nodes, low, high), nodes, regions }
    }
}

/// What has been learnt about a view of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Guide {
    pub(super) trees: [Tree; FACES],
}

impl Guide {
    /// The region of a point on a surface whose normal, on the side from which it is seen, is `normal`. `None`: follow the
    /// BSDF.
    #[inline(always)]
    pub(crate) fn at(&self, p: Vec3, normal: Vec3) -> Option<&Region> {
        let tree = &self.trees[face_of(normal)];
        let mut node = *tree.nodes.get(tree.entry.at(p)?)?;
        while let Some((axis, plane, first)) = node.as_split() {
            node = *tree.nodes.get(first + usize::from(p[axis] >= plane))?;
        }
        tree.regions.get(node.number())
    }

    /// Bytes held.
    pub(crate) fn memory_bytes(&self) -> usize {
        let of_tree = |tree: &Tree| {
            size_of_val(&*tree.entry.nodes) + size_of_val(&*tree.nodes) + size_of_val(&*tree.regions)
        };
        self.trees.iter().map(of_tree).sum()
    }
}
