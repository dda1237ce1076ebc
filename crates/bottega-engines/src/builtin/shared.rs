//! The state that all zones of a picture share.

use std::sync::{
    Arc, OnceLock,
    atomic::{AtomicBool, AtomicU64},
};

use bottega_image::{Layout, Tile};
use bottega_render::{LightGroups, PathSettings, PreparedScene, Prepass, ShadowCatchers, TechniqueJudge, View};

/// The name of the built-in engine.
pub(crate) const NAME: &str = "builtin";

/// The time of a sample of a pixel before any was measured, in nanoseconds.
pub(super) const SAMPLE_NS_GUESSED: u64 = 2_000;

/// The options of the built-in engine.
#[derive(Clone, Debug)]
pub struct BuiltinOptions {
    /// The camera and the size of the picture.
    pub view: View,
    /// Seed, filter and depth; the farm's tunables replace depth and light samples per zone.
    pub settings: PathSettings,
    /// The values kept per pixel.
    pub layout: Layout,
    /// The number of CPU threads; 0: only the devices render.
    pub threads: usize,
    /// True: rays and shading are separate units of work, the paper's decomposition. False: blocks of pixels.
    pub wavefront: bool,
}

/// A callback that receives blocks of pixels while they are rendered.
pub(super) type Watcher = Box<dyn Fn(&Tile) + Send + Sync>;

/// The state that all zones of a picture share.
pub(super) struct Shared {
    pub(super) scene: Arc<PreparedScene>,
    pub(super) prepass: Arc<Prepass>,
    pub(super) options: BuiltinOptions,
    /// Groups of lights whose light is kept in the averaged layers.
    pub(super) light_groups: Option<Arc<LightGroups>>,
    /// The rules that choose between paths and photons, for a picture that tries photons.
    pub(super) technique_judge: Option<Arc<dyn TechniqueJudge>>,
    /// Shadow catchers.
    pub(super) catchers: Option<Arc<ShadowCatchers>>,
    /// The number of devices, without the CPU.
    pub(super) devices: usize,
    pub(super) cancelled: AtomicBool,
    /// The time of one sample of one pixel in nanoseconds, measured from finished units.
    pub(super) sample_ns: AtomicU64,
    /// Samples taken, over all pixels.
    pub(super) samples_done: AtomicU64,
    /// Samples with non-finite radiance.
    pub(super) dropped_count: AtomicU64,
    pub(super) watcher: OnceLock<Watcher>,
}
