//! Geometry that moves: transformations, vertices and spheres with keys at several times.
//!
//! Times are numbers of the caller's unit. A renderer maps the interval in which its shutter is open to [0, 1]: rays have
//! times of that interval, and boxes around paths of moving geometry cover exactly it.

use crate::{Aabb, BuildError, InstanceGeometry, MeshGeometry, SphereGeometry, math};
use glam::{Affine3A, DMat3, DQuat, DVec3, Mat3, Vec3};

/// A transformation over time. Between two keys, translation, rotation and stretch are interpolated apart: the
/// translation and the stretch linearly, the rotation at constant speed by the shorter way. Before the first key and
/// after the last one it stands still.
///
/// Source: Shoemake and Duff 1992, *Matrix Animation and Polar Decomposition*; pbrt-v4, section 3.9.3.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingTransform {
    keys: Box<[PoseKey]>,
}

/// A key of a transformation, taken apart, and the way to the next key.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PoseKey {
    time: f32,
    /// The transformation as it was given.
    given: Affine3A,
    translation: DVec3,
    rotation: DMat3,
    stretch: DMat3,
    /// Axis and angle in radians of the rotation to the next key, in the space that `stretch` leads to.
    axis: DVec3,
    angle: f64,
    /// `true`: the stretch of the next key differs.
    stretches: bool,
}

/// Largest angle in radians by which a transformation turns between two boxes of its path.
const TURN_MAX: f64 = 0.125;
/// Largest number of boxes between two keys.
const STEPS_MAX: f64 = 32.0;

impl MovingTransform {
    /// Makes a transformation of keys: times, ascending, and the transformations then. `None`: there is no key, the
    /// times do not ascend, a number is not finite, a transformation is singular, or only some of them mirror.
    pub fn new(keys: &[(f32, Affine3A)]) -> Option<Self> {
        let is_ascending = keys.windows(2).all(|pair| pair[0].0 < pair[1].0);
        let is_finite = keys.iter().all(|(time, given)| time.is_finite() && given.is_finite());
        if keys.is_empty() || !is_ascending || !is_finite {
            return None;
        }
        let mut poses = keys.iter().map(|&(time, given)| PoseKey::new(time, given)).collect::<Option<Vec<_>>>()?;
        let mirrors = |pose: &PoseKey| pose.stretch.determinant() < 0.0;
        if poses.iter().any(|pose| mirrors(pose) != mirrors(&poses[0])) {
            return None;
        }
        for index in 1..poses.len() {
            let next = poses[index];
            poses[index - 1].lead_to(&next);
        }
        Some(Self { keys: poses.into() })
    }

    /// Returns the transformation at a time; NaN counts as before the first key.
    pub fn at(&self, time: f32) -> Affine3A {
        let (first, last) = (&self.keys[0], &self.keys[self.keys.len() - 1]);
        if time >= last.time {
            return last.given;
        }
        if time <= first.time || time.is_nan() {
            return first.given;
        }
        let next = self.keys.partition_point(|key| key.time <= time);
        let (from, to) = (&self.keys[next - 1], &self.keys[next]);
        if time == from.time {
            return from.given;
        }
        from.towards(to, f64::from(time - from.time) / f64::from(to.time - from.time))
    }

    /// Returns true if the transformation is the same at all times.
    pub fn is_still(&self) -> bool {
        self.keys.iter().all(|key| key.given == self.keys[0].given)
    }

    /// Returns true if the transformation changes by its translation alone.
    pub fn only_shifts(&self) -> bool {
        self.keys.iter().all(|key| key.given.matrix3 == self.keys[0].given.matrix3)
    }

    /// Returns boxes around the path of `object`, a box in object space, from time 0 to time 1, each with its time,
    /// ascending. At any time between two of them, the box interpolated linearly from both contains the moved box.
    pub fn path(&self, object: &Aabb) -> Vec<(f32, Aabb)> {
        // Times within the interval where the motion changes, and both ends
        let mut times = vec![0.0];
        times.extend(self.keys.iter().map(|key| key.time).filter(|&time| time > 0.0 && time < 1.0));
        times.push(1.0);
        let mut path: Vec<(f32, Aabb)> = vec![(0.0, self.bounds_at(0.0, object))];
        for span in times.windows(2) {
            let (turn, slack) = self.bend(span[0], span[1], object);
            let steps = (turn / TURN_MAX).ceil().clamp(1.0, STEPS_MAX);
            // An arc differs from its chord by at most the eighth part of its second derivative
            let room = Vec3::splat((slack / (8.0 * steps * steps) * (1.0 + 1e-6)) as f32);
            if let Some((_, bounds)) = path.last_mut() {
                *bounds = Aabb { min: bounds.min - room, max: bounds.max + room };
            }
            for step in 1..=steps as u32 {
                let share = step as f32 / steps as f32;
                let time = if share >= 1.0 { span[1] } else { span[0] + (span[1] - span[0]) * share };
                let Aabb { min, max } = self.bounds_at(time, object);
                path.push((time, Aabb { min: min - room, max: max + room }));
            }
        }
        path
    }

