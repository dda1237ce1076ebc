//! Search for an installed engine.

use std::{
    env,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use super::{
    child::{ChildOutput, GuardedChild, Program},
    error::EngineFault,
    manifest::{Argument, Limits, Manifest, SearchStep, Values, Version},
    scratch::Scratch,
    shelf::ShelfEntry,
};

/// The environment variable with the Python of all workers: a program, or the folder of a virtual environment.
const PYTHON: &str = "BOTTEGA_ENGINE_PYTHON";
/// The paths of Python in a virtual environment.
const OF_ENVIRONMENT: &[&str] = &["bin/python3", "bin/python", "Scripts/python.exe"];
/// The time in which an engine must print its version: large Python modules load slowly from a cold disk.
const CHECK_TIME: Duration = Duration::from_secs(90);

/// An engine that is installed on this machine.
#[derive(Clone, Debug)]
pub struct LocatedEngine {
    /// The manifest and its files.
    pub entry: ShelfEntry,
    /// The path of the program.
    pub program: PathBuf,
    /// The installed version.
    pub version: Version,
    /// The index of the search step that found it.
    way: usize,
}

impl LocatedEngine {
    /// Searches for the engine by all steps of its manifest. Returns the first program found in a supported version.
    ///
    /// # Errors
    /// The engine is not installed, or only in unsupported versions: with the places searched, and how to install it;
    /// or the folder for temporary files cannot be created.
    pub fn find(entry: &ShelfEntry) -> Result<Self, EngineFault> {
        let manifest = &entry.manifest;
        let scratch = Scratch::new()?;
        let mut tried = Vec::new();
        let mut unfit = None;
        for (way_index, way) in manifest.find.iter().enumerate() {
            let candidates = candidates(way);
            if candidates.is_empty() {
                tried.push(format!("no {} in PATH", way.programs.join(" or ")));
            }
            for program in candidates {
                match ask(way, &program, scratch.path()) {
                    Err(why) => tried.push(format!("{}: {why}", program.display())),
                    Ok(version) if !manifest.versions.include(&version) => unfit = Some(version),
                    Ok(version) => return Ok(Self { entry: entry.clone(), program, version, way: way_index }),
                }
            }
        }
        let (title, install) = (manifest.title.clone(), install_hint(manifest));
        Err(match unfit {
            Some(found) => {
                EngineFault::Version { title, found: found.to_string(), wanted: manifest.versions.to_string(), install }
            }
            None => EngineFault::NotFound { title, tried: tried.join("; "), install },
        })
    }

    /// Returns the manifest of the engine.
    pub fn manifest(&self) -> &Manifest {
        &self.entry.manifest
    }

    /// Returns name, version and a hash of all files that affect its pictures: machines with equal identities render equal
    /// pictures.
    pub fn identity(&self) -> String {
        let bytes = self.entry.identity();
        // FNV-1a, by Fowler, Noll and Vo: detects accidental differences.
        let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
        });
        format!("{} {}, manifest {hash:016x}", self.manifest().name, self.version)
    }

    /// Returns the search step that found the engine.
    pub(super) fn way(&self) -> &SearchStep {
        &self.entry.manifest.find[self.way]
    }
}

/// Returns the candidate programs of a step: first the one of its variable, then the Python of all workers, then those on PATH.
fn candidates(way: &SearchStep) -> Vec<PathBuf> {
    let set = |name: &str| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let is_python = way.programs.iter().any(|name| name == "python3");
    let python = is_python.then(|| set(PYTHON)).flatten().map(|named| python_of(&named));
    let named = way.variable.as_deref().and_then(set).into_iter().chain(python);
    let folders: Vec<PathBuf> = env::var_os("PATH").map(|path| env::split_paths(&path).collect()).unwrap_or_default();
    let found = way.programs.iter().filter_map(|name| {
        let path = Path::new(name);
        if path.is_absolute() {
            return path.is_file().then(|| path.to_owned());
        }
        let in_folder = |folder: &PathBuf| [name.clone(), format!("{name}.exe")].map(|name| folder.join(name));
        folders.iter().flat_map(in_folder).find(|path| path.is_file())
    });
    let mut all: Vec<PathBuf> = named.chain(found).collect();
    all.dedup();
    all
}

