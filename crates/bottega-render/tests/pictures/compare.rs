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
    /// - `films`: of several seeds.
    pub(crate) fn new(films: &[Film], full: &Picture, shrink: u32) -> Self {
        let pictures: Vec<Picture> = films.iter().map(Film::to_picture).collect();
        let (width, height) = pictures[0].size();
        let block = |x: u32, y: u32| {
            let pixels = (0..shrink * shrink).map(move |i| (x * shrink + i % shrink, y * shrink + i / shrink));
            pixels.map(|(x, y)| full.pixel(x, y))
        };
        let reference = Picture::from_fn(width, height, |x, y| mean(block(x, y)));
        let painted = Picture::from_fn(width, height, |x, y| mean(pictures.iter().map(|picture| picture.pixel(x, y))));
        let of_films: Vec<Vec<Moments>> = films.iter().map(Moments::of_film).collect();
        let count = f64::from(shrink * shrink);
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let (ours, theirs): (Vec<Moments>, Vec<Moments>) = pixels
            .enumerate()
            .map(|(index, (x, y))| {
                let at = || of_films.iter().map(|film| film[index]);
                let variance = at().map(|m| m.variance).sum::<f64>() / films.len() as f64;
                let samples = at().map(|m| m.samples).sum::<f64>();
                let ours = Moments { mean: luminance(painted.pixel(x, y)), variance, samples };
                // What the block's pixels differ by is their noise, and what the scene shows there: an upper bound.
                let mean = luminance(reference.pixel(x, y));
                let variance = block(x, y).map(|pixel| (luminance(pixel) - mean).powi(2)).sum::<f64>() / (count - 1.0);
                (ours, Moments { mean, variance, samples: count })
            })
            .unzip();
        let total = |moments: &[Moments]| moments.iter().map(|m| m.mean).sum::<f64>();
        let (mine, expected) = (total(&ours), total(&theirs));
        // The samples of one picture are no independent ones; pictures of several seeds are.
        let n = films.len() as f64;
        let spread = of_films.iter().map(|film| (total(film) - mine).powi(2)).sum::<f64>() / (n - 1.0);
        Self {
            mean_error: mine / expected - 1.0,
            standard_error: (spread / n).sqrt() / expected,
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

fn mean(pixels: impl ExactSizeIterator<Item = [f32; 3]>) -> [f32; 3] {
    let count = pixels.len() as f64;
    let sum = pixels.fold([0.0; 3], |sum, pixel| [0, 1, 2].map(|i| sum[i] + f64::from(pixel[i])));
    sum.map(|sum: f64| (sum / count) as f32)
}

fn luminance(color: [f32; 3]) -> f64 {
    f64::from(bottega_image::luminance(color))
}
