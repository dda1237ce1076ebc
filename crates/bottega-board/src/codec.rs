//! Serialization of shapes, rays and hits.

use std::time::Duration;

use bottega_kernels::{Hit, InstanceGeometry, MeshGeometry, Ray, SphereGeometry};
use bottega_render::SceneGeometry;
use bytemuck::{Pod, cast_slice, pod_collect_to_vec};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use crate::{BoardError, timed_reader::Receipt};

/// The floats of a ray: origin, t_min, direction, t_max.
const RAY_FLOATS: usize = 8;
/// The 32-bit words of a hit.
const HIT_WORDS: usize = 5;

/// The bytes of a ray.
const RAY_BYTES: usize = 4 * RAY_FLOATS;

/// Shapes owned by a board.
#[derive(Debug, Default)]
pub(crate) struct Shapes {
    meshes: Vec<(Vec<Vec3>, Vec<[u32; 3]>)>,
    instances: Vec<InstanceGeometry>,
    spheres: Vec<SphereGeometry>,
}

impl Shapes {
    pub(crate) fn meshes(&self) -> Vec<MeshGeometry<'_>> {
        self.meshes.iter().map(|(positions, triangles)| MeshGeometry { positions, triangles }).collect()
    }

    pub(crate) fn instances(&self) -> &[InstanceGeometry] {
        &self.instances
    }

    pub(crate) fn spheres(&self) -> &[SphereGeometry] {
        &self.spheres
    }
}

/// Serializes the shapes of a scene.
pub(crate) fn shapes_to_bytes(shapes: &SceneGeometry<'_>) -> Vec<u8> {
    let counts = [shapes.meshes.len(), shapes.instances.len(), shapes.spheres.len()].map(|count| count as u32);
    let mut bytes = cast_slice(&counts).to_vec();
    for mesh in &shapes.meshes {
        let counts = [mesh.positions.len() as u32, mesh.triangles.len() as u32];
        bytes.extend_from_slice(cast_slice(&counts));
        bytes.extend_from_slice(cast_slice(mesh.positions));
        bytes.extend_from_slice(cast_slice(mesh.triangles));
    }
    for instance in &shapes.instances {
        bytes.extend_from_slice(&instance.mesh.to_le_bytes());
        bytes.extend_from_slice(cast_slice(&instance.world_from_object.to_cols_array()));
    }
    for sphere in &shapes.spheres {
        let [x, y, z] = sphere.center.to_array();
        bytes.extend_from_slice(cast_slice(&[x, y, z, sphere.radius]));
    }
    bytes
}

/// Deserializes the shapes of a scene.
///
/// # Errors
/// The bytes are truncated, or an index is out of range.
pub(crate) fn shapes_of(bytes: &[u8]) -> Result<Shapes, BoardError> {
    let mut reader = Reader(bytes);
    let [meshes, instances, spheres] = reader.array::<u32, 3>()?;
    let mut shapes = Shapes::default();
    for _ in 0..meshes {
        let [positions, triangles] = reader.array::<u32, 2>()?;
        let positions: Vec<Vec3> = reader.many(positions)?;
        let triangles: Vec<[u32; 3]> = reader.many(triangles)?;
        if triangles.iter().flatten().any(|&corner| corner as usize >= positions.len()) {
            return Err(BoardError::Malformed("a triangle has a corner that does not exist"));
        }
        shapes.meshes.push((positions, triangles));
    }
    for _ in 0..instances {
        let [mesh] = reader.array::<u32, 1>()?;
        if mesh as usize >= shapes.meshes.len() {
            return Err(BoardError::Malformed("an instance refers to a mesh that does not exist"));
        }
        let columns = reader.array::<f32, 12>()?;
        let column = |i: usize| Vec3A::new(columns[3 * i], columns[3 * i + 1], columns[3 * i + 2]);
        let world_from_object =
            Affine3A { matrix3: Mat3A::from_cols(column(0), column(1), column(2)), translation: column(3) };
        shapes.instances.push(InstanceGeometry { mesh, world_from_object });
    }
    for _ in 0..spheres {
        let [x, y, z, radius] = reader.array::<f32, 4>()?;
        shapes.spheres.push(SphereGeometry { center: Vec3::new(x, y, z), radius });
    }
    if reader.0.is_empty() { Ok(shapes) } else { Err(BoardError::Malformed("something follows the shapes")) }
}

