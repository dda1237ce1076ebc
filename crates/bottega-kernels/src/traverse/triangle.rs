//! Eight triangles against a ray.

use super::lanes::{Lanes, Row, cross, dot, splat3};
use super::setup::Setup;
use crate::tree::{TriangleBlock, WIDTH};

/// A ray spread over lanes, as the tests below want it.
///
/// Both tests decide by numerators, with the sign of the determinant moved over to them; the division comes last, for the few
/// blocks that pass. A first look at the parameter is a little generous, the second is exact.
pub(crate) struct WideRay<S: Lanes> {
    axes: [Row<3>; 3],
    /// Robust: along `axes`. Fast: along x, y, z.
    origin: [S::F; 3],
    /// Robust: shear in x and y, inverse direction in z. Fast: direction.
    direction: [S::F; 3],
    t_min: S::F,
}

impl<S: Lanes> WideRay<S> {
    #[inline(always)]
    pub(crate) fn new<const ROBUST: bool>(s: S, setup: &Setup, t_min: f32) -> Self {
        let axes = if ROBUST { setup.axes } else { [0, 1, 2] };
        let [x, y, z] = axes;
        let origin = [setup.origin[x], setup.origin[y], setup.origin[z]];
        let direction = if ROBUST { setup.shear } else { setup.direction };
        let axes = [Row::new(x), Row::new(y), Row::new(z)];
        Self { axes, origin: splat3(s, origin), direction: splat3(s, direction), t_min: s.splat(t_min) }
    }

    /// Parameter of each hit, and a bit where there is one: see the head of the parent module. `None`: nowhere.
    #[inline(always)]
    pub(crate) fn watertight(&self, s: S, block: &TriangleBlock, t_max: f32) -> Option<(S::F, u32)> {
        let (ax, ay, az) = self.sheared(s, &block.p[0]);
        let (bx, by, bz) = self.sheared(s, &block.p[1]);
        let (cx, cy, cz) = self.sheared(s, &block.p[2]);
        // Each product rounded by itself, so that the neighbor gets exactly the negative.
        let u = s.sub(s.mul(cx, by), s.mul(cy, bx));
        let v = s.sub(s.mul(ax, cy), s.mul(ay, cx));
        let w = s.sub(s.mul(bx, ay), s.mul(by, ax));
        // Where all three have one sign, so has the sum.
        let det = s.add(s.add(u, v), w);
        let sign = s.sign(det);
        let least = s.min(s.min(s.turn(u, sign), s.turn(v, sign)), s.turn(w, sign));
        let inside = s.le(s.splat(0.0), least);
        let distance = s.mul_add(u, az, s.mul_add(v, bz, s.mul(w, cz)));
        self.parameter(s, inside, s.turn(s.mul(distance, self.direction[2]), sign), s.turn(det, sign), t_max)
    }

    /// A vertex where the ray starts at the origin and runs along z.
    #[inline(always)]
    fn sheared(&self, s: S, p: &[[f32; WIDTH]; 3]) -> (S::F, S::F, S::F) {
        let [kx, ky, kz] = self.axes;
        let z = s.sub(s.load_row(p, kz), self.origin[2]);
        let x = s.neg_mul_add(self.direction[0], z, s.sub(s.load_row(p, kx), self.origin[0]));
        let y = s.neg_mul_add(self.direction[1], z, s.sub(s.load_row(p, ky), self.origin[1]));
        (x, y, z)
    }

