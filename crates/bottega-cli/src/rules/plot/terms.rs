//! The membership functions of all variables.

use bottega_fuzzy::{FunctionBlock, Membership};
use plotters::{
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{
    super::chart::{Area, DrawResult, FONT_NAME, Figure},
    axes::{TEXT, TITLE, number, padded, tick_step},
};

/// Colors that most people can distinguish (M. Okabe and K. Ito, 2008), without yellow, which is invisible on white.
const TERM_COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(213, 94, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// The membership functions of all variables, inputs first.
pub(super) struct Terms {
    panels: Vec<Panel>,
}

struct Panel {
    title: String,
    range: (f64, f64),
    /// The name of each term, and its corners from left to right.
    terms: Vec<(String, Vec<(f64, f64)>)>,
}

impl Terms {
    const PANEL: (u32, u32) = (620, 260);
    const COLUMNS: u32 = 2;

    pub(super) fn new(block: &FunctionBlock) -> Self {
        let inputs = block.inputs().iter().map(|input| {
            let declared = input.declared_range();
            let corners = |membership| {
                let corners = corners(membership, declared).into_iter();
                corners.map(|(x, y)| (input.laid_out(x), y)).collect()
            };
            let terms = input.terms.iter().map(|term| (term.name.clone(), corners(&term.membership))).collect();
            Panel { title: format!("{} (input)", input.name), range: input.interval(), terms }
        });
        let outputs = block.outputs().iter().map(|output| {
            let range = output.declared_range();
            let corners = |membership| corners(membership, range);
            let terms = output.terms.iter().map(|term| (term.name.clone(), corners(&term.membership))).collect();
            Panel { title: format!("{} (output)", output.name), range, terms }
        });
        Self { panels: inputs.chain(outputs).collect() }
    }
}

/// Returns a membership function as a polyline over an interval.
fn corners(membership: &Membership, (low, high): (f64, f64)) -> Vec<(f64, f64)> {
    match membership {
        Membership::Singleton(at) => vec![(*at, 0.0), (*at, 1.0)],
        Membership::Linear(points) => {
            let inside = points.iter().copied().filter(|(x, _)| (low..=high).contains(x));
            let ends = |x: f64| (x, membership.degree(x));
            // A step at an end of the interval keeps both of its points.
            let first = points.first().is_none_or(|point| point.0 != low).then(|| ends(low));
            let last = points.last().is_none_or(|point| point.0 != high).then(|| ends(high));
            first.into_iter().chain(inside).chain(last).collect()
        }
    }
}

impl Figure for Terms {
    fn size(&self) -> (u32, u32) {
        let rows = (self.panels.len() as u32).div_ceil(Self::COLUMNS).max(1);
        (Self::PANEL.0 * Self::COLUMNS, Self::PANEL.1 * rows)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult<B> {
        let rows = self.panels.len().div_ceil(Self::COLUMNS as usize).max(1);
        let areas = area.split_evenly((rows, Self::COLUMNS as usize));
        self.panels.iter().zip(&areas).try_for_each(|(panel, area)| panel.draw(area))
    }
}

impl Panel {
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult<B> {
        let (low, high) = padded(self.range);
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, (FONT_NAME, TITLE))
            .margin(10)
            .margin_right(24)
            .x_label_area_size(28)
            .y_label_area_size(44)
            .build_cartesian_2d(low..high, 0.0..1.18)?;
        let ticks = tick_step(high - low);
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .axis_style(BLACK.mix(0.6))
            .label_style((FONT_NAME, TEXT))
            .x_labels(9)
            .y_labels(5)
            .x_label_formatter(&|x| number(*x, ticks))
            .y_label_formatter(&|y| if *y > 1.001 { String::new() } else { number(*y, 0.2) })
            .draw()?;
        for (i, (name, corners)) in self.terms.iter().enumerate() {
            let color = TERM_COLORS[i % TERM_COLORS.len()];
            chart.draw_series(LineSeries::new(raised(corners).iter().copied(), color.stroke_width(2)))?;
            let style = (FONT_NAME, TEXT).into_font().color(&color).pos(Pos::new(HPos::Center, VPos::Bottom));
            let (x, y) = top(corners);
            chart.draw_series([Text::new(name.clone(), (x, y + 0.03), style)])?;
        }
        Ok(())
    }
}

/// Returns the part of a polyline above the axis, where polylines overlap.
fn raised(corners: &[(f64, f64)]) -> &[(f64, f64)] {
    let is_up = |corner: &(f64, f64)| corner.1 > 0.0;
    let first = corners.iter().position(is_up).unwrap_or(corners.len()).saturating_sub(1);
    let last = corners.iter().rposition(is_up).map_or(first, |last| (last + 2).min(corners.len()));
    &corners[first..last]
}

/// Returns the center of the highest part of a polyline.
fn top(corners: &[(f64, f64)]) -> (f64, f64) {
    let y = corners.iter().map(|corner| corner.1).fold(0.0, f64::max);
    let at = || corners.iter().filter(|corner| corner.1 == y).map(|corner| corner.0);
    let (left, right) = (at().fold(f64::INFINITY, f64::min), at().fold(f64::NEG_INFINITY, f64::max));
    (left + 0.5 * (right - left), y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_term_is_drawn_from_end_to_end_with_its_steps() {
        let term = Membership::Linear(vec![(1.0, 0.0), (1.0, 1.0), (3.0, 0.5)]);
        assert_eq!(corners(&term, (0.0, 4.0)), [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (3.0, 0.5), (4.0, 0.5)]);
        assert_eq!(corners(&term, (1.0, 2.0)), [(1.0, 0.0), (1.0, 1.0), (2.0, 0.75)]);
        assert_eq!(corners(&Membership::Singleton(2.0), (0.0, 4.0)), [(2.0, 0.0), (2.0, 1.0)]);
        assert_eq!(raised(&corners(&term, (0.0, 4.0))), &corners(&term, (0.0, 4.0))[1..]);
        assert_eq!(
            raised(&[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, 0.0), (4.0, 0.0)]),
            [(1.0, 0.0), (2.0, 1.0), (3.0, 0.0)]
        );
        assert_eq!(raised(&[(0.0, 0.0), (1.0, 0.0)]), []);
    }
}
