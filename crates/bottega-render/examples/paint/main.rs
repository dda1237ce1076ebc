//! Paints a scene on one thread and says how fast: for looking at pictures and for measuring, without the farm.
//!
//! `cargo run --release --example paint -- SCENE OUT.png|OUT.exr WIDTHxHEIGHT SPP [DEPTH] [ENVIRONMENT|-] [REFERENCE.exr] [SEED]`
//!
//! Against a reference it says the ratio of the means and the mean of the relative squared error.

mod peer;

use std::{error::Error, path::Path, sync::Arc, time::Instant};

use bottega_image::{
    ExrOptions, Film, Layout, Metadata, Picture, PngOptions, Rect, Tile, read_picture, write_exr, write_png,
};
use bottega_render::{BlockWork, Filter, PathSettings, PrepareOptions, PreparedScene, View};
use bottega_scene::{LoadOptions, Scene};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene_path, output, size, spp, rest @ ..] = &arguments[..] else {
        return Err("usage: paint SCENE OUT WIDTHxHEIGHT SPP [DEPTH] [ENVIRONMENT|-] [REFERENCE] [SEED]".into());
    };
    let (width, height) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let view = View { camera: 0, width: width.parse()?, height: height.parse()? };
    let max_depth = rest.first().map_or(Ok(16), |depth| depth.parse())?;
    let scene = load(Path::new(scene_path), rest.get(1).filter(|path| *path != "-"))?;
    let prepared = Arc::new(PreparedScene::new(Arc::new(scene), &PrepareOptions::default())?);

    let seed = rest.get(3).map_or(Ok(0), |seed| seed.parse())?;
    let settings = PathSettings { seed, max_depth, filter: Filter::PIXEL, ..PathSettings::default() };
    let rect = Rect::of_size(view.width, view.height);
    let spp: u32 = spp.parse()?;
    let (film, seconds, dropped_count) = paint(&prepared, view, &settings, spp)?;
    let rate = rect.area() as f64 * f64::from(spp) / seconds / 1e6;
    eprintln!("{seconds:.2} s, {rate:.3} Mpaths/s, {dropped_count} samples dropped");
    if let Some(reference) = rest.get(2) {
        compare(&film.to_picture(), &read_picture(reference)?)?;
    }
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
    let settings = Arc::new(*settings);
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

/// The worst thousandth of the pixels is left out of the error, as is usual where a few fireflies would decide it.
fn compare(picture: &Picture, reference: &Picture) -> Result<(), Box<dyn Error>> {
    if (picture.width, picture.height) != (reference.width, reference.height) {
        return Err("picture and reference differ in size".into());
    }
    let sum = |picture: &Picture| -> [f64; 3] {
        std::array::from_fn(|c| picture.data.iter().map(|pixel| f64::from(pixel[c])).sum())
    };
    let (ours, theirs) = (sum(picture), sum(reference));
    let ratios: [f64; 3] = std::array::from_fn(|c| ours[c] / theirs[c]);
    let mut errors: Vec<f32> = picture
        .data
        .iter()
        .zip(&reference.data)
        .map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).powi(2) / (b[c] * b[c] + 1e-2) / 3.0).sum())
        .collect();
    errors.sort_by(f32::total_cmp);
    errors.truncate(errors.len() - errors.len() / 1000);
    let error = errors.iter().map(|&e| f64::from(e)).sum::<f64>() / errors.len() as f64;
    eprintln!("means over those of the reference: {ratios:.4?}, relMSE {error:.5}");
    Ok(())
}