    /// The same by Möller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection"; not watertight.
    #[inline(always)]
    pub(crate) fn moeller_trumbore(&self, s: S, block: &TriangleBlock, t_max: f32) -> Option<(S::F, u32)> {
        let (p0, e1, e2) = (load3(s, &block.p[0]), load3(s, &block.p[1]), load3(s, &block.p[2]));
        let from_p0 = [s.sub(self.origin[0], p0[0]), s.sub(self.origin[1], p0[1]), s.sub(self.origin[2], p0[2])];
        let h = cross(s, &self.direction, &e2);
        let q = cross(s, &from_p0, &e1);
        let det = dot(s, &e1, &h);
        let sign = s.sign(det);
        let u = s.turn(dot(s, &from_p0, &h), sign);
        let v = s.turn(dot(s, &self.direction, &q), sign);
        let det = s.turn(det, sign);
        // NaN in one of them is NaN in the sum.
        let inside = s.and(s.le(s.splat(0.0), s.min(u, v)), s.le(s.add(u, v), det));
        self.parameter(s, inside, s.turn(dot(s, &e2, &q), sign), det, t_max)
    }

    /// The parameter is `distance / det`, and `det` is not negative. With a `det` of 0 there is none.
    #[inline(always)]
    fn parameter(&self, s: S, inside: S::Mask, distance: S::F, det: S::F, t_max: f32) -> Option<(S::F, u32)> {
        const MORE: f32 = 1.0 + 8.0 * f32::EPSILON;
        const LESS: f32 = 1.0 - 8.0 * f32::EPSILON;
        // Not a number where infinity meets a `det` of 0: then, too, there is no hit.
        let early = s.le(distance, s.mul(det, s.splat(t_max * MORE)));
        let late = s.lt(s.mul(det, s.mul(self.t_min, s.splat(LESS))), distance);
        let valid = s.and(inside, s.and(early, late));
        if s.bits(valid) == 0 {
            return None;
        }
        let t = s.div(distance, det);
        let valid = s.and(valid, s.and(s.lt(self.t_min, t), s.le(t, s.splat(t_max))));
        Some((t, s.bits(valid)))
    }
}

#[inline(always)]
fn load3<S: Lanes>(s: S, p: &[[f32; WIDTH]; 3]) -> [S::F; 3] {
    [s.load(&p[0]), s.load(&p[1]), s.load(&p[2])]
}

/// Barycentric coordinates (of vertices 1 and 2) of the hit on one lane, which the tests above have found.
#[inline(always)]
pub(crate) fn barycentric<const ROBUST: bool>(block: &TriangleBlock, lane: usize, setup: &Setup) -> (f32, f32) {
    let [p0, p1, p2] = [lane_of(&block.p[0], lane), lane_of(&block.p[1], lane), lane_of(&block.p[2], lane)];
    if ROBUST {
        let ((ax, ay), (bx, by), (cx, cy)) = (sheared1(p0, setup), sheared1(p1, setup), sheared1(p2, setup));
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        let det = u + v + w;
        (v / det, w / det)
    } else {
        let o = setup.origin;
        let from_p0 = [o[0] - p0[0], o[1] - p0[1], o[2] - p0[2]];
        let h = cross1(setup.direction, p2);
        let inverse = 1.0 / dot1(p1, h);
        (dot1(from_p0, h) * inverse, dot1(setup.direction, cross1(from_p0, p1)) * inverse)
    }
}

#[inline(always)]
fn lane_of(p: &[[f32; WIDTH]; 3], lane: usize) -> [f32; 3] {
    [p[0][lane % WIDTH], p[1][lane % WIDTH], p[2][lane % WIDTH]]
}

#[inline(always)]
fn sheared1(p: [f32; 3], setup: &Setup) -> (f32, f32) {
    let [kx, ky, kz] = setup.axes;
    let z = p[kz] - setup.origin[kz];
    let x = (-setup.shear[0]).mul_add(z, p[kx] - setup.origin[kx]);
    let y = (-setup.shear[1]).mul_add(z, p[ky] - setup.origin[ky]);
    (x, y)
}

#[inline(always)]
fn cross1(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1].mul_add(b[2], -(a[2] * b[1])), a[2].mul_add(b[0], -(a[0] * b[2])), a[0].mul_add(b[1], -(a[1] * b[0]))]
}

#[inline(always)]
fn dot1(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}
