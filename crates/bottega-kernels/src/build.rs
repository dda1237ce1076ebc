//! The build of a tree in three stages: [`bins`] builds a binary tree, [`collapse`] chooses the wide nodes, [`emit`]
//! writes them.
//!
//! Before the first stage [`presplit`] splits long thin triangles; after it [`reinsert`] moves badly placed subtrees. A
//! build peaks at about 80 bytes per triangle, including the result (a quarter more if many are split): 32 for the item
//! and 13 for the binary tree, of which there are briefly two, and finally the tree itself.

mod binary;
mod bins;
mod collapse;
mod emit;
mod item;
mod moving;
mod presplit;
pub(crate) mod refit;
mod reinsert;
mod world;

pub use binary::{BinaryTree, Shape};
pub use bins::Binary;

use crate::arena::Arena;
use crate::geometry::{BuildError, BuildOptions, InstanceGeometry, MeshGeometry, SphereGeometry};
use crate::instance::{self, Affine};
use crate::motion::MotionGeometry;
use crate::moving_tree::{KeyTrees, MovingMesh, SphereMotion, TreeMotion};
use crate::tree::{Child, PlacedTree, SceneTrees, Sphere, TriangleBlock, WIDTH, WideNode};
use crate::{Aabb, Hit};
use glam::Vec3;
use item::Item;
use rayon::prelude::*;
use world::BuildWorld;

/// Maximal number of triangles in a leaf of the binary tree: testing half a block costs as much as a quarter. (Eight
/// leave too little choice when filling blocks.)
const BINARY_LEAF: usize = 6;

/// Ratio of triangles to splits: at most one in this many is split before the build; see [`presplit`].
const SPLIT_BUDGET: usize = 4;

/// A finished tree, its bounds and its number of triangles.
pub(crate) struct BuiltTree {
    pub(crate) tree: SceneTrees,
    /// Bounds of all geometry, in world space.
    pub(crate) bounds: Aabb,
    /// Number of triangles, counted once per instance.
    pub(crate) triangles: usize,
}

/// Checks the geometry and builds the trees.
///
/// # Errors
/// The geometry or its motion is invalid, or there is too much of it.
pub(crate) fn build(
    meshes: &[MeshGeometry<'_>],
    instances: &[InstanceGeometry],
    spheres: &[SphereGeometry],
    motion: &MotionGeometry<'_>,
    options: &BuildOptions,
) -> Result<BuiltTree, BuildError> {
    with_threads(options.threads, |parallel| {
        instance::validate(meshes, instances, spheres)?;
        motion.validate(meshes, instances, spheres)?;
        TreeBuilder { meshes, instances, motion, options, parallel, tree: empty_tree() }.build(spheres)
    })
}

/// Runs a build, which may use the threads of the current pool if its argument is true; `threads` as in
/// [`BuildOptions::threads`].
fn with_threads<T: Send>(threads: usize, run: impl Fn(bool) -> T + Sync) -> T {
    match threads {
        0 => run(true),
        1 => run(false),
        threads => match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
            Ok(pool) => pool.install(|| run(true)),
            Err(_) => run(false),
        },
    }
}

fn empty_tree() -> SceneTrees {
    SceneTrees {
        arena: Arena::new(),
        spheres: Vec::new(),
        placed: Vec::new(),
        root: Child::EMPTY,
        flat: Vec::new(),
        motion: TreeMotion::default(),
    }
}

struct TreeBuilder<'a> {
    meshes: &'a [MeshGeometry<'a>],
    instances: &'a [InstanceGeometry],
    motion: &'a MotionGeometry<'a>,
    options: &'a BuildOptions,
    parallel: bool,
    tree: SceneTrees,
}

