//! An output over two inputs, in false colours.

use bottega_fuzzy::FunctionBlock;
use bottega_image::ColorMap;
use plotters::prelude::*;

use super::{
    super::{
        chart::{Area, DrawResult, FONT_NAME, Figure},
        eval::unusable,
    },
    axes::{TEXT, TITLE, number, padded, tick_step},
};
use bottega::rules::inputs;

use crate::error::CliError;

/// The color where no rule fires and there is no default.
const NO_VALUE: RGBColor = RGBColor(200, 200, 200);

/// An output over two inputs, the others fixed.
pub(super) struct Surface {
    title: String,
    fixed: String,
    axes: [Axis; 2],
    /// [`Surface::STEPS`] squared values, row by row from the bottom.
    values: Vec<Option<f64>>,
    /// The minimum and the maximum value.
    range: (f64, f64),
}

struct Axis {
    name: String,
    range: (f64, f64),
}

impl Surface {
    const SIZE: (u32, u32) = (860, 640);
    /// The number of cells along each axis.
    const STEPS: usize = 160;

    pub(super) fn new(
        block: &FunctionBlock,
        output: &str,
        over: &[String; 2],
        fixed: &[(String, f64)],
    ) -> Result<Self, CliError> {
        let index = block.output_index(output).ok_or_else(|| {
            let outputs: Vec<&str> = block.outputs().iter().map(|output| output.name.as_str()).collect();
            CliError::usage(format!("the rules have no output `{output}`"), format!("choose of {}", outputs.join(", ")))
        })?;
        let axis = |name: &String| {
            let index = block.input_index(name).ok_or_else(|| {
                CliError::usage(format!("the rules have no input `{name}`"), format!("choose of {}", inputs(block)))
            })?;
            let input = &block.inputs()[index];
            Ok::<_, CliError>(Axis { name: input.name.clone(), range: padded(input.interval()) })
        };
        let axes = [axis(&over[0])?, axis(&over[1])?];
        if let Some((name, _)) = fixed.iter().find(|(name, _)| over.iter().any(|axis| axis.eq_ignore_ascii_case(name)))
        {
            return Err(CliError::usage(
                format!("`{name}` cannot be both an axis and fixed"),
                "leave out its value, or draw over another input",
            ));
        }
        let mut named: Vec<(&str, f64)> = fixed.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        let free = named.len();
        named.extend(axes.iter().map(|axis| (axis.name.as_str(), axis.range.0)));
        let mut values = Vec::with_capacity(Self::STEPS * Self::STEPS);
        for row in 0..Self::STEPS {
            for column in 0..Self::STEPS {
                named[free].1 = axes[0].middle(column);
                named[free + 1].1 = axes[1].middle(row);
                let outputs = block.evaluate(&named).map_err(|error| unusable(block, &error))?;
                values.push(outputs.values()[index]);
            }
        }
        let known = || values.iter().flatten().copied();
        let range = (known().fold(f64::INFINITY, f64::min), known().fold(f64::NEG_INFINITY, f64::max));
        let fixed: Vec<String> = fixed.iter().map(|(name, value)| format!("{name} = {value}")).collect();
        let title = block.outputs()[index].name.clone();
        Ok(Self { title, fixed: fixed.join(", "), axes, values, range })
    }

    fn color(&self, value: Option<f64>) -> RGBColor {
        let Some(value) = value else { return NO_VALUE };
        let (low, high) = self.range;
        let share = if high > low { (value - low) / (high - low) } else { 0.5 };
        let [r, g, b] = ColorMap::Viridis.color(share as f32);
        RGBColor(r, g, b)
    }

    /// Returns the cells as rectangles; adjacent cells of one color in a row are merged.
    fn rectangles(&self) -> Vec<Rectangle<(f64, f64)>> {
        let mut rectangles = Vec::new();
        for row in 0..Self::STEPS {
            let colors: Vec<RGBColor> =
                self.values[row * Self::STEPS..][..Self::STEPS].iter().map(|value| self.color(*value)).collect();
            let mut from = 0;
            for run in colors.chunk_by(|a, b| a == b) {
                let [x, y] = &self.axes;
                let corners = [(x.at(from), y.at(row)), (x.at(from + run.len()), y.at(row + 1))];
                rectangles.push(Rectangle::new(corners, run[0].filled()));
                from += run.len();
            }
        }
        rectangles
    }

    /// Draws the color scale.
    fn draw_scale<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult<B> {
        let (low, high) = if self.range.0 <= self.range.1 { padded(self.range) } else { return Ok(()) };
        let mut chart = ChartBuilder::on(area)
            .margin_top(38)
            .margin_bottom(64)
            .margin_right(10)
            .right_y_label_area_size(70)
            .build_cartesian_2d(0.0..1.0, low..high)?
            .set_secondary_coord(0.0..1.0, low..high);
        let steps = Self::STEPS as f64;
        let at = |k: f64| low + (high - low) * k / steps;
        let strip = |k: usize| {
            let k = k as f64;
            let color = self.color(Some(at(k + 0.5).clamp(self.range.0, self.range.1)));
            Rectangle::new([(0.0, at(k)), (1.0, at(k + 1.0))], color.filled())
        };
        chart.draw_series((0..Self::STEPS).map(strip))?;
        let ticks = tick_step(high - low);
        chart
            .configure_secondary_axes()
            .axis_style(BLACK.mix(0.6))
            .label_style((FONT_NAME, TEXT))
            .y_labels(7)
            .y_label_formatter(&|y| number(*y, ticks))
            .draw()
    }
}

impl Axis {
    /// Returns the position of the border before a cell.
    fn at(&self, cell: usize) -> f64 {
        self.range.0 + (self.range.1 - self.range.0) * cell as f64 / Surface::STEPS as f64
    }

    /// Returns the center of a cell.
    fn middle(&self, cell: usize) -> f64 {
        self.range.0 + (self.range.1 - self.range.0) * (cell as f64 + 0.5) / Surface::STEPS as f64
    }
}

impl Figure for Surface {
    fn size(&self) -> (u32, u32) {
        Self::SIZE
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult<B> {
        let (left, right) = area.split_horizontally(Self::SIZE.0 - 120);
        let title = if self.fixed.is_empty() { self.title.clone() } else { format!("{}, {}", self.title, self.fixed) };
        let [x, y] = &self.axes;
        let mut chart = ChartBuilder::on(&left)
            .caption(title, (FONT_NAME, TITLE))
            .margin(12)
            .x_label_area_size(52)
            .y_label_area_size(72)
            .build_cartesian_2d(x.range.0..x.range.1, y.range.0..y.range.1)?;
        chart.draw_series(self.rectangles())?;
        let (x_ticks, y_ticks) = (tick_step(x.range.1 - x.range.0), tick_step(y.range.1 - y.range.0));
        chart
            .configure_mesh()
            .disable_mesh()
            .axis_style(BLACK.mix(0.6))
            .label_style((FONT_NAME, TEXT))
            .axis_desc_style((FONT_NAME, TEXT + 1))
            .x_desc(x.name.as_str())
            .y_desc(y.name.as_str())
            .x_labels(9)
            .y_labels(9)
            .x_label_formatter(&|value| number(*value, x_ticks))
            .y_label_formatter(&|value| number(*value, y_ticks))
            .draw()?;
        self.draw_scale(&right)
    }
}
