//! Regions of surfaces: a binary tree over space for each of six facings.

use std::slice;

use bottega_kernels::prefetch;
use glam::Vec3;

use super::{
    agent::{PictureWorth, RegionAgent},
    directions::Directions,
    plan::PaintPlan,
};

/// Number of facings: the signed axes.
pub(super) const FACES: usize = 6;
/// Greatest number of cells of a [`Lattice`] along a side, and in total.
const LATTICE_SIDE_MAX: f32 = 64.0;
const LATTICE_CELLS_MAX: f32 = 32768.0;

/// Returns the facing of a normal: the signed axis nearest to it.
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

/// A node of a [`Tree`]: a split or a leaf.
#[derive(Clone, Copy, Debug)]
pub(super) struct GuideNode {
    plane: f32,
    /// Axis in the two high bits and index of the first child below; for a leaf [`LEAF`] and the number of the region.
    link: u32,
}

/// Link bits of a leaf, in place of an axis.
const LEAF: u32 = 3 << LINK_BITS;
const LINK_BITS: u32 = 30;
const LINK_MASK: u32 = (1 << LINK_BITS) - 1;

impl GuideNode {
    /// A leaf without directions.
    pub(super) const UNGUIDED: Self = Self { plane: 0.0, link: LEAF | LINK_MASK };

    /// Returns a split by a plane; the second child follows the first.
    pub(super) fn split(axis: usize, plane: f32, first: usize) -> Self {
        Self { plane, link: (axis as u32) << LINK_BITS | first as u32 & LINK_MASK }
    }

    /// Returns the leaf of a region.
    pub(super) fn region(number: usize) -> Self {
        Self { plane: 0.0, link: LEAF | number as u32 & LINK_MASK }
    }

    /// Returns the byte form.
    pub(super) fn to_numbers(self) -> [u32; 2] {
        [self.plane.to_bits(), self.link]
    }

    /// Reads the byte form.
    pub(super) fn from_numbers([plane, link]: [u32; 2]) -> Self {
        Self { plane: f32::from_bits(plane), link }
    }

    /// Returns axis, plane and first child; `None`: a leaf.
    #[inline(always)]
    pub(super) fn as_split(self) -> Option<(usize, f32, usize)> {
        let axis = self.link >> LINK_BITS;
        (axis < 3).then_some((axis as usize, self.plane, (self.link & LINK_MASK) as usize))
    }

    /// Returns the number of the leaf; beyond all regions and agents if it has none.
    #[inline(always)]
    fn number(self) -> usize {
        (self.link & LINK_MASK) as usize
    }
}

/// A grid on whose planes trees prefer to split.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lattice {
    /// Low corner, in world space.
    low: Vec3,
    /// Cells per unit of length.
    scale: Vec3,
    /// Cells along each axis.
    size: [u32; 3],
}

impl Lattice {
    /// Creates a lattice over a box, with roughly cubic cells.
    pub(super) fn new(low: Vec3, high: Vec3) -> Self {
        let extent = (high - low).max(Vec3::splat(f32::MIN_POSITIVE));
        let size_of = |cell: f32| extent.to_array().map(|extent| (extent / cell).ceil().clamp(1.0, LATTICE_SIDE_MAX));
        let mut cell = extent.max_element() / LATTICE_SIDE_MAX;
        while size_of(cell).iter().product::<f32>() > LATTICE_CELLS_MAX {
            cell *= 1.25;
        }
        let size = size_of(cell);
        Self { low, scale: Vec3::from_array(size) / extent, size: size.map(|size| size as u32) }
    }

