//! The parts of a scene that move while the shutter is open.
//!
//! Times run from 0, when the shutter opens, to 1, when it is closed. A prepared scene holds all parts at time 0, so
//! code without motion renders that moment. This module has the poses at other times.

use std::sync::Arc;

use bottega_kernels::{KeySpan, MeshKeyGeometry, MotionGeometry, MovingTransform, SphereGeometry, SphereKeyGeometry};
use bottega_scene::{Camera, LightKind, MeshKey, Scene, Shutter, Sphere, SphereKey, TransformKey};
use glam::{Affine3A, Vec3};

/// A list of which few elements are set; empty if none is.
#[derive(Clone, Debug)]
struct SparseList<T>(Vec<Option<Box<T>>>);

impl<T> Default for SparseList<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> SparseList<T> {
    fn set(&mut self, index: usize, value: T) {
        if self.0.len() <= index {
            self.0.resize_with(index + 1, || None);
        }
        self.0[index] = Some(Box::new(value));
    }

    #[inline(always)]
    fn get(&self, index: u32) -> Option<&T> {
        self.0.get(index as usize)?.as_deref()
    }

    fn iter(&self) -> impl Iterator<Item = (u32, &T)> {
        self.0.iter().zip(0..).filter_map(|(value, index)| Some((index, value.as_deref()?)))
    }
}

/// Keys that take part: their times from 0 to 1 and beyond, and the index of the first one.
#[derive(Clone, Debug)]
struct ChosenKeys {
    times: Box<[f32]>,
    first: usize,
}

/// Keys of a sphere that take part, and their times.
#[derive(Clone, Debug)]
struct ChosenSphereKeys {
    times: Box<[f32]>,
    keys: Box<[SphereKey]>,
}

/// The moving parts of a prepared scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct SceneMotion {
    shutter: Shutter,
    instances: SparseList<MovingTransform>,
    meshes: SparseList<ChosenKeys>,
    spheres: SparseList<ChosenSphereKeys>,
    lights: SparseList<MovingTransform>,
    /// `true`: something moves, or a camera of the scene does.
    moves: bool,
}

/// Chooses the keys that a shutter sees: those of the span, and the nearest ones before and after. Returns their indices
/// with their times as shares of the span.
fn seen_keys(shutter: &Shutter, times: impl Iterator<Item = f64>) -> Vec<(usize, f32)> {
    let mut seen: Vec<(usize, f32)> = Vec::new();
    for (index, time) in times.enumerate() {
        let share = if shutter.is_instant() { (time - shutter.open) * 1e3 } else { shutter.share(time) } as f32;
        // The last key before the span replaces those before it
        if share <= 0.0 {
            seen.clear();
        }
        // Times that are no longer apart as shares are one
        if seen.last().is_some_and(|last| last.1 >= share) {
            continue;
        }
        seen.push((index, share.clamp(-1e6, 1e6)));
        if share >= 1.0 {
            break;
        }
    }
    seen
}

/// Returns the transformation that keys make, if they are followed.
fn transform_of(shutter: &Shutter, keys: &[TransformKey]) -> Option<MovingTransform> {
    let seen = seen_keys(shutter, keys.iter().map(|key| key.time));
    let keys: Vec<(f32, Affine3A)> = seen.into_iter().map(|(index, time)| (time, keys[index].transform)).collect();
    MovingTransform::new(&keys)
}

/// Interpolates vectors linearly.
fn mixed(from: &[Vec3], to: &[Vec3], share: f32) -> Vec<Vec3> {
    from.iter().zip(to).map(|(&a, &b)| a * (1.0 - share) + b * share).collect()
}

/// Returns the sphere at a share of the way between two keys.
fn sphere_between(sphere: &Sphere, from: &SphereKey, to: &SphereKey, share: f32) -> Sphere {
    let rest = 1.0 - share;
    let near = if from.world_from_object.dot(to.world_from_object) < 0.0 { -1.0 } else { 1.0 };
    let turn = from.world_from_object * rest + to.world_from_object * (share * near);
    Sphere {
        center: from.center * rest + to.center * share,
        radius: from.radius * rest + to.radius * share,
        world_from_object: if turn.length_squared() > 1e-12 { turn.normalize() } else { from.world_from_object },
        material: sphere.material,
        visibility: sphere.visibility,
        motion: Vec::new(),
    }
}