/// Appends the bytes of rays to a frame.
pub(crate) fn put_rays(bytes: &mut Vec<u8>, rays: &[Ray]) {
    bytes.reserve(rays.len() * RAY_BYTES);
    for ray in rays {
        let ([ox, oy, oz], [dx, dy, dz]) = (ray.origin.to_array(), ray.direction.to_array());
        bytes.extend_from_slice(cast_slice(&[ox, oy, oz, ray.t_min, dx, dy, dz, ray.t_max]));
    }
}

/// Deserializes rays.
///
/// # Errors
/// The last ray is truncated.
pub(crate) fn rays_of(bytes: &[u8]) -> Result<Vec<Ray>, BoardError> {
    if !bytes.len().is_multiple_of(RAY_BYTES) {
        return Err(BoardError::Malformed("a ray is cut off"));
    }
    let floats: Vec<f32> = pod_collect_to_vec(bytes);
    let ray = |f: &[f32]| Ray {
        t_min: f[3],
        t_max: f[7],
        ..Ray::new(Vec3::new(f[0], f[1], f[2]), Vec3::new(f[4], f[5], f[6]))
    };
    Ok(floats.chunks_exact(RAY_FLOATS).map(ray).collect())
}

/// Appends the bytes of hits to a frame.
pub(crate) fn put_hits(bytes: &mut Vec<u8>, hits: &[Hit]) {
    let words = |hit: &Hit| [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.instance, hit.primitive];
    bytes.reserve(4 * HIT_WORDS * hits.len());
    hits.iter().for_each(|hit| bytes.extend_from_slice(cast_slice(&words(hit))));
}

/// Deserializes hits.
///
/// # Errors
/// The number of hits is not `count`.
pub(crate) fn hits_of(bytes: &[u8], count: usize) -> Result<Vec<Hit>, BoardError> {
    if bytes.len() != 4 * HIT_WORDS * count {
        return Err(BoardError::Malformed("the numbers of hits and rays differ"));
    }
    let words: Vec<u32> = pod_collect_to_vec(bytes);
    let hit = |w: &[u32]| {
        let [t, u, v] = [w[0], w[1], w[2]].map(f32::from_bits);
        Hit { t, u, v, instance: w[3], primitive: w[4] }
    };
    Ok(words.chunks_exact(HIT_WORDS).map(hit).collect())
}

/// Appends one bit per flag, starting with the lowest of each byte.
pub(crate) fn put_flags(bytes: &mut Vec<u8>, flags: &[bool]) {
    let byte = |eight: &[bool]| eight.iter().rev().fold(0, |byte, &flag| byte << 1 | u8::from(flag));
    bytes.extend(flags.chunks(8).map(byte));
}

/// Serializes the receipt at the start of an answer: the rate at which its rays arrived.
pub(crate) fn receipt_to_bytes(receipt: &Receipt) -> Vec<u8> {
    let time = u64::try_from(receipt.time.as_nanos()).unwrap_or(u64::MAX);
    cast_slice(&[receipt.timed_bytes, time]).to_vec()
}

/// Splits an answer into its receipt and the rest.
///
/// # Errors
/// The answer is truncated.
pub(crate) fn receipt_of(bytes: &[u8]) -> Result<(Receipt, &[u8]), BoardError> {
    let mut reader = Reader(bytes);
    let [timed_bytes, time] = reader.array::<u64, 2>()?;
    Ok((Receipt { timed_bytes, time: Duration::from_nanos(time) }, reader.0))
}

