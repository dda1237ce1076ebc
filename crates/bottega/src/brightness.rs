//! The brightness of a picture beside what a screen can show.

use bottega_image::{Film, luminance};

/// What a screen shows as the middle between black and white: a grey card.
const MIDDLE_GREY: f32 = 0.18;
/// So far from it nothing is left to be seen, whatever the curve.
const STOPS_MAX: f32 = 6.0;
/// The share of the lit pixels that are not brighter: what is brighter than these is lamps and noise.
const BRIGHT: f32 = 0.99;
/// Pixels that are looked at.
const PIXELS: usize = 1 << 20;

/// What is wrong with the brightness of a picture that a screen is to show, and what would mend it.
///
/// Lamps are often in other units than they seem: Blender writes watts into glTF 683 times as bright as what glows.
///
/// - `exposure`: in stops, as it is shown with.
pub(crate) fn told_brightness(film: &Film, exposure: f32) -> Option<String> {
    let step = (film.rect().area() as usize).div_ceil(PIXELS).max(1);
    let shown = |(x, y)| {
        let [r, g, b, _] = film.color(x, y);
        luminance([r, g, b])
    };
    told(film.rect().pixels().step_by(step).map(shown), exposure)
}

/// White is where half of what is lit is too bright, black where all of it is too dark: a dark background is none.
fn told(luminances: impl Iterator<Item = f32>, exposure: f32) -> Option<String> {
    let mut lit: Vec<f32> = luminances.filter(|&it| it > 0.0 && it.is_finite()).collect();
    if lit.is_empty() {
        return Some(
            "is black: no light comes from what the camera sees; `--env 1,1,1` adds some from all around".to_owned(),
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

    /// Of a hundred pixels one is dark, and so many of the others have a value; the rest is faintly lit.
    fn told_of(value: f32, count: usize, exposure: f32) -> Option<String> {
        let faint = std::iter::repeat_n(1e-6, 99 - count);
        told([0.0].into_iter().chain(std::iter::repeat_n(value, count)).chain(faint), exposure)
    }

    #[test]
    fn only_what_cannot_be_seen_is_told() {
        assert!([0.01, 0.18, 1.0, 8.0].into_iter().all(|value| told_of(value, 99, 0.0).is_none()));
        let bright = told_of(0.18 * 1024.0, 99, 0.0).unwrap();
        assert!(bright.contains("white: half of it is 10.0 stops and more above"), "{bright}");
        assert!(bright.contains("--exposure -10.0"), "{bright}");
        assert!(told_of(0.18 * 1024.0, 99, -10.0).is_none());
        let dark = told_of(0.18 / 256.0, 99, 1.0).unwrap();
        assert!(dark.contains("black: nearly all of it is 7.0 stops and more below"), "{dark}");
        assert!(dark.contains("--exposure 8.0"), "{dark}");
        assert!(told_of(0.0, 0, 0.0).unwrap().contains("nearly black"));
        assert!(told([0.0; 4].into_iter(), 0.0).unwrap().contains("--env"));
    }

    #[test]
    fn what_stands_in_the_dark_or_beside_a_window_is_seen() {
        assert!(told_of(0.2, 10, 0.0).is_none(), "a lit thing before a dark background");
        assert!(told([vec![0.2; 60], vec![1e4; 40]].concat().into_iter(), 0.0).is_none(), "a bright window");
    }
}
