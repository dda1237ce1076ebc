//! Directions that indirect light comes from: those of the photons near points all over the surfaces (Jensen 1995,
//! *Importance Driven Path Tracing Using the Photon Map*).
//!
//! Jensen looks up photons wherever a path scatters. Here the directions are precomputed at points near photons, as
//! with the irradiance. So a path looks up only one point, and a point can use more photons.

use std::f32::consts::{PI, TAU};

use bottega_kernels::math;
use glam::Vec3;
use rayon::prelude::*;

use super::{
    around::{CELL_RINGS, CELL_SECTORS, CELLS, cell_of},
    bytes::{Reader, Writer},
    estimator::{Estimator, FLATNESS, is_on_surface},
    map::{Nearest, PhotonMap},
    trace::is_alike,
};
use crate::sampling::orthonormal_basis;

/// Indirect photons per point.
const STEP: u32 = 64;
/// Photons that the distribution of a point is computed from.
const GATHERED: usize = 240;
/// Least number of photons; points with fewer have no distribution.
const GATHERED_MIN: f32 = 24.0;
/// Share of the directions that are drawn by the cosine alone, so that no light is missed.
const BLIND: f32 = 0.4;
/// Least mean unevenness of the light over the cells of the hemisphere, as relative variance. Below it, guiding does
/// not pay off.
const UNEVEN: f32 = 0.3;
/// Value of the last entry of a cumulative distribution.
const WHOLE: f32 = 65535.0;

/// The distribution at a point: cumulative shares of the rings, and of the sectors within each ring.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shares {
    rings: [u16; CELL_RINGS],
    sectors: [[u16; CELL_SECTORS]; CELL_RINGS],
}

/// Points with distributions of indirect light.
#[derive(Clone, Debug, Default)]
pub(crate) struct Arrivals {
    /// Points; the label is the index into `shares`.
    places: PhotonMap,
    shares: Vec<Shares>,
}

/// The distribution of indirect light at a point, proportional to radiance times cosine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightDirections<'a> {
    frame: [Vec3; 3],
    shares: &'a Shares,
}

impl Arrivals {
    /// Computes distributions on the current thread pool. Returns no points where light comes so evenly from all sides
    /// that guiding does not pay off.
    ///
    /// - `indirect`: photons that have scattered.
    pub(super) fn new(indirect: &PhotonMap, estimator: &Estimator) -> Self {
        let count = (indirect.len() as u32).div_ceil(STEP);
        let distribution = |found: &mut Nearest, number: u32| {
            let photon = indirect.photon(number * STEP);
            let n = photon.mark().normal();
            light_of_cells(indirect, photon.p, n, estimator.reach_at(photon.p), found).map(|light| (photon, light))
        };
        let found = (0..count).into_par_iter().map_init(|| Nearest::new(GATHERED), distribution);
        let found: Vec<_> = found.collect::<Vec<_>>().into_iter().flatten().collect();
        let uneven: f32 = found.iter().map(|(_, light)| unevenness(light)).sum();
        if uneven < UNEVEN * found.len() as f32 {
            return Self::default();
        }
        let places = found.iter().zip(0..).map(|((photon, _), number)| photon.with_label(number)).collect();
        Self { places: PhotonMap::new(places), shares: found.iter().map(|(_, light)| Shares::new(light)).collect() }
    }

    /// Returns the distribution of the nearest point on the surface; `None`: none near enough.
    ///
    /// - `normal`: geometric normal, on the side that the light arrives at.
    /// - `shading`: shading normal.
    #[inline(always)]
    pub(crate) fn at(&self, p: Vec3, [normal, shading]: [Vec3; 2], reach: f32) -> Option<LightDirections<'_>> {
        let accept = |index: u32| is_on_surface(&self.places.photon(index), p, normal, reach);
        let mark = self.places.mark(self.places.nearest_where(p, reach * reach, accept)?);
        // Turn the sectors to the surface, by the smallest angle
        let (s, _) = orthonormal_basis(mark.normal());
        let s = (s - shading * s.dot(shading)).try_normalize()?;
        let frame = [s, shading.cross(s), shading];
        Some(LightDirections { frame, shares: &self.shares[mark.label() as usize] })
    }

    /// Returns the memory, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.places.memory_bytes() + size_of_val(&*self.shares)
    }

    /// Writes the points with their distributions.
    pub(crate) fn write(&self, to: &mut Writer) {
        to.map(&self.places);
        let all = self.shares.iter().flat_map(|it| it.rings.iter().chain(it.sectors.as_flattened()));
        to.numbers(&all.map(|&share| u32::from(share)).collect::<Vec<_>>());
    }

    /// Reads points with their distributions; `None`: not valid.
    pub(crate) fn read(from: &mut Reader<'_>) -> Option<Self> {
        let (places, numbers) = (from.map()?, from.numbers()?);
        let numbers = numbers.into_iter().map(u16::try_from).collect::<Result<Vec<_>, _>>().ok()?;
        let parts = numbers.chunks_exact(CELL_RINGS + CELLS);
        let is_whole = parts.remainder().is_empty();
        let shares: Vec<Shares> = parts
            .map(|part| Shares {
                rings: std::array::from_fn(|ring| part[ring]),
                sectors: std::array::from_fn(|ring| {
                    std::array::from_fn(|sector| part[CELL_RINGS + ring * CELL_SECTORS + sector])
                }),
            })
            .collect();
        let is_sound = is_whole
            && places.iter().all(|place| (place.mark().label() as usize) < shares.len())
            && shares.iter().all(|it| is_distribution(&it.rings) && it.sectors.iter().all(|it| is_distribution(it)));
        is_sound.then_some(Self { places, shares })
    }
}

