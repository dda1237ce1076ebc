//! A Master whose rows the store has lost.

use std::{collections::BTreeMap, time::Duration};

use bottega_agents::{AclMessage, AgentId, Entry, Key, Revision, StoreReply, StoreRequest, Ticket};
use bottega_engines::Tunables;
use bottega_image::Rect;

use super::*;
use crate::{
    AuctionRule, FarmMessage, GoalRules, InputRanges, NeighborDifference, Optimization, RelativePower, TaskFeatures,
    WorkId, WorkKeys, WorkSettings,
};

const STEP: Duration = Duration::from_millis(500);

/// A Master of one zone, its store, and an agent that says that it lives.
struct Farm {
    master: Master,
    rows: BTreeMap<Key, (Revision, FarmValue)>,
    agent: AgentId,
    now: Time,
    /// Answers of the store that are on their way.
    replies: Vec<FarmEvent>,
    /// Orders that the agent was sent, and times that the Master has begun again.
    orders: usize,
    stalls: usize,
}

impl Farm {
    fn new() -> Self {
        let config = MasterConfig {
            id: AgentId::new("master"),
            work: WorkId(1),
            auction: AuctionRule::default(),
            prefetch: 2,
            shares_tail: true,
            verify: 1,
            compares_by_look: false,
            secret: 1,
            credits: Arc::default(),
            goals: GoalRules::default(),
            timing: Timing::default(),
            registration: None,
        };
        let frame = Rect::of_size(32, 32);
        let settings = WorkSettings {
            picture: frame,
            frame,
            samples: 64,
            goal: crate::Goal::Samples,
            tunables: Tunables { max_depth: 8, light_samples: 1 },
            optimization: Optimization::Off,
        };
        let zone = ZoneRow::open(WorkId(1), ZoneId(0), frame, 1024.0, NeighborDifference::default());
        let ranges = InputRanges::of([zone.clone()]);
        let features = TaskFeatures::default();
        let work = WorkRow { work: WorkId(1), settings, zone_count: 1, ranges, features };
        let keys = WorkKeys::new(WorkId(1));
        let values = [FarmValue::Work(Arc::new(work)), FarmValue::Zone(Arc::new(zone))];
        let rows = values.into_iter().map(|value| (keys.of(&value), (Revision(5), value))).collect();
        let agent = AgentId::new("agent");
        Self { master: Master::new(config), rows, agent, now: Time::ZERO, replies: Vec::new(), orders: 0, stalls: 0 }
    }

    fn say(&mut self, performative: Performative, protocol: &'static str, content: FarmContent) {
        let to = vec![self.master.assignments.config.id.clone()];
        let said: FarmMessage = message(performative, protocol, &self.agent, to, content);
        self.feed(FarmEvent::Message(AclMessage { conversation_id: 1, ..said }));
    }

    /// - `lost`: by how much the numbers are too high that the Master knows of the rows.
    fn tell_rows(&mut self, ticket: Ticket, lost: u64) {
        let rows: Vec<_> = self.rows.iter().map(|(key, row)| (key.clone(), row.clone())).collect();
        for (key, (revision, value)) in rows {
            let entry = Entry { key, revision: Revision(revision.0 + lost), value };
            self.feed(FarmEvent::Store { ticket, reply: StoreReply::Changed(entry) });
        }
        self.feed(FarmEvent::Store { ticket, reply: StoreReply::CaughtUp });
    }

    fn feed(&mut self, event: FarmEvent) {
        let mut actions = Vec::new();
        self.master.handle(self.now, event, &mut actions);
        for action in actions {
            match action {
                FarmAction::Store { ticket, request: StoreRequest::Watch { .. } } if self.stalls > 0 => {
                    self.tell_rows(ticket, 0);
                }
                FarmAction::Store {
                    ticket,
                    request: StoreRequest::CompareAndSet { key, expected_revision, value },
                } => {
                    let (revision, known) = self.rows[&key].clone();
                    let reply = if revision == expected_revision {
                        self.rows.insert(key.clone(), (Revision(revision.0 + 1), value));
                        StoreReply::Written { key, revision: Revision(revision.0 + 1) }
                    } else {
                        let entry = Some(Entry { key: key.clone(), revision, value: known });
                        StoreReply::Conflict { key, entry }
                    };
                    self.replies.push(FarmEvent::Store { ticket, reply });
                }
                FarmAction::Store { request: StoreRequest::Put { key, value }, .. } => {
                    self.rows.insert(key, (Revision(9), value));
                }
                FarmAction::Effect(FarmEffect::Stalled { zones, free, .. }) => {
                    assert_eq!((zones, free), (1, 1));
                    self.stalls += 1;
                }
                FarmAction::Send(sent) if matches!(sent.content, FarmContent::Profile(_)) => self.orders += 1,
                _ => {}
            }
        }
    }

    /// Lets time pass, in which the store answers and the agent says that it lives.
    fn pass(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end && self.orders == 0 {
            self.now = self.now + STEP;
            std::mem::take(&mut self.replies).into_iter().for_each(|reply| self.feed(reply));
            let alive = FarmContent::Alive { power: RelativePower::REFERENCE, orders: Vec::new() };
            self.say(Performative::Inform, protocol::SUBSCRIBE, alive);
            self.feed(FarmEvent::Deadline);
        }
    }
}

#[test]
fn a_master_that_knows_rows_which_the_store_has_lost_begins_again_from_those_that_there_are() {
    let mut farm = Farm::new();
    farm.feed(FarmEvent::Start);
    farm.tell_rows(Ticket(0), 3);
    let subscription = FarmContent::Subscription { power: RelativePower::REFERENCE, lanes: 1.0 };
    farm.say(Performative::Subscribe, protocol::SUBSCRIBE, subscription);
    farm.pass(Duration::from_secs(29));
    assert_eq!((farm.orders, farm.stalls), (0, 0), "each write meets a row with another number");
    farm.pass(Duration::from_secs(3));
    assert_eq!((farm.orders, farm.stalls), (1, 1));
}
