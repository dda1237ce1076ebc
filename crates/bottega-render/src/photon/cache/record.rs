//! The irradiance record: irradiance at a point, its gradients and its noise.

use std::{f32::consts::PI, sync::Arc};

use bottega_kernels::math;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::super::{
    around::{CELLS, CellsAround, GatherSample, RINGS, SECTORS},
    bounces::{BOUNCES_KEPT, ByBounces, kept},
    bytes::{Reader, Writer},
};
use crate::{color::luminance, sampling::orthonormal_basis};

/// Cells of the hemisphere, which have equal cosine-weighted solid angles, and the least number of rays per record.
pub(crate) const RAYS: u32 = (RINGS * SECTORS) as u32;
/// Greatest number of rays per cell.
pub(crate) const EFFORT_MAX: u32 = 16;

/// An irradiance record. The first 64 bytes hold what every lookup near the record reads.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct IrradianceRecord {
    /// Position, in world space.
    pub(super) p: Vec3,
    /// Shading normal; unit length.
    pub(super) n: Vec3,
    /// Harmonic mean distance to other surfaces.
    pub(super) radius: f32,
    /// Distance to walls along the surface, per side; see [`clearance`].
    pub(super) clearance: Clearance,
    /// Rays per cell.
    pub(super) effort: u32,
    /// Expected relative variance, shared by a neighbourhood; see [`super::noise`].
    pub(super) noise: f32,
    /// Indirect irradiance at the point.
    pub(super) irradiance: Spectrum,
    /// Rotational gradient, per channel.
    pub(super) turning: [Vec3; 3],
    /// Translational gradient, per channel.
    pub(super) moving: [Vec3; 3],
    /// Variance of the luminance of the irradiance, estimated from the record's own rays.
    pub(super) variance: f32,
    /// Cumulative share of the light with at most 0, 1, 2 … bounces; beyond the list, 1.
    pub(super) shares: Box<[Share]>,
    /// Light by direction; only on surfaces that are not matte.
    pub(super) around: Option<Arc<CellsAround>>,
}

/// Greatest distance off the surface of a point that a record counts for, along the sum of both normals, in radii.
const OFF_PLANE: f32 = 0.1;

/// Steepness by which a record fades before walls, so that it has no edge there.
const FADING: f32 = 3.0;

/// The region where a record may count: a ball around it, between two planes parallel to its surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordRegion {
    p: Vec3,
    n: Vec3,
    /// Radius of the ball.
    pub(super) radius: f32,
    /// Distance of the planes from the surface.
    height: f32,
}

impl RecordRegion {
    /// Returns `true` if a part of the cube lies within the region.
    pub(super) fn meets(&self, low: Vec3, side: f32) -> bool {
        let half = 0.5 * side;
        let is_near = self.p.distance_squared(self.p.clamp(low, low + side)) <= self.radius * self.radius;
        is_near && (low + half - self.p).dot(self.n).abs() - half * self.n.abs().element_sum() <= self.height
    }
}

/// Number of sides with known clearance.
pub(super) const SIDES: usize = 8;

/// Distances to eight sides, as the upper 16 bits of an `f32`.
pub(super) type Clearance = [u16; SIDES];

/// A share of red, green and blue, each in units of 1 ∕ 65535.
pub(super) type Share = [u16; 3];

/// The radiance and distance that a record's rays found, per cell of the hemisphere.
#[derive(Clone, Debug)]
pub(crate) struct Measurement {
    cells: Vec<GatherSample>,
    effort: u32,
    /// Variance of the luminance of the irradiance.
    variance: f32,
}

impl Measurement {
    /// Computes irradiance, gradients and harmonic mean distance (Ward and Heckbert 1992).
    ///
    /// - `rays`: samples in the directions of [`direction`], cell by cell.
    /// - `effort`: rays per cell: 1 or an even number.
    pub(crate) fn new(rays: Vec<GatherSample>, effort: u32) -> Self {
        let cell = PI / RAYS as f32;
        if effort == 1 {
            // Take differences between neighbouring cells for noise
            let next = |i: usize| i / SECTORS * SECTORS + (i + 1) % SECTORS;
            let difference = |i: usize| luminance(rays[i].radiance) - luminance(rays[next(i)].radiance);
            let squares = (0..rays.len()).map(|i| 0.5 * difference(i) * difference(i)).sum::<f32>();
            return Self { cells: rays, effort, variance: squares * cell * cell };
        }
        let cells = || rays.chunks_exact(effort as usize);
        let difference = |cell: &[GatherSample]| {
            let (first, second) = cell.split_at(cell.len() / 2);
            luminance(GatherSample::mean(first).radiance) - luminance(GatherSample::mean(second).radiance)
        };
        let squares = cells().map(|cell| 0.25 * difference(cell) * difference(cell)).sum::<f32>();
        Self { cells: cells().map(GatherSample::mean).collect(), effort, variance: squares * cell * cell }
    }

