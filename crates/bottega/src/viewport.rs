//! An interactive view of a scene: rendered progressively from a camera that can be moved.
//!
//! One thread renders. A new look expires all work units of the previous one. Its first frame is coarse enough to render in a
//! moment; each later pass over the whole picture takes as many samples as all before. Other pictures of this process wait in
//! the meantime.

mod cameras;
mod follower;
mod painter;
mod sampler;
mod samples;
mod screen;
mod shown;

use std::{
    sync::Arc,
    thread::{self, JoinHandle},
    time::Duration,
};

use bottega_denoise::Denoiser;
use bottega_farm::JobSettings;
use bottega_scene::Loaded;

pub use self::{
    cameras::ViewportCamera,
    follower::{ViewportFollower, ViewportLook},
    sampler::{LookEnd, ViewportSampler},
    samples::ViewportSamples,
    shown::{LinearFrameState, ViewportFrame},
};
use self::{
    cameras::cameras,
    painter::ViewportPainter,
    shown::{ViewportShared, ViewportWish},
};
use crate::{
    error::Error,
    loaded_scene::check_view,
    request::{GuideChoice, GuideOptions, IntegratorChoice, Request, ViewOptions},
    session::{Session, SessionOptions, Urgency},
};

/// Largest number of pixels of a viewport that [`Viewport::open`] opens; a larger picture is scaled down.
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
    request.film.light_groups.clear();
    request.film.shadow_catchers.clear();
    if let Some([width, height]) = request.film.size {
        request.film.size = Some(fitted((width, height), VIEWPORT_PIXELS_MAX));
    }
    request
}

/// Returns the request as a viewport of a scene in memory renders it: without features that delay the first pixels.
fn as_edited(request: &Request) -> Request {
    let mut edited = as_viewed(request, request.film.denoise);
    (edited.film.size, edited.film.crop) = (request.film.size, request.film.crop);
    edited
}

/// Scales a size down to at most `pixels_max` pixels, keeping its aspect ratio.
fn fitted((width, height): (u32, u32), pixels_max: u64) -> [u32; 2] {
    let scale = (pixels_max as f64 / (f64::from(width) * f64::from(height))).sqrt().min(1.0);
    [width, height].map(|side| ((f64::from(side) * scale) as u32).max(1))
}

impl Viewport {
    /// Loads the scene of a request, and starts rendering on a thread of its own. Returns the viewport.
    ///
    /// # Errors
    /// The request or its scene cannot be used, the request names an external engine, or a thread cannot be started.
    pub fn open(request: &Request) -> Result<Self, Error> {
        if !request.engine.is_builtin() {
            return Err(Error::usage("only the built-in engine can change the view", "leave out the engine"));
        }
        let mut request = as_viewed(request, Denoiser::load().is_ok());
        let options = SessionOptions { urgency: Urgency::Look, ..SessionOptions::default() };
        let mut session = Session::open_with(&request, options)?;
        if request.film.size.is_none() {
            let JobSettings { width, height, .. } = *session.settings();
            request.film.size = Some(fitted((width, height), PIXELS));
            session = session.seen(&request)?;
        }
        Self::begin(session, request, false)
    }

    /// Opens a viewport of a scene in memory, and starts rendering. It makes linear frames.
    ///
    /// - `request`: its size is that of the picture, and its crop the region that is rendered.
    ///
    /// # Errors
    /// The request or the scene cannot be used, the request names an external engine, or a thread cannot be started.
    pub fn of_scene(request: &Request, scene: impl Into<Loaded>) -> Result<Self, Error> {
        let request = as_edited(request);
        let options = SessionOptions { urgency: Urgency::Look, ..SessionOptions::default() };
        let session = Session::of_scene_with(&request, scene, options)?;
        Self::begin(session, request, true)
    }

