//! Text sizes and numbers of axes.

/// The height of text at axes, in pixels.
pub(super) const TEXT: u32 = 15;
/// The height of a chart's title, in pixels.
pub(super) const TITLE: u32 = 18;

/// Returns the interval, widened if it is empty.
pub(super) fn padded((low, high): (f64, f64)) -> (f64, f64) {
    if low < high {
        return (low, high);
    }
    let half = 0.5 * low.abs().max(1.0);
    (low - half, low + half)
}

/// Returns a tenth of the width: the precision of an axis's numbers.
pub(super) fn tick_step(width: f64) -> f64 {
    width / 10.0
}

/// Formats a number with the precision of a step.
pub(super) fn number(value: f64, step: f64) -> String {
    if value != 0.0 && !(1e-4..1e6).contains(&value.abs().max(step)) {
        return format!("{value:.2e}");
    }
    let places = (-step.log10()).ceil().clamp(0.0, 9.0) as usize;
    let text = format!("{value:.places$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text.as_str() };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_as_many_places_as_they_need() {
        let shown = [(0.30000000000000004, 0.1), (12.0, 2.0), (0.005, 0.001), (-0.0, 0.1), (1.5e7, 1e6), (5.0, 0.4)];
        assert_eq!(shown.map(|(value, step)| number(value, step)), ["0.3", "12", "0.005", "0", "1.50e7", "5"]);
    }
}
