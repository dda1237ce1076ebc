//! `bottega engines try`: renders a small image as a whole and in windows.

use std::{fs, process::ExitCode, time::Instant};

use bottega::{
    devices::processors,
    engines::{absolute, located, parameters},
    text::shown,
};
use bottega_engines::external::{EngineTrial, LocatedEngine, SceneRequest, Session, manifest::Determinism};
use bottega_image::{ExrOptions, Metadata, Picture, Rect, rel_mse, seams, write_exr};

use super::args::TryArgs;
use crate::error::CliError;

/// The number of rows and columns of windows.
const WINDOWS: u32 = 3;
/// Seams with a p-value below this count as visible.
const SEEN: f64 = 1e-4;

pub(super) fn run(args: &TryArgs) -> Result<ExitCode, CliError> {
    let engine = located(&args.folders, &args.name)?;
    let failed = |source| bottega::Error::External { engine: args.name.clone(), source };
    let request = request(args, &engine)?;
    let begun = Instant::now();
    let session = Session::open(&engine, &request).map_err(failed)?;
    let opened = session.opened().clone();
    println!("opened    {}x{} pixels after {:.2} s", opened.width, opened.height, begun.elapsed().as_secs_f64());
    let small = |side: u32| (side / 4).max(8.min(side));
    let size = args.size.map_or((small(opened.width), small(opened.height)), |size| (size.width, size.height));
    drop(session);
    let frame = Rect::of_size(size.0, size.1);
    let request = SceneRequest { size: Some(size), ..request };
    let trial = |seed| EngineTrial::begin(&engine, &request, seed);
    let trials = (trial(1).map_err(failed)?, trial(2).map_err(failed)?);
    let (whole, whole_time) = trials.0.paint(&[frame], args.spp)?;
    let (other, _) = trials.1.paint(&[frame], args.spp)?;
    let parts: Vec<Rect> = cut(frame);
    let (windows, windows_time) = trials.0.paint(&parts, args.spp)?;
    let (_, one_time) = trials.0.paint(&[Rect::new(0, 0, 1.max(frame.x1 / 64), 1.max(frame.y1 / 64))], 1)?;
    println!("whole     {}x{} pixels, {} samples: {:.2} s", size.0, size.1, args.spp, whole_time.as_secs_f64());
    let [all, one] = [windows_time, one_time].map(|time| time.as_secs_f64());
    println!("windows   {}: {all:.2} s; a small one of one sample: {one:.3} s", parts.len());
    compare(&whole.to_picture(), &other.to_picture(), &windows.to_picture(), &parts, &engine)?;
    if let Some(folder) = &args.output {
        fs::create_dir_all(folder).map_err(|source| CliError::write(folder.clone(), source))?;
        for (name, film) in [("full.exr", &whole), ("windows.exr", &windows)] {
            write_exr(folder.join(name), film, &Metadata::new(), ExrOptions::default())?;
        }
        println!("written   {}", shown(folder));
    }
    Ok(ExitCode::SUCCESS)
}

fn request(args: &TryArgs, engine: &LocatedEngine) -> Result<SceneRequest, CliError> {
    Ok(SceneRequest {
        scene: absolute(&args.scene)?,
        size: args.size.map(|size| (size.width, size.height)),
        frame: None,
        threads: args.threads.map_or_else(processors, usize::from),
        view: None,
        trust: args.trust,
        parameters: parameters(engine, &args.options.iter().cloned().collect())?,
        outside: Vec::new(),
    })
}

fn cut(frame: Rect) -> Vec<Rect> {
    let edge = |side: u32, i: u32| side * i / WINDOWS;
    let cell = |i: u32| {
        let (column, row) = (i % WINDOWS, i / WINDOWS);
        Rect::new(edge(frame.x1, column), edge(frame.y1, row), edge(frame.x1, column + 1), edge(frame.y1, row + 1))
    };
    (0..WINDOWS * WINDOWS).map(cell).filter(|rect| !rect.is_empty()).collect()
}

/// Prints the difference between the windows and the whole, next to the difference between two seeds.
fn compare(
    whole: &Picture,
    other: &Picture,
    windows: &Picture,
    parts: &[Rect],
    engine: &LocatedEngine,
) -> Result<(), CliError> {
    let equal = whole.data.iter().zip(&windows.data).filter(|(a, b)| a == b).count();
    println!("equal     {equal} of {} pixels have the same bits", whole.data.len());
    let (apart, noise) = (rel_mse(whole, windows)?, rel_mse(whole, other)?);
    println!("apart     relMSE {apart:.3e} between whole and windows, {noise:.3e} between two seeds");
    let mean = |picture: &Picture| {
        let sum: f64 = picture.data.iter().flatten().map(|value| f64::from(*value)).sum();
        sum / (3 * picture.data.len()) as f64
    };
    println!("mean      {:.5} whole, {:.5} windows, {:.5} another seed", mean(whole), mean(windows), mean(other));
    // Compare with another seed, so that edges of the scene itself do not count as seams.
    let found = seams(windows, Some(other), parts)?;
    println!("seams     z = {:.2}, p = {:.3} that there are none", found.z, found.p());
    let is_exact = engine.manifest().determinism == Determinism::Frame;
    if is_exact && equal < whole.data.len() {
        return Err(CliError::failed(
            "the windows do not have the bits of the whole frame, as the manifest says",
            "correct `determinism` in the manifest, or the engine's worker",
        ));
    }
    if found.p() < SEEN {
        return Err(CliError::failed(
            "the edges of the windows can be seen",
            "the windows may be off by a pixel, or the pixel filter does not reach across their edges",
        ));
    }
    Ok(())
}
