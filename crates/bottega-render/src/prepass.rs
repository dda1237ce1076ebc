//! The prepass of a picture: guides, photon maps, lighting agents.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::{
    AgentUse, PathSettings, PhotonSettings, PreparedScene, View,
    ala::{AgentReport, Agents},
    guide::{Guide, UnreadGuide},
    photon::{MapBytes, Passes, PhotonPlan, PhotonPlans, PhotonStore},
};

/// What is found out of one scene before its pictures, shared by all who paint them. Each part is made by the first who
/// needs it, while others wait; it depends on scene, view, settings and seed alone.
///
/// A prepass belongs to one [`PreparedScene`]: with another one its answers are of no use.
#[derive(Default)]
pub struct Prepass {
    guides: Mutex<Vec<(LearntFor, GuidePlace)>>,
    photons: PhotonStore,
    photon_plans: PhotonPlans,
}

/// What a guide is for: a view, samples a pixel, what agents are asked for, and whether paths are guided.
type LearntFor = (View, u32, AgentUse, bool);

fn learnt_for(view: View, settings: &PathSettings) -> LearntFor {
    (view, settings.planned_samples, settings.agents, settings.guiding)
}

/// Where a guide is put by the first who needs it, while others wait.
type GuidePlace = Arc<OnceLock<Arc<Guide>>>;

impl Prepass {
    /// Returns the bytes that it holds.
    pub fn memory_bytes(&self) -> usize {
        let guides = self.guides.lock().unwrap_or_else(PoisonError::into_inner);
        let guides = guides.iter().filter_map(|(_, place)| place.get()).map(|guide| guide.memory_bytes());
        guides.sum::<usize>() + self.photons.memory_bytes()
    }

    /// Where photons and agents of a view are sent; the first who asks looks at it.
    pub(crate) fn photon_plan(&self, prepared: &PreparedScene, view: View) -> Arc<PhotonPlan> {
        self.photon_plans.of_view(prepared, view)
    }

    /// The photon maps of a picture.
    pub(crate) fn passes(
        &self,
        prepared: &PreparedScene,
        view: View,
        photons: PhotonSettings,
        seed: u64,
        pass_count: u32,
    ) -> Arc<Passes> {
        self.photons.passes(self.photon_plan(prepared, view), photons, seed, pass_count)
    }

    /// What the lighting agents of a picture are like, and what they were asked so far; `None` where there are none.
    pub fn lighting_agents(
        &self,
        prepared: &PreparedScene,
        view: View,
        photons: PhotonSettings,
        seed: u64,
    ) -> Option<AgentReport> {
        photons.agents?;
        let passes = self.passes(prepared, view, photons, seed, 1);
        let report = passes.known_agents().map(Agents::report)?;
        Some(AgentReport { caustics_seen: passes.plan().shares_seen(), ..report })
    }

    /// What the maps of a picture by photons take.
    pub fn map_bytes(&self, prepared: &PreparedScene, view: View, photons: PhotonSettings, seed: u64) -> MapBytes {
        self.passes(prepared, view, photons, seed, 1).bytes()
    }

    /// What is known of where light comes from, for a view and as many samples a pixel as are planned. The first who asks
    /// learns it by `learn`; who asks meanwhile waits.
    pub(crate) fn guide(&self, view: View, settings: &PathSettings, learn: impl FnOnce() -> Guide) -> Arc<Guide> {
        Arc::clone(self.guide_place(learnt_for(view, settings)).get_or_init(|| Arc::new(learn())))
    }

    /// Whether that has been learnt.
    pub(crate) fn has_guide(&self, view: View, settings: &PathSettings) -> bool {
        self.guide_place(learnt_for(view, settings)).get().is_some()
    }

    /// What has been learnt of a view that is painted with such settings, for others who paint the same; `None`: nothing
    /// yet.
    pub fn learnt(&self, prepared: &PreparedScene, view: View, settings: &PathSettings) -> Option<Vec<u8>> {
        match settings.photons {
            None => Some(self.guide_place(learnt_for(view, settings)).get()?.to_bytes()),
            Some(photons) => self.passes(prepared, view, photons, settings.seed, 1).to_bytes(),
        }
    }

    /// Takes what somebody else has [learnt](Self::learnt) of the same view of the same scene, by the same version of this
    /// program. Whoever has learnt it already keeps that.
    ///
    /// # Errors
    /// The bytes are nothing of the kind.
    pub fn learn_from(
        &self,
        prepared: &PreparedScene,
        view: View,
        settings: &PathSettings,
        bytes: &[u8],
    ) -> Result<(), UnreadGuide> {
        if let Some(photons) = settings.photons {
            let is_taken = self.passes(prepared, view, photons, settings.seed, 1).take_bytes(bytes);
            return is_taken.then_some(()).ok_or(UnreadGuide);
        }
        let guide = Guide::from_bytes(bytes)?;
        self.guide_place(learnt_for(view, settings)).get_or_init(|| Arc::new(guide));
        Ok(())
    }

    fn guide_place(&self, of: LearntFor) -> GuidePlace {
        /// Guides that are kept.
        const GUIDES_MAX: usize = 4;
        let mut guides = self.guides.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, place)) = guides.iter().find(|(known, _)| *known == of) {
            return Arc::clone(place);
        }
        if guides.len() == GUIDES_MAX {
            guides.remove(0);
        }
        let place = GuidePlace::default();
        guides.push((of, Arc::clone(&place)));
        place
    }
}
