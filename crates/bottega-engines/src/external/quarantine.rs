//! Quarantine of engines that failed repeatedly on this machine. It is stored in files, one per engine, for later
//! processes; a new version, another manifest or [`release`] ends it.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, Read},
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, OnceLock, PoisonError},
    time::{SystemTime, UNIX_EPOCH},
};

use serde::{Deserialize, Serialize};

use super::{error::EngineFault, locate::LocatedEngine};

/// The largest quarantine file that is read, in bytes.
const BYTES_MAX: u64 = 1 << 16;
/// The most characters kept of an engine's last message.
const REASON_MAX: usize = 2000;

/// The record of a quarantined engine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quarantine {
    /// The name, version, manifest and scripts of the engine: others are not affected.
    pub identity: String,
    /// The number of failures in a row.
    pub failures: u32,
    /// The last failure.
    pub reason: String,
    /// The time of the quarantine, in seconds since 1970.
    pub since: u64,
}

/// The folder of the quarantine files.
static FOLDER: OnceLock<PathBuf> = OnceLock::new();

/// Sets the folder in which quarantines are stored; without it they end with this process. Only the first call has an
/// effect.
pub fn keep_quarantines_in(folder: PathBuf) {
    let _ = FOLDER.set(folder);
}

/// Returns the quarantines that could not be stored, by the name of the engine; they last as long as this process.
fn unstored() -> MutexGuard<'static, BTreeMap<String, Quarantine>> {
    static UNKEPT: Mutex<BTreeMap<String, Quarantine>> = Mutex::new(BTreeMap::new());
    UNKEPT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the path of a quarantine file. `Manifest` has validated the name.
fn file_of(folder: &Path, name: &str) -> PathBuf {
    folder.join(format!("{name}.json"))
}

/// Quarantines this version of the engine.
pub(super) fn put(engine: &LocatedEngine, failures: u32, last: &str) {
    let name = &engine.manifest().name;
    let reason = last.chars().take(REASON_MAX).collect();
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let found = Quarantine { identity: engine.identity(), failures, reason, since };
    let kept = FOLDER.get().is_some_and(|folder| {
        write(&file_of(folder, name), &found)
            .inspect_err(|error| tracing::warn!(%error, name, "cannot store the failures of the engine"))
            .is_ok()
    });
    if !kept {
        unstored().insert(name.clone(), found);
    }
}

fn write(path: &Path, found: &Quarantine) -> io::Result<()> {
    path.parent().map(fs::create_dir_all).transpose()?;
    let bytes = serde_json::to_vec_pretty(found)?;
    bottega_image::write_whole(path, &bytes).map_err(io::Error::other)
}

/// Returns the quarantine of this version of an engine; `None`: it is not quarantined, or its file cannot be read, as
/// the log then says.
pub fn quarantine(engine: &LocatedEngine) -> Option<Quarantine> {
    let name = &engine.manifest().name;
    let kept = FOLDER.get().and_then(|folder| {
        let path = file_of(folder, name);
        read(&path).unwrap_or_else(|problem| {
            tracing::warn!("{} is ignored, and the engine is used: {problem}", path.display());
            None
        })
    });
    kept.or_else(|| unstored().get(name).cloned()).filter(|found| found.identity == engine.identity())
}

/// Reads an untrusted file: limits its size, checks its form, and removes control characters.
fn read(path: &Path) -> Result<Option<Quarantine>, String> {
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error.to_string()),
        Ok(found) if !found.is_file() => return Err("it is not a regular file".to_owned()),
        Ok(found) if found.len() > BYTES_MAX => return Err("it is too large".to_owned()),
        Ok(_) => {}
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(BYTES_MAX).read_to_end(&mut bytes))
        .map_err(|error| error.to_string())?;
    let mut found: Quarantine = serde_json::from_slice(&bytes).map_err(|error| error.to_string())?;
    let signs = found.reason.chars().map(|sign| if sign.is_control() && sign != '\n' { ' ' } else { sign });
    found.reason = signs.take(REASON_MAX).collect();
    Ok(Some(found))
}

/// Returns an error if an engine is quarantined.
pub(super) fn check(engine: &LocatedEngine) -> Result<(), EngineFault> {
    match quarantine(engine) {
        Some(Quarantine { failures, reason, .. }) => {
            let name = Some(engine.manifest().name.clone());
            Err(EngineFault::Quarantined { failures, last: reason, name })
        }
        None => Ok(()),
    }
}

/// Ends the quarantine of an engine, in all its versions. Returns `true` if it was quarantined.
///
/// # Errors
/// The quarantine file cannot be removed.
pub fn release(name: &str) -> io::Result<bool> {
    let was_unstored = unstored().remove(name).is_some();
    let removed = FOLDER.get().map_or(Ok(()), |folder| fs::remove_file(file_of(folder, name)));
    match removed {
        Ok(()) => Ok(FOLDER.get().is_some() || was_unstored),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(was_unstored),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found() -> Quarantine {
        Quarantine { identity: "toy 1".to_owned(), failures: 3, reason: "it fell".to_owned(), since: 7 }
    }

    #[test]
    fn what_is_kept_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = file_of(&folder.path().join("engines"), "toy");
        assert_eq!(read(&path), Ok(None));
        write(&path, &found()).unwrap();
        assert_eq!(read(&path), Ok(Some(found())));
    }

    #[test]
    fn files_that_are_not_ours_are_no_quarantine() {
        let folder = tempfile::tempdir().unwrap();
        let path = file_of(folder.path(), "toy");
        let whole = serde_json::to_string(&found()).unwrap();
        let broken = [
            String::new(),
            whole[..20].to_owned(),
            whole.replace("toy", "\\ud800"),
            whole.replace(":3", ":-1"),
            whole.replace("since", "sense"),
            "[".repeat(60_000),
            " ".repeat(BYTES_MAX as usize + 1),
        ];
        for text in broken {
            fs::write(&path, &text).unwrap();
            assert!(read(&path).is_err(), "{:?}", text.get(..40));
        }
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        assert!(read(&path).is_err());
    }

    #[test]
    fn nothing_in_a_file_steers_a_terminal() {
        let folder = tempfile::tempdir().unwrap();
        let path = file_of(folder.path(), "toy");
        write(&path, &Quarantine { reason: "\u{1b}[2J\u{7}gone".to_owned(), ..found() }).unwrap();
        assert_eq!(read(&path).unwrap().unwrap().reason, " [2J gone");
    }
}
