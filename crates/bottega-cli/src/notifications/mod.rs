//! Notifications to other programs: by HTTP, a command, or the desktop. They are sent by the process that submitted the job or
//! hosts the farm; their failure never stops the work.
//!
//! | what | where |
//! |---|---|
//! | `--on` and related options | `args.rs`, `target.rs` |
//! | the message | `message.rs` |
//! | detection of events: of one image, of all jobs of a farm | `picture_watch.rs`, `farm_watch.rs` |
//! | delivery: the queue, HTTP, a command, the desktop | `notifier.rs`, `post.rs`, `command.rs` |

mod args;
mod command;
mod farm_watch;
mod message;
mod notifier;
mod picture_watch;
mod post;
mod target;

pub(crate) use self::{args::NotificationArgs, farm_watch::watch_farm, picture_watch::PictureWatch};
