//! Rendering of whole images by the built-in engine as one zone, with time measurement.

use std::{
    ops::Range,
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, RenderEngine, Tunables, ZoneTask};
use bottega_image::{AovSet, Layout, Rect, Tile};
use bottega_render::{PathSettings, PreparedScene, Prepass, View};

use crate::error::Error;

/// Renders a whole image of the scene's first camera as one zone.
pub(crate) fn paint_zone(
    (scene, prepass): (&Arc<PreparedScene>, &Arc<Prepass>),
    size: (u32, u32),
    settings: PathSettings,
    threads: usize,
    spp: u32,
) -> Result<(Tile, Duration), Error> {
    let view = View::of_scene(scene.scene(), 0, size.0, size.1)?;
    let options = BuiltinOptions { view, settings, layout: Layout::new(AovSet::NONE), threads, wavefront: false };
    let engine = BuiltinEngine::with_prepass(Arc::clone(scene), Arc::clone(prepass), options, Devices::default());
    paint_zone_with(&engine, size, settings, spp)
}

/// Renders a whole image as one zone, with an existing engine.
pub(crate) fn paint_zone_with(
    engine: &BuiltinEngine,
    (width, height): (u32, u32),
    settings: PathSettings,
    spp: u32,
) -> Result<(Tile, Duration), Error> {
    let tunables = Tunables { max_depth: settings.max_depth, light_samples: settings.light_samples };
    paint_samples(engine, Rect::of_size(width, height), tunables, 0..spp, None)
}

/// Renders samples of all pixels of a rectangle. Returns the sums and the time that they took.
///
/// - `tile`: the sums of previous samples.
pub(crate) fn paint_samples(
    engine: &BuiltinEngine,
    rect: Rect,
    tunables: Tunables,
    samples: Range<u32>,
    tile: Option<Tile>,
) -> Result<(Tile, Duration), Error> {
    let task = ZoneTask { tile, ..ZoneTask::new(rect, samples, tunables) };
    let begun = Instant::now();
    let painted = engine.paint(task)?;
    Ok((painted.tile, begun.elapsed()))
}
