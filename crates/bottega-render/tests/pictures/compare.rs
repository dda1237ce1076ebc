//! Comparison of two pictures within their noise.

use std::{fmt, fs, path::Path};

use bottega_image::{ExrOptions, Film, Metadata, Moments, Picture, rejected_share};

/// A picture, with an estimate of its noise.
pub(crate) struct Estimate {
    picture: Picture,
    /// Variance of the luminance of each pixel.
    moments: Vec<Moments>,
    /// Luminances of the independent pictures of which this one is the mean; none: the noise of the whole is negligible.
    parts: Vec<Vec<f64>>,
}

impl Estimate {
    /// The mean of films of several seeds.
    pub(crate) fn of_films(films: &[Film]) -> Self {
        let pictures: Vec<Picture> = films.iter().map(Film::to_picture).collect();
        let of_films: Vec<Vec<Moments>> = films.iter().map(Moments::of_film).collect();
        let picture = mean_picture(&pictures);
        let moments = (0..of_films[0].len()).map(|pixel| {
            let at = || of_films.iter().map(|film| film[pixel]);
            let n = films.len() as f64;
            Moments {
                mean: at().map(|m| m.mean).sum::<f64>() / n,
                variance: at().map(|m| m.variance).sum::<f64>() / n,
                samples: at().map(|m| m.samples).sum(),
            }
        });
        Self { moments: moments.collect(), picture, parts: pictures.iter().map(luminances).collect() }
    }

    /// The mean of independent pictures.
    pub(crate) fn of_pictures(pictures: &[Picture]) -> Self {
        let parts: Vec<Vec<f64>> = pictures.iter().map(luminances).collect();
        let moments = (0..parts[0].len()).map(|pixel| moments(parts.iter().map(|part| part[pixel])));
        Self { picture: mean_picture(pictures), moments: moments.collect(), parts }
    }

    /// A picture reduced by the mean of blocks of pixels. The differences of the pixels of a block are their noise plus
    /// the detail of the scene: an upper bound of the noise.
    pub(crate) fn of_blocks(full: &Picture, side: u32) -> Self {
        let picture = brought_down(full, side);
        let (width, height) = picture.size();
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let moments = pixels.map(|(x, y)| moments(block(full, side, x, y).map(luminance))).collect();
        Self { picture, moments, parts: Vec::new() }
    }

    /// A picture with the picture of its standard error, both stored as half floats.
    pub(crate) fn with_error(picture: Picture, error: &Picture) -> Self {
        /// The relative change of a value by rounding.
        const HALF: f64 = 1.0 / 2048.0;
        let moments = luminances(&picture).into_iter().zip(luminances(error)).map(|(mean, error)| {
            let error = error.max(HALF * mean);
            Moments { mean, variance: error * error, samples: 1.0 }
        });
        let moments = moments.collect();
        Self { picture, moments, parts: Vec::new() }
    }

    /// Mean of the luminance over some of the pixels, and its standard error.
    fn mean(&self, of: &[usize]) -> (f64, f64) {
        let n = of.len() as f64;
        let mean = of.iter().map(|&pixel| self.moments[pixel].mean).sum::<f64>() / n;
        if self.parts.is_empty() {
            return (mean, 0.0);
        }
        // The samples of one picture are not independent; pictures of several seeds are.
        let whole = self.parts.iter().map(|part| of.iter().map(|&pixel| part[pixel]).sum::<f64>() / n);
        let whole = moments(whole);
        (mean, (whole.variance / whole.samples).sqrt())
    }
}

/// A picture compared with a reference.
pub(crate) struct Comparison<'a> {
    painted: &'a Estimate,
    reference: &'a Estimate,
    /// Mean of all pixels over that of the reference, minus 1.
    mean_error: f64,
    /// Standard error of the difference of the means.
    standard_error: f64,
    /// Share of pixels that differ by more than chance.
    rejected: f64,
}

impl<'a> Comparison<'a> {
    /// - `counts`: returns true if a pixel is compared.
    pub(crate) fn new(painted: &'a Estimate, reference: &'a Estimate, counts: impl Fn(u32, u32) -> bool) -> Self {
        assert_eq!(painted.picture.size(), reference.picture.size(), "pictures of different sizes");
        let width = painted.picture.size().0 as usize;
        let of: Vec<usize> =
            (0..painted.moments.len()).filter(|i| counts((i % width) as u32, (i / width) as u32)).collect();
        let ((mine, my_error), (expected, its_error)) = (painted.mean(&of), reference.mean(&of));
        let chosen =
            |estimate: &Estimate| -> Vec<Moments> { of.iter().map(|&pixel| estimate.moments[pixel]).collect() };
        Self {
            mean_error: mine / expected - 1.0,
            standard_error: my_error.hypot(its_error) / expected,
            rejected: rejected_share(&chosen(painted), &chosen(reference), 0.01),
            painted,
            reference,
        }
    }

