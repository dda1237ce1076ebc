//! Saliency: how strongly places attract the eye, from colors alone.
//!
//! Source: Itti, Koch and Niebur 1998, *A Model of Saliency-Based Visual Attention for Rapid Scene Analysis*. A survey
//! is about as coarse as scale 2 of the paper's pyramid of a 640 × 480 picture, so its own size stands for scale 2. The
//! centers c ∈ {2, 3, 4} and surrounds c + δ, δ ∈ {3, 4}, are all used unless the survey is too small for the coarsest
//! ones.

mod orientation;
mod plane;

use self::{orientation::Orientations, plane::Plane};

/// The scale of the paper's pyramid at which a survey enters.
const SURVEY_SCALE: usize = 2;
/// Scales of the centers.
const CENTERS: [usize; 3] = [2, 3, 4];
/// Scales by which surrounds are coarser than centers.
const SURROUNDS: [usize; 2] = [3, 4];
/// The scale of the resulting maps.
const MAP_SCALE: usize = 4;
/// Minimum intensity for a hue, as a share of the greatest intensity.
const HUE_FLOOR: f32 = 0.1;

/// The saliency of every cell, row-major, 0..=1; 0 everywhere in a uniform picture.
///
/// - `colors`: `[width × height]`, linear RGB, finite and not negative.
pub(super) fn saliency(width: u32, height: u32, colors: &[[f32; 3]]) -> Vec<f32> {
    // A uniform picture has no saliency; it also occurs with test engines, which give no colors.
    if colors.windows(2).all(|pair| pair[0] == pair[1]) {
        return vec![0.0; colors.len()];
    }
    // Encode the colors for display and build the pyramids of intensity and opponent colors
    let shown = shown(colors);
    let plane = |value: &dyn Fn([f32; 3]) -> f32| Plane::new(width, height, shown.iter().map(|&c| value(c)).collect());
    let intensity = pyramid(plane(&|[r, g, b]| (r + g + b) / 3.0));
    let [red, green, blue, yellow] = opponents(&shown).map(|values| pyramid(Plane::new(width, height, values)));
    // The paper prints the surround's opponency with its sign changed, G − R; literally a uniform red picture would be
    // salient everywhere. Center minus surround of the same opponency is what its figures show.
    let red_green = differences(&red, &green);
    let blue_yellow = differences(&blue, &yellow);

    // Add up the center–surround differences of intensity and color
    let map = intensity[(MAP_SCALE - SURVEY_SCALE).min(intensity.len() - 1)].size();
    let of_intensity = across_scales(&intensity, map);
    let mut of_color = across_scales(&red_green, map);
    of_color.add(&across_scales(&blue_yellow, map));
    // Add up the center–surround differences of each orientation
    let mut of_orientation = Plane::zero(map);
    let orientations = Orientations::new();
    for angle in 0..Orientations::COUNT {
        let strength: Vec<Plane> = intensity.iter().map(|level| orientations.strength(level, angle)).collect();
        of_orientation.add(&normalized(across_scales(&strength, map)));
    }
    // Normalize and add the three conspicuity maps
    let mut all = Plane::zero(map);
    for conspicuity in [of_intensity, of_color, of_orientation] {
        all.add(&normalized(conspicuity));
    }
    // Resize to the survey and scale to 0..=1
    let all = all.resized((width, height));
    let most = all.values.iter().copied().fold(0.0, f32::max);
    let scale = if most > 0.0 { 1.0 / most } else { 0.0 };
    all.values.iter().map(|value| (value * scale).clamp(0.0, 1.0)).collect()
}

/// Colors approximately as a display shows them, by exact operations only: compressed around the mean luminance with
/// the hue kept, then encoded by a square root.
fn shown(colors: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mean = colors.iter().map(|&c| f64::from(bottega_image::luminance(c))).sum::<f64>() / colors.len().max(1) as f64;
    let mean = (mean as f32).max(f32::MIN_POSITIVE);
    let show = |color: &[f32; 3]| {
        let brightest = color.iter().copied().fold(0.0, f32::max);
        color.map(|value| (value / (brightest + mean)).sqrt())
    };
    colors.iter().map(show).collect()
}

/// The paper's broadly tuned red, green, blue and yellow: hue independent of intensity, 0 where it is too dark for a
/// hue.
fn opponents(colors: &[[f32; 3]]) -> [Vec<f32>; 4] {
    let intensity = |[r, g, b]: [f32; 3]| (r + g + b) / 3.0;
    let floor = HUE_FLOOR * colors.iter().map(|&color| intensity(color)).fold(0.0, f32::max);
    let tuned = |color: &[f32; 3]| {
        let of = intensity(*color);
        if of <= floor {
            return [0.0; 4];
        }
        let [r, g, b] = color.map(|value| value / of);
        [r - (g + b) / 2.0, g - (r + b) / 2.0, b - (r + g) / 2.0, (r + g) / 2.0 - (r - g).abs() / 2.0 - b]
            .map(|value| value.max(0.0))
    };
    let all: Vec<[f32; 4]> = colors.iter().map(tuned).collect();
    [0, 1, 2, 3].map(|i| all.iter().map(|values| values[i]).collect())
}

/// Returns a Gaussian pyramid down to the coarsest surround, or as far as the plane can be halved.
fn pyramid(base: Plane) -> Vec<Plane> {
    let coarsest = CENTERS[CENTERS.len() - 1] + SURROUNDS[SURROUNDS.len() - 1] - SURVEY_SCALE;
    let mut levels = vec![base];
    while levels.len() <= coarsest {
        let last = &levels[levels.len() - 1];
        if last.size().0.min(last.size().1) < 2 {
            break;
        }
        levels.push(last.halved());
    }
    levels
}

