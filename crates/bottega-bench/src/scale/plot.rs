//! A drawing of all curves, in logarithmic axes, each with its law.

use bottega_image::Svg;

use super::curve::{Curve, Point};

/// Width and height of a chart in pixels.
const SIDE: f64 = 220.0;
/// Space around a chart in pixels.
const MARGIN: f64 = 60.0;
/// Number of charts in a row.
const COLUMNS: usize = 3;

/// Returns the drawing: measured points in blue, and the band of the law from the last point in gray.
pub(super) fn svg(curves: &[Curve]) -> String {
    let rows = curves.len().div_ceil(COLUMNS);
    let pitch = SIDE + MARGIN;
    let mut svg = Svg::new(COLUMNS as f64 * pitch + MARGIN, rows as f64 * (pitch + 10.0) + MARGIN, 11);
    for (number, curve) in curves.iter().enumerate() {
        let (column, row) = (number % COLUMNS, number / COLUMNS);
        let corner = [MARGIN + column as f64 * pitch, MARGIN + row as f64 * (pitch + 10.0)];
        draw(&mut svg, curve, corner);
    }
    svg.finish()
}

/// A logarithmic axis.
struct LogAxis {
    low: f64,
    high: f64,
}

impl LogAxis {
    /// Returns the axis over some values, from one power of ten to another.
    fn over(values: impl Iterator<Item = f64> + Clone) -> Self {
        let low = values.clone().fold(f64::INFINITY, f64::min).max(1e-9).log10().floor();
        let high = values.fold(0.0, f64::max).max(1e-9).log10().ceil();
        Self { low, high: high.max(low + 1.0) }
    }

    /// Returns the position of a value, 0 at the low end and 1 at the high one.
    fn at(&self, value: f64) -> f64 {
        (value.max(1e-12).log10() - self.low) / (self.high - self.low)
    }
}

fn draw(svg: &mut Svg, curve: &Curve, [left, top]: [f64; 2]) {
    let bottom = top + SIDE;
    let (sizes, values) = (curve.points.iter().map(|it| it.size as f64), curve.points.iter().map(|it| it.value));
    let (across, up) = (LogAxis::over(sizes), LogAxis::over(values));
    let place = |size: f64, value: f64| (left + SIDE * across.at(size), bottom - SIDE * up.at(value));
    // Title, frame and the powers of ten at the ends
    let exponent = curve.exponent.map_or("?".to_owned(), |exponent| format!("{exponent:.2}"));
    svg.text([left, top - 20.0], "", curve.quantity);
    svg.text(
        [left, top - 6.0],
        "fill=\"#666\"",
        format_args!("by {}: law {}, exponent {exponent}", curve.axis, curve.law),
    );
    svg.put(format_args!(
        "<path d=\"M{left:.1} {top:.1}V{bottom:.1}H{:.1}\" fill=\"none\" stroke=\"#999\"/>",
        left + SIDE
    ));
    for (power, y) in [(up.low, bottom), (up.high, top + 8.0)] {
        svg.text([left - 4.0, y], "text-anchor=\"end\"", format_args!("1e{:.0}", power + 0.0));
    }
    for (power, x) in [(across.low, left), (across.high, left + SIDE)] {
        svg.text([x, bottom + 14.0], "text-anchor=\"middle\"", format_args!("1e{:.0}", power + 0.0));
    }
    // The law through the last point, by both exponents
    if let [first, .., last] = curve.points[..] {
        for exponent in curve.expected {
            let value = last.value * (first.size as f64 / last.size as f64).powf(exponent);
            let ((x0, y0), (x1, y1)) = (place(first.size as f64, value), place(last.size as f64, last.value));
            let style = "stroke=\"#bbb\" stroke-dasharray=\"4 3\"";
            svg.put(format_args!("<path d=\"M{x0:.1} {:.1}L{x1:.1} {y1:.1}\" {style}/>", y0.clamp(top, bottom)));
        }
    }
    // The measured points
    let point = |it: &Point| place(it.size as f64, it.value);
    let line: Vec<String> = curve.points.iter().map(point).map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    svg.put(format_args!("<polyline points=\"{}\" fill=\"none\" stroke=\"#04c\" stroke-width=\"2\"/>", line.join(" ")));
    for (x, y) in curve.points.iter().map(point) {
        svg.put(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"#04c\"/>"));
    }
}
