//! `bottega diff`: the difference of two images in numbers and as a heat map, and visible seams between zones.

use std::{fs, path::Path, process::ExitCode};

use bottega_image::{Canvas, ColorMap, Picture, Rect, Seams, read_picture, seams};
use serde::Deserialize;
use serde_json::json;

use bottega::{difference::Difference, text::shown};

use crate::{cli::DiffArgs, error::CliError};

/// Seams are reported if their probability by chance is below this.
const SIGNIFICANCE: f64 = 1e-3;

pub(crate) fn run(args: &DiffArgs) -> Result<ExitCode, CliError> {
    let picture = read_picture(&args.picture)?;
    let reference = args.reference.as_deref().map(read_picture).transpose()?;
    let difference = reference.as_ref().map(|reference| compare(args, &picture, reference)).transpose()?;
    let seams =
        args.seams.as_deref().map(|path| find_seams(path, args.level, &picture, reference.as_ref())).transpose()?;
    if args.json {
        let mut report = difference.as_ref().map_or_else(|| json!({}), |difference| json!(difference));
        if let Some(seams) = &seams {
            report["seams"] = json!({"pieces": seams.pieces, "z": seams.z, "p": seams.p(), "ratio": seams.ratio});
        }
        println!("{report}");
    } else {
        difference.iter().for_each(tell);
        seams.iter().for_each(tell_seams);
    }
    let is_too_much = |difference: &Difference| args.fail_above.is_some_and(|limit| difference.flip > f64::from(limit));
    Ok(ExitCode::from(u8::from(difference.as_ref().is_some_and(is_too_much))))
}

fn compare(args: &DiffArgs, picture: &Picture, reference: &Picture) -> Result<Difference, CliError> {
    let difference = Difference::between(picture, reference)?;
    if let Some(path) = &args.output {
        Canvas::heat_map(picture.width, picture.height, &difference.flip_map, 1.0, ColorMap::Inferno)
            .write_png(path)?;
    }
    Ok(difference)
}

fn tell(difference: &Difference) {
    let ratio = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.4}"));
    println!("FLIP         {:.5}   mean; 0: equal to the eye, above 0.05: plainly different", difference.flip);
    println!("FLIP > 0.1   {:.3} %   of the pixels", 100.0 * difference.flip_visible_share);
    println!(
        "relMSE       {:.3e}   ({:.3e} without the worst 0.1 % of the pixels)",
        difference.rel_mse, difference.rel_mse_trimmed
    );
    println!("RMSE         {:.3e}", difference.rmse);
    println!("MAE          {:.3e}", difference.mae);
    println!("mean ratio   {}   red, green, blue", difference.mean_ratio.map(ratio).join(" "));
}

fn tell_seams(seams: &Seams) {
    let verdict = match seams.p() {
        _ if seams.pieces == 0 => "there is nothing to compare",
        p if p < SIGNIFICANCE => "zones have seams",
        _ => "no significant seams",
    };
    println!(
        "seams        z = {:.2} (p = {:.2e}), steps across edges {:.3} times those inside, {} pieces: {verdict}",
        seams.z,
        seams.p(),
        seams.ratio,
        seams.pieces
    );
}

/// The parts of an index.json that are needed here.
#[derive(Deserialize)]
struct Index {
    size: [u32; 2],
    levels: Vec<IndexedLevel>,
}

#[derive(Deserialize)]
struct IndexedLevel {
    level: u8,
    zones: Vec<IndexedZone>,
}

#[derive(Deserialize)]
struct IndexedZone {
    rect: [u32; 4],
}

fn find_seams(path: &Path, level: u8, picture: &Picture, reference: Option<&Picture>) -> Result<Seams, CliError> {
    let text = fs::read_to_string(path).map_err(|source| CliError::read(path.to_owned(), source))?;
    let unusable = |problem: String| {
        CliError::usage(
            format!("`{}` {problem}", shown(path)),
            "give the index.json that `bottega analyze` wrote of this picture's scene",
        )
    };
    let index: Index = bottega::json::from_slice(text.as_bytes())
        .map_err(|error| unusable(format!("is not an index of zones: {error}")))?;
    let [width, height] = index.size;
    if (width, height) != picture.size() {
        let (w, h) = picture.size();
        return Err(unusable(format!("has the zones of a picture of {width}x{height}, not of {w}x{h}")));
    }
    let zones = index.levels.into_iter().find(|indexed| indexed.level == level);
    let zones = zones.ok_or_else(|| unusable(format!("has no zones of level {level}")))?.zones;
    let rects = zones.iter().map(|&IndexedZone { rect: [x0, y0, x1, y1] }| {
        if x0 > x1 || y0 > y1 {
            return Err(unusable(format!("has a zone {x0},{y0},{x1},{y1} of negative size")));
        }
        Ok(Rect { x0, y0, x1, y1 })
    });
    Ok(seams(picture, reference, &rects.collect::<Result<Vec<_>, _>>()?)?)
}
