//! The experience of this machine, stored between runs: times of zones, and its computing power.
//!
//! Two files in [`state_folder`]: `experience.json` and `benchmark.json`. Several processes may read and write them at the same
//! time: they are written atomically, and additions to the first are made under the lock `experience.lock`.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use bottega_farm::{BenchmarkClocks, Experience, ExperienceError, JobLesson, JobSettings, MachineSpeed, RelativePower};
use bottega_image::{ImageError, write_whole};
use bottega_platform::{folders::state_folder, processor_time::thread_seconds};
use serde::{Deserialize, Serialize};
use thiserror::Error as ThisError;

use crate::{error::error_chain, identity::identity};

/// Largest file that is read, in bytes.
const BYTES_MAX: u64 = 1 << 20;

/// V_cp (relative computing power) of this machine by the processor time of its benchmark, and the load meanwhile.
#[derive(Serialize, Deserialize)]
struct KeptBenchmark {
    /// The build that was measured; another build may be faster.
    build: String,
    power: f64,
    /// Clock time per processor time while it was measured, at least 1.
    load: f64,
}

/// Returns the path of the file with the experience of this machine.
pub fn path() -> PathBuf {
    state_folder().join("experience.json")
}

/// Reads the experience from earlier jobs. Returns it, and a warning for the user if the file is unusable. It is empty then, and
/// also if there is no file or an earlier version of Bottega wrote it.
pub fn read() -> (Experience, Option<String>) {
    let path = path();
    match read_file(&path) {
        Ok(None) => (Experience::default(), None),
        Ok(Some(experience)) => (experience, None),
        Err(reason) => {
            let warning = format!(
                "cannot use this machine's experience with the times of zones: {}: {reason}; `bottega machines forget` removes it",
                path.display()
            );
            (Experience::default(), Some(warning))
        }
    }
}

/// The reason why the experience of this machine cannot be read or stored.
#[derive(Debug, ThisError)]
pub enum ExperienceFileError {
    /// The file cannot be read.
    #[error(transparent)]
    Unreadable(#[from] io::Error),
    /// The file does not hold a valid experience.
    #[error("{}", error_chain(.0))]
    Damaged(#[from] ExperienceError),
    /// The file with earlier experience cannot be used.
    #[error("{}: {source}", .path.display())]
    Earlier {
        /// The path of the file.
        path: PathBuf,
        /// The error of reading the earlier version.
        source: Box<Self>,
    },
    /// The folder of the experience cannot be created or locked.
    #[error("{}: {source}", .folder.display())]
    Folder {
        /// The path of the folder.
        folder: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The file cannot be written.
    #[error("{}", error_chain(.0))]
    Unwritten(#[from] ImageError),
}

fn read_file(path: &Path) -> Result<Option<Experience>, ExperienceFileError> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    let mut text = String::new();
    // One byte above the limit shows that the file is too long.
    file.take(BYTES_MAX + 1).read_to_string(&mut text)?;
    match Experience::from_json(&text) {
        // An earlier Bottega learned other things: they are replaced.
        Err(ExperienceError::Earlier { .. }) => Ok(None),
        experience => Ok(Some(experience?)),
    }
}

/// Adds the lesson of a job to the file. An unusable file is left as it is, for the user to inspect.
///
/// # Errors
/// The file cannot be read, is invalid, or cannot be written, or its folder cannot be created or locked.
pub fn keep(lesson: &JobLesson) -> Result<(), ExperienceFileError> {
    let path = path();
    let folder = state_folder();
    let cannot = |source| ExperienceFileError::Folder { folder: folder.clone(), source };
    fs::create_dir_all(&folder).map_err(cannot)?;
    let lock = File::create(folder.join("experience.lock")).map_err(cannot)?;
    lock.lock().map_err(cannot)?;
    let earlier = |source| ExperienceFileError::Earlier { path: path.clone(), source: Box::new(source) };
    let before = read_file(&path).map_err(earlier)?;
    let mut experience = before.unwrap_or_default();
    experience.learn(lesson, None);
    Ok(write_whole(&path, experience.to_json().as_bytes())?)
}

/// Removes the experience and the benchmark of this machine. Returns true if there was anything to remove.
///
/// # Errors
/// A file cannot be removed.
pub fn forget() -> Result<bool, io::Error> {
    let mut found = false;
    for file in [path(), benchmark_path()] {
        match fs::remove_file(file) {
            Ok(()) => found = true,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
    }
    Ok(found)
}

fn benchmark_path() -> PathBuf {
    state_folder().join("benchmark.json")
}

/// Returns the stored speed of this machine; `None`: this build was not measured yet, or the file cannot be used.
pub fn kept_benchmark() -> Option<MachineSpeed> {
    let kept: KeptBenchmark = serde_json::from_slice(&fs::read(benchmark_path()).ok()?).ok()?;
    let is_sound = kept.build == identity() && kept.power.is_finite() && kept.power > 0.0 && kept.load >= 1.0;
    is_sound.then(|| MachineSpeed { power: RelativePower::new(kept.power), load: kept.load })
}

/// Returns V_cp of this machine, and its load now, in some 30 ms. The first call runs the benchmark, in a quarter of a second, and
/// stores it. One that was run while the machine was busy is run again by later calls, until the machine is quiet.
pub fn speed() -> MachineSpeed {
    let begun = Instant::now();
    let clocks = BenchmarkClocks {
        now: || begun.elapsed(),
        processor: || thread_seconds().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()),
    };
    let kept = kept_benchmark();
    if let Some(kept) = kept.filter(MachineSpeed::is_quiet) {
        return MachineSpeed { load: clocks.present_load(), ..kept };
    }
    let measured = clocks.benchmark();
    let quietest = kept.map_or(measured, |kept| kept.quieter(measured));
    if kept != Some(quietest) {
        keep_benchmark(quietest);
    }
    MachineSpeed { load: measured.load, ..quietest }
}

fn keep_benchmark(speed: MachineSpeed) {
    let kept = KeptBenchmark { build: identity().to_owned(), power: speed.power.get(), load: speed.load };
    let path = benchmark_path();
    _ = path.parent().map(fs::create_dir_all);
    let text = serde_json::to_string(&kept).unwrap_or_default();
    if let Err(error) = write_whole(&path, text.as_bytes()) {
        // The next run measures it again.
        tracing::debug!(%error, "cannot store the benchmark");
    }
}

/// Returns the settings of a job with the V_cp and the load of this machine.
pub(crate) fn measured(settings: JobSettings) -> JobSettings {
    JobSettings { benchmark: speed(), ..settings }
}
