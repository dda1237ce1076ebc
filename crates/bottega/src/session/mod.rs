//! Sessions: from a request to a picture.

mod farm;
mod lighting_agents;
mod looking;
mod occupation;
mod painter;
mod painting;
mod reporter;
mod watcher;

use std::{
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};

use bottega_denoise::Denoiser;
use bottega_engines::RenderEngine;
pub use bottega_engines::Urgency;
use bottega_farm::{
    Goal, JobError, JobSettings, JournalContents, Observer, StopSwitch, ZoneStore, simulate::Recorder, survey_size,
};
use bottega_image::{Rect, Tile, check_writable};
use bottega_scene::Loaded;

use self::painter::{Beginning, OpenedPicture, Painter};
pub use self::{farm::JobPart, painting::ActiveSession, reporter::Reporter, watcher::Watcher};
use crate::{
    agent_rules::{AgentRules, RuleTexts},
    denoise,
    engines::ExternalPainter,
    error::Error,
    experience::{self, measured},
    journal::PictureJournal,
    loaded_scene::LoadedScene,
    picture::{Picture, finishing},
    plan::{PicturePart, time_goal},
    preview::{LivePreview, PreviewView, check_preview},
    request::Request,
    settings::tone,
    tev::TevMirror,
};

/// The options of a session that are not part of the request. None of them changes a pixel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SessionOptions {
    /// `true`: resume from the journal that an earlier session has left beside the output.
    pub resume: bool,
    /// A PNG file that is updated with a preview during rendering; `None`: no preview file.
    pub preview: Option<PathBuf>,
    /// True if the watcher gets previews and tiles.
    pub shows: bool,
    /// The file for the times of zones, for `bottega simulate`; `None`: no record.
    pub record: Option<PathBuf>,
    /// An SVG or JSON file for the timeline of processors and devices; `None`: no timeline.
    pub timeline: Option<PathBuf>,
    /// `HOST` or `HOST:PORT` of the viewer tev, which shows all layers during rendering; `None`: no viewer.
    pub tev: Option<String>,
    /// The urgency of the picture among all pictures that this process renders.
    pub urgency: Urgency,
    /// The start of the time limit (`goal.time`), such as the start of the program; `None`: the opening of the session.
    pub begun: Option<Instant>,
}

/// A request with its scene loaded and its engine ready to render.
pub struct Session {
    request: Request,
    /// The request that is stored in the picture.
    submitted: Request,
    options: SessionOptions,
    painter: Painter,
    name: Option<String>,
    settings: JobSettings,
    denoiser: Option<Denoiser>,
    /// The texts of the agents' rules.
    rules: RuleTexts,
    /// Warnings, reported before rendering begins.
    notes: Vec<String>,
    begun: Instant,
    journal: Option<PictureJournal>,
}

/// The values that [`bottega_farm::run`] needs for a job.
pub struct PaintingSetup {
    /// The settings of the job.
    pub settings: JobSettings,
    /// The engine that renders zones.
    pub engine: Arc<dyn RenderEngine>,
    /// The observer of the job.
    pub observer: Arc<dyn Observer>,
    /// The store for finished zones, such as the writer of the journal; `None`: zones are not stored.
    pub store: Option<Box<dyn ZoneStore>>,
    /// The zones of an interrupted session, read from the journal; `None`: a new picture.
    pub kept: Option<JournalContents>,
}

impl Session {
    /// Loads the scene of a request, prepares it and chooses engine and devices. Returns the session. All errors of the request
    /// are found here.
    ///
    /// # Errors
    /// The request, its scene, rules or engine cannot be used, its output cannot be written, or the denoiser is not installed.
    pub fn open(request: &Request) -> Result<Self, Error> {
        Self::open_with(request, SessionOptions::default())
    }

    /// Opens a session like [`Self::open`], with options.
    ///
    /// # Errors
    /// Those of [`Self::open`]. An option cannot be used. `options.resume` is set, and this picture has no journal.
    pub fn open_with(request: &Request, options: SessionOptions) -> Result<Self, Error> {
        let begun = options.begun.unwrap_or_else(Instant::now);
        let request = &request.by_engine_of_scene();
        Self::check(request, &options)?;
        // Read rules and scene, choose everything for the picture, and make its engine
        let opened = Painter::open(request, &PicturePart::Whole { begun, urgency: options.urgency })?;
        // Report a missing denoiser before anything is written.
        let denoiser = denoise::ready(request)?;
        let journal = PictureJournal::of_request(request, opened.name.as_deref(), options.resume)?;
        Ok(Self { denoiser, journal, ..Self::new(request, options, opened, begun) })
    }

    /// Opens a session for a scene in memory. The request's `scene.file` only serves as the scene's name. The session writes no
    /// journal, so it cannot be resumed.
    ///
    /// # Errors
    /// Those of [`Self::open`], or the request names an external engine.
    pub fn of_scene(request: &Request, scene: impl Into<Loaded>) -> Result<Self, Error> {
        Self::of_scene_with(request, scene, SessionOptions::default())
    }

