//! Rendering of a scene file with its own settings, at a smaller size.

use std::{path::Path, sync::Arc, thread};

use bottega_image::{AovSet, Film, Layout, Rect, Tile};
use bottega_render::{BlockWork, Filter, PathSettings, PhotonSettings, PrepareOptions, PreparedScene, Prepass, View};
use bottega_scene::{LoadOptions, Loaded};

/// Threads that render; the picture does not depend on their number.
const THREADS: u32 = 2;

/// Number of pictures per scene; their differences measure the noise.
const SEEDS: u32 = 4;

/// Renders a scene with several seeds.
///
/// - `change`: the change to the scene before it is rendered.
/// - `samples`: samples per pixel, all seeds together.
pub(crate) fn paint(path: &Path, size: (u32, u32), samples: u32, change: impl FnOnce(&mut Loaded)) -> Vec<Film> {
    paint_by(path, size, samples, change, None)
}

/// As [`paint`], by photons if `photons` are given.
pub(crate) fn paint_by(
    path: &Path,
    size: (u32, u32),
    samples: u32,
    change: impl FnOnce(&mut Loaded),
    photons: Option<PhotonSettings>,
) -> Vec<Film> {
    let options = LoadOptions { allow_outside: true, ..LoadOptions::default() };
    let mut loaded = bottega_scene::load(path, &options).expect("a scene");
    change(&mut loaded);
    let options = PrepareOptions { threads: THREADS as usize, ..PrepareOptions::default() };
    let prepared = Arc::new(PreparedScene::new(Arc::new(loaded.scene), &options).expect("a sound scene"));
    let settings = |seed: u32| PathSettings {
        seed: seed.into(),
        max_depth: loaded.hints.max_depth.unwrap_or(64).min(64),
        // The mean over a block of the reference's pixels; their own filter is small in comparison.
        filter: Filter::PIXEL,
        photons,
        planned_samples: photons.map_or(PathSettings::default().planned_samples, |_| samples.div_ceil(SEEDS)),
        ..PathSettings::default()
    };
    let samples = samples.div_ceil(SEEDS);
    let subject = (&prepared, &Arc::default());
    (0..SEEDS).map(|seed| paint_once(subject, &Arc::new(settings(seed)), size, samples)).collect()
}

fn paint_once(
    (prepared, prepass): (&Arc<PreparedScene>, &Arc<Prepass>),
    settings: &Arc<PathSettings>,
    (width, height): (u32, u32),
    samples: u32,
) -> Film {
    let frame = Rect::of_size(width, height);
    let layout = Layout::new(AovSet::NONE);
    let mut film = Film::new(frame, layout.clone());
    let bands: Vec<Rect> = (0..height).step_by(4).map(|y| Rect::new(0, y, width, (y + 4).min(height))).collect();
    let paint_band = |rect: &Rect| -> Tile {
        let view = View::of_scene(prepared.scene(), 0, width, height).expect("a camera");
        let (scene, prepass, settings) = (Arc::clone(prepared), Arc::clone(prepass), Arc::clone(settings));
        let tile = Tile::new(*rect, layout.clone());
        let work =
            BlockWork { scene, prepass, view, settings, tile, samples: 0..samples, light_groups: None, catchers: None };
        work.perform().expect("a picture").tile
    };
    let paint_every = |first: usize| bands.iter().skip(first).step_by(THREADS as usize).map(paint_band).collect();
    let tiles: Vec<Vec<Tile>> = thread::scope(|scope| {
        let painters: Vec<_> = (0..THREADS as usize).map(|first| scope.spawn(move || paint_every(first))).collect();
        painters.into_iter().map(|painter| painter.join().expect("a painter")).collect()
    });
    tiles.iter().flatten().for_each(|tile| film.add_tile(tile, |_, _| 1.0));
    film
}
