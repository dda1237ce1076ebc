//! A scene looked around in: painted over and over, finer and finer, from wherever one wants to see it.
//!
//! One thread paints. A new look ends the life time of all units of the one before; the first thing to be seen of it is as coarse
//! as it must be to be painted in a moment, and each pass over the whole picture takes as many samples as all before. What else this
//! process paints waits meanwhile.

mod cameras;
mod painter;
mod shown;

use std::{
    sync::Arc,
    thread::{self, JoinHandle},
    time::Duration,
};

use bottega_denoise::Denoiser;
use bottega_farm::JobSettings;

pub use self::{cameras::ViewportCamera, shown::ViewportFrame};
use self::{cameras::cameras, painter::ViewportPainter, shown::ViewportShared};
use crate::{
    error::Error,
    loaded_scene::check_view,
    request::{GuideChoice, GuideOptions, IntegratorChoice, Request, ViewOptions},
    session::{Session, SessionOptions, Urgency},
};

/// Pixels of a viewport at most; a larger picture is shown smaller.
pub const VIEWPORT_PIXELS_MAX: u64 = 1 << 20;
/// The same where nobody says a size: soon painted.
const PIXELS: u64 = 1 << 18;
/// Samples of a pixel after which nothing more is painted, where nobody says.
const SAMPLES: u32 = 64;
/// The most samples of a pixel.
const SAMPLES_MAX: u32 = 1024;

/// A scene looked around in. It ends when it is dropped.
pub struct Viewport {
    shared: Arc<ViewportShared>,
    request: Request,
    cameras: Vec<ViewportCamera>,
    settings: JobSettings,
    denoises: bool,
    painter: Option<JoinHandle<()>>,
}

/// A request as a viewport paints it: without anything that delays the first pixels, of a size that is soon painted, without noise
/// where a denoiser is there.
fn as_viewed(request: &Request, has_denoiser: bool) -> Request {
    let mut request = request.clone();
    (request.frames, request.output.file) = (None, None);
    (request.goal.error, request.goal.time) = (None, None);
    request.goal.samples = Some(request.goal.samples.unwrap_or(SAMPLES).clamp(1, SAMPLES_MAX));
    request.guide = GuideOptions { by: Some(GuideChoice::None), ..GuideOptions::default() };
    request.integrator.method = Some(IntegratorChoice::Path);
    (request.film.crop, request.film.layers, request.film.denoise) = (None, None, has_denoiser);
    if let Some([width, height]) = request.film.size {
        request.film.size = Some(fitted((width, height), VIEWPORT_PIXELS_MAX));
    }
    request
}

/// A size of the same shape that is not too large.
fn fitted((width, height): (u32, u32), pixels_max: u64) -> [u32; 2] {
    let scale = (pixels_max as f64 / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
    [width, height].map(|side| ((f64::from(side) * scale) as u32).max(1))
}

impl Viewport {
    /// Reads the scene of a request, and begins to paint it.
    ///
    /// # Errors
    /// The request or its scene cannot be used, or another engine is asked for.
    pub fn open(request: &Request) -> Result<Self, Error> {
        if !request.engine.is_builtin() {
            return Err(Error::usage("only our own engine shows a scene from elsewhere", "leave out the engine"));
        }
        let mut request = as_viewed(request, Denoiser::load().is_ok());
        let options = SessionOptions { urgency: Urgency::Look, ..SessionOptions::default() };
        let mut session = Session::open_with(&request, options)?;
        if request.film.size.is_none() {
            let JobSettings { width, height, .. } = *session.settings();
            request.film.size = Some(fitted((width, height), PIXELS));
            session = session.seen(&request)?;
        }
        let settings = session.settings().clone();
        let cameras = session.subject().map(cameras).unwrap_or_default();
        let denoises = session.denoiser().is_some();
        let shared = Arc::new(ViewportShared::new(request.view.clone()));
        let paints = ViewportPainter::new(Arc::clone(&shared));
        let painter = thread::Builder::new().name("viewport".to_owned()).spawn(move || paints.paint(session));
        let painter = painter.map_err(|error| Error::failed(format!("cannot start a thread: {error}"), "try again"))?;
        Ok(Self { shared, request, cameras, settings, denoises, painter: Some(painter) })
    }

    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        (self.settings.width, self.settings.height)
    }

    /// Samples of a pixel after which nothing more is painted.
    pub fn samples(&self) -> u32 {
        self.settings.samples
    }

    /// The cameras of the scene, by number.
    pub fn cameras(&self) -> &[ViewportCamera] {
        &self.cameras
    }

    /// Whether noise is removed.
    pub fn denoises(&self) -> bool {
        self.denoises
    }

    /// From now on shows the scene so. Returns the number of the look.
    ///
    /// # Errors
    /// The scene cannot be seen so; what was shown before is.
    pub fn look(&self, view: &ViewOptions) -> Result<u64, Error> {
        Request { view: view.clone(), ..self.request.clone() }.validate()?;
        check_view(view, self.cameras.iter().map(|camera| (&*camera.name, camera.pose.fov.is_some())))?;
        Ok(self.shared.look(view))
    }

    /// Has `watcher` told whenever there may be a new frame, by whoever paints: it must return soon. There is one watcher: a
    /// second call does nothing.
    pub fn watch(&self, watcher: impl Fn() + Send + Sync + 'static) {
        self.shared.watch(watcher);
    }

    /// In how long [`Self::frame`] gives a frame newer than `after`: zero, now. `None`: nothing newer is painted yet.
    pub fn due(&self, after: u64) -> Option<Duration> {
        self.shared.due(after)
    }

    /// What is to be seen, if it is newer than the frame `after`; each look has its first one at once.
    ///
    /// # Errors
    /// The scene could not be seen as it was asked for.
    pub fn frame(&self, after: u64) -> Result<Option<ViewportFrame>, Error> {
        self.shared.frame(after)
    }
}

impl Drop for Viewport {
    fn drop(&mut self) {
        self.shared.close();
        if let Some(painter) = self.painter.take() {
            // A panic in there was already reported by the thread itself; there is nothing left to lose.
            let _ = painter.join();
        }
    }
}
