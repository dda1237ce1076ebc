//! The prepass of pictures: guides, photon maps, lighting agents.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::{
    ala::{AgentReport, Agents},
    guide::{Guide, UnreadGuide},
    photon::{
        MapBytes, Passes, PhotonPlan, PhotonPlans, PhotonStore,
        bytes::{ByteForm, Reader, Writer},
    },
    prepare::PreparedScene,
    settings::{AgentUse, PathSettings, PhotonSettings, View},
    technique::{TechniquePlan, TechniqueStore, TriedPhotons},
};

/// Data learnt from one scene before its pictures, shared by all threads that render them. Each part is created by the
/// first user while others wait; it depends on scene, view, settings and seed alone.
///
/// A prepass belongs to one [`PreparedScene`]; with another one its data is meaningless.
#[derive(Default)]
pub struct Prepass {
    guides: Mutex<Vec<(GuideKey, GuidePlace)>>,
    photons: PhotonStore,
    photon_plans: PhotonPlans,
    techniques: TechniqueStore,
}

/// The key of a guide: view, samples per pixel, uses of agents, and if paths are guided.
type GuideKey = (View, u32, AgentUse, bool);

fn guide_key(view: &View, settings: &PathSettings) -> GuideKey {
    (view.clone(), settings.planned_samples, settings.agents, settings.guiding)
}

/// A guide, filled by its first user while others wait.
type GuidePlace = Arc<OnceLock<Arc<Guide>>>;

impl Prepass {
    /// Returns the memory of guides, photon maps, irradiance caches and lighting agents, in bytes.
    pub fn memory_bytes(&self) -> usize {
        let guides = self.guides.lock().unwrap_or_else(PoisonError::into_inner);
        let guides = guides.iter().filter_map(|(_, place)| place.get()).map(|guide| guide.memory_bytes());
        guides.sum::<usize>() + self.photons.memory_bytes()
    }

    /// Returns the plan of photons and agents for a view; the first call computes it.
    pub(crate) fn photon_plan(&self, prepared: &PreparedScene, view: &View) -> Arc<PhotonPlan> {
        self.photon_plans.of_view(prepared, view)
    }

    /// Returns the photon maps of a picture.
    pub(crate) fn passes(
        &self,
        prepared: &PreparedScene,
        view: &View,
        photons: PhotonSettings,
        seed: u64,
        pass_count: u32,
    ) -> Arc<Passes> {
        self.photons.passes(self.photon_plan(prepared, view), photons, seed, pass_count)
    }

    /// Returns statistics of the lighting agents of a picture and of their answers so far; `None`: the settings have no
    /// agents, or none are cast yet.
    pub fn lighting_agents(
        &self,
        prepared: &PreparedScene,
        view: &View,
        photons: PhotonSettings,
        seed: u64,
    ) -> Option<AgentReport> {
        photons.agents?;
        let passes = self.passes(prepared, view, photons, seed, 1);
        let report = passes.known_agents().map(Agents::report)?;
        Some(AgentReport { caustics_seen: passes.plan().shares_seen(), ..report })
    }

    /// Returns the memory of the photon maps and agents of a picture that exist so far, in bytes.
    pub fn map_bytes(&self, prepared: &PreparedScene, view: &View, photons: PhotonSettings, seed: u64) -> MapBytes {
        self.passes(prepared, view, photons, seed, 1).bytes()
    }

    /// Returns the guide of a view for the planned number of samples per pixel. The first caller computes it by `learn`;
    /// others wait.
    pub(crate) fn guide(&self, view: &View, settings: &PathSettings, learn: impl FnOnce() -> Guide) -> Arc<Guide> {
        Arc::clone(self.guide_place(guide_key(view, settings)).get_or_init(|| Arc::new(learn())))
    }

    /// Returns true if the guide exists.
    pub(crate) fn has_guide(&self, view: &View, settings: &PathSettings) -> bool {
        self.guide_place(guide_key(view, settings)).get().is_some()
    }

    /// Returns the technique of each zone of a picture that tries photons. The first caller decides it; others wait.
    pub(crate) fn technique(
        &self,
        view: &View,
        settings: &PathSettings,
        decide: impl FnOnce() -> TechniquePlan,
    ) -> Arc<TechniquePlan> {
        Arc::clone(self.techniques.place(view, settings).get_or_init(|| Arc::new(decide())))
    }

    /// Returns the technique of each zone of a picture that tries photons; `None`: nothing is decided yet.
    pub(crate) fn known_technique(&self, view: &View, settings: &PathSettings) -> Option<Arc<TechniquePlan>> {
        self.techniques.place(view, settings).get().cloned()
    }

    /// Returns the number of zones that photons render, and that of all zones, of a picture that tries photons; `None`:
    /// the picture does not try them, has too few samples for it, or nothing is decided yet.
    pub fn zones_by_photons(&self, view: &View, settings: &PathSettings) -> Option<[usize; 2]> {
        TriedPhotons::of(view, settings)?;
        Some(self.techniques.place(view, settings).get()?.counts())
    }

