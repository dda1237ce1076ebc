//! The images of an analysis.

use std::path::Path;

use bottega::analysis::AnalyzedScene;
use bottega_farm::{Analysis, Channel};
use bottega_image::{Canvas, ColorMap, Picture, Rect, ToneMap};

use crate::error::CliError;

/// The minimum length of the images' longer side, in pixels; smaller maps are enlarged to it.
const SHOWN_SIDE: u32 = 1024;
/// The color of the outlines of zones.
const OUTLINE: [u8; 3] = [255, 64, 32];
/// The share of the cells that may be clipped to white, so that a few extremes do not darken the rest.
const CLIPPED: f64 = 0.005;

/// Draws all images of the importance map and of the zones.
///
/// - `levels`: the analyses of the levels from 1 up.
/// - `chosen`: the analysis whose zone costs are shown.
pub(super) fn all(
    drawn: &mut PictureFolder<'_>,
    subject: &AnalyzedScene,
    levels: &[Analysis],
    chosen: &Analysis,
) -> Result<(), CliError> {
    let (columns, rows) = (subject.survey.width, subject.survey.height);
    let gray = |values: &[f32]| enlarged(&Canvas::gray_map(columns, rows, values));
    drawn.put("cost", &gray(&chosen.map.grey()), "the importance map: dark is simple, white is complex")?;
    let importance = chosen.map.importance();
    drawn.put("importance", &gray(importance), "how much an error would be seen, from 0 (black) to 1 (white)")?;
    for channel in Channel::ALL {
        let values = channel.values(&subject.survey);
        let white = white(&values);
        let scaled: Vec<f32> = values.iter().map(|value| value / white).collect();
        let meaning = format!("{}; white: {white:.3}", channel.meaning());
        drawn.put(&format!("channel-{channel}"), &gray(&scaled), &meaning)?;
    }

    let color = |x: u32, y: u32| subject.survey.pixels[(y * columns + x) as usize].color;
    let seen = enlarged(&Canvas::of_picture(&Picture::from_fn(columns, rows, color), 0.0, ToneMap::Agx));
    let size = (seen.width, seen.height);
    for (analysis, level) in levels.iter().zip(1..) {
        let mut zones = seen.clone();
        for row in &analysis.rows {
            zones.draw_rect(scaled(row.rect, subject.frame(), size), OUTLINE);
        }
        let meaning = format!("the {} zones of level {level} over what the survey saw", analysis.rows.len());
        drawn.put(&format!("zones-{level}"), &zones, &meaning)?;
    }
    drawn.put("zone-cost", &zone_costs(chosen, subject.frame(), size), "expected time of each zone, dark to bright")
}

/// The images written to a folder.
pub(super) struct PictureFolder<'a> {
    pub(super) folder: &'a Path,
    /// The name and the description of each file.
    pub(super) files: Vec<(String, String)>,
}

impl PictureFolder<'_> {
    pub(super) fn put(&mut self, name: &str, canvas: &Canvas, meaning: &str) -> Result<(), CliError> {
        let name = format!("{name}.png");
        canvas.write_png(self.folder.join(&name))?;
        self.files.push((name, meaning.to_owned()));
        Ok(())
    }
}

fn enlarged(canvas: &Canvas) -> Canvas {
    let side = canvas.width.max(canvas.height);
    canvas.enlarged((SHOWN_SIDE / side).max(1))
}

/// Returns the value shown as white, greater than 0.
fn white(values: &[f32]) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let place = ((sorted.len() as f64 * (1.0 - CLIPPED)) as usize).min(sorted.len().saturating_sub(1));
    let most = sorted.last().copied().unwrap_or(0.0);
    // If nearly all values are 0, scale by the largest.
    match sorted.get(place).copied().unwrap_or(0.0) {
        white if white > 0.0 => white,
        _ if most > 0.0 => most,
        _ => 1.0,
    }
}

fn zone_costs(analysis: &Analysis, frame: Rect, (width, height): (u32, u32)) -> Canvas {
    let mut canvas = Canvas::new(width, height, [0; 3]);
    let largest = analysis.rows.iter().map(|row| row.complexity).fold(f64::MIN_POSITIVE, f64::max);
    for row in &analysis.rows {
        let rect = scaled(row.rect, frame, (width, height));
        canvas.fill_rect(rect, ColorMap::Viridis.color((row.complexity / largest) as f32));
        canvas.draw_rect(rect, [0; 3]);
    }
    canvas
}

/// Scales a rectangle of the frame to a canvas of another size.
fn scaled(rect: Rect, frame: Rect, (width, height): (u32, u32)) -> Rect {
    let x = |x: u32| (u64::from(x) * u64::from(width) / u64::from(frame.width())) as u32;
    let y = |y: u32| (u64::from(y) * u64::from(height) / u64::from(frame.height())) as u32;
    Rect::new(x(rect.x0), y(rect.y0), x(rect.x1), y(rect.y1))
}
