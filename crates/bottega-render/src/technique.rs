//! The techniques of a picture's zones: paths, or photons with final gathering.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::{
    photon::bytes::{ByteForm, Reader, Writer},
    settings::{PathSettings, PhotonSettings, View},
};

/// Samples of a picture per photon of the trial: casting then takes a few percent of the time of the picture.
const SAMPLES_PER_TRIED_PHOTON: u64 = 50;
/// The least number of photons that are tried: fewer make blurred maps.
const PHOTONS_MIN: u64 = 20_000;
/// Samples of a picture per photon, if photons render some of its zones.
const SAMPLES_PER_PHOTON: u64 = 5;
/// Number of plans kept.
const PLANS_MAX: usize = 4;

/// The result of the trial for a picture or for one of its zones, from which a [`TechniqueJudge`] decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TechniqueEvidence {
    /// log₂ of the error times work of paths over that of photons: 1 if photons are twice as good. Geometric mean of two
    /// measures of the error: relative, and as a display shows it.
    pub gain: f64,
    /// The same by the measure that is worse for photons.
    pub worse_gain: f64,
    /// Light that paths find over the light that photons find, at most 1. Paths that miss light cannot judge photons.
    pub found: f64,
    /// Relative squared error of paths in the trial.
    pub noise: f64,
    /// The technique of the picture, `true` for photons, if one of its zones is judged; `None`: the picture is.
    pub picture: Option<bool>,
}

/// Rules that choose the technique of zones.
pub trait TechniqueJudge: Send + Sync {
    /// Returns the preferred technique: photons above 0, paths at or below 0. It depends on the evidence alone, so that all
    /// machines choose alike.
    fn preference(&self, evidence: &TechniqueEvidence) -> f64;
}

/// The technique of each zone of a picture, in a grid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TechniquePlan {
    columns: u32,
    rows: u32,
    /// `true`: photons; `false`: paths.
    by_photons: Vec<bool>,
}

impl TechniquePlan {
    /// Creates a plan; `None`: the number of zones is not columns times rows, or 0.
    pub(crate) fn new(columns: u32, rows: u32, by_photons: Vec<bool>) -> Option<Self> {
        let count = u64::from(columns) * u64::from(rows);
        (count > 0 && count == by_photons.len() as u64).then_some(Self { columns, rows, by_photons })
    }

    /// Creates a plan with one technique for the whole picture.
    ///
    /// - `by_photons`: `true`: photons; `false`: paths.
    pub(crate) fn whole(by_photons: bool) -> Self {
        Self { columns: 1, rows: 1, by_photons: vec![by_photons] }
    }

    /// Returns the index of the zone of a position in the picture, in [0, 1)².
    #[inline(always)]
    pub(crate) fn zone([columns, rows]: [u32; 2], [x, y]: [f32; 2]) -> usize {
        let along = |place: f32, count: u32| ((place * count as f32) as u32).min(count.saturating_sub(1));
        (along(y, rows) * columns + along(x, columns)) as usize
    }

    /// Returns `true` if photons render a position in the picture, in [0, 1)².
    #[inline(always)]
    pub(crate) fn is_by_photons(&self, place: [f32; 2]) -> bool {
        self.by_photons[Self::zone([self.columns, self.rows], place)]
    }

    /// Returns the technique of the whole picture, `true` for photons; `None`: zones differ.
    pub(crate) fn only(&self) -> Option<bool> {
        let first = self.by_photons[0];
        self.by_photons.iter().all(|&it| it == first).then_some(first)
    }

    /// Returns the number of zones that photons render, and that of all zones.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [self.by_photons.iter().filter(|&&it| it).count(), self.by_photons.len()]
    }
}

impl ByteForm for TechniquePlan {
    fn write(&self, to: &mut Writer) {
        to.number(self.columns);
        to.number(self.rows);
        self.by_photons.iter().for_each(|&it| to.number(u32::from(it)));
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        /// Greatest number of zones that is read.
        const ZONES_MAX: u64 = 1 << 16;
        let (columns, rows) = (from.number()?, from.number()?);
        let count = u64::from(columns) * u64::from(rows);
        if count > ZONES_MAX {
            return None;
        }
        let by_photons: Option<Vec<bool>> = (0..count).map(|_| Some(from.number()? != 0)).collect();
        Self::new(columns, rows, by_photons?)
    }
}

/// The photons of a picture whose zones try them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriedPhotons {
    /// Those of the trial.
    pub(crate) trial: PhotonSettings,
    /// Those of the zones that photons render.
    pub(crate) zones: PhotonSettings,
}

impl TriedPhotons {
    /// Returns the photons of a picture; `None`: it has too few samples for photons to pay off.
    pub(crate) fn of(view: &View, settings: &PathSettings) -> Option<Self> {
        let photons = settings.photons.filter(|_| settings.tries_photons)?;
        let samples = view.pixel_count() * u64::from(settings.planned_samples);
        let affordable = samples / SAMPLES_PER_TRIED_PHOTON;
        let at_most = |count: u64| PhotonSettings { count: u64::from(photons.count).min(count) as u32, ..photons };
        (affordable >= PHOTONS_MIN)
            .then(|| Self { trial: at_most(affordable), zones: at_most(samples / SAMPLES_PER_PHOTON) })
    }
}

/// The view and settings that a plan depends on. It also depends on the scene.
type PlanKey = (View, PathSettings);

/// A plan, filled by its first user while others wait.
type PlanPlace = Arc<OnceLock<Arc<TechniquePlan>>>;

/// The plans of some pictures of a scene.
#[derive(Default)]
pub(crate) struct TechniqueStore(Mutex<Vec<(PlanKey, PlanPlace)>>);

impl TechniqueStore {
    /// Returns the place of a picture's plan. Depth and light samples, which zones change, are no part of the key.
    pub(crate) fn place(&self, view: &View, settings: &PathSettings) -> PlanPlace {
        let usual = PathSettings::default();
        let settings = PathSettings { max_depth: usual.max_depth, light_samples: usual.light_samples, ..*settings };
        let key = (view.clone(), settings);
        let mut plans = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, place)) = plans.iter().find(|(known, _)| *known == key) {
            return Arc::clone(place);
        }
        if plans.len() == PLANS_MAX {
            plans.remove(0);
        }
        let place = PlanPlace::default();
        plans.push((key, Arc::clone(&place)));
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_survive_their_bytes_and_damaged_ones_are_refused() {
        let plan = TechniquePlan::new(2, 2, vec![true, false, false, true]).unwrap();
        let mut bytes = Writer(Vec::new());
        plan.write(&mut bytes);
        assert_eq!(TechniquePlan::read(&mut Reader(&bytes.0)), Some(plan.clone()));
        assert_eq!(TechniquePlan::read(&mut Reader(&bytes.0[..11])), None);
        assert_eq!(TechniquePlan::read(&mut Reader(&[0; 8])), None);
        assert_eq!((plan.only(), TechniquePlan::whole(true).only()), (None, Some(true)));
        assert_eq!([[0.1, 0.1], [0.9, 0.1], [1.0, 1.0]].map(|at| plan.is_by_photons(at)), [true, false, true]);
        assert_eq!(plan.counts(), [2, 4]);
    }
}
