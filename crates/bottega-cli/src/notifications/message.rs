//! A notification: one JSON object, the same for HTTP servers and commands.

use serde::Serialize;

use super::target::WorkEvent;

/// The version of the fields: fields may be added, none changes its meaning.
const VERSION: u32 = 1;

/// What is known of a job when it is told of.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct JobFacts {
    /// Its number in the farm; of an animation the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) job: Option<u32>,
    /// The last one of an animation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) last_job: Option<u32>,
    /// The scene, as its asker calls it.
    pub(super) scene: String,
    /// The picture, as its asker calls it.
    pub(super) output: String,
    /// Who asked for it.
    pub(super) from: String,
    /// Zones painted, of the picture that is painted now.
    pub(super) zones_done: usize,
    /// All zones.
    pub(super) zones: usize,
    /// Seconds since it was asked for.
    pub(super) seconds: f64,
    /// Why it failed or is taken to be stalled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) reason: Option<String>,
}

/// A notification.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Notification {
    version: u32,
    /// The same in each try.
    pub(super) id: String,
    pub(super) event: &'static str,
    /// Seconds since 1970.
    pub(super) at: u64,
    #[serde(flatten)]
    pub(super) facts: JobFacts,
    #[serde(skip)]
    pub(super) kind: WorkEvent,
}

impl Notification {
    /// - `at`: seconds since 1970.
    pub(super) fn new(kind: WorkEvent, facts: JobFacts, at: u64) -> Self {
        let event = kind.word();
        let what = format!("{event} {at} {} {:?} {} {}", std::process::id(), facts.job, facts.from, facts.output);
        let digest = ring::digest::digest(&ring::digest::SHA256, what.as_bytes());
        Self { version: VERSION, id: hex(&digest.as_ref()[..16]), event, at, facts, kind }
    }

    pub(super) fn to_json(&self) -> String {
        // It has no maps with odd keys.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// For people, in a line.
    pub(super) fn title(&self) -> String {
        let name = match (self.facts.job, self.facts.last_job) {
            (Some(job), Some(last)) if last != job => format!("jobs {job} to {last}"),
            (Some(job), _) => format!("job {job}"),
            (None, _) => self.facts.output.clone(),
        };
        format!("{name}: {}", self.event)
    }

    /// For people, beneath the title.
    pub(super) fn text(&self) -> String {
        self.facts.reason.clone().unwrap_or_else(|| format!("{} → {}", self.facts.scene, self.facts.output))
    }
}

/// Bytes as lowercase hexadecimal digits.
pub(super) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a text does not fail.
        _ = write!(text, "{byte:02x}");
        text
    })
}