    fn bounds_at(&self, time: f32, object: &Aabb) -> Aabb {
        crate::instance::Affine::new(&self.at(time)).bounds(object)
    }

    /// Returns the angle by which the transformation turns between two times without a key between them, and a bound of
    /// the second derivative of the path of any point of the box, for a parameter from 0 to 1.
    fn bend(&self, start: f32, end: f32, object: &Aabb) -> (f64, f64) {
        let middle = 0.5 * (start + end);
        let next = self.keys.partition_point(|key| key.time <= middle);
        if next == 0 || next == self.keys.len() {
            return (0.0, 0.0);
        }
        let (from, to) = (&self.keys[next - 1], &self.keys[next]);
        let share = f64::from(end - start) / f64::from(to.time - from.time);
        let corner = |index: usize| {
            let pick = |axis: usize| if index >> axis & 1 == 1 { object.max[axis] } else { object.min[axis] };
            DVec3::new(pick(0).into(), pick(1).into(), pick(2).into())
        };
        let (mut size, mut growth) = (0.0f64, 0.0f64);
        for corner in (0..8).map(corner) {
            let (before, after) = (from.stretch * corner, to.stretch * corner);
            size = size.max(before.length()).max(after.length());
            growth = growth.max((after - before).length() * share);
        }
        let turn = from.angle * share;
        (turn, turn * turn * size + 2.0 * turn * growth)
    }
}

impl PoseKey {
    /// Takes a transformation apart. `None`: it is singular.
    fn new(time: f32, given: Affine3A) -> Option<Self> {
        let linear = Mat3::from(given.matrix3).as_dmat3();
        let determinant = linear.determinant();
        if !determinant.is_normal() {
            return None;
        }
        // A mirroring matrix is a rotation after a stretch by negative factors
        let side = if determinant < 0.0 { -1.0 } else { 1.0 };
        let rotation = nearest_rotation(linear * side)?;
        Some(Self {
            time,
            given,
            translation: Vec3::from(given.translation).as_dvec3(),
            rotation,
            stretch: rotation.transpose() * linear,
            axis: DVec3::Z,
            angle: 0.0,
            stretches: false,
        })
    }

    /// Sets the way to the next key.
    fn lead_to(&mut self, next: &Self) {
        let turn = DQuat::from_mat3(&(self.rotation.transpose() * next.rotation)).normalize();
        let turn = if turn.w < 0.0 { -turn } else { turn };
        let sine = turn.xyz().length();
        // Smaller angles are rounding errors of the matrices
        if sine > 1e-7 {
            self.axis = turn.xyz() / sine;
            self.angle = 2.0 * f64::from(math::atan2(sine as f32, turn.w as f32));
        }
        let change = next.stretch - self.stretch;
        let size = |matrix: &DMat3| matrix.to_cols_array().into_iter().fold(0.0f64, |most, x| most.max(x.abs()));
        self.stretches = size(&change) > 1e-6 * size(&self.stretch);
    }

    /// Returns the transformation at a share of the way to the next key.
    fn towards(&self, next: &Self, share: f64) -> Affine3A {
        let translation = self.translation * (1.0 - share) + next.translation * share;
        let translation = translation.as_vec3a();
        if self.angle == 0.0 && !self.stretches {
            return Affine3A { matrix3: self.given.matrix3, translation };
        }
        let stretch = if self.stretches { self.stretch * (1.0 - share) + next.stretch * share } else { self.stretch };
        let linear = self.rotation * (turned(self.axis, self.angle * share) * stretch);
        Affine3A { matrix3: linear.as_mat3().into(), translation }
    }
}

/// Returns the rotation about an axis by an angle in radians (Rodrigues' formula).
fn turned(axis: DVec3, angle: f64) -> DMat3 {
    let (sine, cosine) = math::sin_cos(angle as f32);
    let (sine, cosine) = (f64::from(sine), f64::from(cosine));
    let DVec3 { x, y, z } = axis;
    let cross = DMat3::from_cols(DVec3::new(0.0, z, -y), DVec3::new(-z, 0.0, x), DVec3::new(y, -x, 0.0));
    let outer = DMat3::from_cols(axis * x, axis * y, axis * z);
    DMat3::IDENTITY * cosine + cross * sine + outer * (1.0 - cosine)
}

