//! The store of photon maps, shared by all work on the same picture.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{
    bytes::{Reader, Writer},
    cache::IrradianceCache,
    maps::PhotonMaps,
    plan::PhotonPlan,
};
use crate::{
    ala::Agents,
    prepare::PreparedScene,
    settings::{PhotonSettings, View},
};

/// Number of pictures whose maps are kept.
const PICTURES_MAX: usize = 2;

/// Key of a picture's maps, in addition to the visible extent: settings, seed and number of passes.
type MapsKey = (PhotonSettings, u64, u32);

/// The maps of all passes of a picture, each built by the first thread that needs it, while others wait.
pub(crate) struct Passes {
    key: MapsKey,
    plan: Arc<PhotonPlan>,
    maps: Vec<OnceLock<PhotonMaps>>,
    caches: Mutex<Vec<(View, CachePlace)>>,
    agents: OnceLock<Agents>,
}

/// The memory of a picture's photon maps and agents, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MapBytes {
    /// Caustic photons; without final gathering, also the indirect photons.
    pub seen: usize,
    /// Places with precomputed irradiance.
    pub irradiance: usize,
    /// Direct photons, if [`PhotonSettings::separate_maps`] is set.
    pub direct: usize,
    /// Indirect photons, if [`PhotonSettings::separate_maps`] is set.
    pub indirect: usize,
    /// Distributions of indirect light.
    pub arrivals: usize,
    /// Shadow photons, lit and shaded.
    pub shadow: usize,
    /// The irradiance cache.
    pub cache: usize,
    /// Lighting agents with all their data.
    pub agents: usize,
}

/// Place of a cache that the first thread that needs it builds, while others wait.
type CachePlace = Arc<OnceLock<IrradianceCache>>;

/// The maps of some pictures of a scene.
#[derive(Default)]
pub(crate) struct PhotonStore(Mutex<Vec<Arc<Passes>>>);

impl PhotonStore {
    /// Returns the maps of a picture; creates their places if it is new, and drops the oldest picture.
    pub(crate) fn passes(
        &self,
        plan: Arc<PhotonPlan>,
        settings: PhotonSettings,
        seed: u64,
        pass_count: u32,
    ) -> Arc<Passes> {
        let key = (settings, seed, pass_count);
        let mut pictures = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_alike = |other: &PhotonPlan| {
            // Lookouts and the agents of the camera depend on the view
            let has_lookouts = settings.lookouts && !settings.progressive;
            let depends = has_lookouts || settings.agents.is_some_and(|agents| agents.has_scouts());
            other.extent() == plan.extent() && (!depends || other.view == plan.view)
        };
        let is_it = |passes: &&Arc<Passes>| passes.key == key && is_alike(&passes.plan);
        if let Some(passes) = pictures.iter().find(is_it) {
            return Arc::clone(passes);
        }
        if pictures.len() == PICTURES_MAX {
            pictures.remove(0);
        }
        let passes = Arc::new(Passes {
            key,
            plan,
            maps: (0..pass_count.max(1)).map(|_| OnceLock::new()).collect(),
            caches: Mutex::default(),
            agents: OnceLock::new(),
        });
        pictures.push(Arc::clone(&passes));
        passes
    }

    /// Returns the memory of all maps, in bytes.
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
    /// Returns the memory of the maps built so far.
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

    /// Returns the bytes of maps and agents for other machines; `None`: not built yet, or a progressive picture, which
    /// has too many.
    pub(crate) fn to_bytes(&self) -> Option<Vec<u8>> {
        let (settings, ..) = &self.key;
        let maps = self.maps.first()?.get().filter(|_| !settings.progressive)?;
        let mut to = Writer::default();
        maps.write(&mut to);
        if settings.agents.is_some() {
            self.agents.get()?.write(&mut to);
        }
        Some(to.0)
    }

    /// Takes over maps and agents from another machine; those already built are kept. Returns `false` if the bytes are
    /// invalid.
    pub(crate) fn take_bytes(&self, bytes: &[u8]) -> bool {
        let (settings, ..) = &self.key;
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

    /// Returns the maps of the pass that a sample belongs to; builds them first if needed.
    pub(crate) fn of_sample(&self, prepared: &PreparedScene, sample: u32) -> &PhotonMaps {
        let pass = sample % self.maps.len() as u32;
        let (settings, seed, _) = &self.key;
        self.maps[pass as usize]
            .get_or_init(|| prepared.on_threads(|| PhotonMaps::new(prepared, &self.plan, settings, *seed, pass)))
    }

    /// Returns the plan of photon and agent emission.
    pub(crate) fn plan(&self) -> &Arc<PhotonPlan> {
        &self.plan
    }

    /// Returns the agents of the picture; calls `make` first if there are none.
    pub(crate) fn agents(&self, make: impl FnOnce() -> Agents) -> &Agents {
        self.agents.get_or_init(make)
    }

    /// Returns `true` if the agents exist.
    pub(crate) fn has_agents(&self) -> bool {
        self.agents.get().is_some()
    }

    /// Returns the agents; `None`: not cast yet.
    pub(crate) fn known_agents(&self) -> Option<&Agents> {
        self.agents.get()
    }

    /// Stores agents that equal what [`Self::agents`] makes.
    pub(crate) fn put_agents(&self, agents: Agents) {
        self.agents.get_or_init(|| agents);
    }

    /// Returns the place of a view's irradiance cache.
    pub(crate) fn cache(&self, view: &View) -> Arc<OnceLock<IrradianceCache>> {
        /// Number of views whose cache is kept.
        const VIEWS_MAX: usize = 2;
        let mut caches = self.caches.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, place)) = caches.iter().find(|(known, _)| known == view) {
            return Arc::clone(place);
        }
        if caches.len() == VIEWS_MAX {
            caches.remove(0);
        }
        let place = CachePlace::default();
        caches.push((view.clone(), Arc::clone(&place)));
        place
    }

    /// Returns the memory of the irradiance caches, in bytes.
    fn cache_bytes(&self) -> usize {
        let caches = self.caches.lock().unwrap_or_else(PoisonError::into_inner);
        caches.iter().filter_map(|(_, place)| place.get()).map(IrradianceCache::memory_bytes).sum()
    }

    /// Returns `true` if the maps of the first pass exist.
    pub(crate) fn is_made(&self) -> bool {
        self.maps[0].get().is_some()
    }

    /// Stores the maps of the first pass, if there are none yet.
    pub(crate) fn put(&self, maps: PhotonMaps) {
        self.maps[0].get_or_init(|| maps);
    }
}
