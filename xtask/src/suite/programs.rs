//! The test programs of the workspace, compiled and listed by cargo.

use std::{collections::BTreeSet, io::BufReader, path::PathBuf, process::Stdio, time::Instant};

use anyhow::{Context, Result, ensure};
use cargo_metadata::{Message, TargetKind};

use super::groups::{PARTS, TestGroup, beside};
use crate::{bars::root, cargo, cost};

/// A test program that has been compiled.
#[derive(Clone, Debug)]
pub(crate) struct TestProgram {
    pub(crate) package: String,
    /// `true`: the unit tests of the package, not those of its folder `tests`.
    pub(crate) is_unit: bool,
    pub(crate) file: PathBuf,
    /// The folder in which cargo runs it: that of the package.
    pub(crate) folder: PathBuf,
}

/// Compiles the test programs of a group, or of the whole workspace.
///
/// # Errors
/// Something does not compile.
pub(crate) fn compile(group: Option<TestGroup>) -> Result<Vec<TestProgram>> {
    let mut arguments = vec!["test", "--no-run", "--message-format=json-render-diagnostics"];
    match group {
        None => arguments.push("--workspace"),
        Some(group) => {
            let parts = PARTS.iter().filter(|part| part.group == group).map(|part| part.package);
            let packages: BTreeSet<&str> = parts.chain(beside(group).iter().copied()).collect();
            packages.into_iter().for_each(|package| arguments.extend(["--package", package]));
        }
    }
    eprintln!("+ cargo {}", arguments.join(" "));
    let begun = Instant::now();
    let mut command = cargo::command();
    command.args(&arguments).current_dir(root()).stdin(Stdio::null()).stdout(Stdio::piped());
    let mut child = command.spawn().context("cannot start cargo test")?;
    let output = child.stdout.take().context("cargo test has no output")?;
    let mut programs = Vec::new();
    for message in Message::parse_stream(BufReader::new(output)) {
        let Message::CompilerArtifact(artifact) = message.context("cannot read what cargo test prints")? else {
            continue;
        };
        let Some(file) = artifact.executable.filter(|_| artifact.profile.test) else { continue };
        let folder = artifact.manifest_path.parent().context("a manifest lies in a folder")?;
        programs.push(TestProgram {
            package: folder.file_name().context("a package has a folder")?.to_owned(),
            is_unit: !artifact.target.kind.contains(&TargetKind::Test),
            file: file.into_std_path_buf(),
            folder: folder.as_std_path().to_owned(),
        });
    }
    let (status, cost) = cost::wait("compile tests", &mut child, begun)?;
    ensure!(status.success(), "the tests do not compile");
    eprintln!("  {cost}");
    Ok(programs)
}