    /// Opens a session like [`Self::of_scene`], with options.
    ///
    /// # Errors
    /// Those of [`Self::of_scene`]; also if an option cannot be used, or `options.resume` is set.
    pub fn of_scene_with(request: &Request, scene: impl Into<Loaded>, options: SessionOptions) -> Result<Self, Error> {
        let begun = options.begun.unwrap_or_else(Instant::now);
        Self::check(request, &options)?;
        if options.resume {
            return Err(Error::usage(
                "there is nothing to resume: a picture whose scene is not in a file has no journal",
                "do not resume",
            ));
        }
        if !request.engine.is_builtin() {
            return Err(Error::usage(
                "only the built-in engine renders a scene that is not in a file",
                "leave out the engine",
            ));
        }
        let part = PicturePart::Whole { begun, urgency: options.urgency };
        let rules = AgentRules::of(request)?;
        let opened = Painter::of_scene(request, LoadedScene::of_scene(scene, request)?, rules, &part)?;
        let denoiser = denoise::ready(request)?;
        Ok(Self { denoiser, ..Self::new(request, options, opened, begun) })
    }

    /// Makes a session without denoiser and journal.
    fn new(request: &Request, options: SessionOptions, opened: OpenedPicture, begun: Instant) -> Self {
        let OpenedPicture { painter, name, settings, rules, notes } = opened;
        Self {
            request: request.clone(),
            submitted: request.clone(),
            options,
            settings,
            painter,
            name,
            denoiser: None,
            rules,
            notes,
            begun,
            journal: None,
        }
    }

    fn check(request: &Request, options: &SessionOptions) -> Result<(), Error> {
        request.validate()?;
        if request.frames.is_some() {
            return Err(Error::usage(
                "the request has several frames, but a session renders one picture",
                "open a session for each of them: Request::at_frame",
            ));
        }
        if let Some(file) = &request.output.file {
            check_writable(file)?;
        }
        options.preview.as_deref().map(check_preview).transpose()?;
        let is_recordable = request.goal.error.is_none() && request.goal.time.is_none() && !options.resume;
        if options.record.is_some() && !(is_recordable && request.engine.is_builtin()) {
            return Err(Error::usage(
                "--record needs a whole picture by the built-in engine with a fixed number of samples",
                "leave it out, or the error, the time, --resume or the engine",
            ));
        }
        options.record.as_deref().map(check_folder).transpose()?;
        if let Some(timeline) = &options.timeline {
            if !request.engine.is_builtin() {
                return Err(Error::usage(
                    "--timeline needs the built-in engine: the activity of other engines' processes is unknown",
                    "leave it out, or the engine",
                ));
            }
            occupation::check_timeline(timeline)?;
            check_folder(timeline)?;
        }
        Ok(())
    }

    /// Returns the request that the session renders.
    pub fn request(&self) -> &Request {
        &self.request
    }

    /// Returns the settings of the job.
    pub fn settings(&self) -> &JobSettings {
        &self.settings
    }

    /// Returns the number of samples taken so far, over all pixels.
    pub fn samples_done(&self) -> u64 {
        self.painter.counter()()
    }

    /// Returns a text with everything that determines the pixels: two sessions with the same name give the same bits. It does
    /// not hold the number of agents and threads. `None`: the session renders zones of another process's job with an
    /// external engine.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// Renders the picture and writes it to the output of the request, if any. Returns the picture; a partial one if `stop` ended
    /// the rendering.
    ///
    /// # Errors
    /// The viewer tev does not answer, the job failed, zones failed, or the picture cannot be denoised or written. The journal
    /// beside the output keeps the finished zones.
    pub fn render(mut self, watcher: Arc<dyn Watcher>, stop: &StopSwitch) -> Result<Picture, Error> {
        // Read the times that earlier jobs have learned
        let reporter = Arc::new(Reporter::new(watcher));
        let (learnt, warning) = experience::read();
        if let Some(warning) = warning {
            reporter.warn(warning);
        }
        self.settings.experience = Arc::new(learnt);
        // Run the job on this machine
        let (painting, setup) = self.begin(reporter)?;
        let PaintingSetup { settings, engine, observer, store, kept } = setup;
        let report = bottega_farm::run(&settings, engine, observer, stop, store, kept).map_err(failed)?;
        // Keep what this job has learned
        for lesson in report.lessons.values() {
            if let Err(reason) = experience::keep(lesson) {
                painting.reporter().warn(format!("cannot store the experience of this job: {reason}"));
            }
        }
        painting.finish(report, stop)?.deliver()
    }

