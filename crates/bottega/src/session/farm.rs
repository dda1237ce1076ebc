//! Sessions of a farm: of the process that submits a picture, and of a machine that renders zones of another process's job.

use std::{path::Path, sync::Arc, time::Instant};

use bottega_farm::JobReport;
use bottega_image::{Film, Metadata};

use super::{PaintingSetup, Session, SessionOptions, Urgency, painter::Painter};
use crate::{
    agent_rules::AgentRules,
    denoise,
    engines::SceneFiles,
    error::Error,
    experience::measured,
    loaded_scene::LoadedScene,
    picture,
    plan::{PicturePart, Plan},
    request::Request,
};

/// A machine's part in a job of another process: see [`Session::for_others`].
#[derive(Clone, Copy, Debug)]
pub struct JobPart<'a> {
    /// The request as it was submitted, before file paths were changed to this machine's; stored in the picture.
    pub submitted: &'a Request,
    /// The folder on this machine that holds all files of the scene.
    pub files: &'a Path,
    /// Identity of the external engine that the job needs, the same on all machines; `None`: the built-in engine.
    pub engine: Option<&'a str>,
    /// Index of this machine's rule set, modulo the number of rule sets: machines carry the rule sets in turn.
    pub turn: usize,
}

impl Session {
    /// Opens a session like [`Self::open_with`], for a picture that the machines of a farm render together. Returns also the files
    /// that they need.
    ///
    /// # Errors
    /// Those of [`Self::open_with`], or the engine cannot list the files that its scene refers to.
    pub fn open_for_farm(request: &Request, options: SessionOptions) -> Result<(Self, SceneFiles), Error> {
        let session = Self::open_with(request, options)?;
        let rules = session.rules.clone();
        let files = match &session.painter {
            Painter::Own(own) => SceneFiles::of(&own.subject, &own.plan.method, rules),
            Painter::Other(_) => SceneFiles::gather(&session.request, rules)?,
        };
        Ok((session, files))
    }

    /// Checks a request that other machines will render, before anything is sent to them. Returns the files that they need.
    ///
    /// # Errors
    /// The request, its scene or its rules cannot be used, its output cannot be written, or its engine is not installed or cannot
    /// list the files that the scene refers to.
    pub fn examine(request: &Request) -> Result<SceneFiles, Error> {
        Self::check(request, &SessionOptions::default())?;
        Self::examine_scene(request)
    }

    /// Checks a request like [`Self::examine`], but not its output, which another machine writes. Returns the files that the
    /// machines need.
    ///
    /// # Errors
    /// The request, its scene or its rules cannot be used, or its engine is not installed or cannot list the files that the scene
    /// refers to.
    pub fn examine_for_elsewhere(request: &Request) -> Result<SceneFiles, Error> {
        request.validate()?;
        Self::examine_scene(request)
    }

    fn examine_scene(request: &Request) -> Result<SceneFiles, Error> {
        let rules = AgentRules::of(request)?;
        let (notes, texts) = (rules.notes.clone(), rules.texts.clone());
        let mut files = if request.engine.is_builtin() {
            let scene = LoadedScene::load(request)?;
            let part = PicturePart::Whole { begun: Instant::now(), urgency: Urgency::Picture };
            SceneFiles::of(&scene, &Plan::of(request, &scene, rules, &part)?.method, texts)
        } else {
            SceneFiles::gather(request, texts)?
        };
        files.warnings.splice(0..0, notes);
        Ok(files)
    }

    /// Opens a session that renders zones of another process's job. The scene files are on this machine; the session writes no
    /// journal and writes the picture only by [`Self::write_to`].
    ///
    /// # Errors
    /// Those of [`Self::open`]; also if the engine on this machine has another identity than `part.engine`.
    pub fn for_others(request: &Request, part: JobPart<'_>) -> Result<Self, Error> {
        let begun = Instant::now();
        request.validate()?;
        let opened = Painter::open(request, &PicturePart::Zones { files: part.files, turn: part.turn })?;
        // All machines must have the same engine
        let identity = opened.painter.identity();
        if identity.as_deref() != part.engine {
            let name = |engine: Option<&str>| engine.unwrap_or("the built-in engine").to_owned();
            return Err(Error::failed(
                format!("the job needs {}, but this machine has {}", name(part.engine), name(identity.as_deref())),
                "install the same version of the engine, and the same manifest, on all machines",
            ));
        }
        opened.painter.log_faults();
        let session = Self::new(request, SessionOptions::default(), opened, begun);
        Ok(Self { submitted: part.submitted.clone(), ..session })
    }

    /// Returns the values with which this machine renders zones of another process's job: with an observer that does nothing,
    /// and without a store.
    pub fn setup(&self) -> PaintingSetup {
        let (settings, engine) = (measured(self.settings.clone()), self.painter.engine());
        PaintingSetup { settings, engine, observer: Arc::new(()), store: None, kept: None }
    }

    /// Denoises a picture whose job this machine has led for others, if the request asks for it. Returns the metadata of the
    /// picture, and the result of denoising.
    ///
    /// # Errors
    /// The denoiser is not installed or fails; the picture then stays noisy.
    pub fn finish_for_others(&self, report: &mut JobReport) -> (Metadata, Result<(), Error>) {
        let mut metadata = self.painter.metadata(&self.submitted, report);
        let denoised = denoise::here(&self.request, report, &mut metadata);
        (metadata, denoised)
    }

    /// Returns a warning if a picture appears nearly black or white on a screen; `None`: it does not, or `file` is not a PNG.
    pub fn wrong_brightness(&self, file: &Path, film: &Film) -> Option<String> {
        picture::wrong_brightness(&self.request, file, film)
    }

    /// Writes a picture of this request to a file, .exr or .png.
    ///
    /// # Errors
    /// The extension is neither of these, or the file cannot be written.
    pub fn write_to(&self, path: &Path, film: &Film, metadata: &Metadata) -> Result<(), Error> {
        picture::write(&self.request, self.painter.hints(), path, film, metadata)
    }
}