impl SceneMotion {
    /// Finds what moves. Returns the scene as it is when the shutter opens.
    pub(crate) fn of(scene: Arc<Scene>) -> (Arc<Scene>, Self) {
        if !scene.has_motion() {
            return (scene, Self::default());
        }
        let shutter = scene.shutter;
        let (mut opened, mut motion) = (Scene::clone(&scene), Self { shutter, ..Self::default() });
        let changes = |moving: &MovingTransform| !shutter.is_instant() && !moving.is_still();
        for (index, instance) in opened.instances.iter_mut().enumerate() {
            let Some(moving) = transform_of(&shutter, &instance.motion) else { continue };
            instance.world_from_object = moving.at(0.0);
            if changes(&moving) {
                motion.instances.set(index, moving);
            }
        }
        for index in 0..opened.meshes.len() {
            motion.open_mesh(&mut opened, index);
        }
        for (index, sphere) in opened.spheres.iter_mut().enumerate() {
            motion.open_sphere(sphere, index);
        }
        for (index, light) in opened.lights.iter_mut().enumerate() {
            let Some(moving) = transform_of(&shutter, &light.motion) else { continue };
            if changes(&moving) && !matches!(light.kind, LightKind::Directional { .. }) {
                motion.lights.set(index, moving);
            } else {
                light.kind = light.kind.moved(&moving.at(0.0));
                light.motion.clear();
            }
        }
        for camera in &mut opened.cameras {
            let Some(moving) = transform_of(&shutter, &camera.motion) else { continue };
            camera.world_from_camera = moving.at(0.0);
            motion.moves |= changes(&moving);
        }
        motion.moves |= motion.moves_surfaces() || !motion.lights.0.is_empty();
        (Arc::new(opened), motion)
    }

    /// Poses the vertices of a mesh for time 0, and notes their keys.
    fn open_mesh(&mut self, scene: &mut Scene, index: usize) {
        let Some(mesh) = scene.meshes.get(index).filter(|mesh| !mesh.motion.is_empty()) else { return };
        let seen = seen_keys(&self.shutter, mesh.motion.iter().map(|key| key.time));
        let (Some(&(first, _)), Some(&(last, _))) = (seen.first(), seen.last()) else { return };
        let times: Box<[f32]> = seen.iter().map(|key| key.1).collect();
        let (from, to, share) = if seen.len() > 1 {
            let KeySpan { key, share } = KeySpan::find(&times, 0.0);
            (seen[key].0, seen[key + 1].0, share)
        } else {
            (first, first, 0.0)
        };
        // The keys that are seen follow each other, unless their times are one as shares
        let is_whole = last - first + 1 == seen.len();
        let is_same = |key: &MeshKey| key.positions == mesh.motion[first].positions;
        let moves = is_whole && !self.shutter.is_instant() && !mesh.motion[first..=last].iter().all(is_same);
        let (positions, normals) = {
            let (from, to) = (&mesh.motion[from], &mesh.motion[to]);
            let normals = mixed(&from.normals, &to.normals, share);
            let normals = normals.iter().zip(&from.normals).map(|(n, &other)| n.normalize_or(other)).collect();
            (mixed(&from.positions, &to.positions, share), normals)
        };
        let mesh = &mut scene.meshes[index];
        (mesh.positions, mesh.normals) = (positions, normals);
        if moves {
            self.meshes.set(index, ChosenKeys { times, first });
        }
    }

