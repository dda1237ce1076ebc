//! Plots of both tables with the paper's curves: speedup over one agent, and over no optimization.

use bottega_image::Svg;

use super::{
    paper::{self, AGENTS},
    report::MagarroReport,
    tables::times,
};

const SIDE: f64 = 320.0;
const MARGIN: f64 = 52.0;

/// A curve over the number of agents, or over the level of optimization.
struct Curve {
    name: String,
    color: &'static str,
    dashed: bool,
    values: Vec<f64>,
}

pub(super) fn svg(report: &MagarroReport) -> String {
    let (width, height) = (2.0 * SIDE + 3.5 * MARGIN, SIDE + 3.4 * MARGIN);
    let mut svg = Svg::new(width, height, 12);
    let agents = AGENTS.map(|agents| agents.to_string());
    chart(&mut svg, MARGIN, "times faster than 1 agent (replayed), by agents", &agents, &by_agents(report), 8.0);
    let levels = ["off", "vs", "s", "n", "b", "vb"].map(str::to_owned);
    let curves = by_optimization(report);
    let most = curves.iter().flat_map(|curve| curve.values.iter().copied()).fold(2.0, f64::max).ceil();
    chart(&mut svg, 2.0 * MARGIN + SIDE + 20.0, "times faster than off, 1 agent (measured)", &levels, &curves, most);
    svg.finish()
}

fn by_agents(report: &MagarroReport) -> Vec<Curve> {
    let colors = ["#c60", "#080", "#04c"];
    let speedups = |times: &[f64; 4]| times.iter().map(|time| times[0] / time).collect();
    let mut curves = vec![Curve {
        name: "as many as agents".to_owned(),
        color: "#999",
        dashed: false,
        values: AGENTS.map(|n| n as f64).to_vec(),
    }];
    for ((row, paper), color) in report.levels.iter().zip(&paper::TABLE_1).zip(colors) {
        let level = row.level as u8;
        curves.push(Curve { name: format!("level {level}"), color, dashed: false, values: speedups(&row.replayed) });
        curves.push(Curve { name: format!("level {level}, the paper"), color, dashed: true, values: speedups(paper) });
    }
    curves
}

fn by_optimization(report: &MagarroReport) -> Vec<Curve> {
    let ours = report.optimizations.iter().map(|row| report.off.measured / times(row)[0]);
    let papers = paper::TABLE_2.iter().map(|row| paper::UNOPTIMIZED / row[0]);
    vec![
        Curve {
            name: "level 3".to_owned(),
            color: "#04c",
            dashed: false,
            values: std::iter::once(1.0).chain(ours).collect(),
        },
        Curve {
            name: "level 3, the paper".to_owned(),
            color: "#04c",
            dashed: true,
            values: std::iter::once(1.0).chain(papers).collect(),
        },
    ]
}

fn chart(svg: &mut Svg, left: f64, title: &str, ticks: &[String], curves: &[Curve], most: f64) {
    let (top, bottom) = (MARGIN, MARGIN + SIDE);
    let x = |index: usize| left + SIDE * index as f64 / (ticks.len() - 1).max(1) as f64;
    let y = |value: f64| bottom - SIDE * value / most;
    svg.text([left, top - 16.0], "", title);
    for value in 0..=most as u32 {
        let at = y(f64::from(value));
        svg.put(format_args!("<path d=\"M{left} {at:.1}H{:.1}\" stroke=\"#ddd\"/>", left + SIDE));
        svg.text([left - 6.0, at + 4.0], "text-anchor=\"end\"", value);
    }
    for (index, tick) in ticks.iter().enumerate() {
        svg.text([x(index), bottom + 16.0], "text-anchor=\"middle\"", tick);
    }
    for (number, curve) in curves.iter().enumerate() {
        let points: Vec<String> =
            curve.values.iter().enumerate().map(|(index, value)| format!("{:.1},{:.1}", x(index), y(*value))).collect();
        let dash = if curve.dashed { " stroke-dasharray=\"5 4\"" } else { "" };
        let style = format!("fill=\"none\" stroke=\"{}\" stroke-width=\"2\"{dash}", curve.color);
        svg.put(format_args!("<polyline points=\"{}\" {style}/>", points.join(" ")));
        let (column, row) = (number % 2, number / 2);
        let (kx, ky) = (left + 165.0 * column as f64, bottom + 36.0 + 18.0 * row as f64);
        svg.put(format_args!("<path d=\"M{kx:.1} {ky:.1}h24\" {style}/>"));
        svg.text([kx + 30.0, ky + 4.0], "", &curve.name);
    }
}
