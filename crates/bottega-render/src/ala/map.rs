//! Agents after sensing: the oracle that integrators ask (§4.4).

use std::sync::Arc;

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    paper,
    report::{AgentReport, Tallies, Tally},
    visibility::{ShadowVerdict, Visibility},
};
use crate::{
    extent::Extent,
    photon::{
        BounceShares, Nearest, Photon, PhotonMap,
        cache::{Estimate, IrradianceCache, IrradianceRecord, Surroundings},
    },
    prepare::PreparedScene,
    settings::AgentSettings,
};

/// Greatest radius of a record, as a share of the visible radius.
const SHARE_MAX: f32 = 0.5;
/// Relative error of a few gathering rays, in units of the tolerated error: records that are no worse are used in full
/// where the camera looks, and are good enough where gathering rays end.
const GATHERED: f32 = 3.0;
/// Relative errors, in units of the tolerated one, beyond which records are no longer used: where the camera looks, and
/// where gathering rays end, whose errors average out.
const SHOWN_MAX: f32 = 6.0;
const GATHERED_MAX: f32 = 10.0;
/// Relative error, in units of the tolerated one, up to which the least presence is enough, and that presence: records
/// that reach less fade out, so that their regions have no edges.
const SURE: f32 = 0.5;
const PRESENCE_MIN: f32 = 0.3;
/// Least effective number of records at a point; where there are fewer, a record is measured.
const RECORDS_MIN: f32 = 1.5;
/// Presence of records at what the camera sees below which a record is measured; and beyond which none is, however
/// uncertain they are.
const PRESENCE_WANTED: f32 = 0.7;
const PRESENCE_ENOUGH: f32 = 3.0;
/// Greatest number of rays per cell of a record where the camera looks: noise of its neighbours averages out.
const SHOWN_EFFORT_MAX: u32 = 4;
/// Least radius of a record, as a share of the radius of its agent's neighbourhood.
const REACH_MIN: f32 = 0.6;

/// Agents after sensing.
#[derive(Debug)]
pub(crate) struct Agents {
    /// Settings of the agents.
    pub(super) settings: AgentSettings,
    /// Visibility of lights.
    pub(super) visibility: Arc<Visibility>,
    /// Indirect light by the oracle.
    pub(super) indirect: Indirect,
    /// Report of casting and sensing.
    pub(super) report: AgentReport,
    /// Counts of answers so far.
    pub(super) tallies: Tallies,
}

/// The use of indirect light at a point, which says how accurate it must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LightUse {
    /// The camera sees the point, over mirrors and glass at most.
    Shown,
    /// Gathering rays end there: the mean over many of them counts.
    Gathered,
}

/// Irradiance at a point, interpolated between agents.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KnownIrradiance {
    /// Interpolated indirect irradiance.
    pub(crate) irradiance: Spectrum,
    /// Share of the irradiance to use, in (0, 1]: the rest must be computed.
    pub(crate) share: f32,
}

/// Indirect light by the oracle that is set.
#[derive(Clone, Debug)]
pub(super) enum Indirect {
    /// Sensors of the paper's oracle.
    Fitted(paper::FittedSensors),
    /// Records of the error oracle.
    Records(IrradianceCache, Extent),
}

impl Agents {
    /// Number of irradiance sensors to find.
    pub(crate) const SENSORS: usize = paper::FittedSensors::SENSORS;

    /// Creates agents of the error oracle, before any has measured indirect light.
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

    /// Creates agents with their visibility and indirect light.
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

    /// Returns these agents with further records, in order, until the memory limit.
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

    /// Returns read-only agents; see [`IrradianceCache::settled`]. Agents read from bytes are equal to them.
    pub(super) fn settled(&self) -> Self {
        self.with_light(match &self.indirect {
            Indirect::Records(cache, extent) => Indirect::Records(cache.settled(), *extent),
            fitted @ Indirect::Fitted(_) => fitted.clone(),
        })
    }

