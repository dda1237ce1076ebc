//! FLIP: the perceived difference of two pictures when flipping between them.
//!
//! Sources: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild 2020, *FLIP: A Difference Evaluator for
//! Alternating Images*; Andersson, Nilsson, Shirley, Akenine-Möller 2021, *Visualizing Errors in Rendered High Dynamic
//! Range Images*. Implemented here because the only binding is to a C++ library. The filters are applied as separable
//! convolutions; results match the authors' program to five digits (see the tests).

use std::f64::consts::PI;

use super::{check_sizes, convolve::FloatPlane};
use crate::{ImageError, Picture, ToneMap, luminance, tone::displayed};

/// The exposure and tone mapping of the comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum FlipView {
    /// HDR-FLIP: the largest difference per pixel over all exposures, from the one that shows the brightest light to
    /// the one that shows the darker half. Independent of exposure and tone map.
    #[default]
    AllExposures,
    /// LDR-FLIP, of displayed values.
    Displayed {
        /// Exposure, in stops; positive: brighter.
        exposure_stops: f32,
        /// Tone map, applied after the exposure.
        tone: ToneMap,
    },
}

/// Options of [`flip`]: the display on which the pictures are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlipOptions {
    /// Exposure and tone mapping.
    pub view: FlipView,
    /// Pixels per degree of the field of view.
    pub pixels_per_degree: f32,
}

impl Default for FlipOptions {
    /// Returns all exposures, on a display 0.7 m and 3840 pixels wide, seen from 0.7 m.
    fn default() -> Self {
        Self { view: FlipView::default(), pixels_per_degree: 0.7 * (3840.0 / 0.7) * std::f32::consts::PI / 180.0 }
    }
}

/// The result of [`flip`].
#[derive(Clone, Debug)]
pub struct FlipError {
    /// Mean error of the picture, in [0, 1]; 0: no difference.
    pub mean: f64,
    /// Error of every pixel, in [0, 1]: `[height × width]`.
    pub map: Vec<f32>,
}

/// Computes the perceived difference of two pictures. Negative values and NaN count as 0.
///
/// # Errors
/// The pictures differ in size.
pub fn flip(reference: &Picture, test: &Picture, options: &FlipOptions) -> Result<FlipError, ImageError> {
    check_sizes(reference, test)?;
    if reference.data.is_empty() {
        return Ok(FlipError { mean: 0.0, map: Vec::new() });
    }
    let kernels = Kernels::new(options.pixels_per_degree);
    let width = reference.width as usize;
    let at = |show: &dyn Fn([f32; 3]) -> [f32; 3]| {
        let seen =
            |picture: &Picture| PerceivedPicture::new(&kernels, width, picture.data.iter().map(|&color| show(color)));
        difference(&seen(reference), &seen(test))
    };
    let map = match options.view {
        FlipView::Displayed { exposure_stops, tone } => at(&|color| displayed(color, exposure_stops, tone)),
        FlipView::AllExposures => {
            let mut worst = vec![0.0f32; reference.data.len()];
            for exposure in exposures(reference) {
                let map = at(&|color| film_curve(color.map(|v| v.max(0.0) * exposure.exp2())));
                worst.iter_mut().zip(map).for_each(|(worst, error)| *worst = worst.max(error));
            }
            worst
        }
    };
    let mean = map.iter().map(|&error| f64::from(error)).sum::<f64>() / map.len() as f64;
    Ok(FlipError { mean, map })
}

/// Numerator and denominator, highest power first, of HDR-FLIP's tone curve: K. Narkowicz' fit of ACES, darkened by
/// 0.6, as in the paper.
const FILM_CURVE: ([f32; 3], [f32; 3]) = ([0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0], [0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14]);

fn film_curve(color: [f32; 3]) -> [f32; 3] {
    let polynomial = |c: [f32; 3], v: f32| (c[0] * v + c[1]) * v + c[2];
    color.map(|v| {
        // Beyond 10⁶ the curve is flat, and squares stay finite.
        let v = v.min(1e6);
        (polynomial(FILM_CURVE.0, v) / polynomial(FILM_CURVE.1, v)).clamp(0.0, 1.0)
    })
}

