//! A job prepared on this machine: its scene fetched and loaded, its engine ready.

use std::{fs, path::Path};

use bottega::{
    Request, Session,
    devices::DeviceChoice,
    identity::{difference, with_commit},
    request::{RulesSource, RulesText},
    session::{JobPart, PaintingSetup},
};
use bottega_farm::JobReport;
use bottega_image::{Film, Metadata};

use crate::{
    build::build,
    error::Error,
    files::{cache::Cache, sent_files::SentFiles},
    job::{board::JobBoard, record::Job},
    machine::member::Member,
};

/// A job whose scene is loaded on this machine.
pub(crate) struct PreparedJob {
    /// The number of the job, the same for all its paintings.
    pub(crate) origin: u64,
    session: Session,
}

/// The threads and devices that this machine renders with.
#[derive(Clone, Debug, Default)]
pub struct WorkerDevices {
    /// Number of CPU threads to use; `None`: all.
    pub threads: Option<u16>,
    /// The choice of devices.
    pub devices: DeviceChoice,
    /// Memory that scenes may use on each GPU, in MiB; `None`: nearly all.
    pub memory_mb: Option<u32>,
    /// The fuzzy rules of the machine's agents; empty: those of the job.
    pub rules: Vec<RulesText>,
}

impl WorkerDevices {
    /// Sets the devices and rules of a request to these.
    pub(crate) fn apply(&self, request: &mut Request) {
        request.devices.threads = self.threads;
        request.devices.memory_mb = self.memory_mb;
        if !self.rules.is_empty() {
            request.work.rules = self.rules.iter().cloned().map(RulesSource::Text).collect();
        }
        request.devices.names = self.devices.for_others(request.devices.exact).names();
    }
}

impl PreparedJob {
    /// Fetches the missing files of a job's scene, and loads it.
    pub(crate) fn open(member: &Member, job: &Job, cache: &Cache, own: &WorkerDevices) -> Result<Self, Error> {
        if job.version != build().identity() {
            return Err(other_build(job));
        }
        let order = member.board.spec(job)?;
        let (scene, environment) = order.files.fetch(cache, member.board.uplink.blobs())?;
        let mut request = order.on_this_machine(&scene, environment)?;
        own.apply(&mut request);
        let turn = member.name.bytes().map(usize::from).sum::<usize>();
        let files = SentFiles::root_of(&scene);
        let part = JobPart { submitted: &order.request, files: &files, engine: order.engine.as_deref(), turn };
        Ok(Self { origin: job.origin, session: Session::for_others(&request, part)? })
    }

    /// Returns the values that rendering needs.
    pub(crate) fn setup(&self) -> PaintingSetup {
        self.session.setup()
    }

    /// Returns the samples rendered by this session so far, over all pixels.
    pub(crate) fn samples_done(&self) -> u64 {
        self.session.samples_done()
    }

    /// Denoises a finished picture, if requested and possible on this machine. Returns the metadata of the picture.
    ///
    /// Problems are written to the job's log.
    pub(crate) fn finish(&self, board: &JobBoard, (number, job): (u32, &Job), report: &mut JobReport) -> Metadata {
        let (metadata, denoised) = self.session.finish_for_others(report);
        if let Err(error) = denoised {
            board.log(number, &format!("cannot denoise the picture: {}", error.error_chain()));
        }
        if let Some(problem) = self.session.wrong_brightness(Path::new(&job.output), &report.film) {
            board.log(number, &format!("the picture {problem}"));
        }
        metadata
    }

    /// Stores the picture at the farm, in the format of its output file.
    pub(crate) fn keep_picture(
        &self,
        board: &JobBoard,
        job: &Job,
        (film, metadata): (&Film, &Metadata),
        cache: &Cache,
    ) -> Result<(), Error> {
        let name = Path::new(&job.output)
            .extension()
            .map_or_else(String::new, |extension| extension.to_string_lossy().into_owned());
        let path = cache.root().join(format!("picture-{}-{}.{name}", job.work, std::process::id()));
        let written = || {
            self.session.write_to(&path, film, metadata)?;
            let bytes = fs::read(&path).map_err(|source| Error::read(path.clone(), source))?;
            board.keep_picture(job, &bytes)
        };
        let written = written();
        // The file was only temporary.
        if let Err(error) = fs::remove_file(&path) {
            tracing::debug!(%error, "cannot remove the picture's file");
        }
        written
    }
}

/// Returns the error for a job of another build.
fn other_build(job: &Job) -> Error {
    let (there, here) = (with_commit(&job.version, &job.commit), build().description());
    Error::failed(
        format!("the job is for version {there}, this is {here}: {}", difference(&job.version, build().identity())),
        format!("install bottega {there} here, or {here} there: only the same build gives the same bits"),
    )
}
