//! A survey of a scene that only its engine can read: a small picture rendered by that engine, and the cost of its regions.

use std::time::{Duration, Instant};

use bottega_image::{Picture, Rect, luminance};

use super::{
    error::EngineFault,
    picture,
    session::{Session, WindowRequest},
};
use crate::{Survey, SurveyPixel};

/// Samples per pixel.
pub(super) const SAMPLES: u32 = 4;
/// Rows and columns of windows that are timed.
const PROBES: u32 = 4;
/// The most time for all of them,
const PROBE_TIME: Duration = Duration::from_millis(1500);
/// and the largest share of the predicted time of the whole picture.
const PROBE_SHARE: f64 = 0.01;
/// The timed window extends from the center by the frame's shorter side divided by this.
const PART: u32 = 12;
/// A window that takes this many seconds is a sufficient measurement.
const PACE_TIME: f64 = 0.5;
/// The least time of a window's samples in seconds: clocks are not more precise.
const LEAST_TIME: f64 = 1e-4;
/// Samples can be distinguished from the overhead of their window if they take this many times as long.
const TELLING_RATIO: f64 = 2.0;
/// The factor by which samples are otherwise increased,
const MORE_SAMPLES: u32 = 16;
/// and their most.
const SAMPLES_PACED: u32 = 1024;
/// The largest share of the time that windows may cost, without their samples.
const WINDOWS_SHARE: f64 = 0.01;
/// The share of the times that must be due to samples, so that they distinguish regions.
const TELLING_SHARE: f64 = 0.3;

/// Surveys the frame that the session has open; `whole` is all of it. Returns the cost of windows, too, if it is known now.
///
/// - `pace`: the cost of windows, if it was measured.
/// - `samples`: samples of the final picture, over all pixels.
pub(super) fn survey(
    session: &mut Session,
    whole: &WindowRequest,
    pace: Option<WindowCost>,
    samples: u64,
) -> Result<(Survey, Option<WindowCost>), EngineFault> {
    let frame = whole.window;
    let reported = session.opened().window_seconds();
    // Render the small picture
    let begun = Instant::now();
    let written = session.paint(whole, &mut |_| {})?;
    let took = begun.elapsed().as_secs_f64() - written.once.max(0.0);
    let picture = picture::read(&written, frame)?.picture;
    // Determine the cost of windows and samples
    let seen = frame.area() * u64::from(whole.samples);
    let pace =
        pace.or(reported.map(|window| WindowCost { window, sample: (took - window).max(LEAST_TIME) / seen as f64 }));
    let time = pace.map_or(PROBE_TIME, |pace| pace.probe_time(samples));
    // If windows are that expensive, timing them takes too long and reveals nothing.
    let probes_fit = pace.is_none_or(|pace| pace.window * f64::from(PROBES * PROBES) < time.as_secs_f64());
    let costs = if probes_fit { probe(session, whole, time)? } else { all_the_same() };
    // Combine both into a survey
    let mut survey = Survey { width: frame.width(), height: frame.height(), ..Survey::default() };
    survey.pixels = frame
        .pixels()
        .map(|(x, y)| {
            let color = picture.pixel(x, y);
            SurveyPixel {
                color,
                // Only the cost is known to differ by region.
                steps: cost_at(&costs, frame, x, y),
                noise: contrast(&picture, x, y),
                path_length: 1.0,
                ..SurveyPixel::default()
            }
        })
        .collect();
    Ok((survey, pace))
}

fn all_the_same() -> Vec<f64> {
    vec![1.0; (PROBES * PROBES) as usize]
}

/// Returns the cost of a pixel in each of a grid of windows, row by row; all equal if it cannot be measured.
fn probe(session: &mut Session, whole: &WindowRequest, time: Duration) -> Result<Vec<f64>, EngineFault> {
    let frame = whole.window;
    if frame.width() < 2 * PROBES || frame.height() < 2 * PROBES {
        return Ok(all_the_same());
    }
    let until = Instant::now() + time;
    let mut timed = |window: Rect| {
        let begun = Instant::now();
        let written = session.paint(&WindowRequest { window, ..whole.clone() }, &mut |_| {})?;
        picture::read(&written, window).map(|_| begun.elapsed().as_secs_f64())
    };
    // The first small window may include compilation.
    timed(Rect::of_size(1, 1))?;
    let idle = timed(Rect::of_size(1, 1))?;
    // Time a grid of windows
    let mut times = Vec::new();
    for row in 0..PROBES {
        for column in 0..PROBES {
            if Instant::now() > until {
                return Ok(all_the_same());
            }
            let window = cell(frame, column, row);
            let beyond = (timed(window)? - idle).max(0.0);
            times.push((beyond, beyond / window.area() as f64));
        }
    }
    // Use the times only if they distinguish regions
    let beyond: f64 = times.iter().map(|(beyond, _)| beyond).sum();
    let all = beyond + idle * times.len() as f64;
    Ok(if beyond < TELLING_SHARE * all { all_the_same() } else { times.into_iter().map(|(_, each)| each).collect() })
}

