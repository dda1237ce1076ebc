//! The queue of notifications: a thread sends them in order, and reports those that fail.

use std::{
    sync::{Arc, mpsc},
    thread::{self, JoinHandle},
};

use bottega_platform::desktop;

use super::{
    command,
    message::Notification,
    post::{Poster, Secret},
    target::{EventSubscription, NotificationTarget},
};
use crate::error::CliError;

/// The maximum number of waiting notifications; further ones are dropped and reported.
const WAITING_MAX: usize = 256;

/// A callback that reports a notification that was not sent, with the reason.
pub(super) type TellLoss = Arc<dyn Fn(String) + Send + Sync>;

/// A queue of notifications and the thread that sends them.
pub(super) struct Notifier {
    queue: Option<mpsc::SyncSender<Notification>>,
    thread: Option<JoinHandle<()>>,
    tell_loss: TellLoss,
}

impl Notifier {
    /// Starts the thread that sends notifications.
    ///
    /// - `tell_loss`: called for each notification that was not sent.
    pub(super) fn start(
        subscriptions: Vec<EventSubscription>,
        secret: Option<Secret>,
        tell_loss: TellLoss,
    ) -> Result<Self, CliError> {
        let has_url =
            subscriptions.iter().any(|subscription| matches!(subscription.target, NotificationTarget::Url(_)));
        let poster = has_url.then(|| Poster::new(secret)).transpose()?;
        let (queue, waiting) = mpsc::sync_channel::<Notification>(WAITING_MAX);
        let tell = Arc::clone(&tell_loss);
        let send = move || {
            for notification in waiting {
                for subscription in
                    subscriptions.iter().filter(|subscription| subscription.events.contains(&notification.kind))
                {
                    if let Err(why) = deliver(&subscription.target, &notification, poster.as_ref()) {
                        tell(format!(
                            "cannot notify {} of `{}`: {why}",
                            subscription.target.label(),
                            notification.event
                        ));
                    }
                }
            }
        };
        let thread = thread::Builder::new().name("notifications".to_owned()).spawn(send).map_err(|error| {
            CliError::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
        })?;
        Ok(Self { queue: Some(queue), thread: Some(thread), tell_loss })
    }

    /// Queues a notification.
    pub(super) fn send(&self, notification: Notification) {
        let Some(queue) = &self.queue else { return };
        if let Err(error) = queue.try_send(notification) {
            let (mpsc::TrySendError::Full(lost) | mpsc::TrySendError::Disconnected(lost)) = error;
            (self.tell_loss)(format!("the notification of `{}` is lost: too many notifications wait", lost.event));
        }
    }
}

impl Drop for Notifier {
    /// Waits until all are sent: each takes a few attempts of a few seconds at most.
    fn drop(&mut self) {
        self.queue = None;
        if let Some(thread) = self.thread.take() {
            // The thread has already reported its panic.
            _ = thread.join();
        }
    }
}

fn deliver(target: &NotificationTarget, notification: &Notification, poster: Option<&Poster>) -> Result<(), String> {
    match (target, poster) {
        (NotificationTarget::Url(url), Some(poster)) => poster.post(url, notification),
        (NotificationTarget::Url(_), None) => Ok(()),
        (NotificationTarget::Command(line), _) => command::run(line, notification),
        (NotificationTarget::Desktop, _) => desktop::notify(&notification.title(), &notification.text()),
    }
}
