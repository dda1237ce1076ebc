//! A Gantt chart of a simulation as SVG: a row per agent, or for many agents the utilization of groups.

use bottega_farm::simulate::{SimulationOutcome, Span, SpanKind};
use bottega_image::{Svg, svg_text};

/// Above this number, agents are drawn in groups.
const ROWS_MAX: usize = 64;
/// The number of groups and time bins for many agents.
const GROUPS: usize = 100;
const BINS: usize = 300;

/// Sizes in pixels.
const LEFT: f64 = 90.0;
const TOP: f64 = 44.0;
const PLOT_WIDTH: f64 = 900.0;
const ROW_HEIGHT: f64 = 28.0;
const GROUP_HEIGHT: f64 = 5.0;
const BOTTOM: f64 = 40.0;
/// The minimum width of a span that shows its number.
const NUMBER_WIDTH: f64 = 8.0;

/// Returns an SVG drawing of a simulated run: the zones of each agent over time.
pub(crate) fn svg(outcome: &SimulationOutcome) -> String {
    let many = outcome.agents.len() > ROWS_MAX;
    let height = if many {
        GROUP_HEIGHT * GROUPS.min(outcome.agents.len()) as f64
    } else {
        ROW_HEIGHT * outcome.agents.len() as f64
    };
    let (width, whole) = (LEFT + PLOT_WIDTH + 20.0, TOP + height + BOTTOM);
    let mut svg = Svg::new(width, whole, 11);
    let title = format!(
        "{} zones, {} agents: {:.2} s, efficiency {:.1} %",
        outcome.zones,
        outcome.agents.len(),
        outcome.makespan.as_secs_f64(),
        100.0 * outcome.efficiency()
    );
    svg.text([LEFT, 18.0], "", title);
    let end = outcome.spans.iter().map(|span| span.end.elapsed()).fold(outcome.makespan, std::cmp::max).as_secs_f64();
    let scale = PLOT_WIDTH / end.max(1e-9);
    if many {
        groups(&mut svg, outcome, end);
    } else {
        rows(&mut svg, outcome, scale);
    }
    axis(&mut svg, outcome, end, scale, height);
    svg.finish()
}

fn rect(svg: &mut Svg, [x, y, width, height]: [f64; 4], fill: &str, title: &str) {
    svg.put(format_args!(
        "<rect x=\"{x:.2}\" y=\"{y:.2}\" width=\"{:.2}\" height=\"{height:.2}\" fill=\"{fill}\"><title>{}</title></rect>",
        width.max(0.3),
        svg_text(title),
    ));
}

/// Draws the time axis, and marks the time of completion.
fn axis(svg: &mut Svg, outcome: &SimulationOutcome, end: f64, scale: f64, height: f64) {
    let bottom = TOP + height;
    let step = nice_step(end / 8.0);
    let mut at = 0.0;
    while at <= end {
        let x = LEFT + at * scale;
        svg.put(format_args!("<path d=\"M{x:.1} {TOP}V{:.1}\" stroke=\"#0003\"/>", bottom + 4.0));
        svg.text([x, bottom + 16.0], "text-anchor=\"middle\"", format_args!("{} s", (at * 1e6).round() / 1e6));
        at += step;
    }
    let marks = [("least", outcome.least, "#06c"), ("end", Some(outcome.makespan), "#000")];
    for (name, time, color) in marks {
        let Some(x) = time.map(|time| LEFT + time.as_secs_f64() * scale) else { continue };
        svg.put(format_args!(
            "<path d=\"M{x:.1} {:.1}V{bottom:.1}\" stroke=\"{color}\" stroke-dasharray=\"4 2\"/>",
            TOP - 6.0
        ));
        let (anchor, x) = if name == "least" { ("text-anchor=\"end\"", x - 2.0) } else { ("", x - 8.0) };
        svg.text([x, TOP - 8.0], anchor, name);
    }
    svg.text([LEFT, bottom + 32.0], "", legend(outcome.agents.len() > ROWS_MAX));
}

fn legend(many: bool) -> &'static str {
    if many {
        "dark: all agents of a group busy; light: idle. Groups of agents in their order, from above."
    } else {
        "pale: first samples of a zone; full: the rest; red: lost with an agent or failed. Numbers are zones."
    }
}

/// Returns the least of 1, 2 or 5 times a power of ten that is at least `wanted`.
fn nice_step(wanted: f64) -> f64 {
    let power = 10_f64.powf(wanted.max(1e-9).log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|step| *step >= wanted).unwrap_or(10.0 * power)
}

fn rows(svg: &mut Svg, outcome: &SimulationOutcome, scale: f64) {
    for (index, agent) in outcome.agents.iter().enumerate() {
        let top = TOP + ROW_HEIGHT * index as f64;
        let place = [LEFT - 6.0, top + 0.65 * ROW_HEIGHT];
        svg.text(place, "text-anchor=\"end\"", format_args!("{} ×{}", agent.name, agent.speed));
        let mut spans: Vec<&Span> = outcome.spans.iter().filter(|span| span.agent as usize == index).collect();
        spans.sort_by_key(|span| (span.begin, span.zone));
        let (lanes, count) = lanes(&spans);
        let height = (ROW_HEIGHT - 4.0) / count as f64;
        for (span, lane) in spans.iter().zip(lanes) {
            let x = LEFT + span.begin.elapsed().as_secs_f64() * scale;
            let width = span.end.since(span.begin).as_secs_f64() * scale;
            let y = top + 2.0 + height * lane as f64;
            rect(svg, [x, y, width, height], &color(span), &title(span));
            let number = span.zone.0.to_string();
            if span.kind == SpanKind::Painting && width > NUMBER_WIDTH * number.len() as f64 {
                let attributes = format!("text-anchor=\"middle\" font-size=\"{:.1}\"", height.min(11.0));
                svg.text([x + width / 2.0, y + 0.85 * height], &attributes, number);
            }
        }
    }
}