/// Deserializes flags.
///
/// # Errors
/// The number of flags is not `count`.
pub(crate) fn flags_of(bytes: &[u8], count: usize) -> Result<Vec<bool>, BoardError> {
    if bytes.len() != count.div_ceil(8) {
        return Err(BoardError::Malformed("the numbers of answers and rays differ"));
    }
    Ok((0..count).map(|i| bytes[i / 8] >> (i % 8) & 1 != 0).collect())
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn many<T: Pod>(&mut self, count: u32) -> Result<Vec<T>, BoardError> {
        let cut_off = BoardError::Malformed("the shapes are cut off");
        let length = (count as usize).checked_mul(size_of::<T>());
        let Some((head, rest)) = length.and_then(|length| self.0.split_at_checked(length)) else { return Err(cut_off) };
        self.0 = rest;
        Ok(pod_collect_to_vec(head))
    }

    fn array<T: Pod, const N: usize>(&mut self) -> Result<[T; N], BoardError> {
        self.many(N as u32)?.try_into().map_err(|_| BoardError::Malformed("the shapes are cut off"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<u8> {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let meshes = vec![MeshGeometry { positions: &positions, triangles: &[[0, 1, 2]] }];
        let world_from_object = Affine3A::from_translation(Vec3::new(0.1, 0.2, 0.3));
        let instances = vec![InstanceGeometry { mesh: 0, world_from_object }];
        let spheres = vec![SphereGeometry { center: Vec3::ONE, radius: 0.5 }];
        shapes_to_bytes(&SceneGeometry { meshes, instances, spheres })
    }

    #[test]
    fn shapes_come_through_and_what_is_cut_off_or_points_nowhere_is_refused() {
        let bytes = shapes();
        let read = shapes_of(&bytes).unwrap();
        assert_eq!(read.meshes[0].1, [[0, 1, 2]]);
        assert_eq!(read.instances[0].world_from_object.translation, Vec3A::new(0.1, 0.2, 0.3));
        assert_eq!(read.spheres[0], SphereGeometry { center: Vec3::ONE, radius: 0.5 });
        for end in 0..bytes.len() {
            assert!(shapes_of(&bytes[..end]).is_err(), "{end} bytes of it");
        }
        assert!(shapes_of(&[&*bytes, &[0]].concat()).is_err(), "something follows");
        let corner = 12 + 8 + 36;
        let mut wrong = bytes.clone();
        wrong[corner] = 3;
        assert!(shapes_of(&wrong).is_err(), "a corner that does not exist");
        let mut wrong = bytes;
        wrong[corner + 12] = 1;
        assert!(shapes_of(&wrong).is_err(), "a mesh that does not exist");
    }

    #[test]
    fn rays_and_answers_come_through() {
        let rays = [Ray { t_max: 0.5, ..Ray::new(Vec3::ONE, Vec3::X) }, Ray::new(Vec3::ZERO, -Vec3::Z)];
        let mut bytes = Vec::new();
        put_rays(&mut bytes, &rays);
        assert_eq!(rays_of(&bytes).unwrap(), rays);
        assert!(rays_of(&bytes[1..]).is_err());
        let hits = [Hit::NONE, Hit { t: 1.5, u: 0.25, v: 0.5, instance: 3, primitive: 7 }];
        let receipt = Receipt { timed_bytes: 17, time: Duration::from_micros(3) };
        let mut answer = receipt_to_bytes(&receipt);
        put_hits(&mut answer, &hits);
        let (read, rest) = receipt_of(&answer).unwrap();
        assert_eq!((read, &*hits_of(rest, 2).unwrap()), (receipt, &hits[..]));
        assert!(hits_of(rest, 3).is_err() && receipt_of(&answer[..15]).is_err());
        let flags: Vec<bool> = (0..19).map(|i| i % 3 == 0).collect();
        let mut bytes = Vec::new();
        put_flags(&mut bytes, &flags);
        assert_eq!(flags_of(&bytes, 19).unwrap(), flags);
        assert!(flags_of(&bytes, 25).is_err());
    }
}
