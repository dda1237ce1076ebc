//! A notification: one JSON object, the same for HTTP servers and commands.

use serde::Serialize;

use super::target::WorkEvent;

/// The version of the format: fields may be added, but none changes its meaning.
const VERSION: u32 = 1;

/// The facts of a job in a notification.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct JobFacts {
    /// The job's number in the farm; for an animation that of the first frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) job: Option<u32>,
    /// The number of an animation's last frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) last_job: Option<u32>,
    /// The scene, as named in the request.
    pub(super) scene: String,
    /// The output file, as named in the request.
    pub(super) output: String,
    /// The user who submitted the job.
    pub(super) from: String,
    /// The number of finished zones of the current image.
    pub(super) zones_done: usize,
    /// The number of all zones.
    pub(super) zones: usize,
    /// Seconds since submission.
    pub(super) seconds: f64,
    /// The reason for a failure or stall.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) reason: Option<String>,
}

/// A notification of a job's end or stall, as it is sent to a target.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Notification {
    version: u32,
    /// The id, equal in each attempt.
    pub(super) id: String,
    pub(super) event: &'static str,
    /// Time in seconds since 1970.
    pub(super) at: u64,
    #[serde(flatten)]
    pub(super) facts: JobFacts,
    #[serde(skip)]
    pub(super) kind: WorkEvent,
}

impl Notification {
    /// Makes the notification of an event.
    ///
    /// - `at`: seconds since 1970.
    pub(super) fn new(kind: WorkEvent, facts: JobFacts, at: u64) -> Self {
        let event = kind.word();
        let identity = format!("{event} {at} {} {:?} {} {}", std::process::id(), facts.job, facts.from, facts.output);
        let digest = ring::digest::digest(&ring::digest::SHA256, identity.as_bytes());
        Self { version: VERSION, id: hex(&digest.as_ref()[..16]), event, at, facts, kind }
    }

    pub(super) fn to_json(&self) -> String {
        // Serialization fails only for maps with non-string keys, of which there are none.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Returns a readable title, one line.
    pub(super) fn title(&self) -> String {
        let name = match (self.facts.job, self.facts.last_job) {
            (Some(job), Some(last)) if last != job => format!("jobs {job} to {last}"),
            (Some(job), _) => format!("job {job}"),
            (None, _) => self.facts.output.clone(),
        };
        format!("{name}: {}", self.event)
    }

    /// Returns the readable text below the title.
    pub(super) fn text(&self) -> String {
        self.facts.reason.clone().unwrap_or_else(|| format!("{} → {}", self.facts.scene, self.facts.output))
    }
}

/// Formats bytes as lowercase hexadecimal digits.
pub(super) fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        _ = write!(text, "{byte:02x}");
        text
    })
}
