//! A job made ready on this machine: its scene loaded, its engine at hand.

use std::{fs, path::Path, sync::Arc};

use bottega_engines::{BuiltinEngine, RenderEngine};
use bottega_farm::{Expert, JobReport, JobSettings};
use bottega_image::{Film, Metadata, check_writable};
use bottega_scene::RenderHints;

use super::{
    cache::Cache,
    job::Job,
    job_board::JobBoard,
    part::{Member, Tools},
};
use crate::{
    cli::RenderArgs,
    denoise,
    devices::{Crew, DeviceChoice},
    engines::Painter,
    error::CliError,
    identity::{description, difference, identity, with_commit},
    render,
    rules::{engine_choice, experts},
    scene::Subject,
};

/// A job made ready.
pub(super) struct Studio {
    /// Which.
    pub(super) work: u64,
    args: RenderArgs,
    settings: JobSettings,
    hand: Hand,
}

/// Who paints here.
enum Hand {
    Own { subject: Subject, engine: Arc<BuiltinEngine>, crew: Crew },
    Other(Painter),
}

/// What of this machine paints.
#[derive(Clone, Debug, Default)]
pub(super) struct Own {
    /// Processors to use; `None`: all.
    pub(super) threads: Option<u16>,
    pub(super) devices: DeviceChoice,
}

impl Studio {
    /// Fetches what this machine lacks of a job's scene, and loads it.
    pub(super) fn open(member: &Member, job: &Job, cache: &Cache, own: &Own) -> Result<Self, CliError> {
        if job.version != identity() {
            return Err(other_build(job));
        }
        let order = member.board.order(job)?;
        let (scene, environment) = order.files.fetch(cache, member.board.uplink.blobs())?;
        let mut args = order.as_asked(&scene, environment)?;
        args.scene.threads = own.threads;
        args.devices = own.devices.for_others(args.exact);
        let choice = order.choice.map(engine_choice).transpose()?;
        let (mut experts, _) = experts(order.rules)?;
        // The machines have the rules in turn, as agents of one process have.
        let turn = member.name.bytes().map(usize::from).sum::<usize>() % experts.len();
        experts.rotate_left(turn);
        let (hand, settings) = Hand::open(&args, experts, order.engine.as_deref())?;
        let settings = JobSettings { engine_choice: choice, ..settings };
        Ok(Self { work: job.work, args, settings, hand })
    }

    /// What painting takes.
    pub(super) fn tools(&self) -> Tools {
        Tools {
            settings: self.settings.clone(),
            engine: self.hand.engine(),
            observer: Arc::new(()),
            store: None,
            kept: None,
        }
    }

    pub(super) fn samples_done(&self) -> u64 {
        self.hand.samples_done()
    }

    /// Denoises a picture that is painted, if that was asked for and can be done here. What the picture says of itself.
    pub(super) fn finish(&self, board: &JobBoard, number: u32, report: &mut JobReport) -> Metadata {
        let mut metadata = self.hand.metadata(&self.args, &self.settings, report);
        if let Err(error) = denoise::here(&self.args, report, &mut metadata) {
            board.log(number, &format!("the picture keeps its noise: {}", error.told()));
        }
        metadata
    }

    /// Has the farm keep the picture, as the file that was asked for.
    pub(super) fn keep_picture(
        &self,
        board: &JobBoard,
        job: &Job,
        (film, metadata): (&Film, &Metadata),
        cache: &Cache,
    ) -> Result<(), CliError> {
        let name = Path::new(&job.output).extension().map_or_else(String::new, |it| it.to_string_lossy().into_owned());
        let path = cache.root().join(format!("picture-{}-{}.{name}", job.work, std::process::id()));
        let written = || {
            let format = check_writable(&path)?;
            render::write(&self.args, self.hand.hints(), &path, format, film, metadata)?;
            let bytes = fs::read(&path).map_err(|source| CliError::Read { path: path.clone(), source })?;
            board.keep_picture(job, &bytes)
        };
        let written = written();
        // It was only on its way.
        if let Err(error) = fs::remove_file(&path) {
            tracing::debug!(%error, "the picture's file was not removed");
        }
        written
    }
}

/// What is wrong with a job of another build.
fn other_build(job: &Job) -> CliError {
    let (there, here) = (with_commit(&job.version, &job.commit), description());
    CliError::failed(
        format!("the job is for version {there}, this is {here}: {}", difference(&job.version, identity())),
        format!("install bottega {there} here, or {here} there: only the same build gives the same bits"),
    )
}

impl Hand {
    /// Our own engine, or the one that the job is for.
    ///
    /// - `wanted`: that engine, as all machines of the job must have it.
    fn open(args: &RenderArgs, experts: Vec<Expert>, wanted: Option<&str>) -> Result<(Self, JobSettings), CliError> {
        let goal = render::asked_goal(args);
        if let Some(wanted) = wanted {
            let painter = Painter::open(args, experts)?;
            let here = painter.located.identity();
            if here != wanted {
                return Err(CliError::failed(
                    format!("the job is for {wanted}, this machine has {here}"),
                    "install the same version of the engine, and the same manifest, on all machines",
                ));
            }
            painter.engine.watch_faults(|fault| tracing::warn!("{fault}"));
            let settings = JobSettings { goal, ..painter.settings.clone() };
            return Ok((Self::Other(painter), settings));
        }
        let subject = Subject::load(&args.scene)?;
        let settings = render::job_settings(args, &subject, experts)?;
        let settings = JobSettings { agents: 1, goal, ..settings };
        let (engine, crew) = render::engine(args, &subject, &settings)?;
        crew.notes.iter().for_each(|note| tracing::warn!("{note}"));
        Ok((Self::Own { subject, engine: Arc::new(engine), crew }, settings))
    }

    fn engine(&self) -> Arc<dyn RenderEngine> {
        match self {
            Self::Own { engine, .. } => Arc::clone(engine) as _,
            Self::Other(painter) => painter.paints(),
        }
    }

    fn samples_done(&self) -> u64 {
        match self {
            Self::Own { engine, .. } => engine.samples_done(),
            Self::Other(painter) => painter.counter()(),
        }
    }

    /// What the scene file asks for, where our own engine has read it.
    fn hints(&self) -> Option<&RenderHints> {
        match self {
            Self::Own { subject, .. } => Some(&subject.hints),
            Self::Other(_) => None,
        }
    }

    fn metadata(&self, args: &RenderArgs, settings: &JobSettings, report: &JobReport) -> Metadata {
        match self {
            Self::Own { subject, crew, .. } => render::metadata(args, subject, settings, crew, report),
            Self::Other(painter) => painter.metadata(args, report),
        }
    }
}