/// Returns exposures, in stops: from where the brightest pixel reaches 0.85 of the display's white to where the median
/// does (2021, §3.3).
fn exposures(reference: &Picture) -> Vec<f32> {
    const BRIGHT: f32 = 0.85;
    let [a, b, c] = std::array::from_fn(|i| FILM_CURVE.0[i] - BRIGHT * FILM_CURVE.1[i]);
    let bright = (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
    let bright = bright.max((-b - (b * b - 4.0 * a * c).sqrt()) / (2.0 * a));

    let mut luminances: Vec<f32> =
        reference.data.iter().map(|&color| luminance(color)).filter(|l| l.is_finite()).collect();
    let middle = luminances.len() / 2;
    if luminances.is_empty() {
        return vec![0.0];
    }
    let largest = luminances.iter().copied().fold(0.0, f32::max);
    let median = *luminances.select_nth_unstable_by(middle, f32::total_cmp).1;
    // For black pictures, limit the range to 20 stops below the brightest, darker than any display.
    let least = (largest * 2.0f32.powi(-20)).max(1e-30);
    let start = (bright / largest.max(least)).log2();
    let stop = (bright / median.max(least)).log2();
    let count = (stop - start).ceil().max(2.0) as usize;
    (0..count).map(|i| start + (stop - start) * i as f32 / (count - 1) as f32).collect()
}

/// The filters for a viewing distance.
struct Kernels {
    /// Contrast sensitivity of the achromatic, red-green and blue-yellow channel, as sums of kernels.
    sensitivity: [Vec<Vec<f32>>; 3],
    gaussian: Vec<f32>,
    edge: Vec<f32>,
    point: Vec<f32>,
}

impl Kernels {
    fn new(pixels_per_degree: f32) -> Self {
        let ppd = f64::from(pixels_per_degree).clamp(1.0, 1e4);
        // 2020, table 1: a and b of the Gaussians a·√(π/b)·exp(−π²d²/b), d in degrees.
        const SENSITIVITY: [&[(f64, f64)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];
        let widest = 0.04;
        let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i64;
        let sensitivity = SENSITIVITY.map(|terms| {
            let kernel = |b: f64| -> Vec<f64> {
                (-radius..=radius).map(|x| (-PI * PI * (x as f64 / ppd).powi(2) / b).exp()).collect()
            };
            let weight = |(a, b): (f64, f64)| a * (PI / b).sqrt();
            let total: f64 = terms.iter().map(|&term| weight(term) * kernel(term.1).iter().sum::<f64>().powi(2)).sum();
            let scaled = |&term: &(f64, f64)| {
                let factor = (weight(term) / total).sqrt();
                kernel(term.1).into_iter().map(|v| (v * factor) as f32).collect()
            };
            terms.iter().map(scaled).collect()
        });

        // 2020, §4.2: the width of features, 0.082 degrees.
        let deviation = 0.5 * 0.082 * ppd;
        let radius = (3.0 * deviation).ceil() as i64;
        let gauss = |x: i64| (-(x as f64).powi(2) / (2.0 * deviation * deviation)).exp();
        let kernel = |value: &dyn Fn(i64) -> f64| -> Vec<f64> { (-radius..=radius).map(value).collect() };
        let gaussian = kernel(&gauss);
        let sum: f64 = gaussian.iter().sum();
        Self {
            sensitivity,
            gaussian: gaussian.iter().map(|v| (v / sum) as f32).collect(),
            edge: balanced(&kernel(&|x| -(x as f64) * gauss(x))),
            point: balanced(&kernel(&|x| ((x as f64 / deviation).powi(2) - 1.0) * gauss(x))),
        }
    }
}

/// Scales a kernel so that its positive values sum to 1 and its negative ones to −1.
fn balanced(kernel: &[f64]) -> Vec<f32> {
    let positive: f64 = kernel.iter().filter(|v| **v > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|v| **v < 0.0).sum::<f64>();
    kernel.iter().map(|&v| (v / if v > 0.0 { positive } else { negative }) as f32).collect()
}

/// A picture as perceived.
struct PerceivedPicture {
    /// CIELAB with Hunt's adjustment, after contrast sensitivity filtering.
    lab: Vec<[f32; 3]>,
    /// Strength of edges and of points.
    features: Vec<[f32; 2]>,
}

impl PerceivedPicture {
    /// Filters linear display values in [0, 1].
    fn new(kernels: &Kernels, width: usize, colors: impl Iterator<Item = [f32; 3]>) -> Self {
        let opponent: Vec<[f32; 3]> = colors.map(opponent_from_rgb).collect();
        let channel = |c: usize| FloatPlane::new(width, opponent.iter().map(|value| value[c]).collect());
        let filtered: [FloatPlane; 3] = std::array::from_fn(|c| {
            let plane = channel(c);
            let parts: Vec<FloatPlane> = kernels.sensitivity[c].iter().map(|k| plane.convolved(k, k)).collect();
            let mut parts = parts.into_iter();
            let mut sum = parts.next().expect("every channel has a kernel");
            for part in parts {
                sum.values.iter_mut().zip(part.values).for_each(|(sum, part)| *sum += part);
            }
            sum
        });
        let lab = (0..opponent.len())
            .map(|i| {
                let rgb = rgb_from_opponent(std::array::from_fn(|c| filtered[c].values[i]));
                hunt_lab_from_rgb(rgb.map(|v| v.clamp(0.0, 1.0)))
            })
            .collect();

        let gray = FloatPlane::new(width, opponent.iter().map(|value| (value[0] + 16.0) / 116.0).collect());
        let (g, edge, point) = (&kernels.gaussian, &kernels.edge, &kernels.point);
        let strength = |kernel: &[f32]| -> Vec<f32> {
            let (x, y) = (gray.convolved(kernel, g), gray.convolved(g, kernel));
            x.values.iter().zip(&y.values).map(|(x, y)| (x * x + y * y).sqrt()).collect()
        };
        let features = strength(edge).into_iter().zip(strength(point)).map(|(edge, point)| [edge, point]).collect();
        Self { lab, features }
    }
}

/// Computes the color difference, amplified where edges or points differ (2020, §4.1.3, §4.2 and §4.3).
fn difference(reference: &PerceivedPicture, test: &PerceivedPicture) -> Vec<f32> {
    const COLOR_EXPONENT: f32 = 0.7;
    const KNEE: f32 = 0.4;
    const KNEE_ERROR: f32 = 0.95;
    let largest = hyab(hunt_lab_from_rgb([0.0, 1.0, 0.0]), hunt_lab_from_rgb([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    let knee = KNEE * largest;
    let color_error = |a: [f32; 3], b: [f32; 3]| {
        let distance = hyab(a, b).powf(COLOR_EXPONENT);
        if distance < knee {
            distance * KNEE_ERROR / knee
        } else {
            KNEE_ERROR + (distance - knee) / (largest - knee) * (1.0 - KNEE_ERROR)
        }
    };
    let feature_error = |a: [f32; 2], b: [f32; 2]| {
        let strongest = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        (strongest * std::f32::consts::FRAC_1_SQRT_2).min(1.0).sqrt()
    };
    let colors = reference.lab.iter().zip(&test.lab).map(|(&a, &b)| color_error(a, b));
    let features = reference.features.iter().zip(&test.features).map(|(&a, &b)| feature_error(a, b));
    colors.zip(features).map(|(color, feature)| color.powf(1.0 - feature).clamp(0.0, 1.0)).collect()
}

/// XYZ of the display's white: the sums of the rows below.
const WHITE: [f32; 3] = [0.950_428_5, 1.0, 1.088_900_4];
const XYZ_FROM_RGB: [[f32; 3]; 3] = [
    [0.412_386_56, 0.357_591_5, 0.180_450_5],
    [0.212_636_82, 0.715_183, 0.072_180_2],
    [0.019_330_62, 0.119_197_17, 0.950_372_6],
];
const RGB_FROM_XYZ: [[f32; 3]; 3] = [
    [3.241_003_2, -1.537_399, -0.498_615_9],
    [-0.969_224_3, 1.875_93, 0.041_554_23],
    [0.055_639_42, -0.204_011_2, 1.057_149],
];

fn multiply(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Converts to Y Cx Cz, linear opponent colors.
fn opponent_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    let xyz = multiply(&XYZ_FROM_RGB, rgb);
    let [x, y, z] = std::array::from_fn(|i| xyz[i] / WHITE[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn rgb_from_opponent([yy, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (yy + 16.0) / 116.0;
    let normalized = [y + cx / 500.0, y, y - cz / 200.0];
    multiply(&RGB_FROM_XYZ, std::array::from_fn(|i| normalized[i] * WHITE[i]))
}

/// Converts to CIELAB, with a and b scaled by lightness: colors differ less in the dark (Hunt).
fn hunt_lab_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let xyz = multiply(&XYZ_FROM_RGB, rgb);
    let curve = |t: f32| if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = std::array::from_fn(|i| curve(xyz[i] / WHITE[i]));
    let lightness = 116.0 * y - 16.0;
    [lightness, 500.0 * (x - y) * 0.01 * lightness, 200.0 * (y - z) * 0.01 * lightness]
}

/// Returns the distance for large color differences: city block in lightness, Euclidean in a and b.
fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    (a[0] - b[0]).abs() + ((a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: u32 = 40;
    const HEIGHT: u32 = 30;

    /// Ramps of red and green, a chessboard of blue.
    fn pattern(x: u32, y: u32) -> [f32; 3] {
        let board = if (x / 4 + y / 4) % 2 == 1 { 0.9 } else { 0.1 };
        [x as f32 / WIDTH as f32, y as f32 / HEIGHT as f32, board]
    }

    fn noisy(x: u32, y: u32) -> [f32; 3] {
        let hash = ((u64::from(x) * 73_856_093) ^ (u64::from(y) * 19_349_663)) % 1000;
        pattern(x, y).map(|v| (v + (hash as f32 / 1000.0 - 0.5) * 0.2).clamp(0.0, 1.0))
    }

    fn shifted(x: u32, y: u32) -> [f32; 3] {
        pattern((x + WIDTH - 1) % WIDTH, y)
    }

    /// Ten stops from left to right.
    fn bright(color: impl Fn(u32, u32) -> [f32; 3]) -> Picture {
        Picture::from_fn(WIDTH, HEIGHT, |x, y| color(x, y).map(|v| v * (x as f32 / 4.0 - 5.0).exp2()))
    }

    /// `expected`: mean, and the pixels (0, 0), (20, 15), (39, 29), as the authors' program version 1.7 gives them.
    fn check(reference: &Picture, test: &Picture, options: FlipOptions, expected: [f64; 4]) {
        let error = flip(reference, test, &options).unwrap();
        let at = |x: u32, y: u32| f64::from(error.map[(y * WIDTH + x) as usize]);
        let got = [error.mean, at(0, 0), at(20, 15), at(39, 29)];
        for (got_one, expected_one) in got.iter().zip(expected) {
            assert!((got_one - expected_one).abs() < 1e-4, "got {got:?}, expected {expected:?}");
        }
    }

    #[test]
    fn ldr_flip_agrees_with_the_program_of_its_authors() {
        let view = FlipView::Displayed { exposure_stops: 0.0, tone: ToneMap::Linear };
        let usual = FlipOptions { view, ..Default::default() };
        let near = FlipOptions { view, pixels_per_degree: 20.0 };
        let [a, b, c] = [pattern, noisy, shifted].map(|f| Picture::from_fn(WIDTH, HEIGHT, f));
        check(&a, &b, usual, [0.086_089_2, 0.152_403_2, 0.081_035_6, 0.144_112_9]);
        check(&b, &a, usual, [0.086_089_2, 0.152_403_2, 0.081_035_6, 0.144_112_9]);
        check(&a, &b, near, [0.213_203_4, 0.300_603_7, 0.180_831_4, 0.324_676_1]);
        check(&a, &c, usual, [0.177_77, 0.969_795_1, 0.090_226_7, 0.145_081_5]);
        check(&a, &c, near, [0.350_822_7, 0.982_725_7, 0.605_063_9, 0.077_988]);
        check(&a, &a, usual, [0.0; 4]);
    }

    #[test]
    fn hdr_flip_agrees_with_the_program_of_its_authors() {
        let options = FlipOptions::default();
        check(&bright(pattern), &bright(noisy), options, [0.139_377_9, 0.008_853_9, 0.128_606_8, 0.189_528]);
        check(&bright(pattern), &bright(shifted), options, [0.125_340_9, 0.503_751_6, 0.086_857_7, 0.103_151_6]);
    }

    #[test]
    fn the_exposures_are_those_of_the_authors() {
        let exposures = exposures(&bright(pattern));
        assert_eq!(exposures.len(), 6);
        assert!((exposures[0] + 3.540_036).abs() < 1e-4 && (exposures[5] - 2.390_083).abs() < 1e-4, "{exposures:?}");
    }

    #[test]
    fn black_huge_and_broken_pictures_give_a_finite_error() {
        let black = Picture::new(9, 7);
        for value in [0.0, f32::NAN, f32::INFINITY, -1.0, f32::MAX, 1e-40] {
            let test = Picture::from_fn(9, 7, |x, _| if x == 4 { [value; 3] } else { [0.0; 3] });
            for (a, b) in [(&black, &test), (&test, &black)] {
                let error = flip(a, b, &FlipOptions::default()).unwrap();
                assert!(error.map.iter().all(|e| (0.0..=1.0).contains(e)), "{value}: {:?}", error.map);
            }
        }
        assert_eq!(flip(&Picture::new(0, 5), &Picture::new(0, 5), &FlipOptions::default()).unwrap().mean, 0.0);
    }
}