    /// Returns the mean sample of each cell.
    pub(crate) fn cells(&self) -> &[GatherSample] {
        &self.cells
    }
}

impl GatherSample {
    /// Returns the mean radiance and the harmonic mean distance of some samples.
    fn mean(looks: &[GatherSample]) -> Self {
        let count = looks.len() as f32;
        let inverse: f32 = looks.iter().map(GatherSample::inverse_distance).sum();
        let distance = if inverse > 0.0 { count / inverse } else { f32::INFINITY };
        Self { radiance: looks.iter().map(|look| look.radiance).sum::<Spectrum>() / count, distance }
    }

    /// Returns 1 over the distance, bounded.
    fn inverse_distance(&self) -> f32 {
        1.0 / self.distance.max(1e-9)
    }
}

/// Returns the distance along the surface to the nearest wall on each side: that of the nearest hit of rays at some
/// twenty degrees above it. Lower rays hit a concave surface itself.
fn clearance(looks: &[GatherSample]) -> Clearance {
    const RING: usize = RINGS - 2;
    let sine = ((RING as f32 + 0.5) / RINGS as f32).sqrt();
    std::array::from_fn(|side| {
        let first = RING * SECTORS + side * (SECTORS / SIDES);
        let nearest =
            looks[first..first + SECTORS / SIDES].iter().map(|look| look.distance).fold(f32::INFINITY, f32::min);
        ((nearest * sine).max(0.0).to_bits() >> 16) as u16
    })
}

/// Returns a cosine-distributed, stratified direction in cell `index` of [`RAYS`]; `u`: position in the cell, in [0,
/// 1)².
pub(crate) fn direction(n: Vec3, index: u32, u: [f32; 2]) -> Vec3 {
    let (ring, sector) = (index as usize / SECTORS, index as usize % SECTORS);
    let sine_squared = (ring as f32 + u[0]) / RINGS as f32;
    let (sin, cos) = math::sin_cos_of_turns((sector as f32 + u[1]) / SECTORS as f32);
    let (s, t) = orthonormal_basis(n);
    let sine = sine_squared.sqrt();
    (s * (sine * cos) + t * (sine * sin) + n * (1.0 - sine_squared).max(0.0).sqrt()).normalize()
}

impl IrradianceRecord {
    /// Makes a record of a measurement.
    ///
    /// - `reach`: least and greatest radius.
    pub(crate) fn new(p: Vec3, n: Vec3, found: &Measurement, reach: [f32; 2]) -> Self {
        let looks = found.cells();
        let look = |ring: usize, sector: usize| &looks[ring * SECTORS + sector % SECTORS];
        let cell = PI / looks.len() as f32;
        // Sum irradiance and harmonic mean distance
        let irradiance = looks.iter().map(|look| look.radiance).sum::<Spectrum>() * cell;
        let inverse: f32 = looks.iter().map(GatherSample::inverse_distance).sum::<f32>() / looks.len() as f32;
        let radius = if inverse > 0.0 { 1.0 / inverse } else { f32::INFINITY };
        let (s, t) = orthonormal_basis(n);
        let around = |turns: f32| {
            let (sin, cos) = math::sin_cos_of_turns(turns);
            s * cos + t * sin
        };
        // Sum the gradients over the cells
        let (mut turning, mut moving) = ([Vec3::ZERO; 3], [Vec3::ZERO; 3]);
        let add = |to: &mut [Vec3; 3], along: Vec3, by: Spectrum| {
            for channel in 0..3 {
                to[channel] += along * by[channel];
            }
        };
        let sine = |edge: usize| (edge as f32 / RINGS as f32).sqrt();
        for sector in 0..SECTORS {
            let middle = (sector as f32 + 0.5) / SECTORS as f32;
            let (towards, across) = (around(middle), around(middle + 0.25));
            let edge_across = around(sector as f32 / SECTORS as f32 + 0.25);
            for ring in 0..RINGS {
                let here = look(ring, sector);
                // Rotational gradient (Ward and Heckbert 1992, eq. 1), positive for a turn from n towards the light
                let middle_squared = (ring as f32 + 0.5) / RINGS as f32;
                let tangent = (middle_squared / (1.0 - middle_squared)).sqrt();
                add(&mut turning, across, here.radiance * (tangent * cell));
                // Translational gradient (ibid., eq. 2), across cell borders between rings and between sectors
                if ring > 0 {
                    let below = look(ring - 1, sector);
                    let sine = sine(ring);
                    let cos_squared = 1.0 - sine * sine;
                    let near = here.distance.min(below.distance).max(reach[0]);
                    let by = 2.0 * PI / SECTORS as f32 * sine * cos_squared / near;
                    add(&mut moving, towards, (here.radiance - below.radiance) * by);
                }
                let before = look(ring, sector + SECTORS - 1);
                let near = here.distance.min(before.distance).max(reach[0]);
                let by = (sine(ring + 1) - sine(ring)) / near;
                add(&mut moving, edge_across, (here.radiance - before.radiance) * by);
            }
        }
        Self {
            p,
            n,
            irradiance,
            shares: Box::default(),
            turning,
            moving,
            radius: radius.clamp(reach[0], reach[1].max(reach[0])),
            clearance: clearance(looks),
            effort: found.effort,
            variance: found.variance,
            noise: 0.0,
            around: None,
        }
    }

