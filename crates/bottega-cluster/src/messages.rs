//! The messages between the agents of a job, as people and programs read them; recorded by the process that leads the job, while
//! somebody looks on.
//!
//! - `watch/N`: somebody wants to see the messages of job N; renewed as long as that is so.
//! - blobs `job-WORK/messages-K`: what was recorded, piece by piece. They go with the job.

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

use crate::{error::Error, job::Job, job_board::JobBoard};

/// Characters of a content that are kept.
const CONTENT_CHARS_MAX: usize = 2000;
/// Messages that wait to be kept; more are lost, which is counted.
const WAITING_MAX: usize = 20_000;
/// Pieces of one job at most.
const PIECES_MAX: usize = 2000;
/// Bytes of a piece that is read at most.
const PIECE_BYTES_MAX: usize = 1 << 26;
/// One who has not said for so long that he looks on does so no more.
const WATCHED_FOR: Duration = Duration::from_secs(6);
/// Senders that are remembered as those of this process.
const LOCALS_MAX: usize = 4096;

/// A message from one agent to others.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MessageEvent {
    /// Seconds since the work began at the process that saw it.
    pub at: f64,
    /// Who says it.
    pub sender: String,
    /// To whom.
    pub receivers: Vec<String>,
    /// The performative of FIPA ACL: `cfp`, `propose`, `inform`, …
    pub performative: String,
    /// The interaction protocol.
    pub protocol: String,
    /// The conversation that it belongs to.
    pub conversation: String,
    /// The zones that it speaks of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zones: Vec<u32>,
    /// What is said, as text; the beginning of a long one.
    pub content: String,
}

impl MessageEvent {
    /// A message of the farm, said or heard `now`.
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

/// The content of a message as text: to and from the directories in SL.
pub fn content_text(message: &FarmMessage) -> String {
    let FarmContent::Management(content) = &message.content else { return format!("{:?}", message.content) };
    // What is done is done by the service, whoever asks for it.
    let service = match message.performative {
        Performative::Request => message.receivers.first().unwrap_or(&message.sender),
        _ => &message.sender,
    };
    print_content(Calendar::default(), service, content)
}

/// The zones that a content speaks of.
fn zones(content: &FarmContent) -> Vec<u32> {
    match content {
        FarmContent::Profile(order) | FarmContent::Award(order) => vec![order.row.zone.0],
        FarmContent::Offers(offers) => offers.iter().map(|offer| offer.zone.0).collect(),
        FarmContent::Bids { bids, .. } => bids.iter().map(|bid| bid.zone.0).collect(),
        FarmContent::Report(report) => vec![report.zone.0],
        FarmContent::Received { zone, .. }
        | FarmContent::Refused { zone, .. }
        | FarmContent::Withdrawn { zone, .. } => vec![zone.0],
        FarmContent::Alive { hands, .. } => hands.iter().map(|hand| hand.zone.0).collect(),
        _ => Vec::new(),
    }
}

/// Some messages of a job, in the order in which they were seen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SeenMessages {
    /// The number of the first one.
    pub first: u64,
    /// The messages.
    pub messages: Vec<MessageEvent>,
    /// Messages that were too many to be kept, so far.
    pub lost: u64,
}

/// Records what the agents of this process say and are told.
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
    /// How many pieces there are; `None`: it is not known yet.
    pieces: Option<usize>,
    /// Agents of this process: what they say is seen when they say it.
    locals: HashSet<String>,
}

impl MessageRecorder {
    /// An agent of this process says something.
    pub(crate) fn see_said(&self, now: Time, message: &FarmMessage) {
        let mut state = self.state();
        if state.locals.len() < LOCALS_MAX && !state.locals.contains(&*message.sender.name) {
            state.locals.insert(message.sender.name.to_string());
        }
        self.keep(&mut state, now, message);
    }

    /// An agent of this process is told something: it was seen already where the one who says it is here, too.
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

    /// Has what was seen kept by the farm, if somebody looks on.
    pub(crate) fn tell(self: &Arc<Self>, board: &JobBoard, number: u32, work: u64) {
        self.is_on.store(board.is_watched(number), Ordering::Relaxed);
        self.send(board, work);
    }

    /// Has what was seen kept by the farm.
    pub(crate) fn send(self: &Arc<Self>, board: &JobBoard, work: u64) {
        if self.state().waiting.is_empty() || self.is_sending.swap(true, Ordering::Relaxed) {
            return;
        }
        let (recorder, board) = (Arc::clone(self), board.clone());
        // It may take longer than a lease.
        let sent = thread::Builder::new().name("messages".to_owned()).spawn(move || {
            recorder.send_now(&board, work);
            recorder.is_sending.store(false, Ordering::Relaxed);
        });
        if let Err(error) = sent {
            self.is_sending.store(false, Ordering::Relaxed);
            tracing::debug!(%error, "nobody sees the messages");
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
            Err(error) => tracing::debug!(%error, "nobody sees these messages"),
        }
    }

    fn state(&self) -> MutexGuard<'_, RecorderState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl JobBoard {
    /// Says that somebody wants to see the messages of a job, for some seconds.
    ///
    /// # Errors
    /// The farm does not answer.
    pub fn watch_messages(&self, number: u32) -> Result<(), Error> {
        self.put_notice(&watch_name(number), &true)
    }

    /// Whether somebody wants to see the messages of a job.
    pub(crate) fn is_watched(&self, number: u32) -> bool {
        self.uplink.notices().get(&watch_name(number)).is_some_and(|notice| notice.unchanged < WATCHED_FOR)
    }

    /// Forgets that somebody wanted to see the messages of a job.
    pub(crate) fn forget_watch(&self, number: u32) {
        if let Err(error) = self.uplink.notices().remove(&watch_name(number)) {
            tracing::debug!(%error, "the farm does not answer");
        }
    }

    /// A piece of the messages of a job; `None`: there is none yet.
    ///
    /// # Errors
    /// The farm does not answer.
    pub fn messages(&self, job: &Job, piece: usize) -> Result<Option<SeenMessages>, Error> {
        let bytes = self.uplink.blobs().get(&piece_blob(job.work, piece), PIECE_BYTES_MAX).map_err(Error::Blob)?;
        Ok(bytes.map(|bytes| serde_json::from_slice(&bytes).unwrap_or_default()))
    }

    /// How many pieces there are.
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
        let told = MessageEvent::new(Time::ZERO, &message("master@work-1", refused));
        assert_eq!(
            (&*told.sender, &*told.performative, &*told.protocol),
            ("master@work-1", "cfp", "fipa-contract-net")
        );
        assert_eq!((told.zones, told.conversation), (vec![3], "7".to_owned()));
        assert_eq!(told.content.chars().count(), CONTENT_CHARS_MAX + 2, "the beginning of a long one");
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
