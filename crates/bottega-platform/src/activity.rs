//! What the owner of the machine does: when somebody touched it, and how many processors others keep at work.

#[cfg(not(target_os = "linux"))]
#[path = "activity/others_listed.rs"]
mod others_listed;
#[cfg(target_os = "linux")]
#[path = "activity/linux.rs"]
mod system;
#[cfg(target_os = "macos")]
#[path = "activity/macos.rs"]
mod system;
#[cfg(not(any(target_os = "linux", target_os = "macos")))]
#[path = "activity/windows.rs"]
mod system;

pub use system::{BusyClock, idle, idle_terminals};
