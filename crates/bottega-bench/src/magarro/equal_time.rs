//! Error at equal time: the gain of a level of optimization over uniform samples that take as long.
//!
//! The error of uniform samples falls with their number, and their time grows with it: error × time is constant for an image. So
//! the gain of another method is the quotient of both products. The part that stays with more samples, because bounces were left
//! out, is the bias: the mean product of the errors of two images with different seeds, whose noise is independent.

use std::io::Write;

use bottega_farm::{Level, Optimization};
use bottega_image::{Picture, rel_mse, rmse, srgb_from_linear};
use serde_json::{Value, json};

use super::{report::Ways, scene::MagarroScene};
use crate::{
    error::Error,
    report::{Report, say},
};

/// The compared levels.
const COMPARED: [Optimization; 3] = [Optimization::Normal, Optimization::Big, Optimization::VeryBig];

/// The number of renders per method, with different seeds. At least two: the bias is estimated from pairs.
const SEEDS: u64 = 4;

/// The first seed of the reference, far from those of the images.
const REFERENCE_SEED: u64 = 1 << 20;

/// Error and time of one method, means over the seeds.
#[derive(Clone, Debug)]
pub(super) struct EqualTimeRow {
    pub(super) ways: Ways,
    pub(super) optimization: Optimization,
    pub(super) seconds: f64,
    /// Mean of (x − r)² ∕ (r² + 0.01).
    pub(super) rel_mse: f64,
    /// Mean squared error of the displayed image.
    pub(super) shown_mse: f64,
    /// The part of both errors that remains for any number of samples.
    pub(super) bias: [f64; 2],
}

impl EqualTimeRow {
    /// Returns error × time of `uniform` over that of this row, by both errors.
    pub(super) fn gains_over(&self, uniform: &Self) -> [f64; 2] {
        [
            uniform.rel_mse * uniform.seconds / (self.rel_mse * self.seconds),
            uniform.shown_mse * uniform.seconds / (self.shown_mse * self.seconds),
        ]
    }
}

/// The results of all methods; the first row is uniform samples.
#[derive(Clone, Debug)]
pub(super) struct EqualTimeReport {
    width: u32,
    height: u32,
    samples: u32,
    reference_samples: u32,
    rows: Vec<EqualTimeRow>,
}

/// Renders a reference, and the scene by some of the paper's methods with several seeds.
///
/// - `reference_samples`: samples per pixel of the reference.
/// - `log`: gets a line per image.
///
/// # Errors
/// The scene cannot be rendered.
pub(super) fn measure(
    scene: &MagarroScene<'_>,
    reference_samples: u32,
    log: &mut dyn Write,
) -> Result<EqualTimeReport, Error> {
    say(log, format_args!("painting the reference, {reference_samples} samples per pixel …"));
    let reference = scene.reference(reference_samples, REFERENCE_SEED)?;
    let ours = COMPARED.map(|optimization| (Ways::Ours, optimization));
    let papers = COMPARED.map(|optimization| (Ways::PapersRules, optimization));
    let ways: Vec<_> = [(Ways::Ours, Optimization::Off)].into_iter().chain(ours).chain(papers).collect();
    // Loop over seeds first, so that other load on the machine affects all methods.
    let mut painted: Vec<(f64, Vec<Picture>)> = vec![(0.0, Vec::new()); ways.len()];
    for seed in 0..SEEDS {
        say(log, format_args!("painting with seed {seed} of {SEEDS} …"));
        for ((ways, optimization), (seconds, pictures)) in ways.iter().zip(&mut painted) {
            let (record, picture) = scene.paint(&scene.settings(Level::Balanced, *optimization, *ways), seed)?;
            *seconds += record.total.as_secs_f64() / SEEDS as f64;
            pictures.push(picture);
        }
    }
    let rows = ways.into_iter().zip(painted).map(|((ways, optimization), (seconds, pictures))| {
        let Errors { rel_mse, shown_mse, bias } = Errors::of(&reference, &pictures)?;
        Ok(EqualTimeRow { ways, optimization, seconds, rel_mse, shown_mse, bias })
    });
    let rows = rows.collect::<Result<_, Error>>()?;
    Ok(EqualTimeReport {
        width: scene.width,
        height: scene.height,
        samples: scene.options.spp,
        reference_samples,
        rows,
    })
}

impl Report for EqualTimeReport {
    fn as_text(&self) -> String {
        let Self { width, height, samples, reference_samples, rows } = self;
        let mut text = format!(
            "{width}x{height}, {samples} samples per pixel, one agent on one thread, means of {SEEDS} seeds; reference: \
             {reference_samples} samples\n\
             gain: error x time of uniform samples over that of the row; bias: the part of the error that more samples \
             leave\n\n\
             rules          seconds   relMSE     bias   gain    shown MSE     bias   gain\n"
        );
        let Some(uniform) = rows.first() else { return text };
        for row in rows {
            let [relative, shown] = row.gains_over(uniform);
            let share = |bias: f64, error: f64| 100.0 * bias.max(0.0) / error;
            let EqualTimeRow { ways, optimization, seconds, rel_mse, shown_mse, bias } = row;
            let rules = if *ways == Ways::Ours { "ours" } else { "paper" };
            text += &format!(
                "{rules:<6} {optimization:<5} {seconds:>8.1} {rel_mse:>10.5} {:>5.1} % {relative:>6.2} {shown_mse:>12.6} \
                 {:>5.1} % {shown:>6.2}\n",
                share(bias[0], *rel_mse),
                share(bias[1], *shown_mse),
            );
        }
        text
    }