    /// - `mean_margin`: maximum relative difference of the mean of the whole.
    /// - `rejected_max`: maximum share of pixels that differ.
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

    /// Writes the three pictures. Returns their paths.
    pub(crate) fn keep(&self, name: &str) -> Vec<String> {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("pictures");
        fs::create_dir_all(&folder).expect("a folder for pictures");
        let (painted, reference) = (&self.painted.picture, &self.reference.picture);
        let (width, height) = painted.size();
        let difference = Picture::from_fn(width, height, |x, y| {
            let (a, b) = (painted.pixel(x, y), reference.pixel(x, y));
            [0, 1, 2].map(|i| (a[i] - b[i]).abs())
        });
        let pictures = [("painted", painted), ("reference", reference), ("difference", &difference)];
        let write = |(what, picture): (&str, &Picture)| {
            let path = folder.join(format!("{name}-{what}.exr"));
            bottega_image::write_picture_exr(&path, picture, &Metadata::new(), ExrOptions::default()).expect("written");
            path.display().to_string()
        };
        pictures.map(write).into()
    }

    /// Panics if the pictures differ, and keeps their files.
    pub(crate) fn check(&self, name: &str, mean_margin: f64, rejected_max: f64) {
        eprintln!("{name}: {self}");
        if let Err(problem) = self.judge(mean_margin, rejected_max) {
            let kept = self.keep(&name.replace(['/', '.', ' ', ','], "-")).join(", ");
            panic!("{name}: {problem}; {self}; see {kept}");
        }
    }
}

impl fmt::Display for Comparison<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mean, error) = (100.0 * self.mean_error, 100.0 * self.standard_error);
        write!(f, "mean off by {mean:.3} % (standard error {error:.3} %), {:.4} of the pixels differ", self.rejected)
    }
}

/// The pixels of one block.
fn block(full: &Picture, side: u32, x: u32, y: u32) -> impl ExactSizeIterator<Item = [f32; 3]> + Clone {
    (0..side * side).map(move |i| full.pixel(x * side + i % side, y * side + i / side))
}

fn brought_down(full: &Picture, side: u32) -> Picture {
    let (width, height) = full.size();
    Picture::from_fn(width / side, height / side, |x, y| mean(block(full, side, x, y)))
}

/// Mean and variance of independent values.
fn moments(values: impl Iterator<Item = f64> + Clone) -> Moments {
    let samples = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / samples;
    let variance = values.map(|value| (value - mean).powi(2)).sum::<f64>() / (samples - 1.0);
    Moments { mean, variance, samples }
}

fn mean_picture(pictures: &[Picture]) -> Picture {
    let (width, height) = pictures[0].size();
    Picture::from_fn(width, height, |x, y| mean(pictures.iter().map(|picture| picture.pixel(x, y))))
}

fn mean(pixels: impl ExactSizeIterator<Item = [f32; 3]>) -> [f32; 3] {
    let count = pixels.len() as f64;
    let sum = pixels.fold([0.0; 3], |sum, pixel| [0, 1, 2].map(|i| sum[i] + f64::from(pixel[i])));
    sum.map(|sum: f64| (sum / count) as f32)
}

fn luminances(picture: &Picture) -> Vec<f64> {
    let (width, height) = picture.size();
    (0..height).flat_map(|y| (0..width).map(move |x| luminance(picture.pixel(x, y)))).collect()
}

fn luminance(color: [f32; 3]) -> f64 {
    f64::from(bottega_image::luminance(color))
}

#[test]
fn different_pictures_are_recognized_and_kept() {
    let gray = |value: f32| {
        let noisy =
            |seed: u32| Picture::from_fn(8, 8, |x, y| [value + (x * 7 + y * 13 + seed * 5) as f32 % 11.0 * 1e-4; 3]);
        Estimate::of_pictures(&[0, 1, 2, 3].map(noisy))
    };
    let (mine, same, other) = (gray(1.0), gray(1.0), gray(1.02));
    assert_eq!(Comparison::new(&mine, &same, |_, _| true).judge(0.005, 0.0025), Ok(()));
    let comparison = Comparison::new(&mine, &other, |_, _| true);
    assert!(comparison.judge(0.005, 1.0).is_err() && comparison.judge(0.1, 0.0025).is_err());
    for path in comparison.keep("a-test-of-keeping") {
        let kept = bottega_image::read_picture(&path).unwrap();
        assert_eq!(kept.size(), (8, 8), "{path}");
        fs::remove_file(path).unwrap();
    }
}
