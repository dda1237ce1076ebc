//! The built-in engine: renders zones with `bottega-render`; each block of pixels is a work unit of the allocator.

mod resources;
mod shared;
mod urgency;
mod waves;
mod zone;

use std::{
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
};

use bottega_hra::{HraClient, HraReport, LifeTime};
use bottega_image::{Picture, Tile};
use bottega_render::{
    AgentUse, LightGroups, PreparedScene, Prepass, RenderError, RenderWork, ShadowCatchers, TechniqueJudge,
    ala::AgentReport,
    integrator::{PathIntegrator, learn_together},
    photon::{MapBytes, cast_photons, prepare_techniques},
    survey::{GlimpseOptions, glimpse},
};

pub(crate) use self::shared::NAME;
pub use self::{
    resources::{Devices, Resources},
    shared::BuiltinOptions,
    urgency::Urgency,
};
use self::{
    shared::{SAMPLE_NS_GUESSED, Shared},
    zone::ZonePainter,
};
use crate::{CancelSwitch, EngineDescription, EngineError, RenderEngine, Sharing, Survey, ZoneCallback, ZoneTask};

/// The built-in engine, on the processors and devices of this machine.
pub struct BuiltinEngine {
    shared: Arc<Shared>,
    resources: Arc<Resources>,
    /// The report of the resources when this engine was created.
    before: HraReport,
    urgency: Urgency,
    /// The life times of all units of a [`Urgency::Look`]; and whether the picture was left.
    lives: Mutex<Vec<LifeTime<RenderWork>>>,
    is_left: AtomicBool,
    zones: Mutex<Vec<JoinHandle<()>>>,
}

impl BuiltinEngine {
    /// Returns an engine on `options.threads` processors and on `devices`: with devices, pixels are no longer bit-identical.
    pub fn new(scene: Arc<PreparedScene>, options: BuiltinOptions, devices: Devices) -> Self {
        Self::with_prepass(scene, Arc::default(), options, devices)
    }

    /// Returns an engine like that of [`BuiltinEngine::new`], which shares the prepass of the scene with other engines.
    pub fn with_prepass(
        scene: Arc<PreparedScene>,
        prepass: Arc<Prepass>,
        options: BuiltinOptions,
        devices: Devices,
    ) -> Self {
        let resources = Arc::new(Resources::new(options.threads, devices, None));
        Self::on(scene, prepass, options, resources)
    }

    /// Returns an engine on resources that other engines may share.
    ///
    /// - `options.threads`: must be the number of the resources' threads.
    pub fn on(
        scene: Arc<PreparedScene>,
        prepass: Arc<Prepass>,
        mut options: BuiltinOptions,
        resources: Arc<Resources>,
    ) -> Self {
        // Devices do not use guiding, so learning is useless.
        if options.threads == 0 {
            options.settings.guiding = false;
            options.settings.agents = AgentUse::default();
        }
        let shared = Shared {
            scene,
            prepass,
            options,
            light_groups: None,
            technique_judge: None,
            catchers: None,
            devices: resources.devices,
            cancelled: AtomicBool::new(false),
            sample_ns: AtomicU64::new(SAMPLE_NS_GUESSED),
            samples_done: AtomicU64::new(0),
            dropped_count: AtomicU64::new(0),
            watcher: OnceLock::new(),
        };
        let before = resources.hra.report();
        Self {
            shared: Arc::new(shared),
            resources,
            before,
            urgency: Urgency::default(),
            lives: Mutex::default(),
            is_left: AtomicBool::new(false),
            zones: Mutex::default(),
        }
    }

    /// Stores the light of each group of lights separately, in the averaged layers of the picture: red, green and blue of
    /// each group. `None`: there are no groups.
    ///
    /// # Panics
    /// The engine already renders.
    #[must_use]
    pub fn with_light_groups(mut self, groups: Option<Arc<LightGroups>>) -> Self {
        Arc::get_mut(&mut self.shared).expect("no zone is rendered yet").light_groups = groups;
        self
    }

    /// Hides shadow catchers from the camera, and stores the light on them in the layers of catchers. `None`: there are none.
    ///
    /// # Panics
    /// The engine already renders.
    #[must_use]
    pub fn with_catchers(mut self, catchers: Option<Arc<ShadowCatchers>>) -> Self {
        Arc::get_mut(&mut self.shared).expect("no zone is rendered yet").catchers = catchers;
        self
    }

