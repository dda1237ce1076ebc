//! What is computed once a ray: scales and shifts of the slab tests, and the shear of the triangle test.

use super::lanes::{Lanes, splat3};
use super::triangle;
use crate::tree::{TriangleBlock, WIDTH};

/// A ray prepared for traversal.
///
/// A plane at `b` on an axis is crossed at `b · scale + shift`, in one fused operation. For origin `o` and direction
/// `d` that should be `(b − o) / d`. Error bound, with ε = 2⁻²⁴: the inverse of `d`, its product with 1 ± k and the
/// fused operation each err by a factor 1 ± ε; the triangle test rounds `p − o` and its shear, three more. A k of
/// 16 ε covers these six. What is left, the product `o · scale` and its sum, err by at most |o · scale| · 2 ε; `shift`
/// is moved outward by 8 ε of it. Parameters are never negative where it matters (`t_min ≥ 0`), so a factor below 1 moves a near
/// plane towards the viewer and a factor above 1 a far plane away.
pub(crate) struct Setup {
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    near_scale: [f32; 3],
    near_shift: [f32; 3],
    far_scale: [f32; 3],
    far_shift: [f32; 3],
    /// Bit `axis` is set where the direction is negative.
    pub(crate) octant: usize,
    /// Axes in the space of the triangle test; the last is the one with the largest direction.
    pub(crate) axes: [usize; 3],
    /// Direction along the first two of `axes`, divided by that along the last, and the inverse of the last.
    pub(crate) shear: [f32; 3],
}

impl Setup {
    /// `None` for a ray that hits nothing: with NaN, infinity, or no direction.
    #[inline(always)]
    pub(crate) fn new<const ROBUST: bool>(origin: [f32; 3], direction: [f32; 3]) -> Option<Self> {
        const EPSILON: f32 = f32::EPSILON / 2.0;
        let (near_factor, far_factor) = if ROBUST { (1.0 - 16.0 * EPSILON, 1.0 + 16.0 * EPSILON) } else { (1.0, 1.0) };
        let size = direction.map(f32::abs);
        let z = if size[0] > size[1] {
            if size[0] > size[2] { 0 } else { 2 }
        } else if size[1] > size[2] {
            1
        } else {
            2
        };
        // A component this small moves nothing within the range of a float. Division by it would overflow.
        let smallest = size[z] * 1e-24;
        let finite = origin.iter().chain(&direction).fold(0.0, |sum, x| sum + x * 0.0) == 0.0;
        if !(finite && smallest > 0.0) {
            return None;
        }
        let mut setup = Self {
            origin,
            direction,
            near_scale: [0.0; 3],
            near_shift: [0.0; 3],
            far_scale: [0.0; 3],
            far_shift: [0.0; 3],
            octant: 0,
            axes: [(z + 1) % 3, (z + 2) % 3, z],
            shear: [0.0; 3],
        };
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            let inverse = 1.0 / if size[axis] < smallest { smallest.copysign(d) } else { d };
            setup.octant |= (d.is_sign_negative() as usize) << axis;
            let (near, far) = (inverse * near_factor, inverse * far_factor);
            // Beside the relative slack a tiny absolute one, for planes that pass through the very origin.
            let slack = if ROBUST { (o.abs() * (8.0 * EPSILON) + size[z] * 1e-20) * inverse.abs() } else { 0.0 };
            (setup.near_scale[axis], setup.far_scale[axis]) = (near, far);
            (setup.near_shift[axis], setup.far_shift[axis]) = (-(o * near) - slack, slack - o * far);
        }
        let [x, y, z] = setup.axes;
        let inverse = 1.0 / direction[z];
        setup.shear = [direction[x] * inverse, direction[y] * inverse, inverse];
        Some(setup)
    }

    /// Origin and direction under an affine map given by rows.
    #[inline(always)]
    pub(crate) fn transformed(&self, m: &[[f32; 4]; 3]) -> ([f32; 3], [f32; 3]) {
        let ([ox, oy, oz], [dx, dy, dz]) = (self.origin, self.direction);
        (m.map(|r| r[0] * ox + r[1] * oy + r[2] * oz + r[3]), m.map(|r| r[0] * dx + r[1] * dy + r[2] * dz))
    }
}

/// The same, spread over lanes.
pub(crate) struct Wide<S: Lanes, const ROBUST: bool> {
    near_scale: [S::F; 3],
    near_shift: [S::F; 3],
    far_scale: [S::F; 3],
    far_shift: [S::F; 3],
    floor: S::F,
    /// 1 on axes where the direction is negative.
    side: [usize; 3],
    triangle: triangle::WideRay<S>,
}

impl<S: Lanes, const ROBUST: bool> Wide<S, ROBUST> {
    #[inline(always)]
    pub(crate) fn new(s: S, setup: &Setup, floor: f32) -> Self {
        Self {
            near_scale: splat3(s, setup.near_scale),
            near_shift: splat3(s, setup.near_shift),
            far_scale: splat3(s, setup.far_scale),
            far_shift: splat3(s, setup.far_shift),
            floor: s.splat(floor),
            side: [setup.octant & 1, setup.octant >> 1 & 1, setup.octant >> 2 & 1],
            triangle: triangle::WideRay::new::<ROBUST>(s, setup),
        }
    }

    /// Where the ray enters each of eight boxes, not before the floor, and which it meets up to `t_max`.
    /// A slab that is NaN (beyond the range of numbers) does not exclude a box.
    #[inline(always)]
    pub(crate) fn boxes(&self, s: S, planes: &[[f32; WIDTH]; 6], t_max: f32) -> (S::F, S::Mask) {
        let (mut near, mut far) = (self.floor, s.splat(t_max));
        for axis in 0..3 {
            let side = self.side[axis] & 1;
            let (low, high) = (s.load(&planes[2 * axis + side]), s.load(&planes[2 * axis + (side ^ 1)]));
            let (far_scale, far_shift) = if ROBUST {
                (self.far_scale[axis], self.far_shift[axis])
            } else {
                (self.near_scale[axis], self.near_shift[axis])
            };
            near = s.max(s.mul_add(low, self.near_scale[axis], self.near_shift[axis]), near);
            far = s.min(s.mul_add(high, far_scale, far_shift), far);
        }
        (near, s.le(near, far))
    }

    /// See [`triangle::WideRay`].
    #[inline(always)]
    pub(crate) fn triangles(&self, s: S, block: &TriangleBlock) -> Option<(S::F, S::Mask)> {
        if ROBUST { self.triangle.watertight(s, block) } else { self.triangle.moeller_trumbore(s, block) }
    }
}
