//! Refitting of a tree to moved geometry: boxes and leaves are rewritten, the topology stays.

use super::world::BuildWorld;
use crate::Aabb;
use crate::geometry::{BuildError, InstanceGeometry, MeshGeometry, Precision, SphereGeometry};
use crate::instance::{self, Affine};
use crate::tree::{Child, PlacedTree, SceneTrees, Sphere, TriangleBlock, WIDTH, WideNode};
use glam::Vec3;

/// Returns mesh index and triangle count of each instance, which must not change between build and refit.
pub(crate) fn topology(meshes: &[MeshGeometry<'_>], instances: &[InstanceGeometry]) -> Box<[(u32, u32)]> {
    instances.iter().map(|i| (i.mesh, meshes[i.mesh as usize].triangles.len() as u32)).collect()
}

/// Refits the tree. Returns the box around everything that can be hit.
///
/// - `known`: the [`topology`] at the build.
///
/// # Errors
/// The geometry is invalid or has another topology, or the tree has moving parts. An error leaves the tree unchanged.
pub(crate) fn refit(
    tree: &mut SceneTrees,
    known: &[(u32, u32)],
    meshes: &[MeshGeometry<'_>],
    instances: &[InstanceGeometry],
    spheres: &[SphereGeometry],
    precision: Precision,
) -> Result<Aabb, BuildError> {
    instance::validate(meshes, instances, spheres)?;
    if !tree.motion.is_empty() || spheres.len() != tree.spheres.len() || *topology(meshes, instances) != *known {
        return Err(BuildError::Changed);
    }
    let world = BuildWorld::new(meshes, instances, tree.flat.iter().map(|f| f.1 as usize))?;
    let mut placed = tree.placed.clone();
    for placed in &mut placed {
        let instance = placed.instance as usize;
        let inverse = Affine::new(&instances[instance].world_from_object).inverse();
        placed.object_from_world = inverse.ok_or(BuildError::Changed)?.rows;
    }
    // Check vertices for overflow; boxes of shared meshes are checked below.
    for &(_, instance) in &world.starts {
        let map = Affine::new(&instances[instance as usize].world_from_object);
        let positions = meshes[instances[instance as usize].mesh as usize].positions;
        if !positions.iter().all(|p| map.point(p.to_array()).iter().all(|x| x.is_finite())) {
            return Err(BuildError::TransformNotFinite { instance: instance as usize });
        }
    }
    let mesh_bounds: Vec<Aabb> =
        meshes.iter().map(|mesh| mesh.positions.iter().fold(Aabb::EMPTY, |b, &p| b.with(p))).collect();
    let boxes: Vec<Aabb> = placed.iter().map(|p| placed_bounds(p, instances, &mesh_bounds)).collect();
    if let Some(bad) = boxes.iter().position(|b| !(b.min.is_finite() && b.max.is_finite())) {
        return Err(BuildError::TransformNotFinite { instance: placed[bad].instance as usize });
    }
    // Everything is valid: write placements and spheres
    tree.placed = placed;
    for (to, from) in tree.spheres.iter_mut().zip(spheres) {
        *to = Sphere { center: from.center.to_array(), radius: from.radius };
    }
    // Refit the trees of shared meshes, then the top-level tree
    let mut done = vec![false; meshes.len()];
    for index in 0..tree.placed.len() {
        let PlacedTree { root, instance, .. } = tree.placed[index];
        let mesh = instances[instance as usize].mesh as usize;
        if !std::mem::replace(&mut done[mesh], true) {
            let geometry = meshes[mesh];
            let corners = |id: u32| geometry.triangles[id as usize].map(|i| geometry.positions[i as usize].to_array());
            subtree(tree, root, precision, &[], &corners);
        }
    }
    let root = tree.root;
    Ok(subtree(tree, root, precision, &boxes, &|id| world.corners(id)))
}

/// Returns the box of an instance. The box of all the mesh's vertices contains that of its tree.
fn placed_bounds(placed: &PlacedTree, instances: &[InstanceGeometry], meshes: &[Aabb]) -> Aabb {
    let instance = &instances[placed.instance as usize];
    Affine::new(&instance.world_from_object).bounds(&meshes[instance.mesh as usize])
}

/// Rewrites everything below a child. Returns the box around it. Recursion is limited by the depth of the tree.
fn subtree(
    tree: &mut SceneTrees,
    child: Child,
    precision: Precision,
    placed: &[Aabb],
    corners: &impl Fn(u32) -> [[f32; 3]; 3],
) -> Aabb {
    let index = child.index();
    if child == Child::EMPTY {
        Aabb::EMPTY
    } else if child.is_node() {
        let children = tree.node(child).children;
        let count = children.iter().take_while(|&&child| child != Child::EMPTY).count();
        let mut all = Aabb::EMPTY;
        for (slot, &child) in children[..count].iter().enumerate() {
            let bounds = subtree(tree, child, precision, placed, corners);
            tree.arena.at_mut::<WideNode>(index).set(slot, &bounds, child);
            all = all.union(&bounds);
        }
        tree.arena.at_mut::<WideNode>(index).sort_octants(count);
        all
    } else if child.is_triangles() {
        let block = tree.arena.at_mut::<TriangleBlock>(index);
        let mut bounds = Aabb::EMPTY;
        for lane in 0..WIDTH {
            if block.id[lane] != u32::MAX {
                let corners = corners(block.id[lane]);
                block.set(lane, &corners, precision);
                bounds = corners.iter().fold(bounds, |b, &p| b.with(Vec3::from(p)));
            }
        }
        bounds
    } else if child.is_sphere() {
        let Sphere { center, radius } = tree.spheres[index];
        Aabb::around(Vec3::from(center), radius)
    } else {
        placed[index]
    }
}
