//! The record of one place: irradiance, how it changes, and how sure it is.

use std::{f32::consts::PI, sync::Arc};

use bottega_kernels::math;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::super::{
    around::{CELLS, CellsAround, GatherSample, RINGS, SECTORS},
    bounces::{BOUNCES_KEPT, ByBounces, kept},
    bytes::{Reader, Writer},
};
use crate::{luminance, sampling::orthonormal_basis};

/// Cells of the hemisphere, which all weigh alike by the cosine, and least rays by which the irradiance at one place is found.
pub(crate) const RAYS: u32 = (RINGS * SECTORS) as u32;
/// Most rays to a cell.
pub(crate) const EFFORT_MAX: u32 = 16;

/// What is known at one place. What is asked of each record near a place fills its first 64 bytes, what it says there the rest.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct IrradianceRecord {
    pub(super) p: Vec3,
    pub(super) n: Vec3,
    /// Distance to other surfaces, on the harmonic mean.
    pub(super) radius: f32,
    /// How far its surface is free of walls, to each side; see [`clearance`].
    pub(super) clearance: Clearance,
    /// Rays to a cell.
    pub(super) effort: u32,
    /// Relative variance that is to be expected of it, as it and those around it tell together: see [`super::noise`].
    pub(super) noise: f32,
    pub(super) irradiance: Spectrum,
    /// How it changes as the surface turns and as the place moves: one vector for each of red, green and blue.
    pub(super) turning: [Vec3; 3],
    pub(super) moving: [Vec3; 3],
    /// Variance of the luminance of the irradiance, by how much its own rays differ.
    pub(super) variance: f32,
    /// Which share of it comes by no more than 0, 1, 2 … bounces; beyond the list, all of it.
    pub(super) shares: Box<[Share]>,
    /// Where the light comes from; on surfaces that do not send it to all sides alike.
    pub(super) around: Option<Arc<CellsAround>>,
}

/// How far off its surface a place may lie that it speaks for, in its radius, along the sum of both normals.
const OFF_PLANE: f32 = 0.1;

/// Where a record may count: a ball around it, between two planes along its surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    p: Vec3,
    n: Vec3,
    pub(super) radius: f32,
    /// Of the planes over the surface and below it.
    height: f32,
}

impl Reach {
    /// Whether a part of a cube lies within.
    pub(super) fn meets(&self, low: Vec3, side: f32) -> bool {
        let half = 0.5 * side;
        let is_near = self.p.distance_squared(self.p.clamp(low, low + side)) <= self.radius * self.radius;
        is_near && (low + half - self.p).dot(self.n).abs() - half * self.n.abs().element_sum() <= self.height
    }
}

/// Sides to which it is known how far a surface is free of walls.
pub(super) const SIDES: usize = 8;

/// Distances to eight sides, in the upper half of the bits of an `f32`.
pub(super) type Clearance = [u16; SIDES];

/// A share of red, green and blue, each in 65535ths.
pub(super) type Share = [u16; 3];

/// What the rays of one place found, by cell of the hemisphere.
#[derive(Clone, Debug)]
pub(crate) struct Measurement {
    cells: Vec<GatherSample>,
    effort: u32,
    /// Of the luminance of the irradiance.
    variance: f32,
}

