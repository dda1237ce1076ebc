//! Paints a scene on one thread and says how fast: for looking at pictures and for measuring, without the farm.
//!
//! `cargo run --release --example paint -- SCENE OUT.png|OUT.exr WIDTHxHEIGHT SPP [DEPTH] [ENVIRONMENT]`

mod peer;

use std::{error::Error, path::Path, sync::Arc, time::Instant};

use bottega_image::{ExrOptions, Film, Layout, Metadata, PngOptions, Rect, Tile, write_exr, write_png};
use bottega_render::{BlockWork, Filter, PathSettings, PrepareOptions, PreparedScene, View};
use bottega_scene::{LoadOptions, Scene};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene_path, output, size, spp, rest @ ..] = &arguments[..] else {
        return Err("usage: paint SCENE OUT WIDTHxHEIGHT SPP [DEPTH] [ENVIRONMENT]".into());
    };
    let (width, height) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let view = View { camera: 0, width: width.parse()?, height: height.parse()? };
    let max_depth = rest.first().map_or(Ok(16), |depth| depth.parse())?;
    let scene = load(Path::new(scene_path), rest.get(1))?;
    let prepared = Arc::new(PreparedScene::new(Arc::new(scene), &PrepareOptions::default())?);

    let settings = PathSettings { max_depth, filter: Filter::Box, ..PathSettings::default() };
    let rect = Rect::of_size(view.width, view.height);
    let spp: u32 = spp.parse()?;
    let (film, seconds, dropped_count) = paint(&prepared, view, &settings, spp)?;
    let rate = rect.area() as f64 * f64::from(spp) / seconds / 1e6;
    eprintln!("{seconds:.2} s, {rate:.3} Mpaths/s, {dropped_count} samples dropped");
    if output.ends_with(".exr") {
        write_exr(output, &film, &Metadata::new(), ExrOptions::default())?;
    } else {
        write_png(output, &film, &PngOptions::default(), &Metadata::new())?;
    }
    Ok(())
}

fn load(path: &Path, environment: Option<&String>) -> Result<Scene, Box<dyn Error>> {
    if path.extension().is_some_and(|extension| extension == "json") {
        return peer::load(path);
    }
    let options = LoadOptions { environment: environment.map(Into::into), ..LoadOptions::default() };
    let loaded = bottega_scene::load(path, &options)?;
    for warning in &loaded.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(loaded.scene)
}

/// Block by block, as the farm does.
fn paint(
    prepared: &Arc<PreparedScene>,
    view: View,
    settings: &PathSettings,
    spp: u32,
) -> Result<(Film, f64, u64), Box<dyn Error>> {
    let rect = Rect::of_size(view.width, view.height);
    let layout = Layout::new(bottega_image::AovSet::NONE);
    let mut film = Film::new(rect, layout);
    let settings = Arc::new(settings.clone());
    let start = Instant::now();
    let mut dropped_count = 0;
    for block in rect.blocks(32) {
        let tile = Tile::new(block, layout);
        let (scene, settings) = (Arc::clone(prepared), Arc::clone(&settings));
        let output = BlockWork { scene, view, settings, tile, samples: 0..spp }.perform()?;
        dropped_count += output.dropped_count;
        film.add_tile(&output.tile, |_, _| 1.0);
    }
    Ok((film, start.elapsed().as_secs_f64(), dropped_count))
}
