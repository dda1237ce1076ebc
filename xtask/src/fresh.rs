//! A test on a fresh machine: the README's two commands in a bare Debian that has only Rust, without the caller's home.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;

use crate::{
    bars::root,
    needs::{answers, run},
};

/// The system packages that Rust itself needs: a linker, the C library, and certificates to reach the registries.
const RUST_NEEDS: &str = "ca-certificates,gcc,libc6-dev";
/// The home of the user of the fresh machine.
const HOME: &str = "home/new";
/// The certificates of this machine, which the fresh machine uses, too.
const CERTIFICATES: &str = "/etc/ssl/certs/ca-certificates.crt";

/// Options of `cargo xtask fresh`.
#[derive(Args)]
pub(crate) struct FreshArgs {
    /// The Debian release.
    #[arg(long, default_value = "bookworm")]
    release: String,
    /// Only commands that contain this text.
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
    /// Keep the system's folder (`target/fresh/root`).
    #[arg(long)]
    keep: bool,
}

/// Creates the system, clones the committed sources, and runs the commands in turn.
///
/// # Errors
/// A command failed, or the system cannot be created: that requires root, on Linux.
pub(crate) fn fresh(args: &FreshArgs) -> Result<()> {
    let system = make_system(&args.release)?;
    let outcome = readme_commands(&root().join("README.md"))?
        .iter()
        .filter(|command| command.contains(&args.only))
        .try_for_each(|command| system.run(command));
    if args.keep {
        println!("the system is kept in {}", system.folder.display());
    } else {
        fs::remove_dir_all(&system.folder).context("cannot remove the system")?;
    }
    outcome
}

/// Returns the commands of the README's section *Two commands*.
fn readme_commands(readme: &Path) -> Result<Vec<String>> {
    let text = fs::read_to_string(readme)?;
    let section = text.split("## Two commands").nth(1).context("the README has no section `Two commands`")?;
    let block = section.split("```sh\n").nth(1).and_then(|rest| rest.split("```").next());
    let lines = block.context("the section has no block of commands")?.lines();
    let commands: Vec<String> = lines.filter(|line| !line.trim().is_empty()).map(str::to_owned).collect();
    ensure!(commands.len() == 2, "the section `Two commands` has {} commands", commands.len());
    Ok(commands)
}

/// A bare system in a folder.
struct System {
    folder: PathBuf,
    /// The folder of the Rust toolchain, on this machine.
    toolchain: PathBuf,
}

fn make_system(release: &str) -> Result<System> {
    ensure!(cfg!(target_os = "linux"), "a fresh machine can be made on Linux only");
    if !answers("mmdebstrap", &["--version"]) {
        println!("a fresh machine is made by mmdebstrap: installing it (apt-get)");
        ensure!(run("apt-get", &["update"]) && run("apt-get", &["install", "-y", "mmdebstrap"]), "cannot install it");
    }
    let place = root().join("target/fresh");
    fs::create_dir_all(&place)?;
    // The archive of the new system, created once.
    let archive = place.join(format!("{release}.tar"));
    if !archive.is_file() {
        let partial = place.join("partial.tar");
        let include = format!("--include={RUST_NEEDS}");
        call("mmdebstrap", &["--quiet", "--variant=minbase", &include, release, text(&partial)?])?;
        fs::rename(partial, &archive)?;
    }
    let folder = place.join("root");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir(&folder)?;
    // Device nodes are not needed: the devices of this machine are mounted.
    call("tar", &["--extract", "--exclude=./dev/*", "--file", text(&archive)?, "--directory", text(&folder)?])?;
    for file in [CERTIFICATES, "/etc/resolv.conf", "/etc/hosts"] {
        if Path::new(file).is_file() {
            fs::copy(file, folder.join(&file[1..])).with_context(|| format!("cannot copy {file}"))?;
        }
    }
    for inner in ["opt/rust", "proc", "sys", "dev", HOME] {
        fs::create_dir_all(folder.join(inner))?;
    }
    let clone = folder.join(HOME).join("bottega");
    call("git", &["clone", "--quiet", "--no-hardlinks", text(&root())?, text(&clone)?])?;
    let shown = Command::new(env!("CARGO").replace("cargo", "rustc")).args(["--print", "sysroot"]).output()?;
    let toolchain = PathBuf::from(String::from_utf8(shown.stdout)?.trim());
    Ok(System { folder, toolchain })
}

impl System {
    /// Runs one command as the system's user; prints its duration.
    fn run(&self, command: &str) -> Result<()> {
        println!("fresh$ {command}");
        let start = Instant::now();
        // Use a separate process namespace, so that no process outlives the command.
        let script = "set -e
            mount --make-rprivate /
            mount --bind \"$TOOLCHAIN\" \"$SYSTEM/opt/rust\"
            mount -t proc proc \"$SYSTEM/proc\"
            mount --rbind /sys \"$SYSTEM/sys\"
            mount --rbind /dev \"$SYSTEM/dev\"
            mount -t tmpfs tmpfs \"$SYSTEM/tmp\"
            exec chroot \"$SYSTEM\" /bin/sh -c \"cd ~/bottega && $COMMAND\"";
        let mut unshare = Command::new("unshare");
        unshare.args(["--mount", "--pid", "--fork", "--kill-child", "/bin/sh", "-c", script]);
        unshare.env_clear().envs(kept_variables());
        unshare.env("SYSTEM", &self.folder).env("TOOLCHAIN", &self.toolchain).env("COMMAND", command);
        unshare.env("HOME", format!("/{HOME}")).env("LANG", "C.UTF-8");
        unshare.env("PATH", "/opt/rust/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin");
        let status = unshare.stdin(Stdio::null()).status().context("cannot start unshare")?;
        println!("  {:.0} s, {status}", Duration::as_secs_f64(&start.elapsed()));
        if !status.success() {
            bail!("on a fresh machine this fails: {command}");
        }
        Ok(())
    }
}

/// Returns the variables by which this machine reaches the registries: proxies and certificates.
fn kept_variables() -> Vec<(String, String)> {
    let is_proxy = |name: &str| ["http_proxy", "https_proxy", "no_proxy"].contains(&name.to_lowercase().as_str());
    let mut kept: Vec<_> = env::vars().filter(|(name, _)| is_proxy(name)).collect();
    if Path::new(CERTIFICATES).is_file() {
        let names = ["SSL_CERT_FILE", "CARGO_HTTP_CAINFO", "PIP_CERT"];
        kept.extend(names.map(|name| (name.to_owned(), CERTIFICATES.to_owned())));
    }
    kept
}

fn call(program: &str, arguments: &[&str]) -> Result<()> {
    let status = Command::new(program).args(arguments).stdin(Stdio::null()).status();
    let status = status.with_context(|| format!("cannot start {program}"))?;
    ensure!(status.success(), "{program} {} failed", arguments.join(" "));
    Ok(())
}

fn text(path: &Path) -> Result<&str> {
    path.to_str().with_context(|| format!("{} is no UTF-8", path.display()))
}
