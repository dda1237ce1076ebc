//! The exposure of a picture, an input of the denoiser's networks.

use bottega_image::{Picture, luminance};

/// Side in pixels of the squares over which luminance is averaged, to remove the influence of noise.
const SIDE: u32 = 16;
/// Luminance of middle grey (Reinhard et al. 2002, equation 2).
const KEY: f64 = 0.18;
/// Mean luminance below which a square counts as black and is ignored.
const BLACK: f64 = 1e-8;

/// Returns the factor that scales the geometric mean of the luminance to middle grey; 1 for a picture without light.
///
/// The library can compute such a factor itself, but sums in the order in which its threads end, so that results are not always
/// bit-identical.
pub(crate) fn exposure(picture: &Picture) -> f32 {
    let (width, height) = picture.size();
    let (mut sum, mut count) = (0.0, 0_u32);
    for y in (0..height).step_by(SIDE as usize) {
        for x in (0..width).step_by(SIDE as usize) {
            let mean = mean_luminance(picture, x..width.min(x + SIDE), y..height.min(y + SIDE));
            if mean > BLACK && mean.is_finite() {
                sum += mean.log2();
                count += 1;
            }
        }
    }
    if count == 0 { 1.0 } else { (KEY / (sum / f64::from(count)).exp2()) as f32 }
}

fn mean_luminance(picture: &Picture, columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> f64 {
    let pixels = rows.len() * columns.len();
    let row_sum = |y: u32| columns.clone().map(|x| f64::from(luminance(picture.pixel(x, y)))).sum::<f64>();
    rows.map(row_sum).sum::<f64>() / pixels as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grey_picture_becomes_middle_grey() {
        let picture = Picture::from_fn(50, 33, |_, _| [3.0; 3]);
        assert!((exposure(&picture) - 0.06).abs() < 1e-6);
    }

    #[test]
    fn the_mean_is_geometric_and_the_black_and_the_broken_have_no_say() {
        // Luminance 1 and 16, one black square, and one that is not finite.
        let picture = Picture::from_fn(64, 16, |x, _| [[1.0, 16.0, 0.0, f32::NAN][x as usize / 16]; 3]);
        assert!((exposure(&picture) - 0.18 / 4.0).abs() < 1e-6);
        assert!((exposure(&Picture::from_fn(20, 20, |_, _| [0.0; 3])) - 1.0).abs() < f32::EPSILON);
    }
}