/// Returns the Python itself, or the one in the folder of a virtual environment.
fn python_of(named: &Path) -> PathBuf {
    let within = OF_ENVIRONMENT.iter().map(|name| named.join(name)).find(|program| program.is_file());
    within.unwrap_or_else(|| named.to_owned())
}

/// Returns how to install the module that a Python worker reports as missing.
pub(super) fn module_hint(engine: &LocatedEngine, said: &str) -> Option<String> {
    let (_, rest) = said.split_once("No module named ")?;
    let name: String = rest
        .trim_start_matches(['\'', '"'])
        .chars()
        .take_while(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'))
        .collect();
    (!name.is_empty()).then(|| format!("to install it: {} -m pip install {name}", engine.program.display()))
}

/// Runs the version check of a step with a program.
fn ask(way: &SearchStep, program: &Path, scratch: &Path) -> Result<Version, String> {
    let values: Values = [("program", program.display().to_string())].into();
    let line = Argument::fill_all(&way.check, &values);
    let outcome = run(&line, scratch, way, &[], CHECK_TIME);
    let (said, ended_well) = outcome.map_err(|fault| fault.report())?;
    if !ended_well {
        let reason = said.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it failed without a message");
        return Err(reason.trim().to_owned());
    }
    let version = way.version.find(&said).and_then(Version::parse);
    version.ok_or_else(|| format!("its output contains no version: {:?}", said.lines().next().unwrap_or_default()))
}

/// Runs a program to its end. Returns its output, and `true` if it succeeded.
pub(super) fn run(
    line: &[String],
    scratch: &Path,
    way: &SearchStep,
    reads: &[PathBuf],
    time: Duration,
) -> Result<(String, bool), EngineFault> {
    let begun = Instant::now();
    let SearchStep { environment, inherit, writes, .. } = way;
    let program = Program { line, scratch, environment, inherit, writes, reads, limits: Limits::default() };
    let mut child = GuardedChild::spawn(&program)?;
    child.close_stdin();
    loop {
        match child.listen()? {
            ChildOutput::End if let Some(ended_well) = child.outcome() => {
                // Its last output may still be in the pipe.
                std::thread::sleep(Duration::from_millis(20));
                return Ok((child.log().text(), ended_well));
            }
            ChildOutput::End => std::thread::sleep(Duration::from_millis(5)),
            ChildOutput::Line(_) | ChildOutput::Silence => {}
        }
        if begun.elapsed() > time {
            let log = child.log().text();
            return Err(EngineFault::TimeOut { seconds: time.as_secs_f64(), what: "an end", log });
        }
    }
}

/// Returns the manifest's install instructions for this system as a clause, such as `to install it: …`; if there are none,
/// `see its home page`.
pub fn install_hint(manifest: &Manifest) -> String {
    let system = std::fs::read_to_string("/etc/os-release").unwrap_or_default();
    let value = |key: &str| {
        let line = system.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        line.unwrap_or_default().trim_matches('"').to_owned()
    };
    let (id, like) = (value("ID"), value("ID_LIKE"));
    let names = std::iter::once(id.as_str()).chain(like.split_whitespace()).chain([env::consts::OS, "any"]);
    let hint = names.filter_map(|name| manifest.install.get(name)).next();
    hint.map_or_else(|| "see its home page".to_owned(), |hint| format!("to install it: {hint}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_python_is_named_by_itself_or_by_its_environment() {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("bin/python3");
        std::fs::create_dir(folder.path().join("bin")).unwrap();
        std::fs::write(&program, "").unwrap();
        assert_eq!(python_of(folder.path()), program);
        assert_eq!(python_of(&program), program);
        assert_eq!(python_of(Path::new("/nowhere")), Path::new("/nowhere"));
    }

    #[test]
    fn a_missing_module_is_named_in_the_hint() {
        let entry = crate::external::Shelf::open(&[]).get("mitsuba").cloned().unwrap();
        let version = Version::parse("1.0").unwrap();
        let engine = LocatedEngine { entry, program: "/v/bin/python3".into(), version, way: 0 };
        let hint = |said: &str| module_hint(&engine, said);
        let numpy = Some("to install it: /v/bin/python3 -m pip install numpy".to_owned());
        assert_eq!(hint("ModuleNotFoundError: No module named 'numpy'"), numpy);
        assert_eq!(hint("X is not installed for /v: No module named 'numpy.core'"), numpy);
        assert_eq!(hint("No module named "), None);
        assert_eq!(hint("out of memory"), None);
    }
}
