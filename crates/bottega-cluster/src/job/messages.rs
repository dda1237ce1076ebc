//! The messages between the agents of a job, for people and programs; recorded by the leader of the job while an observer
//! watches.
//!
//! - `watch/N`: an observer watches the messages of job N; renewed while that is so.
//! - blobs `job-WORK/messages-K`: recorded messages, in pieces. They are deleted with the job.

use std::{
    collections::HashSet,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use bottega_agents::{Performative, Time, platform::print_content, wire::Calendar};
use bottega_farm::{FarmContent, FarmMessage};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    job::{board::JobBoard, record::Job},
};

/// The most characters kept of a message's content.
const CONTENT_CHARS_MAX: usize = 2000;
/// The most messages waiting to be stored; more are lost, and counted.
const WAITING_MAX: usize = 20_000;
/// The most pieces of one job.
const PIECES_MAX: usize = 2000;
/// The largest piece that is read, in bytes.
const PIECE_BYTES_MAX: usize = 1 << 26;
/// Time without a renewal after which a watcher counts as gone.
const WATCHED_FOR: Duration = Duration::from_secs(6);
/// The most senders remembered as local to this process.
const LOCALS_MAX: usize = 4096;

/// A message from one agent to others.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MessageEvent {
    /// Time since the start of the work, in seconds, by the clock of the process that recorded it.
    pub at: f64,
    /// The sender's name.
    pub sender: String,
    /// The receivers' names.
    pub receivers: Vec<String>,
    /// The FIPA ACL performative: `cfp`, `propose`, `inform`, …
    pub performative: String,
    /// The name of the FIPA interaction protocol, such as `fipa-contract-net`.
    pub protocol: String,
    /// The identifier of the message's conversation.
    pub conversation: String,
    /// The identifiers of the zones that the message is about (IdZone).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zones: Vec<u32>,
    /// The content as text; a longer one is truncated after 2000 characters and ends with ` …`.
    pub content: String,
}

impl MessageEvent {
    /// Returns the event of a message sent or received `now`.
    pub fn new(now: Time, message: &FarmMessage) -> Self {
        let content = content_text(message);
        let end = content.char_indices().nth(CONTENT_CHARS_MAX).map(|(end, _)| end);
        Self {
            at: now.elapsed().as_secs_f64(),
            sender: message.sender.to_string(),
            receivers: message.receivers.iter().map(ToString::to_string).collect(),
            performative: message.performative.word().to_owned(),
            protocol: message.protocol.to_owned(),
            conversation: message.conversation_id.to_string(),
            zones: zones(&message.content),
            content: end.map_or(content.clone(), |end| format!("{} …", &content[..end])),
        }
    }
}

/// Returns the content of a message as text: in FIPA SL if it is for or from a directory, otherwise as Rust's `Debug` prints it.
pub fn content_text(message: &FarmMessage) -> String {
    let FarmContent::Management(content) = &message.content else { return format!("{:?}", message.content) };
    // Actions are performed by the directory service, not by its client.
    let service = match message.performative {
        Performative::Request => message.receivers.first().unwrap_or(&message.sender),
        _ => &message.sender,
    };
    print_content(Calendar::default(), service, content)
}

/// Returns the zones that a content is about.
fn zones(content: &FarmContent) -> Vec<u32> {
    match content {
        FarmContent::Profile(order) | FarmContent::Award(order) => vec![order.row.zone.0],
        FarmContent::Offers(offers) => offers.iter().map(|offer| offer.zone.0).collect(),
        FarmContent::Bids { bids, .. } => bids.iter().map(|bid| bid.zone.0).collect(),
        FarmContent::Report(report) => vec![report.zone.0],
        FarmContent::Received { zone, .. }
        | FarmContent::Refused { zone, .. }
        | FarmContent::Withdrawn { zone, .. } => vec![zone.0],
        FarmContent::Alive { orders, .. } => orders.iter().map(|order| order.zone.0).collect(),
        _ => Vec::new(),
    }
}

