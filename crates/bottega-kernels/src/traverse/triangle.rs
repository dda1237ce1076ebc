//! The intersection of a ray and eight triangles.

use super::lanes::{LaneRow, Lanes, cross, dot};
use crate::Ray;
use crate::tree::{TriangleBlock, WIDTH};

/// A ray in lanes, prepared for one of the tests.
///
/// Both tests compare numerators, multiplied by the sign of the determinant, and divide last, for the few blocks that
/// pass. The first check of the parameter is slightly generous, the second exact.
pub(crate) struct WideRay<S: Lanes> {
    axes: [LaneRow<3>; 3],
    /// Origin. Robust: along `axes`. Fast: along x, y, z.
    origin: [S::F; 3],
    /// Robust: shear in x and y, inverse direction in z. Fast: direction.
    direction: [S::F; 3],
    t_min: S::F,
    /// Slightly less than `t_min`.
    early: S::F,
}

/// The hits of a block.
pub(crate) struct BlockHits<S: Lanes> {
    /// Parameters; meaningless in lanes without a hit.
    pub(crate) t: S::F,
    /// Barycentric coordinates of vertices 1 and 2 times `det`.
    pub(crate) u: S::F,
    pub(crate) v: S::F,
    /// Determinant that divides `u` and `v`.
    pub(crate) det: S::F,
    /// One bit per lane, set for a hit.
    pub(crate) bits: u32,
}

const LESS: f32 = 1.0 - 8.0 * f32::EPSILON;
const MORE: f32 = 1.0 + 8.0 * f32::EPSILON;

impl<S: Lanes> WideRay<S> {
    /// Prepares for [`WideRay::test_sheared`]: along the axis with the largest direction component.
    #[inline(always)]
    pub(crate) fn watertight(s: S, ray: &Ray, t_min: f32) -> Self {
        let (origin, direction): (&[f32; 3], &[f32; 3]) = (ray.origin.as_ref(), ray.direction.as_ref());
        let size = direction.map(|d| d.to_bits() << 1);
        let (larger, axis) = if size[1] >= size[0] { (size[1], 1) } else { (size[0], 0) };
        let z = if size[2] >= larger { 2 } else { axis };
        let next = |axis: usize| if axis == 2 { 0 } else { axis + 1 };
        let (x, y) = (next(z), next(next(z)));
        let inverse = s.div(s.splat(1.0), s.splat_at(&direction[z]));
        Self {
            axes: [LaneRow::new(x), LaneRow::new(y), LaneRow::new(z)],
            origin: [s.splat_at(&origin[x]), s.splat_at(&origin[y]), s.splat_at(&origin[z])],
            direction: [s.mul(s.splat_at(&direction[x]), inverse), s.mul(s.splat_at(&direction[y]), inverse), inverse],
            t_min: s.splat(t_min),
            early: s.splat(t_min * LESS),
        }
    }

    /// Prepares for [`WideRay::test_edges`].
    #[inline(always)]
    pub(crate) fn moeller_trumbore(s: S, origin: [S::F; 3], direction: [S::F; 3], t_min: f32) -> Self {
        let axes = [LaneRow::new(0), LaneRow::new(1), LaneRow::new(2)];
        Self { axes, origin, direction, t_min: s.splat(t_min), early: s.splat(t_min * LESS) }
    }

