//! The Debian package, made by `dpkg-deb` from the staged tree.

use std::{fs, os::unix::fs::PermissionsExt, path::PathBuf, process::Command};

use anyhow::{Context, Result};

use super::{
    stage::{Stage, set_modes},
    tools::{VERSION, call, commit_time, compress, output},
};
use crate::bars::root;

/// The template of the control file, without version, size and C library.
const CONTROL: &str = include_str!("../../../packaging/debian/control");

/// Builds the package.
pub(super) fn build(stage: &Stage) -> Result<PathBuf> {
    let time = commit_time()?;
    let date = output(Command::new("date").args(["-R", "-u", "-d", &format!("@{time}")]))?;
    let changes = format!(
        "bottega ({VERSION}) unstable; urgency=medium\n\n  * See CHANGELOG.md of the sources.\n\n -- {}  {}",
        maintainer().context("packaging/debian/control has a maintainer")?,
        String::from_utf8(date)?
    );
    // A native package has its own changelog.
    let changelog = stage.place("usr/share/doc/bottega/changelog")?;
    fs::write(&changelog, changes)?;
    compress(&changelog)?;
    fs::copy(root().join("packaging/debian/copyright"), stage.place("usr/share/doc/bottega/copyright")?)?;
    // Both texts are in `copyright`, or in every Debian system.
    for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
        fs::remove_file(stage.place(&format!("usr/share/doc/bottega/{name}"))?)?;
    }
    compress(&stage.place("usr/share/doc/bottega/THIRD-PARTY-LICENCES.txt")?)?;
    set_modes(&stage.folder)?;
    let program = fs::read(stage.place("usr/bin/bottega")?)?;
    let size = output(Command::new("du").args(["-sk"]).arg(&stage.folder))?;
    let size = String::from_utf8(size)?.split_whitespace().next().unwrap_or("0").to_owned();
    let library = libc_version(&program).context("the program names no version of the C library")?;
    let library = format!("{}.{}", library.0, library.1);
    let control = [("VERSION", VERSION), ("SIZE", &size), ("LIBC", &library)]
        .iter()
        .fold(CONTROL.to_owned(), |text, (name, value)| text.replace(&format!("@{name}@"), value));
    let control_file = stage.place("DEBIAN/control")?;
    fs::write(control_file, control)?;
    for script in ["postinst", "prerm", "postrm"] {
        let target = stage.place(&format!("DEBIAN/{script}"))?;
        fs::copy(root().join("packaging/debian").join(script), &target)?;
        fs::set_permissions(&target, fs::Permissions::from_mode(0o755))?;
    }
    let sums = output(
        Command::new("sh").current_dir(&stage.folder).args(["-c", "find usr -type f | LC_ALL=C sort | xargs md5sum"]),
    )?;
    fs::write(stage.place("DEBIAN/md5sums")?, sums)?;
    let file = stage.out.join(format!("bottega_{VERSION}_amd64.deb"));
    let mut build = Command::new("dpkg-deb");
    build.args(["--root-owner-group", "-Zxz", "--build"]).arg(&stage.folder).arg(&file).env("SOURCE_DATE_EPOCH", time);
    call(&mut build)?;
    Ok(file)
}

fn maintainer() -> Option<&'static str> {
    CONTROL.lines().find_map(|line| line.strip_prefix("Maintainer: "))
}

/// Returns the newest version of the C library that a program needs: versions such as `GLIBC_2.34` are stored in it as text.
fn libc_version(program: &[u8]) -> Option<(u32, u32)> {
    const START: &[u8] = b"\0GLIBC_";
    let places = (0..program.len().saturating_sub(START.len())).filter(|&at| program[at..].starts_with(START));
    let read = |at: usize| {
        let text = program[at + START.len()..].split(|byte| *byte == 0).next()?;
        let mut parts = std::str::from_utf8(text).ok()?.split('.');
        Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
    };
    places.filter_map(read).max()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_symbol_decides_the_c_library() {
        let program = b"..\0GLIBC_2.17\0x\0GLIBC_2.2.5\0GLIBC_2.34\0NOT_GLIBC_2.90\0";
        assert_eq!(libc_version(program), Some((2, 34)));
        assert_eq!(libc_version(b"nothing"), None);
    }

    #[test]
    fn the_control_file_has_what_is_filled_in() {
        assert!(["@VERSION@", "@SIZE@", "@LIBC@"].iter().all(|name| CONTROL.contains(name)));
        assert!(maintainer().is_some_and(|it| it.contains('@')));
    }
}
