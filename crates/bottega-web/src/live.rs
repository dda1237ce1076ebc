//! The live state of a job, for any number of clients. It keeps the present state, not the history: each client gets what has
//! changed since its last update, so a slow client misses intermediate steps but never the final state.

use std::{
    collections::{BTreeMap, HashMap, VecDeque},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bottega::events::Event;
use bottega_cluster::view::JobView;

use crate::redact::{redacted_json, without_paths};

/// Largest number of notes and auction rounds kept for new clients.
const NOTES_MAX: usize = 200;

/// The live state of a job, as clients follow it by an event stream.
#[derive(Default)]
pub struct LiveJob {
    state: Mutex<LiveState>,
}

/// The state up to which a client is up to date.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cursor {
    /// Number of restarts of the job.
    epoch: u64,
    version: u64,
}

/// An update for a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LiveUpdate {
    /// True if the update holds the whole state and replaces all earlier ones.
    pub(crate) is_whole: bool,
    /// A JSON array of events.
    pub(crate) text: String,
    pub(crate) cursor: Cursor,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum RowKey {
    Job,
    Zone(u32),
    Agent(String),
    /// An event of which only the last one counts, by its kind.
    Last(&'static str),
    Note(u64),
}

#[derive(Default)]
struct LiveState {
    /// The work number of the current rendering; `None`: unknown.
    painting: Option<u64>,
    epoch: u64,
    version: u64,
    rows: HashMap<RowKey, (u64, Arc<str>)>,
    /// The row that each version has changed.
    changed: BTreeMap<u64, RowKey>,
    notes: VecDeque<u64>,
}

impl LiveJob {
    /// Publishes an event. A start of rendering discards all earlier state.
    pub fn tell(&self, event: &Event) {
        let mut state = self.state();
        if matches!(event, Event::Started { .. }) {
            state.restart();
        }
        let key = match event {
            Event::Zone(zone) => RowKey::Zone(zone.id),
            Event::Agent(agent) => RowKey::Agent(agent.agent.clone()),
            Event::Started { .. } => RowKey::Last("started"),
            Event::Analyzed { .. } => RowKey::Last("analyzed"),
            Event::Progress(_) => RowKey::Last("progress"),
            Event::Sending { .. } | Event::Compiling { .. } | Event::Step { .. } => RowKey::Last("step"),
            Event::Preview { .. } => RowKey::Last("preview"),
            Event::Finished { .. } | Event::Interrupted { .. } | Event::Fetched { .. } => RowKey::Last("end"),
            Event::Round(_)
            | Event::Theft(_)
            | Event::Note { .. }
            | Event::Warning { .. }
            | Event::Submitted { .. }
            | Event::LightingAgents(_)
            | Event::Auction(_)
            | Event::Forecast(_)
            | Event::Mixed { .. }
            | Event::Recorded { .. }
            | Event::Resources { .. }
            | Event::Timeline { .. }
            | Event::Frame { .. }
            | Event::Denoised { .. } => state.next_note(),
        };
        state.put(key, without_paths(event.to_json()).into());
    }

    /// Notes the work number of the current rendering. Discards the state of another one, and returns true if there was one.
    pub(crate) fn begin_painting(&self, work: u64) -> bool {
        let mut state = self.state();
        let is_another = state.painting.is_some_and(|before| before != work);
        if is_another {
            state.restart();
        }
        state.painting = Some(work);
        is_another
    }

    /// Publishes the view of the job, as an event `job`.
    pub fn tell_job(&self, job: &JobView) {
        let mut text = redacted_json(job);
        text.replace_range(..1, "{\"event\":\"job\",");
        self.state().put(RowKey::Job, text.into());
    }

    /// Returns true if nothing was published yet.
    pub(crate) fn is_empty(&self) -> bool {
        self.state().rows.is_empty()
    }

    /// Returns the changes since the last update of a client; `None`: none.
    ///
    /// - `cursor`: cursor of that update; `None` for a new client, which gets the whole state.
    pub(crate) fn since(&self, cursor: Option<Cursor>) -> Option<LiveUpdate> {
        let state = self.state();
        let known = cursor.filter(|cursor| cursor.epoch == state.epoch);
        let from = known.map_or(0, |cursor| cursor.version);
        if known.is_some() && from == state.version {
            return None;
        }
        let mut text = String::from("[");
        for key in state.changed.range(from + 1..).map(|(_, key)| key) {
            if text.len() > 1 {
                text.push(',');
            }
            text.push_str(state.rows.get(key).map_or("null", |(_, row)| row));
        }
        text.push(']');
        let cursor = Cursor { epoch: state.epoch, version: state.version };
        Some(LiveUpdate { is_whole: known.is_none(), text, cursor })
    }

    /// Publishes that the job was removed.
    pub(crate) fn tell_removed(&self) {
        self.state().put(RowKey::Last("end"), r#"{"event":"removed"}"#.into());
    }

    fn state(&self) -> MutexGuard<'_, LiveState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl LiveState {
    fn put(&mut self, key: RowKey, text: Arc<str>) {
        if let Some((before, old)) = self.rows.get(&key) {
            if *old == text {
                return;
            }
            self.changed.remove(before);
        }
        self.version += 1;
        self.changed.insert(self.version, key.clone());
        self.rows.insert(key, (self.version, text));
    }

    /// Returns the key of a new note; drops the oldest one if there are too many.
    fn next_note(&mut self) -> RowKey {
        if self.notes.len() >= NOTES_MAX
            && let Some(oldest) = self.notes.pop_front()
            && let Some((version, _)) = self.rows.remove(&RowKey::Note(oldest))
        {
            self.changed.remove(&version);
        }
        let number = self.notes.back().map_or(0, |last| last + 1);
        self.notes.push_back(number);
        RowKey::Note(number)
    }

    fn restart(&mut self) {
        *self = Self { epoch: self.epoch + 1, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use bottega::events::{Progress, ZoneEvent};
    use serde_json::Value;

    use super::*;

    fn zone(id: u32, state: &str) -> Event {
        Event::Zone(Box::new(ZoneEvent { id, state: state.to_owned(), ..ZoneEvent::default() }))
    }

    fn events_of(update: &LiveUpdate) -> Vec<Value> {
        serde_json::from_str(&update.text).expect("JSON")
    }

    #[test]
    fn updates_of_an_earlier_painting_are_void() {
        let live = LiveJob::default();
        assert!(!live.begin_painting(7));
        live.tell(&zone(3, "done"));
        let first = live.since(None).unwrap();
        assert!(!live.begin_painting(7) && live.begin_painting(8));
        live.tell(&zone(1, "open"));
        let next = live.since(Some(first.cursor)).unwrap();
        assert!(next.is_whole && events_of(&next).len() == 1 && events_of(&next)[0]["id"] == 1);
    }

    #[test]
    fn a_new_client_gets_the_whole_state_and_a_known_one_only_the_changes() {
        let live = LiveJob::default();
        live.tell(&zone(3, "open"));
        live.tell(&zone(3, "done"));
        live.tell(&Event::Progress(Progress { zones_done: 1, ..Progress::default() }));
        let first = live.since(None).unwrap();
        let events = events_of(&first);
        assert!(first.is_whole && events.len() == 2 && events[0]["state"] == "done", "{events:?}");
        assert_eq!(live.since(Some(first.cursor)), None);
        live.tell(&zone(3, "done"));
        assert_eq!(live.since(Some(first.cursor)), None, "nothing has changed");
        live.tell(&zone(4, "open"));
        let next = live.since(Some(first.cursor)).unwrap();
        assert!(!next.is_whole && events_of(&next).len() == 1 && events_of(&next)[0]["id"] == 4);
    }

    #[test]
    fn a_slow_client_misses_steps_but_never_the_end() {
        let live = LiveJob::default();
        let first = live.since(None).unwrap();
        for step in 0..100_000u32 {
            live.tell(&zone(step % 10, &step.to_string()));
            live.tell(&Event::Note { message: step.to_string() });
        }
        let changes = events_of(&live.since(Some(first.cursor)).unwrap());
        assert_eq!(changes.len(), 10 + NOTES_MAX);
        assert!(changes.iter().any(|event| event["state"] == "99999"));
    }

    #[test]
    fn a_restarted_picture_makes_earlier_updates_void() {
        let live = LiveJob::default();
        live.tell(&zone(3, "open"));
        let first = live.since(None).unwrap();
        let started = r#"{"event":"started","version":1,"scene":"/home/anna/s.glb","output":"o.png","width":1,"height":1,
            "crop":[0,0,1,1],"samples_per_pixel":1,"integrator":"path","progressive":false,"agents":1,"threads":1,"gpus":[],
            "method":"m","painters":"p","seed":0}"#;
        live.tell(&serde_json::from_str(started).unwrap());
        let next = live.since(Some(first.cursor)).unwrap();
        let events = events_of(&next);
        assert!(next.is_whole && events.len() == 1 && events[0]["scene"] == "s.glb", "{events:?}");
    }
}