    /// Tests watertightly; see the head of the parent module. `None`: no hit.
    #[inline(always)]
    pub(crate) fn test_sheared(&self, s: S, block: &TriangleBlock, t_max: S::F) -> Option<BlockHits<S>> {
        // Shear the vertices
        let (ax, ay, az) = self.sheared(s, &block.p[0]);
        let (bx, by, bz) = self.sheared(s, &block.p[1]);
        let (cx, cy, cz) = self.sheared(s, &block.p[2]);
        // Round each product separately, so that the neighbor gets exactly the negative.
        let u = s.sub(s.mul(cx, by), s.mul(cy, bx));
        let v = s.sub(s.mul(ax, cy), s.mul(ay, cx));
        let w = s.sub(s.mul(bx, ay), s.mul(by, ax));
        // If all three have the same sign, so does the sum.
        let det = s.add(s.add(u, v), w);
        let sign = s.sign(det);
        let (turned_v, turned_w) = (s.turn(v, sign), s.turn(w, sign));
        let least = s.min(s.min(s.turn(u, sign), turned_v), turned_w);
        // Inside if all edge functions have the sign of the determinant
        let inside = s.le(s.splat(0.0), least);
        // Compute the scaled distance
        let distance = s.mul_add(u, az, s.mul_add(v, bz, s.mul(w, cz)));
        let distance = s.turn(s.mul(distance, self.direction[2]), sign);
        self.parameter(s, inside, distance, [turned_v, turned_w, s.turn(det, sign)], t_max)
    }

    /// Returns a vertex in the space where the ray starts at the origin and runs along z.
    #[inline(always)]
    fn sheared(&self, s: S, p: &[[f32; WIDTH]; 3]) -> (S::F, S::F, S::F) {
        let [kx, ky, kz] = self.axes;
        let z = s.sub(s.load_row(p, kz), self.origin[2]);
        let x = s.neg_mul_add(self.direction[0], z, s.sub(s.load_row(p, kx), self.origin[0]));
        let y = s.neg_mul_add(self.direction[1], z, s.sub(s.load_row(p, ky), self.origin[1]));
        (x, y, z)
    }

    /// Tests by Möller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection"; not watertight.
    #[inline(always)]
    pub(crate) fn test_edges(&self, s: S, block: &TriangleBlock, t_max: S::F) -> Option<BlockHits<S>> {
        let (p0, e1, e2) = (load3(s, &block.p[0]), load3(s, &block.p[1]), load3(s, &block.p[2]));
        let from_p0 = [s.sub(self.origin[0], p0[0]), s.sub(self.origin[1], p0[1]), s.sub(self.origin[2], p0[2])];
        let h = cross(s, &self.direction, &e2);
        let q = cross(s, &from_p0, &e1);
        let det = dot(s, &e1, &h);
        let sign = s.sign(det);
        let u = s.turn(dot(s, &from_p0, &h), sign);
        let v = s.turn(dot(s, &self.direction, &q), sign);
        let det = s.turn(det, sign);
        // NaN in one of them makes the sum NaN.
        let inside = s.and(s.le(s.splat(0.0), s.min(u, v)), s.le(s.add(u, v), det));
        self.parameter(s, inside, s.turn(dot(s, &e2, &q), sign), [u, v, det], t_max)
    }

    /// Computes the parameter `distance / det`, where `det` is not negative. A `det` of 0 is a miss.
    #[inline(always)]
    fn parameter(
        &self,
        s: S,
        inside: S::Mask,
        distance: S::F,
        [u, v, det]: [S::F; 3],
        t_max: S::F,
    ) -> Option<BlockHits<S>> {
        // An infinite `t_max` times a `det` of 0 is NaN, which is also a miss.
        let early = s.le(distance, s.mul(det, s.mul(t_max, s.splat(MORE))));
        let late = s.lt(s.mul(det, self.early), distance);
        let valid = s.and(inside, s.and(early, late));
        if s.bits(valid) == 0 {
            return None;
        }
        let t = s.div(distance, det);
        let valid = s.and(valid, s.and(s.lt(self.t_min, t), s.le(t, t_max)));
        Some(BlockHits { t, u, v, det, bits: s.bits(valid) }).filter(|struck| struck.bits != 0)
    }
}

#[inline(always)]
fn load3<S: Lanes>(s: S, p: &[[f32; WIDTH]; 3]) -> [S::F; 3] {
    [s.load(&p[0]), s.load(&p[1]), s.load(&p[2])]
}