    /// Poses a sphere for time 0, and notes its keys.
    fn open_sphere(&mut self, sphere: &mut Sphere, index: usize) {
        let seen = seen_keys(&self.shutter, sphere.motion.iter().map(|key| key.time));
        let times: Box<[f32]> = seen.iter().map(|key| key.1).collect();
        let keys: Box<[SphereKey]> = seen.iter().map(|key| sphere.motion[key.0]).collect();
        let motion = std::mem::take(&mut sphere.motion);
        match &keys[..] {
            [] => {}
            [key] => *sphere = sphere_between(sphere, key, key, 0.0),
            _ => {
                let KeySpan { key, share } = KeySpan::find(&times, 0.0);
                *sphere = sphere_between(sphere, &keys[key], &keys[key + 1], share);
                let place = |key: &SphereKey| (key.center, key.radius, key.world_from_object);
                if !self.shutter.is_instant() && keys.iter().any(|key| place(key) != place(&keys[0])) {
                    self.spheres.set(index, ChosenSphereKeys { times, keys });
                }
            }
        }
        sphere.motion = motion;
    }

    /// Returns true if something moves: then every path has a time.
    #[inline(always)]
    pub(crate) fn moves(&self) -> bool {
        self.moves
    }

    /// Returns true if a surface moves.
    pub(crate) fn moves_surfaces(&self) -> bool {
        !(self.instances.0.is_empty() && self.meshes.0.is_empty() && self.spheres.0.is_empty())
    }

    /// Returns the time of a path, given a number that is uniform in [0, 1).
    pub(crate) fn time(&self, u: f32) -> f32 {
        self.shutter.sample(u)
    }

    /// Returns the transformation of an instance, if it moves; else `None`.
    #[inline(always)]
    pub(crate) fn instance(&self, index: u32) -> Option<&MovingTransform> {
        self.instances.get(index)
    }

    /// Returns true if the vertices of a mesh move.
    #[inline(always)]
    pub(crate) fn moves_mesh(&self, mesh: u32) -> bool {
        self.meshes.get(mesh).is_some()
    }

    /// Returns the transformation of a light without extent, from where the scene puts it, if it moves; else `None`.
    pub(crate) fn light(&self, index: u32) -> Option<&MovingTransform> {
        self.lights.get(index)
    }

    /// Returns the transformation of a camera, if it moves; else `None`.
    pub(crate) fn camera(&self, camera: &Camera) -> Option<MovingTransform> {
        let moving = transform_of(&self.shutter, &camera.motion)?;
        (!self.shutter.is_instant() && !moving.is_still()).then_some(moving)
    }

    /// Returns positions and normals of a triangle's corners at a time, in object space, if the vertices of the mesh
    /// move. Without vertex normals, the normals are 0. Returns `None` if they stand still.
    pub(crate) fn corners(&self, scene: &Scene, mesh: u32, triangle: [u32; 3], time: f32) -> Option<[[Vec3; 3]; 2]> {
        let ChosenKeys { times, first } = self.meshes.get(mesh)?;
        let KeySpan { key, share } = KeySpan::find(times, time);
        let keys = &scene.meshes[mesh as usize].motion;
        let (from, to) = (&keys[first + key], &keys[first + key + 1]);
        let mix = |a: &[Vec3], b: &[Vec3]| {
            triangle.map(|vertex| match (a.get(vertex as usize), b.get(vertex as usize)) {
                (Some(&a), Some(&b)) => a * (1.0 - share) + b * share,
                _ => Vec3::ZERO,
            })
        };
        let normals = mix(&from.normals, &to.normals).map(Vec3::normalize_or_zero);
        Some([mix(&from.positions, &to.positions), normals])
    }

    /// Returns the boxes of the keys' positions of a triangle, over all keys that are seen; `None`: the mesh stands still.
    pub(crate) fn triangle_bounds(
        &self,
        scene: &Scene,
        mesh: u32,
        triangle: [u32; 3],
    ) -> Option<bottega_kernels::Aabb> {
        let ChosenKeys { times, first } = self.meshes.get(mesh)?;
        let keys = &scene.meshes[mesh as usize].motion[*first..first + times.len()];
        let corners = keys.iter().flat_map(|key| triangle.map(|vertex| key.positions[vertex as usize]));
        Some(corners.fold(bottega_kernels::Aabb::EMPTY, |bounds, p| bounds.with(p)))
    }