    fn begin(session: Session, request: Request, is_linear: bool) -> Result<Self, Error> {
        let settings = session.settings().clone();
        let cameras = session.subject().map(cameras).unwrap_or_default();
        let denoises = session.denoiser().is_some();
        let shared = Arc::new(ViewportShared::new(is_linear));
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

    /// Changes the view. Returns the number of the new look. An error in preparing it comes from [`Self::frame`] or
    /// [`Self::copy_linear`].
    ///
    /// # Errors
    /// The view is invalid; the previous one stays.
    pub fn look(&self, view: &ViewOptions) -> Result<u64, Error> {
        Request { view: view.clone(), ..self.request.clone() }.validate()?;
        check_view(view, self.cameras.iter().map(|camera| (&*camera.name, camera.pose.fov.is_some())))?;
        Ok(self.shared.look(ViewportWish::View(view.clone())))
    }

    /// Shows another state of the scene, of which only what has changed is prepared again. States that follow each other faster
    /// than they are shown are left out; a state is never shown in part. Returns the number of the new look. An error in
    /// preparing it comes from [`Self::frame`] or [`Self::copy_linear`].
    ///
    /// - `request`: may differ from the request of the opening in view, size, crop and samples alone.
    ///
    /// # Errors
    /// The request is invalid.
    pub fn show(&self, request: &Request, scene: impl Into<Loaded>) -> Result<u64, Error> {
        let request = as_edited(request);
        request.validate()?;
        Ok(self.shared.look(ViewportWish::Scene(Box::new(request), Box::new(scene.into()))))
    }

    /// Waits until there is a frame newer than the frame `after`, the view has failed or the viewport is closed. Returns true
    /// then, and false if `timeout` has passed before.
    pub fn wait(&self, after: u64, timeout: Duration) -> bool {
        self.shared.wait(after, timeout)
    }

    /// Copies the current linear frame: R G B A, the lowest row first. Returns its state; `None`: there is none yet, or it has
    /// another size.
    ///
    /// - `size`: columns and rows of `values`, which has four numbers per pixel.
    ///
    /// # Errors
    /// The requested view failed.
    pub fn copy_linear(&self, size: (u32, u32), values: &mut [f32]) -> Result<Option<LinearFrameState>, Error> {
        self.shared.copy_linear(size, values)
    }

    /// Registers a follower, which is informed of all looks from the current one on, so that other processes can render samples
    /// of them. Only the first call has an effect.
    pub fn follow(&self, follower: Box<dyn ViewportFollower>) {
        self.shared.follow(follower);
    }

    /// Adds samples that another process has rendered of a look, and shows them. Returns false if the look is over, or the samples
    /// do not fit its pixels.
    pub fn add(&self, samples: &ViewportSamples) -> bool {
        self.shared.add(samples)
    }

    /// Ends rendering without waiting for the end of the step that is running. The last frame stays.
    pub fn close(&self) {
        self.shared.close();
    }

    /// Registers a function that is called when there may be a new frame. It is called from rendering threads and must return
    /// quickly. Only the first call of `watch` has an effect.
    pub fn watch(&self, watcher: impl Fn() + Send + Sync + 'static) {
        self.shared.watch(watcher);
    }

    /// Returns the time until [`Self::frame`] gives a frame newer than `after`; zero: it gives one now, or the error of a failed
    /// view. `None`: there is no newer frame yet.
    pub fn due(&self, after: u64) -> Option<Duration> {
        self.shared.due(after)
    }

    /// Returns the current frame if it is newer than the frame `after` and due, else `None`; the first frame of each look is due
    /// at once.
    ///
    /// # Errors
    /// The requested view failed, or the frame cannot be encoded.
    pub fn frame(&self, after: u64) -> Result<Option<ViewportFrame>, Error> {
        self.shared.frame(after)
    }
}

impl Drop for Viewport {
    fn drop(&mut self) {
        // Who has closed the viewport does not wait for the step that is running.
        let waits = !self.shared.closing.is_cancelled();
        self.shared.close();
        if let Some(painter) = self.painter.take().filter(|_| waits) {
            // The thread has reported its panic itself; there is nothing left to lose.
            let _ = painter.join();
        }
    }
}
