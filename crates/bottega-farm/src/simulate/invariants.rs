//! Invariants that hold during and after every simulated run, whatever faults occur.

use std::time::Duration;

use bottega_agents::{AgentId, Time, driver::Simulator};
use bottega_image::Rect;

use super::{film::BROKEN_MAX, simulated_farm::SimulatedFarm};
use crate::{FarmAgent, FarmValue, Partition, ResultRef, Watchdog, WorkKeys, WorkRow, ZoneId, ZoneRow, ZoneState};

/// Virtual time between checks for stalls.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Checks during a run for stalls: zones wait while agents are free and nothing starts. It looks from outside, at the
/// zones agents hold. The Master's own check is stricter and must find nothing either.
#[derive(Debug)]
pub(super) struct IdleWatch {
    master: AgentId,
    watchdog: Watchdog,
    next_look: Time,
    /// The violation, if any.
    pub(super) broken: Option<String>,
}

impl IdleWatch {
    pub(super) fn new(master: AgentId) -> Self {
        Self { master, watchdog: Watchdog::default(), next_look: Time::ZERO, broken: None }
    }

    /// Checks the current state. Called after each event.
    pub(super) fn look(&mut self, simulator: &Simulator<FarmAgent, SimulatedFarm>) {
        let now = simulator.now();
        if now < self.next_look || self.broken.is_some() {
            return;
        }
        self.next_look = now + LOOK_EVERY;
        let world = simulator.world();
        let waiting = match simulator.machine(&self.master) {
            Some(FarmAgent::Master(master)) => master.waiting_count(),
            _ => 0,
        };
        let mut free = 0;
        let mut is_idle = waiting > 0;
        for name in world.names.iter().take_while(|_| waiting > 0) {
            if let Some(FarmAgent::Render(agent)) = simulator.machine(name) {
                free += usize::from(agent.is_free());
                is_idle &= agent.held_zones().next().is_none();
            }
        }
        if let Some(waited) = self.watchdog.look(now, is_idle && free > 0, world.orders_begun) {
            let seconds = waited.as_secs();
            self.broken = Some(format!("{waiting} zones waited for {seconds} s, and all of {free} agents were free"));
        }
    }
}

/// Checks a run that has ended. Returns the violations; none if all is well.
///
/// - Each zone was composed exactly once into the last Master's film, from samples painted under its latest order, or
///   was given up; the work ended once. (Recorded by the film's log.)
/// - On the Blackboard every zone is done or given up, and together they cover the frame exactly once.
/// - Each finished zone was finished under its latest order, by the agent in its row; the pieces of a zone cover it
///   and its band exactly once.
/// - If paintings are compared: wrong zones in the picture were accepted on one agent's word, and none depends on an
///   agent that was found wrong.
/// - Credits are finite.
/// - A live agent holds only valid orders or orders that were taken from it.
pub(super) fn check(simulator: &Simulator<FarmAgent, SimulatedFarm>, work: &WorkRow, verify: u32) -> Vec<String> {
    let world = simulator.world();
    let film = &world.film;
    let mut broken = film.broken.clone();
    let mut must = |holds: bool, what: &dyn Fn() -> String| {
        if !holds && broken.len() < 2 * BROKEN_MAX {
            broken.push(what());
        }
    };
    let Some((_, failed)) = &film.finished else { return broken };
    let mut zones: Vec<&ZoneRow> = Vec::with_capacity(work.zone_count as usize);
    let mut given_up: Vec<ZoneId> = Vec::new();
    let (mut words, mut convicts) = (Vec::new(), Vec::new());
    let prefix = WorkKeys::new(work.work).prefix();
    for entry in simulator.store().with_prefix(&prefix) {
        match &entry.value {
            FarmValue::Zone(row) => {
                zones.push(row);
                match (row.state, row.result) {
                    (ZoneState::Done, Some(ResultRef { fence, .. })) => {
                        must(film.is_composed(row.zone), &|| format!("{} is done and not composed", row.zone));
                        must(film.is_valid(row.zone, fence), &|| format!("{} is done under {fence:?}", row.zone));
                        let is_sound = verify < 2 || row.word_of.is_some() || !film.is_wrong(row.zone);
                        must(is_sound, &|| format!("{} is wrong, and was compared", row.zone));
                        if let Some(agent) = &row.word_of {
                            words.push(agent.clone());
                        }
                        let whose = film.whose(row.zone, fence).map(|agent| &world.names[agent]);
                        must(whose == row.agent.as_ref(), &|| format!("{} was painted by {whose:?}", row.zone));
                    }
                    (ZoneState::Failed, _) => given_up.push(row.zone),
                    (state, _) => must(false, &|| format!("{} is {state:?} at the end", row.zone)),
                }
            }
            FarmValue::Agent(row) => {
                if row.left_out.is_some() && row.failures == 0 {
                    convicts.push(row.agent.clone());
                }
                must(row.credit.sum.is_finite(), &|| format!("{} has a credit of {}", row.agent, row.credit.sum));
            }
            FarmValue::Work(_) => {}
            FarmValue::Page(_) => must(false, &|| format!("{} is a page among the rows", entry.key)),
        }
    }
    let is_convict = |agent: &&AgentId| convicts.contains(agent);
    must(!words.iter().any(|agent| is_convict(&agent)), &|| format!("the word of one of {convicts:?} counts"));
    given_up.sort_unstable();
    must(given_up == *failed, &|| format!("{given_up:?} were given up, and {failed:?} are reported"));
    let done = zones.len() - given_up.len();
    must(done == film.composed_count(), &|| format!("{done} zones are done, and {} composed", film.composed_count()));
    let rects: Vec<Rect> = zones.iter().filter(|row| row.root.is_none()).map(|row| row.rect).collect();
    must(Partition::covers(work.settings.frame, &rects), &|| "the zones do not cover the frame once".to_owned());
    for root in torn(zones, &work.settings.frame) {
        must(false, &|| format!("the pieces of {root} do not cover it once"));
    }
    for name in &world.names {
        let Some(FarmAgent::Render(agent)) = simulator.machine(name) else { continue };
        for (zone, fence) in agent.held_zones() {
            let valid = film.is_valid(zone, fence) && !film.is_taken_over(zone) && film.is_composed(zone);
            must(!valid, &|| format!("{name} still has {zone} in hand under a valid order"));
        }
    }
    broken
}

/// Returns the zones whose pieces do not cover them and their bands exactly once.
fn torn(mut rows: Vec<&ZoneRow>, frame: &Rect) -> Vec<ZoneId> {
    // Skip zones that were never cut
    rows.retain(|row| row.root.is_some() || row.cut.is_some());
    rows.sort_unstable_by_key(|row| (row.root(), row.zone));
    let mut torn = Vec::new();
    for pieces in rows.chunk_by(|a, b| a.root() == b.root()).filter(|pieces| pieces.len() > 1) {
        let root = pieces[0].root();
        let Some(choice) = pieces[0].choice else { continue };
        let whole = pieces[0].rect.grown_by(choice.bands, frame);
        let painted: Vec<Rect> = pieces.iter().map(|row| row.painted(&choice, frame)).collect();
        if !Partition::covers(whole, &painted) {
            torn.push(root);
        }
    }
    torn
}
