//! Whether a film shows the same as a larger reference.

use std::{fmt, fs, path::Path};

use bottega_image::{ExrOptions, Film, Metadata, Moments, Picture, rejected_share};

/// A film beside a reference brought down to its size.
pub(crate) struct Comparison {
    painted: Picture,
    reference: Picture,
    /// Of the means of all pixels, ours over the reference's, minus 1.
    mean_error: f64,
    /// Standard error of that.
    standard_error: f64,
    /// Share of pixels that differ by more than chance.
    rejected: f64,
}

impl Comparison {
    pub(crate) fn new(film: &Film, full: &Picture, shrink: u32) -> Self {
        let painted = film.to_picture();
        let (width, height) = painted.size();
        let block = |x: u32, y: u32| {
            let pixels = (0..shrink * shrink).map(move |i| (x * shrink + i % shrink, y * shrink + i / shrink));
            pixels.map(|(x, y)| full.pixel(x, y))
        };
        let count = f64::from(shrink * shrink);
        let mean = |x: u32, y: u32| {
            let sum = block(x, y).fold([0.0; 3], |sum, pixel| [0, 1, 2].map(|i| sum[i] + f64::from(pixel[i])));
            sum.map(|sum| (sum / count) as f32)
        };
        let reference = Picture::from_fn(width, height, mean);
        let ours = Moments::of_film(film);
        let theirs: Vec<Moments> = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| {
                // What the block's pixels differ by is their noise, and what the scene shows there: an upper bound.
                let mean = luminance(reference.pixel(x, y));
                let variance = block(x, y).map(|pixel| (luminance(pixel) - mean).powi(2)).sum::<f64>() / (count - 1.0);
                Moments { mean, variance, samples: count }
            })
            .collect();
        let total = |moments: &[Moments]| moments.iter().map(|m| m.mean).sum::<f64>();
        let variance = ours.iter().map(|m| m.variance / m.samples).sum::<f64>();
        Self {
            mean_error: total(&ours) / total(&theirs) - 1.0,
            standard_error: variance.sqrt() / total(&theirs),
            rejected: rejected_share(&ours, &theirs, 0.01),
            painted,
            reference,
        }
    }

    pub(crate) fn judge(&self, mean_margin: f64, rejected_max: f64) -> Result<(), String> {
        if self.standard_error > 0.5 * mean_margin {
            return Err("too noisy to tell".into());
        }
        if self.mean_error.is_nan() || self.mean_error.abs() > mean_margin + 2.0 * self.standard_error {
            return Err(format!("the mean may be off by {mean_margin}"));
        }
        if self.rejected > rejected_max {
            return Err(format!("no more than {rejected_max} of the pixels may differ"));
        }
        Ok(())
    }

    /// Writes the three pictures. Returns the folder.
    pub(crate) fn keep(&self, name: &str) -> String {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("pictures");
        fs::create_dir_all(&folder).expect("a folder for pictures");
        let (width, height) = self.painted.size();
        let difference = Picture::from_fn(width, height, |x, y| {
            let (a, b) = (self.painted.pixel(x, y), self.reference.pixel(x, y));
            [0, 1, 2].map(|i| (a[i] - b[i]).abs())
        });
        let pictures = [("painted", &self.painted), ("reference", &self.reference), ("difference", &difference)];
        for (what, picture) in pictures {
            let path = folder.join(format!("{name}-{what}.exr"));
            bottega_image::write_picture_exr(path, picture, &Metadata::new(), ExrOptions::default()).expect("written");
        }
        folder.display().to_string()
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mean, error) = (100.0 * self.mean_error, 100.0 * self.standard_error);
        write!(f, "mean off by {mean:.3} % (standard error {error:.3} %), {:.4} of the pixels differ", self.rejected)
    }
}

fn luminance(color: [f32; 3]) -> f64 {
    f64::from(bottega_image::luminance(color))
}
