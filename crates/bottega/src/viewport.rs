//! An interactive view of a scene: rendered progressively from a camera that can be moved.
//!
//! One thread renders. A new look expires all work units of the previous one. Its first frame is coarse enough to render in a
//! moment; each later pass over the whole picture takes as many samples as all before. Other pictures of this process wait in
//! the meantime.

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

/// Largest number of pixels of a viewport; a larger picture is scaled down.
pub const VIEWPORT_PIXELS_MAX: u64 = 1 << 20;
/// Largest number of pixels if the request gives no size.
const PIXELS: u64 = 1 << 18;
/// Samples per pixel after which rendering stops, if the request gives none.
const SAMPLES: u32 = 64;
/// Largest number of samples per pixel.
const SAMPLES_MAX: u32 = 1024;

/// An interactive view of a scene. Dropping it ends rendering.
pub struct Viewport {
    shared: Arc<ViewportShared>,
    request: Request,
    cameras: Vec<ViewportCamera>,
    settings: JobSettings,
    denoises: bool,
    painter: Option<JoinHandle<()>>,
}

/// Returns the request as a viewport renders it: without features that delay the first pixels, of limited size, and denoised if
/// a denoiser is installed.
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

/// Scales a size down to at most `pixels_max` pixels, keeping its aspect ratio.
fn fitted((width, height): (u32, u32), pixels_max: u64) -> [u32; 2] {
    let scale = (pixels_max as f64 / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
    [width, height].map(|side| ((f64::from(side) * scale) as u32).max(1))
}

impl Viewport {
    /// Loads the scene of a request, and starts rendering.
    ///
    /// # Errors
    /// The request or its scene cannot be used, or the request names an external engine.
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

    /// Returns width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.settings.width, self.settings.height)
    }

    /// Returns the samples per pixel after which rendering stops.
    pub fn samples(&self) -> u32 {
        self.settings.samples
    }

    /// Returns the cameras of the scene, in the order of the file.
    pub fn cameras(&self) -> &[ViewportCamera] {
        &self.cameras
    }

    /// Returns true if frames are denoised.
    pub fn denoises(&self) -> bool {
        self.denoises
    }

    /// Changes the view. Returns the number of the new look.
    ///
    /// # Errors
    /// The view is invalid; the previous one stays.
    pub fn look(&self, view: &ViewOptions) -> Result<u64, Error> {
        Request { view: view.clone(), ..self.request.clone() }.validate()?;
        check_view(view, self.cameras.iter().map(|camera| (&*camera.name, camera.pose.fov.is_some())))?;
        Ok(self.shared.look(view))
    }

    /// Registers a function that is called when there may be a new frame. It is called from rendering threads and must return
    /// quickly. Only the first call of `watch` has an effect.
    pub fn watch(&self, watcher: impl Fn() + Send + Sync + 'static) {
        self.shared.watch(watcher);
    }

    /// Returns the time until [`Self::frame`] gives a frame newer than `after`; zero: now. `None`: there is none yet.
    pub fn due(&self, after: u64) -> Option<Duration> {
        self.shared.due(after)
    }

    /// Returns the current frame if it is newer than the frame `after` and due; the first frame of each look is due at once.
    ///
    /// # Errors
    /// The requested view failed.
    pub fn frame(&self, after: u64) -> Result<Option<ViewportFrame>, Error> {
        self.shared.frame(after)
    }
}

impl Drop for Viewport {
    fn drop(&mut self) {
        self.shared.close();
        if let Some(painter) = self.painter.take() {
            // The thread has reported its panic itself; there is nothing left to lose.
            let _ = painter.join();
        }
    }
}