    /// Returns these agents with other indirect light.
    fn with_light(&self, indirect: Indirect) -> Self {
        let visibility = Arc::clone(&self.visibility);
        Self { settings: self.settings, visibility, indirect, report: self.report, tallies: Tallies::default() }
    }

    /// Returns `true` if there is memory for further records.
    pub(super) fn has_room(&self) -> bool {
        self.memory_bytes() as u64 <= self.settings.memory_bytes
    }

    /// Returns the least and greatest radius of a record at a point.
    ///
    /// - `around`: radius of its agent's neighbourhood: other agents measure at least that near.
    pub(super) fn reach_of_records(&self, p: Vec3, around: f32) -> [f32; 2] {
        let most = match &self.indirect {
            Indirect::Records(_, extent) => SHARE_MAX * extent.length_at(p),
            Indirect::Fitted(_) => around,
        };
        [REACH_MIN * around / self.settings.tolerance(), most]
    }

    /// Returns the memory, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let indirect = match &self.indirect {
            Indirect::Fitted(fitted) => fitted.sensors.memory_bytes(),
            Indirect::Records(cache, _) => cache.memory_bytes(),
        };
        self.visibility.memory_bytes() + indirect
    }

    /// Returns the report, with all answers so far.
    pub(crate) fn report(&self) -> AgentReport {
        AgentReport { tally: self.tallies.sum(), ..self.report }
    }

    /// Adds counts of answers.
    pub(crate) fn count(&self, tally: &Tally) {
        self.tallies.add(tally);
    }

    /// Answers "should I trace a shadow ray?". `None`: yes; else no, and `true` if the light is visible.
    ///
    /// - `normal`: geometric normal, on the side that faces the light.
    #[inline(always)]
    pub(crate) fn visibility_at(&self, p: Vec3, normal: Vec3, light: u32) -> Option<bool> {
        if self.settings.decides_shadows { self.visibility.at(p, normal, light) } else { None }
    }

    /// Answers "should I compute incoming irradiance?". `None`: yes; else no, with the known irradiance.
    ///
    /// - `normals`: geometric and shading normal, on the side that the light arrives at.
    /// - `bounces`: greatest number of bounces of the light, including the one at the point.
    /// - `what_for`: with [`LightUse::Gathered`], light is known in full or not at all.
    #[inline(always)]
    pub(crate) fn irradiance_at(
        &self,
        p: Vec3,
        normals: [Vec3; 2],
        bounces: u32,
        found: &mut Nearest,
        what_for: LightUse,
    ) -> Option<KnownIrradiance> {
        if !self.settings.decides_irradiance {
            return None;
        }
        let whole = |irradiance| KnownIrradiance { irradiance, share: 1.0 };
        match &self.indirect {
            Indirect::Fitted(fitted) => fitted.at(p, normals[0], bounces, found).map(whole),
            Indirect::Records(cache, _) => {
                let estimate = cache.estimate(p, normals[1], bounces)?;
                let share = match what_for {
                    LightUse::Shown => self.share_taken(&estimate)?,
                    LightUse::Gathered if estimate.error <= GATHERED_MAX * self.settings.error => 1.0,
                    LightUse::Gathered => return None,
                };
                Some(KnownIrradiance { irradiance: estimate.irradiance, share })
            }
        }
    }

    /// Returns the share of a record's light to use, in (0, 1]; `None`: do not use it. Small where records are
    /// uncertain and barely reach, to hide their edges.
    #[inline(always)]
    fn share_taken(&self, estimate: &Estimate) -> Option<f32> {
        // A single record that found no light is not certain
        let is_sure = estimate.irradiance != Spectrum::ZERO || estimate.count >= RECORDS_MIN;
        let error = estimate.error / self.settings.error;
        if !is_sure || error >= SHOWN_MAX {
            return None;
        }
        let needed = ((error - SURE) / (GATHERED - SURE)).clamp(PRESENCE_MIN, 1.0);
        let accurate = ((SHOWN_MAX - error) / (SHOWN_MAX - GATHERED)).min(1.0);
        Some((estimate.presence / needed).min(1.0) * accurate)
    }

    /// Answers "which light comes from where?". `None`: unknown.
    ///
    /// - `normal`: shading normal, on the side that the light arrives at.
    /// - `bounces`: greatest number of bounces of the light, including the one at the point.
    /// - `u`: number in [0, 1); partly known light counts as known where `u` is below its share.
    #[inline(always)]
    pub(crate) fn surroundings_at(&self, p: Vec3, normal: Vec3, bounces: u32, u: f32) -> Option<Surroundings<'_>> {
        let Indirect::Records(cache, _) = &self.indirect else { return None };
        if !self.settings.decides_radiance || !self.settings.decides_irradiance {
            return None;
        }
        let (estimate, surroundings) = cache.surroundings(p, normal, bounces)?;
        self.share_taken(&estimate).filter(|&share| u < share).map(|_| surroundings)
    }

    /// Returns the network's answer at a point on an agent or a link, as for [`super::network_dots`]. `None`: neither
    /// is near, or the network is not kept.
    pub(super) fn network_at(&self, p: Vec3, width: f32) -> Option<f32> {
        self.visibility.network_at(p, width)
    }

    /// Returns how the known indirect light at a point divides by number of bounces; `None`: unknown.
    ///
    /// - `normal`: shading normal, on the side that the light arrives at.
    /// - `bounces`: greatest number of bounces of the light, including the one at the point.
    pub(crate) fn shares_at(&self, p: Vec3, normal: Vec3, bounces: u32) -> Option<BounceShares> {
        let Indirect::Records(cache, _) = &self.indirect else { return None };
        Some(cache.shares(p, normal, bounces))
    }

    /// Returns the number of rays per cell for a record at a point, by the noise of earlier records.
    pub(super) fn effort_at(&self, p: Vec3, normal: Vec3, what_for: LightUse) -> u32 {
        let Indirect::Records(cache, _) = &self.indirect else { return 1 };
        match what_for {
            LightUse::Shown => cache.effort_for(p, normal, self.settings.error).min(SHOWN_EFFORT_MAX),
            LightUse::Gathered => cache.effort_for(p, normal, GATHERED * self.settings.error),
        }
    }

    /// Returns `true` if records know a point well enough that no other is needed there.
    ///
    /// - `is_directed`: `true`: the directions of the light must be known, too.
    pub(super) fn knows(&self, p: Vec3, normal: Vec3, is_directed: bool, what_for: LightUse) -> bool {
        let Indirect::Records(cache, _) = &self.indirect else { return false };
        let (error, presence) = match what_for {
            LightUse::Shown => (self.settings.error, PRESENCE_WANTED),
            LightUse::Gathered => (GATHERED * self.settings.error, 0.0),
        };
        let is_enough = |it: Estimate| {
            let is_certain = it.error <= error || it.presence >= PRESENCE_ENOUGH;
            it.count >= RECORDS_MIN && is_certain && it.presence >= presence
        };
        let estimate = if is_directed {
            cache.surroundings(p, normal, u32::MAX).map(|(estimate, _)| estimate)
        } else {
            cache.estimate(p, normal, u32::MAX)
        };
        estimate.is_some_and(is_enough)
    }

    /// Returns the share of the agent's light that arrives at an agent of the first map, by its answer: 1 lit, 0 shaded, 0.5 in
    /// between.
    pub(super) fn lit_share(agent: &Photon) -> f32 {
        Visibility::lit_share(agent)
    }

    /// Returns the agents' positions, and their irradiance sensors.
    pub(crate) fn maps(&self) -> [PhotonMap; 2] {
        let sensors = match &self.indirect {
            Indirect::Fitted(fitted) => fitted.sensors.places().clone(),
            Indirect::Records(cache, _) => PhotonMap::new(cache.as_photons().collect()),
        };
        [self.visibility.places().clone(), sensors]
    }
}
