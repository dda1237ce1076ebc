//! The map of a swarm, and the oracle that is asked while the picture is painted (§4.4).

use std::sync::Arc;

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    paper,
    report::{AgentReport, Tallies, Tally},
    visibility::{ShadowVerdict, Visibility},
};
use crate::{
    AgentSettings,
    extent::Extent,
    photon::{
        BounceShares, Nearest, Photon, PhotonMap,
        cache::{Estimate, IrradianceCache, IrradianceRecord, Surroundings},
    },
    prepare::PreparedScene,
};

/// Greatest radius of a record, in radii of what is seen.
const SHARE_MAX: f32 = 0.5;
/// How much greater than the error that is borne that of a few gathering rays is: where records are no worse they are taken.
const GATHERED: f32 = 3.0;
/// How great it may be, beside the one that is borne, where the edge of what a record says is not seen.
const SURE: f32 = 0.5;
/// How many records must speak for a place, so that none measures there.
const RECORDS_MIN: f32 = 1.5;
/// How much farther than an agent looks around its word goes, at least.
const REACH_MIN: f32 = 0.6;

/// Agents after they have looked around.
#[derive(Debug)]
pub(crate) struct Agents {
    pub(super) settings: AgentSettings,
    pub(super) visibility: Arc<Visibility>,
    pub(super) indirect: Indirect,
    pub(super) report: AgentReport,
    pub(super) tallies: Tallies,
}

/// What agents say of the irradiance at a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KnownIrradiance {
    pub(crate) irradiance: Spectrum,
    /// How much of it is to be taken, in (0, 1]: the rest is to be computed.
    pub(crate) share: f32,
}

/// What is known of the indirect light.
#[derive(Clone, Debug)]
pub(super) enum Indirect {
    /// As in the paper.
    Fitted(paper::Fitted),
    /// By our own rules.
    Records(IrradianceCache, Extent),
}

impl Agents {
    /// Irradiance sensors that are looked for.
    pub(crate) const SENSORS: usize = paper::Fitted::SENSORS;

    /// By our own rules, before any has measured indirect light.
    pub(super) fn without_light(
        prepared: &PreparedScene,
        extent: Extent,
        settings: AgentSettings,
        visibility: Arc<Visibility>,
        answers: &[ShadowVerdict],
    ) -> Self {
        let bounds = prepared.accel().bounds();
        let size = bounds.max - bounds.min;
        let size = if size.is_finite() { size } else { Vec3::ZERO };
        let records = IrradianceCache::new(bounds.min, size.max_element() * 1.001, settings.tolerance());
        let indirect = Indirect::Records(records, extent);
        Self::of(settings, visibility, indirect, answers)
    }

    pub(super) fn of(
        settings: AgentSettings,
        visibility: Arc<Visibility>,
        indirect: Indirect,
        answers: &[ShadowVerdict],
    ) -> Self {
        let count = |answer: ShadowVerdict| answers.iter().filter(|&&it| it == answer).count() as u64;
        let answers = [count(ShadowVerdict::Lit), count(ShadowVerdict::Shaded), count(ShadowVerdict::Trace)];
        let report = AgentReport { answers, ..AgentReport::default() };
        Self { settings, visibility, indirect, report, tallies: Tallies::default() }
    }

    /// The same with what was measured since, in its order, as far as there is room.
    pub(super) fn with_records(&self, mut records: Vec<IrradianceRecord>) -> Self {
        let mut more = self.with_light(self.indirect.clone());
        if let Indirect::Records(cache, _) = &mut more.indirect {
            cache.tell_noise(&mut records);
        }
        for record in records {
            if !more.has_room() {
                break;
            }
            if let Indirect::Records(cache, _) = &mut more.indirect {
                cache.add_within(record, self.settings.error);
            }
        }
        more
    }

