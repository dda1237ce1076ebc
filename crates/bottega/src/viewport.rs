//! A scene looked around in: painted over and over, finer and finer, from wherever one wants to see it.
//!
//! One thread paints. A new look ends the life time of all units of the one before; the first thing to be seen of it is coarse, and
//! each pass over the whole picture takes as many samples as all before. What else this process paints waits meanwhile.

use std::{
    ops::{ControlFlow, Range},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, mpsc},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use bottega_denoise::Denoiser;
use bottega_engines::{BuiltinEngine, CancelSwitch, EnginePreference, RenderEngine, TaskProgress, ZoneTask};
use bottega_farm::JobSettings;
use bottega_image::{Film, Picture, Preview, Rect, Tile};
use bottega_scene::{Camera, Projection};
use glam::{DVec3, Vec3};
use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    devices::threads,
    error::Error,
    loaded_scene::{LoadedScene, check_view},
    request::{CameraPose, GuideChoice, GuideOptions, IntegratorChoice, Request, ViewOptions},
    session::{Session, SessionOptions, Urgency},
    settings::tone,
};

/// Pixels of a viewport at most; a larger picture is shown smaller.
pub const VIEWPORT_PIXELS_MAX: u64 = 1 << 20;
/// The same where nobody says a size: soon painted.
const PIXELS: u64 = 1 << 18;
/// Samples of a pixel after which nothing more is painted, where nobody says.
const SAMPLES: u32 = 64;
/// The most samples of a pixel.
const SAMPLES_MAX: u32 = 1024;
/// Side of the cells of the first thing to be seen, in pixels.
const COARSE_CELL: u32 = 8;
/// Samples of a pixel from which on noise is removed.
const DENOISED_FROM: u32 = 4;
/// A picture of the same look is given so often at most.
const FRAME_EVERY: Duration = Duration::from_millis(40);

/// A scene looked around in. It ends when it is dropped.
pub struct Viewport {
    shared: Arc<ViewportShared>,
    request: Request,
    cameras: Vec<ViewportCamera>,
    settings: JobSettings,
    denoises: bool,
    painter: Option<JoinHandle<()>>,
}

/// A camera of the scene that is looked around in.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ViewportCamera {
    /// Its name in the file; may be empty.
    pub name: String,
    /// Where it stands, and a place that it looks at, in the middle of what is there.
    pub pose: CameraPose,
}

/// What is to be seen of a viewport.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ViewportFrame {
    /// It grows with each change.
    pub number: u64,
    /// Of which look it is: the first is 0.
    pub look: u64,
    /// Samples that each pixel has; some may have more. 0: it is coarse.
    pub samples: u32,
    /// Whether noise was removed.
    pub is_denoised: bool,
    /// A PNG file.
    pub png: Vec<u8>,
}

/// What those who look and the one who paints share.
struct ViewportShared {
    state: Mutex<ViewportState>,
    /// Something else is wanted.
    wanted: Condvar,
}

struct ViewportState {
    view: ViewOptions,
    look: u64,
    /// Paints the look that is under way.
    engine: Option<Arc<BuiltinEngine>>,
    shown: Option<ShownView>,
    number: u64,
    given: Option<(u64, Instant)>,
    is_closed: bool,
    problem: Option<(String, String)>,
}

/// What is shown.
#[derive(Clone)]
struct ShownView {
    preview: Arc<Preview>,
    look: u64,
    samples: u32,
    is_denoised: bool,
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
        let state = Mutex::new(ViewportState {
            view: request.view.clone(),
            look: 0,
            engine: None,
            shown: None,
            number: 0,
            given: None,
            is_closed: false,
            problem: None,
        });
        let shared = Arc::new(ViewportShared { state, wanted: Condvar::new() });
        let painting = Arc::clone(&shared);
        let painter = thread::Builder::new().name("viewport".to_owned()).spawn(move || painting.paint(session));
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
        let (left, look) = {
            let mut state = self.shared.state();
            state.view = view.clone();
            state.look += 1;
            (state.engine.take(), state.look)
        };
        self.shared.wanted.notify_all();
        // What waits of the look before is painted by nobody.
        left.iter().for_each(|engine| engine.leave());
        Ok(look)
    }

    /// What is to be seen, if it is newer than the frame `after`; each look has its first one at once.
    ///
    /// # Errors
    /// The scene could not be seen as it was asked for.
    pub fn frame(&self, after: u64) -> Result<Option<ViewportFrame>, Error> {
        let (shown, number) = {
            let mut state = self.shared.state();
            if let Some((problem, remedy)) = &state.problem {
                return Err(Error::usage(problem, remedy));
            }
            let (Some(shown), true) = (state.shown.clone(), state.number > after) else { return Ok(None) };
            let is_soon = |(look, at): (u64, Instant)| look == shown.look && at.elapsed() < FRAME_EVERY;
            if state.given.is_some_and(is_soon) {
                return Ok(None);
            }
            state.given = Some((shown.look, Instant::now()));
            (shown, state.number)
        };
        let ShownView { preview, look, samples, is_denoised } = shown;
        Ok(Some(ViewportFrame { number, look, samples, is_denoised, png: preview.to_png()? }))
    }
}

