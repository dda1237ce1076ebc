//! Scene files on a device against the processor: the same samples, so nearly the same picture. The files of the repository, and
//! with `BOTTEGA_SCENES` those of that folder; `BOTTEGA_PICTURES` names a folder for the pictures of both.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use bottega_gpu::{GpuError, GpuPaths, PathOptions, adapters};
use bottega_hra::{Hra, HraConfig, Lane, Window, WorkUnit};
use bottega_image::{
    AovSet, Film, FlipOptions, Layout, Metadata, PngOptions, Rect, Tile, flip, rejected_share_of_films, write_png,
};
use bottega_render::{BlockWork, Filter, PathSettings, PrepareOptions, PreparedScene, RenderOutput, RenderWork, View};
use bottega_scene::LoadOptions;

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;
const SAMPLES: u32 = 16;
/// Share of pixels that may differ by more than a hundredth of their value: paths that graze an edge or meet a facet of glass
/// at its rim go another way.
const DIFFERING_MAX: f64 = 0.05;
/// Share of pixels that the z-test may reject; Mitsuba's tests have the same.
const REJECTED_MAX: f64 = 0.0025;
/// Largest perceived difference of the processor's and the device's picture, beyond that of two seeds, where a last bit decides
/// on the way of many paths: which triangle of a lamp is drawn, say.
const NOISE_RATIO_MAX: f64 = 1.15;
/// Greatest mean perceived difference (FLIP).
const FLIP_MAX: f64 = 0.02;

fn options() -> Option<PathOptions> {
    let there = adapters();
    let software = there.iter().find(|adapter| adapter.name.contains("llvmpipe"));
    let chosen = std::env::var("BOTTEGA_GPU").ok().or(software.or(there.first()).map(|adapter| adapter.name.clone()));
    if chosen.is_none() {
        eprintln!("skipped: no Vulkan adapter; install a driver, or Mesa's llvmpipe");
    }
    let timeout = std::time::Duration::from_secs(300);
    chosen.map(|adapter| PathOptions { adapter: Some(adapter), timeout, ..PathOptions::default() })
}

/// A picture by the processor and by the device.
struct Pair {
    device: Tile,
    processor: Tile,
    /// The processor's work, to be done with another seed.
    again: BlockWork,
}

fn paint(path: &Path, options: &PathOptions) -> Result<Pair, GpuError> {
    let load = LoadOptions { allow_outside: true, ..LoadOptions::default() };
    let loaded = bottega_scene::load(path, &load).expect("a scene");
    let prepare = PrepareOptions { threads: 2, ..PrepareOptions::default() };
    let scene = Arc::new(PreparedScene::new(Arc::new(loaded.scene), &prepare).expect("a sound scene"));
    let settings = PathSettings { guiding: false, max_depth: 8, filter: Filter::PIXEL, ..PathSettings::default() };
    let frame = Rect::of_size(WIDTH, HEIGHT);
    let block = BlockWork {
        scene: Arc::clone(&scene),
        prepass: Arc::default(),
        view: View::of_scene(scene.scene(), 0, WIDTH, HEIGHT).expect("a camera"),
        settings: Arc::new(settings),
        tile: Tile::new(frame, Layout::new(AovSet::NONE)),
        samples: 0..SAMPLES,
        light_groups: None,
        catchers: None,
    };
    let gpu = GpuPaths::new(&scene, options)?;
    let window = Window { packets: 2, units_per_packet: 64, patience: options.timeout, ..Window::default() };
    let hra = Hra::with_lanes(HraConfig::default(), vec![Lane::Windowed(Box::new(gpu), window)]);
    let client = hra.client();
    let blocks =
        frame.blocks(16).map(|rect| BlockWork { tile: Tile::new(rect, block.tile.layout().clone()), ..block.clone() });
    let units = blocks.zip(0..).map(|(block, n)| WorkUnit::new(RenderWork::Block(block), n));
    client.submit_group(units.collect()).expect("units are taken");
    let mut device = block.tile.clone();
    while let Some(completed) = client.take() {
        match completed.output {
            Ok(RenderOutput::Block(output)) => device.copy_from(&output.tile),
            other => panic!("{}: {other:?}", path.display()),
        }
    }
    let other = PathSettings { seed: settings.seed + 1, ..settings };
    let again = BlockWork { settings: Arc::new(other), ..block.clone() };
    Ok(Pair { device, processor: block.perform().expect("a picture").tile, again })
}

impl Pair {
    fn films(&self) -> [Film; 2] {
        [&self.device, &self.processor].map(film)
    }

