//! Camera paths per second of a scene.

use std::{path::Path, sync::Arc, time::Duration};

use bottega::{devices::processors, text::shown};
use bottega_render::{PathSettings, PrepareOptions, PreparedScene, Prepass};
use bottega_scene::LoadOptions;

use crate::{error::Error, painting::paint_zone};

/// The side of the image, in pixels.
const SIDE: u32 = 256;
/// Samples per pixel of one repetition.
const SAMPLES: u32 = 16;

/// Camera paths of a scene, in millions per second.
pub(super) struct PathsRow {
    pub(super) scene: String,
    pub(super) threads: usize,
    pub(super) on_one: f64,
    pub(super) on_all: f64,
}

/// Measures on one thread and on all, alternately; medians.
pub(super) fn measure(scene: &Path, repeat: u16) -> Result<PathsRow, Error> {
    let loaded = bottega_scene::load(scene, &LoadOptions::default())?;
    let threads = processors();
    let options = PrepareOptions { threads, ..PrepareOptions::default() };
    let prepared = Arc::new(PreparedScene::new(Arc::new(loaded.scene), &options)?);
    let subject = (&prepared, &Arc::default());
    let (mut one, mut all) = (Vec::new(), Vec::new());
    for _ in 0..repeat {
        one.push(paint(subject, 1)?);
        all.push(paint(subject, threads)?);
    }
    let rate = |times: &mut Vec<Duration>| {
        times.sort();
        let samples = f64::from(SIDE * SIDE * SAMPLES);
        (samples / times[times.len() / 2].as_secs_f64() / 1e3).round() / 1e3
    };
    Ok(PathsRow { scene: shown(scene), threads, on_one: rate(&mut one), on_all: rate(&mut all) })
}

fn paint(scene: (&Arc<PreparedScene>, &Arc<Prepass>), threads: usize) -> Result<Duration, Error> {
    Ok(paint_zone(scene, (SIDE, SIDE), PathSettings::default(), threads, SAMPLES)?.1)
}
