//! What is computed once a ray: scales and shifts of the slab tests, and the shear of the triangle test.

use super::lanes::{Lanes, Row, splat3};
use super::triangle::WideRay;
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
    /// For each axis scale and shift of near planes, then of far planes; all finite, and no scale is 0, so that no crossing is
    /// NaN, not even of a plane at infinity.
    slabs: [[f32; 4]; 3],
    /// Bit `axis` is set where the direction is negative.
    pub(crate) octant: usize,
    /// Axes in the space of the robust triangle test; the last is the one with the largest direction.
    pub(crate) axes: [usize; 3],
    /// Direction along the first two of `axes`, divided by that along the last, and the inverse of the last.
    pub(crate) shear: [f32; 3],
}

impl Setup {
    /// `None` for a ray that hits nothing: with NaN, infinity, or no direction.
    #[inline(always)]
    pub(crate) fn new<const ROBUST: bool>(origin: [f32; 3], direction: [f32; 3]) -> Option<Self> {
        const EPSILON: f32 = f32::EPSILON / 2.0;
        const NEAR: f32 = 1.0 - 16.0 * EPSILON;
        const FAR: f32 = 1.0 + 16.0 * EPSILON;
        // Every axis is free: crossed by each plane before and after everything.
        const FREE: [f32; 4] = [f32::MIN_POSITIVE, f32::MIN, f32::MIN_POSITIVE, f32::MAX];
        let size = direction.map(f32::abs);
        let larger = usize::from(size[1] >= size[0]);
        let z = if size[2] >= size[larger] { 2 } else { larger };
        let largest = if size[2] >= size[larger] { size[2] } else { size[larger] };
        // A component this small moves nothing within the range of a float. Division by it would overflow.
        let smallest = largest * 1e-24;
        let [ox, oy, oz] = origin.map(|x| x * 0.0);
        let [dx, dy, dz] = direction.map(|x| x * 0.0);
        let finite = (ox + oy) + (oz + dx) + (dy + dz) == 0.0;
        if !(finite && smallest > 0.0) {
            return None;
        }
        let mut slabs = [FREE; 3];
        let mut octant = 0;
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            let inverse = 1.0 / if size[axis] < smallest { smallest.copysign(d) } else { d };
            octant |= (d.is_sign_negative() as usize) << axis;
            let slab = if ROBUST {
                let (near, far) = (inverse * NEAR, inverse * FAR);
                // Beside the relative slack a tiny absolute one, for planes that pass through the very origin.
                let slack = (o.abs() * (8.0 * EPSILON) + largest * 1e-20) * inverse.abs();
                [near, -(o * near) - slack, far, slack - o * far]
            } else {
                [inverse, -(o * inverse), inverse, -(o * inverse)]
            };
            if (slab[1] * 0.0 + slab[2] * 0.0) + slab[3] * 0.0 == 0.0 {
                slabs[axis] = slab;
            }
        }
        let mut setup = Self { origin, direction, slabs, octant, axes: [1, 2, 0], shear: [0.0; 3] };
        if ROBUST {
            setup.axes = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][z];
            let [x, y, z] = setup.axes;
            let inverse = 1.0 / direction[z];
            setup.shear = [direction[x] * inverse, direction[y] * inverse, inverse];
        }
        Some(setup)
    }

    /// Origin and direction under an affine map given by rows.
    #[inline(always)]
    pub(crate) fn transformed(&self, m: &[[f32; 4]; 3]) -> ([f32; 3], [f32; 3]) {
        let ([ox, oy, oz], [dx, dy, dz]) = (self.origin, self.direction);
        (m.map(|r| r[0] * ox + r[1] * oy + r[2] * oz + r[3]), m.map(|r| r[0] * dx + r[1] * dy + r[2] * dz))
    }
}

/// The planes of a node.
pub(crate) type Planes = [[f32; WIDTH]; 6];

/// The same, spread over lanes.
pub(crate) struct Wide<S: Lanes, const ROBUST: bool> {
    near_scale: [S::F; 3],
    near_shift: [S::F; 3],
    far_scale: [S::F; 3],
    far_shift: [S::F; 3],
    floor: S::F,
    /// Which planes are near, and which are far, on each axis.
    near: [Row<6>; 3],
    far: [Row<6>; 3],
    triangle: WideRay<S>,
}

impl<S: Lanes, const ROBUST: bool> Wide<S, ROBUST> {
    #[inline(always)]
    pub(crate) fn new(s: S, setup: &Setup, floor: f32, t_min: f32) -> Self {
        let [x, y, z] = setup.slabs;
        let side = [setup.octant & 1, setup.octant >> 1 & 1, setup.octant >> 2 & 1];
        Self {
            near_scale: splat3(s, [x[0], y[0], z[0]]),
            near_shift: splat3(s, [x[1], y[1], z[1]]),
            far_scale: splat3(s, [x[2], y[2], z[2]]),
            far_shift: splat3(s, [x[3], y[3], z[3]]),
            floor: s.splat(floor),
            near: [Row::new(side[0]), Row::new(2 + side[1]), Row::new(4 + side[2])],
            far: [Row::new(1 - side[0]), Row::new(3 - side[1]), Row::new(5 - side[2])],
            triangle: WideRay::new::<ROBUST>(s, setup, t_min),
        }
    }

    /// Where the ray enters each of eight boxes, not before the floor, and which it does *not* meet up to `t_max`.
    ///
    /// Crossings are compared by their bits: no floor and no `t_max` is negative, and a box that is left at a negative
    /// parameter is missed whatever its order among negatives.
    #[inline(always)]
    pub(crate) fn boxes(&self, s: S, planes: &Planes, t_max: S::F) -> (S::F, S::Mask) {
        let (far_scale, far_shift) =
            if ROBUST { (&self.far_scale, &self.far_shift) } else { (&self.near_scale, &self.near_shift) };
        let near = |axis: usize| {
            s.mul_add(s.load_row(planes, self.near[axis]), self.near_scale[axis], self.near_shift[axis])
        };
        let far = |axis: usize| s.mul_add(s.load_row(planes, self.far[axis]), far_scale[axis], far_shift[axis]);
        let entry = s.max_bits(s.max_bits(near(0), near(1)), s.max_bits(near(2), self.floor));
        let exit = s.min_bits(s.min_bits(far(0), far(1)), s.min_bits(far(2), t_max));
        (entry, s.gt_bits(entry, exit))
    }

    /// See [`WideRay`].
    #[inline(always)]
    pub(crate) fn triangles(&self, s: S, block: &TriangleBlock, t_max: f32) -> Option<(S::F, u32)> {
        if ROBUST {
            self.triangle.watertight(s, block, t_max)
        } else {
            self.triangle.moeller_trumbore(s, block, t_max)
        }
    }
}
