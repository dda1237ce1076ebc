//! The setup of a ray: scales and shifts of the slab tests, and the shear of the triangle test.
//!
//! Everything is computed in lanes, each a broadcast of the ray's numbers: numbers assembled in memory and read back as
//! vectors cost a cheap ray a tenth of its time.

use super::lanes::{LaneRow, Lanes};
use super::triangle::{BlockHits, WideRay};
use crate::Ray;
use crate::tree::{TriangleBlock, WIDTH};

/// Scales and shifts of near and far planes by axis; all finite, and no scale is 0, so no crossing is NaN, not even of
/// a plane at infinity.
///
/// A plane at `b` on an axis is crossed at `b · scale + shift`, one fused operation, for `(b − o) / d` with origin `o`
/// and direction `d`. Error bound, with ε = 2⁻²⁴: the inverse of `d`, its product with 1 ± k and the fused operation
/// each err by a factor 1 ± ε; the triangle test rounds `p − o` and its shear, three more. A k of 16 ε covers these
/// six. The rest, the product `o · scale` and its sum, err by at most |o · scale| · 2 ε; `shift` is moved outward by 8
/// ε of it. Relevant parameters are never negative (`t_min ≥ 0`), so a factor below 1 moves a near plane towards the
/// viewer and a factor above 1 a far plane away.
struct Slabs<F> {
    near_scale: [F; 3],
    near_shift: [F; 3],
    far_scale: [F; 3],
    far_shift: [F; 3],
}

impl<F: Copy> Slabs<F> {
    /// Returns `None` for a ray that hits nothing: with NaN, infinity or no direction.
    #[inline(always)]
    fn new<S: Lanes<F = F>, const ROBUST: bool>(s: S, ray: &Ray, origin: &[F; 3], direction: &[F; 3]) -> Option<Self> {
        const EPSILON: f32 = f32::EPSILON / 2.0;
        const NEAR: f32 = 1.0 - 16.0 * EPSILON;
        const FAR: f32 = 1.0 + 16.0 * EPSILON;
        // Invert the direction
        let sign = [s.sign(direction[0]), s.sign(direction[1]), s.sign(direction[2])];
        let size = |axis: usize| s.turn(direction[axis], sign[axis]);
        let largest = s.max_bits(s.max_bits(size(0), size(1)), size(2));
        // Clamp tiny components, by which division overflows; they move nothing within the range of a float.
        let smallest = s.mul(largest, s.splat(1e-24));
        let one = s.splat(1.0);
        let inverse_size = |axis: usize| s.div(one, s.max_bits(size(axis), smallest));
        let inverse_size = [inverse_size(0), inverse_size(1), inverse_size(2)];
        let turned = |axis: usize| s.turn(inverse_size[axis], sign[axis]);
        let inverse = [turned(0), turned(1), turned(2)];
        let slabs = if ROBUST {
            // Beside the relative slack, add a tiny absolute one for planes through the origin itself.
            let least = s.mul(largest, s.splat(1e-20));
            let slack = |axis: usize| {
                let distance = s.turn(origin[axis], s.sign(origin[axis]));
                s.mul(s.mul_add(distance, s.splat(8.0 * EPSILON), least), inverse_size[axis])
            };
            let slack = [slack(0), slack(1), slack(2)];
            // Scale and shift near and far planes outward by the error bound
            let (near_factor, far_factor, minus) = (s.splat(NEAR), s.splat(FAR), s.splat(-0.0));
            let scaled = |factor: F| [s.mul(inverse[0], factor), s.mul(inverse[1], factor), s.mul(inverse[2], factor)];
            let (near_scale, far_scale) = (scaled(near_factor), scaled(far_factor));
            let near = |axis: usize| s.neg_mul_add(origin[axis], near_scale[axis], s.turn(slack[axis], minus));
            let far = |axis: usize| s.neg_mul_add(origin[axis], far_scale[axis], slack[axis]);
            Self { near_scale, near_shift: [near(0), near(1), near(2)], far_scale, far_shift: [far(0), far(1), far(2)] }
        } else {
            let zero = s.splat(0.0);
            let shift = |axis: usize| s.neg_mul_add(origin[axis], inverse[axis], zero);
            let shift = [shift(0), shift(1), shift(2)];
            Self { near_scale: inverse, near_shift: shift, far_scale: inverse, far_shift: shift }
        };
        // Multiply everything by 0, which gives 0 only for finite numbers.
        let zero = s.splat(0.0);
        let odd = |axis: usize| {
            let shifts = s.mul_add(slabs.near_shift[axis], zero, s.mul(slabs.far_shift[axis], zero));
            s.mul_add(direction[axis], zero, s.mul_add(inverse[axis], zero, shifts))
        };
        let even = s.le(s.add(s.add(odd(0), odd(1)), odd(2)), zero);
        if s.bits(s.and(even, s.lt(zero, smallest))) & 1 == 0 {
            let near_or_far = |shifts: &[F; 3], scales: &[F; 3]| {
                let first = |x: F| s.store(x)[0];
                (
                    [first(scales[0]), first(scales[1]), first(scales[2])],
                    [first(shifts[0]), first(shifts[1]), first(shifts[2])],
                )
            };
            let (near_scale, near_shift) = near_or_far(&slabs.near_shift, &slabs.near_scale);
            let (far_scale, far_shift) = near_or_far(&slabs.far_shift, &slabs.far_scale);
            let freed = Slabs { near_scale, near_shift, far_scale, far_shift }.freed(ray)?;
            return Some(Self {
                near_scale: s.splat3(&freed.near_scale),
                near_shift: s.splat3(&freed.near_shift),
                far_scale: s.splat3(&freed.far_scale),
                far_shift: s.splat3(&freed.far_shift),
            });
        }
        Some(slabs)
    }
}