    /// Creates a lattice over positions: over all of them, or over most where a few are far away. Positions outside
    /// count as in the nearest cell.
    pub(super) fn over(places: &[Vec3]) -> Self {
        /// Ratio of the extent of all positions to that of most from which only most count.
        const WIDE: f32 = 8.0;
        /// Number of positions that the extent of most is estimated from.
        const SOME: usize = 4095;
        let grow = |(low, high): (Vec3, Vec3), &p: &Vec3| (low.min(p), high.max(p));
        let (low, high) = places.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), grow);
        let some: Vec<Vec3> = places.iter().step_by(places.len() / SOME + 1).copied().collect();
        // Leave out a fiftieth on each side
        let most = |axis: usize| {
            let mut along: Vec<f32> = some.iter().map(|p| p[axis]).collect();
            along.sort_by(f32::total_cmp);
            let cut = along.len() / 50;
            (!along.is_empty()).then(|| (along[cut], along[along.len() - 1 - cut]))
        };
        let (Some(x), Some(y), Some(z)) = (most(0), most(1), most(2)) else { return Self::new(low, high) };
        let (from, to) = (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1));
        let is_wide = (high - low).max_element() > WIDE * (to - from).max_element();
        if is_wide { Self::new(from, to) } else { Self::new(low, high) }
    }

    /// Returns the byte form.
    pub(super) fn to_numbers(self) -> [u32; 9] {
        let [low, scale] = [self.low, self.scale].map(|it| it.to_array().map(f32::to_bits));
        let numbers = [low, scale, self.size];
        std::array::from_fn(|i| numbers[i / 3][i % 3])
    }

    /// Reads the byte form. `None`: not valid.
    pub(super) fn from_numbers(numbers: [u32; 9]) -> Option<Self> {
        let vector = |i: usize| Vec3::from_array(std::array::from_fn(|axis| f32::from_bits(numbers[i + axis])));
        let lattice = Self { low: vector(0), scale: vector(3), size: [numbers[6], numbers[7], numbers[8]] };
        let is_sized = lattice.size.iter().all(|&size| size as f32 <= LATTICE_SIDE_MAX)
            && lattice.size.iter().product::<u32>() as f32 <= LATTICE_CELLS_MAX;
        (is_sized && lattice.low.is_finite() && lattice.scale.cmpge(Vec3::ZERO).all()).then_some(lattice)
    }

    /// Returns the position of plane `i` along an axis.
    fn plane(&self, axis: usize, i: f32) -> f32 {
        self.low[axis] + i / self.scale[axis]
    }

    /// Returns the plane of the grid nearest to a coordinate.
    pub(super) fn nearest(&self, axis: usize, place: f32) -> f32 {
        self.plane(axis, ((place - self.low[axis]) * self.scale[axis]).round())
    }

    /// Returns the cell of a position, or the nearest one if outside.
    #[inline(always)]
    fn cell(&self, p: Vec3) -> usize {
        let place = (p - self.low) * self.scale;
        let along = |axis: usize| (place[axis] as u32).min(self.size[axis].wrapping_sub(1));
        ((along(2) * self.size[1] + along(1)) * self.size[0] + along(0)) as usize
    }

    /// Returns for each cell and tree the deepest node that contains the whole cell, among those whose index fits into
    /// a [`LatticeEntry`]. The root of a tree is the node with the index of its facing.
    fn entries(&self, nodes: &[GuideNode]) -> Vec<LatticeEntry> {
        let edge = |axis: usize, i: u32| match i {
            0 => f32::NEG_INFINITY,
            i if i == self.size[axis] => f32::INFINITY,
            i => self.plane(axis, i as f32),
        };
        let deepest = |cell: [u32; 3], root: usize| {
            let mut number = root;
            while let Some((axis, plane, first)) = nodes.get(number).and_then(|node| node.as_split()) {
                number = if first >= usize::from(u16::MAX) {
                    break;
                } else if edge(axis, cell[axis] + 1) <= plane {
                    first
                } else if edge(axis, cell[axis]) >= plane {
                    first + 1
                } else {
                    break;
                }
            }
            number as u16
        };
        let [columns, rows, layers] = self.size;
        let cell = |i: u32| [i % columns, i / columns % rows, i / (columns * rows)];
        let entry =
            |i: u32| LatticeEntry(std::array::from_fn(|root| if root < FACES { deepest(cell(i), root) } else { 0 }));
        (0..columns * rows * layers).map(entry).collect()
    }
}

/// Entry points of a cell into the trees: indices of nodes, one per facing.
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
struct LatticeEntry([u16; 8]);