    /// Begins rendering: reports the start and returns the values for [`bottega_farm::run`]. For callers that run the job
    /// themselves; [`Self::render`] does everything.
    ///
    /// # Errors
    /// The viewer tev does not answer, or the preview of an interrupted picture cannot be made.
    pub fn begin(mut self, reporter: Arc<Reporter>) -> Result<(ActiveSession, PaintingSetup), Error> {
        // Report warnings and the start
        self.notes.iter().for_each(|note| reporter.warn(note.clone()));
        let Beginning { started, engine, counter } = self.painter.begin(&self.request, &self.settings);
        reporter.tell(started);
        let (journal, store, kept) = match self.journal.take() {
            Some(PictureJournal { path, store, kept }) => (Some(path), Some(store), kept),
            None => (None, None, None),
        };
        // Start previews and progress events
        let tev = self.show(&reporter, kept.as_ref())?;
        reporter.watch(counter);
        // Subtract loading and finishing from the time limit
        if let (Goal::Time(_), Some(time)) = (self.settings.goal, self.request.goal.time) {
            let finishing = finishing(&self.request, &self.settings, self.denoiser.is_some());
            self.settings.goal = time_goal(time, self.begun, finishing);
        }
        // Record the times of zones
        let observer: Arc<dyn Observer> = Arc::clone(&reporter) as _;
        let record = |_: &PathBuf| Arc::new(Recorder::new(Arc::clone(&engine), Arc::clone(&observer)));
        let recorder = self.options.record.as_ref().map(|path| (path.clone(), record(path)));
        let (engine, observer) = match &recorder {
            Some((_, recorder)) => (Arc::clone(recorder) as _, Arc::clone(recorder) as _),
            None => (engine, observer),
        };
        let setup = PaintingSetup { settings: measured(self.settings.clone()), engine, observer, store, kept };
        let Self { request, submitted, painter, settings, denoiser, options, .. } = self;
        let timeline = options.timeline;
        let active = ActiveSession {
            request,
            submitted,
            painter,
            settings,
            denoiser,
            reporter,
            recorder,
            journal,
            timeline,
            tev,
        };
        Ok((active, setup))
    }

    /// Starts previews and the tev viewer, and reports faults of an external engine. With a journal the preview shows the kept
    /// zones at once, over the survey.
    fn show(&self, reporter: &Arc<Reporter>, kept: Option<&JournalContents>) -> Result<Option<Arc<TevMirror>>, Error> {
        let SessionOptions { preview, shows, .. } = &self.options;
        let watch_faults = |painter: &ExternalPainter| {
            let (teller, title) = (Arc::downgrade(reporter), painter.title());
            painter.engine.watch_faults(move |fault| {
                if let Some(reporter) = teller.upgrade() {
                    reporter.warn(format!("{title}: {fault}"));
                }
            });
        };
        if let Painter::Other(painter) = &self.painter {
            watch_faults(painter);
        }
        let tev = self.mirror()?;
        if preview.is_none() && !shows {
            if let Some(mirror) = tev.clone() {
                self.watch(move |tile| mirror.painted(tile));
            }
            return Ok(tev);
        }
        let (settings, output) = (&self.settings, &self.request.output);
        let frame = Rect::of_size(settings.width, settings.height);
        let look = PreviewView { frame, crop: settings.crop, exposure: output.exposure, tone: tone(output.tonemap) };
        let watcher = shows.then(|| Arc::clone(reporter.watcher()));
        let show = Arc::new(LivePreview::new(look, preview.clone(), watcher.clone()));
        match &self.painter {
            Painter::Own(own) => {
                if let Some(kept) = kept {
                    let (columns, rows) = survey_size(&look.frame);
                    show.begin(&own.engine.survey(columns, rows)?);
                    for tile in kept.tiles.values() {
                        show.painted(tile);
                        watcher.iter().for_each(|watcher| watcher.tile(tile));
                    }
                }
                reporter.show(&show, own.subject.loaded);
            }
            Painter::Other(_) => reporter.show(&show, self.begun),
        }
        let mirror = tev.clone();
        self.watch(move |tile| {
            show.painted(tile);
            watcher.iter().for_each(|watcher| watcher.tile(tile));
            mirror.iter().for_each(|mirror| mirror.painted(tile));
        });
        Ok(tev)
    }

    /// Registers a function that is called with each rendered block.
    pub(crate) fn watch(&self, watcher: impl Fn(&Tile) + Send + Sync + 'static) {
        match &self.painter {
            Painter::Own(own) => own.engine.watch(watcher),
            Painter::Other(painter) => painter.engine.watch(watcher),
        }
    }

    /// Connects to the tev viewer of the options; `None`: none is set.
    fn mirror(&self) -> Result<Option<Arc<TevMirror>>, Error> {
        let Some(host) = &self.options.tev else { return Ok(None) };
        let JobSettings { width, height, layout, .. } = &self.settings;
        let name = self.request.output.file.as_deref().unwrap_or(&self.request.scene.file);
        let mirror = TevMirror::open(host, &crate::text::shown(name), (*width, *height), layout)?;
        Ok(Some(Arc::new(mirror)))
    }
}

fn failed(error: JobError) -> Error {
    match error {
        JobError::OtherWork => Error::failed(
            "the interrupted picture was made with other settings",
            "give the same options as before, or leave out --resume to start again",
        ),
        error => Error::Job(error),
    }
}

/// Checks that the folder of a file exists.
fn check_folder(path: &Path) -> Result<(), Error> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if folder.is_dir() {
        return Ok(());
    }
    let source = io::Error::new(io::ErrorKind::NotFound, format!("there is no folder {}", folder.display()));
    Err(Error::Write { path: path.to_owned(), source })
}
