//! Time lines of resources as a drawing.

use std::fmt::Write;

use crate::{Activity, HraReport, ResourceReport, Time};

const WIDTH: f64 = 1000.0;
const LEFT: f64 = 180.0;
const RIGHT: f64 = 80.0;
const ROW: f64 = 28.0;
const BAR: f64 = 18.0;
const TOP: f64 = 30.0;

/// Draws what each resource was at as SVG, a bar a resource with its occupation in percent: the share of the time
/// since the allocator was made, or of `from` to `to`, in which it had work. Needs
/// [`HraConfig::spans_kept`](crate::HraConfig::spans_kept).
pub fn timeline_svg(report: &HraReport, window: Option<(Time, Time)>) -> String {
    let (from, to) = window.unwrap_or((Time::ZERO, Time::at(report.uptime)));
    let span_ns = to.since(from).as_nanos().max(1) as f64;
    let height = TOP + ROW * report.resources.len() as f64 + 30.0;
    let mut svg = String::new();
    // Writing to a string does not fail.
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
    );
    let x = |at: Time| LEFT + (WIDTH - LEFT - RIGHT) * (at.since(from).as_nanos() as f64 / span_ns).min(1.0);
    for (resource, row) in report.resources.iter().zip(0..) {
        draw_row(&mut svg, resource, TOP + ROW * f64::from(row), (from, to), x);
    }
    let axis = height - 12.0;
    for tenth in 0..=10_u32 {
        let at = from.plus_ns(span_ns * f64::from(tenth) / 10.0);
        let seconds = at.since(Time::ZERO).as_secs_f64();
        let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{axis:.1}\" text-anchor=\"middle\">{seconds:.3} s</text>", x(at));
    }
    svg.push_str("</svg>\n");
    svg
}

fn draw_row(svg: &mut String, resource: &ResourceReport, y: f64, (from, to): (Time, Time), x: impl Fn(Time) -> f64) {
    let text = y + BAR - 4.0;
    let _ = writeln!(svg, "<text x=\"8\" y=\"{text:.1}\">{}</text>", escaped(&resource.descriptor.name));
    let mut busy = 0.0;
    for span in resource.spans.iter().filter(|span| span.to > from && span.from < to) {
        let (start, end) = (span.from.max(from), span.to.min(to));
        if span.activity == Activity::Working {
            busy += end.since(start).as_nanos() as f64;
        }
        let (left, width) = (x(start), x(end) - x(start));
        let colour = colour(span.activity);
        let _ = writeln!(
            svg,
            "<rect x=\"{left:.2}\" y=\"{y:.1}\" width=\"{width:.2}\" height=\"{BAR}\" fill=\"{colour}\"/>"
        );
    }
    let percent = 100.0 * busy / to.since(from).as_nanos().max(1) as f64;
    let _ = writeln!(svg, "<text x=\"{:.1}\" y=\"{text:.1}\">{percent:.1} %</text>", WIDTH - RIGHT + 8.0);
}

fn colour(activity: Activity) -> &'static str {
    match activity {
        Activity::Idle => "#e6e6e6",
        Activity::Working => "#2f7d4f",
        Activity::Suspended => "#d9902f",
        Activity::Retired => "#a33a3a",
    }
}

/// A name as XML text; what no XML may hold is left out.
fn escaped(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars().take(24) {
        match c {
            '<' => out.push_str("&lt;"),
            '&' => out.push_str("&amp;"),
            c if c.is_control() => {}
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Load, Model, simulate};
    use crate::{CostBook, HraConfig, Primitive};

    #[test]
    fn each_resource_has_a_row_with_its_occupation() {
        let models = [Model::near("a < b & c", 1e6), Model::near("idle", 1e9)];
        let load = Load::batch(10, 100, &[Primitive::Intersect]);
        let config = HraConfig { spans_kept: 50, ..HraConfig::default() };
        let mut book = CostBook::new("");
        for model in &models {
            let ns = model.time_per_item[0].unwrap_or(0.0);
            book.set(&model.name, Primitive::Intersect, crate::CostModel::known(9, 900, 0.0, ns, 0.0));
        }
        let outcome = simulate(config, &models, &load, &book, 0);
        let svg = timeline_svg(&outcome.report, None);
        // All of the work is done by the first, without a pause; the second would have ended later with a single unit.
        assert!(svg.contains("a &lt; b &amp; c") && svg.contains("100.0 %") && svg.contains(">0.0 %"), "{svg}");
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        assert_eq!(svg.matches(colour(Activity::Working)).count(), 1, "{svg}");
        let half = timeline_svg(&outcome.report, Some((Time::ZERO, outcome.end.after(outcome.end.since(Time::ZERO)))));
        assert!(half.contains("50.0 %"), "{half}");
    }
}
