//! Displacement of meshes by the textures of their materials, before a scene is prepared.

mod refined;

use std::collections::{BTreeMap, HashMap};

use bottega_scene::{
    Displacement, DisplacementSource, DisplacementSpace, Mesh, MeshKey, SURFACE_UV_SETS, Scene, TextureMap,
};
use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec4};
use refined::split_long_edges;

use crate::mapping::{MappingPoint, TexturePlace};

/// The most triangles of a displaced mesh; a quarter of it if [`displace`] gets no level.
pub const DISPLACED_FACES_MAX: usize = 1 << 22;
/// The most triangles of a displaced mesh if the request does not say how fine it is.
const USUAL_FACES_MAX: usize = 1 << 20;
/// Longest edge of a mesh whose texture has no texels, as a share of its diagonal.
const USUAL_EDGE: f32 = 1.0 / 256.0;
/// Memory of a triangle while a mesh is displaced, in bytes.
const BYTES_PER_FACE: usize = 512;

/// Displaces the meshes whose materials have a displacement, and removes it from the materials. Returns what could not be
/// displaced, or not as finely as asked for.
///
/// - `level`: number of times that the longest edge of each mesh is halved; 0: no edge is split. `None`: edges are as
///   long as a texel of the texture, or as the file says, with at most a million triangles per mesh.
/// - `memory_bytes`: memory that all displaced meshes may take.
pub fn displace(scene: &mut Scene, level: Option<u8>, memory_bytes: usize) -> Vec<String> {
    if scene.materials.iter().all(|material| material.displacement.is_none()) {
        return Vec::new();
    }
    let mut notes = Vec::new();
    if scene.spheres.iter().any(|sphere| scene.materials[sphere.material as usize].displacement.is_some()) {
        notes.push("spheres are not displaced".to_owned());
    }
    let mut faces_left = memory_bytes / BYTES_PER_FACE;
    // Displace a mesh once for each material and, if it depends on it, each placement
    let mut made: BTreeMap<DisplacedKey, u32> = BTreeMap::new();
    for index in 0..scene.instances.len() {
        let instance = &scene.instances[index];
        let material = scene.material_of(instance);
        let Some(displacement) = &scene.materials[material as usize].displacement else { continue };
        let mesh = &scene.meshes[instance.mesh as usize];
        if mesh.curves.is_some() {
            notes.push(format!("the curves `{}` are not displaced", mesh.name));
            continue;
        }
        let is_placed = depends_on_place(displacement, &instance.world_from_object);
        let key = (instance.mesh, material, is_placed.then_some(index));
        let displaced = match made.get(&key) {
            Some(&displaced) => displaced,
            None => {
                let most = if level.is_some() { DISPLACED_FACES_MAX } else { USUAL_FACES_MAX };
                let limits = RefinementLimits { level, faces_max: most.min(faces_left) };
                let (displaced, is_fine) = displaced(scene, mesh, displacement, &instance.world_from_object, limits);
                if !is_fine && (level.is_some() || most > faces_left) {
                    let name = &mesh.name;
                    notes.push(format!(
                        "the mesh `{name}` is refined less than asked for, to {} triangles",
                        displaced.triangles.len()
                    ));
                }
                faces_left = faces_left.saturating_sub(displaced.triangles.len());
                scene.meshes.push(displaced);
                let displaced = scene.meshes.len() as u32 - 1;
                made.insert(key, displaced);
                displaced
            }
        };
        scene.instances[index].mesh = displaced;
    }
    drop_unused(scene);
    scene.materials.iter_mut().for_each(|material| material.displacement = None);
    notes.dedup();
    notes
}

/// A mesh, a material, and an instance if the displacement depends on its place.
type DisplacedKey = (u32, u32, Option<usize>);

/// The bounds of a refinement.
#[derive(Clone, Copy)]
struct RefinementLimits {
    level: Option<u8>,
    faces_max: usize,
}

