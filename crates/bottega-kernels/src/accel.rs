//! Geometry in, hits out.

use crate::{Aabb, Hit, Ray};
use glam::{Affine3A, Vec3};

/// A triangle mesh in its own space.
#[derive(Clone, Copy, Debug)]
pub struct MeshGeometry<'a> {
    /// Vertices.
    pub positions: &'a [Vec3],
    /// Three indices into `positions` a triangle.
    pub triangles: &'a [[u32; 3]],
}

/// A sphere in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereGeometry {
    /// Middle.
    pub center: Vec3,
    /// Radius; 0 is allowed and never hit.
    pub radius: f32,
}

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceGeometry {
    /// Index of the mesh.
    pub mesh: u32,
    /// Where it stands.
    pub world_from_object: Affine3A,
}

/// How exact the tests along a ray are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Watertight: no ray slips between two triangles that share an edge or a vertex.
    #[default]
    Robust,
    /// Somewhat faster; about one ray in ten that is aimed exactly at an edge passes through.
    Fast,
}

/// How an [`Accel`] is built.
#[derive(Clone, Debug, Default)]
pub struct BuildOptions {
    /// Threads to build with; 0 for as many as the machine has. The result does not depend on it.
    pub threads: usize,
    /// How exact the tests along a ray are.
    pub precision: Precision,
}

/// Geometry that cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// An index beyond the vertices.
    #[error("mesh {mesh}: triangle {triangle} refers to vertex {vertex} of {vertices}")]
    IndexOutOfRange {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the triangle.
        triangle: usize,
        /// The index found.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// NaN or an infinity among the positions.
    #[error("mesh {mesh}: vertex {vertex} is not finite")]
    PositionNotFinite {
        /// Index of the mesh.
        mesh: usize,
        /// Index of the vertex.
        vertex: usize,
    },
    /// An instance of a mesh that is not there.
    #[error("instance {instance} refers to mesh {mesh} of {meshes}")]
    NoSuchMesh {
        /// Index of the instance.
        instance: usize,
        /// The mesh asked for.
        mesh: u32,
        /// How many there are.
        meshes: usize,
    },
    /// NaN or an infinity in a transform, or a transform that moves a vertex beyond the range of `f32`.
    #[error("instance {instance}: its transform is not finite, or leads beyond the range of numbers")]
    TransformNotFinite {
        /// Index of the instance.
        instance: usize,
    },
    /// A sphere with NaN, an infinity or a negative radius.
    #[error("sphere {sphere}: center or radius is not finite, or the radius is negative")]
    BadSphere {
        /// Index of the sphere.
        sphere: usize,
    },
    /// More than the indices can number.
    #[error("{count} {what} are more than the limit of {limit}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
}

#[derive(Clone, Copy)]
struct Shape {
    p: [Vec3; 3],
    instance: u32,
    primitive: u32,
}

impl Shape {
    fn bounds(&self) -> Aabb {
        if self.instance & Hit::SPHERE != 0 {
            return Aabb::around(self.p[0], self.p[1].x);
        }
        Aabb::EMPTY.with(self.p[0]).with(self.p[1]).with(self.p[2])
    }

    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<Hit> {
        let hit = |t, u, v| Hit { t, u, v, instance: self.instance, primitive: self.primitive };
        if self.instance & Hit::SPHERE != 0 {
            let o = (ray.origin - self.p[0]).as_dvec3();
            let d = ray.direction.as_dvec3();
            let a = d.length_squared();
            let b = -o.dot(d) / a;
            let radius = f64::from(self.p[1].x);
            let discriminant = radius * radius - (o + d * b).length_squared();
            if discriminant <= 0.0 {
                return None;
            }
            let s = (discriminant / a).sqrt();
            return [(b - s) as f32, (b + s) as f32]
                .into_iter()
                .find(|t| *t > ray.t_min && *t <= t_max)
                .map(|t| hit(t, 0.0, 0.0));
        }
        let [a, b, c] = self.p.map(|p| (p - ray.origin).as_dvec3());
        let d = ray.direction.as_dvec3();
        let (u, v, w) = (d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a)));
        let det = u + v + w;
        if !((u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0)) || det == 0.0 {
            return None;
        }
        let n = (b - a).cross(c - a);
        let t = (a.dot(n) / d.dot(n)) as f32;
        (t > ray.t_min && t <= t_max).then(|| hit(t, (v / det) as f32, (w / det) as f32))
    }
}

struct Node {
    bounds: Aabb,
    /// Leaf: first shape; inner: the second child (the first follows the node).
    index: u32,
    count: u32,
}

/// The acceleration structure over a scene.
pub struct Accel {
    nodes: Vec<Node>,
    shapes: Vec<Shape>,
    triangles: usize,
}

