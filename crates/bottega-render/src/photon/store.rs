//! The store of maps, for all who paint the same.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{
    bytes::{Reader, Writer},
    cache::IrradianceCache,
    maps::PhotonMaps,
    plan::PhotonPlan,
};
use crate::{PhotonSettings, View, ala::Agents, prepare::PreparedScene};

/// Pictures whose maps are kept.
const PICTURES_MAX: usize = 2;

/// What maps depend on beside the scene and the extent of what is seen: settings, seed, and how many passes there are.
type Of = (PhotonSettings, u64, u32);

/// The maps of each pass, each made by the first who needs it, while others wait.
pub(crate) struct Passes {
    of: Of,
    plan: Arc<PhotonPlan>,
    maps: Vec<OnceLock<PhotonMaps>>,
    caches: Mutex<Vec<(View, CachePlace)>>,
    agents: OnceLock<Agents>,
}

/// The memory of a picture's maps, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MapBytes {
    /// Photons of light that was brought together by mirrors and glass; with the indirect ones, where no rays are gathered.
    pub seen: usize,
    /// Places where the irradiance is known.
    pub irradiance: usize,
    /// Photons straight from the lights, and photons that were scattered before; where these maps are kept apart.
    pub direct: usize,
    /// See [`Self::direct`].
    pub indirect: usize,
    /// Places where it is known where indirect light comes from.
    pub arrivals: usize,
    /// Shadow photons.
    pub shadow: usize,
    /// The irradiance cache.
    pub cache: usize,
    /// Lighting agents with all that they know.
    pub agents: usize,
}

/// Where a cache is put by the first who needs it, while others wait.
type CachePlace = Arc<OnceLock<IrradianceCache>>;

/// The maps of some pictures of a scene.
#[derive(Default)]
pub(crate) struct PhotonStore(Mutex<Vec<Arc<Passes>>>);

impl PhotonStore {
    /// The passes of a picture.
    pub(crate) fn passes(
        &self,
        plan: Arc<PhotonPlan>,
        settings: PhotonSettings,
        seed: u64,
        pass_count: u32,
    ) -> Arc<Passes> {
        let of = (settings, seed, pass_count);
        let mut pictures = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_alike = |other: &PhotonPlan| {
            // Lookouts are those of one view.
            other.extent() == plan.extent() && (!settings.lookouts || settings.progressive || other.view == plan.view)
        };
        let is_it = |passes: &&Arc<Passes>| passes.of == of && is_alike(&passes.plan);
        if let Some(passes) = pictures.iter().find(is_it) {
            return Arc::clone(passes);
        }
        if pictures.len() == PICTURES_MAX {
            pictures.remove(0);
        }
        let passes = Arc::new(Passes {
            of,
            plan,
            maps: (0..pass_count.max(1)).map(|_| OnceLock::new()).collect(),
            caches: Mutex::default(),
            agents: OnceLock::new(),
        });
        pictures.push(Arc::clone(&passes));
        passes
    }

    /// Bytes held.
    pub(crate) fn memory_bytes(&self) -> usize {
        let pictures = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let maps = pictures.iter().flat_map(|passes| passes.maps.iter().filter_map(OnceLock::get));
        let agents = pictures.iter().filter_map(|passes| passes.agents.get());
        maps.map(PhotonMaps::memory_bytes).sum::<usize>()
            + agents.map(Agents::memory_bytes).sum::<usize>()
            + pictures.iter().map(|it| it.cache_bytes()).sum::<usize>()
    }
}

impl Passes {
    /// What is there so far.
    pub(crate) fn bytes(&self) -> MapBytes {
        let maps = || self.maps.iter().filter_map(OnceLock::get);
        MapBytes {
            seen: maps().map(|maps| maps.seen.memory_bytes()).sum(),
            irradiance: maps().map(|maps| maps.irradiance.memory_bytes()).sum(),
            direct: maps().map(|maps| maps.direct.memory_bytes()).sum(),
            indirect: maps().map(|maps| maps.indirect.memory_bytes()).sum(),
            arrivals: maps().map(|maps| maps.arrivals.memory_bytes()).sum(),
            shadow: maps().map(|maps| maps.visibility.memory_bytes()).sum(),
            cache: self.cache_bytes(),
            agents: self.agents.get().map_or(0, Agents::memory_bytes),
        }
    }

