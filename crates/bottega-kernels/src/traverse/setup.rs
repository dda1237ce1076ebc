//! What is computed once a ray: scales and shifts of the slab tests, and the shear of the triangle test.

use super::lanes::{Lanes, Row, splat3};
use super::triangle::WideRay;
use crate::tree::{TriangleBlock, WIDTH};

/// Scales and shifts of near and far planes by axis; all finite, and no scale is 0, so that no crossing is NaN, not even of a
/// plane at infinity. (Not an array an axis: processors are slow to read as one what was just written as two.)
#[derive(Clone, Copy)]
struct Slabs {
    near_scale: [f32; 3],
    near_shift: [f32; 3],
    far_scale: [f32; 3],
    far_shift: [f32; 3],
}

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
    slabs: Slabs,
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
        let size = direction.map(f32::abs);
        let larger = usize::from(size[1] >= size[0]);
        let z = if size[2] >= size[larger] { 2 } else { larger };
        let greater = |a: f32, b: f32| if a > b { a } else { b };
        let largest = greater(greater(size[0], size[1]), size[2]);
        // A component this small moves nothing within the range of a float. Division by it would overflow.
        let smallest = largest * 1e-24;
        let inverse = |axis: usize| 1.0 / greater(size[axis], smallest).copysign(direction[axis]);
        let inverse = [inverse(0), inverse(1), inverse(2)];
        let (near_factor, far_factor) = if ROBUST { (NEAR, FAR) } else { (1.0, 1.0) };
        let scaled = |factor: f32| [inverse[0] * factor, inverse[1] * factor, inverse[2] * factor];
        let (near_scale, far_scale) = (scaled(near_factor), scaled(far_factor));
        // Beside the relative slack a tiny absolute one, for planes that pass through the very origin.
        let slack = |axis: usize| {
            if ROBUST { (origin[axis].abs() * (8.0 * EPSILON) + largest * 1e-20) * inverse[axis].abs() } else { 0.0 }
        };
        let near = |axis: usize| -(origin[axis] * near_scale[axis]) - slack(axis);
        let far = |axis: usize| slack(axis) - origin[axis] * far_scale[axis];
        let near_shift = [near(0), near(1), near(2)];
        let far_shift = if ROBUST { [far(0), far(1), far(2)] } else { near_shift };
        let mut slabs = Slabs { near_scale, near_shift, far_scale, far_shift };
        let bit = |axis: usize| (direction[axis].to_bits() >> 31 << axis) as usize;
        let octant = bit(0) | bit(1) | bit(2);
        // Everything times 0: not 0 where something is infinite or no number.
        let odd = |axis: usize| {
            (near_shift[axis] * 0.0 + far_shift[axis] * 0.0) + (direction[axis] * 0.0 + inverse[axis] * 0.0)
        };
        if odd(0) + odd(1) + odd(2) != 0.0 || smallest == 0.0 {
            slabs = free_slabs(origin, direction, &slabs)?;
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

/// Lets go of axes whose crossings leave the range of numbers: crossed by each plane before and after everything. `None`: the ray
/// itself is at fault.
#[cold]
#[inline(never)]
fn free_slabs(origin: [f32; 3], direction: [f32; 3], slabs: &Slabs) -> Option<Slabs> {
    let finite = origin.iter().chain(&direction).all(|x| x.is_finite());
    let longer = direction.iter().any(|d| d.abs() * 1e-24 > 0.0);
    let mut slabs = *slabs;
    for axis in 0..3 {
        let all = [slabs.near_scale[axis], slabs.near_shift[axis], slabs.far_scale[axis], slabs.far_shift[axis]];
        if !all.iter().all(|x| x.is_finite()) {
            (slabs.near_scale[axis], slabs.far_scale[axis]) = (f32::MIN_POSITIVE, f32::MIN_POSITIVE);
            (slabs.near_shift[axis], slabs.far_shift[axis]) = (f32::MIN, f32::MAX);
        }
    }
    (finite && longer).then_some(slabs)
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
        let Slabs { near_scale, near_shift, far_scale, far_shift } = setup.slabs;
        let side = [setup.octant & 1, setup.octant >> 1 & 1, setup.octant >> 2 & 1];
        Self {
            near_scale: splat3(s, near_scale),
            near_shift: splat3(s, near_shift),
            far_scale: splat3(s, far_scale),
            far_shift: splat3(s, far_shift),
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
        let far_scale = if ROBUST { &self.far_scale } else { &self.near_scale };
        let far_shift = &self.far_shift;
        let near =
            |axis: usize| s.mul_add(s.load_row(planes, self.near[axis]), self.near_scale[axis], self.near_shift[axis]);
        let far = |axis: usize| s.mul_add(s.load_row(planes, self.far[axis]), far_scale[axis], far_shift[axis]);
        let entry = s.max_bits(s.max_bits(near(0), near(1)), s.max_bits(near(2), self.floor));
        let exit = s.min_bits(s.min_bits(far(0), far(1)), s.min_bits(far(2), t_max));
        (entry, s.gt_bits(entry, exit))
    }

    /// See [`WideRay`].
    #[inline(always)]
    pub(crate) fn triangles(&self, s: S, block: &TriangleBlock, t_max: f32) -> Option<(S::F, u32)> {
        if ROBUST { self.triangle.watertight(s, block, t_max) } else { self.triangle.moeller_trumbore(s, block, t_max) }
    }
}