/// Returns the rotation of the polar decomposition of a matrix with a positive determinant, by Newton's iteration.
fn nearest_rotation(matrix: DMat3) -> Option<DMat3> {
    let mut rotation = matrix;
    for _ in 0..200 {
        let next = (rotation + rotation.inverse().transpose()) * 0.5;
        if !next.is_finite() {
            return None;
        }
        let change = next - rotation;
        rotation = next;
        if change.to_cols_array().into_iter().all(|x| x.abs() < 1e-13) {
            break;
        }
    }
    Some(rotation)
}

/// The vertices of a mesh at a time.
#[derive(Clone, Copy, Debug)]
pub struct MeshKeyGeometry<'a> {
    /// Time of the key.
    pub time: f32,
    /// Positions in object space: as many as the mesh has.
    pub positions: &'a [Vec3],
}

/// A sphere at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereKeyGeometry {
    /// Time of the key.
    pub time: f32,
    /// Sphere at that time.
    pub sphere: SphereGeometry,
}

/// The moving parts of a scene. Parts that are not named here stand still.
#[derive(Clone, Debug, Default)]
pub struct MotionGeometry<'a> {
    /// Moving instances: index and transformation, ascending by the index. It takes the place of the instance's
    /// [`world_from_object`](InstanceGeometry::world_from_object).
    pub instances: Vec<(u32, MovingTransform)>,
    /// Meshes with moving vertices: index and two keys at least, ascending by the index; the times ascend, too.
    pub meshes: Vec<(u32, Vec<MeshKeyGeometry<'a>>)>,
    /// Moving spheres: index and two keys at least, ascending by the index; the times ascend, too.
    pub spheres: Vec<(u32, Vec<SphereKeyGeometry>)>,
}

impl MotionGeometry<'_> {
    /// Returns true if nothing moves.
    pub fn is_empty(&self) -> bool {
        self.instances.is_empty() && self.meshes.is_empty() && self.spheres.is_empty()
    }

    /// Checks moving parts against the geometry that they belong to.
    pub(crate) fn validate(
        &self,
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
    ) -> Result<(), BuildError> {
        let bad = |what: &'static str, index: u32, problem: &'static str| {
            Err(BuildError::BadMotion { what, index: index as usize, problem })
        };
        let mut last = None;
        for (index, _) in &self.instances {
            if *index as usize >= instances.len() || last.is_some_and(|last| last >= *index) {
                return bad("instance", *index, "does not exist, or is out of order");
            }
            last = Some(*index);
        }
        let mut last = None;
        for (index, keys) in &self.meshes {
            if *index as usize >= meshes.len() || last.is_some_and(|last| last >= *index) {
                return bad("mesh", *index, "does not exist, or is out of order");
            }
            last = Some(*index);
            if !ascend(keys.iter().map(|key| key.time)) {
                return bad("mesh", *index, "needs two keys or more, at times that ascend");
            }
            if keys.iter().any(|key| key.positions.len() != meshes[*index as usize].positions.len()) {
                return bad("mesh", *index, "has keys with different numbers of vertices");
            }
            if keys.iter().any(|key| key.positions.iter().any(|p| !p.is_finite())) {
                return bad("mesh", *index, "has a position that is not finite");
            }
        }
        let mut last = None;
        for (index, keys) in &self.spheres {
            if *index as usize >= spheres.len() || last.is_some_and(|last| last >= *index) {
                return bad("sphere", *index, "does not exist, or is out of order");
            }
            last = Some(*index);
            if !ascend(keys.iter().map(|key| key.time)) {
                return bad("sphere", *index, "needs two keys or more, at times that ascend");
            }
            let is_sound = |sphere: &SphereGeometry| {
                let bounds = Aabb::around(sphere.center, sphere.radius);
                sphere.radius >= 0.0 && bounds.min.is_finite() && bounds.max.is_finite()
            };
            if !keys.iter().all(|key| is_sound(&key.sphere)) {
                return bad("sphere", *index, "has a center or radius that is not finite, or a negative radius");
            }
        }
        Ok(())
    }
}

/// Returns true if there are two finite times at least, and all ascend.
fn ascend(times: impl Iterator<Item = f32> + Clone) -> bool {
    times.clone().count() >= 2
        && times.clone().all(f32::is_finite)
        && times.clone().zip(times.skip(1)).all(|(before, after)| before < after)
}

/// The place of a time between two keys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeySpan {
    /// Index of the key before; the next one is the key after.
    pub key: usize,
    /// Share of the way to the key after, in [0, 1].
    pub share: f32,
}