/// Returns true if the same mesh is displaced otherwise elsewhere.
fn depends_on_place(displacement: &Displacement, world_from_object: &Affine3A) -> bool {
    let in_space = displacement.texture().is_some_and(|map| map.uv_set >= SURFACE_UV_SETS);
    let is_scaled = || {
        let Mat3A { x_axis, y_axis, z_axis } = world_from_object.matrix3;
        [x_axis, y_axis, z_axis].iter().any(|axis| (axis.length_squared() - 1.0).abs() > 1e-5)
    };
    in_space || displacement.space == DisplacementSpace::World && is_scaled()
}

/// Removes meshes without instances from the end of the list, and the geometry of others.
fn drop_unused(scene: &mut Scene) {
    let mut is_used = vec![false; scene.meshes.len()];
    scene.instances.iter().for_each(|instance| is_used[instance.mesh as usize] = true);
    // Move the last mesh into the place of each that is not used
    let mut index = 0;
    while index < scene.meshes.len() {
        if is_used[index] {
            index += 1;
            continue;
        }
        let last = scene.meshes.len() - 1;
        let Some(mesh) = scene.meshes.pop() else { return };
        let was_used = is_used.pop().unwrap_or(false);
        if index < last {
            scene.meshes.set_shared(index, mesh);
            is_used[index] = was_used;
            let moved = scene.instances.iter_mut().filter(|instance| instance.mesh as usize == last);
            moved.for_each(|instance| instance.mesh = index as u32);
        }
    }
}

/// Returns a mesh refined and displaced, and true if it is as fine as asked for.
fn displaced(
    scene: &Scene,
    mesh: &Mesh,
    displacement: &Displacement,
    world_from_object: &Affine3A,
    limits: RefinementLimits,
) -> (Mesh, bool) {
    let mut mesh = mesh.clone();
    let edge = longest_edge(scene, &mesh, displacement, world_from_object, limits.level);
    let is_fine = edge.is_none_or(|edge| split_long_edges(&mut mesh, edge, limits.faces_max));
    if displacement.keeps_normals && mesh.normals.is_empty() {
        // A mesh without normals would take those of its displaced triangles
        let vertices: Vec<u32> = (0..mesh.positions.len() as u32).collect();
        mesh.normals = smooth_normals(&mesh.positions, &mesh.triangles, &vertices);
        mesh.motion.iter_mut().for_each(|key| key.normals.clone_from(&mesh.normals));
    }
    let has_new_normals = !mesh.normals.is_empty() && !displacement.keeps_normals;
    let frame = PlaceFrame::new(world_from_object);
    let corner_ids = joined(&mesh.positions, &mesh.normals);
    let mut keys = std::mem::take(&mut mesh.motion);
    let moved = move_points(scene, &mesh, displacement, &frame, (&mesh.positions, &mesh.normals));
    for MeshKey { positions, normals, .. } in &mut keys {
        *positions = move_points(scene, &mesh, displacement, &frame, (positions, normals));
        if has_new_normals {
            *normals = smooth_normals(positions, &mesh.triangles, &corner_ids);
        }
    }
    if has_new_normals {
        mesh.normals = smooth_normals(&moved, &mesh.triangles, &corner_ids);
    }
    mesh.positions = moved;
    mesh.motion = keys;
    (mesh, is_fine)
}