    /// The perceived difference of two pictures of the processor.
    fn noise(self) -> f64 {
        let other = self.again.perform().expect("a picture").tile;
        seen(&film(&self.processor), &film(&other))
    }

    /// Pixels that differ, and how many standard errors the mean of the differences is away from 0.
    fn differences(&self) -> (f64, f64) {
        let luminance = |pixel: &[f32]| f64::from(0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2]);
        let pixels = self.device.sums().chunks_exact(6).zip(self.processor.sums().chunks_exact(6));
        let pairs: Vec<_> = pixels.map(|(a, b)| (luminance(a), luminance(b))).collect();
        let count = pairs.len() as f64;
        let differing = pairs.iter().filter(|(a, b)| (a - b).abs() > 0.01 * (a + b) + 1e-4).count();
        let mean = pairs.iter().map(|(a, b)| a - b).sum::<f64>() / count;
        let variance = pairs.iter().map(|(a, b)| (a - b - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let whole = pairs.iter().map(|(_, b)| b).sum::<f64>() / count;
        // Invisible differences do not count, even if they are significant.
        let error = (variance / count).sqrt().max(1e-4 * whole);
        (differing as f64 / count, if error > 0.0 { mean / error } else { 0.0 })
    }
}

fn film(tile: &Tile) -> Film {
    let mut film = Film::new(tile.rect(), tile.layout().clone());
    film.add_tile(tile, |_, _| 1.0);
    film
}

fn seen(reference: &Film, film: &Film) -> f64 {
    flip(&reference.to_picture(), &film.to_picture(), &FlipOptions::default()).expect("pictures of one size").mean
}

/// Renders a scene by both. Returns a description of the fault, if there is one.
fn compare(path: &Path, options: &PathOptions) -> Option<String> {
    let parts: Vec<_> = path.iter().rev().take(3).map(|part| part.to_string_lossy()).collect();
    let name = parts.into_iter().rev().collect::<Vec<_>>().join("-");
    let pair = match paint(path, options) {
        Ok(pair) => pair,
        Err(error @ (GpuError::Unsupported(_) | GpuError::TooLarge { .. })) => {
            eprintln!("{name}: refused: {error}");
            return None;
        }
        Err(error) => return Some(format!("{name}: {error}")),
    };
    let (differing, deviation) = pair.differences();
    let films = pair.films();
    if let Some(folder) = std::env::var_os("BOTTEGA_PICTURES").map(PathBuf::from) {
        for (film, by) in films.iter().zip(["device", "processor"]) {
            let path = folder.join(format!("{name}-{by}.png"));
            write_png(path, film, &PngOptions::default(), &Metadata::new()).expect("a folder that can be written");
        }
    }
    let rejected = rejected_share_of_films(&films[0], &films[1], 0.01);
    let seen = seen(&films[1], &films[0]);
    eprintln!(
        "{name}: {:.2} % of the pixels differ, mean by {deviation:.1} standard errors, FLIP {seen:.4}, z-test rejects {rejected:.4}",
        100.0 * differing
    );
    let is_one_by_statistics = rejected <= REJECTED_MAX && deviation.abs() < 4.0;
    let is_nearly_equal = differing <= DIFFERING_MAX && seen <= FLIP_MAX;
    let is_same = is_one_by_statistics && (is_nearly_equal || seen <= NOISE_RATIO_MAX * pair.noise());
    (!is_same).then(|| format!("{name}: {differing} {deviation} {seen}"))
}

#[test]
fn the_scenes_of_the_repository_are_the_same() {
    let Some(options) = options() else { return };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let wrong: Vec<_> = ["cornell-box.glb", "goblets.glb", "clear-coat-test.glb"]
        .iter()
        .filter_map(|name| compare(&folder.join(name), &options))
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
#[ignore = "takes minutes"]
fn larger_scenes_are_the_same() {
    let Some(options) = options() else { return };
    let Some(folder) = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from) else {
        eprintln!("skipped: BOTTEGA_SCENES names no folder");
        return;
    };
    let mut found = Vec::new();
    find(&folder, &mut found);
    let only = std::env::var("BOTTEGA_ONLY").unwrap_or_default();
    let chosen = found.iter().filter(|path| path.to_string_lossy().contains(&only));
    let wrong: Vec<_> = chosen.filter_map(|path| compare(path, &options)).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// All scene files below a folder, in order.
fn find(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            find(&path, found);
        } else if path.extension().is_some_and(|it| it == "glb" || it == "gltf" || it == "xml" || it == "pbrt") {
            found.push(path);
        }
    }
}
