//! Watches: all entries below a name, and then every change of one.

use std::{ops::Range, time::Duration};

use async_nats::{
    Client, HeaderMap,
    jetstream::{
        Message,
        consumer::{AckPolicy, DeliverPolicy, ReplayPolicy, push},
        kv,
        stream::LastRawMessageErrorKind,
    },
};
use bytes::Bytes;
use tokio::time::Instant;
use tokio_stream::StreamExt;

/// Delay before a broken watch is restarted.
const AGAIN_AFTER: Duration = Duration::from_millis(250);
/// Interval of calls to a follower without updates.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Maximum number of questions per second to the server about missing numbers. If entries are rewritten faster than
/// they are reported, numbers are missing between nearly all of them: then everything is reported again.
const QUESTIONS_MAX: u32 = 200;
/// The header of a message that says that an entry was removed.
const OPERATION: &str = "KV-Operation";

/// An update for a follower.
pub(super) enum WatchUpdate {
    /// A report of all existing entries begins, followed by changes.
    Begins,
    /// The current or new state of an entry.
    Entry(WrittenEntry),
    /// All existing entries have been reported.
    CaughtUp,
    /// Nothing has happened for some time.
    Nothing,
}

/// A write of an entry.
pub(super) struct WrittenEntry {
    /// The key of the entry on the server.
    pub(super) key: String,
    pub(super) revision: u64,
    /// `None`: it was removed.
    pub(super) value: Option<Bytes>,
}

/// Reports all entries below a name, and then every change, until `tell` returns false. After an interruption all are
/// reported again.
///
/// Neither the number of pending entries, which the server gives with each one, nor complete delivery by a consumer is
/// reliable: servers (2.9.10) may count wrongly and never reach 0 if entries are written while a consumer starts, and
/// under load entries were skipped. So the last number received is compared with that of the last existing entry, and
/// if numbers are missing between two entries they are requested from the server.
pub(super) async fn follow(client: &Client, store: &kv::Store, below: &str, mut tell: impl FnMut(WatchUpdate) -> bool) {
    let filter = format!("{}{below}", store.prefix);
    while tell(WatchUpdate::Nothing) {
        // Existing entries are reported by the last write of each name; later writes must all be reported
        let Ok(there) = last_written(store, &filter).await else {
            tokio::time::sleep(AGAIN_AFTER).await;
            continue;
        };
        match open(client, store, &filter).await {
            Ok(messages) => {
                if !tell(WatchUpdate::Begins) || !listen(store, &filter, messages, there, &mut tell).await {
                    return;
                }
            }
            Err(reason) => tracing::debug!(reason, "cannot watch entries"),
        }
        tokio::time::sleep(AGAIN_AFTER).await;
    }
}

/// Reports what a consumer delivers until it fails. Returns true to continue with another consumer.
///
/// - `there`: the number of the last write before the consumer started.
async fn listen(
    store: &kv::Store,
    filter: &str,
    mut messages: push::Ordered,
    there: u64,
    tell: &mut impl FnMut(WatchUpdate) -> bool,
) -> bool {
    // Entries arrive in the order of their writes: with this one, all that existed at the start have arrived
    let Ok(mut last) = last_written(store, filter).await else { return true };
    let (mut last_reported, mut is_caught_up) = (0, false);
    // A write was missing at the last check
    let mut is_late = false;
    let mut questions = Questions { begun: Instant::now(), count: 0 };
    loop {
        if last_reported >= last && !std::mem::replace(&mut is_caught_up, true) && !tell(WatchUpdate::CaughtUp) {
            return false;
        }
        match tokio::time::timeout(LOOK_EVERY, messages.next()).await {
            Ok(Some(Ok(message))) => {
                let Some(entry) = written(store, &message) else { continue };
                let missing = last_reported.max(there) + 1..entry.revision;
                if !missing.is_empty() {
                    if !questions.may_ask() {
                        return true;
                    }
                    let Ok(passed_over) = passed_over(store, filter, missing).await else { return true };
                    for entry in passed_over {
                        if !tell(WatchUpdate::Entry(entry)) {
                            return false;
                        }
                    }
                }
                last_reported = last_reported.max(entry.revision);
                is_late = false;
                if !tell(WatchUpdate::Entry(entry)) {
                    return false;
                }
            }
            Ok(_) => return true,
            Err(_) => {
                if !tell(WatchUpdate::Nothing) {
                    return false;
                }
                // Ask again later if the server does not answer
                let Ok(now) = last_written(store, filter).await else { continue };
                last = now;
                if std::mem::replace(&mut is_late, last_reported < last) && is_late {
                    tracing::warn!(filter, "a consumer does not deliver written entries: starting another one");
                    return true;
                }
            }
        }
    }
}

