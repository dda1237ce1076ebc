//! Checks beside the tests: farms and browsers leave a third of the processors' time, and take what they need first.

use std::{
    env,
    fs::{self, File},
    path::PathBuf,
    process::{Child, Command},
};

use anyhow::{Context, Result, ensure};

use crate::bars::root;

/// A command of xtask that runs with what processors others leave, and builds in a folder of its own: two calls of cargo in one
/// folder wait for each other.
pub(crate) struct CheckBeside {
    name: &'static str,
    child: Child,
    log: PathBuf,
}

impl CheckBeside {
    /// # Errors
    /// It cannot be started.
    pub(crate) fn start(name: &'static str) -> Result<Self> {
        let folder = root().join("target").join(name);
        fs::create_dir_all(&folder)?;
        let log = folder.join("log");
        let file = File::create(&log).with_context(|| format!("cannot write {}", log.display()))?;
        let mut command = Command::new("nice");
        command.args(["-n", "19"]).arg(env::current_exe()?).arg(name);
        command.current_dir(root()).env("CARGO_TARGET_DIR", &folder);
        let child = command.stdout(file.try_clone()?).stderr(file).spawn();
        eprintln!("+ cargo xtask {name}, beside the tests");
        Ok(Self { name, child: child.with_context(|| format!("cannot start {name}"))?, log })
    }

    /// Waits for its end, and shows what it said.
    ///
    /// # Errors
    /// It failed.
    pub(crate) fn finish(mut self) -> Result<()> {
        let status = self.child.wait()?;
        print!("{}", fs::read_to_string(&self.log)?);
        ensure!(status.success(), "cargo xtask {} failed", self.name);
        Ok(())
    }
}
