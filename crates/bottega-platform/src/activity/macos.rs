//! The owner of a Mac, as its input devices show him. **Untested.**

use std::{
    process::{Command, Stdio},
    time::Duration,
};

/// For how long nobody has touched this machine.
pub fn idle() -> Option<Duration> {
    let mut command = Command::new("/usr/sbin/ioreg");
    command.args(["-c", "IOHIDSystem", "-d", "4"]).stdin(Stdio::null()).stderr(Stdio::null());
    let output = command.output().ok().filter(|output| output.status.success())?;
    // `"HIDIdleTime" = 1234567`, nanoseconds.
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = text.lines().find(|line| line.contains("\"HIDIdleTime\""))?;
    line.rsplit('=').next()?.trim().parse().ok().map(Duration::from_nanos)
}

/// By the time at which a terminal was read last: not told here; what is typed is seen by [`idle`].
pub fn idle_terminals() -> Option<Duration> {
    None
}