/// Returns the longest edge of a refined mesh, in object space; `None`: its edges stay.
fn longest_edge(
    scene: &Scene,
    mesh: &Mesh,
    displacement: &Displacement,
    world_from_object: &Affine3A,
    level: Option<u8>,
) -> Option<f32> {
    let corner = |vertex: u32| mesh.positions[vertex as usize];
    let longest = || {
        let edges = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        edges.map(|[a, b]| corner(a).distance(corner(b))).fold(0.0, f32::max)
    };
    if let Some(level) = level {
        // Half of an edge that is split may be longer than half of the longest one, by rounding
        return (level > 0).then(|| longest() / (1u64 << level.min(62)) as f32 * 1.0001);
    }
    let (min, max) = mesh.bounds();
    let usual = (max - min).length() * USUAL_EDGE;
    let edge = match (displacement.edge, displacement.texture()) {
        (Some(edge), _) if displacement.space == DisplacementSpace::World => {
            edge / world_from_object.matrix3.determinant().abs().cbrt().max(f32::MIN_POSITIVE)
        }
        (Some(edge), _) => edge,
        (None, Some(map)) if map.uv_set < SURFACE_UV_SETS => {
            texel_edge(scene, mesh, map).unwrap_or(usual).max(usual * 0.25)
        }
        (None, _) => usual,
    };
    (edge > 0.0 && edge.is_finite()).then_some(edge)
}

/// Returns the length of a texel on a mesh, on average; `None`: the mesh has no texture coordinates.
fn texel_edge(scene: &Scene, mesh: &Mesh, map: &TextureMap) -> Option<f32> {
    let uvs = &mesh.uvs[usize::from(map.uv_set & 1)];
    if uvs.is_empty() {
        return None;
    }
    let (width, height) = scene.images[map.image.0 as usize].size();
    let to_texels = map.picture_from_uv.matrix2.determinant().abs() * width as f32 * height as f32;
    let (mut area, mut texels) = (0.0_f64, 0.0_f64);
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
        let [s, t, r] = triangle.map(|vertex| uvs[vertex as usize]);
        area += f64::from((b - a).cross(c - a).length());
        texels += f64::from((t - s).perp_dot(r - s).abs() * to_texels);
    }
    let edge = (area / texels).sqrt() as f32;
    (edge > 0.0 && edge.is_finite()).then_some(edge)
}

/// A placement of a mesh.
struct PlaceFrame {
    world_from_object: Affine3A,
    world_from_normal: Mat3A,
    object_from_world: Mat3A,
}

impl PlaceFrame {
    fn new(world_from_object: &Affine3A) -> Self {
        let object_from_world = world_from_object.matrix3.inverse();
        Self {
            world_from_object: *world_from_object,
            world_from_normal: object_from_world.transpose(),
            object_from_world,
        }
    }
}

/// Returns the displaced points of a mesh. Vertices at one point move together.
fn move_points(
    scene: &Scene,
    mesh: &Mesh,
    displacement: &Displacement,
    frame: &PlaceFrame,
    (positions, normals): (&[Vec3], &[Vec3]),
) -> Vec<Vec3> {
    let points = joined(positions, &[]);
    let smooth;
    let normals = if normals.is_empty() {
        smooth = smooth_normals(positions, &mesh.triangles, &points);
        &smooth
    } else {
        normals
    };
    let along_u;
    let tangents = if mesh.tangents.is_empty() && matches!(displacement.source, DisplacementSource::TangentVectors(_)) {
        along_u = tangents_of_uvs(mesh, positions, normals);
        &along_u
    } else {
        &mesh.tangents
    };
    let mut sums: Vec<(Vec3, f32)> = vec![(Vec3::ZERO, 0.0); positions.len()];
    for (vertex, (&p, &n)) in positions.iter().zip(normals).enumerate() {
        let tangent = tangents.get(vertex).copied().unwrap_or(Vec4::ZERO);
        let offset = offset_at(scene, mesh, displacement, frame, vertex, (p, n, tangent));
        let sum = &mut sums[points[vertex] as usize];
        *sum = (sum.0 + offset, sum.1 + 1.0);
    }
    positions
        .iter()
        .zip(&points)
        .map(|(&p, &point)| {
            let (sum, count) = sums[point as usize];
            p + sum / count
        })
        .collect()
}