/// The regions of all surfaces with one facing.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    /// Nodes, the root first; empty where nothing is known. Leaves hold numbers of regions, or of agents in
    /// [lone](Self::lone).
    pub(super) nodes: Vec<GuideNode>,
    /// Directions of the regions.
    pub(super) regions: Vec<Region>,
    /// Agents of the regions, if agents are learned.
    pub(super) agents: Vec<RegionAgent>,
    /// Agents of leaves without directions; their leaf numbers start at [`LONE`].
    pub(super) lone: Vec<RegionAgent>,
}

/// First leaf number of agents without directions.
pub(super) const LONE: usize = 1 << 29;

/// The directions of one region, laid out so that a lookup starts in one cache line.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Region {
    /// Probability of sampling the guide instead of the BSDF, in [0, 1].
    pub(super) share: f32,
    /// Density of directions.
    pub(super) directions: Directions,
}

impl Region {
    /// Returns the probability of sampling the guide instead of the BSDF, in [0, 1].
    #[inline(always)]
    pub(crate) fn share(&self) -> f32 {
        self.share
    }

    /// Prefetches what sampling reads first.
    #[inline(always)]
    pub(crate) fn request(&self) {
        prefetch(slice::from_ref(&self.share), 0);
        self.directions.request();
    }

    /// Returns the guide's density of a world-space direction, in sr⁻¹.
    #[inline(always)]
    pub(crate) fn pdf(&self, w: Vec3) -> f32 {
        self.directions.pdf(w)
    }

    /// Samples a direction, and returns it with its density in sr⁻¹.
    #[inline(always)]
    pub(crate) fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        self.directions.sample(u)
    }
}

/// All that was learned about a view of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Guide {
    lattice: Lattice,
    entries: Vec<LatticeEntry>,
    /// Nodes of all trees; the roots first.
    nodes: Vec<GuideNode>,
    regions: Vec<Region>,
    /// Agents of the regions, then of leaves without directions. Empty if only directions were learned.
    agents: Vec<RegionAgent>,
    expected: PictureWorth,
    /// The way of rendering in each zone of the picture.
    plan: PaintPlan,
}

impl Guide {
    /// Joins the trees of all facings.
    pub(super) fn new(lattice: Lattice, trees: Vec<Tree>) -> Self {
        let mut nodes = vec![GuideNode::UNGUIDED; FACES];
        let mut regions = Vec::new();
        let region_count: usize = trees.iter().map(|tree| tree.regions.len()).sum();
        let (mut agents, mut lone) = (Vec::new(), Vec::new());
        for (root, tree) in trees.into_iter().enumerate() {
            // Only a root moves; all others keep their order, behind those of earlier trees
            let moved = |node: GuideNode| match node.as_split() {
                Some((axis, plane, first)) => GuideNode::split(axis, plane, first + nodes.len() - 1),
                None if node.number() < tree.regions.len() => GuideNode::region(node.number() + regions.len()),
                None if node.number().wrapping_sub(LONE) < tree.lone.len() => {
                    GuideNode::region(node.number() - LONE + region_count + lone.len())
                }
                None => GuideNode::UNGUIDED,
            };
            let mut tree_nodes = tree.nodes.into_iter().map(moved).collect::<Vec<_>>().into_iter();
            if let Some(node) = tree_nodes.next() {
                nodes[root] = node;
            }
            nodes.extend(tree_nodes);
            regions.extend(tree.regions);
            agents.extend(tree.agents);
            lone.extend(tree.lone);
        }
        agents.extend(lone);
        Self { entries: lattice.entries(&nodes), lattice, nodes, regions, agents, ..Self::default() }
    }

    /// Returns this guide with the importance of the picture's parts.
    pub(super) fn expecting(self, expected: PictureWorth) -> Self {
        Self { expected, ..self }
    }

    /// Returns this guide with a plan.
    pub(crate) fn planned(self, plan: PaintPlan) -> Self {
        Self { plan, ..self }
    }

    /// Returns the plan.
    pub(crate) fn plan(&self) -> &PaintPlan {
        &self.plan
    }

    /// Returns lattice, nodes, regions and agents.
    pub(super) fn parts(&self) -> (Lattice, &[GuideNode], &[Region], &[RegionAgent]) {
        (self.lattice, &self.nodes, &self.regions, &self.agents)
    }

    /// Returns the importance of the picture's parts.
    pub(crate) fn expected(&self) -> &PictureWorth {
        &self.expected
    }

