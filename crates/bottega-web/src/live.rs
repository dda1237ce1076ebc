//! A job as it changes, for any number of clients. What is kept is the present state, not its history: each client is told what has
//! changed since it was told the last time, so one that reads slowly misses steps and never the end.

use std::{
    collections::{BTreeMap, HashMap, VecDeque},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use bottega::events::Event;
use bottega_cluster::view::JobView;

use crate::redact::{redacted_json, without_paths};

/// Notes and rounds of the auction that one is told who comes late.
const NOTES_MAX: usize = 200;

/// A job as it changes.
#[derive(Default)]
pub struct LiveJob {
    state: Mutex<LiveState>,
}

/// How much of a job a client was told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Cursor {
    /// How often the job had begun anew.
    epoch: u64,
    version: u64,
}

/// What a client is told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct News {
    /// All that is known: what was told before counts no more.
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
    /// Of which only the last one counts.
    Last(&'static str),
    Note(u64),
}

#[derive(Default)]
struct LiveState {
    /// The painting that is told, where there may be several.
    painting: Option<u64>,
    epoch: u64,
    version: u64,
    rows: HashMap<RowKey, (u64, Arc<str>)>,
    /// Which row has which version.
    changed: BTreeMap<u64, RowKey>,
    notes: VecDeque<u64>,
}

impl LiveJob {
    /// Tells an event. A picture that begins anew makes what was told before void.
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
            | Event::Asked { .. }
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

    /// A painting of the job is told from now on. What was told of another one is void. Returns whether something was.
    pub(crate) fn begin_painting(&self, work: u64) -> bool {
        let mut state = self.state();
        let is_another = state.painting.is_some_and(|before| before != work);
        if is_another {
            state.restart();
        }
        state.painting = Some(work);
        is_another
    }

    /// Tells how the job stands: an event `job`.
    pub fn tell_job(&self, job: &JobView) {
        let mut text = redacted_json(job);
        text.replace_range(..1, "{\"event\":\"job\",");
        self.state().put(RowKey::Job, text.into());
    }

    /// Whether nothing is known.
    pub(crate) fn is_empty(&self) -> bool {
        self.state().rows.is_empty()
    }

    /// What has changed since a client was told; `None`: nothing.
    ///
    /// - `cursor`: none: it was told nothing yet.
    pub(crate) fn since(&self, cursor: Option<Cursor>) -> Option<News> {
        let state = self.state();
        let told = cursor.filter(|cursor| cursor.epoch == state.epoch);
        let from = told.map_or(0, |cursor| cursor.version);
        if told.is_some() && from == state.version {
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
        Some(News { is_whole: told.is_none(), text, cursor })
    }

    /// Tells that the job is no more.
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

    /// The key of a new note; the oldest goes when there are too many.
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

    fn told(news: &News) -> Vec<Value> {
        serde_json::from_str(&news.text).expect("JSON")
    }

    #[test]
    fn what_was_told_of_an_earlier_painting_is_void() {
        let live = LiveJob::default();
        assert!(!live.begin_painting(7));
        live.tell(&zone(3, "done"));
        let first = live.since(None).unwrap();
        assert!(!live.begin_painting(7) && live.begin_painting(8));
        live.tell(&zone(1, "open"));
        let next = live.since(Some(first.cursor)).unwrap();
        assert!(next.is_whole && told(&next).len() == 1 && told(&next)[0]["id"] == 1);
    }

    #[test]
    fn one_who_comes_late_is_told_the_present_state_and_one_who_was_told_only_what_is_new() {
        let live = LiveJob::default();
        live.tell(&zone(3, "open"));
        live.tell(&zone(3, "done"));
        live.tell(&Event::Progress(Progress { zones_done: 1, ..Progress::default() }));
        let first = live.since(None).unwrap();
        let events = told(&first);
        assert!(first.is_whole && events.len() == 2 && events[0]["state"] == "done", "{events:?}");
        assert_eq!(live.since(Some(first.cursor)), None);
        live.tell(&zone(3, "done"));
        assert_eq!(live.since(Some(first.cursor)), None, "nothing has changed");
        live.tell(&zone(4, "open"));
        let next = live.since(Some(first.cursor)).unwrap();
        assert!(!next.is_whole && told(&next).len() == 1 && told(&next)[0]["id"] == 4);
    }

    #[test]
    fn one_who_reads_slowly_misses_steps_and_never_the_end() {
        let live = LiveJob::default();
        let first = live.since(None).unwrap();
        for step in 0..100_000u32 {
            live.tell(&zone(step % 10, &step.to_string()));
            live.tell(&Event::Note { message: step.to_string() });
        }
        let news = told(&live.since(Some(first.cursor)).unwrap());
        assert_eq!(news.len(), 10 + NOTES_MAX);
        assert!(news.iter().any(|event| event["state"] == "99999"));
    }

    #[test]
    fn a_picture_that_begins_anew_makes_void_what_was_told() {
        let live = LiveJob::default();
        live.tell(&zone(3, "open"));
        let first = live.since(None).unwrap();
        let started = r#"{"event":"started","version":1,"scene":"/home/anna/s.glb","output":"o.png","width":1,"height":1,
            "crop":[0,0,1,1],"samples_per_pixel":1,"integrator":"path","progressive":false,"agents":1,"threads":1,"gpus":[],
            "method":"m","painters":"p","seed":0}"#;
        live.tell(&serde_json::from_str(started).unwrap());
        let next = live.since(Some(first.cursor)).unwrap();
        let events = told(&next);
        assert!(next.is_whole && events.len() == 1 && events[0]["scene"] == "s.glb", "{events:?}");
    }
}
