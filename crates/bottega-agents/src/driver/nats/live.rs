//! Live messages: sent to all current listeners, neither stored nor confirmed.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use async_nats::{Client, connection::State};
use tokio::runtime::Handle;
use tokio_stream::StreamExt;

use super::names;

/// Largest number of bytes of a live message: well below the size that servers accept by default.
pub const LIVE_BYTES_MAX: usize = 512 << 10;

/// Longest time for which sending blocks.
const SEND_TIME: Duration = Duration::from_millis(500);

/// The live messages of a farm, by channel. All members may send and read them, guests may not.
#[derive(Clone)]
pub struct NatsLive {
    client: Client,
    farm: String,
    handle: Handle,
}

/// A subscription to a channel; dropping it ends the subscription.
#[derive(Debug)]
pub struct LiveSubscription {
    is_over: Arc<AtomicBool>,
    task: tokio::task::AbortHandle,
}

impl Drop for LiveSubscription {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.task.abort();
    }
}

impl NatsLive {
    pub(super) fn new(client: Client, farm: &str, handle: Handle) -> Self {
        Self { client, farm: farm.to_owned(), handle }
    }

    /// Sends a message to all listeners of a channel. Blocks for half a second at most if too many messages wait for
    /// the connection; a message is lost if there are no listeners or the farm does not answer.
    ///
    /// - `channel`: the name of the channel; its parts are separated by `/`.
    /// - `bytes`: at most [`LIVE_BYTES_MAX`].
    ///
    /// # Panics
    /// In debug builds, if `bytes` is longer.
    pub fn send(&self, channel: &str, bytes: Vec<u8>) {
        debug_assert!(bytes.len() <= LIVE_BYTES_MAX, "a live message of {} bytes", bytes.len());
        let subject = names::live(&self.farm, channel);
        if self.client.connection_state() != State::Connected {
            return;
        }
        let publish = async { tokio::time::timeout(SEND_TIME, self.client.publish(subject, bytes.into())).await };
        if !matches!(self.handle.block_on(publish), Ok(Ok(()))) {
            tracing::debug!(channel, "a live message was lost");
        }
    }

    /// Calls a function with each message to a channel, until the subscription is dropped; never, with a warning in the
    /// log, if the subscription fails.
    ///
    /// - `tell`: runs on the thread of the link, so it must return quickly.
    pub fn listen(&self, channel: &str, tell: impl Fn(&[u8]) + Send + 'static) -> LiveSubscription {
        let (client, subject) = (self.client.clone(), names::live(&self.farm, channel));
        let is_over = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&is_over);
        let task = self.handle.spawn(async move {
            let mut messages = match client.subscribe(subject.clone()).await {
                Ok(messages) => messages,
                Err(error) => return tracing::warn!(subject, %error, "cannot read live messages"),
            };
            while let Some(message) = messages.next().await {
                if ended.load(Ordering::Relaxed) {
                    return;
                }
                tell(&message.payload);
            }
        });
        LiveSubscription { is_over, task: task.abort_handle() }
    }
}
