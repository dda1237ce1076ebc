//! File access control for a child process: which files it may read and write, enforced by the kernel where it supports
//! Landlock.
//!
//! Readable: system folders, the engine's installation, and the files of the scene. Writable: only the scratch folder,
//! which is also its home and its folder for temporary files. Nothing else in the user's home can be opened.

use std::{
    env,
    ffi::OsString,
    fs,
    path::{Component, Path, PathBuf},
};

use bottega_platform::permissions;

use super::program::{PASSED_ON, Program, USER_BASE};

/// The environment variable with further readable folders, separated as in `PATH`, for installations elsewhere.
pub(super) const MORE: &str = "BOTTEGA_ENGINE_READS";
/// System folders with programs, their data, and information on the machine.
const SYSTEM: &[&str] = &[
    "/bin",
    "/sbin",
    "/lib",
    "/lib32",
    "/lib64",
    "/usr",
    "/opt",
    "/nix",
    "/gnu",
    "/snap",
    "/proc",
    "/sys",
    "/var/cache/fontconfig",
    "/run/current-system",
    "/run/opengl-driver",
];
/// Entries of `/etc` that engines may not read.
const PRIVATE: &[&str] = &["ssh", "ssl", "sudoers.d", "wireguard", "NetworkManager", "cups", "krb5.keytab"];
const OF_SSL: &[&str] = &["/etc/ssl/openssl.cnf", "/etc/ssl/certs"];
/// Devices that may be read and written.
const DEVICES: &[&str] = &[
    "/dev/null",
    "/dev/zero",
    "/dev/full",
    "/dev/random",
    "/dev/urandom",
    "/dev/tty",
    "/dev/shm",
    "/dev/dri",
    "/dev/kfd",
];
/// Names of folders in which an installation keeps its programs.
const OF_PROGRAMS: &[&str] = &["bin", "sbin", "shims", "Scripts"];
/// Folders of a shared installation prefix that belong to its programs.
const OF_SHARED: &[&str] = &["lib", "lib64", "libexec"];
/// The most symbolic links from a program's name to the program.
const LINKS_MAX: usize = 16;

/// The files that a child may access.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Fence {
    pub(super) reads: Vec<PathBuf>,
    pub(super) writes: Vec<PathBuf>,
    /// Folders of which only the names of their entries may be read.
    pub(super) listed: Vec<PathBuf>,
    /// True if `/proc` may be written, which creating user namespaces needs.
    pub(super) makes_users: bool,
}

impl Fence {
    /// Returns the access of a program.
    pub(super) fn of(program: &Program<'_>) -> Self {
        let home = env::var_os("HOME").map(PathBuf::from).filter(|home| home.is_absolute());
        let place = HomeFolder { home: home.as_deref() };
        let mut reads: Vec<PathBuf> = SYSTEM.iter().chain(OF_SSL).map(PathBuf::from).collect();
        reads.extend(settings());
        for (index, word) in program.line.iter().enumerate() {
            let path = Path::new(word);
            if path.is_absolute() && index == 0 {
                reads.extend(place.installation(path));
            } else if path.is_absolute() {
                reads.extend(place.narrowed(path));
            }
        }
        let passed = PASSED_ON.iter().copied().filter(|name| *name != "PATH" && *name != "XDG_DATA_DIRS");
        let passed = passed.chain(program.inherit.iter().map(String::as_str)).chain([MORE]).filter_map(env::var_os);
        let set = program.environment.values().map(OsString::from);
        for value in passed.chain(set) {
            let named = env::split_paths(&value).filter(|path| path.is_absolute());
            reads.extend(named.flat_map(|path| place.narrowed(&path)));
        }
        reads.extend(home.iter().map(|home| home.join(USER_BASE).join("lib")));
        reads.extend(program.reads.iter().flat_map(|path| place.narrowed(path)));
        let mut writes: Vec<PathBuf> = DEVICES.iter().map(PathBuf::from).collect();
        let devices = fs::read_dir("/dev").into_iter().flatten().flatten();
        writes.extend(
            devices
                .map(|device| device.path())
                .filter(|path| path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"nvidia"))),
        );
        writes.push(program.scratch.to_owned());
        let named = program.writes.iter().filter_map(env::var_os);
        writes.extend(named.flat_map(|value| env::split_paths(&value).collect::<Vec<_>>()));
        Self { reads, writes, listed: vec!["/dev".into()], makes_users: super::guard::makes_users() }
    }
}

