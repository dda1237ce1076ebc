//! Eight triangles against a ray.

use super::lanes::Lanes;
use super::setup::Setup;
use crate::tree::TriangleBlock;

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
        let [kx, ky, kz] = if ROBUST { setup.axes } else { [0, 1, 2] };
        let [x, y, z] = if ROBUST { setup.shear } else { setup.direction };
        Self {
            axes: setup.axes,
            origin: [s.splat(setup.origin[kx]), s.splat(setup.origin[ky]), s.splat(setup.origin[kz])],
            direction: [s.splat(x), s.splat(y), s.splat(z)],
        }
    }

    /// Vertex `i` of each triangle, seen from the origin and sheared so that the ray runs along the third axis.
    ///
    /// No closure: one that is called more than once may stay a function of its own, without the vector unit of its
    /// caller, and then every operation in it is a call.
    #[inline(always)]
    fn sheared(&self, s: S, [kx, ky, kz]: [usize; 3], p: &[[f32; 8]; 3]) -> (S::F, S::F, S::F) {
        let [sx, sy, _] = self.direction;
        let z = s.sub(s.load(&p[kz]), self.origin[2]);
        let x = s.neg_mul_add(sx, z, s.sub(s.load(&p[kx]), self.origin[0]));
        let y = s.neg_mul_add(sy, z, s.sub(s.load(&p[ky]), self.origin[1]));
        (x, y, z)
    }

    /// Parameter of each hit, and where there is one: see the head of the parent module. `None`: nowhere.
    #[inline(always)]
    pub(crate) fn watertight(&self, s: S, block: &TriangleBlock) -> Option<(S::F, S::Mask)> {
        let [kx, ky, kz] = self.axes;
        let axes = [if kx < 3 { kx } else { 0 }, if ky < 3 { ky } else { 0 }, if kz < 3 { kz } else { 0 }];
        let sz = self.direction[2];
        let (ax, ay, az) = self.sheared(s, axes, &block.p[0]);
        let (bx, by, bz) = self.sheared(s, axes, &block.p[1]);
        let (cx, cy, cz) = self.sheared(s, axes, &block.p[2]);
        // Each product rounded by itself, so that the neighbor gets exactly the negative.
        let u = s.sub(s.mul(cx, by), s.mul(cy, bx));
        let v = s.sub(s.mul(ax, cy), s.mul(ay, cx));
        let w = s.sub(s.mul(bx, ay), s.mul(by, ax));
        let zero = s.splat(0.0);
        let least = s.min(s.min(u, v), w);
        let most = s.max(s.max(u, v), w);
        let mixed = s.and(s.lt(least, zero), s.lt(zero, most));
        let det = s.add(s.add(u, v), w);
        let flat = s.and(s.le(det, zero), s.le(zero, det));
        let inside = s.and_not(mixed, s.and_not(flat, s.le(det, det)));
        if s.bits(inside) == 0 {
            return None;
        }
        let distance = s.mul_add(u, az, s.mul_add(v, bz, s.mul(w, cz)));
        Some((s.div(s.mul(distance, sz), det), inside))
    }

    /// The same by Möller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection"; not watertight.
    #[inline(always)]
    pub(crate) fn moeller_trumbore(&self, s: S, block: &TriangleBlock) -> Option<(S::F, S::Mask)> {
        let load = |i: usize| std::array::from_fn::<_, 3, _>(|axis| s.load(&block.p[i][axis]));
        let cross = |a: &[S::F; 3], b: &[S::F; 3]| {
            [
                s.mul_sub(a[1], b[2], s.mul(a[2], b[1])),
                s.mul_sub(a[2], b[0], s.mul(a[0], b[2])),
                s.mul_sub(a[0], b[1], s.mul(a[1], b[0])),
            ]
        };
        let dot = |a: &[S::F; 3], b: &[S::F; 3]| s.mul_add(a[0], b[0], s.mul_add(a[1], b[1], s.mul(a[2], b[2])));
        let (p0, e1, e2) = (load(0), load(1), load(2));
        let from_p0 = std::array::from_fn(|i| s.sub(self.origin[i], p0[i]));
        let h = cross(&self.direction, &e2);
        let det = dot(&e1, &h);
        let inverse = s.div(s.splat(1.0), det);
        let u = s.mul(dot(&from_p0, &h), inverse);
        let q = cross(&from_p0, &e1);
        let v = s.mul(dot(&self.direction, &q), inverse);
        let (zero, one) = (s.splat(0.0), s.splat(1.0));
        // With a determinant of 0 the others are NaN or infinite, and the comparisons false.
        let inside = s.and(s.and(s.le(zero, u), s.le(zero, v)), s.le(s.add(u, v), one));
        if s.bits(inside) == 0 {
            return None;
        }
        Some((s.mul(dot(&e2, &q), inverse), inside))
    }
}

/// Barycentric coordinates (of vertices 1 and 2) of the hit on one lane, which the tests above have found.
#[inline(always)]
pub(crate) fn barycentric<const ROBUST: bool>(block: &TriangleBlock, lane: usize, setup: &Setup) -> (f32, f32) {
    let lane = lane & 7;
    if ROBUST {
        let (ax, ay) = sheared_lane(&block.p[0], lane, setup);
        let (bx, by) = sheared_lane(&block.p[1], lane, setup);
        let (cx, cy) = sheared_lane(&block.p[2], lane, setup);
        let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
        let det = u + v + w;
        (v / det, w / det)
    } else {
        let vector = |i: usize| std::array::from_fn::<_, 3, _>(|axis| block.p[i][axis][lane]);
        let cross = |a: [f32; 3], b: [f32; 3]| {
            [a[1].mul_add(b[2], -(a[2] * b[1])), a[2].mul_add(b[0], -(a[0] * b[2])), a[0].mul_add(b[1], -(a[1] * b[0]))]
        };
        let dot = |a: [f32; 3], b: [f32; 3]| a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]));
        let (p0, e1, e2) = (vector(0), vector(1), vector(2));
        let from_p0 = std::array::from_fn(|i| setup.origin[i] - p0[i]);
        let h = cross(setup.direction, e2);
        let inverse = 1.0 / dot(e1, h);
        (dot(from_p0, h) * inverse, dot(setup.direction, cross(from_p0, e1)) * inverse)
    }
}

/// The first two coordinates of one lane of [`WideRay::sheared`].
#[inline(always)]
fn sheared_lane(p: &[[f32; 8]; 3], lane: usize, setup: &Setup) -> (f32, f32) {
    let [kx, ky, kz] = setup.axes;
    let z = p[kz][lane] - setup.origin[kz];
    let x = (-setup.shear[0]).mul_add(z, p[kx][lane] - setup.origin[kx]);
    let y = (-setup.shear[1]).mul_add(z, p[ky][lane] - setup.origin[ky]);
    (x, y)
}