    /// Returns this record with its light by direction.
    pub(crate) fn with_directions(self, found: &Measurement) -> Self {
        Self { around: Some(Arc::new(CellsAround::new(found.cells()))), ..self }
    }

    /// Returns this record with its light by number of bounces.
    ///
    /// - `light`: by number of bounces, in any unit.
    pub(crate) fn with_bounces(self, light: &ByBounces) -> Self {
        /// Share of the light at which the list ends.
        const REST: f32 = 1.0 / 2048.0;
        let total: Spectrum = light.iter().sum();
        if !total.is_finite() {
            return self;
        }
        let inverse = total.max(Spectrum::splat(f32::MIN_POSITIVE)).recip();
        let mut shares = Vec::new();
        let mut sum = Spectrum::ZERO;
        for part in &light[..BOUNCES_KEPT - 1] {
            sum += *part;
            if (total - sum).cmple(total * REST).all() {
                break;
            }
            let share = (sum * inverse).clamp(Spectrum::ZERO, Spectrum::ONE) * f32::from(u16::MAX) + 0.5;
            shares.push(share.to_array().map(|channel| channel as u16));
        }
        Self { shares: shares.into(), ..self }
    }

    /// Returns the share of the record's light with at most `bounces` bounces.
    #[inline(always)]
    pub(super) fn share(&self, bounces: u32) -> Spectrum {
        match self.shares.get(kept(bounces)) {
            Some(share) => Spectrum::from(share.map(f32::from)) * (1.0 / f32::from(u16::MAX)),
            None => Spectrum::ONE,
        }
    }

    /// Calls `take` with the share of its light with exactly 0, 1, 2 … bounces, up to `bounces`.
    #[inline(always)]
    pub(super) fn parts(&self, bounces: u32, mut take: impl FnMut(usize, Spectrum)) {
        let last = kept(bounces).min(self.shares.len());
        let mut below = Spectrum::ZERO;
        for number in 0..last {
            let sum = self.share(number as u32);
            take(number, (sum - below).max(Spectrum::ZERO));
            below = sum;
        }
        take(last, (self.share(bounces) - below).max(Spectrum::ZERO));
    }

    /// Returns the memory of the record's lists, in bytes.
    pub(super) fn list_bytes(&self) -> usize {
        size_of_val(&*self.shares) + if self.around.is_some() { size_of::<CellsAround>() } else { 0 }
    }

    /// Size of a record without directions, in bytes.
    pub(crate) const BYTES_MIN: usize = 4 * (33 + SIDES);

    /// Writes the record.
    pub(crate) fn write(&self, to: &mut Writer) {
        let Self { p, n, irradiance, shares, turning, moving, radius, clearance, effort, variance, noise, around } =
            self;
        [*p, *n, *irradiance].iter().chain(turning).chain(moving).for_each(|&vector| to.vector(vector));
        to.value(*radius);
        clearance.iter().for_each(|&distance| to.number(u32::from(distance)));
        to.number(*effort);
        to.value(*variance);
        to.value(*noise);
        to.number(u32::from(around.is_some()));
        around.iter().flat_map(|around| around.to_numbers()).for_each(|number| to.number(number));
        to.number(shares.len() as u32);
        shares.iter().flatten().for_each(|&share| to.number(u32::from(share)));
    }

    /// Reads a record; `None`: not a valid one.
    pub(crate) fn read(from: &mut Reader<'_>) -> Option<Self> {
        let mut vector = || from.vector();
        let [p, n, irradiance] = [vector()?, vector()?, vector()?];
        let turning = [vector()?, vector()?, vector()?];
        let moving = [vector()?, vector()?, vector()?];
        let radius = from.value()?;
        let mut clearance = [0; SIDES];
        for distance in &mut clearance {
            *distance = u16::try_from(from.number()?).ok()?;
        }
        let (effort, variance, noise) = (from.number()?, from.value()?, from.value()?);
        if radius < 0.0 || variance < 0.0 || noise < 0.0 || !(1..=EFFORT_MAX).contains(&effort) {
            return None;
        }
        let around = match from.number()? {
            0 => None,
            1 => {
                let mut numbers = [0; CELLS];
                for number in &mut numbers {
                    *number = from.number()?;
                }
                Some(Arc::new(CellsAround::from_numbers(numbers)))
            }
            _ => return None,
        };
        let count = from.count(size_of::<u32>() * 3)?;
        let mut share = || from.number().map(|number| number.min(u32::from(u16::MAX)) as u16);
        let shares = (0..count).map(|_| Some([share()?, share()?, share()?])).collect::<Option<_>>()?;
        Some(Self { p, n, irradiance, shares, turning, moving, radius, clearance, effort, variance, noise, around })
    }

