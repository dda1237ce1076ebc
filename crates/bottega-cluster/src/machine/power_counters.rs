//! The energy counters of a machine's processors (RAPL), from Linux's `/sys/class/powercap`.

use std::{
    env, fs,
    path::{Path, PathBuf},
};

/// The environment variable that overrides the folder.
const FOLDER_VARIABLE: &str = "BOTTEGA_POWERCAP";
const FOLDER: &str = "/sys/class/powercap";

/// The energy counter of a processor package.
#[derive(Debug)]
struct PackageCounter {
    file: PathBuf,
    /// The value in µJ at which it wraps to 0.
    range: u64,
    last: u64,
}

/// The energy counters of all packages.
#[derive(Debug, Default)]
pub(crate) struct PowerCounters {
    packages: Vec<PackageCounter>,
}

impl PowerCounters {
    /// Returns the readable counters of this machine; often only root may read them.
    pub(crate) fn of_machine() -> Self {
        let named = env::var_os(FOLDER_VARIABLE).filter(|folder| !folder.is_empty()).map(PathBuf::from);
        Self::in_folder(&named.unwrap_or_else(|| PathBuf::from(FOLDER)))
    }

    /// Returns the counters of whole packages in a folder; those of parts, or of the whole system, count the same energy twice.
    fn in_folder(folder: &Path) -> Self {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let mut packages: Vec<PackageCounter> = entries.filter_map(|path| PackageCounter::open(&path)).collect();
        packages.sort_by(|a, b| a.file.cmp(&b.file));
        Self { packages }
    }

    /// Returns true if there are no counters.
    pub(crate) fn is_empty(&self) -> bool {
        self.packages.is_empty()
    }

    /// Returns the energy used since the last call, in µJ. `None`: a counter cannot be read any more, so the sum is incomplete.
    ///
    /// Call it at least every few minutes: a counter may wrap only once between calls.
    pub(crate) fn advance(&mut self) -> Option<u64> {
        let mut sum = Some(0);
        for package in &mut self.packages {
            let used = package.advance();
            sum = sum.zip(used).map(|(sum, used)| sum + used);
        }
        sum.filter(|_| !self.packages.is_empty())
    }
}

impl PackageCounter {
    fn open(zone: &Path) -> Option<Self> {
        let name = fs::read_to_string(zone.join("name")).ok()?;
        if !name.starts_with("package") {
            return None;
        }
        let (file, range) = (zone.join("energy_uj"), number(&zone.join("max_energy_range_uj"))?);
        let last = number(&file)?;
        Some(Self { file, range, last })
    }

    fn advance(&mut self) -> Option<u64> {
        let now = number(&self.file)?;
        let before = std::mem::replace(&mut self.last, now);
        Some(now.checked_sub(before).unwrap_or_else(|| self.range.saturating_sub(before).saturating_add(now)))
    }
}

fn number(file: &Path) -> Option<u64> {
    fs::read_to_string(file).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(folder: &Path, zone: &str, name: &str, microjoules: u64) {
        let zone = folder.join(zone);
        fs::create_dir_all(&zone).unwrap();
        fs::write(zone.join("name"), format!("{name}\n")).unwrap();
        fs::write(zone.join("max_energy_range_uj"), "1000\n").unwrap();
        fs::write(zone.join("energy_uj"), format!("{microjoules}\n")).unwrap();
    }

    #[test]
    fn packages_are_added_up_their_parts_are_not_and_a_counter_may_begin_again() {
        let folder = tempfile::tempdir().unwrap();
        zone(folder.path(), "intel-rapl:0", "package-0", 100);
        zone(folder.path(), "intel-rapl:1", "package-1", 900);
        zone(folder.path(), "intel-rapl:0:0", "core", 50);
        zone(folder.path(), "intel-rapl:2", "psys", 50);
        fs::create_dir(folder.path().join("intel-rapl")).unwrap();
        let mut counters = PowerCounters::in_folder(folder.path());
        assert!(!counters.is_empty());
        assert_eq!(counters.advance(), Some(0));
        zone(folder.path(), "intel-rapl:0", "package-0", 350);
        zone(folder.path(), "intel-rapl:1", "package-1", 40);
        zone(folder.path(), "intel-rapl:0:0", "core", 900);
        assert_eq!(counters.advance(), Some(250 + 100 + 40));
        fs::remove_file(folder.path().join("intel-rapl:1/energy_uj")).unwrap();
        assert_eq!(counters.advance(), None, "what is known is not all");
    }

    #[test]
    fn a_machine_without_counters_knows_nothing() {
        let folder = tempfile::tempdir().unwrap();
        zone(folder.path(), "intel-rapl:0", "package-0", 100);
        fs::remove_file(folder.path().join("intel-rapl:0/max_energy_range_uj")).unwrap();
        let mut counters = PowerCounters::in_folder(folder.path());
        assert!(counters.is_empty() && counters.advance().is_none());
        assert!(PowerCounters::in_folder(Path::new("nowhere")).is_empty());
    }
}
