//! Rays and hits: the input and output of a query.

use glam::Vec3;

/// A ray in world space: the points `origin + t · direction` with `t_min < t <= t_max`.
///
/// `t` is in lengths of `direction`, which need not be 1. A negative `t_min` counts as 0. A ray with a component that
/// is not finite, or with a zero direction, hits nothing.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Origin of the ray, at parameter 0.
    pub origin: Vec3,
    /// Hits at or before this parameter are ignored.
    pub t_min: f32,
    /// Direction, of any length but 0.
    pub direction: Vec3,
    /// Hits beyond this parameter are ignored; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// Returns the ray from `origin` along `direction` without end.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
    }

    /// Returns the point at parameter `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// An intersection of a ray and a surface. On a triangle it is at `(1 − u − v) p0 + u p1 + v p2`; on a sphere `u` and
/// `v` are 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Parameter along the ray; infinite if nothing was hit.
    pub t: f32,
    /// Barycentric coordinate of the triangle's second vertex.
    pub u: f32,
    /// Barycentric coordinate of the triangle's third vertex.
    pub v: f32,
    /// Index of the instance, or [`Hit::SPHERE`] | index of the sphere, or `u32::MAX` if nothing was hit.
    pub instance: u32,
    /// Index of the triangle in the instance's mesh; 0 for a sphere.
    pub primitive: u32,
}

impl Hit {
    /// The result of a ray that hits nothing: `t` is infinite.
    pub const NONE: Self = Self { t: f32::INFINITY, u: 0.0, v: 0.0, instance: u32::MAX, primitive: u32::MAX };
    /// The bit of `instance` that marks a sphere.
    pub const SPHERE: u32 = 1 << 31;

    /// Returns true if something was hit.
    #[inline]
    pub fn is_some(&self) -> bool {
        self.instance != u32::MAX
    }

    /// Returns true if nothing was hit.
    #[inline]
    pub fn is_none(&self) -> bool {
        self.instance == u32::MAX
    }

    /// Returns the index of the sphere that was hit; `None` if it was not a sphere.
    #[inline]
    pub fn sphere(&self) -> Option<u32> {
        (self.is_some() && self.instance & Self::SPHERE != 0).then_some(self.instance & !Self::SPHERE)
    }
}

impl Default for Hit {
    fn default() -> Self {
        Self::NONE
    }
}

/// An axis-aligned box, given by two corners; empty if a coordinate of `min` exceeds that of `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least coordinates of the box.
    pub min: Vec3,
    /// Greatest coordinates of the box.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box; its union with a box is that box.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Returns true if the box contains no point.
    #[inline]
    pub fn is_empty(&self) -> bool {
        !(self.min.x <= self.max.x && self.min.y <= self.max.y && self.min.z <= self.max.z)
    }

    /// Returns the smallest box around both boxes.
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Returns the smallest box around the box and a point.
    #[inline]
    pub fn with(&self, p: Vec3) -> Self {
        Self { min: self.min.min(p), max: self.max.max(p) }
    }

    /// Returns half the surface area; 0 for the empty box.
    #[inline]
    pub fn half_area(&self) -> f32 {
        let d = (self.max - self.min).max(Vec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// Returns the center of the box.
    #[inline]
    pub fn center(&self) -> Vec3 {
        (self.min + self.max) * 0.5
    }

    /// Returns the box around a sphere.
    pub fn around(center: Vec3, radius: f32) -> Self {
        Self { min: center - Vec3::splat(radius), max: center + Vec3::splat(radius) }
    }
}
