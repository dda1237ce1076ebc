//! The geometry of a scene in the layout of the shader: every shape in world space, in one array, under one tree.

use bottega_kernels::{Aabb, BinaryTree, Hit, InstanceGeometry, MeshGeometry, Shape as Outline, SphereGeometry};
use glam::Vec3;

use crate::bvh::{self, DeviceTree};
use crate::error::GpuError;
use crate::shared::geometry::{LEAF_MAX, Node, Shape};

impl Shape {
    fn outline(&self) -> Outline {
        if self.instance & Hit::SPHERE != 0 {
            let radius = Vec3::splat(self.p1.x);
            Outline::Within(Aabb { min: self.p0 - radius, max: self.p0 + radius })
        } else {
            Outline::Triangle([self.p0, self.p1, self.p2])
        }
    }

    /// Returns true if the shader can intersect the shape without computing infinities or NaN. Other shapes are never
    /// hit.
    fn is_bounded(&self) -> bool {
        let (min, max) = match self.outline() {
            Outline::Within(Aabb { min, max }) => (min, max),
            Outline::Triangle([a, b, c]) => (a.min(b).min(c), a.max(b).max(c)),
        };
        // Products of three differences must stay finite.
        min.is_finite() && max.is_finite() && min.abs().max(max.abs()).max_element() < 1e12
    }
}

/// The arrays that are uploaded. Kept to upload them again after the device was lost.
#[derive(Debug)]
pub(crate) struct Geometry {
    pub(crate) nodes: Vec<Node>,
    /// The number of nodes on the longest path from the root.
    pub(crate) depth: u32,
    pub(crate) shapes: Vec<Shape>,
}

impl Geometry {
    /// Places all instances in world space and builds the tree. `limit` is the maximum size of one array, in bytes.
    pub(crate) fn build(
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
        limit: u64,
        adapter: &str,
    ) -> Result<Self, GpuError> {
        check(meshes, instances)?;
        let count = instances.iter().map(|instance| meshes[instance.mesh as usize].triangles.len() as u64).sum::<u64>()
            + spheres.len() as u64;
        let bytes = count.saturating_mul(size_of::<Shape>() as u64);
        let limit = limit.min(bvh::SHAPES_MAX * size_of::<Shape>() as u64);
        if bytes > limit {
            return Err(GpuError::TooLarge { what: "the scene's shapes", bytes, limit, adapter: adapter.to_owned() });
        }
        let mut shapes = Vec::with_capacity(count as usize);
        for (instance, index) in instances.iter().zip(0..) {
            place(&meshes[instance.mesh as usize], instance, index, &mut shapes);
        }
        for (sphere, index) in spheres.iter().zip(0_u32..) {
            let (p0, p1) = (sphere.center, Vec3::splat(sphere.radius));
            shapes.push(Shape { p0, instance: Hit::SPHERE | index, p1, ..Shape::default() });
        }
        shapes.retain(Shape::is_bounded);
        let outlines: Vec<_> = shapes.iter().map(Shape::outline).collect();
        let DeviceTree { nodes, order, depth } = bvh::widen(&BinaryTree::build(&outlines, LEAF_MAX as usize, 0));
        let bytes = (size_of_val(&*nodes) as u64).max((order.len() * size_of::<Shape>()) as u64);
        if bytes > limit {
            return Err(GpuError::TooLarge { what: "the scene's tree", bytes, limit, adapter: adapter.to_owned() });
        }
        Ok(Self { nodes, depth, shapes: order.into_iter().map(|index| shapes[index as usize]).collect() })
    }
}

/// Appends the triangles of one instance, in world space.
fn place(mesh: &MeshGeometry<'_>, instance: &InstanceGeometry, index: u32, shapes: &mut Vec<Shape>) {
    let world = |vertex: u32| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]);
    for (&[a, b, c], primitive) in mesh.triangles.iter().zip(0..) {
        shapes.push(Shape { p0: world(a), instance: index, p1: world(b), primitive, p2: world(c), padding: 0 });
    }
}

/// Checks that every index is in range.
fn check(meshes: &[MeshGeometry<'_>], instances: &[InstanceGeometry]) -> Result<(), GpuError> {
    for (mesh, index) in meshes.iter().zip(0_usize..) {
        let count = mesh.positions.len();
        if mesh.triangles.iter().flatten().any(|&vertex| vertex as usize >= count) {
            return Err(GpuError::Invalid(format!("a triangle of mesh {index} names a vertex that does not exist")));
        }
    }
    for (instance, index) in instances.iter().zip(0_usize..) {
        if instance.mesh as usize >= meshes.len() {
            return Err(GpuError::Invalid(format!(
                "instance {index} names mesh {}, which does not exist",
                instance.mesh
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;

    #[test]
    fn shapes_without_bounds_are_left_out_and_a_bad_index_is_an_error() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::NAN];
        let mesh = MeshGeometry { positions: &positions, triangles: &[[0, 1, 2], [0, 1, 3]] };
        let instance = InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY };
        let spheres = [SphereGeometry { center: Vec3::ZERO, radius: f32::INFINITY }];
        let built = Geometry::build(&[mesh], std::slice::from_ref(&instance), &spheres, u64::MAX, "test").unwrap();
        assert_eq!(built.shapes.len(), 1);
        let mesh = MeshGeometry { positions: &positions, triangles: &[[0, 1, 4]] };
        let outcome = Geometry::build(&[mesh], std::slice::from_ref(&instance), &[], u64::MAX, "test");
        assert!(matches!(outcome, Err(GpuError::Invalid(_))));
        assert!(matches!(Geometry::build(&[], &[instance], &[], u64::MAX, "test"), Err(GpuError::Invalid(_))));
    }

    #[test]
    fn a_scene_beyond_the_limit_is_refused_before_it_is_placed() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = MeshGeometry { positions: &positions, triangles: &[[0, 1, 2]] };
        let instances = vec![InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY }; 10];
        let outcome = Geometry::build(&[mesh], &instances, &[], 479, "test");
        assert!(matches!(outcome, Err(GpuError::TooLarge { bytes: 480, limit: 479, .. })));
    }
}
