//! A job made ready on this machine: its scene loaded, its engine at hand.

use std::{fs, path::Path, sync::Arc};

use bottega_engines::BuiltinEngine;
use bottega_farm::{JobReport, JobSettings};
use bottega_image::check_writable;

use super::{
    cache::Cache,
    job::Job,
    job_board::JobBoard,
    part::{Member, Tools},
};
use crate::{
    cli::RenderArgs,
    devices::{Crew, DeviceChoice},
    error::CliError,
    render,
    rules::experts,
    scene::Subject,
};

/// A job made ready.
pub(super) struct Studio {
    /// Which.
    pub(super) work: u64,
    args: RenderArgs,
    subject: Subject,
    settings: JobSettings,
    engine: Arc<BuiltinEngine>,
    /// Who paints here.
    crew: Crew,
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
        let version = env!("CARGO_PKG_VERSION");
        if job.version != version {
            return Err(CliError::failed(
                format!("the job is for version {}, this is {version}", job.version),
                format!("install bottega {} here, or {version} there", job.version),
            ));
        }
        let order = member.board.order(job)?;
        let (scene, environment) = order.files.fetch(cache, member.board.uplink.blobs())?;
        let mut args = order.as_asked(&scene, environment)?;
        args.scene.threads = own.threads;
        args.devices = own.devices.for_others(args.exact);
        let subject = Subject::load(&args.scene)?;
        let (mut experts, _) = experts(order.rules)?;
        // The machines have the rules in turn, as agents of one process have.
        let turn = member.name.bytes().map(usize::from).sum::<usize>() % experts.len();
        experts.rotate_left(turn);
        let settings = render::job_settings(&args, &subject, experts)?;
        let settings = JobSettings { agents: 1, goal: render::asked_goal(&args), ..settings };
        let (engine, crew) = render::engine(&args, &subject, &settings)?;
        crew.notes.iter().for_each(|note| tracing::warn!("{note}"));
        let engine = Arc::new(engine);
        Ok(Self { work: job.work, args, subject, settings, engine, crew })
    }

    /// What painting takes.
    pub(super) fn tools(&self) -> Tools {
        Tools {
            settings: self.settings.clone(),
            engine: Arc::clone(&self.engine) as _,
            observer: Arc::new(()),
            store: None,
            kept: None,
        }
    }

    pub(super) fn samples_done(&self) -> u64 {
        self.engine.samples_done()
    }

    /// Has the farm keep the picture, as the file that was asked for.
    pub(super) fn keep_picture(
        &self,
        board: &JobBoard,
        job: &Job,
        report: &JobReport,
        cache: &Cache,
    ) -> Result<(), CliError> {
        let name = Path::new(&job.output).extension().map_or_else(String::new, |it| it.to_string_lossy().into_owned());
        let path = cache.root().join(format!("picture-{}-{}.{name}", job.work, std::process::id()));
        let written = || {
            let format = check_writable(&path)?;
            let metadata = render::metadata(&self.args, &self.subject, &self.settings, &self.crew, report);
            render::write(&self.args, &path, format, &report.film, &metadata)?;
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