/// Returns `true` if the entries are a cumulative distribution without empty parts.
fn is_distribution(shares: &[u16]) -> bool {
    shares[0] > 0 && shares.is_sorted_by(|a, b| a < b) && shares.last().is_some_and(|&all| f32::from(all) == WHOLE)
}

/// Returns the share of light from each cell of the hemisphere; `None`: too few photons.
fn light_of_cells(indirect: &PhotonMap, p: Vec3, n: Vec3, reach: f32, found: &mut Nearest) -> Option<[f32; CELLS]> {
    indirect.nearest(p, reach * reach, found);
    let flatness = FLATNESS * FLATNESS * found.farthest();
    let (mut light, mut count) = ([0.0_f32; CELLS], 0.0);
    for (index, _) in found.iter() {
        let photon = indirect.photon(index);
        let off_plane = (photon.p - p).dot(n);
        if is_alike(photon.mark().normal(), n) && off_plane * off_plane <= flatness {
            light[cell_of(n, photon.mark().to_light())] += photon.mark().power().element_sum();
            count += 1.0;
        }
    }
    let all: f32 = light.iter().sum();
    (count >= GATHERED_MIN && all > 0.0 && all.is_finite()).then(|| light.map(|light| light / all))
}

/// Returns the relative variance of the light over the cells.
fn unevenness(light: &[f32; CELLS]) -> f32 {
    light.iter().map(|light| light * light).sum::<f32>() * CELLS as f32 - 1.0
}

impl Shares {
    /// Creates the distribution.
    ///
    /// - `light`: share of the light from each cell.
    fn new(light: &[f32; CELLS]) -> Self {
        let wanted = light.map(|light| BLIND / CELLS as f32 + (1.0 - BLIND) * light);
        let rings: [f32; CELL_RINGS] =
            std::array::from_fn(|ring| wanted[ring * CELL_SECTORS..(ring + 1) * CELL_SECTORS].iter().sum());
        let sectors = std::array::from_fn(|ring| {
            summed(std::array::from_fn(|sector| wanted[ring * CELL_SECTORS + sector] / rings[ring]))
        });
        Self { rings: summed(rings), sectors }
    }
}

/// Returns the cumulative sums.
fn summed<const N: usize>(parts: [f32; N]) -> [u16; N] {
    let mut sum = 0.0;
    let mut summed = parts.map(|part| {
        sum += part;
        (WHOLE * sum).min(WHOLE) as u16
    });
    summed[N - 1] = WHOLE as u16;
    summed
}

/// Returns the entry that a number in [0, 1) falls into, and its position there, in [0, 1).
#[inline(always)]
fn chosen<const N: usize>(shares: &[u16; N], u: f32) -> (usize, f32) {
    let at = u * WHOLE;
    let part = shares.iter().filter(|&&share| f32::from(share) <= at).count().min(N - 1);
    let (below, share) = part_of(shares, part);
    (part, ((at - below) / share).clamp(0.0, 1.0 - f32::EPSILON))
}

/// Returns the sum of all entries before one, and its own share.
#[inline(always)]
fn part_of<const N: usize>(shares: &[u16; N], part: usize) -> (f32, f32) {
    let below = if part == 0 { 0 } else { shares[part - 1] };
    (f32::from(below), f32::from(shares[part] - below))
}

impl LightDirections<'_> {
    /// Share of the directions that this distribution draws at surfaces that are not matte; the BSDF draws the others.
    pub(crate) const SHARE: f32 = 0.5;

    /// Samples a unit direction; preserves stratification.
    #[inline(always)]
    pub(crate) fn sample(&self, [u, v]: [f32; 2]) -> Vec3 {
        let (ring, u) = chosen(&self.shares.rings, u);
        let (sector, v) = chosen(&self.shares.sectors[ring], v);
        let sine_squared = (ring as f32 + u) / CELL_RINGS as f32;
        let (sin, cos) = math::sin_cos(TAU * ((sector as f32 + v) / CELL_SECTORS as f32));
        let sine = sine_squared.sqrt();
        let [s, t, n] = self.frame;
        s * (cos * sine) + t * (sin * sine) + n * (1.0 - sine_squared).max(0.0).sqrt()
    }

    /// Returns the density of a unit direction, in sr⁻¹.
    #[inline(always)]
    pub(crate) fn pdf(&self, w: Vec3) -> f32 {
        let [x, y, z] = self.frame.map(|axis| axis.dot(w));
        if z <= 0.0 {
            return 0.0;
        }
        let ring = (((1.0 - z * z).max(0.0) * CELL_RINGS as f32) as usize).min(CELL_RINGS - 1);
        let turns = y.atan2(x) / TAU;
        let sector = (((turns + 1.0).fract() * CELL_SECTORS as f32) as usize).min(CELL_SECTORS - 1);
        let share = part_of(&self.shares.rings, ring).1 * part_of(&self.shares.sectors[ring], sector).1;
        share / (WHOLE * WHOLE) * (CELLS as f32 / PI) * z
    }

    /// Returns the density of a direction drawn by this distribution or by the BSDF.
    ///
    /// - `own`: density by the BSDF.
    /// - `is_matte`: `true`: all directions are drawn by this distribution.
    #[inline(always)]
    pub(crate) fn mixed(&self, w: Vec3, own: f32, is_matte: bool) -> f32 {
        if is_matte { self.pdf(w) } else { Self::SHARE * self.pdf(w) + (1.0 - Self::SHARE) * own }
    }
}