impl Slabs<f32> {
    /// Disables axes whose crossings exceed the range of floats: they are crossed before and after everything. `None`:
    /// the ray itself is invalid.
    #[cold]
    #[inline(never)]
    fn freed(mut self, ray: &Ray) -> Option<Self> {
        let longer = ray.direction.to_array().iter().any(|d| d.abs() * 1e-24 > 0.0);
        for axis in 0..3 {
            let all = [self.near_scale[axis], self.near_shift[axis], self.far_scale[axis], self.far_shift[axis]];
            if !all.iter().all(|x| x.is_finite()) {
                (self.near_scale[axis], self.far_scale[axis]) = (f32::MIN_POSITIVE, f32::MIN_POSITIVE);
                (self.near_shift[axis], self.far_shift[axis]) = (f32::MIN, f32::MAX);
            }
        }
        (ray.origin.is_finite() && ray.direction.is_finite() && longer).then_some(self)
    }
}

/// The planes of a node, in the order of [`WideNode::planes`](crate::tree::WideNode::planes).
pub(crate) type Planes = [[f32; WIDTH]; 6];

/// A ray prepared for traversal, spread over lanes.
pub(crate) struct PreparedRay<S: Lanes, const ROBUST: bool> {
    slabs: Slabs<S::F>,
    floor: S::F,
    /// Rows of the near and far planes, on each axis.
    near: [LaneRow<6>; 3],
    far: [LaneRow<6>; 3],
    /// Bit `axis` is set if the direction is negative there.
    pub(crate) octant: usize,
    triangle: WideRay<S>,
}

impl<S: Lanes, const ROBUST: bool> PreparedRay<S, ROBUST> {
    /// Returns `None` for a ray that hits nothing: with NaN, infinity or no direction.
    #[inline(always)]
    pub(crate) fn new(s: S, ray: &Ray, floor: f32, t_min: f32) -> Option<Self> {
        let (origin, direction) = (s.splat3(ray.origin.as_ref()), s.splat3(ray.direction.as_ref()));
        let slabs = Slabs::new::<S, ROBUST>(s, ray, &origin, &direction)?;
        let side = |d: f32| (d.to_bits() >> 31) as usize;
        let side = [side(ray.direction.x), side(ray.direction.y), side(ray.direction.z)];
        let triangle = if ROBUST {
            WideRay::watertight(s, ray, t_min)
        } else {
            WideRay::moeller_trumbore(s, origin, direction, t_min)
        };
        Some(Self {
            slabs,
            floor: s.splat(floor),
            near: [LaneRow::new(side[0]), LaneRow::new(2 + side[1]), LaneRow::new(4 + side[2])],
            far: [LaneRow::new(1 - side[0]), LaneRow::new(3 - side[1]), LaneRow::new(5 - side[2])],
            octant: side[0] | side[1] << 1 | side[2] << 2,
            triangle,
        })
    }

    /// Returns where the ray enters each of eight boxes, at least the floor, and a mask of the boxes that it *misses*
    /// up to `t_max`.
    ///
    /// Crossings are compared by their bits: floor and `t_max` are not negative, and a box with a negative exit is
    /// missed for any order of negatives.
    #[inline(always)]
    pub(crate) fn boxes(&self, s: S, planes: &Planes, t_max: S::F) -> (S::F, S::Mask) {
        let Slabs { near_scale, near_shift, far_scale, far_shift } = &self.slabs;
        let far_scale = if ROBUST { far_scale } else { near_scale };
        let near = |axis: usize| s.mul_add(s.load_row(planes, self.near[axis]), near_scale[axis], near_shift[axis]);
        let far = |axis: usize| s.mul_add(s.load_row(planes, self.far[axis]), far_scale[axis], far_shift[axis]);
        let entry = s.max_bits(s.max_bits(near(0), near(1)), s.max_bits(near(2), self.floor));
        let exit = s.min_bits(s.min_bits(far(0), far(1)), s.min_bits(far(2), t_max));
        (entry, s.gt_bits(entry, exit))
    }

    /// Tests a block of triangles; see [`WideRay`].
    #[inline(always)]
    pub(crate) fn triangles(&self, s: S, block: &TriangleBlock, t_max: S::F) -> Option<BlockHits<S>> {
        if ROBUST { self.triangle.test_sheared(s, block, t_max) } else { self.triangle.test_edges(s, block, t_max) }
    }
}
