//! The build of moving parts: paths of instances, and trees of meshes whose vertices move.

use super::{BINARY_LEAF, TreeBuilder, bins, collapse, emit, is_flat, item::Item, reinsert};
use crate::geometry::BuildError;
use crate::instance::Affine;
use crate::motion::MeshKeyGeometry;
use crate::moving_tree::{KeyTrees, MovingMesh, PlacedMotion};
use crate::tree::{Child, SceneTrees, TriangleBlock, WIDTH, WideNode};
use crate::{Aabb, Precision};
use glam::Vec3;

/// The planes of empty slots in trees of keys. They are finite, so that planes between two keys are numbers.
const FAR: f32 = 3e38;

impl TreeBuilder<'_> {
    /// Returns the motion of a placed instance with its bounds over all times; `None`: it stands still.
    ///
    /// - `object`: bounds of its mesh, over all keys.
    /// - `keys`: trees of its mesh, if that moves.
    pub(super) fn placed_motion(&self, index: usize, object: &Aabb, keys: Option<KeyTrees>) -> Option<PlacedMotion> {
        let place = self.motion.instances.binary_search_by_key(&(index as u32), |moving| moving.0);
        let transform = place.ok().map(|place| self.motion.instances[place].1.clone());
        if transform.is_none() && keys.is_none() {
            return None;
        }
        let path = match &transform {
            Some(transform) => transform.path(object),
            None => {
                let bounds = Affine::new(&self.instances[index].world_from_object).bounds(object);
                vec![(0.0, bounds), (1.0, bounds)]
            }
        };
        let (times, boxes): (Vec<f32>, Vec<Aabb>) = path.into_iter().unzip();
        Some(PlacedMotion { transform, times: times.into(), boxes: boxes.into(), keys })
    }

    /// Returns the keys of a mesh; `None`: its vertices stand still.
    pub(super) fn keys_of(&self, mesh: usize) -> Option<&[MeshKeyGeometry<'_>]> {
        let place = self.motion.meshes.binary_search_by_key(&(mesh as u32), |moving| moving.0).ok()?;
        Some(&self.motion.meshes[place].1)
    }

    /// Builds the trees of a mesh with moving vertices. Their shape is chosen for the mean box of each triangle.
    pub(super) fn moving_mesh_tree(
        &mut self,
        mesh: usize,
        keys: &[MeshKeyGeometry<'_>],
    ) -> Result<MovingMesh<Child>, BuildError> {
        let triangles = self.meshes[mesh].triangles;
        let corners = |key: usize, triangle: u32| {
            triangles[triangle as usize].map(|vertex| keys[key].positions[vertex as usize].to_array())
        };
        // Collect the triangles that have an area at some key
        let mut items = Vec::with_capacity(triangles.len());
        for id in 0..triangles.len() as u32 {
            let (mut min, mut max, mut all_flat) = (Vec3::ZERO, Vec3::ZERO, true);
            for key in 0..keys.len() {
                let corners = corners(key, id);
                all_flat &= is_flat(&corners);
                let bounds = corners.iter().fold(Aabb::EMPTY, |bounds, &p| bounds.with(Vec3::from(p)));
                min += bounds.min / keys.len() as f32;
                max += bounds.max / keys.len() as f32;
            }
            if !all_flat {
                items.push(Item::new(&Aabb { min, max: max.max(min) }, id));
            }
        }
        // Build the tree of the first key, as of a mesh that stands still
        let mut binary = bins::build(&mut items, BINARY_LEAF, self.parallel);
        let mut ids: Vec<u32> = items.iter().map(Item::id).collect();
        if self.options.optimize
            && let Some(better) = reinsert::optimize(&binary, &ids, self.parallel)
        {
            (binary, ids) = better;
        }
        let choices = collapse::choose(&binary, WIDTH as u32, self.parallel);
        let base = self.tree.arena.len();
        let leaf = |line: usize, _: &_| Child::triangles(line);
        let precision = self.options.precision;
        let arena = &mut self.tree.arena;
        let out = emit::nodes(&binary, &choices, arena, self.parallel, TriangleBlock::LINES, leaf)?;
        emit::blocks(out.lines, &out.leaves, &ids, precision, self.parallel, |id| corners(0, id));
        let root = out.root;
        // Copy it for the other keys
        let stride = self.tree.arena.len() - base;
        emit::check("cache lines of tree", base.saturating_add(stride.saturating_mul(keys.len())))?;
        for _ in 1..keys.len() {
            let first = self.tree.arena.len();
            self.tree.arena.grow(stride);
            self.tree.arena.copy_within(base..base + stride, first);
        }
        // Write boxes and corners of each key
        let mut bounds = Aabb::EMPTY;
        for key in 0..keys.len() {
            let of_key = |id: u32| corners(key, id);
            bounds = bounds.union(&pose(&mut self.tree, root, key * stride, precision, &of_key));
        }
        let times = keys.iter().map(|key| key.time).collect();
        Ok(MovingMesh { root, bounds, keys: KeyTrees { times, stride } })
    }
}

/// Rewrites everything below a child in the tree of a key. Returns the box around it. Recursion is limited by the depth
/// of the tree.
///
/// - `offset`: cache lines from the first key's tree to that of the key.
fn pose(
    tree: &mut SceneTrees,
    child: Child,
    offset: usize,
    precision: Precision,
    corners: &impl Fn(u32) -> [[f32; 3]; 3],
) -> Aabb {
    let index = child.index() + offset;
    if child == Child::EMPTY {
        return Aabb::EMPTY;
    }
    let mut all = Aabb::EMPTY;
    if child.is_node() {
        let children = tree.arena.at::<WideNode>(index).children;
        let count = children.iter().take_while(|&&child| child != Child::EMPTY).count();
        for (slot, &child) in children[..count].iter().enumerate() {
            let bounds = pose(tree, child, offset, precision, corners);
            tree.arena.at_mut::<WideNode>(index).set(slot, &bounds, child);
            all = all.union(&bounds);
        }
        let node = tree.arena.at_mut::<WideNode>(index);
        node.sort_octants(count);
        for slot in count..WIDTH {
            node.set(slot, &Aabb { min: Vec3::splat(FAR), max: Vec3::splat(-FAR) }, Child::EMPTY);
        }
    } else {
        let block = tree.arena.at_mut::<TriangleBlock>(index);
        for lane in 0..WIDTH {
            if block.id[lane] != u32::MAX {
                let corners = corners(block.id[lane]);
                block.set(lane, &corners, precision);
                all = corners.iter().fold(all, |bounds, &p| bounds.with(Vec3::from(p)));
            }
        }
    }
    all
}
