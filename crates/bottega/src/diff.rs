//! `bottega diff`: how two pictures differ, in figures and as a heat map.

use std::process::ExitCode;

use bottega_image::{Canvas, ColorMap, FlipOptions, Picture, flip, mae, read_picture, rel_mse, rel_mse_trimmed, rmse};
use serde::Serialize;

use crate::{cli::DiffArgs, error::CliError};

#[derive(Serialize)]
struct Difference {
    rmse: f64,
    mae: f64,
    rel_mse: f64,
    rel_mse_trimmed: f64,
    flip: f64,
    mean_ratio: [Option<f64>; 3],
}

/// Share of the worst pixels that the trimmed relMSE leaves out, so that one firefly does not hide everything else.
const TRIMMED: f64 = 1e-3;

pub(crate) fn run(args: &DiffArgs) -> Result<ExitCode, CliError> {
    let picture = read_picture(&args.picture)?;
    let reference = read_picture(&args.reference)?;
    if picture.size() != reference.size() {
        let (a, b) = (picture.size(), reference.size());
        return Err(CliError::usage(
            format!("the pictures differ in size: {}x{} and {}x{}", a.0, a.1, b.0, b.1),
            "compare pictures of the same size",
        ));
    }
    let flip = flip(&reference, &picture, &FlipOptions::default())?;
    let difference = Difference {
        rmse: rmse(&reference, &picture)?,
        mae: mae(&reference, &picture)?,
        rel_mse: rel_mse(&reference, &picture)?,
        rel_mse_trimmed: rel_mse_trimmed(&reference, &picture, TRIMMED)?,
        flip: flip.mean,
        mean_ratio: mean_ratio(&picture, &reference),
    };
    if let Some(path) = &args.output {
        Canvas::heat_map(picture.width, picture.height, &flip.map, 1.0, ColorMap::Inferno).write_png(path)?;
    }
    if args.json {
        println!("{}", serde_json::to_string(&difference).unwrap_or_default());
    } else {
        let ratio = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.4}"));
        println!("FLIP         {:.5}   mean; 0: equal to the eye, above 0.05: plainly different", difference.flip);
        println!(
            "relMSE       {:.3e}   ({:.3e} without the worst 0.1 % of the pixels)",
            difference.rel_mse, difference.rel_mse_trimmed
        );
        println!("RMSE         {:.3e}", difference.rmse);
        println!("MAE          {:.3e}", difference.mae);
        println!("mean ratio   {}   red, green, blue", difference.mean_ratio.map(ratio).join(" "));
    }
    let failed = args.fail_above.is_some_and(|limit| difference.flip > f64::from(limit));
    Ok(ExitCode::from(u8::from(failed)))
}

/// Mean of the one over mean of the other, by channel.
fn mean_ratio(picture: &Picture, reference: &Picture) -> [Option<f64>; 3] {
    let sum =
        |picture: &Picture, channel: usize| picture.data.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>();
    [0, 1, 2].map(|channel| {
        let ratio = sum(picture, channel) / sum(reference, channel);
        ratio.is_finite().then_some(ratio)
    })
}