    fn as_json(&self) -> Value {
        let uniform = self.rows.first();
        let row = |row: &EqualTimeRow| {
            let EqualTimeRow { ways, optimization, seconds, rel_mse, shown_mse, bias } = row;
            let gains = uniform.map(|uniform| row.gains_over(uniform));
            json!({
                "ways": ways.name(), "optimize": optimization.to_string(), "seconds": seconds, "rel_mse": rel_mse,
                "shown_mse": shown_mse, "bias_rel_mse": bias[0], "bias_shown_mse": bias[1],
                "gain_rel_mse": gains.map(|gains| gains[0]), "gain_shown_mse": gains.map(|gains| gains[1]),
            })
        };
        json!({
            "width": self.width, "height": self.height, "samples": self.samples, "seeds": SEEDS,
            "reference_samples": self.reference_samples, "rows": self.rows.iter().map(row).collect::<Vec<_>>(),
        })
    }
}

/// The errors of images that differ by their seeds.
struct Errors {
    rel_mse: f64,
    shown_mse: f64,
    bias: [f64; 2],
}

impl Errors {
    fn of(reference: &Picture, pictures: &[Picture]) -> Result<Self, Error> {
        let shown = |picture: &Picture| -> Picture {
            let mut shown = picture.clone();
            shown.data.iter_mut().flatten().for_each(|value| *value = srgb_from_linear(value.clamp(0.0, 1.0)));
            shown
        };
        let (shown_reference, shown_pictures) = (shown(reference), pictures.iter().map(shown).collect::<Vec<_>>());
        let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let relative = pictures.iter().map(|picture| Ok(rel_mse(reference, picture)?)).collect::<Result<_, Error>>()?;
        let squared = shown_pictures.iter().map(|picture| Ok(rmse(&shown_reference, picture)?.powi(2)));
        Ok(Self {
            rel_mse: mean(relative),
            shown_mse: mean(squared.collect::<Result<_, Error>>()?),
            bias: [
                shared_error(reference, pictures, |r| r * r + 0.01),
                shared_error(&shown_reference, &shown_pictures, |_| 1.0),
            ],
        })
    }
}

/// Returns the mean product of the errors of two images, over all pairs: independent noise cancels.
fn shared_error(reference: &Picture, pictures: &[Picture], scale: impl Fn(f64) -> f64) -> f64 {
    let count = pictures.len() as f64;
    let mut sum = 0.0;
    for (pixel, r) in reference.data.iter().enumerate() {
        for channel in 0..3 {
            let r = f64::from(r[channel]);
            let errors = pictures.iter().map(|picture| f64::from(picture.data[pixel][channel]) - r);
            let (all, squares) = errors.fold((0.0, 0.0), |(all, squares), e| (all + e, squares + e * e));
            // (Σe)² − Σe² is twice the sum over pairs.
            sum += (all * all - squares) / (count * (count - 1.0)) / scale(r);
        }
    }
    sum / (3 * reference.data.len().max(1)) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image with a constant difference `bias` to black, and noise from a seed.
    fn picture(bias: f32, noise: f32, seed: u32) -> Picture {
        let mut picture = Picture::new(64, 64);
        let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
        for value in picture.data.iter_mut().flatten() {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            *value = bias + noise * (state as f32 / u32::MAX as f32 - 0.5);
        }
        picture
    }

    #[test]
    fn noise_is_no_bias_and_bias_is_not_lost_in_noise() {
        let reference = Picture::new(64, 64);
        let of = |bias: f32| {
            let pictures: Vec<_> = (1..5).map(|seed| picture(bias, 1.0, seed)).collect();
            shared_error(&reference, &pictures, |_| 1.0)
        };
        // The noise alone has a variance of 1/12.
        assert!(of(0.0).abs() < 2e-3, "{}", of(0.0));
        assert!((of(0.3) - 0.09).abs() < 6e-3, "{}", of(0.3));
    }

    #[test]
    fn half_the_error_in_half_the_time_is_four_times_as_good() {
        let row = |seconds, error| EqualTimeRow {
            ways: Ways::Ours,
            optimization: Optimization::Off,
            seconds,
            rel_mse: error,
            shown_mse: 2.0 * error,
            bias: [0.0; 2],
        };
        assert_eq!(row(1.0, 0.5).gains_over(&row(2.0, 1.0)), [4.0, 4.0]);
    }
}
