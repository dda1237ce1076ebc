//! Indirect light at a place by direction, as the records around it tell it.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::IrradianceRecord;

/// Most records that are asked where light comes from.
const SPEAKERS: usize = 6;
/// Most by which the light of their directions is brought to the irradiance between them.
const SCALE_MAX: f32 = 4.0;
/// Records that are heard about a place: those that count most.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Speakers<'a>([Option<(&'a IrradianceRecord, f32)>; SPEAKERS]);

/// Records that speak for a place, by how much they count: indirect light there by direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surroundings<'a> {
    records: [Option<(&'a IrradianceRecord, f32)>; SPEAKERS],
    /// By how much their light is brought to the irradiance at the place.
    scale: Spectrum,
}

impl<'a> Speakers<'a> {
    /// Keeps a record if it counts more than one of those that are kept, in its place.
    pub(super) fn hear(&mut self, record: &'a IrradianceRecord, weight: f32) {
        let heaviness = |it: &Option<(&IrradianceRecord, f32)>| it.map_or(-1.0, |(_, weight)| weight);
        let lightest = self.0.iter_mut().min_by(|a, b| heaviness(a).total_cmp(&heaviness(b)));
        if let Some(lightest) = lightest.filter(|it| heaviness(it) < weight) {
            *lightest = Some((record, weight));
        }
    }

    /// What they tell together.
    ///
    /// - `irradiance`: at the place.
    pub(super) fn told(self, irradiance: Spectrum) -> Surroundings<'a> {
        let mut records = self.0;
        let weights: f32 = records.iter().flatten().map(|&(_, weight)| weight).sum();
        records.iter_mut().flatten().for_each(|(_, weight)| *weight /= weights);
        let light: Spectrum = records.iter().flatten().map(|&(record, weight)| record.irradiance * weight).sum();
        let scale = irradiance / light.max(Spectrum::splat(f32::MIN_POSITIVE));
        Surroundings { records, scale: scale.min(Spectrum::splat(SCALE_MAX)) }
    }
}

impl Surroundings<'_> {
    /// Indirect radiance from about a unit direction.
    #[inline(always)]
    pub(crate) fn radiance(&self, w: Vec3) -> Spectrum {
        let from = |&(record, weight): &(&IrradianceRecord, f32)| match &record.around {
            Some(around) => around.from(record.n, w) * weight,
            None => Spectrum::ZERO,
        };
        self.records.iter().flatten().map(from).sum::<Spectrum>() * self.scale
    }
}
