//! A plot of error over time and over memory, on logarithmic axes.

use bottega_image::Svg;

use super::{report::AlaReport, ways::MethodResult};

const SIDE: f64 = 360.0;
const MARGIN: f64 = 56.0;
const COLORS: [&str; 12] = [
    "#1b6ca8", "#7fb3d5", "#888", "#d95f02", "#1b9e77", "#66c2a5", "#8dd3c7", "#b2df8a", "#9ecae1", "#c6dbef",
    "#08519c", "#e6ab02",
];

/// Points, as logarithms on both axes.
type Points = Vec<[f64; 2]>;

pub(super) fn svg(report: &AlaReport) -> String {
    let rows = report.all().count();
    let (width, height) = (2.0 * SIDE + 3.0 * MARGIN, SIDE + 2.4 * MARGIN + 18.0 * rows.div_ceil(2) as f64);
    let mut svg = Svg::new(width, height, 12);
    let over_time = |result: &MethodResult| -> Points {
        result.marks.iter().map(|mark| [result.casting + mark.seconds, mark.error]).collect()
    };
    chart(&mut svg, MARGIN, "relMSE over seconds, casting included", report, over_time);
    let over_memory = |result: &MethodResult| -> Points {
        let is_mapped = result.megabytes() > 0.0;
        if is_mapped { vec![[result.megabytes(), result.error()]] } else { Vec::new() }
    };
    chart(&mut svg, 2.0 * MARGIN + SIDE, "relMSE over megabytes of maps", report, over_memory);
    for (number, result) in report.all().enumerate() {
        let (x, y) = (MARGIN + 400.0 * (number % 2) as f64, MARGIN + SIDE + 48.0 + 18.0 * (number / 2) as f64);
        let color = COLORS[number % COLORS.len()];
        svg.put(format_args!("<path d=\"M{x:.1} {y:.1}h24\" stroke=\"{color}\" stroke-width=\"3\"/>"));
        svg.text([x + 30.0, y + 4.0], "", &result.way.name);
    }
    svg.finish()
}

fn chart(svg: &mut Svg, left: f64, title: &str, report: &AlaReport, points: impl Fn(&MethodResult) -> Points) {
    let lines: Vec<Points> = report
        .all()
        .map(|result| points(result).into_iter().map(|point| point.map(|value| value.max(1e-9).log10())).collect())
        .collect();
    let bound = |axis: usize| {
        let values = || lines.iter().flatten().map(|point| point[axis]);
        let (low, high) = (values().fold(f64::MAX, f64::min), values().fold(f64::MIN, f64::max));
        if low < high { [low - 0.05, high + 0.05] } else { [low - 0.5, low + 0.5] }
    };
    let bounds = [bound(0), bound(1)];
    let share = |axis: usize, value: f64| (value - bounds[axis][0]) / (bounds[axis][1] - bounds[axis][0]);
    let (x, y) = (|value: f64| left + SIDE * share(0, value), |value: f64| MARGIN + SIDE * (1.0 - share(1, value)));
    svg.text([left, MARGIN - 16.0], "font-size=\"13\"", title);
    svg.put(format_args!(
        "<rect x=\"{left}\" y=\"{MARGIN}\" width=\"{SIDE}\" height=\"{SIDE}\" fill=\"none\" stroke=\"#999\"/>"
    ));
    for (axis, [low, high]) in bounds.into_iter().enumerate() {
        for tick in ticks(low, high) {
            let (at, label) = (tick.log10(), label(tick));
            if axis == 0 {
                svg.put(format_args!("<path d=\"M{:.1} {MARGIN}v{SIDE}\" stroke=\"#eee\"/>", x(at)));
                svg.text([x(at), MARGIN + SIDE + 16.0], "text-anchor=\"middle\"", label);
            } else {
                svg.put(format_args!("<path d=\"M{left} {:.1}h{SIDE}\" stroke=\"#eee\"/>", y(at)));
                svg.text([left - 6.0, y(at) + 4.0], "text-anchor=\"end\"", label);
            }
        }
    }
    for (line, color) in lines.iter().zip(COLORS.iter().cycle()) {
        let at: Vec<String> = line.iter().map(|&[a, b]| format!("{:.1},{:.1}", x(a), y(b))).collect();
        svg.put(format_args!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>",
            at.join(" ")
        ));
        for &[a, b] in line {
            svg.put(format_args!("<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\" fill=\"{color}\"/>", x(a), y(b)));
        }
    }
}

/// Returns 1, 2 and 5 times the powers of ten between two logarithms.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let powers = low.floor() as i32..=high.ceil() as i32;
    let all = powers.flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powi(power)));
    all.filter(|tick| (low..=high).contains(&tick.log10())).collect()
}

fn label(value: f64) -> String {
    if value >= 0.01 { format!("{value}") } else { format!("{value:.0e}") }
}
