//! The measured cost of work on the devices of this machine, stored between runs.

use std::{fs, path::PathBuf};

use bottega_hra::{CostBook, HraReport};

use bottega_platform::folders::state_folder;

/// Costs of another version are ignored: their units may differ.
const VERSION: &str = env!("CARGO_PKG_VERSION");

fn path() -> PathBuf {
    state_folder().join("costs.json")
}

/// Reads the costs that earlier runs have learned; `None`: there is no usable file.
pub(crate) fn read() -> Option<CostBook> {
    let text = fs::read_to_string(path()).ok()?;
    CostBook::from_json(&text, VERSION)
        .inspect_err(|error| tracing::debug!(%error, "cannot use the stored costs of devices; they are measured again"))
        .ok()
}

/// Stores the costs that a run has learned for its devices in this user's file. A failure is only logged.
pub fn keep(report: &HraReport) {
    let mut book = read().unwrap_or_else(|| CostBook::new(VERSION));
    for resource in &report.resources {
        for &(primitive, cost) in &resource.costs {
            book.set(&resource.descriptor.name, primitive, cost);
        }
    }
    let path = path();
    _ = path.parent().map(fs::create_dir_all);
    if let Err(error) = bottega_image::write_whole(&path, book.to_json().as_bytes()) {
        // The next run learns them again.
        tracing::debug!(%error, "cannot store the costs of devices");
    }
}
