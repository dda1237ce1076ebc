//! The difference of two pictures, in figures.

use bottega_image::{FlipOptions, Picture, flip, mae, rel_mse, rel_mse_trimmed, rmse};
use schemars::JsonSchema;
use serde::Serialize;

use crate::error::Error;

/// Share of the worst pixels excluded from the trimmed relMSE, so that a few fireflies do not dominate it.
const TRIMMED: f64 = 1e-3;

/// FLIP value above which a pixel counts as visibly different.
const VISIBLE: f32 = 0.1;

/// The difference of a picture from a reference.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Difference {
    /// Root mean squared error, in linear light.
    pub rmse: f64,
    /// Mean absolute error, in linear light.
    pub mae: f64,
    /// Mean squared error relative to the reference (relMSE).
    pub rel_mse: f64,
    /// relMSE without the worst 0.1 % of the pixels.
    pub rel_mse_trimmed: f64,
    /// Mean FLIP over all pixels: 0 no visible difference, above 0.05 clearly different.
    pub flip: f64,
    /// Share of the pixels with FLIP above 0.1, 0 to 1.
    pub flip_visible_share: f64,
    /// Mean of the picture divided by mean of the reference, per channel; `null`: the reference is black.
    pub mean_ratio: [Option<f64>; 3],
    /// FLIP of each pixel, `[height × width]`, 0 to 1.
    #[serde(skip)]
    pub flip_map: Vec<f32>,
}

impl Difference {
    /// Compares a picture with a reference, both in linear light. Returns their difference.
    ///
    /// # Errors
    /// The pictures differ in size.
    pub fn between(picture: &Picture, reference: &Picture) -> Result<Self, Error> {
        if picture.size() != reference.size() {
            let (a, b) = (picture.size(), reference.size());
            return Err(Error::usage(
                format!("the pictures differ in size: {}x{} and {}x{}", a.0, a.1, b.0, b.1),
                "compare pictures of the same size",
            ));
        }
        let flip = flip(reference, picture, &FlipOptions::default())?;
        let visible = flip.map.iter().filter(|&&error| error > VISIBLE).count();
        Ok(Self {
            flip_visible_share: visible as f64 / flip.map.len().max(1) as f64,
            rmse: rmse(reference, picture)?,
            mae: mae(reference, picture)?,
            rel_mse: rel_mse(reference, picture)?,
            rel_mse_trimmed: rel_mse_trimmed(reference, picture, TRIMMED)?,
            flip: flip.mean,
            mean_ratio: mean_ratio(picture, reference),
            flip_map: flip.map,
        })
    }
}

/// Returns the mean of the picture divided by that of the reference, per channel; `None`: the reference is black.
fn mean_ratio(picture: &Picture, reference: &Picture) -> [Option<f64>; 3] {
    let sum =
        |picture: &Picture, channel: usize| picture.data.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>();
    [0, 1, 2].map(|channel| {
        let ratio = sum(picture, channel) / sum(reference, channel);
        ratio.is_finite().then_some(ratio)
    })
}
