//! Display transforms of scene-referred radiance: exposure, tone mapping, encoding.

/// The tone mapping of unbounded radiance to [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneMap {
    /// A film-like curve in a slightly desaturated base, after Sobotka's AgX: bright saturated light turns white
    /// instead of changing its hue. Middle gray, 0.18, is unchanged.
    #[default]
    Agx,
    /// The fit by S. Hill of the ACES reference rendering and output transforms: more contrast, about one stop darker.
    Aces,
    /// None: values above 1 are clamped.
    Linear,
}

/// The encoding of linear display values as numbers in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// The sRGB curve of IEC 61966-2-1, which displays and viewers expect.
    #[default]
    Srgb,
    /// Linear values, without a curve.
    Linear,
}

impl ToneMap {
    /// Returns the linear display values, in [0, 1], of linear radiance. NaN and −∞ become 0, ∞ becomes 1.
    pub fn apply(self, color: [f32; 3]) -> [f32; 3] {
        let color = color.map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1e9) });
        let mapped = match self {
            Self::Agx => agx(color),
            Self::Aces => aces(color),
            Self::Linear => color,
        };
        mapped.map(|v| v.clamp(0.0, 1.0))
    }
}

impl Encoding {
    /// Encodes a linear value in [0, 1]. Returns a value in [0, 1].
    pub fn encode(self, linear: f32) -> f32 {
        match self {
            Self::Srgb => srgb_from_linear(linear),
            Self::Linear => linear,
        }
    }
}

/// Encodes a linear value in [0, 1] by the sRGB curve, IEC 61966-2-1.
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Decodes a value in [0, 1] by the sRGB curve; the inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Returns the factor of an exposure in stops, 2^stops.
pub(crate) fn exposure_factor(stops: f32) -> f32 {
    stops.exp2()
}

type Matrix = [[f32; 3]; 3];

