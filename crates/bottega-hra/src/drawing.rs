//! A drawing of the activities of resources and of the work bin.

use std::fmt::Write;

use crate::{Activity, HraReport, PacketUse, ResourceReport, Time};

const WIDTH: f64 = 1000.0;
const LEFT: f64 = 180.0;
const RIGHT: f64 = 80.0;
const ROW: f64 = 28.0;
const BAR: f64 = 18.0;
const TOP: f64 = 30.0;
/// Height of the row that shows the bin, in pixels.
const BIN: f64 = 48.0;
/// Height of a line of text below the drawing, in pixels.
const LINE: f64 = 18.0;

/// Returns a drawing of the activity of the resources as SVG: a bar per resource, with its occupation in percent, the
/// share of the drawn time in which it had work. Below are the number of units waiting in the bin, and the incidents.
/// Needs [`HraConfig::spans_kept`](crate::HraConfig::spans_kept).
///
/// - `window`: start and end of the drawn time; `None`: all of the report.
pub fn timeline_svg(report: &HraReport, window: Option<(Time, Time)>) -> String {
    let (from, to) = window.unwrap_or((Time::ZERO, Time::at(report.uptime)));
    let rows = TOP + ROW * report.resources.len() as f64;
    let lines = report.incidents.len() + usize::from(report.expiries.count() > 0);
    let height = rows + BIN + 40.0 + LINE * lines as f64;
    let mut svg = String::new();
    // Writing to a string cannot fail
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#ffffff\"/>\n"
    );
    legend(&mut svg);
    let scale = TimeScale { from, to };
    for (resource, row) in report.resources.iter().zip(0..) {
        draw_row(&mut svg, resource, TOP + ROW * f64::from(row), &scale);
    }
    draw_bin(&mut svg, report, rows, &scale);
    let axis = rows + BIN + 20.0;
    let span_ns = to.since(from).as_nanos().max(1) as f64;
    for tenth in 0..=10_u32 {
        let at = from.plus_ns(span_ns * f64::from(tenth) / 10.0);
        let seconds = at.since(Time::ZERO).as_secs_f64();
        let x = scale.x(at);
        let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{axis:.1}\" text-anchor=\"middle\">{seconds:.3} s</text>");
    }
    draw_incidents(&mut svg, report, axis + LINE, &scale);
    draw_expiries(&mut svg, report, (rows, axis + LINE * (1 + report.incidents.len()) as f64), &scale);
    svg.push_str("</svg>\n");
    svg
}

/// The horizontal scale of times.
struct TimeScale {
    from: Time,
    to: Time,
}

impl TimeScale {
    fn x(&self, at: Time) -> f64 {
        let span_ns = self.to.since(self.from).as_nanos().max(1) as f64;
        LEFT + (WIDTH - LEFT - RIGHT) * (at.since(self.from).as_nanos() as f64 / span_ns).min(1.0)
    }
}

fn legend(svg: &mut String) {
    let words = [
        (Activity::Working, "at work"),
        (Activity::Idle, "idle"),
        (Activity::Suspended, "not used after a failure"),
        (Activity::Retired, "given up"),
    ];
    let mut x = LEFT;
    for (activity, words) in words {
        let _ = writeln!(
            svg,
            "<rect x=\"{x}\" y=\"8\" width=\"12\" height=\"12\" fill=\"{}\"/><text x=\"{}\" y=\"18\">{words}</text>",
            colour(activity),
            x + 16.0
        );
        x += 34.0 + 6.5 * words.len() as f64;
    }
}

