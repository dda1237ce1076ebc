//! The staged files of a package, and their tarball.

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result};

use super::tools::{VERSION, call, commit_time, compress, output};
use crate::bars::root;

/// The shells, and the place where each looks for completions.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "usr/share/bash-completion/completions/bottega"),
    ("zsh", "usr/share/zsh/vendor-completions/_bottega"),
    ("fish", "usr/share/fish/vendor_completions.d/bottega.fish"),
];

/// The staged tree of a package.
pub(super) struct Stage {
    /// The folder of the tree, with `usr` and others below.
    pub(super) folder: PathBuf,
    /// The folder for packages.
    pub(super) out: PathBuf,
}

impl Stage {
    /// Adds the program, man pages, completions, units and licences.
    pub(super) fn fill(&self, program: &Path, licences: &str) -> Result<()> {
        if self.folder.exists() {
            fs::remove_dir_all(&self.folder)?;
        }
        let target = self.place("usr/bin/bottega")?;
        fs::copy(program, &target).with_context(|| format!("cannot copy {}", program.display()))?;
        call(Command::new("strip").arg("--strip-unneeded").arg(&target))?;
        let pages = self.place("usr/share/man/man1")?;
        let made = output(Command::new(&target).args(["manual", "pages"]).arg(&pages))
            .context("the program makes no man pages: is it of this version?")?;
        println!("{}", String::from_utf8_lossy(&made).trim());
        for page in fs::read_dir(&pages)? {
            compress(&page?.path())?;
        }
        for (shell, place) in COMPLETIONS {
            fs::write(self.place(place)?, output(Command::new(&target).args(["completions", shell]))?)?;
        }
        for unit in ["bottega-up.service", "bottega-join.service"] {
            fs::copy(
                root().join("packaging/systemd").join(unit),
                self.place(&format!("usr/lib/systemd/system/{unit}"))?,
            )?;
        }
        for name in ["README.md", "LICENSE-MIT", "LICENSE-APACHE"] {
            fs::copy(root().join(name), self.place(&format!("usr/share/doc/bottega/{name}"))?)?;
        }
        fs::write(self.place("usr/share/doc/bottega/THIRD-PARTY-LICENCES.txt")?, licences)?;
        set_modes(&self.folder)
    }

    /// Returns the path of a file in the tree, and creates its folder.
    pub(super) fn place(&self, name: &str) -> Result<PathBuf> {
        let place = self.folder.join(name);
        fs::create_dir_all(place.parent().context("it has a folder")?)?;
        Ok(place)
    }

    /// Packs the tree without `usr/`, to be unpacked into `/usr/local` or anywhere else.
    pub(super) fn tarball(&self) -> Result<PathBuf> {
        let name = format!("bottega-{VERSION}-x86_64-linux");
        let file = self.out.join(format!("{name}.tar.gz"));
        let (time, rename) = (format!("--mtime=@{}", commit_time()?), format!("--transform=s,^\\.,{name},"));
        let mut tar = Command::new("tar");
        tar.args(["--create", "--gzip", "--sort=name", "--owner=0", "--group=0", "--numeric-owner", &time, &rename]);
        call(tar.arg("--file").arg(&file).arg("--directory").arg(self.folder.join("usr")).arg("."))?;
        Ok(file)
    }
}

/// Makes all files readable for everybody, and programs executable.
pub(super) fn set_modes(folder: &Path) -> Result<()> {
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755))?;
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let is_program = path.parent().is_some_and(|it| it.ends_with("usr/bin"));
        if path.is_dir() {
            set_modes(&path)?;
        } else {
            fs::set_permissions(&path, fs::Permissions::from_mode(if is_program { 0o755 } else { 0o644 }))?;
        }
    }
    Ok(())
}
