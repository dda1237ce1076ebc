//! How noisy records are to be expected to be.
//!
//! Where light comes from a small bright place, a record whose rays missed it looks sure and is too dark, and one whose rays
//! found it looks noisy and is too bright. Who went by the noise that each record has found itself would take the dark ones and
//! leave the bright ones. So those around a place tell together how noisy each of them is.

use glam::Vec3;
use rayon::prelude::*;

use super::{EFFORT_MAX, IrradianceCache, Record};
use crate::{
    luminance,
    photon::{Nearest, Photon, PhotonMap, is_alike},
};

/// Records that tell together.
const TOGETHER: usize = 64;

impl IrradianceCache {
    /// Lets each record be told by those nearest to it how noisy it is, on the threads of the present pool.
    ///
    /// - `new`: records that are not kept yet.
    pub(crate) fn tell_noise(&mut self, new: &mut [Record]) {
        let all: Vec<&Record> = self.records.iter().chain(&*new).collect();
        let place = |(record, index): (&Record, u32)| Photon::tagged(record.p, record.n, record.n, index);
        let tree = PhotonMap::new(all.iter().copied().zip(0..).map(place).collect());
        let faint = self.faint();
        let noise = |found: &mut Nearest, record: &&Record| {
            tree.nearest(record.p, f32::INFINITY, found);
            let near = found.iter().map(|(number, _)| all[tree.mark(number).tag() as usize]);
            let near = near.filter(|other| is_alike(other.n, record.n));
            let (mut variance, mut light, mut count) = (0.0, 0.0, 0.0);
            for other in near {
                variance += other.variance * other.effort as f32;
                light += luminance(other.irradiance);
                count += 1.0;
            }
            let light = light.max(faint * count);
            if variance > 0.0 { variance * count / (light * light * record.effort as f32) } else { 0.0 }
        };
        let told: Vec<f32> = all.par_iter().map_init(|| Nearest::new(TOGETHER), noise).collect();
        self.records.iter_mut().chain(new).zip(told).for_each(|(record, noise)| record.noise = noise);
    }

    /// How many rays to a cell bring the noise at a place below an error, as far as is known of it.
    pub(crate) fn effort_for(&self, p: Vec3, n: Vec3, error: f32) -> u32 {
        let (mut noise, mut count) = (0.0, 0.0);
        self.visit(p, |record| {
            if record.nearness(p, n, self.tolerance) > 0.0 {
                noise += record.noise * record.effort as f32;
                count += 1.0;
            }
        });
        let wanted = noise / (count * error * error).max(f32::MIN_POSITIVE);
        if wanted > 1.0 { (wanted.min(EFFORT_MAX as f32) as u32).next_power_of_two().min(EFFORT_MAX) } else { 1 }
    }
}
