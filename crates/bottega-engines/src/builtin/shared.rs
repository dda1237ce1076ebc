//! The part of a picture that all its zones share.

use std::sync::{
    Arc, OnceLock,
    atomic::{AtomicBool, AtomicU64},
};

use bottega_image::{Layout, Tile};
use bottega_render::{PathSettings, PreparedScene, Prepass, View};

pub(crate) const NAME: &str = "builtin";

/// What a sample of a pixel may take before any was measured.
pub(super) const SAMPLE_NS_GUESSED: u64 = 2_000;

/// The options of the built-in engine.
#[derive(Clone, Debug)]
pub struct BuiltinOptions {
    /// Which camera, at which size.
    pub view: View,
    /// Seed, filter and depth; the farm's tunables take the place of depth and light samples zone by zone.
    pub settings: PathSettings,
    /// Which values a pixel keeps.
    pub layout: Layout,
    /// Processors to use; 0: none, the devices do all.
    pub threads: usize,
    /// Whether rays are units of work of their own, and shading is another: the paper's decomposition. Blocks of pixels else.
    pub wavefront: bool,
}

/// Sees blocks of pixels as they are painted.
pub(super) type Watcher = Box<dyn Fn(&Tile) + Send + Sync>;

/// What all zones of a picture have in common.
pub(super) struct Shared {
    pub(super) scene: Arc<PreparedScene>,
    pub(super) prepass: Arc<Prepass>,
    pub(super) options: BuiltinOptions,
    /// How many there are beside the processors.
    pub(super) devices: usize,
    pub(super) cancelled: AtomicBool,
    /// Nanoseconds that one sample of one pixel takes, learnt from the units done so far.
    pub(super) sample_ns: AtomicU64,
    /// Samples taken, all pixels together.
    pub(super) samples_done: AtomicU64,
    /// Samples whose radiance was not finite.
    pub(super) dropped_count: AtomicU64,
    pub(super) watcher: OnceLock<Watcher>,
}