    /// Returns what was learnt for a view and settings, as bytes for machines that render the same picture. With paths: the
    /// guide. With photon mapping: the photon maps and lighting agents. With [`PathSettings::tries_photons`]: the technique
    /// of each zone, the guide if there is one, and the maps if photons render a zone; in too small a picture the guide
    /// alone. `None`: these data do not exist yet, or the photon mapping is progressive.
    pub fn learnt(&self, prepared: &PreparedScene, view: &View, settings: &PathSettings) -> Option<Vec<u8>> {
        if settings.tries_photons {
            return self.learnt_techniques(prepared, view, settings);
        }
        match settings.photons {
            None => Some(self.guide_place(guide_key(view, settings)).get()?.to_bytes()),
            Some(photons) => self.passes(prepared, view, photons, settings.seed, 1).to_bytes(),
        }
    }

    /// Takes data that another machine has [learnt](Self::learnt) for the same view and settings of the same scene,
    /// with the same version of this program. Existing data is kept.
    ///
    /// # Errors
    /// The bytes are not such data.
    pub fn learn_from(
        &self,
        prepared: &PreparedScene,
        view: &View,
        settings: &PathSettings,
        bytes: &[u8],
    ) -> Result<(), UnreadGuide> {
        if settings.tries_photons {
            return self.take_techniques(prepared, view, settings, bytes);
        }
        if let Some(photons) = settings.photons {
            let is_taken = self.passes(prepared, view, photons, settings.seed, 1).take_bytes(bytes);
            return is_taken.then_some(()).ok_or(UnreadGuide);
        }
        let guide = Guide::from_bytes(bytes)?;
        self.guide_place(guide_key(view, settings)).get_or_init(|| Arc::new(guide));
        Ok(())
    }

    /// Returns plan, guide and maps of a picture that tries photons as bytes: a list of three parts with their lengths.
    /// Without photons in any zone, the maps are left out.
    fn learnt_techniques(&self, prepared: &PreparedScene, view: &View, settings: &PathSettings) -> Option<Vec<u8>> {
        let guide = self.guide_place(guide_key(view, settings)).get().map(|guide| guide.to_bytes());
        let (mut plan, mut maps) = (Writer(Vec::new()), Vec::new());
        let tried = TriedPhotons::of(view, settings);
        if tried.is_none() && guide.is_none() {
            return None;
        }
        if let Some(TriedPhotons { zones: photons, .. }) = tried {
            let known = Arc::clone(self.techniques.place(view, settings).get()?);
            known.write(&mut plan);
            if known.only() != Some(false) {
                maps = self.passes(prepared, view, photons, settings.seed, 1).to_bytes()?;
            }
        }
        let mut all = Writer(Vec::new());
        for part in [plan.0, guide.unwrap_or_default(), maps] {
            all.long(part.len() as u64);
            all.0.extend(part);
        }
        Some(all.0)
    }

    /// Takes the bytes of [`Self::learnt_techniques`].
    fn take_techniques(
        &self,
        prepared: &PreparedScene,
        view: &View,
        settings: &PathSettings,
        bytes: &[u8],
    ) -> Result<(), UnreadGuide> {
        let mut rest = Reader(bytes);
        let mut part = || {
            let length = usize::try_from(rest.long()?).ok()?;
            let (part, after) = rest.0.split_at_checked(length)?;
            rest = Reader(after);
            Some(part)
        };
        let [plan, guide, maps] = [part(), part(), part()].map(|part| part.ok_or(UnreadGuide));
        let (plan, guide, maps) = (plan?, guide?, maps?);
        if !guide.is_empty() {
            let guide = Guide::from_bytes(guide)?;
            self.guide_place(guide_key(view, settings)).get_or_init(|| Arc::new(guide));
        }
        let Some(TriedPhotons { zones: photons, .. }) = TriedPhotons::of(view, settings) else { return Ok(()) };
        let plan = TechniquePlan::read(&mut Reader(plan)).ok_or(UnreadGuide)?;
        let needs_maps = plan.only() != Some(false);
        if needs_maps && !self.passes(prepared, view, photons, settings.seed, 1).take_bytes(maps) {
            return Err(UnreadGuide);
        }
        self.technique(view, settings, || plan);
        Ok(())
    }

    fn guide_place(&self, key: GuideKey) -> GuidePlace {
        /// Number of guides kept.
        const GUIDES_MAX: usize = 4;
        let mut guides = self.guides.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, place)) = guides.iter().find(|(known, _)| *known == key) {
            return Arc::clone(place);
        }
        if guides.len() == GUIDES_MAX {
            guides.remove(0);
        }
        let place = GuidePlace::default();
        guides.push((key, Arc::clone(&place)));
        place
    }
}