/// Some messages of a job, in the order they were recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SeenMessages {
    /// The index of the first message, from 0, among all recorded messages of the job.
    pub first: u64,
    /// The messages, oldest first.
    pub messages: Vec<MessageEvent>,
    /// The number of messages lost so far, because too many came at once.
    pub lost: u64,
}

/// Records the messages that agents of this process send and receive.
#[derive(Debug, Default)]
pub(crate) struct MessageRecorder {
    is_on: AtomicBool,
    state: Mutex<RecorderState>,
    is_sending: Arc<AtomicBool>,
}

#[derive(Debug, Default)]
struct RecorderState {
    waiting: Vec<MessageEvent>,
    lost: u64,
    /// The number of stored pieces; `None`: not known yet.
    pieces: Option<usize>,
    /// Agents of this process: their messages are recorded when sent.
    locals: HashSet<String>,
}

impl MessageRecorder {
    /// Records a message sent by an agent of this process.
    pub(crate) fn see_said(&self, now: Time, message: &FarmMessage) {
        let mut state = self.state();
        if state.locals.len() < LOCALS_MAX && !state.locals.contains(&*message.sender.name) {
            state.locals.insert(message.sender.name.to_string());
        }
        self.keep(&mut state, now, message);
    }

    /// Records a message received by an agent of this process, unless it was recorded when sent.
    pub(crate) fn see_heard(&self, now: Time, message: &FarmMessage) {
        let mut state = self.state();
        if !state.locals.contains(&*message.sender.name) {
            self.keep(&mut state, now, message);
        }
    }

    fn keep(&self, state: &mut RecorderState, now: Time, message: &FarmMessage) {
        if !self.is_on.load(Ordering::Relaxed) {
            return;
        }
        if state.waiting.len() < WAITING_MAX {
            state.waiting.push(MessageEvent::new(now, message));
        } else {
            state.lost += 1;
        }
    }

    /// Stores the recorded messages while an observer watches.
    pub(crate) fn tell(self: &Arc<Self>, board: &JobBoard, number: u32, work: u64) {
        self.is_on.store(board.is_watched(number), Ordering::Relaxed);
        self.send(board, work);
    }

    /// Stores the recorded messages.
    pub(crate) fn send(self: &Arc<Self>, board: &JobBoard, work: u64) {
        if self.state().waiting.is_empty() || self.is_sending.swap(true, Ordering::Relaxed) {
            return;
        }
        let (recorder, board) = (Arc::clone(self), board.clone());
        // Use a thread: it may take longer than a lease lasts.
        let sent = thread::Builder::new().name("messages".to_owned()).spawn(move || {
            recorder.send_now(&board, work);
            recorder.is_sending.store(false, Ordering::Relaxed);
        });
        if let Err(error) = sent {
            self.is_sending.store(false, Ordering::Relaxed);
            tracing::debug!(%error, "cannot publish the messages");
        }
    }

    fn send_now(&self, board: &JobBoard, work: u64) {
        let known = self.state().pieces;
        let piece = match known.map_or_else(|| board.message_pieces(work), Ok) {
            Ok(piece) if piece < PIECES_MAX => piece,
            _ => return,
        };
        let (messages, lost) = {
            let mut state = self.state();
            state.pieces = Some(piece);
            (std::mem::take(&mut state.waiting), state.lost)
        };
        let text = serde_json::to_vec(&SeenMessages { first: 0, messages, lost }).unwrap_or_default();
        match board.uplink.blobs().put(&piece_blob(work, piece), &text) {
            Ok(()) => self.state().pieces = Some(piece + 1),
            Err(error) => tracing::debug!(%error, "cannot publish these messages"),
        }
    }

    fn state(&self) -> MutexGuard<'_, RecorderState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl JobBoard {
    /// Announces that an observer watches the messages of a job. Without another call, the announcement counts for 6 s.
    ///
    /// # Errors
    /// The farm does not store the announcement.
    pub fn watch_messages(&self, number: u32) -> Result<(), Error> {
        self.put_notice(&watch_name(number), &true)
    }