fn multiply(m: &Matrix, v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Applies AgX: inset of the primaries, a logarithm from 10 stops below to 6.5 above middle gray, a sigmoid, the
/// outset.
///
/// The primaries are those of T. Sobotka's configuration for Rec. 709; the sigmoid is [`sigmoid`], with the slope of
/// its later "punchless" form, which keeps middle gray.
fn agx(color: [f32; 3]) -> [f32; 3] {
    const INSET: Matrix = [
        [0.842_479_06, 0.078_433_6, 0.079_223_745],
        [0.042_328_242, 0.878_468_64, 0.079_166_13],
        [0.042_375_654, 0.078_433_6, 0.879_143],
    ];
    const OUTSET: Matrix = [
        [1.196_879, -0.098_020_88, -0.099_029_74],
        [-0.052_896_85, 1.151_903_1, -0.098_961_18],
        [-0.052_971_635, -0.098_043_45, 1.151_073_7],
    ];
    const MIDDLE_GRAY: f32 = 0.18;
    let curved = multiply(&INSET, color).map(|v| {
        let stops = (v.max(1e-10) / MIDDLE_GRAY).log2();
        sigmoid(((stops + STOPS_BELOW) / (STOPS_BELOW + STOPS_ABOVE)).clamp(0.0, 1.0))
    });
    multiply(&OUTSET, curved).map(|v| v.clamp(0.0, 1.0).powf(DISPLAY_GAMMA))
}

const STOPS_BELOW: f32 = 10.0;
const STOPS_ABOVE: f32 = 6.5;
const DISPLAY_GAMMA: f32 = 2.4;

/// Evaluates the curve from (0, 0) to (1, 1) through middle gray with slope 2.4, which bends towards both ends as h(t)
/// = t / (1 + t^p)^(1/p), with p = 3 below and 3.25 above.
///
/// At d in x from the pivot it is s·h(2.4·d/s) in y from it. Ending in the corner, r_x and r_y from the pivot, requires
/// s = (((2.4·r_x/r_y)^p − 1) / (2.4·r_x)^p)^(−1/p).
fn sigmoid(x: f32) -> f32 {
    const SLOPE: f32 = 2.4;
    const PIVOT_X: f32 = STOPS_BELOW / (STOPS_BELOW + STOPS_ABOVE);
    // 0.18^(1/2.4): middle gray, as encoded for the display.
    const PIVOT_Y: f32 = 0.489_437_1;
    const SCALE_BELOW: f32 = 0.495_815_4;
    const SCALE_ABOVE: f32 = 0.533_861_6;
    if x < PIVOT_X {
        let t = SLOPE * (PIVOT_X - x) / SCALE_BELOW;
        PIVOT_Y - SCALE_BELOW * t / (1.0 + t * t * t).cbrt()
    } else {
        let t = SLOPE * (x - PIVOT_X) / SCALE_ABOVE;
        PIVOT_Y + SCALE_ABOVE * t / (1.0 + t * t * t * t.sqrt().sqrt()).powf(1.0 / 3.25)
    }
}

/// Applies the fit by S. Hill (2016) of ACES' reference rendering transform and its output transform for sRGB displays.
fn aces(color: [f32; 3]) -> [f32; 3] {
    const INPUT: Matrix = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
    const OUTPUT: Matrix =
        [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];
    let curved = multiply(&INPUT, color)
        .map(|v| (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081));
    multiply(&OUTPUT, curved)
}

/// Returns a threshold in (0, 1) for pixel (x, y), evenly distributed both locally and globally: interleaved gradient
/// noise.
///
/// Source: Jimenez 2014, *Next Generation Post Processing in Call of Duty: Advanced Warfare*, slide 123.
fn dither_threshold(x: u32, y: u32) -> f64 {
    let fraction = |v: f64| v - v.floor();
    fraction(52.982_918_9 * fraction(0.067_110_56 * f64::from(x) + 0.005_837_15 * f64::from(y)))
}

/// Quantizes an encoded value in [0, 1] to an integer from 0 to `max`. With dithering it is one of the two nearest, so
/// that the mean over neighbors is right; an exact integer is unchanged.
pub(crate) fn quantize(encoded: f32, max: f64, dither: Option<(u32, u32)>) -> u32 {
    let scaled = f64::from(encoded) * max;
    let threshold = dither.map_or(0.5, |(x, y)| dither_threshold(x, y));
    // A float may differ slightly from an exact integer.
    let nearest = scaled.round();
    if (scaled - nearest).abs() < 1e-4 * max / 255.0 {
        nearest as u32
    } else {
        (scaled + threshold).floor().min(max) as u32
    }
}

/// Applies exposure and tone mapping to radiance. Returns linear display values in [0, 1].
///
/// - `exposure_stops`: exposure in stops; positive: brighter.
pub fn displayed(color: [f32; 3], exposure_stops: f32, tone: ToneMap) -> [f32; 3] {
    let factor = exposure_factor(exposure_stops);
    tone.apply(color.map(|v| v * factor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn agx_keeps_middle_gray_and_ends_at_black_and_white() {
        let gray = ToneMap::Agx.apply([0.18; 3]);
        assert!(gray.iter().all(|v| (v - 0.18).abs() < 2e-3), "{gray:?}");
        assert!(ToneMap::Agx.apply([0.0; 3]).iter().all(|&v| v < 1e-4));
        assert!(ToneMap::Agx.apply([1e4; 3]).iter().all(|&v| v > 0.99));
    }

    #[test]
    fn the_curve_joins_the_corners_through_its_pivot() {
        let points = [(0.0, 0.0), (10.0 / 16.5, 0.18f32.powf(1.0 / 2.4)), (1.0, 1.0)];
        for (x, y) in points {
            assert!((sigmoid(x) - y).abs() < 2e-6, "{x}: {}", sigmoid(x));
        }
        let slope = |x: f32| (sigmoid(x + 1e-3) - sigmoid(x - 1e-3)) / 2e-3;
        assert!((slope(10.0 / 16.5) - 2.4).abs() < 0.01);
    }

    #[test]
    fn bright_saturated_light_turns_white_with_agx_and_not_without() {
        let least = |tone: ToneMap| tone.apply([0.0, 0.0, 200.0])[0];
        assert!(least(ToneMap::Agx) > 0.4, "{}", least(ToneMap::Agx));
        assert_eq!(least(ToneMap::Linear), 0.0);
    }

    #[test]
    fn no_value_leaves_the_display() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, f32::MAX] {
            for tone in [ToneMap::Agx, ToneMap::Aces, ToneMap::Linear] {
                let shown = tone.apply([bad, 0.5, bad]);
                assert!(shown.iter().all(|v| (0.0..=1.0).contains(v)), "{tone:?} of {bad}: {shown:?}");
            }
        }
    }

    #[test]
    fn the_srgb_curve_has_its_published_values() {
        for (linear, encoded) in [(0.0, 0.0), (0.003_130_8, 0.040_45), (0.214_041, 0.5), (1.0, 1.0)] {
            assert!((srgb_from_linear(linear) - encoded).abs() < 1e-5);
            assert!((linear_from_srgb(encoded) - linear).abs() < 1e-5);
        }
    }

    #[test]
    fn dithering_keeps_the_mean_and_exact_values() {
        let value = 100.3 / 255.0;
        let count = 64 * 64;
        let sum: u32 = (0..count).map(|i| quantize(value, 255.0, Some((i % 64, i / 64)))).sum();
        let mean = f64::from(sum) / f64::from(count);
        assert!((mean - 100.3).abs() < 0.02, "{mean}");
        for exact in 0..=255u32 {
            let value = exact as f32 / 255.0;
            assert!((0..64).all(|i| quantize(value, 255.0, Some((i, 3 * i))) == exact));
        }
    }

    proptest! {
        #[test]
        fn gray_stays_gray_and_brighter_is_not_darker(v in 1e-4f32..50.0, more in 1.0f32..2.0) {
            for tone in [ToneMap::Agx, ToneMap::Aces, ToneMap::Linear] {
                let [r, g, b] = tone.apply([v; 3]);
                prop_assert!((r - g).abs() < 3e-3 && (g - b).abs() < 3e-3, "{:?}: {} {} {}", tone, r, g, b);
                prop_assert!(tone.apply([v * more; 3])[1] >= g - 1e-6);
            }
        }

        #[test]
        fn decoding_undoes_encoding(v in 0.0f32..1.0) {
            prop_assert!((linear_from_srgb(srgb_from_linear(v)) - v).abs() < 1e-5);
        }
    }
}