/// Returns the entries of `/etc` that all users may read.
fn settings() -> Vec<PathBuf> {
    let entries = fs::read_dir("/etc").into_iter().flatten().flatten();
    let open = entries.filter(|entry| {
        let name = entry.file_name();
        !PRIVATE.iter().any(|private| name == *private) && permissions::is_for_all(&entry.path())
    });
    open.map(|entry| entry.path()).collect()
}

/// A machine with the user's home, of which as little as possible is readable.
struct HomeFolder<'a> {
    home: Option<&'a Path>,
}

impl HomeFolder<'_> {
    /// Returns true if a folder is not of one engine alone: the user's home, a folder above it, or the user's installation
    /// prefix.
    fn is_shared(&self, folder: &Path) -> bool {
        let is_root = folder.components().all(|part| matches!(part, Component::RootDir | Component::Prefix(_)));
        let temporary = env::temp_dir();
        let known = self.home.into_iter().chain([temporary.as_path()]);
        is_root
            || known.clone().any(|known| known.starts_with(folder))
            || self.home.is_some_and(|home| folder == home.join(USER_BASE))
    }

    /// Returns what to open for a named path: of a shared folder, only the entries that are not hidden. The root folder is
    /// taken literally.
    fn narrowed(&self, path: &Path) -> Vec<PathBuf> {
        if path == Path::new("/") || !self.is_shared(path) || !path.is_dir() {
            return vec![path.to_owned()];
        }
        let is_home = self.home == Some(path);
        let entries = fs::read_dir(path).into_iter().flatten().flatten();
        let shown = entries.filter(|entry| {
            let is_hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
            !is_hidden && (is_home || entry.path().is_file())
        });
        shown.map(|entry| entry.path()).collect()
    }

    /// Returns the installation of a program, under each of the names that lead to it.
    fn installation(&self, program: &Path) -> Vec<PathBuf> {
        let (mut found, mut next) = (Vec::new(), Some(program.to_owned()));
        while let Some(path) = next.filter(|_| found.len() < 8 * LINKS_MAX) {
            self.around(&path, &mut found);
            let folder = path.parent().unwrap_or(Path::new("/"));
            next = fs::read_link(&path).ok().map(|target| folder.join(target));
        }
        // Folders on the path may be links, too.
        if let Ok(real) = program.canonicalize() {
            self.around(&real, &mut found);
        }
        found
    }

    /// Adds the installation of a program of this name.
    fn around(&self, program: &Path, found: &mut Vec<PathBuf>) {
        found.push(program.to_owned());
        let Some(folder) = program.parent() else { return };
        let is_of_programs = folder.file_name().is_some_and(|name| OF_PROGRAMS.iter().any(|known| name == *known));
        let prefix = folder.parent().filter(|_| is_of_programs);
        match prefix {
            Some(prefix) if self.is_shared(prefix) => {
                found.push(folder.to_owned());
                found.extend(OF_SHARED.iter().map(|name| prefix.join(name)));
            }
            Some(prefix) => {
                found.push(prefix.to_owned());
                // A virtual environment names the installation whose libraries it uses.
                let text = fs::read_to_string(prefix.join("pyvenv.cfg")).unwrap_or_default();
                let base = text.lines().find_map(|line| line.split_once('=').filter(|(key, _)| key.trim() == "home"));
                if let Some(base) =
                    base.map(|(_, folder)| PathBuf::from(folder.trim())).filter(|base| base.is_absolute())
                {
                    found.extend(base.parent().filter(|base| !self.is_shared(base)).map(Path::to_owned));
                }
            }
            // A single script has no installation folder.
            None if is_script(program) || self.is_shared(folder) => {}
            None => found.push(folder.to_owned()),
        }
    }
}