fn draw_row(svg: &mut String, resource: &ResourceReport, y: f64, scale: &TimeScale) {
    let text = y + BAR - 4.0;
    let _ = writeln!(svg, "<text x=\"8\" y=\"{text:.1}\">{}</text>", escaped(&resource.descriptor.name, 24));
    let mut busy = 0.0;
    for span in resource.spans.iter().filter(|span| span.to > scale.from && span.from < scale.to) {
        let (start, end) = (span.from.max(scale.from), span.to.min(scale.to));
        if span.activity == Activity::Working {
            busy += end.since(start).as_nanos() as f64;
        }
        let (left, width) = (scale.x(start), scale.x(end) - scale.x(start));
        let colour = colour(span.activity);
        let _ = writeln!(
            svg,
            "<rect x=\"{left:.2}\" y=\"{y:.1}\" width=\"{width:.2}\" height=\"{BAR}\" fill=\"{colour}\"/>"
        );
    }
    let percent = 100.0 * busy / scale.to.since(scale.from).as_nanos().max(1) as f64;
    let _ = writeln!(
        svg,
        "<text x=\"{:.1}\" y=\"{text:.1}\">{percent:.1} %<title>{}</title></text>",
        WIDTH - RIGHT + 8.0,
        escaped(&tuning(&resource.packets), 200)
    );
    let _ = writeln!(
        svg,
        "<text x=\"8\" y=\"{:.1}\" font-size=\"8\" fill=\"#666666\">{}</text>",
        text + 9.0,
        escaped(&tuning(&resource.packets), 44)
    );
}

/// Returns what tuning chose for a resource as readable text: the sizes of packets, and the window of a far one.
fn tuning(packets: &PacketUse) -> String {
    let window = packets
        .round_trip
        .map_or_else(String::new, |time| format!(", {} in flight, {:.1} ms", packets.window, 1e3 * time.as_secs_f64()));
    format!("{} packets, {:.1} units each{window}", packets.packets, packets.mean_units())
}

/// Draws the waiting units as an area, and the bin's capacity as a line above it.
fn draw_bin(svg: &mut String, report: &HraReport, top: f64, scale: &TimeScale) {
    let steps: Vec<_> = report.bin.steps.iter().filter(|step| step.to > scale.from && step.from < scale.to).collect();
    // A capacity beyond the scale is drawn at the top
    let most = steps.iter().map(|step| step.waiting).fold(1.0, f64::max);
    let bottom = top + BIN - 4.0;
    let y = |units: f64| bottom - (BIN - 10.0) * (units / most).min(1.0);
    let (mut area, mut line) = (format!("{LEFT:.1},{bottom:.1}"), String::new());
    for step in &steps {
        let (left, right) = (scale.x(step.from.max(scale.from)), scale.x(step.to));
        let (waiting, capacity) = (y(step.waiting), y(step.capacity as f64));
        let _ = write!(area, " {left:.1},{waiting:.1} {right:.1},{waiting:.1}");
        let _ = write!(line, " {left:.1},{capacity:.1} {right:.1},{capacity:.1}");
    }
    let end = steps.last().map_or(LEFT, |step| scale.x(step.to));
    let full = 100.0 * report.bin.full.as_secs_f64() / report.uptime.as_secs_f64().max(f64::MIN_POSITIVE);
    let _ = writeln!(
        svg,
        "<text x=\"8\" y=\"{:.1}\">units that wait</text>\n<polygon points=\"{area} {end:.1},{bottom:.1}\" \
         fill=\"#4a7fb5\"/>\n<polyline points=\"{}\" fill=\"none\" stroke=\"#999999\"/>\n<text x=\"{:.1}\" \
         y=\"{:.1}\">at most {most:.0}</text>\n<text x=\"{:.1}\" y=\"{bottom:.1}\">full {full:.0} %</text>\n<text x=\"8\" \
         y=\"{:.1}\" font-size=\"8\" fill=\"#666666\">room for {} at the end</text>",
        top + BIN / 2.0,
        line.trim_start(),
        WIDTH - RIGHT + 8.0,
        top + 14.0,
        WIDTH - RIGHT + 8.0,
        top + BIN / 2.0 + 11.0,
        report.bin_capacity,
    );
}

