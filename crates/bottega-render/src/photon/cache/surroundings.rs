//! Indirect light at a point by direction, interpolated between irradiance records.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::IrradianceRecord;

/// Greatest number of records that are interpolated.
const RECORDS_MAX: usize = 6;
/// Greatest factor by which their light is scaled to the interpolated irradiance.
const SCALE_MAX: f32 = 4.0;
/// The records with the greatest weights at a point.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StrongestRecords<'a>([Option<(&'a IrradianceRecord, f32)>; RECORDS_MAX]);

/// Indirect light at a point by direction, interpolated between records with their weights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surroundings<'a> {
    records: [Option<(&'a IrradianceRecord, f32)>; RECORDS_MAX],
    /// Factor that scales the records' light to the irradiance at the point.
    scale: Spectrum,
}

impl<'a> StrongestRecords<'a> {
    /// Keeps a record if it has a greater weight than one of those kept, in place of the lightest.
    pub(super) fn insert(&mut self, record: &'a IrradianceRecord, weight: f32) {
        let heaviness = |it: &Option<(&IrradianceRecord, f32)>| it.map_or(-1.0, |(_, weight)| weight);
        let lightest = self.0.iter_mut().min_by(|a, b| heaviness(a).total_cmp(&heaviness(b)));
        if let Some(lightest) = lightest.filter(|it| heaviness(it) < weight) {
            *lightest = Some((record, weight));
        }
    }

    /// Returns the interpolated light.
    ///
    /// - `irradiance`: at the point.
    pub(super) fn finish(self, irradiance: Spectrum) -> Surroundings<'a> {
        let mut records = self.0;
        let weights: f32 = records.iter().flatten().map(|&(_, weight)| weight).sum();
        records.iter_mut().flatten().for_each(|(_, weight)| *weight /= weights);
        let light: Spectrum = records.iter().flatten().map(|&(record, weight)| record.irradiance * weight).sum();
        let scale = irradiance / light.max(Spectrum::splat(f32::MIN_POSITIVE));
        Surroundings { records, scale: scale.min(Spectrum::splat(SCALE_MAX)) }
    }
}

impl Surroundings<'_> {
    /// Returns the indirect radiance from a unit direction, averaged over a cell.
    #[inline(always)]
    pub(crate) fn radiance(&self, w: Vec3) -> Spectrum {
        let from = |&(record, weight): &(&IrradianceRecord, f32)| match &record.around {
            Some(around) => around.from(record.n, w) * weight,
            None => Spectrum::ZERO,
        };
        self.records.iter().flatten().map(from).sum::<Spectrum>() * self.scale
    }
}
