//! The experience of this machine: how long zones take it, and how fast it is, kept from one run to the next.
//!
//! Two files of [`state_folder`]: `experience.json` and `benchmark.json`. Several processes may read and write them at the same time: they
//! are written whole or not at all, and who adds to the first holds `experience.lock`.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
    time::Instant,
};

use bottega_farm::{Experience, JobLesson, JobSettings, RelativePower, benchmark};
use serde::{Deserialize, Serialize};

use bottega_platform::folders::state_folder;

use crate::{error::error_chain, identity::identity};

/// Longest file that is read.
const BYTES_MAX: u64 = 1 << 20;

/// V_cp of this machine by its benchmark.
#[derive(Serialize, Deserialize)]
struct KeptBenchmark {
    /// The build that was measured: another one may be faster.
    build: String,
    power: f64,
}

/// The file of what this machine has learnt.
pub fn path() -> PathBuf {
    state_folder().join("experience.json")
}

/// What this machine has learnt in the jobs before, and what is wrong with the file, for the user: it counts as empty then.
pub fn read() -> (Experience, Option<String>) {
    let path = path();
    match read_file(&path) {
        Ok(None) => (Experience::default(), None),
        Ok(Some(experience)) => (experience, None),
        Err(reason) => {
            let warning = format!(
                "what this machine has learnt of how long zones take is not used: {}: {reason}; `bottega machines forget` removes it",
                path.display()
            );
            (Experience::default(), Some(warning))
        }
    }
}

fn read_file(path: &Path) -> Result<Option<Experience>, String> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error.to_string()),
    };
    let mut text = String::new();
    // One byte more tells that there are more.
    file.take(BYTES_MAX + 1).read_to_string(&mut text).map_err(|error| error.to_string())?;
    Experience::from_json(&text).map(Some).map_err(|error| error_chain(&error))
}

/// Adds what was learnt in a job. A file that cannot be used is left as it is, for the user to look at.
///
/// # Errors
/// The file cannot be used or written.
pub fn keep(lesson: &JobLesson) -> Result<(), String> {
    let path = path();
    let folder = state_folder();
    let cannot = |error: io::Error| format!("{}: {error}", folder.display());
    fs::create_dir_all(&folder).map_err(cannot)?;
    let lock = File::create(folder.join("experience.lock")).map_err(cannot)?;
    lock.lock().map_err(cannot)?;
    let before = read_file(&path).map_err(|reason| format!("{}: {reason}", path.display()))?;
    let mut experience = before.unwrap_or_default();
    experience.learn(lesson);
    bottega_image::write_whole(&path, experience.to_json().as_bytes()).map_err(|error| error_chain(&error))
}

/// Forgets all that this machine has learnt, the benchmark too. Returns whether there was anything.
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

/// V_cp of this machine as its benchmark found it before; `None`: this build was not measured yet.
pub fn kept_benchmark() -> Option<RelativePower> {
    let kept: KeptBenchmark = serde_json::from_slice(&fs::read(benchmark_path()).ok()?).ok()?;
    let is_sound = kept.build == identity() && kept.power.is_finite() && kept.power > 0.0;
    is_sound.then(|| RelativePower::new(kept.power))
}

/// V_cp of this machine. The first time it is measured, in a quarter of a second, and kept.
pub fn power() -> RelativePower {
    kept_benchmark().unwrap_or_else(|| {
        let begun = Instant::now();
        let power = benchmark(|| begun.elapsed());
        let kept = KeptBenchmark { build: identity().to_owned(), power: power.get() };
        let path = benchmark_path();
        _ = path.parent().map(fs::create_dir_all);
        let text = serde_json::to_string(&kept).unwrap_or_default();
        if let Err(error) = bottega_image::write_whole(&path, text.as_bytes()) {
            // The next run measures it again.
            tracing::debug!(%error, "the benchmark was not kept");
        }
        power
    })
}

/// The job with what this machine knows of itself.
pub(crate) fn measured(settings: JobSettings) -> JobSettings {
    JobSettings { benchmark: power(), ..settings }
}
