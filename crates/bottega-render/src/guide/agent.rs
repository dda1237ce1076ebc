//! The knowledge of lighting agents beside directions: of each region which lights matter and are seen, and how much a path is
//! worth that comes there; of each part of the picture what it is worth to whoever looks at it.
//!
//! A path that comes to a region with throughput T goes on as q paths, q = T ∕ I · √(M ∕ C) ∕ √(V ∕ K): I is what its pixel
//! shows, M the mean square of what leaves the region (where q > 1, where paths are split, the variance), C the work that
//! takes, and V ∕ K the mean over all pixels of the same of the regions that they show, relative to I². That is what makes error times work least, if
//! all of these are right; the mean is the same whatever they are.
//!
//! Source: Rath et al. 2022, *EARS: Efficiency-Aware Russian Roulette and Splitting*, eqs. 17 and 18; Vorba and Křivánek
//! 2016, *Adjoint-Driven Russian Roulette and Splitting in Light Transport Simulation* (reciprocal of the pixel as measure).

use glam::Vec3;

use crate::lights::{CHOICE_NUMBERS, Choice};

/// Vertices from which a region's agent learns, at least.
const VERTICES_MIN: usize = 48;
/// What is so many times as bright as the mean counts as no brighter.
const OUTLIER: f32 = 40.0;

/// What is known of the surfaces of one region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Agent {
    /// Which lights matter, and are seen.
    lights: Option<Choice>,
    /// Root of the mean square of what leaves, over the work.
    strength: f32,
    /// Root of its variance, over the work.
    pub(super) noise: f32,
}

/// Numbers that an [`Agent`] is written down as.
pub(super) const NUMBERS: usize = 3 + CHOICE_NUMBERS;

/// What leaves a vertex of a path, by its greatest channel, and the work that it took.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepartingLight {
    pub(super) brightness: f32,
    pub(super) work: f32,
}

impl Agent {
    /// `None`: too little was seen.
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

    /// Which lights matter, and are seen.
    #[inline(always)]
    pub(crate) fn lights(&self) -> Option<&Choice> {
        self.lights.as_ref()
    }

    /// As how many paths one is to go on that comes with this throughput, in units of what its pixel is worth.
    #[inline(always)]
    pub(crate) fn worth(&self, throughput: f32) -> f32 {
        let many = throughput * self.noise;
        if many > 1.0 { many } else { (throughput * self.strength).min(1.0) }
    }

    pub(super) fn to_numbers(self) -> [u32; NUMBERS] {
        let mut numbers = [0; NUMBERS];
        numbers[..2].copy_from_slice(&[self.strength, self.noise].map(f32::to_bits));
        if let Some(lights) = self.lights {
            numbers[2] = 1;
            numbers[3..].copy_from_slice(&lights.to_numbers());
        }
        numbers
    }

    /// The other way round. `None`: they are none.
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

/// A path from the eye.
#[derive(Clone, Copy, Debug)]
pub(super) struct EyePath {
    /// Where in the picture, in [0, 1)².
    pub(super) place: [f32; 2],
    /// Its greatest channel.
    pub(super) brightness: f32,
    /// Where it first could have gone elsewhere, if anywhere: place, normal, and the greatest channel of what it carried.
    pub(super) first: Option<(Vec3, Vec3, f32)>,
}

/// What the parts of the picture are worth: 1 ∕ (I √(V ∕ K)), see the [module](self).
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PictureWorth {
    pub(super) columns: u32,
    pub(super) rows: u32,
    pub(super) worth: Vec<f32>,
}

impl PictureWorth {
    pub(super) fn part(&self, [x, y]: [f32; 2]) -> usize {
        let along = |place: f32, count: u32| ((place * count as f32) as u32).min(count.saturating_sub(1));
        (along(y, self.rows) * self.columns + along(x, self.columns)) as usize
    }

    /// What a unit of light is worth at a place in the picture, in [0, 1)²; 0 where nobody knows.
    #[inline(always)]
    pub(crate) fn at(&self, place: [f32; 2]) -> f32 {
        self.worth.get(self.part(place)).copied().unwrap_or(0.0)
    }

    /// Columns, rows, and what each part is worth.
    pub(super) fn parts(&self) -> (u32, u32, &[f32]) {
        (self.columns, self.rows, &self.worth)
    }

    /// The other way round. `None`: they are none.
    pub(super) fn from_parts(columns: u32, rows: u32, worth: Vec<f32>) -> Option<Self> {
        let count = u64::from(columns) * u64::from(rows);
        let is_sound = worth.iter().all(|worth| worth.is_finite() && *worth >= 0.0);
        (is_sound && worth.len() as u64 == count).then_some(Self { columns, rows, worth })
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.worth)
    }
}