/// Returns the displacement of a vertex, in object space.
fn offset_at(
    scene: &Scene,
    mesh: &Mesh,
    displacement: &Displacement,
    frame: &PlaceFrame,
    vertex: usize,
    (p, n, tangent): (Vec3, Vec3, Vec4),
) -> Vec3 {
    let uvs = [0, 1].map(|set: usize| mesh.uvs[set].get(vertex).copied().unwrap_or(Vec2::ZERO));
    let world_normal = (frame.world_from_normal * n).normalize_or(n);
    let mapping_point = MappingPoint {
        p: frame.world_from_object.transform_point3(p),
        normal: world_normal,
        ..MappingPoint::default()
    };
    let place = TexturePlace { uvs, mapping_point };
    let in_world = displacement.space == DisplacementSpace::World;
    let scaled = |value: f32| value * displacement.scale + displacement.bias;
    let offset = match &displacement.source {
        DisplacementSource::Heights(height) => {
            let height = scaled(height.eval(scene, place, 0.0));
            if in_world { frame.object_from_world * (world_normal * height) } else { n * height }
        }
        DisplacementSource::TangentVectors(vector) => {
            let vector = vector.eval(scene, place, 0.0);
            let t = (tangent.truncate() - n * n.dot(tangent.truncate())).normalize_or(n.any_orthonormal_vector());
            let b = n.cross(t) * if tangent.w < 0.0 { -1.0 } else { 1.0 };
            t * scaled(vector.x) + n * scaled(vector.y) + b * scaled(vector.z)
        }
        DisplacementSource::ObjectVectors(vector) => {
            let vector = vector.eval(scene, place, 0.0);
            Vec3::new(scaled(vector.x), scaled(vector.y), scaled(vector.z))
        }
    };
    if offset.is_finite() { offset } else { Vec3::ZERO }
}

/// Returns the tangents of vertices along u of the first texture coordinates, with the sign of the bitangent, which points
/// up in the picture.
fn tangents_of_uvs(mesh: &Mesh, positions: &[Vec3], normals: &[Vec3]) -> Vec<Vec4> {
    let uvs = &mesh.uvs[0];
    if uvs.is_empty() {
        return Vec::new();
    }
    let mut sums = vec![(Vec3::ZERO, Vec3::ZERO); positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        let [s, t, r] = triangle.map(|vertex| uvs[vertex as usize]);
        let (e, f, d, g) = (b - a, c - a, t - s, r - s);
        // Both times the determinant of the coordinates, whose sign alone matters: larger triangles count more
        let sign = d.perp_dot(g).signum();
        let (along_u, along_v) = ((e * g.y - f * d.y) * sign, (f * d.x - e * g.x) * sign);
        for &vertex in triangle {
            let sum = &mut sums[vertex as usize];
            *sum = (sum.0 + along_u, sum.1 + along_v);
        }
    }
    let tangent = |(&(u, v), &n): (&(Vec3, Vec3), &Vec3)| {
        let t = (u - n * n.dot(u)).normalize_or(n.any_orthonormal_vector());
        // v runs downwards
        t.extend(if n.cross(t).dot(v) > 0.0 { -1.0 } else { 1.0 })
    };
    sums.iter().zip(normals).map(tangent).collect()
}

/// Returns for each vertex the number of the first one at the same position and with the same normal.
fn joined(positions: &[Vec3], normals: &[Vec3]) -> Vec<u32> {
    // + 0.0 makes 0 of −0
    let bits = |v: Vec3| (v + 0.0).to_array().map(f32::to_bits);
    let mut firsts = HashMap::with_capacity(positions.len());
    let vertices = positions.iter().enumerate();
    vertices
        .map(|(vertex, &p)| {
            let n = normals.get(vertex).map(|&n| bits(n));
            *firsts.entry((bits(p), n)).or_insert(vertex as u32)
        })
        .collect()
}

