//! Metrics of the difference between two pictures.

mod convolve;
mod flip;
mod moments;
mod seams;

pub use flip::{FlipError, FlipOptions, FlipView, flip};
pub use moments::{Moments, mean_z_score, rejected_share, rejected_share_of_films};
pub use seams::{Seams, seams};

use crate::{ImageError, Picture, srgb_from_linear};

/// Usual `trim` of [`rel_mse_trimmed`]: share of the worst pixels to leave out.
pub const USUAL_TRIM: f64 = 1e-3;

fn check_sizes(a: &Picture, b: &Picture) -> Result<(), ImageError> {
    if a.size() == b.size() { Ok(()) } else { Err(ImageError::SizesDiffer { first: a.size(), second: b.size() }) }
}

/// Iterates over the pairs of values of all pixels and channels, test first.
fn pairs<'a>(reference: &'a Picture, test: &'a Picture) -> impl Iterator<Item = (f64, f64)> + 'a {
    let values = |picture: &'a Picture| picture.data.iter().flatten().map(|&value| f64::from(value));
    values(test).zip(values(reference))
}

/// Returns the mean over pixels and channels; 0 without pixels.
fn mean(values: impl Iterator<Item = f64>, picture: &Picture) -> f64 {
    let count = 3 * picture.data.len();
    if count == 0 { 0.0 } else { values.sum::<f64>() / count as f64 }
}

/// Computes the root mean squared difference, over all pixels and channels. NaN if a picture contains NaN.
///
/// # Errors
/// The pictures differ in size.
pub fn rmse(reference: &Picture, test: &Picture) -> Result<f64, ImageError> {
    check_sizes(reference, test)?;
    Ok(mean(pairs(reference, test).map(|(x, r)| (x - r) * (x - r)), reference).sqrt())
}

/// Computes the mean absolute difference, over all pixels and channels.
///
/// # Errors
/// The pictures differ in size.
pub fn mae(reference: &Picture, test: &Picture) -> Result<f64, ImageError> {
    check_sizes(reference, test)?;
    Ok(mean(pairs(reference, test).map(|(x, r)| (x - r).abs()), reference))
}

/// Computes the relative mean squared error: the mean of (x − r)² / (r² + 0.01) over all pixels and channels.
///
/// # Errors
/// The pictures differ in size.
pub fn rel_mse(reference: &Picture, test: &Picture) -> Result<f64, ImageError> {
    rel_mse_trimmed(reference, test, 0.0)
}

/// Computes [`rel_mse`] without the worst pixels, so that a few fireflies do not dominate.
///
/// - `trim`: share of the pixels to leave out, in [0, 1]; see [`USUAL_TRIM`].
///
/// # Errors
/// The pictures differ in size.
pub fn rel_mse_trimmed(reference: &Picture, test: &Picture, trim: f64) -> Result<f64, ImageError> {
    let mut errors = rel_mse_map(reference, test)?;
    let left_out = (errors.len() as f64 * trim.clamp(0.0, 1.0)).round() as usize;
    let kept = errors.len() - left_out;
    if left_out > 0 && kept > 0 {
        errors.select_nth_unstable_by(kept - 1, f32::total_cmp);
    }
    let sum: f64 = errors[..kept].iter().map(|&error| f64::from(error)).sum();
    Ok(if kept == 0 { 0.0 } else { sum / kept as f64 })
}

/// Computes the relative squared error of every pixel: (x − r)² / (r² + 0.01), averaged over its channels.
///
/// Returns `[height × width]` values.
///
/// # Errors
/// The pictures differ in size.
pub fn rel_mse_map(reference: &Picture, test: &Picture) -> Result<Vec<f32>, ImageError> {
    check_sizes(reference, test)?;
    let of_pixel = |(r, x): (&[f32; 3], &[f32; 3])| {
        let of_channel = |(&r, &x): (&f32, &f32)| {
            let (r, x) = (f64::from(r), f64::from(x));
            (x - r) * (x - r) / (r * r + 1e-2)
        };
        (r.iter().zip(x).map(of_channel).sum::<f64>() / 3.0) as f32
    };
    Ok(reference.data.iter().zip(&test.data).map(of_pixel).collect())
}

/// Computes the mean squared error of displayed values: sRGB-encoded, in [0, 1], over all pixels and channels. It
/// weighs a pixel by how wrong it looks, not by its radiance.
///
/// # Errors
/// The pictures differ in size.
pub fn srgb_mse(reference: &Picture, test: &Picture) -> Result<f64, ImageError> {
    check_sizes(reference, test)?;
    let shown = |value: f64| f64::from(srgb_from_linear(value.clamp(0.0, 1.0) as f32));
    let squared = |(x, r): (f64, f64)| (shown(x) - shown(r)).powi(2);
    Ok(mean(pairs(reference, test).map(squared), reference))
}

/// Ratio of a firefly's luminance to its surroundings.
const FIREFLY_FACTOR: f32 = 100.0;
/// Radius of the surroundings, in pixels.
const FIREFLY_REACH: u32 = 2;
/// Least luminance of the surroundings, as a share of the picture's mean.
const FIREFLY_FLOOR: f64 = 1e-3;