fn is_script(program: &Path) -> bool {
    use std::io::Read;
    let mut begin = [0; 2];
    fs::File::open(program).is_ok_and(|mut file| file.read_exact(&mut begin).is_ok()) && begin == *b"#!"
}

pub(super) use kernel::{ChildGuard, is_enforced, spawn};

#[cfg(target_os = "linux")]
mod kernel {
    use std::{
        io,
        process::{Child, Command},
        sync::{OnceLock, mpsc},
        thread,
    };

    use landlock::{
        ABI, Access, AccessFs, CompatLevel, Compatible, PathBeneath, PathFd, Ruleset, RulesetAttr, RulesetCreatedAttr,
        RulesetError, RulesetStatus, path_beneath_rules,
    };

    use super::Fence;

    /// The Landlock version: access rights that it does not know are not restricted.
    const KNOWN: ABI = ABI::V5;

    /// A guard that must live as long as the child: the system kills the child when the thread that started it ends.
    #[derive(Debug)]
    pub(in super::super) struct ChildGuard {
        _release: mpsc::Sender<()>,
    }

    /// Starts a program within its fence, on a thread with the same restrictions.
    pub(in super::super) fn spawn(mut command: Command, fence: Fence) -> io::Result<(Child, ChildGuard)> {
        let (release, held) = mpsc::channel::<()>();
        let (sender, receiver) = mpsc::sync_channel(1);
        thread::Builder::new().name("engine".to_owned()).spawn(move || {
            let started = restrict(&fence).map_err(io::Error::other).and_then(|_| command.spawn());
            // The caller waits for it.
            _ = sender.send(started);
            _ = held.recv();
        })?;
        let started = receiver.recv().map_err(io::Error::other)?;
        Ok((started?, ChildGuard { _release: release }))
    }

    fn restrict(fence: &Fence) -> Result<RulesetStatus, RulesetError> {
        let all = AccessFs::from_all(KNOWN);
        let mut ruleset = Ruleset::default()
            .set_compatibility(CompatLevel::BestEffort)
            .handle_access(all)?
            .create()?
            .add_rules(path_beneath_rules(&fence.reads, AccessFs::from_read(KNOWN)))?
            .add_rules(path_beneath_rules(&fence.writes, all))?;
        for folder in &fence.listed {
            if let Ok(folder) = PathFd::new(folder) {
                ruleset = ruleset.add_rule(PathBeneath::new(folder, AccessFs::ReadDir))?;
            }
        }
        if let Some(processes) = fence.makes_users.then(|| PathFd::new("/proc")).and_then(Result::ok) {
            ruleset = ruleset.add_rule(PathBeneath::new(processes, AccessFs::WriteFile))?;
        }
        Ok(ruleset.restrict_self()?.ruleset)
    }

    /// Returns true if the kernel enforces the fence. Checked once.
    pub(in super::super) fn is_enforced() -> bool {
        static FOUND: OnceLock<bool> = OnceLock::new();
        *FOUND.get_or_init(|| {
            let tried = thread::spawn(|| restrict(&Fence::default())).join();
            let status = tried.ok().and_then(Result::ok);
            tracing::debug!(?status, "whether engines are fenced in");
            status.is_some_and(|status| status != RulesetStatus::NotEnforced)
        })
    }
}

#[cfg(not(target_os = "linux"))]
mod kernel {
    use std::{
        io,
        process::{Child, Command},
    };

    use super::Fence;

    /// A guard without effect: the fence is not supported on this system.
    #[derive(Debug)]
    pub(in super::super) struct ChildGuard;

    /// Starts a program without a fence.
    pub(in super::super) fn spawn(mut command: Command, _fence: Fence) -> io::Result<(Child, ChildGuard)> {
        Ok((command.spawn()?, ChildGuard))
    }

    /// Always `false` on this system.
    pub(in super::super) fn is_enforced() -> bool {
        false
    }
}