/// Returns the normals of a surface that is smooth where vertices are joined, weighted by area.
fn smooth_normals(positions: &[Vec3], triangles: &[[u32; 3]], joined: &[u32]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        let area = (b - a).cross(c - a);
        triangle.iter().for_each(|&vertex| sums[joined[vertex as usize] as usize] += area);
    }
    joined.iter().map(|&first| sums[first as usize].normalize_or(Vec3::Z)).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bottega_scene::{Channel, ColorParam, Image, ImageId, Material, ScalarParam};

    use super::*;

    /// Heights that rise from 0 at u = 0 to 1 at u = 1.
    fn ramp() -> (Image, ScalarParam) {
        let picture_from_uv = glam::Affine2::from_cols_array(&[0.5, 0.0, 0.0, 1.0, 0.25, 0.0]);
        let map = TextureMap { picture_from_uv, ..TextureMap::new(ImageId(0)) };
        let param = ScalarParam { factor: 1.0, texture: Some((map, Channel::R)) };
        (Image::from_linear_rgb("ramp", 2, 1, vec![[0.0; 3], [1.0; 3]]), param)
    }

    fn scene(mesh: Mesh, change: impl FnOnce(&mut Displacement)) -> Scene {
        let (image, height) = ramp();
        let mut displacement = Displacement::heights(height);
        change(&mut displacement);
        let material = Material { displacement: Some(displacement), ..Material::default() };
        let mut scene = Scene { images: vec![image].into(), materials: vec![material], ..Scene::default() };
        scene.push_surface(mesh);
        scene
    }

    fn square() -> Mesh {
        Mesh::quad(Vec3::ZERO, 2.0 * Vec3::X, 2.0 * Vec3::Y)
    }

    #[test]
    fn a_square_rises_as_its_texture_does() {
        let mut scene = scene(square(), |displacement| (displacement.scale, displacement.bias) = (3.0, -1.0));
        assert_eq!(displace(&mut scene, Some(4), 1 << 30), Vec::<String>::new());
        assert_eq!(scene.meshes.len(), 1);
        let mesh = &scene.meshes[0];
        assert!(mesh.triangles.len() >= 2 * 16 * 16, "{}", mesh.triangles.len());
        let uvs = &mesh.uvs[0];
        for (p, uv) in mesh.positions.iter().zip(uvs) {
            assert!((p.z - (3.0 * uv.x - 1.0)).abs() < 1e-5, "{p} {uv}");
        }
        assert!(scene.materials[0].displacement.is_none());
        scene.validate().unwrap();
    }

    #[test]
    fn normals_follow_the_displaced_surface() {
        let mut mesh = square();
        mesh.normals = vec![Vec3::Z; mesh.positions.len()];
        let mut scene = scene(mesh, |displacement| displacement.scale = 2.0);
        displace(&mut scene, Some(3), 1 << 30);
        // u rises by 1 over 2 units
        let expected = Vec3::new(-1.0, 0.0, 1.0).normalize();
        let mesh = &scene.meshes[0];
        for n in &mesh.normals {
            assert!((*n - expected).length() < 1e-4 || (n.y.abs() < 1e-4 && n.z > 0.5), "{n}");
        }
    }

    #[test]
    fn normals_stay_for_a_relief() {
        let mut scene = scene(square(), |displacement| displacement.keeps_normals = true);
        displace(&mut scene, Some(1), 1 << 30);
        let mesh = &scene.meshes[0];
        assert!(mesh.normals.iter().all(|n| *n == Vec3::Z) && mesh.positions.iter().any(|p| p.z > 0.5));
    }

    #[test]
    fn level_zero_moves_the_vertices_alone() {
        let mut scene = scene(square(), |_| ());
        displace(&mut scene, Some(0), 1 << 30);
        assert_eq!(scene.meshes[0].triangles.len(), 2);
        assert!(scene.meshes[0].positions.iter().any(|p| (p.z - 1.0).abs() < 1e-5));
    }

    #[test]
    fn larger_instances_are_displaced_more_unless_lengths_are_in_the_world() {
        for (space, factor) in [(DisplacementSpace::Object, 4.0), (DisplacementSpace::World, 1.0)] {
            let mut scene = scene(square(), |displacement| displacement.space = space);
            scene.push_instance(0, Affine3A::from_scale(Vec3::splat(4.0)));
            displace(&mut scene, Some(2), 1 << 30);
            let instance = &scene.instances[1];
            let mesh = &scene.meshes[instance.mesh as usize];
            let most =
                mesh.positions.iter().map(|&p| instance.world_from_object.transform_point3(p).z).fold(0.0, f32::max);
            assert!((most - factor).abs() < 1e-4, "{space:?}: {most}");
            assert_eq!(scene.meshes.len(), if space == DisplacementSpace::World { 2 } else { 1 });
        }
    }

    #[test]
    fn vectors_go_along_the_tangent_the_normal_and_the_bitangent() {
        let vector = ColorParam { factor: Vec3::new(1.0, 2.0, 3.0), texture: None };
        // v of the quad grows along y, so up in the picture is the opposite
        for (source, expected) in [
            (DisplacementSource::TangentVectors(vector.clone()), Vec3::new(1.0, -3.0, 2.0)),
            (DisplacementSource::ObjectVectors(vector), Vec3::new(1.0, 2.0, 3.0)),
        ] {
            let mut scene = scene(square(), |displacement| displacement.source = source.clone());
            let before = scene.meshes[0].positions.clone();
            displace(&mut scene, Some(0), 1 << 30);
            for (p, before) in scene.meshes[0].positions.iter().zip(before) {
                assert!((*p - before - expected).length() < 1e-5, "{source:?}: {}", *p - before);
            }
        }
    }

    #[test]
    fn too_fine_a_mesh_is_reported() {
        let mut scene = scene(square(), |_| ());
        let notes = displace(&mut scene, Some(12), 200 * BYTES_PER_FACE);
        assert!(notes.len() == 1 && notes[0].contains("less than asked for"), "{notes:?}");
        assert!(scene.meshes[0].triangles.len() <= 200);
    }

    #[test]
    fn what_lies_at_one_point_stays_together() {
        // A box: three vertices at each corner, with normals of their own
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for axis in 0..3 {
            for side in [0.0, 1.0_f32] {
                let first = positions.len() as u32;
                for (a, b) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                    let mut p = Vec3::ZERO;
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, a, b);
                    positions.push(p);
                }
                let quad = [[first, first + 1, first + 2], [first, first + 2, first + 3]];
                triangles.extend(quad.map(|[a, b, c]| if side == 1.0 { [a, b, c] } else { [a, c, b] }));
            }
        }
        let mesh = Mesh { positions, triangles, ..Mesh::default() };
        let mut scene = scene(mesh, |displacement| displacement.bias = 0.1);
        displace(&mut scene, Some(2), 1 << 30);
        let mesh = &scene.meshes[0];
        let points: std::collections::BTreeSet<[u32; 3]> =
            mesh.positions.iter().map(|p| (*p + 0.0).to_array().map(f32::to_bits)).collect();
        // As many points as a closed surface of that many triangles has
        assert_eq!(points.len(), mesh.triangles.len() / 2 + 2);
    }

    #[test]
    fn meshes_that_nothing_refers_to_are_dropped() {
        let mut scene = scene(square(), |_| ());
        scene.push_mesh(square());
        let plain = scene.push_material(Material::default());
        scene.push_surface(Mesh { material: plain, name: "plain".into(), ..square() });
        displace(&mut scene, Some(1), 1 << 30);
        assert_eq!(scene.meshes.len(), 2);
        let names: Vec<&str> =
            scene.instances.iter().map(|instance| scene.meshes[instance.mesh as usize].name.as_str()).collect();
        assert_eq!(names[1], "plain");
        scene.validate().unwrap();
    }

    #[test]
    fn shared_meshes_of_other_scenes_stay() {
        let whole = scene(square(), |_| ());
        let mut copy = whole.clone();
        displace(&mut copy, Some(1), 1 << 30);
        assert_eq!(whole.meshes[0].triangles.len(), 2);
        assert!(Arc::strong_count(&whole.meshes.shared()[0]) == 1);
    }
}