/// The cost of windows and of their samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WindowCost {
    /// Seconds per window, without its samples.
    pub(super) window: f64,
    /// Seconds per sample of a pixel.
    pub(super) sample: f64,
}

impl WindowCost {
    /// Measures windows of the frame that the session has open.
    pub(super) fn measure(session: &mut Session, whole: &WindowRequest) -> Result<Self, EngineFault> {
        let (frame, reported) = (whole.window, session.opened().window_seconds());
        let dot = Rect::new(frame.x1 / 2, frame.y1 / 2, frame.x1 / 2 + 1, frame.y1 / 2 + 1);
        let mut timed = |window: Rect, samples: u32| {
            let begun = Instant::now();
            let request = WindowRequest { window, samples, ..whole.clone() };
            let written = session.paint(&request, &mut |_| {})?;
            picture::read(&written, window).map(|_| begun.elapsed().as_secs_f64())
        };
        let window = match reported {
            Some(window) => window,
            None => {
                // The first window may include compilation, and other programs only add time: use the minimum.
                let first = timed(dot, whole.samples)?;
                timed(dot, whole.samples)?.min(first)
            }
        };
        let part = dot.grown(frame.width().min(frame.height()) / PART, &frame);
        let mut samples = whole.samples;
        loop {
            let took = timed(part, samples)?;
            if took - window > TELLING_RATIO * window || took > window + PACE_TIME || samples >= SAMPLES_PACED {
                let sample = (took - window).max(LEAST_TIME) / (part.area() as f64 * f64::from(samples));
                return Ok(Self { window, sample });
            }
            samples = samples.saturating_mul(MORE_SAMPLES).min(SAMPLES_PACED);
        }
    }

    /// Returns how long the regions of a picture with this many samples may be timed.
    fn probe_time(self, samples: u64) -> Duration {
        let all = self.sample * samples as f64;
        Duration::try_from_secs_f64(all * PROBE_SHARE).unwrap_or(PROBE_TIME).min(PROBE_TIME)
    }

    /// Returns the number of zones for which the cost of windows stays small compared to that of the samples.
    ///
    /// - `windows`: windows per zone.
    pub(super) fn zones_max(self, samples: u64, windows: f64) -> u32 {
        let all = self.sample * samples as f64;
        (all * WINDOWS_SHARE / (windows * self.window).max(1e-6)).clamp(1.0, f64::from(1 << 20)) as u32
    }
}

fn cell(frame: Rect, column: u32, row: u32) -> Rect {
    let edge = |side: u32, i: u32| side * i / PROBES;
    let (width, height) = (frame.width(), frame.height());
    Rect::new(edge(width, column), edge(height, row), edge(width, column + 1), edge(height, row + 1))
}

fn cost_at(costs: &[f64], frame: Rect, x: u32, y: u32) -> f32 {
    let index = |at: u32, side: u32| (0..PROBES).rev().find(|i| side * i / PROBES <= at).unwrap_or(0);
    let place = index(y, frame.height()) * PROBES + index(x, frame.width());
    let mean = costs.iter().sum::<f64>() / costs.len() as f64;
    if mean > 0.0 { (costs[place as usize] / mean) as f32 } else { 1.0 }
}

/// Returns the mean difference in luminance between a pixel and its neighborhood.
fn contrast(picture: &Picture, x: u32, y: u32) -> f32 {
    let own = luminance(picture.pixel(x, y));
    let around = Rect::new(x, y, x + 1, y + 1).grown(1, &Rect::of_size(picture.width, picture.height));
    let difference = |(x, y)| (luminance(picture.pixel(x, y)) - own).abs();
    around.pixels().map(difference).sum::<f32>() / around.area() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dear_windows_make_few_zones() {
        let pace = WindowCost { window: 0.1, sample: 1e-6 };
        // For 62.5 s of samples, 0.625 s of windows are allowed.
        assert_eq!(pace.zones_max(62_500_000, 2.0), 3);
        assert_eq!(pace.zones_max(62_500_000, 1.0), 6);
        assert_eq!(pace.zones_max(1, 1.0), 1);
        assert_eq!(WindowCost { window: 0.0, sample: 1.0 }.zones_max(u64::MAX, 2.0), 1 << 20);
    }

    #[test]
    fn looking_takes_a_hundredth_of_painting() {
        let pace = WindowCost { window: 0.1, sample: 1e-6 };
        assert_eq!(pace.probe_time(30_000_000), Duration::from_millis(300));
        assert_eq!(pace.probe_time(u64::MAX), PROBE_TIME);
    }

    #[test]
    fn costs_are_where_they_were_measured() {
        let frame = Rect::of_size(16, 8);
        let costs: Vec<f64> = (0..16).map(f64::from).collect();
        assert_eq!(cost_at(&costs, frame, 0, 0), 0.0);
        assert_eq!(cost_at(&costs, frame, 15, 7), 2.0);
        assert_eq!(cost_at(&costs, frame, 4, 2), 5.0 / 7.5);
    }
}
