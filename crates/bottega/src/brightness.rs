//! A check of a picture's brightness for screens.

use bottega_image::{Film, luminance};

/// Luminance of middle grey, a grey card.
const MIDDLE_GREY: f32 = 0.18;
/// Distance from middle grey, in stops, beyond which nothing is visible with any tone curve.
const STOPS_MAX: f32 = 6.0;
/// Quantile of the lit pixels that stands for the bright ones; pixels above it are lights and noise.
const BRIGHT: f32 = 0.99;
/// Largest number of pixels examined.
const PIXELS: usize = 1 << 20;

/// Returns a warning if a picture appears nearly black or white on a screen, with the exposure that corrects it; `None`: it is
/// fine.
///
/// A frequent cause is a wrong unit: Blender writes watts into glTF 683 times as bright as emissive surfaces.
///
/// - `exposure`: exposure of the picture in stops.
pub(crate) fn brightness_warning(film: &Film, exposure: f32) -> Option<String> {
    let step = (film.rect().area() as usize).div_ceil(PIXELS).max(1);
    let shown = |(x, y)| {
        let [r, g, b, _] = film.color(x, y);
        luminance([r, g, b])
    };
    warning(film.rect().pixels().step_by(step).map(shown), exposure)
}

/// Judges luminances: white if half of the lit pixels are too bright, black if all of them are too dark. Unlit pixels, such as
/// a dark background, do not count.
fn warning(luminances: impl Iterator<Item = f32>, exposure: f32) -> Option<String> {
    let mut lit: Vec<f32> = luminances.filter(|&luminance| luminance > 0.0 && luminance.is_finite()).collect();
    if lit.is_empty() {
        return Some(
            "is black: nothing that the camera sees is lit; `--env 1,1,1` adds light from all around".to_owned(),
        );
    }
    let last = lit.len() - 1;
    let mut stops_at = |share: f32| {
        let (_, &mut value, _) = lit.select_nth_unstable_by((share * last as f32) as usize, f32::total_cmp);
        (value / MIDDLE_GREY).log2() + exposure
    };
    let (middle, bright) = (stops_at(0.5), stops_at(BRIGHT));
    let (what, stops) = match () {
        () if middle > STOPS_MAX => (format!("white: half of it is {middle:.1} stops and more above"), middle),
        () if bright < -STOPS_MAX => {
            (format!("black: nearly all of it is {:.1} stops and more below", -bright), bright)
        }
        () => return None,
    };
    Some(format!("is nearly {what} middle grey; `--exposure {:.1}` shows it", exposure - stops))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Judges 100 pixels: one black, `count` of luminance `value`, the others faintly lit.
    fn warning_of(value: f32, count: usize, exposure: f32) -> Option<String> {
        let faint = std::iter::repeat_n(1e-6, 99 - count);
        warning([0.0].into_iter().chain(std::iter::repeat_n(value, count)).chain(faint), exposure)
    }

    #[test]
    fn only_invisible_pictures_are_warned_of() {
        assert!([0.01, 0.18, 1.0, 8.0].into_iter().all(|value| warning_of(value, 99, 0.0).is_none()));
        let bright = warning_of(0.18 * 1024.0, 99, 0.0).unwrap();
        assert!(bright.contains("white: half of it is 10.0 stops and more above"), "{bright}");
        assert!(bright.contains("--exposure -10.0"), "{bright}");
        assert!(warning_of(0.18 * 1024.0, 99, -10.0).is_none());
        let dark = warning_of(0.18 / 256.0, 99, 1.0).unwrap();
        assert!(dark.contains("black: nearly all of it is 7.0 stops and more below"), "{dark}");
        assert!(dark.contains("--exposure 8.0"), "{dark}");
        assert!(warning_of(0.0, 0, 0.0).unwrap().contains("nearly black"));
        assert!(warning([0.0; 4].into_iter(), 0.0).unwrap().contains("--env"));
    }

    #[test]
    fn dark_backgrounds_and_bright_windows_give_no_warning() {
        assert!(warning_of(0.2, 10, 0.0).is_none(), "a lit thing before a dark background");
        assert!(warning([vec![0.2; 60], vec![1e4; 40]].concat().into_iter(), 0.0).is_none(), "a bright window");
    }
}
