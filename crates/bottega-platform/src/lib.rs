//! The differences between Linux, macOS and Windows behind one interface.
//!
//! All system-specific code is here; no other crate distinguishes between systems, which `cargo xtask test` checks. Each function
//! documents its result where a system lacks the feature. Linux is tested; Windows and macOS are compiled and **untested**.
//!
//! # Modules
//!
//! | subject | files |
//! |---|---|
//! | folders of settings and of state | `src/folders.rs` |
//! | read permissions of files | `src/permissions.rs` |
//! | space on a disk | `src/disk.rs` |
//! | processor time | `src/processor_time.rs` |
//! | priority of this process, processors that it may use | `src/scheduling.rs` |
//! | notifications on the desktop | `src/desktop.rs` |
//! | a child process and its descendants | `src/processes.rs`, `src/processes/` |
//! | the header of measurements: command and machine | `src/run_head.rs` |
//! | standard error of libraries that write to it themselves | `src/standard_error.rs` |
//! | the machine's owner: time since the last input, load | `src/activity.rs`, `src/activity/` |

pub mod activity;
pub mod desktop;
pub mod disk;
pub mod folders;
pub mod permissions;
pub mod processes;
pub mod processor_time;
pub mod run_head;
pub mod scheduling;
pub mod standard_error;
