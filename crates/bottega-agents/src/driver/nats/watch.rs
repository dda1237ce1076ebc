//! All entries below a name, and every change to one from then on.

use std::time::Duration;

use async_nats::{
    Client,
    jetstream::{
        Message,
        consumer::{AckPolicy, DeliverPolicy, ReplayPolicy, push},
        kv,
    },
};
use tokio_stream::StreamExt;

/// After what time a watch that broke is begun again.
const AGAIN_AFTER: Duration = Duration::from_millis(250);
/// How often one who follows entries is asked whether it is enough, when nothing happens.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// The header by which a message says that an entry is no more.
const OPERATION: &str = "KV-Operation";

/// What one is told who follows entries.
pub(super) enum News {
    /// An entry as it is, or is from now on.
    Entry(Written),
    /// All entries that there were have been told.
    CaughtUp,
    /// Nothing has happened for a while.
    Nothing,
}

/// A writing of an entry.
pub(super) struct Written {
    /// Its key, as the server has it.
    pub(super) key: String,
    pub(super) revision: u64,
    /// `None`: it was taken out.
    pub(super) value: Option<bytes::Bytes>,
}

/// Tells of all entries below a name, and from then on of every change, until `tell` says that it is enough. After an
/// interruption all are told again.
pub(super) async fn follow(client: &Client, store: &kv::Store, below: &str, mut tell: impl FnMut(News) -> bool) {
    while tell(News::Nothing) {
        match open(client, store, below).await {
            Ok((mut messages, waiting)) => {
                // Where nothing has ever been written no entry will say that it is the last.
                if waiting == 0 && !tell(News::CaughtUp) {
                    return;
                }
                loop {
                    let goes_on = match tokio::time::timeout(LOOK_EVERY, messages.next()).await {
                        Err(_) => tell(News::Nothing),
                        Ok(Some(Ok(message))) => match written(store, &message) {
                            Some((entry, is_last)) => tell(News::Entry(entry)) && (!is_last || tell(News::CaughtUp)),
                            None => true,
                        },
                        Ok(_) => break,
                    };
                    if !goes_on {
                        return;
                    }
                }
            }
            Err(reason) => tracing::debug!(reason, "entries cannot be watched"),
        }
        tokio::time::sleep(AGAIN_AFTER).await;
    }
}

/// A consumer of the entries below a name, the last of each first, and how many of these there are. What the server then
/// says of it is compared with what was asked.
async fn open(client: &Client, store: &kv::Store, below: &str) -> Result<(push::Ordered, u64), String> {
    let filter_subject = format!("{}{below}", store.prefix);
    let wanted = push::OrderedConfig {
        deliver_subject: client.new_inbox(),
        description: Some("entries of a farm, and what changes".to_owned()),
        filter_subject: filter_subject.clone(),
        replay_policy: ReplayPolicy::Instant,
        deliver_policy: DeliverPolicy::LastPerSubject,
        ..push::OrderedConfig::default()
    };
    let consumer = store.stream.create_consumer(wanted).await.map_err(|error| error.to_string())?;
    let (got, waiting) = (&consumer.cached_info().config, consumer.cached_info().num_pending);
    let same = [
        ("filter", got.filter_subject == filter_subject),
        ("first message", got.deliver_policy == DeliverPolicy::LastPerSubject),
        ("pace", got.replay_policy == ReplayPolicy::Instant && got.rate_limit == 0),
        ("way to confirm", got.ack_policy == AckPolicy::None),
        ("flow control", got.flow_control && !got.idle_heartbeat.is_zero()),
        ("content", !got.headers_only),
    ];
    if let Some((other, _)) = same.iter().find(|(_, same)| !same) {
        tracing::warn!("the consumer of {filter_subject} has another {other} than was asked for");
        return Err(format!("the consumer has another {other} than was asked for"));
    }
    let messages = consumer.messages().await.map_err(|error| error.to_string())?;
    Ok((messages, waiting))
}

/// What a message says, and whether it is the last of those that were there.
fn written(store: &kv::Store, message: &Message) -> Option<(Written, bool)> {
    let info = message.info().ok()?;
    let key = message.subject.strip_prefix(&*store.prefix)?.to_owned();
    let operation = message.headers.as_ref().and_then(|headers| headers.get(OPERATION));
    let is_there = operation.is_none_or(|operation| operation.as_str() == "PUT");
    let value = is_there.then(|| message.payload.clone());
    Some((Written { key, revision: info.stream_sequence, value }, info.pending == 0))
}