    /// Returns a sphere at a time, if it moves; else `None`.
    pub(crate) fn sphere(&self, scene: &Scene, index: u32, time: f32) -> Option<Sphere> {
        let ChosenSphereKeys { times, keys } = self.spheres.get(index)?;
        let KeySpan { key, share } = KeySpan::find(times, time);
        Some(sphere_between(&scene.spheres[index as usize], &keys[key], &keys[key + 1], share))
    }

    /// Returns the keys of a sphere that are seen, if it moves; else `None`.
    pub(crate) fn sphere_keys(&self, index: u32) -> Option<&[SphereKey]> {
        self.spheres.get(index).map(|chosen| &*chosen.keys)
    }

    /// Returns the moving surfaces as the input of the tree builder.
    pub(crate) fn geometry<'a>(&self, scene: &'a Scene) -> MotionGeometry<'a> {
        let instances = self.instances.iter().map(|(index, moving)| (index, moving.clone())).collect();
        let mesh = |(index, chosen): (u32, &ChosenKeys)| {
            let keys = scene.meshes[index as usize].motion[chosen.first..].iter();
            let key = |(&time, key): (&f32, &'a MeshKey)| MeshKeyGeometry { time, positions: &key.positions };
            (index, chosen.times.iter().zip(keys).map(key).collect())
        };
        let sphere = |(index, ChosenSphereKeys { times, keys }): (u32, &ChosenSphereKeys)| {
            let key = |(&time, key): (&f32, &SphereKey)| {
                let sphere = SphereGeometry { center: key.center, radius: key.radius };
                SphereKeyGeometry { time, sphere }
            };
            (index, times.iter().zip(keys.iter()).map(key).collect())
        };
        MotionGeometry {
            instances,
            meshes: self.meshes.iter().map(mesh).collect(),
            spheres: self.spheres.iter().map(sphere).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(time: f64, x: f32) -> TransformKey {
        TransformKey { time, transform: Affine3A::from_translation(Vec3::X * x) }
    }

    #[test]
    fn only_keys_that_the_shutter_sees_count() {
        let shutter = Shutter { open: 10.0, close: 12.0, ramp: 0.0 };
        let seen = |times: &[f64]| seen_keys(&shutter, times.iter().copied());
        assert_eq!(seen(&[0.0, 9.0, 11.0, 14.0, 20.0]), [(1, -0.5), (2, 0.5), (3, 2.0)]);
        assert_eq!(seen(&[10.0, 12.0, 13.0]), [(0, 0.0), (1, 1.0)]);
        assert_eq!(seen(&[1.0, 2.0]), [(1, -4.0)]);
        assert_eq!(seen(&[15.0, 16.0]), [(0, 2.5)]);
        assert_eq!(seen(&[]), []);
    }

    #[test]
    fn a_closed_shutter_sees_one_moment() {
        let mut scene = Scene { shutter: Shutter { open: 1.0, close: 1.0, ramp: 0.0 }, ..Scene::default() };
        scene.cameras.push(Camera { motion: vec![key(0.0, 0.0), key(2.0, 4.0)], ..Camera::default() });
        let (opened, motion) = SceneMotion::of(Arc::new(scene.clone()));
        assert!(!motion.moves() && motion.camera(&opened.cameras[0]).is_none());
        assert!((opened.cameras[0].world_from_camera.translation.x - 2.0).abs() < 1e-5);
        scene.shutter.close = 3.0;
        let (opened, motion) = SceneMotion::of(Arc::new(scene));
        let moving = motion.camera(&opened.cameras[0]).unwrap();
        assert!(motion.moves() && !motion.moves_surfaces());
        assert!(
            [(0.0, 2.0), (0.25, 3.0), (0.5, 4.0), (1.0, 4.0)]
                .iter()
                .all(|&(time, x)| { (moving.at(time).translation.x - x).abs() < 1e-5 })
        );
    }
}
