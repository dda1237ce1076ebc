//! The activity of the machine's owner: time since the last input, and processors kept busy by other programs.

#[cfg(target_os = "linux")]
mod linux;
#[cfg(target_os = "macos")]
mod macos;
#[cfg(not(target_os = "linux"))]
mod others_listed;
#[cfg(not(any(target_os = "linux", target_os = "macos")))]
mod windows;

#[cfg(target_os = "linux")]
pub use linux::{BusyClock, idle, idle_terminals};
#[cfg(target_os = "macos")]
pub use macos::{idle, idle_terminals};
#[cfg(not(target_os = "linux"))]
pub use others_listed::BusyClock;
#[cfg(not(any(target_os = "linux", target_os = "macos")))]
pub use windows::{idle, idle_terminals};
