//! The moving geometry of a tree.
//!
//! A mesh with moving vertices has a tree for each key: the first one as the build emits it, the others as copies of it
//! at a fixed distance in the arena, with the boxes and corners of their keys. A ray interpolates linearly between the two
//! trees around its time. All do that by the same monotone operation, so an interpolated box contains the interpolated
//! boxes and corners below it, to the last bit.

use crate::instance::Affine;
use crate::motion::{KeySpan, MovingTransform, SphereKeyGeometry};
use crate::{Aabb, Ray, SphereGeometry};

/// The moving parts of a scene's trees.
#[derive(Debug, Default)]
pub(crate) struct TreeMotion {
    /// Motion of placed trees, which refer to it by [`PlacedTree::motion`](crate::tree::PlacedTree::motion).
    pub(crate) placements: Vec<PlacedMotion>,
    /// Moving spheres: index, and spheres at the times of their keys; ascending by the index.
    pub(crate) spheres: Vec<(u32, SphereMotion)>,
}

/// The motion of an instance, of its mesh's vertices, or of both.
#[derive(Debug)]
pub(crate) struct PlacedMotion {
    /// The transformation to world space; `None`: it stands still.
    pub(crate) transform: Option<MovingTransform>,
    /// Times of boxes around the instance in world space, from 0 to 1.
    pub(crate) times: Box<[f32]>,
    /// The boxes; between two times they are interpolated linearly.
    pub(crate) boxes: Box<[Aabb]>,
    /// Trees of the mesh's keys; `None`: its vertices stand still.
    pub(crate) keys: Option<KeyTrees>,
}

/// The trees of a mesh's keys.
#[derive(Clone, Debug)]
pub(crate) struct KeyTrees {
    pub(crate) times: Box<[f32]>,
    /// Distance from the tree of a key to that of the next one, in cache lines.
    pub(crate) stride: usize,
}

/// The trees of a mesh whose vertices move: the root of the first one, and the box around all keys.
#[derive(Clone)]
pub(crate) struct MovingMesh<C> {
    pub(crate) root: C,
    pub(crate) bounds: Aabb,
    pub(crate) keys: KeyTrees,
}

/// The keys of a moving sphere.
#[derive(Clone, Debug)]
pub(crate) struct SphereMotion {
    pub(crate) times: Box<[f32]>,
    pub(crate) spheres: Box<[SphereGeometry]>,
}

/// A time between two trees of keys.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KeyPose {
    /// Cache lines from a node of the first key to that of the key before.
    pub(crate) offset: usize,
    /// Cache lines from there to the key after.
    pub(crate) stride: usize,
    /// Share of the way between both.
    pub(crate) share: f32,
}

impl KeyPose {
    /// The pose of a tree without keys.
    pub(crate) const NONE: Self = Self { offset: 0, stride: 0, share: 0.0 };
}

impl KeyTrees {
    /// Returns the place of a time between the trees.
    pub(crate) fn at(&self, time: f32) -> KeyPose {
        let KeySpan { key, share } = KeySpan::find(&self.times, time);
        KeyPose { offset: key * self.stride, stride: self.stride, share }
    }
}

impl SphereMotion {
    /// Collects the keys of a sphere.
    pub(crate) fn new(keys: &[SphereKeyGeometry]) -> Self {
        Self { times: keys.iter().map(|key| key.time).collect(), spheres: keys.iter().map(|key| key.sphere).collect() }
    }

    /// Returns the sphere at a time.
    fn at(&self, time: f32) -> SphereGeometry {
        let KeySpan { key, share } = KeySpan::find(&self.times, time);
        let (from, to) = (&self.spheres[key], &self.spheres[key + 1]);
        let rest = 1.0 - share;
        SphereGeometry {
            center: from.center * rest + to.center * share,
            radius: from.radius * rest + to.radius * share,
        }
    }
}

impl TreeMotion {
    /// Returns a sphere at a time, if it moves.
    #[inline]
    pub(crate) fn sphere(&self, index: usize, time: f32) -> Option<SphereGeometry> {
        if self.spheres.is_empty() {
            return None;
        }
        let place = self.spheres.binary_search_by_key(&(index as u32), |sphere| sphere.0).ok()?;
        Some(self.spheres[place].1.at(time))
    }

    /// Returns true if nothing moves.
    pub(crate) fn is_empty(&self) -> bool {
        self.placements.is_empty() && self.spheres.is_empty()
    }

    /// Returns the memory of the motion, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let placement = |motion: &PlacedMotion| {
            size_of::<PlacedMotion>() + size_of_val(&*motion.times) + size_of_val(&*motion.boxes)
        };
        let sphere = |(_, motion): &(u32, SphereMotion)| size_of_val(&*motion.times) + size_of_val(&*motion.spheres);
        self.placements.iter().map(placement).sum::<usize>() + self.spheres.iter().map(sphere).sum::<usize>()
    }
}

impl PlacedMotion {
    /// Returns the map from world space to object space at a time. `None`: the ray passes the instance, or the instance
    /// is flat then.
    ///
    /// - `still`: the map if the instance itself stands still.
    pub(crate) fn object_from_world(&self, still: &[[f32; 4]; 3], ray: &Ray, time: f32) -> Option<[[f32; 4]; 3]> {
        let Some(transform) = &self.transform else { return Some(*still) };
        if self.is_passed(ray, time) {
            return None;
        }
        Affine::new(&transform.at(time)).inverse().map(|inverse| inverse.rows)
    }

    /// Returns true if a ray, continued in both directions, misses the box of the instance at a time. Computed in double
    /// precision, with room for the errors of a hit test.
    fn is_passed(&self, ray: &Ray, time: f32) -> bool {
        let KeySpan { key, share } = KeySpan::find(&self.times, time);
        let (from, to) = (&self.boxes[key], &self.boxes[key + 1]);
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let mix = |a: f32, b: f32| f64::from(a) + (f64::from(b) - f64::from(a)) * f64::from(share);
            let (low, high) = (mix(from.min[axis], to.min[axis]), mix(from.max[axis], to.max[axis]));
            let (origin, direction) = (f64::from(ray.origin[axis]), f64::from(ray.direction[axis]));
            let room = (origin.abs() + low.abs().max(high.abs())) * (16.0 * f64::from(f32::EPSILON));
            let (low, high) = (low - room - origin, high + room - origin);
            if direction == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return true;
                }
                continue;
            }
            let (a, b) = (low / direction, high / direction);
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter > leave || leave < 0.0
    }
}