    /// Sets the rules that choose between paths and photons; a picture that tries photons needs them. Their digest is
    /// [`PathSettings::technique_rules`](bottega_render::PathSettings::technique_rules).
    ///
    /// # Panics
    /// The engine already renders.
    #[must_use]
    pub fn with_technique_judge(mut self, judge: Option<Arc<dyn TechniqueJudge>>) -> Self {
        Arc::get_mut(&mut self.shared).expect("no zone is rendered yet").technique_judge = judge;
        self
    }

    /// Sets the urgency of the picture; initially it is [`Urgency::Picture`].
    #[must_use]
    pub fn with_urgency(mut self, urgency: Urgency) -> Self {
        self.urgency = urgency;
        self
    }

    /// Abandons an interactive picture: its waiting units are discarded, running ones are dropped, and later tasks end at
    /// once, incomplete. Does nothing unless the picture is a [`Urgency::Look`].
    pub fn leave(&self) {
        if self.urgency != Urgency::Look {
            return;
        }
        self.is_left.store(true, Ordering::SeqCst);
        let lives = std::mem::take(&mut *self.lives.lock().unwrap_or_else(PoisonError::into_inner));
        lives.iter().for_each(LifeTime::end);
        // Cancel last, so that no thread takes back units that the client counts as expired.
        self.shared.cancelled.store(true, Ordering::SeqCst);
    }

    /// Returns an allocator client for units of the picture.
    fn client(&self, priority: i32) -> HraClient<RenderWork> {
        let client = self.resources.hra.client_of(priority);
        if self.urgency == Urgency::Look {
            let mut lives = self.lives.lock().unwrap_or_else(PoisonError::into_inner);
            lives.retain(|life| !life.is_over());
            lives.push(client.life_time());
            drop(lives);
            if self.is_left.load(Ordering::SeqCst) {
                client.expire();
            }
        }
        client
    }

    /// Returns the number of samples taken so far, over all pixels, including those of unfinished zones.
    pub fn samples_done(&self) -> u64 {
        self.shared.samples_done.load(Ordering::Relaxed)
    }

    /// Returns the number of samples so far with non-finite radiance, which count as black.
    pub fn dropped_count(&self) -> u64 {
        self.shared.dropped_count.load(Ordering::Relaxed)
    }

    /// Shows each block of pixels to `watcher` while it is rendered: every few milliseconds of work, with its current
    /// running sums. Called from several threads; must return soon. Only the first call has an effect.
    pub fn watch(&self, watcher: impl Fn(&Tile) + Send + Sync + 'static) {
        let _ = self.shared.watcher.set(Box::new(watcher));
    }

    /// Renders a small, coarse image of the picture: see [`glimpse`]. `None`: it was cancelled.
    ///
    /// - `size`: columns and rows; their ratio is the aspect ratio of the camera.
    /// - `samples`: paths per pixel of this image.
    ///
    /// # Errors
    /// The allocator fails.
    pub fn glimpse(
        &self,
        (width, height): (u32, u32),
        samples: u32,
        cancel: &CancelSwitch,
    ) -> Result<Option<Picture>, EngineError> {
        let Shared { scene, options, .. } = &*self.shared;
        let view = options.view.sized(width, height);
        let glimpse_options = GlimpseOptions { max_depth: options.settings.max_depth, samples };
        glimpse(scene, &view, glimpse_options, &self.client(self.urgency.first_look()), &|| cancel.is_cancelled())
            .map_err(|error| EngineError::Survey { engine: NAME.to_owned(), reason: error.to_string() })
    }

    /// Returns statistics of the picture's lighting agents; `None`: the picture has none, or they have not started yet.
    pub fn lighting_agents(&self) -> Option<AgentReport> {
        let Shared { scene, prepass, options: BuiltinOptions { view, settings, .. }, .. } = &*self.shared;
        prepass.lighting_agents(scene, view, settings.photons?, settings.seed)
    }

    /// Returns the number of zones that photons render, and that of all zones, of a picture that tries photons; `None`: it
    /// does not, or it is too small, or nothing is decided yet.
    pub fn zones_by_photons(&self) -> Option<[usize; 2]> {
        let Shared { prepass, options, .. } = &*self.shared;
        prepass.zones_by_photons(&options.view, &options.settings)
    }