impl TreeBuilder<'_> {
    fn build(mut self, spheres: &[SphereGeometry]) -> Result<BuiltTree, BuildError> {
        let inverses = self.choose_shared()?;
        let flat: Vec<usize> = (0..self.instances.len()).filter(|&i| inverses[i].is_none()).collect();
        let parts = [self.instance_tree(&inverses)?, self.world_triangles(&flat)?, self.sphere_tree(spheres)?];
        let bounds = parts.iter().fold(Aabb::EMPTY, |b, part| b.union(&part.1));
        self.tree.root = self.join(&parts);
        let triangles = self.instances.iter().map(|i| self.meshes[i.mesh as usize].triangles.len()).sum();
        Ok(BuiltTree { tree: self.tree, bounds, triangles })
    }

    /// Returns for each instance the map from world to object space, or `None` if it is flattened into the world.
    fn choose_shared(&self) -> Result<Vec<Option<Affine>>, BuildError> {
        let mut uses = vec![0usize; self.meshes.len()];
        for instance in self.instances {
            uses[instance.mesh as usize] += 1;
        }
        let shared = |mesh: usize| {
            uses[mesh] > 1
                && uses[mesh].saturating_mul(self.meshes[mesh].triangles.len()) > self.options.flatten_triangles
        };
        let inverse = |i: &InstanceGeometry| {
            shared(i.mesh as usize).then(|| Affine::new(&i.world_from_object).inverse()).flatten()
        };
        let mut inverses: Vec<Option<Affine>> = self.instances.iter().map(inverse).collect();
        // What moves is not flattened
        for (index, instance) in self.instances.iter().enumerate() {
            let moving = self.motion.instances.binary_search_by_key(&(index as u32), |moving| moving.0).ok();
            let map = match moving {
                Some(place) => self.motion.instances[place].1.at(0.0),
                None if self.keys_of(instance.mesh as usize).is_some() => instance.world_from_object,
                None => continue,
            };
            let problem = "its transform flattens it";
            let inverse = Affine::new(&map).inverse();
            inverses[index] = Some(inverse.ok_or(BuildError::BadMotion { what: "instance", index, problem })?);
        }
        Ok(inverses)
    }

    /// Builds the trees of the shared meshes, and one over their instances.
    fn instance_tree(&mut self, inverses: &[Option<Affine>]) -> Result<(Child, Aabb), BuildError> {
        let mut roots: Vec<Option<(Child, Aabb, Option<KeyTrees>)>> = vec![None; self.meshes.len()];
        let mut items = Vec::new();
        for (index, inverse) in inverses.iter().enumerate() {
            let Some(inverse) = inverse else { continue };
            let mesh = self.instances[index].mesh as usize;
            let (root, bounds, keys) = match &roots[mesh] {
                Some(known) => known.clone(),
                None => roots[mesh].insert(self.mesh_trees(mesh)?).clone(),
            };
            if root == Child::EMPTY {
                continue;
            }
            let (bounds, motion) = match self.placed_motion(index, &bounds, keys) {
                None => (Affine::new(&self.instances[index].world_from_object).bounds(&bounds), PlacedTree::STILL),
                Some(motion) => {
                    let bounds = motion.boxes.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
                    self.tree.motion.placements.push(motion);
                    (bounds, self.tree.motion.placements.len() as u32 - 1)
                }
            };
            if !(bounds.min.is_finite() && bounds.max.is_finite()) {
                return Err(BuildError::TransformNotFinite { instance: index });
            }
            items.push(Item::new(&bounds, self.tree.placed.len() as u32));
            self.tree.placed.push(PlacedTree { object_from_world: inverse.rows, root, instance: index as u32, motion });
        }
        emit::check("instances", self.tree.placed.len())?;
        self.single_item_tree(&mut items, Child::instance)
    }

    /// Builds the tree of a mesh, or those of its keys if its vertices move.
    fn mesh_trees(&mut self, mesh: usize) -> Result<(Child, Aabb, Option<KeyTrees>), BuildError> {
        let motion = self.motion;
        if let Ok(place) = motion.meshes.binary_search_by_key(&(mesh as u32), |moving| moving.0) {
            let MovingMesh { root, bounds, keys } = self.moving_mesh_tree(mesh, &motion.meshes[place].1)?;
            return Ok((root, bounds, Some(keys)));
        }
        let (root, bounds) = self.mesh_tree(mesh)?;
        Ok((root, bounds, None))
    }

    fn mesh_tree(&mut self, mesh: usize) -> Result<(Child, Aabb), BuildError> {
        let geometry = self.meshes[mesh];
        let corners =
            |triangle: u32| geometry.triangles[triangle as usize].map(|i| geometry.positions[i as usize].to_array());
        let items = self.items(geometry.triangles.len() as u32, &corners);
        self.triangle_tree(items, corners)
    }

    /// Builds one tree over all triangles of flattened instances.
    fn world_triangles(&mut self, flat: &[usize]) -> Result<(Child, Aabb), BuildError> {
        let world = BuildWorld::new(self.meshes, self.instances, flat.iter().copied())?;
        self.tree.flat.clone_from(&world.starts);
        let items = self.items(world.count, &|id| world.corners(id));
        world.check(&items, self.parallel)?;
        self.triangle_tree(items, |id| world.corners(id))
    }

    /// Makes items of the triangles that have an area, with capacity for splits.
    fn items(&self, count: u32, corners: &(impl Fn(u32) -> [[f32; 3]; 3] + Sync)) -> Vec<Item> {
        let item = |id: u32| {
            let corners = corners(id);
            let [a, b, c] = corners.map(Vec3::from);
            let bounds = if is_flat(&corners) { Aabb::EMPTY } else { Aabb::EMPTY.with(a).with(b).with(c) };
            Item::new(&bounds, id)
        };
        let mut items = Vec::with_capacity(count as usize + count as usize / SPLIT_BUDGET);
        let flat = if self.parallel {
            (0..count).into_par_iter().with_min_len(1024).map(item).collect_into_vec(&mut items);
            items.par_iter().any(Item::is_empty)
        } else {
            items.extend((0..count).map(item));
            true
        };
        if flat {
            items.retain(|item| !item.is_empty());
        }
        items
    }

    fn triangle_tree(
        &mut self,
        mut items: Vec<Item>,
        corners: impl Fn(u32) -> [[f32; 3]; 3] + Sync,
    ) -> Result<(Child, Aabb), BuildError> {
        // Split long thin triangles
        let budget = items.len() / SPLIT_BUDGET;
        presplit::presplit(&mut items, budget, self.parallel, &corners);
        // Build the binary tree
        let mut binary = bins::build(&mut items, BINARY_LEAF, self.parallel);
        // Keep the items' numbers only, an eighth of their memory.
        let mut ids: Vec<u32> =
            if self.parallel { items.par_iter().map(Item::id).collect() } else { items.iter().map(Item::id).collect() };
        drop(items);
        // Reinsert badly placed subtrees
        if self.options.optimize
            && let Some(better) = reinsert::optimize(&binary, &ids, self.parallel)
        {
            (binary, ids) = better;
        }
        // Choose wide nodes and leaves, then write them
        let choices = collapse::choose(&binary, WIDTH as u32, self.parallel);
        let leaf = |line: usize, _: &_| Child::triangles(line);
        let arena = &mut self.tree.arena;
        let out = emit::nodes(&binary, &choices, arena, self.parallel, TriangleBlock::LINES, leaf)?;
        drop((binary, choices));
        emit::blocks(out.lines, &out.leaves, &ids, self.options.precision, self.parallel, corners);
        Ok((out.root, out.bounds))
    }

    fn sphere_tree(&mut self, spheres: &[SphereGeometry]) -> Result<(Child, Aabb), BuildError> {
        emit::check("spheres", spheres.len())?;
        let mut items = Vec::new();
        for (index, s) in spheres.iter().enumerate() {
            self.tree.spheres.push(Sphere { center: s.center.to_array(), radius: s.radius });
            let moving = self.motion.spheres.binary_search_by_key(&(index as u32), |moving| moving.0);
            if let Ok(place) = moving {
                let keys = &self.motion.spheres[place].1;
                let around = |bounds: Aabb, s: &SphereGeometry| bounds.union(&Aabb::around(s.center, s.radius));
                let bounds = keys.iter().fold(Aabb::EMPTY, |bounds, key| around(bounds, &key.sphere));
                self.tree.motion.spheres.push((index as u32, SphereMotion::new(keys)));
                items.push(Item::new(&padded(&bounds), index as u32));
            } else if s.radius > 0.0 {
                items.push(Item::new(&Aabb::around(s.center, s.radius), index as u32));
            }
        }
        self.single_item_tree(&mut items, Child::sphere)
    }

    /// Builds a tree whose leaves are single items, referred to by `child`.
    fn single_item_tree(
        &mut self,
        items: &mut [Item],
        child: impl Fn(usize) -> Child + Sync,
    ) -> Result<(Child, Aabb), BuildError> {
        let binary = bins::build(items, 1, self.parallel);
        let choices = collapse::choose(&binary, 1, self.parallel);
        let items = &*items;
        let leaf = |_, node: &bins::Binary| child(items[node.first as usize].id() as usize);
        let out = emit::nodes(&binary, &choices, &mut self.tree.arena, self.parallel, 0, leaf)?;
        Ok((out.root, out.bounds))
    }

    /// Makes one root over several trees.
    fn join(&mut self, parts: &[(Child, Aabb)]) -> Child {
        let parts: Vec<_> = parts.iter().filter(|part| part.0 != Child::EMPTY).collect();
        if let [] | [_] = parts[..] {
            return parts.first().map_or(Child::EMPTY, |part| part.0);
        }
        let mut node = WideNode::EMPTY;
        for (slot, part) in parts.iter().enumerate() {
            node.set(slot, &part.1, part.0);
        }
        node.sort_octants(parts.len());
        let line = self.tree.arena.len();
        self.tree.arena.grow(WideNode::LINES);
        *self.tree.arena.at_mut(line) = node;
        Child::node(line)
    }
}

/// Returns a box with room for the rounding of an interpolation.
fn padded(bounds: &Aabb) -> Aabb {
    let room = bounds.min.abs().max(bounds.max.abs()) * (4.0 * f32::EPSILON);
    Aabb { min: bounds.min - room, max: bounds.max + room }
}

/// Returns true if a triangle has no area. In double precision both products of each component round alike, so
/// collinear corners give exactly zero if the edges are exact in `f64`.
fn is_flat(corners: &[[f32; 3]; 3]) -> bool {
    // Decide clear cases in single precision.
    let [a, b, c] = corners.map(Vec3::from);
    let (e, f) = (b - a, c - a);
    if e.cross(f).abs().max_element() > 1e-3 * e.abs().max_element() * f.abs().max_element() {
        return false;
    }
    let [a, b, c] = corners.map(|p| p.map(f64::from));
    let edge = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
    let (e, f) = (edge(b), edge(c));
    e[1] * f[2] == e[2] * f[1] && e[2] * f[0] == e[0] * f[2] && e[0] * f[1] == e[1] * f[0]
}

const _: () = assert!(Hit::SPHERE as usize > Child::LIMIT, "sphere numbers leave the bit free");