impl Drop for Viewport {
    fn drop(&mut self) {
        let left = {
            let mut state = self.shared.state();
            state.is_closed = true;
            state.engine.take()
        };
        self.shared.wanted.notify_all();
        left.iter().for_each(|engine| engine.leave());
        if let Some(painter) = self.painter.take() {
            // A panic in there was already reported by the thread itself; there is nothing left to lose.
            let _ = painter.join();
        }
    }
}

impl ViewportShared {
    fn state(&self) -> MutexGuard<'_, ViewportState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Paints what is wanted until nothing is any more.
    fn paint(self: &Arc<Self>, session: Session) {
        let (mut session, mut look) = (session, 0);
        loop {
            let painted = self.paint_look(&session, look);
            let (view, next) = {
                let is_content = |state: &mut ViewportState| state.look == look && !state.is_closed;
                let state = self.wanted.wait_while(self.state(), is_content).unwrap_or_else(PoisonError::into_inner);
                if state.is_closed {
                    return;
                }
                (state.view.clone(), state.look)
            };
            match painted.and_then(|()| session.look(&view)) {
                Ok(other) => (session, look) = (other, next),
                Err(error) => {
                    let remedy = error.remedy().unwrap_or_default();
                    self.state().problem = Some((error.error_chain(), remedy));
                    return;
                }
            }
        }
    }

    /// Paints a look until another one is wanted, or it has all samples.
    fn paint_look(self: &Arc<Self>, session: &Session, look: u64) -> Result<(), Error> {
        let (settings, output) = (session.settings(), &session.request().output);
        let Some(engine) = session.own_engine() else { return Ok(()) };
        if !self.begin(engine, look) {
            return Ok(());
        }
        let frame = Rect::of_size(settings.width, settings.height);
        let fresh = || Arc::new(Preview::new(frame, output.exposure, tone(output.tonemap)));
        let show = |preview: &Arc<Preview>, samples, is_denoised| {
            self.show(ShownView { preview: Arc::clone(preview), look, samples, is_denoised });
        };
        let preview = fresh();
        let survey = engine.survey(frame.width().div_ceil(COARSE_CELL), frame.height().div_ceil(COARSE_CELL));
        if !self.is_wanted(look) {
            return Ok(());
        }
        let survey = survey?;
        let coarse = survey.pixels.iter().map(|pixel| pixel.color).collect();
        preview.show_coarse(&Picture { width: survey.width, height: survey.height, data: coarse }, frame);
        show(&preview, 0, false);
        let (painted, shared) = (Arc::clone(&preview), Arc::clone(self));
        session.watch(move |tile| {
            painted.show(tile);
            shared.touch(&painted);
        });
        let (mut tile, mut done) = (None, 0);
        while done < settings.samples {
            let until = (2 * done).max(1).min(settings.samples);
            tile = match self.pass(&**engine, settings, (done..until, tile), look)? {
                Some(painted) => Some(painted),
                None => return Ok(()),
            };
            done = until;
            let film = tile.as_ref().filter(|_| done >= DENOISED_FROM).map(film_of);
            match film.and_then(|film| self.without_noise(session, &film, look)) {
                None => self.note_samples(look, done),
                Some(clean) => {
                    let preview = fresh();
                    preview.show_coarse(&clean, frame);
                    show(&preview, done, true);
                }
            }
        }
        Ok(())
    }