    /// Joins the parts of a guide. `None`: a path through the nodes does not end, or leaves them.
    pub(super) fn from_parts(
        lattice: Lattice,
        nodes: Vec<GuideNode>,
        regions: Vec<Region>,
        agents: Vec<RegionAgent>,
        expected: PictureWorth,
    ) -> Option<Self> {
        let leads_on = |(number, node): (usize, &GuideNode)| {
            node.as_split().is_none_or(|(_, _, first)| first > number && first + 1 < nodes.len())
        };
        let is_sound = (nodes.is_empty() || nodes.len() >= FACES) && nodes.iter().enumerate().all(leads_on);
        is_sound.then(|| Self {
            entries: lattice.entries(&nodes),
            lattice,
            nodes,
            regions,
            agents,
            expected,
            plan: PaintPlan::default(),
        })
    }

    /// Prefetches the data that [`Guide::at`] reads first.
    #[inline(always)]
    pub(crate) fn request(&self, p: Vec3) {
        prefetch(&self.entries, self.lattice.cell(p));
    }

    /// Prefetches the node at which [`Guide::leaf`] enters a tree.
    #[inline(always)]
    pub(crate) fn request_leaf(&self, p: Vec3, normal: Vec3) {
        if let Some(LatticeEntry(roots)) = self.entries.get(self.lattice.cell(p)) {
            prefetch(&self.nodes, usize::from(roots[face_of(normal)]));
        }
    }

    /// Returns the region of a point on a surface; `None`: the BSDF alone samples directions there.
    ///
    /// - `normal`: shading normal on the side of `wo`.
    #[inline(always)]
    pub(crate) fn at(&self, p: Vec3, normal: Vec3) -> Option<&Region> {
        self.region(self.leaf(p, normal)?)
    }

    /// Returns the number of the leaf at a point on a surface; `None`: nothing was learned there.
    ///
    /// - `normal`: shading normal on the side of `wo`.
    #[inline(always)]
    pub(crate) fn leaf(&self, p: Vec3, normal: Vec3) -> Option<usize> {
        let LatticeEntry(roots) = self.entries.get(self.lattice.cell(p))?;
        let mut node = *self.nodes.get(usize::from(roots[face_of(normal)]))?;
        while let Some((axis, plane, first)) = node.as_split() {
            node = *self.nodes.get(first + usize::from(p[axis] >= plane))?;
        }
        Some(node.number())
    }

    /// Returns the region of a leaf; `None`: the BSDF alone samples directions there.
    #[inline(always)]
    pub(crate) fn region(&self, leaf: usize) -> Option<&Region> {
        self.regions.get(leaf)
    }

    /// Returns the agent of a leaf; `None`: it has none.
    #[inline(always)]
    pub(crate) fn agent(&self, leaf: usize) -> Option<&RegionAgent> {
        self.agents.get(leaf)
    }

    /// Returns the memory, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.entries)
            + size_of_val(&*self.nodes)
            + size_of_val(&*self.regions)
            + size_of_val(&*self.agents)
            + self.expected.memory_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_lies_over_most_places() {
        let part = |i: u32, prime: u32| (i * prime % 1009) as f32 / 1009.0;
        let near: Vec<Vec3> = (0..5000).map(|i| Vec3::new(part(i, 7), part(i, 31), part(i, 101))).collect();
        let (low, high) = (near.iter().copied().reduce(Vec3::min), near.iter().copied().reduce(Vec3::max));
        let plain = Lattice::new(low.unwrap(), high.unwrap());
        assert_eq!(Lattice::over(&near).to_numbers(), plain.to_numbers());
        // A few to the horizon.
        let wide = [near, (0..50).map(|i| Vec3::new(1e4 * part(i, 7), 0.0, -1e4)).collect()].concat();
        let lattice = Lattice::over(&wide);
        let cells = [0.2, 0.8].map(|x| lattice.cell(Vec3::new(x, 0.5, 0.5)));
        assert_ne!(cells[0], cells[1]);
        assert_eq!(lattice.cell(Vec3::new(1e4, 0.5, 0.5)), lattice.cell(Vec3::new(1.0, 0.5, 0.5)));
    }
}