impl Measurement {
    /// - `rays`: in the directions of [`direction`], cell by cell.
    /// - `effort`: rays to a cell: 1 or an even number.
    pub(crate) fn new(rays: Vec<GatherSample>, effort: u32) -> Self {
        let cell = PI / RAYS as f32;
        if effort == 1 {
            // What cells next to each other differ by is noise, or too fine to be told from it.
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

    /// One for each cell.
    pub(crate) fn cells(&self) -> &[GatherSample] {
        &self.cells
    }
}

impl GatherSample {
    /// What some rays found together: the harmonic mean of their distances.
    fn mean(looks: &[GatherSample]) -> Self {
        let count = looks.len() as f32;
        let inverse: f32 = looks.iter().map(GatherSample::inverse_distance).sum();
        let distance = if inverse > 0.0 { count / inverse } else { f32::INFINITY };
        Self { radiance: looks.iter().map(|look| look.radiance).sum::<Spectrum>() / count, distance }
    }

    fn inverse_distance(&self) -> f32 {
        1.0 / self.distance.max(1e-9)
    }
}

/// How far a surface is free of walls to each side: as far as the nearest thing that rays have met that left it at some twenty degrees.
/// Lower ones meet a hollow surface itself.
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

/// A direction in cell `index` of [`RAYS`]: by the cosine, stratified. `u`: where in its cell.
pub(crate) fn direction(n: Vec3, index: u32, u: [f32; 2]) -> Vec3 {
    let (ring, sector) = (index as usize / SECTORS, index as usize % SECTORS);
    let sine_squared = (ring as f32 + u[0]) / RINGS as f32;
    let (sin, cos) = math::sin_cos_of_turns((sector as f32 + u[1]) / SECTORS as f32);
    let (s, t) = orthonormal_basis(n);
    let sine = sine_squared.sqrt();
    (s * (sine * cos) + t * (sine * sin) + n * (1.0 - sine_squared).max(0.0).sqrt()).normalize()
}

impl IrradianceRecord {
    /// - `reach`: least and greatest radius within which it may count.
    pub(crate) fn new(p: Vec3, n: Vec3, found: &Measurement, reach: [f32; 2]) -> Self {
        let looks = found.cells();
        let look = |ring: usize, sector: usize| &looks[ring * SECTORS + sector % SECTORS];
        let cell = PI / looks.len() as f32;
        let irradiance = looks.iter().map(|look| look.radiance).sum::<Spectrum>() * cell;
        let inverse: f32 = looks.iter().map(GatherSample::inverse_distance).sum::<f32>() / looks.len() as f32;
        let radius = if inverse > 0.0 { 1.0 / inverse } else { f32::INFINITY };
        let (s, t) = orthonormal_basis(n);
        let around = |turns: f32| {
            let (sin, cos) = math::sin_cos_of_turns(turns);
            s * cos + t * sin
        };
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
                // Ward and Heckbert 1992, eq. 1; the sign is that of a turn from n to where the light is.
                let middle_squared = (ring as f32 + 0.5) / RINGS as f32;
                let tangent = (middle_squared / (1.0 - middle_squared)).sqrt();
                add(&mut turning, across, here.radiance * (tangent * cell));
                // Ibid., eq. 2: across the borders of cells between rings, and between sectors.
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

    /// The same with where the light comes from.
    pub(crate) fn with_directions(self, found: &Measurement) -> Self {
        Self { around: Some(Arc::new(CellsAround::new(found.cells()))), ..self }
    }

    /// The same with how often its light has been scattered.
    ///
    /// - `light`: by number of bounces, in any unit.
    pub(crate) fn with_bounces(self, light: &ByBounces) -> Self {
        /// What is left of the light where the list ends.
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

    /// The share of its light that comes by no more than so many bounces.
    #[inline(always)]
    pub(super) fn share(&self, bounces: u32) -> Spectrum {
        match self.shares.get(kept(bounces)) {
            Some(share) => Spectrum::from(share.map(f32::from)) * (1.0 / f32::from(u16::MAX)),
            None => Spectrum::ONE,
        }
    }

    /// Hands out which share of its light comes by 0, 1, 2 … bounces, of no more than so many.
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

    /// Bytes of its lists.
    pub(super) fn list_bytes(&self) -> usize {
        size_of_val(&*self.shares) + if self.around.is_some() { size_of::<CellsAround>() } else { 0 }
    }

    /// Bytes of one that knows no directions.
    pub(crate) const BYTES_MIN: usize = 4 * (33 + SIDES);

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

    /// Where it may count: see [`Self::nearness`].
    ///
    /// A place d away whose normal differs by 1 − cos = e² counts where d ∕ R + e < a (the tolerance), if the way there, along the mean of both
    /// normals, is within 0.1 R. So along its own normal the way is at most R (0.1 ∕ (2 − e²) + (a − e) e ∕ √(2 − e²)): no more than with
    /// (a − e) e = a² ∕ 4, and e = a below.
    pub(super) fn reach(&self, tolerance: f32) -> Reach {
        let (squared, rounding) = (tolerance * tolerance, 1.01);
        let below = (2.0 - squared).max(0.0);
        let height = rounding * (OFF_PLANE / below + 0.25 * squared / below.sqrt());
        Reach { height: height * self.radius, ..self.reach_around(tolerance) }
    }

    /// All around it, as far as it may count.
    pub(super) fn reach_around(&self, tolerance: f32) -> Reach {
        Reach { p: self.p, n: self.n, radius: tolerance * self.radius, height: f32::INFINITY }
    }

    /// How much it counts at another place; nothing where it is too far off, before that place or behind it.
    pub(super) fn weight(&self, p: Vec3, n: Vec3, tolerance: f32) -> f32 {
        match self.nearness(p, n, tolerance) {
            0.0 => 0.0,
            nearness => 1.0 / (tolerance * (1.0 - nearness)).max(1e-6) - 1.0 / tolerance,
        }
    }

    /// 1 where it was measured, 0 where it counts nothing.
    #[inline(always)]
    pub(super) fn nearness(&self, p: Vec3, n: Vec3, tolerance: f32) -> f32 {
        let way = p - self.p;
        let (distance_squared, reach) = (way.length_squared(), tolerance * self.radius);
        // Most of those that are asked are too far off: no roots for them. On a smooth surface the way is across both normals alike;
        // what lies before a place is on another surface, and what lies behind it may be the inside of a thin wall.
        if distance_squared >= reach * reach || way.dot(n + self.n).abs() > OFF_PLANE * self.radius {
            return 0.0;
        }
        let error = distance_squared.sqrt() / self.radius + (1.0 - n.dot(self.n)).max(0.0).sqrt();
        let nearness = 1.0 - error / tolerance;
        // Walls are looked for only where it counts.
        if nearness > 0.0 && self.is_clear(way) { nearness } else { 0.0 }
    }

    /// Whether no wall stands between it and a place on its surface: behind a wall is another room, however thin the wall is.
    #[inline(always)]
    pub(super) fn is_clear(&self, way: Vec3) -> bool {
        let (s, t) = orthonormal_basis(self.n);
        let (x, y) = (way.dot(s), way.dot(t));
        // Sides go around as sectors do: each is an eighth of a turn.
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
        x * x + y * y <= distance * distance
    }

    /// What it says of another place.
    pub(super) fn at(&self, p: Vec3, n: Vec3) -> Spectrum {
        let (turned, moved) = (self.n.cross(n), p - self.p);
        let change = |channel: usize| self.turning[channel].dot(turned) + self.moving[channel].dot(moved);
        (self.irradiance + Vec3::new(change(0), change(1), change(2))).max(Vec3::ZERO)
    }
}