    /// Returns true if an observer watches the messages of a job.
    pub(crate) fn is_watched(&self, number: u32) -> bool {
        self.uplink.notices().get(&watch_name(number)).is_some_and(|notice| notice.unchanged < WATCHED_FOR)
    }

    /// Removes the announcement that an observer watches a job.
    pub(crate) fn forget_watch(&self, number: u32) {
        if let Err(error) = self.uplink.notices().remove(&watch_name(number)) {
            tracing::debug!(%error, "the farm does not answer");
        }
    }

    /// Returns a piece of a job's recorded messages; without messages if it cannot be read. `None`: it does not exist yet. In
    /// each piece [`SeenMessages::first`] is 0.
    ///
    /// - `piece`: the index of the piece, from 0.
    ///
    /// # Errors
    /// The farm does not answer, or the stored piece is damaged.
    pub fn messages(&self, job: &Job, piece: usize) -> Result<Option<SeenMessages>, Error> {
        let bytes = self.uplink.blobs().get(&piece_blob(job.work, piece), PIECE_BYTES_MAX).map_err(Error::Blob)?;
        Ok(bytes.map(|bytes| serde_json::from_slice(&bytes).unwrap_or_default()))
    }

    /// Returns the number of stored pieces.
    fn message_pieces(&self, work: u64) -> Result<usize, Error> {
        let mut piece = 0;
        while piece < PIECES_MAX && self.uplink.blobs().has(&piece_blob(work, piece)).map_err(Error::Blob)? {
            piece += 1;
        }
        Ok(piece)
    }
}

fn watch_name(number: u32) -> String {
    format!("watch/{number}")
}

fn piece_blob(work: u64, piece: usize) -> String {
    format!("job-{work}/messages-{piece}")
}

#[cfg(test)]
mod tests {
    use bottega_agents::AgentId;
    use bottega_farm::ZoneId;

    use super::*;

    fn message(sender: &str, content: FarmContent) -> FarmMessage {
        FarmMessage {
            performative: Performative::CallForProposal,
            sender: AgentId::new(sender),
            receivers: vec![AgentId::new("render-1@b")],
            content,
            language: "typed",
            ontology: "farm",
            protocol: "fipa-contract-net",
            conversation_id: 7,
            reply_with: 0,
            in_reply_to: 0,
            reply_by: None,
        }
    }

    #[test]
    fn a_message_tells_who_says_what_of_which_zones() {
        let refused = FarmContent::Refused { zone: ZoneId(3), fence: Default::default(), reason: "é".repeat(3000) };
        let event = MessageEvent::new(Time::ZERO, &message("master@work-1", refused));
        assert_eq!(
            (&*event.sender, &*event.performative, &*event.protocol),
            ("master@work-1", "cfp", "fipa-contract-net")
        );
        assert_eq!((event.zones, event.conversation), (vec![3], "7".to_owned()));
        assert_eq!(event.content.chars().count(), CONTENT_CHARS_MAX + 2, "the beginning of a long one");
    }

    #[test]
    fn what_is_said_here_is_seen_once_and_nothing_while_nobody_looks_on() {
        let recorder = MessageRecorder::default();
        let (here, there) =
            (message("master@here", FarmContent::Subscribed), message("render-1@there", FarmContent::Nothing));
        recorder.see_said(Time::ZERO, &here);
        assert!(recorder.state().waiting.is_empty());
        recorder.is_on.store(true, Ordering::Relaxed);
        recorder.see_said(Time::ZERO, &here);
        recorder.see_heard(Time::ZERO, &here);
        recorder.see_heard(Time::ZERO, &there);
        let senders: Vec<String> = recorder.state().waiting.iter().map(|it| it.sender.clone()).collect();
        assert_eq!(senders, ["master@here", "render-1@there"]);
    }
}