impl KeySpan {
    /// Returns the place of `time` among the ascending `times` of keys. A time before the first key, and NaN, gets that
    /// key, and a time after the last key gets the last.
    ///
    /// # Panics
    /// There are fewer than two keys.
    pub fn find(times: &[f32], time: f32) -> Self {
        let key = times.partition_point(|&key| key <= time).clamp(1, times.len() - 1) - 1;
        let (from, to) = (times[key], times[key + 1]);
        let share = (time - from) / (to - from);
        // NaN becomes 0
        Self { key, share: if share > 0.0 { share.min(1.0) } else { 0.0 } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SplitMix64;
    use glam::Quat;

    fn near(a: &Affine3A, b: &Affine3A, tolerance: f32) -> bool {
        a.abs_diff_eq(*b, tolerance)
    }

    #[test]
    fn translation_rotation_and_stretch_are_interpolated_apart() {
        let at = |turns: f32, size: f32, x: f32| {
            Affine3A::from_scale_rotation_translation(
                Vec3::new(size, 1.0, 2.0),
                Quat::from_rotation_z(turns * std::f32::consts::TAU),
                Vec3::X * x,
            )
        };
        let moving = MovingTransform::new(&[(0.0, at(0.0, 1.0, -3.0)), (1.0, at(0.25, 3.0, 5.0))]).unwrap();
        for share in [0.0, 0.25, 0.5, 0.8, 1.0] {
            let expected = at(0.25 * share, 1.0 + 2.0 * share, -3.0 + 8.0 * share);
            assert!(near(&moving.at(share), &expected, 2e-6), "{share}: {} {expected}", moving.at(share));
        }
        assert_eq!((moving.at(-1.0), moving.at(2.0)), (at(0.0, 1.0, -3.0), at(0.25, 3.0, 5.0)));
    }

    #[test]
    fn keys_that_cannot_be_followed_are_refused() {
        let still = Affine3A::IDENTITY;
        let mirrored = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        assert!(MovingTransform::new(&[]).is_none());
        assert!(MovingTransform::new(&[(1.0, still), (0.0, still)]).is_none());
        assert!(MovingTransform::new(&[(0.0, still), (0.0, still)]).is_none());
        assert!(MovingTransform::new(&[(f32::NAN, still)]).is_none());
        assert!(MovingTransform::new(&[(0.0, Affine3A::from_mat3(Mat3::ZERO))]).is_none());
        assert!(MovingTransform::new(&[(0.0, still), (1.0, mirrored)]).is_none());
        let both = MovingTransform::new(&[(0.0, mirrored), (1.0, mirrored * Affine3A::from_rotation_x(1.0))]).unwrap();
        let middle = mirrored * Affine3A::from_rotation_x(0.5);
        assert!(near(&both.at(0.5), &middle, 1e-6), "{} {middle}", both.at(0.5));
    }

    #[test]
    fn the_boxes_of_a_path_contain_every_point_of_it() {
        let mut random = SplitMix64::new(5);
        let mut number = |size: f32| size * (2.0 * random.unit_f32() - 1.0);
        for _ in 0..60 {
            let mut key = |time: f32| {
                let axis = Vec3::new(number(1.0), number(1.0), number(1.0) + 1.5).normalize();
                let scale = Vec3::new(1.2, 1.2, 1.2) + Vec3::new(number(1.0), number(1.0), number(1.0));
                let turn = Quat::from_axis_angle(axis, number(3.0));
                (time, Affine3A::from_scale_rotation_translation(scale, turn, axis * number(4.0)))
            };
            let moving = MovingTransform::new(&[key(-0.3), key(0.4), key(0.9)]).unwrap();
            let object = Aabb { min: Vec3::new(-1.0, 0.5, -3.0), max: Vec3::new(2.0, 0.75, -2.0) };
            let path = moving.path(&object);
            assert_eq!((path[0].0, path[path.len() - 1].0), (0.0, 1.0));
            let times: Vec<f32> = path.iter().map(|step| step.0).collect();
            for i in 0..=200 {
                let time = i as f32 / 200.0;
                let KeySpan { key, share } = KeySpan::find(&times, time);
                let (a, b) = (path[key].1, path[key + 1].1);
                let (min, max) = (a.min.lerp(b.min, share), a.max.lerp(b.max, share));
                for corner in 0..8 {
                    let pick = |axis: usize| if corner >> axis & 1 == 1 { object.max[axis] } else { object.min[axis] };
                    let p = moving.at(time).transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
                    assert!(p.cmpge(min - 1e-6).all() && p.cmple(max + 1e-6).all(), "{time}: {p} {min} {max}");
                }
            }
        }
    }

    #[test]
    fn a_time_is_found_between_its_keys() {
        let times = [0.0, 0.25, 1.0];
        for (time, key, share) in [
            (-1.0, 0, 0.0),
            (0.0, 0, 0.0),
            (0.125, 0, 0.5),
            (0.25, 1, 0.0),
            (0.625, 1, 0.5),
            (1.0, 1, 1.0),
            (7.0, 1, 1.0),
        ] {
            assert_eq!(KeySpan::find(&times, time), KeySpan { key, share }, "{time}");
        }
        assert_eq!(KeySpan::find(&times, f32::NAN).share, 0.0);
    }
}