    /// Returns the region where the record may count; see [`Self::nearness`].
    ///
    /// A point at distance d whose normal differs by 1 − cos = e² counts where d ∕ R + e < a (the tolerance), if its
    /// offset along the mean of both normals is within 0.1 R. So its offset along the record's normal is at most R (0.1
    /// ∕ (2 − e²) + (a − e) e ∕ √(2 − e²)). The bound takes (a − e) e = a² ∕ 4, and e = a in the denominators.
    pub(super) fn reach(&self, tolerance: f32) -> RecordRegion {
        let (squared, rounding) = (tolerance * tolerance, 1.01);
        let below = (2.0 - squared).max(0.0);
        let height = rounding * (OFF_PLANE / below + 0.25 * squared / below.sqrt());
        RecordRegion { height: height * self.radius, ..self.reach_around(tolerance) }
    }

    /// Returns the ball where the record may count, without the planes.
    pub(super) fn reach_around(&self, tolerance: f32) -> RecordRegion {
        RecordRegion { p: self.p, n: self.n, radius: tolerance * self.radius, height: f32::INFINITY }
    }

    /// Returns Ward's weight at another point; 0 where it does not count.
    pub(super) fn weight(&self, p: Vec3, n: Vec3, tolerance: f32) -> f32 {
        match self.nearness(p, n, tolerance) {
            0.0 => 0.0,
            nearness => 1.0 / (tolerance * (1.0 - nearness)).max(1e-6) - 1.0 / tolerance,
        }
    }

    /// Returns 1 at the record itself, falling to 0 where it does not count.
    #[inline(always)]
    pub(super) fn nearness(&self, p: Vec3, n: Vec3, tolerance: f32) -> f32 {
        let way = p - self.p;
        let (distance_squared, reach) = (way.length_squared(), tolerance * self.radius);
        // Reject most records early, without square roots. On a smooth surface the offset is perpendicular to both
        // normals; points above it are on another surface, and points below it may be inside a thin wall
        if distance_squared >= reach * reach || way.dot(n + self.n).abs() > OFF_PLANE * self.radius {
            return 0.0;
        }
        let error = distance_squared.sqrt() / self.radius + (1.0 - n.dot(self.n)).max(0.0).sqrt();
        let nearness = 1.0 - error / tolerance;
        // Test for walls only where it counts
        if nearness > 0.0 { nearness.min(self.open_share(way)) } else { 0.0 }
    }

    /// Returns `true` if no wall stands between the record and a point on its surface, however thin.
    #[inline(always)]
    pub(super) fn is_clear(&self, way: Vec3) -> bool {
        self.open_share(way) > 0.0
    }

    /// Returns how far before a wall a point on the record's surface is: 0 at the wall and behind it, at least 1 in the
    /// first two thirds of the way.
    #[inline(always)]
    fn open_share(&self, way: Vec3) -> f32 {
        let (s, t) = orthonormal_basis(self.n);
        let (x, y) = (way.dot(s), way.dot(t));
        // The sides are octants, in the order of the sectors
        let (is_below, is_left, is_steep) = (y < 0.0, x < 0.0, y.abs() > x.abs());
        let side = match (is_below, is_left, is_steep) {
            (false, false, false) => 0,
            (false, false, true) => 1,
            (false, true, true) => 2,
            (false, true, false) => 3,
            (true, true, false) => 4,
            (true, true, true) => 5,
            (true, false, true) => 6,
            (true, false, false) => 7,
        };
        let distance = f32::from_bits(u32::from(self.clearance[side]) << 16);
        FADING * (1.0 - ((x * x + y * y) / (distance * distance).max(f32::MIN_POSITIVE)).sqrt()).max(0.0)
    }

    /// Returns the irradiance extrapolated to another point by the gradients.
    pub(super) fn at(&self, p: Vec3, n: Vec3) -> Spectrum {
        let (turned, moved) = (self.n.cross(n), p - self.p);
        let change = |channel: usize| self.turning[channel].dot(turned) + self.moving[channel].dot(moved);
        (self.irradiance + Vec3::new(change(0), change(1), change(2))).max(Vec3::ZERO)
    }
}
