//! Indirect light at a point by direction, in cells of the hemisphere.

use std::f32::consts::TAU;

use bottega_scene::Spectrum;
use glam::Vec3;

use super::record::{of_shared_exponent, shared_exponent};
use crate::sampling::orthonormal_basis;

/// Rings of ray directions, from the normal to the horizon.
pub(crate) const RINGS: usize = 10;
/// Sectors of ray directions per ring.
pub(crate) const SECTORS: usize = 32;
/// Rings and sectors of rays per cell: small enough for detail, with enough rays for a mean.
const RINGS_JOINED: usize = 2;
const SECTORS_JOINED: usize = 4;
/// Rings of cells.
pub(crate) const CELL_RINGS: usize = RINGS / RINGS_JOINED;
/// Sectors of cells per ring.
pub(crate) const CELL_SECTORS: usize = SECTORS / SECTORS_JOINED;
/// Cells of the hemisphere, which have equal cosine-weighted solid angles.
pub(crate) const CELLS: usize = CELL_RINGS * CELL_SECTORS;

/// The result of a gathering ray.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct GatherSample {
    /// Radiance that the ray found.
    pub(crate) radiance: Spectrum,
    /// Distance to the hit; infinite: nothing hit.
    pub(crate) distance: f32,
}

/// Mean radiance from each cell of the hemisphere above a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CellsAround([u32; CELLS]);

impl CellsAround {
    /// Averages the samples of a record's rays, in the order of [`direction`](super::cache::direction).
    pub(crate) fn new(looks: &[GatherSample]) -> Self {
        let mean = |cell: usize| {
            let (ring, sector) = (cell / CELL_SECTORS * RINGS_JOINED, cell % CELL_SECTORS * SECTORS_JOINED);
            let rings = (ring..ring + RINGS_JOINED).map(|ring| ring * SECTORS + sector);
            let sum: Spectrum =
                rings.flat_map(|first| &looks[first..first + SECTORS_JOINED]).map(|it| it.radiance).sum();
            sum / (RINGS_JOINED * SECTORS_JOINED) as f32
        };
        Self(std::array::from_fn(|cell| shared_exponent(mean(cell))))
    }

    /// Returns the mean radiance around a unit direction; below the horizon that of just above it.
    ///
    /// - `n`: normal of the record.
    #[inline(always)]
    pub(crate) fn from(&self, n: Vec3, w: Vec3) -> Spectrum {
        of_shared_exponent(self.0[cell_of(n, w)])
    }

    /// Returns the irradiance by all cells.
    #[cfg(test)]
    fn irradiance(&self) -> Spectrum {
        self.0.iter().map(|&cell| of_shared_exponent(cell)).sum::<Spectrum>() * (std::f32::consts::PI / CELLS as f32)
    }

    /// Returns the packed form.
    pub(crate) fn to_numbers(self) -> [u32; CELLS] {
        self.0
    }

    /// Returns the cells of a packed form.
    pub(crate) fn from_numbers(numbers: [u32; CELLS]) -> Self {
        Self(numbers)
    }
}

/// Returns the cell of a unit direction.
#[inline(always)]
pub(crate) fn cell_of(n: Vec3, w: Vec3) -> usize {
    let (s, t) = orthonormal_basis(n);
    let cosine = w.dot(n).max(0.0);
    let ring = (((1.0 - cosine * cosine) * CELL_RINGS as f32) as usize).min(CELL_RINGS - 1);
    let turns = w.dot(t).atan2(w.dot(s)) / TAU;
    let sector = ((turns + 1.0).fract() * CELL_SECTORS as f32) as usize;
    ring * CELL_SECTORS + sector.min(CELL_SECTORS - 1)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::{super::cache::direction, *};
    use crate::photon::cache::RAYS;

    fn looks(n: Vec3, radiance: impl Fn(Vec3) -> Spectrum) -> Vec<GatherSample> {
        (0..RAYS).map(|i| GatherSample { radiance: radiance(direction(n, i, [0.5, 0.5])), distance: 1.0 }).collect()
    }

    const NORMALS: [Vec3; 3] = [Vec3::Y, Vec3::NEG_Z, Vec3::new(0.6, 0.0, -0.8)];

    #[test]
    fn every_ray_falls_into_the_cell_that_it_was_counted_for() {
        for n in NORMALS {
            for ray in 0..RAYS as usize {
                let mut found = vec![GatherSample::default(); RAYS as usize];
                found[ray].radiance = Vec3::new(8.0, 4.0, 0.0);
                let around = CellsAround::new(&found);
                for u in [[0.01, 0.01], [0.5, 0.5], [0.99, 0.99]] {
                    let w = direction(n, ray as u32, u);
                    assert!((around.from(n, w) - Vec3::new(1.0, 0.5, 0.0)).length() < 0.01, "{n} {ray} {u:?}");
                }
            }
        }
    }

    #[test]
    fn the_light_of_all_cells_is_the_irradiance() {
        for n in NORMALS {
            // ∫ (1 + w·x) cos dω = π (1 + 2∕3 n·x): what comes from the side cancels.
            let light = |w: Vec3| Vec3::new(1.0 + w.x, 2.0, 0.0);
            let expected = PI * Vec3::new(1.0 + 2.0 / 3.0 * n.x, 2.0, 0.0);
            let found = CellsAround::new(&looks(n, light)).irradiance();
            assert!((found - expected).abs().max_element() < 0.02 * PI, "{n}: {found} {expected}");
        }
    }

    #[test]
    fn light_read_by_direction_is_the_light_from_there() {
        let n = Vec3::Y;
        let around = CellsAround::new(&looks(n, |w| Vec3::splat(if w.x > 0.0 { 3.0 } else { 1.0 })));
        assert!((around.from(n, Vec3::new(0.8, 0.6, 0.0)) - 3.0).length() < 0.02);
        assert!((around.from(n, Vec3::new(-0.8, 0.6, 0.0)) - 1.0).length() < 0.01);
        // Below the horizon: the light from just above it.
        assert!((around.from(n, Vec3::new(0.8, -0.6, 0.0)) - 3.0).length() < 0.02);
    }
}
