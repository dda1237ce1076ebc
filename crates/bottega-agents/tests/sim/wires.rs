//! Simulated connections: they take time, fail before or after the message was taken, and take it twice.

use std::{
    collections::{BTreeMap, VecDeque},
    time::Duration,
};

use bottega_agents::{
    AgentId, Random, Time, World,
    acc::{Letter, Outbound},
    gateway::{ChannelEffect, ChannelReport},
    wire::{parse_envelope, print_envelope},
};

use super::process::{Deed, Process};

/// The probability of each fault.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weather {
    /// Share of messages that are not taken: the next address is tried.
    pub(crate) lost: f64,
    /// Share of messages that are taken without an answer to the sender, which then tries the next address.
    pub(crate) unanswered: f64,
    /// Share of messages that arrive twice.
    pub(crate) twice: f64,
    /// The longest time a message takes.
    pub(crate) late: Duration,
    /// The time at which all faults end.
    pub(crate) until: Time,
}

/// Time without an answer after which a message counts as not taken.
const GIVES_UP_AFTER: Duration = Duration::from_secs(3);

/// A lane: messages from one process to one first address, sent one after the other.
type Lane = (AgentId, String);

struct Flight {
    number: u64,
    /// The life of the sender.
    life: u32,
    outbound: Box<Outbound>,
    /// Number of addresses tried.
    tried: usize,
}

enum Event {
    /// A message arrives at an address, or does not.
    Arrive { lane: Lane, flight: u64, to: Option<AgentId>, answered: bool },
    /// A message that was taken arrives again.
    Again { to: AgentId, letter: Box<Letter> },
    /// The sender's time to wait is over.
    Next { lane: Lane, flight: u64 },
}

pub(crate) struct Wires {
    weather: Weather,
    random: Random,
    /// The listening process at each address.
    at: BTreeMap<String, AgentId>,
    /// Number of times that each process began to listen, and whether it listens now.
    lives: BTreeMap<AgentId, (u32, bool)>,
    lanes: BTreeMap<Lane, VecDeque<Flight>>,
    events: BTreeMap<(Time, u64), Event>,
    number: u64,
}

impl Wires {
    pub(crate) fn new(seed: u64, weather: Weather, at: BTreeMap<String, AgentId>) -> Self {
        Self {
            weather,
            random: Random::new(seed),
            at,
            lives: BTreeMap::new(),
            lanes: BTreeMap::new(),
            events: BTreeMap::new(),
            number: 0,
        }
    }

    fn plan(&mut self, at: Time, event: Event) {
        self.number += 1;
        self.events.insert((at, self.number), event);
    }

    fn chance(&mut self, now: Time, share: f64) -> bool {
        self.random.unit() < share && now < self.weather.until
    }

    /// Begins to send the first message of a lane to its next address.
    fn try_next(&mut self, now: Time, lane: Lane, reports: &mut Vec<(AgentId, ChannelReport)>) {
        let life = self.life(&lane.0);
        let Some(queue) = self.lanes.get_mut(&lane) else { return };
        while queue.front().is_some_and(|flight| Some(flight.life) != life) {
            queue.pop_front();
        }
        let Some(flight) = queue.front() else { return };
        let Some(address) = flight.outbound.addresses.get(flight.tried).cloned() else {
            if let Some(flight) = queue.pop_front() {
                let reason = "no connection".to_owned();
                reports.push((lane.0.clone(), ChannelReport::Failed { outbound: flight.outbound, reason }));
            }
            return self.try_next(now, lane, reports);
        };
        let number = flight.number;
        let to = self.at.get(&address).cloned().filter(|_| !self.chance(now, self.weather.lost));
        let answered = !self.chance(now, self.weather.unanswered);
        let takes = self.weather.late.mul_f64(self.random.unit().powi(3)) + Duration::from_millis(1);
        self.plan(now + takes, Event::Arrive { lane, flight: number, to, answered });
    }

    /// The number of the life of a process, while it lives.
    fn life(&self, process: &AgentId) -> Option<u32> {
        self.lives.get(process).filter(|(_, up)| *up).map(|(life, _)| *life)
    }

