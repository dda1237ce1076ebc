//! The built-in engine: paints zones with `bottega-render`, every block of pixels a work unit of the allocator.

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
    AgentUse, PreparedScene, Prepass, RenderWork, View,
    ala::AgentReport,
    integrator::{PathIntegrator, learn_together},
    photon::{MapBytes, cast_photons},
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

/// The built-in engine over the processors of this machine.
pub struct BuiltinEngine {
    shared: Arc<Shared>,
    resources: Arc<Resources>,
    /// What the resources had done before.
    before: HraReport,
    urgency: Urgency,
    /// The life times of all units of a look, and whether nobody looks any more.
    lives: Mutex<Vec<LifeTime<RenderWork>>>,
    is_left: AtomicBool,
    zones: Mutex<Vec<JoinHandle<()>>>,
}

impl BuiltinEngine {
    /// An engine on `options.threads` processors, and on whatever else is given as `devices`: with these, pixels are no
    /// longer the same to the last bit.
    pub fn new(scene: Arc<PreparedScene>, options: BuiltinOptions, devices: Devices) -> Self {
        Self::with_prepass(scene, Arc::default(), options, devices)
    }

    /// The same with what other engines have found out of the scene, and will.
    pub fn with_prepass(
        scene: Arc<PreparedScene>,
        prepass: Arc<Prepass>,
        options: BuiltinOptions,
        devices: Devices,
    ) -> Self {
        let resources = Arc::new(Resources::new(options.threads, devices));
        Self::on(scene, prepass, options, resources)
    }

    /// The same on resources that others may use at the same time, or have used.
    ///
    /// - `options.threads`: must be theirs.
    pub fn on(
        scene: Arc<PreparedScene>,
        prepass: Arc<Prepass>,
        mut options: BuiltinOptions,
        resources: Arc<Resources>,
    ) -> Self {
        // Devices are not guided, so nobody needs to learn.
        if options.threads == 0 {
            options.settings.guiding = false;
            options.settings.agents = AgentUse::default();
        }
        let shared = Shared {
            scene,
            prepass,
            options,
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

    /// The same for a picture that is wanted so soon.
    #[must_use]
    pub fn with_urgency(mut self, urgency: Urgency) -> Self {
        self.urgency = urgency;
        self
    }

    /// Nobody looks at the picture any more: its units that wait are painted by nobody, those under way are dropped. What is painted of
    /// it from now on ends at once, and not complete. Does nothing for a picture that is no [`Urgency::Look`].
    pub fn leave(&self) {
        if self.urgency != Urgency::Look {
            return;
        }
        self.is_left.store(true, Ordering::SeqCst);
        let lives = std::mem::take(&mut *self.lives.lock().unwrap_or_else(PoisonError::into_inner));
        lives.iter().for_each(LifeTime::end);
        // After that, so that nobody takes units back which are to be counted.
        self.shared.cancelled.store(true, Ordering::SeqCst);
    }

    /// A client for units of the picture.
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

    /// Samples taken so far, all pixels together; those of zones under way are in it.
    pub fn samples_done(&self) -> u64 {
        self.shared.samples_done.load(Ordering::Relaxed)
    }

    /// Samples so far whose radiance was not finite, and which therefore counted as black.
    pub fn dropped_count(&self) -> u64 {
        self.shared.dropped_count.load(Ordering::Relaxed)
    }

    /// From now on shows the blocks of pixels to `watcher` as they are painted: each after some milliseconds of work on
    /// it, with the running sums that it has then. Called from several threads, and must return soon. There is one
    /// watcher: a second call does nothing.
    pub fn watch(&self, watcher: impl Fn(&Tile) + Send + Sync + 'static) {
        let _ = self.shared.watcher.set(Box::new(watcher));
    }

    /// What the picture looks like, small and coarse: see [`glimpse`]. `None`: it was ended by the switch.
    ///
    /// - `size`: columns and rows; the camera sees what their ratio says.
    /// - `samples`: paths of each of these pixels.
    ///
    /// # Errors
    /// The allocator has failed.
    pub fn glimpse(
        &self,
        (width, height): (u32, u32),
        samples: u32,
        cancel: &CancelSwitch,
    ) -> Result<Option<Picture>, EngineError> {
        let Shared { scene, options, .. } = &*self.shared;
        let view = View { camera: options.view.camera, width, height };
        let asked = GlimpseOptions { max_depth: options.settings.max_depth, samples };
        glimpse(scene, view, asked, &self.client(self.urgency.first_look()), &|| cancel.is_cancelled())
            .map_err(|error| EngineError::Survey { engine: NAME.to_owned(), reason: error.to_string() })
    }

    /// What the lighting agents of the picture were like and what they were asked so far, if it has any.
    pub fn lighting_agents(&self) -> Option<AgentReport> {
        let Shared { scene, prepass, options: BuiltinOptions { view, settings, .. }, .. } = &*self.shared;
        prepass.lighting_agents(scene, *view, settings.photons?, settings.seed)
    }

    /// What the maps of a picture by photons take so far.
    pub fn map_bytes(&self) -> MapBytes {
        let Shared { scene, prepass, options: BuiltinOptions { view, settings, .. }, .. } = &*self.shared;
        let bytes = |photons| prepass.map_bytes(scene, *view, photons, settings.seed);
        settings.photons.map_or_else(MapBytes::default, bytes)
    }

    /// What the resources of the allocator have done since this engine is there, for whomever.
    pub fn report(&self) -> HraReport {
        self.resources.hra.report().since(&self.before)
    }

    fn prepared(&self, others: Option<&dyn Sharing>) -> Result<(), EngineError> {
        // With the settings of the user: a zone whose settings are lowered must not be the one from which all learn.
        let Shared { scene, prepass, options, .. } = &*self.shared;
        let (view, settings) = (options.view, &options.settings);
        let prepared = match (settings.photons, others) {
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
        let view = View { camera: self.shared.options.view.camera, width, height };
        let max_depth = self.shared.options.settings.max_depth;
        bottega_render::survey(&self.shared.scene, view, max_depth, &self.client(self.urgency.first_look()))
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
        prepass.learnt(scene, options.view, &options.settings)
    }

    fn learn_from(&self, bytes: &[u8]) -> Result<(), EngineError> {
        let Shared { scene, prepass, options, .. } = &*self.shared;
        let learnt = prepass.learn_from(scene, options.view, &options.settings, bytes);
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
        // Whoever was told of the last zone may be the last to know the engine: a thread does not wait for itself.
        let others = zones.drain(..).filter(|zone| zone.thread().id() != thread::current().id());
        for zone in others {
            // A panic in there was already reported by the thread itself; there is nothing left to lose.
            let _ = zone.join();
        }
    }
}