    /// The same to be asked, and not to be added to; see [`IrradianceCache::settled`]. So whoever is told of them finds them.
    pub(super) fn settled(&self) -> Self {
        self.with_light(match &self.indirect {
            Indirect::Records(cache, extent) => Indirect::Records(cache.settled(), *extent),
            fitted @ Indirect::Fitted(_) => fitted.clone(),
        })
    }

    fn with_light(&self, indirect: Indirect) -> Self {
        let visibility = Arc::clone(&self.visibility);
        Self { settings: self.settings, visibility, indirect, report: self.report, tallies: Tallies::default() }
    }

    /// Whether there is memory for what is measured next.
    pub(super) fn has_room(&self) -> bool {
        self.memory_bytes() as u64 <= self.settings.memory_bytes
    }

    /// Least and greatest radius of a record at a place.
    ///
    /// - `around`: how far its agent looks around: others will measure no farther off.
    pub(super) fn reach_of_records(&self, p: Vec3, around: f32) -> [f32; 2] {
        let most = match &self.indirect {
            Indirect::Records(_, extent) => SHARE_MAX * extent.length_at(p),
            Indirect::Fitted(_) => around,
        };
        [REACH_MIN * around / self.settings.tolerance(), most]
    }

    /// Bytes held.
    pub(crate) fn memory_bytes(&self) -> usize {
        let indirect = match &self.indirect {
            Indirect::Fitted(fitted) => fitted.sensors.memory_bytes(),
            Indirect::Records(cache, _) => cache.memory_bytes(),
        };
        self.visibility.memory_bytes() + indirect
    }

    /// What there is to tell, with all that was asked so far.
    pub(crate) fn report(&self) -> AgentReport {
        AgentReport { tally: self.tallies.sum(), ..self.report }
    }

    /// Adds what was asked.
    pub(crate) fn count(&self, tally: &Tally) {
        self.tallies.add(tally);
    }

    /// "Should I trace a shadow ray?" `None`: yes; else whether the light is seen.
    ///
    /// - `normal`: of the surface, on the side that is asked for.
    #[inline(always)]
    pub(crate) fn visibility_at(&self, p: Vec3, normal: Vec3, light: u32) -> Option<bool> {
        if self.settings.decides_shadows { self.visibility.at(p, normal, light) } else { None }
    }

    /// "Should I compute incoming irradiance?" `None`: yes; else what is known of it.
    ///
    /// - `normals`: of the real surface, and the one that it is shaded with; on the side that is asked for.
    /// - `bounces`: of the light, the one at the place among them; at most.
    #[inline(always)]
    pub(crate) fn irradiance_at(
        &self,
        p: Vec3,
        normals: [Vec3; 2],
        bounces: u32,
        found: &mut Nearest,
    ) -> Option<KnownIrradiance> {
        if !self.settings.decides_irradiance {
            return None;
        }
        let whole = |irradiance| KnownIrradiance { irradiance, share: 1.0 };
        match &self.indirect {
            Indirect::Fitted(fitted) => fitted.at(p, normals[0], bounces, found).map(whole),
            Indirect::Records(cache, _) => {
                let estimate = cache.estimate(p, normals[1], bounces)?;
                let share = self.share_taken(&estimate)?;
                Some(KnownIrradiance { irradiance: estimate.irradiance, share })
            }
        }
    }

    /// How far a picture takes what records say, in (0, 1]; `None`: not at all. Where they are unsure and hardly reach, little: the edge of what one
    /// says would be seen.
    #[inline(always)]
    fn share_taken(&self, estimate: &Estimate) -> Option<f32> {
        // What one has found dark may be dim.
        let is_sure = estimate.irradiance != Spectrum::ZERO || estimate.count >= RECORDS_MIN;
        let error = estimate.error / self.settings.error;
        if !is_sure || error > GATHERED {
            return None;
        }
        let needed = ((error - SURE) / (GATHERED - SURE)).max(f32::MIN_POSITIVE);
        Some((estimate.presence / needed).min(1.0))
    }

