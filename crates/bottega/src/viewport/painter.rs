//! The rendering thread of a viewport, which refines the wanted view.

use std::{
    ops::{ControlFlow, Range},
    sync::{
        Arc,
        mpsc::{self, RecvTimeoutError},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bottega_denoise::GuideUse;
use bottega_engines::{BuiltinEngine, CancelSwitch, EnginePreference, RenderEngine, TaskProgress, ZoneTask};
use bottega_farm::JobSettings;
use bottega_image::{Film, Picture, Rect, Tile};

use super::{
    screen::ViewportScreen,
    shown::{ShownView, ViewportShared, ViewportWish},
};
use crate::{devices::threads, error::Error, session::Session, settings::tone};

/// Target time for the first frame of a look.
const FIRST_TIME: Duration = Duration::from_millis(25);
/// Paths per second, assumed before any measurement.
const PACE_GUESSED: f64 = 60_000.0;
/// Paths per pixel of the first frame; finer coarse frames have one.
const FIRST_SAMPLES: u32 = 2;
/// Smallest number of pixels of the first frame.
const FIRST_PIXELS: f64 = 192.0;
/// Ratio of pixel counts between successive coarse frames.
const FINER: f64 = 4.0;
/// Number of picture pixels per pixel of the finest coarse frame.
const FINEST: f64 = 9.0;
/// Samples per pixel from which frames are denoised.
const DENOISED_FROM: u32 = 4;
/// Interval of checks for a new look during denoising.
const LOOK_EVERY: Duration = Duration::from_millis(2);

/// The renderer of a viewport.
pub(super) struct ViewportPainter {
    shared: Arc<ViewportShared>,
    /// Recent speed in paths per second.
    pace: f64,
    noise: NoiseRemover,
}

impl ViewportPainter {
    pub(super) fn new(shared: Arc<ViewportShared>) -> Self {
        Self { shared, pace: PACE_GUESSED, noise: NoiseRemover::default() }
    }

    /// Renders the wanted looks until the viewport is closed.
    pub(super) fn paint(mut self, session: Session) {
        let (mut session, mut look) = (session, 0);
        loop {
            self.shared.begin_look(&session, look);
            let painted = self.paint_look(&session, look);
            let Some((wish, next)) = self.shared.next_look(look) else { return };
            let changed = painted.and_then(|()| match wish {
                ViewportWish::View(view) => session.look(&view),
                ViewportWish::Scene(request, scene) => session.edited(&request, *scene),
            });
            match changed {
                Ok(other) => (session, look) = (other, next),
                Err(error) => return self.shared.fail(&error),
            }
        }
    }

    /// Renders a look until another one is wanted or it has all samples.
    fn paint_look(&mut self, session: &Session, look: u64) -> Result<(), Error> {
        let Some(engine) = session.own_engine() else { return Ok(()) };
        let settings = session.settings();
        let frame = Rect::of_size(settings.width, settings.height);
        // Render coarse frames first
        let Some(coarse) = self.paint_coarse(session, engine, look)? else { return Ok(()) };
        let screen = self.fresh(session, settings.crop, true);
        screen.show_coarse(&coarse, frame, frame);
        self.shared.show_merged(&screen, look, settings.crop);
        self.shared.show(ShownView { screen: Arc::clone(&screen), look, samples: 0, is_denoised: false });
        let (painted, shared) = (Arc::clone(&screen), Arc::clone(&self.shared));
        session.watch(move |tile| {
            shared.show_own(&painted, look, tile);
            shared.touch(&painted);
        });
        let (mut tile, mut done, mut shown) = (None, 0, 0);
        // Double the samples with each pass, and denoise the result
        loop {
            let wanted = settings.samples.saturating_sub(self.shared.samples_of_others());
            if done >= wanted {
                break;
            }
            let until = (2 * done).max(1).min(wanted);
            let Some(cancel) = self.shared.begin(look, engine) else { return Ok(()) };
            tile = match pass(engine, settings, (done..until, tile), cancel.clone())? {
                Some(painted) => Some(painted),
                None => return Ok(()),
            };
            done = until;
            shown = self.show_pass(session, look, (done, tile.as_ref()), &cancel);
        }
        // Show samples of others that have arrived since the last pass
        if shown < done + self.shared.samples_of_others() {
            let Some(cancel) = self.shared.begin(look, engine) else { return Ok(()) };
            self.show_pass(session, look, (done, tile.as_ref()), &cancel);
        }
        self.shared.rest(look);
        Ok(())
    }

    /// Shows a complete pass with the samples of other processes, denoised if possible. Returns the samples per pixel.
    fn show_pass(
        &mut self,
        session: &Session,
        look: u64,
        (done, tile): (u32, Option<&Tile>),
        cancel: &CancelSwitch,
    ) -> u32 {
        let crop = session.settings().crop;
        let samples = done + self.shared.samples_of_others();
        let merged = tile.filter(|_| samples >= DENOISED_FROM).map(|tile| self.shared.with_others(look, tile));
        let film = merged.as_deref().map(film_of);
        match film.and_then(|film| self.noise.remove(session, film, cancel)) {
            None => self.shared.note_samples(look, samples),
            Some(clean) => {
                let screen = self.fresh(session, crop, true);
                // Alpha is that of the samples; the denoiser changes colors alone.
                merged.iter().for_each(|tile| screen.show(tile));
                screen.show_denoised(&clean, crop);
                self.shared.show(ShownView { screen, look, samples, is_denoised: true });
            }
        }
        samples
    }

    /// Renders coarse frames of a look, first one that takes a moment, then finer ones. Returns the finest; `None`: another
    /// look is wanted.
    fn paint_coarse(
        &mut self,
        session: &Session,
        engine: &Arc<BuiltinEngine>,
        look: u64,
    ) -> Result<Option<Picture>, Error> {
        let size = (session.settings().width, session.settings().height);
        let frame = Rect::of_size(size.0, size.1);
        let pixels = f64::from(size.0) * f64::from(size.1);
        let in_time = self.pace * FIRST_TIME.as_secs_f64() / f64::from(FIRST_SAMPLES);
        let (mut cells, mut samples) = (in_time.max(FIRST_PIXELS), FIRST_SAMPLES);
        // The first frame is always completed, so that a camera in constant motion shows something of each look.
        let mut cancel = self.shared.closing.clone();
        loop {
            let size = similar_size(size, cells.min(pixels / FINEST));
            let begun = Instant::now();
            let Some(coarse) = engine.glimpse(size, samples, &cancel)? else { return Ok(None) };
            let paths = f64::from(size.0) * f64::from(size.1) * f64::from(samples);
            self.pace = 0.5 * (self.pace + paths / begun.elapsed().as_secs_f64().max(1e-6));
            let shape = Rect::of_size(size.0, size.1);
            let screen = self.fresh(session, shape, false);
            screen.show_coarse(&coarse, shape, frame);
            self.shared.show(ShownView { screen, look, samples: 0, is_denoised: false });
            let Some(next) = self.shared.begin(look, engine) else { return Ok(None) };
            if cells * FINER > pixels / FINEST {
                return Ok(Some(coarse));
            }
            (cells, samples, cancel) = (cells * FINER, 1, next);
        }
    }
}

impl ViewportPainter {
    /// Makes a black screen with the exposure and tone curve of the request.
    ///
    /// - `shape`: the pixels of displayed frames.
    /// - `shows_pixels`: true if these are pixels of the picture.
    fn fresh(&self, session: &Session, shape: Rect, shows_pixels: bool) -> Arc<ViewportScreen> {
        let output = &session.request().output;
        let linear = self.shared.is_linear.then_some(session.settings().crop);
        Arc::new(ViewportScreen::new(shape, (output.exposure, tone(output.tonemap)), linear, shows_pixels))
    }
}

/// A denoiser on a thread of its own: the library can stop only between two of its steps, and a new look must not wait for
/// that.
#[derive(Default)]
struct NoiseRemover {
    under_way: Option<JoinHandle<()>>,
}

impl NoiseRemover {
    /// Denoises a film; `None`: there is no denoiser, it failed, or another look is wanted.
    fn remove(&mut self, session: &Session, film: Film, cancel: &CancelSwitch) -> Option<Picture> {
        let denoiser = session.denoiser()?.clone();
        self.wait();
        let (threads, ended) = (threads(session.request()), cancel.clone());
        let (sender, removed) = mpsc::channel();
        let remove = move || {
            let mut go_on = |_| if ended.is_cancelled() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
            let denoised = denoiser.denoise(&film, GuideUse::AsPainted, threads, &mut go_on);
            // The receiver is gone if another look is wanted.
            _ = sender.send(denoised.ok().map(|denoised| denoised.film.to_picture()));
        };
        self.under_way = thread::Builder::new().name("viewport-noise".to_owned()).spawn(remove).ok();
        while !cancel.is_cancelled() {
            match removed.recv_timeout(LOOK_EVERY) {
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
                Ok(picture) => return picture,
            }
        }
        None
    }

    /// Waits for the denoising that is running, if any.
    fn wait(&mut self) {
        if let Some(thread) = self.under_way.take() {
            // The thread has reported its panic itself; the picture stays noisy.
            _ = thread.join();
        }
    }
}

impl Drop for NoiseRemover {
    fn drop(&mut self) {
        self.wait();
    }
}

/// Returns a size of about `pixels` pixels, with an aspect ratio as near as possible to that of the given size.
fn similar_size((width, height): (u32, u32), pixels: f64) -> (u32, u32) {
    let ratio = f64::from(width) / f64::from(height);
    let rows_max = (pixels / ratio).sqrt().max(1.0) as u32;
    let columns = |rows: u32| (f64::from(rows) * ratio).round().max(1.0);
    let error = |rows: u32| (columns(rows) / f64::from(rows) / ratio - 1.0).abs();
    // Among equally near sizes take the largest
    let rows = (3 * rows_max / 4).max(1)..=rows_max;
    let rows = rows.rev().min_by(|&a, &b| error(a).total_cmp(&error(b))).unwrap_or(1);
    (columns(rows) as u32, rows)
}

/// Adds samples to all pixels. Returns their sums; `None`: cancelled.
///
/// - `(samples, tile)`: the range of sample indices, and the sums so far.
///
/// # Errors
/// The engine fails.
pub(super) fn pass(
    engine: &BuiltinEngine,
    settings: &JobSettings,
    (samples, tile): (Range<u32>, Option<Tile>),
    cancel: CancelSwitch,
) -> Result<Option<Tile>, Error> {
    let task = ZoneTask {
        rect: settings.crop,
        samples,
        tunables: settings.tunables,
        preference: EnginePreference::default(),
        tile,
        parts: None,
        cancel,
        progress: TaskProgress::default(),
    };
    let (sender, painted) = mpsc::channel();
    engine.start(task, Box::new(move |painted| _ = sender.send(painted)));
    let gone = |_| Error::failed("the engine does not answer", "open the viewport again");
    let painted = painted.recv().map_err(gone)??;
    Ok(painted.complete.then_some(painted.tile))
}

fn film_of(tile: &Tile) -> Film {
    let mut film = Film::new(tile.rect(), tile.layout().clone());
    film.add_tile(tile, |_, _| 1.0);
    film
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coarse_picture_has_the_shape_of_the_fine_one() {
        for (size, pixels, expected) in [
            ((720, 480), 1350.0, (45, 30)),
            ((320, 240), 1000.0, (36, 27)),
            ((1280, 720), 600.0, (32, 18)),
            ((48, 32), 170.0, (15, 10)),
            ((10_000, 1), 192.0, (10_000, 1)),
            ((1, 1), 1.0, (1, 1)),
        ] {
            assert_eq!(similar_size(size, pixels), expected, "{size:?}");
        }
    }
}
