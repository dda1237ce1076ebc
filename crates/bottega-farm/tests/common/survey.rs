//! The survey of a fake engine.

use bottega_engines::{Survey, SurveyPixel, Tunables};

pub(crate) fn tunables() -> Tunables {
    Tunables { max_depth: 8, light_samples: 1 }
}

/// A survey with a complex lower right corner.
pub(crate) fn survey(width: u32, height: u32) -> Survey {
    let pixel = |x: u32, y: u32| SurveyPixel {
        steps: 29.0 + 60.0 * (f64::from(x * y) / f64::from(width * height)) as f32,
        recursion_levels: if 2 * x > width && 2 * y > height { 5.0 } else { 0.0 },
        path_length: 2.0,
        ..SurveyPixel::default()
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| pixel(x, y))).collect();
    Survey { width, height, pixels, zones_max: None }
}
