//! Notifications of the work to other programs: HTTP, a command, the desktop. Sent by the process that asked for a picture or has
//! the farm; what becomes of them never stops the work.
//!
//! | what | where |
//! |---|---|
//! | `--on` and the options beside it | `args.rs`, `target.rs` |
//! | what is told | `message.rs` |
//! | when: of one picture, of all jobs of a farm | `picture_watch.rs`, `farm_watch.rs` |
//! | how: the queue, HTTP, a command, the desktop | `notifier.rs`, `post.rs`, `command.rs` |

mod args;
mod command;
mod farm_watch;
mod message;
mod notifier;
mod picture_watch;
mod post;
mod target;

pub(crate) use self::{args::NotificationArgs, farm_watch::watch_farm, picture_watch::PictureWatch};