/// The number of questions to the server in the current second.
struct Questions {
    begun: Instant,
    count: u32,
}

impl Questions {
    /// Counts one more question. False if there are too many.
    fn may_ask(&mut self) -> bool {
        if self.begun.elapsed() > LOOK_EVERY {
            *self = Self { begun: Instant::now(), count: 0 };
        }
        self.count += 1;
        self.count <= QUESTIONS_MAX
    }
}

/// Returns the entries with these numbers that still exist and were not delivered. Those written again since are
/// delivered later.
async fn passed_over(store: &kv::Store, filter: &str, numbers: Range<u64>) -> Result<Vec<WrittenEntry>, String> {
    let (mut from, mut entries) = (numbers.start, Vec::new());
    while from < numbers.end {
        match store.stream.get_first_raw_message_by_subject(filter, from).await {
            Ok(message) if message.sequence < numbers.end => {
                from = message.sequence + 1;
                tracing::debug!(filter, number = message.sequence, "an entry was not delivered");
                let key = message.subject.strip_prefix(&*store.prefix).map(str::to_owned);
                let (revision, value) = (message.sequence, value_of(Some(&message.headers), &message.payload));
                entries.extend(key.map(|key| WrittenEntry { key, revision, value }));
            }
            Ok(_) => break,
            Err(error) if error.kind() == LastRawMessageErrorKind::NoMessageFound => break,
            Err(error) => return Err(error.to_string()),
        }
    }
    Ok(entries)
}

/// Returns the number of the last write below a name; 0: there is none.
async fn last_written(store: &kv::Store, filter: &str) -> Result<u64, String> {
    match store.stream.get_last_raw_message_by_subject(filter).await {
        Ok(message) => Ok(message.sequence),
        Err(error) if error.kind() == LastRawMessageErrorKind::NoMessageFound => Ok(0),
        Err(error) => {
            tracing::debug!(%error, "cannot read the last entry");
            Err(error.to_string())
        }
    }
}

/// Returns a consumer of the entries below a name, beginning with the last write of each. Compares the server's
/// description of it with the request.
async fn open(client: &Client, store: &kv::Store, filter: &str) -> Result<push::Ordered, String> {
    let filter_subject = filter.to_owned();
    let wanted = push::OrderedConfig {
        deliver_subject: client.new_inbox(),
        description: Some("entries of a farm, and what changes".to_owned()),
        filter_subject: filter_subject.clone(),
        replay_policy: ReplayPolicy::Instant,
        deliver_policy: DeliverPolicy::LastPerSubject,
        ..push::OrderedConfig::default()
    };
    let consumer = store.stream.create_consumer(wanted).await.map_err(|error| error.to_string())?;
    let got = &consumer.cached_info().config;
    let same = [
        ("filter", got.filter_subject == filter_subject),
        ("first message", got.deliver_policy == DeliverPolicy::LastPerSubject),
        ("pace", got.replay_policy == ReplayPolicy::Instant && got.rate_limit == 0),
        ("way to confirm", got.ack_policy == AckPolicy::None),
        ("flow control", got.flow_control && !got.idle_heartbeat.is_zero()),
        ("content", !got.headers_only),
    ];
    if let Some((other, _)) = same.iter().find(|(_, same)| !same) {
        tracing::warn!("the {other} of the consumer of {filter_subject} differs from the requested one");
        return Err(format!("the {other} of the consumer differs from the requested one"));
    }
    consumer.messages().await.map_err(|error| error.to_string())
}

/// Decodes a message.
fn written(store: &kv::Store, message: &Message) -> Option<WrittenEntry> {
    let info = message.info().ok()?;
    let key = message.subject.strip_prefix(&*store.prefix)?.to_owned();
    let value = value_of(message.headers.as_ref(), &message.payload);
    Some(WrittenEntry { key, revision: info.stream_sequence, value })
}

/// Returns the value of an entry; `None`: it was removed.
fn value_of(headers: Option<&HeaderMap>, payload: &Bytes) -> Option<Bytes> {
    let operation = headers.and_then(|headers| headers.get(OPERATION));
    operation.is_none_or(|operation| operation.as_str() == "PUT").then(|| payload.clone())
}