    /// The maps and the agents, once they are there, for others who paint the same. Those of progressive pictures are too many to
    /// be told.
    pub(crate) fn to_bytes(&self) -> Option<Vec<u8>> {
        let (settings, ..) = &self.of;
        let maps = self.maps.first()?.get().filter(|_| !settings.progressive)?;
        let mut to = Writer::default();
        maps.write(&mut to);
        if settings.agents.is_some() {
            self.agents.get()?.write(&mut to);
        }
        Some(to.0)
    }

    /// Takes what somebody else has told. Whoever has it already keeps that. False: it is nothing of the kind.
    pub(crate) fn take_bytes(&self, bytes: &[u8]) -> bool {
        let (settings, ..) = &self.of;
        let mut from = Reader(bytes);
        let mut read = || {
            let maps = PhotonMaps::read(settings, *self.plan.extent(), &mut from)?;
            let agents = match settings.agents {
                Some(agents) => Some(Agents::read(agents, *self.plan.extent(), &mut from)?),
                None => None,
            };
            from.0.is_empty().then_some((maps, agents))
        };
        let Some((maps, agents)) = read() else { return false };
        if settings.progressive {
            return false;
        }
        self.put(maps);
        if let Some(agents) = agents {
            self.put_agents(agents);
        }
        true
    }

    /// The maps that belong to a sample.
    pub(crate) fn of_sample(&self, prepared: &PreparedScene, sample: u32) -> &PhotonMaps {
        let pass = sample % self.maps.len() as u32;
        let (settings, seed, _) = &self.of;
        self.maps[pass as usize]
            .get_or_init(|| prepared.on_threads(|| PhotonMaps::new(prepared, &self.plan, settings, *seed, pass)))
    }

    /// Where photons and agents are sent.
    pub(crate) fn plan(&self) -> &Arc<PhotonPlan> {
        &self.plan
    }

    /// The agents of the picture; the first who asks has them made.
    pub(crate) fn agents(&self, make: impl FnOnce() -> Agents) -> &Agents {
        self.agents.get_or_init(make)
    }

    /// Whether the agents are there.
    pub(crate) fn has_agents(&self) -> bool {
        self.agents.get().is_some()
    }

    /// The agents, if they are there.
    pub(crate) fn known_agents(&self) -> Option<&Agents> {
        self.agents.get()
    }

    /// Takes agents that were made as [`Self::agents`] would make them.
    pub(crate) fn put_agents(&self, agents: Agents) {
        self.agents.get_or_init(|| agents);
    }

    /// Where the irradiance of a view is kept.
    pub(crate) fn cache(&self, view: View) -> Arc<OnceLock<IrradianceCache>> {
        /// Views whose irradiance is kept.
        const VIEWS_MAX: usize = 2;
        let mut caches = self.caches.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, place)) = caches.iter().find(|(known, _)| *known == view) {
            return Arc::clone(place);
        }
        if caches.len() == VIEWS_MAX {
            caches.remove(0);
        }
        let place = CachePlace::default();
        caches.push((view, Arc::clone(&place)));
        place
    }

    fn cache_bytes(&self) -> usize {
        let caches = self.caches.lock().unwrap_or_else(PoisonError::into_inner);
        caches.iter().filter_map(|(_, place)| place.get()).map(IrradianceCache::memory_bytes).sum()
    }

    /// Whether the maps of the first pass are there.
    pub(crate) fn is_made(&self) -> bool {
        self.maps[0].get().is_some()
    }

    /// Takes the maps of the first pass, made as this would make them.
    pub(crate) fn put(&self, maps: PhotonMaps) {
        self.maps[0].get_or_init(|| maps);
    }
}
