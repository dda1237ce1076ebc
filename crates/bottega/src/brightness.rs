//! The brightness of a picture beside what a screen can show.

use bottega_image::Film;

/// What a screen shows as the middle between black and white: a grey card.
const MIDDLE_GREY: f32 = 0.18;
/// So far from it nothing is left to be seen, whatever the curve.
const STOPS_MAX: f32 = 6.0;

/// What is wrong with the brightness of a picture that a screen is to show, and what would mend it.
///
/// Lamps are often in other units than they seem: Blender writes watts into glTF 683 times as bright as what glows.
///
/// - `exposure`: in stops, as it is shown with.
pub(crate) fn told_brightness(film: &Film, exposure: f32) -> Option<String> {
    let luminance = |(x, y)| {
        let [r, g, b, _] = film.color(x, y);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    };
    told(film.rect().pixels().map(luminance), exposure)
}

fn told(luminances: impl Iterator<Item = f32>, exposure: f32) -> Option<String> {
    let (mut logarithms, mut lit) = (0.0, 0_u64);
    for luminance in luminances {
        if luminance > 0.0 && luminance.is_finite() {
            logarithms += f64::from(luminance.log2());
            lit += 1;
        }
    }
    if lit == 0 {
        return Some(
            "is black: no light comes from what the camera sees; `--env 1,1,1` adds some from all around".to_owned(),
        );
    }
    let stops = logarithms / lit as f64 - f64::from(MIDDLE_GREY.log2()) + f64::from(exposure);
    if stops.abs() <= f64::from(STOPS_MAX) {
        return None;
    }
    let (how, side) = if stops > 0.0 { ("white", "above") } else { ("black", "below") };
    let away = stops.abs();
    Some(format!(
        "is nearly {how}: its light is {away:.1} stops {side} middle grey; `--exposure {:.1}` shows it",
        f64::from(exposure) - stops
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pixels, one of them dark.
    fn told_of(value: f32, exposure: f32) -> Option<String> {
        told([0.0, value].into_iter(), exposure)
    }

    #[test]
    fn only_what_cannot_be_seen_is_told() {
        assert!([0.01, 0.18, 1.0, 8.0].into_iter().all(|value| told_of(value, 0.0).is_none()));
        let bright = told_of(0.18 * 1024.0, 0.0).unwrap();
        assert!(
            bright.contains("nearly white")
                && bright.contains("10.0 stops above")
                && bright.contains("--exposure -10.0")
        );
        assert!(told_of(0.18 * 1024.0, -10.0).is_none());
        let dark = told_of(0.18 / 256.0, 1.0).unwrap();
        assert!(dark.contains("nearly black") && dark.contains("7.0 stops below") && dark.contains("--exposure 8.0"));
        assert!(told_of(0.0, 0.0).unwrap().contains("--env"));
    }
}
