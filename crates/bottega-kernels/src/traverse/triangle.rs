//! Eight triangles against a ray.

use super::lanes::{Lanes, cross, dot, splat3};
use super::setup::Setup;
use crate::tree::{TriangleBlock, WIDTH};

/// A ray spread over lanes, as the tests below want it.
pub(crate) struct WideRay<S: Lanes> {
    axes: [usize; 3],
    /// Robust: along `axes`. Fast: along x, y, z.
    origin: [S::F; 3],
    /// Robust: shear in x and y, inverse direction in z. Fast: direction.
    direction: [S::F; 3],
}

impl<S: Lanes> WideRay<S> {
    #[inline(always)]
    pub(crate) fn new<const ROBUST: bool>(s: S, setup: &Setup) -> Self {
        let [x, y, z] = if ROBUST { setup.axes } else { [0, 1, 2] };
        let origin = [setup.origin[x], setup.origin[y], setup.origin[z]];
        let direction = if ROBUST { setup.shear } else { setup.direction };
        Self { axes: setup.axes, origin: splat3(s, origin), direction: splat3(s, direction) }
    }

    /// Parameter of each hit, and where there is one: see the head of the parent module. `None`: nowhere.
    #[inline(always)]
    pub(crate) fn watertight(&self, s: S, block: &TriangleBlock) -> Option<(S::F, S::Mask)> {
        let (ax, ay, az) = self.sheared(s, &block.p[0]);
        let (bx, by, bz) = self.sheared(s, &block.p[1]);
        let (cx, cy, cz) = self.sheared(s, &block.p[2]);
        // Each product rounded by itself, so that the neighbor gets exactly the negative.
        let u = s.sub(s.mul(cx, by), s.mul(cy, bx));
        let v = s.sub(s.mul(ax, cy), s.mul(ay, cx));
        let w = s.sub(s.mul(bx, ay), s.mul(by, ax));
        let zero = s.splat(0.0);
        let least = s.min(s.min(u, v), w);
        let most = s.max(s.max(u, v), w);
        let inside = s.or(s.le(zero, least), s.le(most, zero));
        if s.bits(inside) == 0 {
            return None;
        }
        let det = s.add(s.add(u, v), w);
        // Where `det` is 0 all three are, or the signs were mixed; the parameter is then NaN, as it is where one of them is.
        let distance = s.mul_add(u, az, s.mul_add(v, bz, s.mul(w, cz)));
        Some((s.div(s.mul(distance, self.direction[2]), det), inside))
    }

    /// A vertex where the ray starts at the origin and runs along z.
    #[inline(always)]
    fn sheared(&self, s: S, p: &[[f32; WIDTH]; 3]) -> (S::F, S::F, S::F) {
        let [kx, ky, kz] = self.axes;
        // The remainder changes nothing and spares the check of the index.
        let z = s.sub(s.load(&p[kz % 3]), self.origin[2]);
        let x = s.neg_mul_add(self.direction[0], z, s.sub(s.load(&p[kx % 3]), self.origin[0]));
        let y = s.neg_mul_add(self.direction[1], z, s.sub(s.load(&p[ky % 3]), self.origin[1]));
        (x, y, z)
    }

    /// The same by Möller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection"; not watertight.
    #[inline(always)]
    pub(crate) fn moeller_trumbore(&self, s: S, block: &TriangleBlock) -> Option<(S::F, S::Mask)> {
        let (p0, e1, e2) = (load3(s, &block.p[0]), load3(s, &block.p[1]), load3(s, &block.p[2]));
        let from_p0 = [s.sub(self.origin[0], p0[0]), s.sub(self.origin[1], p0[1]), s.sub(self.origin[2], p0[2])];
        let h = cross(s, &self.direction, &e2);
        let det = dot(s, &e1, &h);
        let inverse = s.div(s.splat(1.0), det);
        let u = s.mul(dot(s, &from_p0, &h), inverse);
        let q = cross(s, &from_p0, &e1);
        let v = s.mul(dot(s, &self.direction, &q), inverse);
        let (zero, one) = (s.splat(0.0), s.splat(1.0));
        // With a determinant of 0 the others are NaN or infinite, and the comparisons false.
        let inside = s.and(s.and(s.le(zero, u), s.le(zero, v)), s.le(s.add(u, v), one));
        if s.bits(inside) == 0 {
            return None;
        }
        Some((s.mul(dot(s, &e2, &q), inverse), inside))
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