fn differences(a: &[Plane], b: &[Plane]) -> Vec<Plane> {
    a.iter().zip(b).map(|(a, b)| a.minus(b)).collect()
}

/// Returns the normalized differences of all centers and surrounds, added up at the size `map`.
fn across_scales(pyramid: &[Plane], map: (u32, u32)) -> Plane {
    let mut sum = Plane::zero(map);
    for center in CENTERS.map(|scale| scale - SURVEY_SCALE) {
        for surround in SURROUNDS.map(|step| center + step) {
            let (Some(fine), Some(coarse)) = (pyramid.get(center), pyramid.get(surround)) else { continue };
            let mut feature = fine.minus(&coarse.resized(fine.size()));
            feature.values.iter_mut().for_each(|value| *value = value.abs());
            sum.add(&normalized(feature).resized(map));
        }
    }
    sum
}

/// Returns the paper's N(·): scales a map to 0..=1 and multiplies it by (1 − m̄)², with m̄ the mean of all local
/// maxima except the greatest. A map with one peak is kept, one with many equal peaks vanishes.
fn normalized(mut map: Plane) -> Plane {
    /// Maximum of a map that is only rounding error.
    const NOTHING: f32 = 1e-5;
    let most = map.values.iter().copied().fold(0.0, f32::max);
    if most < NOTHING {
        return Plane::zero(map.size());
    }
    map.values.iter_mut().for_each(|value| *value /= most);
    let mut peaks = map.peaks();
    // Remove one peak of the greatest height.
    if let Some(greatest) = peaks.iter().position(|&peak| peak >= 1.0) {
        peaks.swap_remove(greatest);
    }
    let mean = if peaks.is_empty() { 0.0 } else { peaks.iter().sum::<f32>() / peaks.len() as f32 };
    let factor = (1.0 - mean) * (1.0 - mean);
    map.values.iter_mut().for_each(|value| *value *= factor);
    map
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 128;

    /// A picture of a 4 × 4 lattice of things on grey, one of which, at (2, 1), is the odd one.
    fn lattice(thing: impl Fn(bool, i32, i32) -> Option<[f32; 3]>) -> Vec<[f32; 3]> {
        let color = |x: u32, y: u32| {
            let (column, row) = (x / 32, y / 32);
            let (dx, dy) = ((x % 32) as i32 - 16, (y % 32) as i32 - 16);
            thing((column, row) == (2, 1), dx, dy).unwrap_or([0.3; 3])
        };
        (0..SIDE * SIDE).map(|i| color(i % SIDE, i / SIDE)).collect()
    }

    /// The greatest saliency of the odd thing over the greatest of any other.
    fn stands_out(colors: &[[f32; 3]]) -> f32 {
        let map = saliency(SIDE, SIDE, colors);
        let cell = |column: u32, row: u32| {
            let pixels = (0..32 * 32).map(|i| (32 * row + i / 32) * SIDE + 32 * column + i % 32);
            pixels.map(|i| map[i as usize]).fold(0.0, f32::max)
        };
        let others = (0..16).map(|i| (i % 4, i / 4)).filter(|&at| at != (2, 1)).map(|(x, y)| cell(x, y));
        cell(2, 1) / others.fold(1e-6, f32::max)
    }

    fn disk(dx: i32, dy: i32) -> bool {
        dx * dx + dy * dy < 25
    }

    #[test]
    fn a_bright_disk_among_dim_ones_stands_out() {
        let picture = lattice(|odd, dx, dy| disk(dx, dy).then_some(if odd { [0.9; 3] } else { [0.45; 3] }));
        assert!(stands_out(&picture) > 1.5, "{}", stands_out(&picture));
    }

    #[test]
    fn a_red_disk_among_green_ones_of_equal_brightness_stands_out() {
        // Large enough that each is the surround of the others: on grey both hues are as far from it.
        let color = |odd: bool| if odd { [0.6, 0.1, 0.1] } else { [0.1, 0.6, 0.1] };
        let picture = lattice(|odd, dx, dy| (dx * dx + dy * dy < 180).then_some(color(odd)));
        assert!(stands_out(&picture) > 1.2, "{}", stands_out(&picture));
    }

    #[test]
    fn an_upright_bar_among_lying_ones_stands_out() {
        let bars = lattice(|odd, dx, dy| {
            let (along, across) = if odd { (dy, dx) } else { (dx, dy) };
            (along.abs() < 9 && across.abs() < 2).then_some([0.9; 3])
        });
        assert!(stands_out(&bars) > 1.1, "{}", stands_out(&bars));
    }

    #[test]
    fn an_even_picture_has_no_salient_place_at_any_size() {
        for (width, height) in [(1, 1), (2, 1), (3, 5), (40, 30), (128, 96)] {
            let even = vec![[0.2, 0.5, 0.1]; (width * height) as usize];
            let mut rounded = even.clone();
            rounded[0][1] = 0.5_f32.next_up();
            for colors in [even, rounded] {
                let map = saliency(width, height, &colors);
                assert_eq!(map.len(), colors.len());
                assert!(map.iter().all(|&value| value == 0.0), "{width}x{height}");
            }
        }
    }

    #[test]
    fn brightness_of_the_whole_makes_no_difference() {
        let colors = lattice(|odd, dx, dy| disk(dx, dy).then_some(if odd { [0.9, 0.2, 0.2] } else { [0.5; 3] }));
        let brighter: Vec<[f32; 3]> = colors.iter().map(|color| color.map(|value| 64.0 * value)).collect();
        let (a, b) = (saliency(SIDE, SIDE, &colors), saliency(SIDE, SIDE, &brighter));
        assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-3));
        assert!(a.contains(&1.0));
    }
}
