//! Lighting agents of the guide: for each region of surfaces the lights that matter and are visible, and data for
//! roulette and splitting; for each part of the picture its importance.
//!
//! A path that arrives in a region with throughput T continues as q paths on average, q = T ∕ I · √(M ∕ C) ∕ √(V ∕ K).
//! I is the brightness of its pixel; M the mean square of the light that leaves the region, or its variance where q > 1
//! (splitting); C the work of finding it; V ∕ K the mean of the same over all pixels for the regions that they show,
//! relative to I². This minimizes error times work if all of these are right; the picture's mean is right in any case.
//!
//! Source: Rath et al. 2022, *EARS: Efficiency-Aware Russian Roulette and Splitting*, eqs. 17 and 18; Vorba and
//! Křivánek 2016, *Adjoint-Driven Russian Roulette and Splitting in Light Transport Simulation* (reciprocal of the
//! pixel as measure).

use std::slice;

use bottega_kernels::prefetch;
use glam::Vec3;

use crate::lights::{CHOICE_NUMBERS, Choice};

/// Least number of vertices that a region's agent is learned from.
const VERTICES_MIN: usize = 48;
/// Greatest brightness, relative to the mean; brighter values are clamped to it.
const OUTLIER: f32 = 40.0;

/// The agent of one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct RegionAgent {
    /// Learned choice of lights; `None`: none was learned.
    lights: Option<Choice>,
    /// Root of the mean square of the light that leaves, divided by the work.
    strength: f32,
    /// Standard deviation of that light, divided by the work.
    pub(super) noise: f32,
}

/// Size of a [`RegionAgent`] in its byte form, in numbers.
pub(super) const NUMBERS: usize = 3 + CHOICE_NUMBERS;

/// Light that leaves a vertex of a path, by its greatest channel, and the work of finding it.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepartingLight {
    /// Greatest channel of the light, relative to the throughput on arrival.
    pub(super) brightness: f32,
    /// Work of finding the light, in vertices.
    pub(super) work: f32,
}

impl RegionAgent {
    /// Learns an agent. `None`: too few vertices.
    pub(super) fn new(left: impl Iterator<Item = DepartingLight> + Clone, lights: Option<Choice>) -> Option<Self> {
        let count = left.clone().count();
        if count < VERTICES_MIN {
            return None;
        }
        let share = 1.0 / count as f64;
        let mean = left.clone().map(|left| f64::from(left.brightness)).sum::<f64>() * share;
        let work = left.clone().map(|left| f64::from(left.work)).sum::<f64>() * share;
        let most = mean * f64::from(OUTLIER);
        let square = left.map(|left| f64::from(left.brightness).min(most).powi(2)).sum::<f64>() * share;
        let root = |square: f64| (square.max(0.0) / work.max(1.0)).sqrt() as f32;
        let (strength, noise) = (root(square), root(square - mean * mean));
        (strength.is_finite() && noise.is_finite()).then_some(Self { lights, strength, noise })
    }

    /// Prefetches what a path reads first.
    #[inline(always)]
    pub(crate) fn request(&self) {
        prefetch(slice::from_ref(&self.lights), 0);
        prefetch(slice::from_ref(&self.noise), 0);
    }

    /// Returns the learned choice of lights; `None`: none was learned.
    #[inline(always)]
    pub(crate) fn lights(&self) -> Option<&Choice> {
        self.lights.as_ref()
    }

    /// Returns the expected number of branches of a path that arrives.
    ///
    /// - `throughput`: greatest channel, times the importance of light to the pixel.
    #[inline(always)]
    pub(crate) fn worth(&self, throughput: f32) -> f32 {
        let many = throughput * self.noise;
        if many > 1.0 { many } else { (throughput * self.strength).min(1.0) }
    }

    /// Returns the byte form.
    pub(super) fn to_numbers(self) -> [u32; NUMBERS] {
        let mut numbers = [0; NUMBERS];
        numbers[..2].copy_from_slice(&[self.strength, self.noise].map(f32::to_bits));
        if let Some(lights) = self.lights {
            numbers[2] = 1;
            numbers[3..].copy_from_slice(&lights.to_numbers());
        }
        numbers
    }

    /// Reads the byte form. `None`: not a valid agent.
    pub(super) fn from_numbers(numbers: &[u32; NUMBERS]) -> Option<Self> {
        let [strength, noise] = [numbers[0], numbers[1]].map(f32::from_bits);
        let lights = match numbers[2] {
            0 => None,
            1 => Some(Choice::from_numbers(numbers[3..].first_chunk()?)?),
            _ => return None,
        };
        let is_sound = |number: f32| number.is_finite() && number >= 0.0;
        (is_sound(strength) && is_sound(noise)).then_some(Self { lights, strength, noise })
    }
}

/// A traced camera path.
#[derive(Clone, Copy, Debug)]
pub(super) struct TracedPath {
    /// Position in the picture, in [0, 1)².
    pub(super) place: [f32; 2],
    /// Greatest channel of its radiance.
    pub(super) brightness: f32,
    /// Its first vertex on a surface that is not specular: position, normal, and greatest channel of the throughput;
    /// `None`: it has none.
    pub(super) first: Option<(Vec3, Vec3, f32)>,
}

/// Importance of the parts of a picture: 1 ∕ (I √(V ∕ K)), see the [module](self).
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PictureWorth {
    /// Number of columns.
    pub(super) columns: u32,
    /// Number of rows.
    pub(super) rows: u32,
    /// Importance of each part, row-major; empty: unknown.
    pub(super) worth: Vec<f32>,
}

impl PictureWorth {
    /// Returns the index of the part of a position in the picture, in [0, 1)².
    pub(super) fn part(&self, [x, y]: [f32; 2]) -> usize {
        let along = |place: f32, count: u32| ((place * count as f32) as u32).min(count.saturating_sub(1));
        (along(y, self.rows) * self.columns + along(x, self.columns)) as usize
    }

    /// Returns the importance of a unit of light at a position in the picture, in [0, 1)²; 0: unknown.
    #[inline(always)]
    pub(crate) fn at(&self, place: [f32; 2]) -> f32 {
        self.worth.get(self.part(place)).copied().unwrap_or(0.0)
    }

    /// Returns columns, rows, and the importance of each part.
    pub(super) fn parts(&self) -> (u32, u32, &[f32]) {
        (self.columns, self.rows, &self.worth)
    }

    /// Reads the parts. `None`: not valid.
    pub(super) fn from_parts(columns: u32, rows: u32, worth: Vec<f32>) -> Option<Self> {
        let count = u64::from(columns) * u64::from(rows);
        let is_sound = worth.iter().all(|worth| worth.is_finite() && *worth >= 0.0);
        (is_sound && worth.len() as u64 == count).then_some(Self { columns, rows, worth })
    }

    /// Returns the memory, in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.worth)
    }
}
