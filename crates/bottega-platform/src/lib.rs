//! The differences between Linux, macOS and Windows, behind one face.
//!
//! Whoever needs something of the system asks here, so that no other crate asks which system it is on; `cargo xtask test` holds
//! them to it. Each function says what it gives where a system does not tell. Linux is tested; Windows and
//! macOS are compiled and **untested**.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | folders of settings and of state | `src/folders.rs` |
//! | who may read a file | `src/permissions.rs` |
//! | room on a disk | `src/disk.rs` |
//! | time that the processors spend | `src/processor_time.rs` |
//! | priority of this process, processors that it may use | `src/scheduling.rs` |
//! | notifications on the desktop | `src/desktop.rs` |
//! | a child and all that it has started | `src/processes.rs`, `src/processes/` |
//! | what stands above figures: their command, and the machine that they are of | `src/run_head.rs` |
//! | standard error of libraries that write to it themselves | `src/standard_error.rs` |
//! | the machine's owner: touched when, how busy | `src/activity.rs`, `src/activity/` |

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