/// Draws a line of text per incident, with a mark at its last time.
fn draw_incidents(svg: &mut String, report: &HraReport, top: f64, scale: &TimeScale) {
    for (incident, line) in report.incidents.iter().zip(0..) {
        let y = top + LINE * f64::from(line);
        let resource = report.resources.iter().position(|resource| resource.id == incident.resource);
        let name =
            resource.map_or_else(|| incident.resource.to_string(), |at| report.resources[at].descriptor.name.clone());
        let text = format!(
            "{name} {} at {:.3} s, {} times: {}",
            incident.fault,
            incident.last.since(Time::ZERO).as_secs_f64(),
            incident.count,
            incident.reason
        );
        let _ = writeln!(svg, "<text x=\"8\" y=\"{y:.1}\" fill=\"#a33a3a\">{}</text>", escaped(&text, 140));
        if let Some(row) = resource {
            let (x, y) = (scale.x(incident.last), TOP + ROW * row as f64);
            let _ = writeln!(
                svg,
                "<path d=\"M{x:.1} {:.1} l-4 -7 h8 z\" fill=\"#a33a3a\"><title>{}</title></path>",
                y + 2.0,
                escaped(&text, 140)
            );
        }
    }
}

/// Draws a line of text for expired units, and a bar above the bin from the first to the last.
fn draw_expiries(svg: &mut String, report: &HraReport, (bin, line): (f64, f64), scale: &TimeScale) {
    let expired = &report.expiries;
    if expired.count() == 0 {
        return;
    }
    let [first, last] = [expired.first, expired.last].map(|at| at.since(Time::ZERO).as_secs_f64());
    let (left, right) = (scale.x(expired.first), scale.x(expired.last));
    let _ = writeln!(
        svg,
        "<rect x=\"{left:.1}\" y=\"{bin:.1}\" width=\"{:.1}\" height=\"3\" fill=\"#a33a3a\"/>\n<text x=\"8\" y=\"{line:.1}\" \
         fill=\"#a33a3a\">{} units were past their life time, {} of them before anybody began with them, from {first:.3} s to \
         {last:.3} s</text>",
        (right - left).max(2.0),
        expired.count(),
        expired.waiting,
    );
}

fn colour(activity: Activity) -> &'static str {
    match activity {
        Activity::Idle => "#e6e6e6",
        Activity::Working => "#2f7d4f",
        Activity::Suspended => "#d9902f",
        Activity::Retired => "#a33a3a",
    }
}

/// Returns a name as XML text, without illegal characters.
fn escaped(name: &str, length_max: usize) -> String {
    let mut out = String::new();
    for c in name.chars().take(length_max) {
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
        let bars = |svg: &str| {
            svg.lines()
                .filter(|line| line.contains("height=\"18\"") && line.contains(colour(Activity::Working)))
                .count()
        };
        assert_eq!(bars(&svg), 1, "{svg}");
        let half = timeline_svg(&outcome.report, Some((Time::ZERO, outcome.end.after(outcome.end.since(Time::ZERO)))));
        assert!(half.contains("50.0 %"), "{half}");
        // Waiting units are drawn: ten units, one in progress.
        let bin = &outcome.report.bin;
        assert!(bin.mean_waiting > 3.0 && bin.mean_waiting < 9.0, "{bin:?}");
    }

    #[test]
    fn units_past_their_life_time_are_a_line() {
        let mut load = Load::batch(10, 100, &[Primitive::Intersect]);
        load.arrivals[9].validity = std::time::Duration::from_millis(50);
        let outcome = simulate(HraConfig::default(), &[Model::near("cpu", 1e5)], &load, &CostBook::new(""), 0);
        assert_eq!((outcome.done(), outcome.report.expiries.waiting), (9, 1));
        let svg = timeline_svg(&outcome.report, None);
        assert!(svg.contains("1 units were past their life time, 1 of them before anybody began"), "{svg}");
        let json = crate::timeline_json(&outcome.report);
        assert!(json.contains("\"expired\":{\"waiting\":1,\"late\":0,\"first\":0.05"), "{json}");
    }
}
