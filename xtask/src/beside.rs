//! Checks that run beside the tests: farms and browsers leave a third of the processors' time unused, so the checks run first.

use std::{
    env,
    fs::{self, File},
    path::PathBuf,
    process::{Child, Command},
    time::Instant,
};

use anyhow::{Context, Result, ensure};

use crate::{bars::root, cost};

/// A command of xtask that runs on processors left idle by others. It uses their build output for the host (macros, build
/// scripts), so it must not start before they have compiled: two compiling calls of cargo wait for each other.
pub(crate) struct CheckBeside {
    name: &'static str,
    child: Child,
    begun: Instant,
    log: PathBuf,
}

impl CheckBeside {
    /// Starts the command.
    ///
    /// # Errors
    /// The command cannot be started.
    pub(crate) fn start(name: &'static str) -> Result<Self> {
        let log = root().join("target").join(name).with_extension("log");
        let file = File::create(&log).with_context(|| format!("cannot write {}", log.display()))?;
        let mut command = Command::new("nice");
        command.args(["-n", "19"]).arg(env::current_exe()?).arg(name);
        let child = command.current_dir(root()).stdout(file.try_clone()?).stderr(file).spawn();
        eprintln!("+ cargo xtask {name}, beside the tests");
        Ok(Self { name, child: child.with_context(|| format!("cannot start {name}"))?, begun: Instant::now(), log })
    }

    /// Waits for the command, and shows its output.
    ///
    /// # Errors
    /// The command failed.
    pub(crate) fn finish(mut self) -> Result<()> {
        let (status, _) = cost::wait(&format!("xtask {}", self.name), &mut self.child, self.begun)?;
        print!("{}", fs::read_to_string(&self.log)?);
        ensure!(status.success(), "cargo xtask {} failed", self.name);
        Ok(())
    }
}
