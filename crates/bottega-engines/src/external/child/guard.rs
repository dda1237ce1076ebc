//! Wrappers from util-linux that isolate a child, as far as they are installed and allowed.

use std::{
    process::{Command, Stdio},
    sync::OnceLock,
};

use crate::external::manifest::Limits;

/// The wrappers that work on this machine. Checked once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Guards {
    limits: bool,
    dies_with_parent: bool,
    /// The command for namespaces of network and processes: as root, or as the current user.
    namespaces: Option<&'static [&'static str]>,
}

const LIMITS: &[&str] = &["prlimit", "--core=0"];
const DIES_WITH_PARENT: &[&str] = &["setpriv", "--pdeathsig", "KILL", "--"];
const AS_ROOT: &[&str] = &["unshare", "--net", "--pid", "--fork", "--kill-child=KILL", "--"];
const AS_USER: &[&str] =
    &["unshare", "--user", "--map-current-user", "--net", "--pid", "--fork", "--kill-child=KILL", "--"];
/// The first process of a PID namespace ignores its own signals, such as `abort`. So make it a shell.
const FIRST: &[&str] = &["/bin/sh", "-c", "\"$@\"; exit $?", "engine"];

fn guards() -> Guards {
    static FOUND: OnceLock<Guards> = OnceLock::new();
    *FOUND.get_or_init(|| {
        if !cfg!(target_os = "linux") {
            return Guards::default();
        }
        let guards = Guards {
            limits: works(LIMITS),
            dies_with_parent: works(DIES_WITH_PARENT),
            namespaces: [AS_ROOT, AS_USER].into_iter().find(|line| works(line)),
        };
        tracing::debug!(?guards, "how engines are shut in");
        guards
    })
}

fn works(line: &[&str]) -> bool {
    let silent = Command::new(line[0])
        .args(&line[1..])
        .arg("true")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    silent.is_ok_and(|status| status.success())
}

/// Returns the wrapper commands to put before a program.
pub(super) fn wrapper(limits: &Limits) -> Vec<String> {
    let guards = guards();
    let mut line: Vec<String> = Vec::new();
    let mut push = |more: &[&str]| line.extend(more.iter().map(|&part| part.to_owned()));
    if guards.limits {
        push(LIMITS);
        if limits.output_mib > 0 {
            push(&[&format!("--fsize={}", limits.output_mib << 20)]);
        }
    }
    if guards.dies_with_parent {
        push(DIES_WITH_PARENT);
    }
    if let Some(namespaces) = guards.namespaces {
        push(namespaces);
        push(FIRST);
    }
    line
}

/// Returns true if the namespaces need a user namespace, and so write access to `/proc`.
pub(super) fn makes_users() -> bool {
    guards().namespaces == Some(AS_USER)
}

/// Returns true if engines have no access to the network on this machine: on Linux, if `unshare` is installed and may create
/// namespaces.
pub fn is_shut_in() -> bool {
    guards().namespaces.is_some()
}