    /// The message as the other side reads it.
    fn letter(outbound: &Outbound) -> Letter {
        let envelope = parse_envelope(&print_envelope(&outbound.envelope).unwrap()).unwrap();
        Letter::open(envelope, outbound.payload.as_bytes()).unwrap()
    }

    fn arrive(
        &mut self,
        now: Time,
        (lane, number): (Lane, u64),
        to: Option<AgentId>,
        answered: bool,
        reports: &mut Vec<(AgentId, ChannelReport)>,
    ) {
        let Some(flight) = self.first(&lane, number) else { return };
        if Some(flight.life) != self.life(&lane.0) {
            // Its sender died, and the connection with it.
            return self.try_next(now, lane, reports);
        }
        let taker = to.filter(|to| self.life(to).is_some());
        if let Some(to) = &taker {
            let letter = Box::new(Self::letter(&flight.outbound));
            if self.chance(now, self.weather.twice) {
                let after = self.weather.late.mul_f64(3.0 * self.random.unit());
                self.plan(now + after, Event::Again { to: to.clone(), letter: letter.clone() });
            }
            reports.push((to.clone(), ChannelReport::Arrived(letter)));
        }
        if taker.is_some() && answered {
            if let Some(queue) = self.lanes.get_mut(&lane) {
                queue.pop_front();
            }
            return self.try_next(now, lane, reports);
        }
        if let Some(flight) = self.lanes.get_mut(&lane).and_then(VecDeque::front_mut) {
            flight.tried += 1;
        }
        let waits = if taker.is_some() { GIVES_UP_AFTER } else { Duration::from_millis(20) };
        self.plan(now + waits, Event::Next { lane, flight: number });
    }

    /// The message at the head of a lane, if it is this one.
    fn first(&self, lane: &Lane, number: u64) -> Option<&Flight> {
        self.lanes.get(lane)?.front().filter(|flight| flight.number == number)
    }
}

impl World<Process> for Wires {
    fn perform(
        &mut self,
        now: Time,
        agent: &AgentId,
        deed: Deed,
        _: &mut Random,
        _: &mut Vec<(Duration, ChannelReport)>,
    ) {
        match deed {
            Deed::Up => {
                let life = self.lives.entry(agent.clone()).or_default();
                *life = (life.0 + 1, true);
                // Its waiting messages are lost with it.
                self.lanes.retain(|(process, _), _| process != agent);
            }
            Deed::Channel(ChannelEffect::Send(outbound)) => {
                let lane = (agent.clone(), outbound.addresses[0].clone());
                let life = self.life(agent).unwrap_or_default();
                self.number += 1;
                let number = self.number;
                let queue = self.lanes.entry(lane.clone()).or_default();
                queue.push_back(Flight { number, life, outbound, tried: 0 });
                if queue.len() == 1 {
                    // Begins at once, after the messages of this step.
                    self.plan(now + Duration::from_micros(1), Event::Next { lane, flight: number });
                }
            }
            Deed::Channel(ChannelEffect::Passed(_)) => {}
        }
    }

    fn next_change(&self) -> Option<Time> {
        self.events.first_key_value().map(|((at, _), _)| *at)
    }

    fn change(&mut self, now: Time, reports: &mut Vec<(AgentId, ChannelReport)>) {
        while let Some(entry) = self.events.first_entry().filter(|entry| entry.key().0 <= now) {
            match entry.remove() {
                Event::Arrive { lane, flight, to, answered } => {
                    self.arrive(now, (lane, flight), to, answered, reports);
                }
                Event::Again { to, letter } => reports.push((to, ChannelReport::Arrived(letter))),
                Event::Next { lane, flight } => {
                    if self.first(&lane, flight).is_some() {
                        self.try_next(now, lane, reports);
                    }
                }
            }
        }
    }

    fn gone(&mut self, _: Time, agent: &AgentId) {
        if let Some(life) = self.lives.get_mut(agent) {
            life.1 = false;
        }
    }
}
