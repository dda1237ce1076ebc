//! Scratch folders for running engines.
//!
//! A process holds its folder by locking a file in it; the system releases the lock when the process ends, in whatever way.
//! So folders of killed processes are detected reliably, and removed by the next process that starts an engine.

use std::{
    fs::{self, File},
    io,
    path::Path,
    sync::Once,
};

use tempfile::TempDir;

use super::error::EngineFault;

const PREFIX: &str = "bottega-engine-";
const HELD: &str = ".held";

/// A scratch folder, removed when this is dropped.
#[derive(Debug)]
pub(super) struct Scratch {
    // Dropped before the folder: some systems cannot remove open files.
    _held: File,
    folder: TempDir,
}

impl Scratch {
    /// Creates an empty folder, and removes abandoned ones.
    pub(super) fn new() -> Result<Self, EngineFault> {
        static SWEPT: Once = Once::new();
        SWEPT.call_once(|| sweep(&std::env::temp_dir()));
        Self::below(&std::env::temp_dir()).map_err(EngineFault::Scratch)
    }

    fn below(place: &Path) -> io::Result<Self> {
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(place)?;
        let making = folder.path().join(".making");
        let held = File::create(&making)?;
        // Without file locks, the folder is used unlocked; a sweep cannot lock it either, and leaves it alone.
        let _ = held.try_lock();
        // Rename last: a sweep must see the file only when it is locked.
        fs::rename(making, folder.path().join(HELD))?;
        Ok(Self { _held: held, folder })
    }

    /// Returns the path of the folder.
    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes the folders in `place` whose processes have ended. Failures are only logged.
fn sweep(place: &Path) {
    let Ok(entries) = fs::read_dir(place) else { return };
    for entry in entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with(PREFIX)) {
        let (folder, held) = (entry.path(), entry.path().join(HELD));
        // Do not follow links, open pipes, or touch a folder that is being created.
        let is_ours = entry.file_type().is_ok_and(|kind| kind.is_dir())
            && fs::symlink_metadata(&held).is_ok_and(|file| file.is_file());
        if is_ours && File::open(&held).is_ok_and(|file| file.try_lock().is_ok()) {
            match fs::remove_dir_all(&folder) {
                Ok(()) => tracing::debug!(folder = %folder.display(), "removed what a killed process had left"),
                Err(error) => tracing::debug!(folder = %folder.display(), %error, "left as it is"),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_removes_what_nobody_holds_and_nothing_else() {
        let place = tempfile::tempdir().expect("a folder");
        let live = Scratch::below(place.path()).expect("a folder");
        let left = Scratch::below(place.path()).expect("a folder");
        let left_path = left.path().to_owned();
        // As after a kill: the lock is released, but the folder stays.
        let Scratch { _held: held, folder } = left;
        drop(held);
        let _ = folder.keep();
        let in_the_making = place.path().join("bottega-engine-new");
        let of_others = place.path().join("elsewhere");
        for folder in [&in_the_making, &of_others] {
            fs::create_dir(folder).expect("a folder");
        }
        fs::write(of_others.join(HELD), "").expect("a file");
        sweep(place.path());
        assert!(!left_path.exists());
        assert!(live.path().join(HELD).is_file() && in_the_making.is_dir() && of_others.is_dir());
        let path = live.path().to_owned();
        drop(live);
        assert!(!path.exists());
    }
}
