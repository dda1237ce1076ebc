//! What must hold after every simulated run, whatever went wrong in it.

use bottega_agents::driver::Simulator;

use super::studio::Studio;
use crate::{FarmAgent, FarmValue, Partition, WorkRow, ZoneId, ZoneState, work_prefix};

/// Checks a run that has ended. Returns what does not hold; nothing, when all is well.
///
/// - Each zone was composed exactly once into the film of the last Master, of samples that were painted under its latest
///   order, or was given up; the work ended once. (What the world saw on the way.)
/// - On the Blackboard every zone is done or given up, and all together cover the frame exactly once.
/// - What is done was done under the latest order, by the agent that the row names.
/// - Credits are numbers.
/// - No agent that lives has anything in hand but orders that were taken from it.
pub(super) fn check(simulator: &Simulator<FarmAgent, Studio>, work: &WorkRow) -> Vec<String> {
    let studio = simulator.world();
    let film = &studio.film;
    let mut broken = film.broken.clone();
    let mut must = |holds: bool, what: &dyn Fn() -> String| {
        if !holds && broken.len() < 2 * super::studio::BROKEN_MAX {
            broken.push(what());
        }
    };
    let Some((_, failed)) = &film.finished else { return broken };
    let mut rects = Vec::with_capacity(work.zone_count as usize);
    let (mut done, mut given_up): (usize, Vec<ZoneId>) = (0, Vec::new());
    for entry in simulator.store().with_prefix(&work_prefix(work.work)) {
        match &entry.value {
            FarmValue::Zone(row) => {
                rects.push(row.rect);
                match row.state {
                    ZoneState::Done => {
                        done += 1;
                        must(film.composed.contains(&row.zone), &|| format!("{} is done and not composed", row.zone));
                        let newest = film.newest.get(&row.zone);
                        let fence = row.result.map(|result| result.fence);
                        must(newest.map(|newest| newest.0) == fence, &|| {
                            format!("{} is done under {fence:?}, and {newest:?} was begun", row.zone)
                        });
                        let whose = newest.map(|newest| &studio.names[newest.1]);
                        must(whose == row.agent.as_ref(), &|| format!("{} was painted by {whose:?}", row.zone));
                    }
                    ZoneState::Failed => given_up.push(row.zone),
                    state => must(false, &|| format!("{} is {state:?} at the end", row.zone)),
                }
            }
            FarmValue::Agent(row) => {
                must(row.credit.is_finite(), &|| format!("{} has a credit of {}", row.agent, row.credit));
            }
            FarmValue::Work(_) => {}
        }
    }
    given_up.sort_unstable();
    must(given_up == *failed, &|| format!("{given_up:?} were given up, and {failed:?} are told"));
    must(done == film.composed.len(), &|| format!("{done} zones are done, and {} composed", film.composed.len()));
    must(Partition::covers(work.settings.frame, &rects), &|| "the zones do not cover the frame once".to_owned());
    for name in &studio.names {
        let Some(FarmAgent::Render(agent)) = simulator.machine(name) else { continue };
        for (zone, fence) in agent.hands() {
            let newest = film.newest.get(&zone).is_some_and(|(newest, _)| *newest == fence);
            let valid = newest && film.composed.contains(&zone);
            must(!valid, &|| format!("{name} still has {zone} in hand under a valid order"));
        }
    }
    broken
}
