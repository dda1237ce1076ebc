//! The activity of a Mac's owner by its input devices. **Untested.**

use std::{
    process::{Command, Stdio},
    time::Duration,
};

/// Returns the time since the owner's last input; `None`: unknown.
pub fn idle() -> Option<Duration> {
    let mut command = Command::new("/usr/sbin/ioreg");
    command.args(["-c", "IOHIDSystem", "-d", "4"]).stdin(Stdio::null()).stderr(Stdio::null());
    let output = command.output().ok().filter(|output| output.status.success())?;
    // For example `"HIDIdleTime" = 1234567`, in nanoseconds.
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = text.lines().find(|line| line.contains("\"HIDIdleTime\""))?;
    line.rsplit('=').next()?.trim().parse().ok().map(Duration::from_nanos)
}

/// Returns `None`: not available here; [`idle`] includes typing in terminals.
pub fn idle_terminals() -> Option<Duration> {
    None
}