#[cfg(test)]
mod tests {
    use bottega_scene::Spectrum;
    use glam::Vec3Swizzles;

    use super::*;
    use crate::{
        bsdf::warp::{cosine_hemisphere, uniform_hemisphere},
        extent::Extent,
        photon::Photon,
        settings::PhotonSettings,
    };

    fn estimator() -> Estimator {
        Estimator::new(&PhotonSettings::default(), Extent { center: Vec3::ZERO, radius: 4.0, whole: 4.0 })
    }

    /// Photons on a sheet, most of them from one side.
    fn lit_from_a_side() -> Arrivals {
        let side = Vec3::new(0.8, 0.6, 0.0);
        let photon = |i: u32| {
            let at = |prime: u32| (i * prime % 4093) as f32 / 4093.0 - 0.5;
            let w = if i.is_multiple_of(4) { Vec3::new(at(31), 0.5, at(89)).normalize() } else { side };
            Photon::new(Vec3::new(at(7), 0.0, at(577)), w, Vec3::Y, Spectrum::ONE)
        };
        let map = PhotonMap::new((0..4000).map(photon).collect());
        Arrivals::new(&map, &estimator())
    }

    #[test]
    fn directions_are_as_dense_as_their_density_says() {
        let arrivals = lit_from_a_side();
        let arrival = arrivals.at(Vec3::ZERO, [Vec3::Y; 2], 1.0).expect("a place");
        let side = Vec3::new(0.8, 0.6, 0.0);
        let count = 1 << 14;
        let at = |i: u32, prime: u32| ((u64::from(i) * u64::from(prime) % 16381) as f32 + 0.5) / 16381.0;
        let drawn: Vec<Vec3> = (0..count).map(|i| arrival.sample([at(i, 1), at(i, 6007)])).collect();
        assert!(drawn.iter().all(|w| w.is_normalized() && w.y >= 0.0 && arrival.pdf(*w) > 0.0));
        let near = drawn.iter().filter(|w| cell_of(Vec3::Y, **w) == cell_of(Vec3::Y, side)).count();
        // Three quarters of the photons, without the blind share.
        let expected = 0.75 * (1.0 - BLIND);
        assert!((near as f32 / count as f32 - expected).abs() < 0.05, "{near}");
        // ∫ p dω = 1.
        let whole: f32 =
            (0..count).map(|i| arrival.pdf(uniform_hemisphere([at(i, 1), at(i, 6007)]).xzy())).sum::<f32>();
        assert!((whole * 2.0 * PI / count as f32 - 1.0).abs() < 0.03, "{}", whole * 2.0 * PI / count as f32);
        assert!((arrival.mixed(side, 0.2, false) - 0.5 * arrival.pdf(side) - 0.1).abs() < 1e-6);
        assert_eq!([false, true].map(|is_matte| arrival.mixed(Vec3::NEG_Y, 0.2, is_matte)), [0.1, 0.0]);
    }

    #[test]
    fn light_from_all_sides_is_not_worth_knowing() {
        let at = |i: u32, prime: u32| (i * prime % 4093) as f32 / 4093.0;
        let photon = |i: u32| {
            let w = cosine_hemisphere([at(i, 31), at(i, 577)]).xzy();
            Photon::new(Vec3::new(at(i, 7), 0.0, at(i, 1009)), w, Vec3::Y, Spectrum::ONE)
        };
        let map = PhotonMap::new((0..4000).map(photon).collect());
        let arrivals = Arrivals::new(&map, &estimator());
        assert!(arrivals.at(Vec3::splat(0.5), [Vec3::Y; 2], 1.0).is_none());
    }

    #[test]
    fn shared_distributions_are_the_same() {
        let arrivals = lit_from_a_side();
        let mut to = Writer::default();
        arrivals.write(&mut to);
        let read = Arrivals::read(&mut Reader(&to.0)).expect("what was written");
        assert_eq!(read.shares, arrivals.shares);
        assert!(arrivals.at(Vec3::ZERO, [Vec3::NEG_Y; 2], 1.0).is_none() && arrivals.memory_bytes() > 0);
        assert!(Arrivals::read(&mut Reader(&to.0[..to.0.len() - 4])).is_none());
    }
}