    /// Whoever looks elsewhere leaves what this engine paints. Returns whether he has not yet.
    fn begin(&self, engine: &Arc<BuiltinEngine>, look: u64) -> bool {
        let mut state = self.state();
        let is_wanted = state.look == look && !state.is_closed;
        state.engine = is_wanted.then(|| Arc::clone(engine));
        is_wanted
    }

    fn is_wanted(&self, look: u64) -> bool {
        let state = self.state();
        state.look == look && !state.is_closed
    }

    /// Some more samples of all pixels; `None`: something else is wanted.
    fn pass(
        &self,
        engine: &dyn RenderEngine,
        settings: &JobSettings,
        (samples, tile): (Range<u32>, Option<Tile>),
        look: u64,
    ) -> Result<Option<Tile>, Error> {
        if !self.is_wanted(look) {
            return Ok(None);
        }
        let task = ZoneTask {
            rect: Rect::of_size(settings.width, settings.height),
            samples,
            tunables: settings.tunables,
            leaning: EnginePreference::default(),
            tile,
            parts: None,
            cancel: CancelSwitch::default(),
            progress: TaskProgress::default(),
        };
        let (told, painted) = mpsc::channel();
        engine.start(task, Box::new(move |painted| _ = told.send(painted)));
        let gone = |_| Error::failed("the engine does not answer", "look at the scene anew");
        let painted = painted.recv().map_err(gone)??;
        Ok(painted.complete.then_some(painted.tile))
    }

    /// The picture without noise; `None`: nobody removes it, or something else is wanted.
    fn without_noise(&self, session: &Session, film: &Film, look: u64) -> Option<Picture> {
        let mut told = |_| if self.is_wanted(look) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
        let denoised = session.denoiser()?.denoise(film, threads(session.request()), &mut told);
        denoised.ok().map(|denoised| denoised.film.to_picture())
    }

    fn show(&self, shown: ShownView) {
        let mut state = self.state();
        state.number += 1;
        state.shown = Some(shown);
    }

    /// Some pixels are painted.
    fn touch(&self, preview: &Arc<Preview>) {
        let mut state = self.state();
        if state.shown.as_ref().is_some_and(|shown| Arc::ptr_eq(&shown.preview, preview)) {
            state.number += 1;
        }
    }

    /// All pixels have so many samples.
    fn note_samples(&self, look: u64, samples: u32) {
        let mut state = self.state();
        state.number += 1;
        if let Some(shown) = state.shown.as_mut().filter(|shown| shown.look == look && !shown.is_denoised) {
            shown.samples = samples;
        }
    }
}

fn film_of(tile: &Tile) -> Film {
    let mut film = Film::new(tile.rect(), tile.layout().clone());
    film.add_tile(tile, |_, _| 1.0);
    film
}

/// The cameras of a scene, each with a place that it looks at.
fn cameras(subject: &LoadedScene) -> Vec<ViewportCamera> {
    let scene = subject.scene();
    let (low, high) = scene.bounds();
    let (center, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    let known = |camera: &Camera| ViewportCamera {
        name: camera.name.clone(),
        pose: pose_of(camera, scene.origin, (center, radius)),
    };
    subject.cameras().iter().map(known).collect()
}

fn pose_of(camera: &Camera, origin: DVec3, (center, radius): (Vec3, f32)) -> CameraPose {
    let eye = Vec3::from(camera.world_from_camera.translation);
    let ahead = Vec3::from(-camera.world_from_camera.matrix3.z_axis).normalize_or(Vec3::NEG_Z);
    // What lies in the middle of the scene is turned about, where that is ahead.
    let middle = (center - eye).dot(ahead);
    let distance = if middle.is_finite() { middle.max(0.1 * radius) } else { 1.0 }.max(f32::MIN_POSITIVE);
    let in_file = |place: Vec3| (place.as_dvec3() + origin).to_array();
    CameraPose {
        eye: in_file(eye),
        target: in_file(eye + distance * ahead),
        up: Vec3::from(camera.world_from_camera.matrix3.y_axis).as_dvec3().to_array(),
        fov: match camera.projection {
            Projection::Perspective { vertical_fov } => Some(vertical_fov.to_degrees()),
            Projection::Orthographic { .. } | Projection::Panorama(_) => None,
        },
    }
}