/// Assigns spans to lanes so that none overlap. Returns the lane of each, and the number of lanes.
fn lanes(spans: &[&Span]) -> (Vec<usize>, usize) {
    let mut free = Vec::new();
    let lane_of = |span: &&Span| {
        let lane = free.iter().position(|end| *end <= span.begin).unwrap_or(free.len());
        if lane == free.len() {
            free.push(span.end);
        }
        free[lane] = span.end;
        lane
    };
    let lanes: Vec<usize> = spans.iter().map(lane_of).collect();
    (lanes, free.len().max(1))
}

/// Returns the color of a span; hues of successive zones are a golden angle apart, so that they are easy to distinguish.
fn color(span: &Span) -> String {
    let hue = (f64::from(span.zone.0) * 137.508).rem_euclid(360.0);
    match span.kind {
        SpanKind::Lost => "#d22".to_owned(),
        SpanKind::Profiling => format!("hsl({hue:.0} 45% 86%)"),
        SpanKind::Painting => format!("hsl({hue:.0} 50% 66%)"),
    }
}

fn title(span: &Span) -> String {
    let seconds = |time: bottega_agents::Time| time.elapsed().as_secs_f64();
    format!("{}, {:?}, {:.3} to {:.3} s", span.zone, span.kind, seconds(span.begin), seconds(span.end))
}

/// Draws the utilization of groups of agents over time.
fn groups(svg: &mut Svg, outcome: &SimulationOutcome, end: f64) {
    let agents = outcome.agents.len();
    let groups = GROUPS.min(agents);
    let group_of = |agent: usize| agent * groups / agents;
    // Sum up busy agents by group and time bin. Overlapping spans of one agent are merged first, so that it counts once.
    let mut busy = vec![0.0_f64; groups * BINS];
    let mut size = vec![0_u32; groups];
    (0..agents).for_each(|agent| size[group_of(agent)] += 1);
    let bin = end.max(1e-9) / BINS as f64;
    let mut spans: Vec<&Span> = outcome.spans.iter().collect();
    spans.sort_by_key(|span| (span.agent, span.begin));
    let (mut of, mut until) = (u32::MAX, 0.0);
    for span in spans {
        if span.agent != of {
            (of, until) = (span.agent, 0.0);
        }
        let (from, to) = (span.begin.elapsed().as_secs_f64().max(until), span.end.elapsed().as_secs_f64());
        if to <= from {
            continue;
        }
        until = to;
        let first = ((from / bin) as usize).min(BINS - 1);
        let last = ((to / bin) as usize).min(BINS - 1);
        for index in first..=last {
            let (start, stop) = (index as f64 * bin, (index + 1) as f64 * bin);
            busy[group_of(span.agent as usize) * BINS + index] += (to.min(stop) - from.max(start)).max(0.0) / bin;
        }
    }
    let width = PLOT_WIDTH / BINS as f64;
    for (group, agents) in size.iter().enumerate() {
        let y = TOP + GROUP_HEIGHT * group as f64;
        let mut index = 0;
        while index < BINS {
            // Merge adjacent bins of one shade into a rectangle.
            let shade = |index: usize| (8.0 * (busy[group * BINS + index] / f64::from(*agents)).min(1.0)).round();
            let begin = index;
            while index < BINS && shade(index) == shade(begin) {
                index += 1;
            }
            if shade(begin) > 0.0 {
                let light = 94.0 - 7.5 * shade(begin);
                let place = [LEFT + begin as f64 * width, y, (index - begin) as f64 * width, GROUP_HEIGHT];
                let title = format!("{:.0} % busy", 12.5 * shade(begin));
                rect(svg, place, &format!("hsl(215 55% {light:.0}%)"), &title);
            }
        }
    }
    let before = "text-anchor=\"end\"";
    svg.text([LEFT - 6.0, TOP + 10.0], before, "agent-0");
    let bottom = TOP + GROUP_HEIGHT * groups as f64;
    svg.text([LEFT - 6.0, bottom], before, format_args!("agent-{}", agents - 1));
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bottega_farm::simulate::{FarmSpec, Plan, SyntheticSpread, Workpiece, simulate};

    use super::*;

    fn drawing(zones: usize, agents: usize) -> (SimulationOutcome, String) {
        let piece = Arc::new(Workpiece::synthetic(zones, &SyntheticSpread::default(), 1).expect("zones"));
        let outcome = simulate(&piece, &Plan::calm(FarmSpec::equal(agents), 1)).expect("a run");
        let svg = svg(&outcome);
        (outcome, svg)
    }

    #[test]
    fn every_span_of_a_few_agents_is_drawn() {
        let (outcome, svg) = drawing(12, 3);
        assert_eq!(svg.matches("<title>").count(), outcome.spans.len());
        assert!(svg.contains("agent-2") && svg.contains("12 zones, 3 agents") && svg.ends_with("</svg>\n"));
    }

    #[test]
    fn a_drawing_of_many_agents_does_not_grow_with_them() {
        let (_, svg) = drawing(400, 100);
        assert!(svg.matches("<title>").count() <= GROUPS * BINS);
        assert!(svg.contains("agent-99"));
        assert_eq!([nice_step(0.9), nice_step(1.1), nice_step(30.0)], [1.0, 2.0, 50.0]);
    }
}
