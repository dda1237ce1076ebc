//! Smoothed noise estimates of irradiance records.
//!
//! Where light comes from a small bright source, a record whose rays missed it seems certain and is too dark, and a
//! record whose rays hit it seems noisy and is too bright. Trusting each record's own variance prefers the dark ones.
//! So the records in a neighbourhood share one estimate.

use glam::Vec3;
use rayon::prelude::*;

use super::{EFFORT_MAX, IrradianceCache, IrradianceRecord};
use crate::{
    color::luminance,
    photon::{Nearest, Photon, PhotonMap, is_alike},
};

/// Records in a neighbourhood.
const TOGETHER: usize = 64;
/// Least number of them without a wall between; then only those count, as light differs behind walls.
const CLEAR_MIN: f32 = 16.0;

impl IrradianceCache {
    /// Estimates the noise of each record from its neighbours, on the current thread pool.
    ///
    /// - `new`: records that are not in the cache yet.
    pub(crate) fn tell_noise(&mut self, new: &mut [IrradianceRecord]) {
        let all: Vec<&IrradianceRecord> = self.records.iter().chain(&*new).collect();
        let place = |(record, index): (&IrradianceRecord, u32)| Photon::tagged(record.p, record.n, record.n, index);
        let tree = PhotonMap::new(all.iter().copied().zip(0..).map(place).collect());
        let faint = self.faint();
        let noise = |found: &mut Nearest, record: &&IrradianceRecord| {
            tree.nearest(record.p, f32::INFINITY, found);
            let near = found.iter().map(|(number, _)| all[tree.mark(number).tag() as usize]);
            let near = near.filter(|other| is_alike(other.n, record.n));
            let [mut all, mut clear] = [(0.0, 0.0, 0.0); 2];
            for other in near {
                let add = |(variance, light, count): &mut (f32, f32, f32)| {
                    *variance += other.variance * other.effort as f32;
                    *light += luminance(other.irradiance);
                    *count += 1.0;
                };
                add(&mut all);
                if record.is_clear(other.p - record.p) {
                    add(&mut clear);
                }
            }
            let (variance, light, count) = if clear.2 >= CLEAR_MIN { clear } else { all };
            let light = light.max(faint * count);
            if variance > 0.0 { variance * count / (light * light * record.effort as f32) } else { 0.0 }
        };
        let noises: Vec<f32> = all.par_iter().map_init(|| Nearest::new(TOGETHER), noise).collect();
        self.records.iter_mut().chain(new).zip(noises).for_each(|(record, noise)| record.noise = noise);
    }

    /// Returns the number of rays per cell that brings the noise at a point below `error`, by the records near it.
    pub(crate) fn effort_for(&self, p: Vec3, n: Vec3, error: f32) -> u32 {
        let (mut noise, mut count) = (0.0, 0.0);
        self.visit(p, |record| {
            if record.nearness(p, n, self.tolerance) > 0.0 {
                noise += record.noise * record.effort as f32;
                count += 1.0;
            }
        });
        let wanted = noise / (count * error * error).max(f32::MIN_POSITIVE);
        (wanted.clamp(1.0, EFFORT_MAX as f32).round() as u32).next_power_of_two()
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;
    use crate::photon::cache::{GatherSample, Measurement, RAYS};

    /// Records along a line, of which every second one has found a small bright place.
    fn some_find_it(effort: u32) -> IrradianceCache {
        let mut cache = IrradianceCache::new(Vec3::splat(-1.0), 70.0, 0.3);
        let mut records: Vec<IrradianceRecord> = (0..64)
            .map(|i| {
                let look = |ray: u32| {
                    let radiance = if i % 2 == 0 && ray == 40 { Vec3::splat(2.0 * RAYS as f32) } else { Vec3::ZERO };
                    GatherSample { radiance, distance: 1.0 }
                };
                let found = Measurement::new((0..RAYS * effort).map(look).collect(), effort);
                IrradianceRecord::new(Vec3::X * i as f32, Vec3::Y, &found, [1e-3, 10.0])
            })
            .collect();
        cache.tell_noise(&mut records);
        records.into_iter().for_each(|record| cache.add(record));
        cache
    }

    #[test]
    fn records_without_light_are_as_uncertain_as_those_with_it() {
        for effort in [1, 4] {
            let cache = some_find_it(effort);
            let noise: Vec<f32> = cache.records.iter().map(|record| record.noise).collect();
            assert!(noise.iter().all(|&it| it == noise[0]), "{noise:?}");
            // Half of them found one ray that weighs 2, where 1 is right: as many of a Poisson distribution have a relative variance
            // of 2.
            let mean = cache.records.iter().map(|record| luminance(record.irradiance)).sum::<f32>() / 64.0;
            assert!((mean * effort as f32 / PI - 1.0).abs() < 1e-3, "{mean}");
            assert!((noise[0] / 2.0 - 1.0).abs() < 0.01, "{effort}: {}", noise[0]);
        }
    }

    #[test]
    fn more_rays_are_requested_where_it_is_noisy() {
        let cache = some_find_it(1);
        assert_eq!(cache.effort_for(Vec3::X, Vec3::Y, 0.1), EFFORT_MAX);
        assert_eq!(cache.effort_for(Vec3::X, Vec3::Y, 2.0), 1);
        assert_eq!(cache.effort_for(Vec3::X, Vec3::Y, 1.1), 2);
        assert_eq!(cache.effort_for(Vec3::Z * 20.0, Vec3::Y, 0.1), 1, "nobody knows");
    }
}