/// Counts the pixels that are more than 100 times as bright as the median of the 5 × 5 pixels around them, or as a
/// thousandth of the picture's mean if that is more.
pub fn firefly_count(picture: &Picture) -> usize {
    let (width, height) = picture.size();
    let luminances: Vec<f32> = picture.data.iter().map(|&pixel| crate::luminance(pixel)).collect();
    let mean = luminances.iter().map(|&value| f64::from(value)).sum::<f64>() / luminances.len().max(1) as f64;
    let floor = (FIREFLY_FLOOR * mean) as f32;
    let mut around = Vec::with_capacity((2 * FIREFLY_REACH as usize + 1).pow(2));
    let mut is_firefly = |x: u32, y: u32| {
        let value = luminances[(y * width + x) as usize];
        // Reject most pixels early.
        if value <= FIREFLY_FACTOR * floor {
            return false;
        }
        around.clear();
        for row in y.saturating_sub(FIREFLY_REACH)..=(y + FIREFLY_REACH).min(height - 1) {
            let (first, last) = (x.saturating_sub(FIREFLY_REACH), (x + FIREFLY_REACH).min(width - 1));
            around.extend_from_slice(&luminances[(row * width + first) as usize..=(row * width + last) as usize]);
        }
        let middle = around.len() / 2;
        let (_, &mut median, _) = around.select_nth_unstable_by(middle, f32::total_cmp);
        value > FIREFLY_FACTOR * median.max(floor)
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).filter(|&(x, y)| is_firefly(x, y)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_difference_is_measured_as_it_is() {
        let reference = Picture::from_fn(10, 10, |_, _| [0.5; 3]);
        let test = Picture::from_fn(10, 10, |_, _| [0.75; 3]);
        assert_eq!(rmse(&reference, &test).unwrap(), 0.25);
        assert_eq!(mae(&reference, &test).unwrap(), 0.25);
        assert!((rel_mse(&reference, &test).unwrap() - 0.0625 / 0.26).abs() < 1e-7);
    }

    #[test]
    fn the_worst_pixels_can_be_left_out() {
        let reference = Picture::from_fn(50, 40, |_, _| [1.0; 3]);
        let mut test = Picture::from_fn(50, 40, |_, _| [1.1; 3]);
        test.data[77] = [1e3; 3];
        test.data[1999] = [f32::NAN; 3];
        let trimmed = rel_mse_trimmed(&reference, &test, USUAL_TRIM).unwrap();
        assert!((trimmed - 0.01 / 1.01).abs() < 1e-6, "{trimmed}");
        assert!(rel_mse(&reference, &test).unwrap().is_nan());
    }

    #[test]
    fn what_a_display_shows_is_compared_as_it_shows_it() {
        let reference = Picture::from_fn(4, 4, |_, _| [1.0; 3]);
        let brighter = Picture::from_fn(4, 4, |_, _| [7.0; 3]);
        assert_eq!(srgb_mse(&reference, &brighter).unwrap(), 0.0, "a display shows both as white");
        let black = Picture::new(4, 4);
        assert!((srgb_mse(&reference, &black).unwrap() - 1.0).abs() < 1e-6);
        // For an expected value of 0.2 (0.5 displayed), black is as wrong as 1.
        let gray = Picture::from_fn(4, 4, |_, _| [0.2140; 3]);
        let [dark, light] = [0.0, 1.0].map(|value| Picture::from_fn(4, 4, |_, _| [value; 3]));
        let [dark, light] = [dark, light].map(|test| srgb_mse(&gray, &test).unwrap());
        assert!((dark - light).abs() < 1e-3, "{dark} {light}");
        assert!(srgb_mse(&reference, &Picture::new(3, 4)).is_err());
    }

    #[test]
    fn fireflies_are_far_brighter_than_what_is_around_them() {
        let mut picture = Picture::from_fn(40, 30, |x, _| [0.01 + 0.1 * x as f32; 3]);
        assert_eq!(firefly_count(&picture), 0);
        picture.data[0] = [50.0; 3];
        picture.data[40 * 30 - 1] = [1e4; 3];
        picture.data[40 * 15 + 20] = [150.0; 3];
        assert_eq!(firefly_count(&picture), 2, "the last is 75 times as bright as its surroundings");
        let mut dark = Picture::new(9, 9);
        assert_eq!(firefly_count(&dark), 0);
        dark.data[40] = [1.0; 3];
        assert_eq!(firefly_count(&dark), 1, "81 times the mean, and all around is black");
        assert_eq!(firefly_count(&Picture::new(0, 0)), 0);
    }

    #[test]
    fn pictures_of_different_sizes_are_not_compared() {
        let result = rmse(&Picture::new(2, 3), &Picture::new(3, 2));
        assert!(matches!(result, Err(ImageError::SizesDiffer { first: (2, 3), second: (3, 2) })));
    }
}