impl Accel {
    /// Builds the structure over all instances and spheres.
    pub fn build(
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
        _options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        let mut shapes = Vec::new();
        for (mesh_index, mesh) in meshes.iter().enumerate() {
            if let Some(vertex) = mesh.positions.iter().position(|p| !p.is_finite()) {
                return Err(BuildError::PositionNotFinite { mesh: mesh_index, vertex });
            }
            for (triangle, indices) in mesh.triangles.iter().enumerate() {
                if let Some(&vertex) = indices.iter().find(|i| **i as usize >= mesh.positions.len()) {
                    let vertices = mesh.positions.len();
                    return Err(BuildError::IndexOutOfRange { mesh: mesh_index, triangle, vertex, vertices });
                }
            }
        }
        for (index, instance) in instances.iter().enumerate() {
            let mesh = meshes.get(instance.mesh as usize).ok_or(BuildError::NoSuchMesh {
                instance: index,
                mesh: instance.mesh,
                meshes: meshes.len(),
            })?;
            for (primitive, indices) in mesh.triangles.iter().enumerate() {
                let p = indices.map(|i| instance.world_from_object.transform_point3(mesh.positions[i as usize]));
                if p.iter().any(|p| !p.is_finite()) {
                    return Err(BuildError::TransformNotFinite { instance: index });
                }
                shapes.push(Shape { p, instance: index as u32, primitive: primitive as u32 });
            }
        }
        let triangles = shapes.len();
        for (index, s) in spheres.iter().enumerate() {
            if !(s.center.is_finite() && s.radius.is_finite() && s.radius >= 0.0) {
                return Err(BuildError::BadSphere { sphere: index });
            }
            let p = [s.center, Vec3::splat(s.radius), Vec3::ZERO];
            shapes.push(Shape { p, instance: Hit::SPHERE | index as u32, primitive: 0 });
        }
        let mut nodes = Vec::new();
        if !shapes.is_empty() {
            split(&mut shapes, 0, &mut nodes);
        }
        Ok(Self { nodes, shapes, triangles })
    }

    fn walk(&self, ray: &Ray, any: bool, steps: &mut u32, accept: impl Fn(&Hit) -> bool) -> Hit {
        let mut best = Hit::NONE;
        let mut t_max = ray.t_max;
        let mut stack = vec![0u32];
        if self.nodes.is_empty() {
            return best;
        }
        let inverse = ray.direction.recip();
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            *steps += 1;
            let (a, b) = ((node.bounds.min - ray.origin) * inverse, (node.bounds.max - ray.origin) * inverse);
            let slack = 1e-6;
            if a.min(b).max_element().max(ray.t_min) * (1.0 - slack) > a.max(b).min_element().min(t_max) * (1.0 + slack)
            {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.index, index + 1]);
                continue;
            }
            for shape in &self.shapes[node.index as usize..(node.index + node.count) as usize] {
                let Some(hit) = shape.intersect(ray, t_max) else { continue };
                let before = (hit.t, hit.instance, hit.primitive) < (best.t, best.instance, best.primitive);
                if before && accept(&hit) {
                    best = hit;
                    t_max = hit.t;
                    if any {
                        return best;
                    }
                }
            }
        }
        best
    }

    /// The closest hit.
    pub fn intersect(&self, ray: &Ray) -> Hit {
        self.walk(ray, false, &mut 0, |_| true)
    }

    /// Whether anything is hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.walk(ray, true, &mut 0, |_| true).is_some()
    }

    /// The closest hit that `accept` lets pass. It is asked for candidates in any order and must be a pure function.
    pub fn intersect_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Hit {
        self.walk(ray, false, &mut 0, accept)
    }

    /// Whether there is a hit that `accept` lets pass.
    pub fn occluded_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        self.walk(ray, true, &mut 0, accept).is_some()
    }

    /// The closest hit; adds the number of nodes and leaves visited to `steps`.
    pub fn intersect_counted(&self, ray: &Ray, steps: &mut u32) -> Hit {
        self.walk(ray, false, steps, |_| true)
    }

    /// The closest hit of every ray. Panics when the lengths differ.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Hit]) {
        assert_eq!(rays.len(), hits.len());
        for (hit, ray) in hits.iter_mut().zip(rays) {
            *hit = self.intersect(ray);
        }
    }

    /// Whether each ray hits anything. Panics when the lengths differ.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len());
        for (hit, ray) in occluded.iter_mut().zip(rays) {
            *hit = self.occluded(ray);
        }
    }

    /// The box around everything; empty for an empty scene.
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |n| n.bounds)
    }

    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.shapes[..])
    }

    /// Triangles, counted once for every instance.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }
}

fn split(shapes: &mut [Shape], offset: u32, nodes: &mut Vec<Node>) {
    let bounds = shapes.iter().fold(Aabb::EMPTY, |b, s| b.union(&s.bounds()));
    let node = nodes.len();
    nodes.push(Node { bounds, index: offset, count: shapes.len() as u32 });
    if shapes.len() <= 4 {
        return;
    }
    let extent = bounds.max - bounds.min;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    let middle = shapes.len() / 2;
    shapes.select_nth_unstable_by(middle, |a, b| a.bounds().center()[axis].total_cmp(&b.bounds().center()[axis]));
    let (left, right) = shapes.split_at_mut(middle);
    split(left, offset, nodes);
    nodes[node].count = 0;
    nodes[node].index = nodes.len() as u32;
    split(right, offset + middle as u32, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_through_a_triangle_tells_where() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let mesh = MeshGeometry { positions: &positions, triangles: &[[0, 1, 2]] };
        let instance = InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY };
        let sphere = SphereGeometry { center: Vec3::Z * 3.0, radius: 1.0 };
        let accel = Accel::build(&[mesh], &[instance], &[sphere], &BuildOptions::default()).unwrap();
        let hit = accel.intersect(&Ray::new(Vec3::new(0.25, 0.5, -1.0), Vec3::Z * 2.0));
        assert_eq!(hit, Hit { t: 0.5, u: 0.25, v: 0.5, instance: 0, primitive: 0 });
        let hit = accel.intersect(&Ray::new(Vec3::new(0.0, 0.0, 1.0), Vec3::Z));
        assert_eq!((hit.t, hit.sphere()), (1.0, Some(0)));
        assert!(accel.intersect(&Ray::new(Vec3::new(9.0, 0.0, 1.0), Vec3::Z)).is_none());
    }
}