    /// "What comes from where?" `None`: nobody knows.
    ///
    /// - `normal`: that the surface is shaded with, on the side that is asked for.
    /// - `bounces`: of the light, the one at the place among them; at most.
    /// - `u`: a number in [0, 1): what is known in part is known where it is small.
    #[inline(always)]
    pub(crate) fn surroundings_at(&self, p: Vec3, normal: Vec3, bounces: u32, u: f32) -> Option<Surroundings<'_>> {
        let Indirect::Records(cache, _) = &self.indirect else { return None };
        if !self.settings.decides_radiance || !self.settings.decides_irradiance {
            return None;
        }
        let (estimate, surroundings) = cache.surroundings(p, normal, bounces)?;
        self.share_taken(&estimate).filter(|&share| u < share).map(|_| surroundings)
    }

    /// About how much indirect irradiance comes to a place, however unsure; `None`: nobody tells, or nobody is to be asked.
    ///
    /// - `normal`: that the surface is shaded with, on the side that is asked for.
    #[inline(always)]
    pub(crate) fn rough_irradiance_at(&self, p: Vec3, normal: Vec3) -> Option<Spectrum> {
        let Indirect::Records(cache, _) = &self.indirect else { return None };
        if !self.settings.decides_halting {
            return None;
        }
        cache.estimate(p, normal, u32::MAX).map(|estimate| estimate.irradiance)
    }

    /// What the network answers at a place where an agent or a link of it lies; see [`super::network_dots`].
    pub(super) fn network_at(&self, p: Vec3, width: f32) -> Option<f32> {
        self.visibility.network_at(p, width)
    }

    /// What share of the indirect light that is known of a place has been scattered how often; `None`: nobody tells.
    ///
    /// - `normal`: that the surface is shaded with, on the side that is asked for.
    /// - `bounces`: of the light, the one at the place among them; at most.
    pub(crate) fn shares_at(&self, p: Vec3, normal: Vec3, bounces: u32) -> Option<BounceShares> {
        let Indirect::Records(cache, _) = &self.indirect else { return None };
        Some(cache.shares(p, normal, bounces))
    }

    /// How many rays to a cell of the hemisphere a record takes, by what our own records know of the noise at a place.
    pub(super) fn effort_at(&self, p: Vec3, normal: Vec3) -> u32 {
        match &self.indirect {
            Indirect::Fitted(_) => 1,
            Indirect::Records(cache, _) => cache.effort_for(p, normal, self.settings.error),
        }
    }

    /// Whether our own records know a place so well that none needs to be measured there.
    ///
    /// - `is_directed`: whether it is to be known from where light comes.
    pub(super) fn knows(&self, p: Vec3, normal: Vec3, is_directed: bool) -> bool {
        let Indirect::Records(cache, _) = &self.indirect else { return false };
        let is_enough = |it: Estimate| it.count >= RECORDS_MIN && it.error <= self.settings.error;
        let estimate = if is_directed {
            cache.surroundings(p, normal, u32::MAX).map(|(estimate, _)| estimate)
        } else {
            cache.estimate(p, normal, u32::MAX)
        };
        estimate.is_some_and(is_enough)
    }

    /// How much of its light arrives at an agent of the first map, as it answers: 1 where it is lit, 0 where it is shaded, and a
    /// half in between.
    pub(super) fn lit_share(agent: &Photon) -> f32 {
        Visibility::lit_share(agent)
    }

    /// Where the agents are, and their irradiance sensors.
    pub(crate) fn maps(&self) -> [PhotonMap; 2] {
        let sensors = match &self.indirect {
            Indirect::Fitted(fitted) => fitted.sensors.places().clone(),
            Indirect::Records(cache, _) => PhotonMap::new(cache.as_photons().collect()),
        };
        [self.visibility.places().clone(), sensors]
    }
}