    /// Returns the memory of the photon maps so far, in bytes.
    pub fn map_bytes(&self) -> MapBytes {
        let Shared { scene, prepass, options: BuiltinOptions { view, settings, .. }, .. } = &*self.shared;
        let bytes = |photons| prepass.map_bytes(scene, view, photons, settings.seed);
        settings.photons.map_or_else(MapBytes::default, bytes)
    }

    /// Returns the work of the resources since this engine was created, for all engines that share them.
    pub fn report(&self) -> HraReport {
        self.resources.hra.report().since(&self.before)
    }

    fn prepared(&self, others: Option<&dyn Sharing>) -> Result<(), EngineError> {
        // Use the user's settings: all zones learn from this, also those with lowered settings.
        let Shared { scene, prepass, options, technique_judge, .. } = &*self.shared;
        let (view, settings) = (&options.view, &options.settings);
        let prepared = match (settings.photons, others) {
            (Some(_), _) if settings.tries_photons => match technique_judge {
                Some(judge) => {
                    let client = self.client(self.urgency.priority());
                    prepare_techniques(scene, prepass, view, settings, &**judge, (&client, others))
                }
                None => Err(RenderError::Untried),
            },
            (None, None) => PathIntegrator::new(scene, prepass, view, settings).map(|_| ()),
            (None, Some(others)) => learn_together(scene, prepass, view, settings, others),
            (Some(_), _) => cast_photons(scene, prepass, view, settings, &self.client(self.urgency.priority()), others),
        };
        prepared.map_err(|error| EngineError::Survey { engine: NAME.to_owned(), reason: error.to_string() })
    }
}

impl RenderEngine for BuiltinEngine {
    fn describe(&self) -> EngineDescription {
        EngineDescription {
            name: NAME.to_owned(),
            has_max_depth: true,
            has_light_samples: true,
            resumes_samples: true,
            is_profiled: true,
            exact_by_pixel: self.shared.devices == 0,
        }
    }

    fn survey(&self, width: u32, height: u32) -> Result<Survey, EngineError> {
        let view = self.shared.options.view.sized(width, height);
        let max_depth = self.shared.options.settings.max_depth;
        bottega_render::survey(&self.shared.scene, &view, max_depth, &self.client(self.urgency.first_look()))
            .map_err(|error| EngineError::Survey { engine: NAME.to_owned(), reason: error.to_string() })
    }

    fn prepare(&self) -> Result<(), EngineError> {
        self.prepared(None)
    }

    fn prepare_with(&self, others: &dyn Sharing) -> Result<(), EngineError> {
        self.prepared(Some(others))
    }

    fn learnt(&self) -> Option<Vec<u8>> {
        let Shared { scene, prepass, options, .. } = &*self.shared;
        prepass.learnt(scene, &options.view, &options.settings)
    }

    fn learn_from(&self, bytes: &[u8]) -> Result<(), EngineError> {
        let Shared { scene, prepass, options, .. } = &*self.shared;
        let learnt = prepass.learn_from(scene, &options.view, &options.settings, bytes);
        learnt.map_err(|error| EngineError::Survey { engine: NAME.to_owned(), reason: error.to_string() })
    }

    fn start(&self, task: ZoneTask, done: ZoneCallback) {
        let shared = Arc::clone(&self.shared);
        let client = self.client(self.urgency.priority());
        let zone = thread::spawn(move || done(ZonePainter::new(&shared, client, task).paint()));
        let mut zones = self.zones.lock().unwrap_or_else(PoisonError::into_inner);
        zones.retain(|zone| !zone.is_finished());
        zones.push(zone);
    }
}

impl Drop for BuiltinEngine {
    fn drop(&mut self) {
        self.shared.cancelled.store(true, Ordering::Relaxed);
        let zones = self.zones.get_mut().unwrap_or_else(PoisonError::into_inner);
        // The callback of the last zone may drop the engine: a thread must not join itself.
        let others = zones.drain(..).filter(|zone| zone.thread().id() != thread::current().id());
        for zone in others {
            // The thread has reported a panic itself.
            let _ = zone.join();
        }
    }
}
