//! Goal of a time: passes over the whole picture, each as large as the remaining time allows.

use std::time::Duration;

use bottega_agents::Time;

use super::{assignments::Assignments, rows::RowFollowUp};
use crate::{FarmAction, Goal, ZoneId, ZoneRow, ZoneState};

/// Share of the requested time kept for composing and writing the picture.
const REST: f64 = 0.01;
/// Range of a zone's number of samples relative to the mean, because its error is only an estimate.
const WEIGHT_RANGE: (f64, f64) = (0.5, 2.0);

/// A zone that waits for the next pass.
struct Waiting {
    zone: ZoneId,
    samples: u32,
    samples_max: u32,
    /// Reference-machine seconds for one sample of all its pixels.
    cost: f64,
    error: Option<f64>,
}

/// The pass over the picture in progress.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pass {
    /// The time at which the pass began.
    begun: Time,
    /// Reference-machine time painted in it.
    painted: Duration,
}

impl Pass {
    pub(super) fn new(begun: Time) -> Self {
        Self { begun, painted: Duration::ZERO }
    }

    /// Adds the reference-machine time of a painting.
    pub(super) fn add(&mut self, painted: Duration) {
        self.painted += painted;
    }

    /// Plans the next pass when all zones have finished the last one, or ends the work.
    pub(super) fn plan_next(&mut self, now: Time, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
        let board = assignments.rows.board();
        let Some(&Goal::Time(limit)) = board.work().map(|work| &work.settings.goal) else { return };
        if !assignments.ledger.all_wait() || assignments.rows.has_writes() {
            return;
        }
        // Collect the waiting zones
        let waiting: Vec<Waiting> = board.zones().filter_map(Waiting::of).collect();
        if waiting.is_empty() {
            return;
        }
        // Choose the share of the remaining time for this pass, and how much that is at the speed of the last one; before
        // the first pass at the agents' reported speeds
        let left = limit.as_secs_f64() * (1.0 - REST) - now.elapsed().as_secs_f64();
        let share = assignments.config.goals.time_share(left / limit.as_secs_f64().max(1e-9));
        let budget = left * share * self.speed(now).unwrap_or_else(|| assignments.roster.field().speed());
        // Distribute it among the zones
        let goals = next_samples(&waiting, budget);
        *self = Self::new(now);
        // Write the new goals; zones without more samples are done
        for (zone, goal) in waiting.iter().zip(goals) {
            let Some((_, row)) = assignments.rows.zone(zone.zone) else { continue };
            let time_estimated = Some(Duration::from_secs_f64(zone.cost * f64::from(goal - zone.samples)));
            let row = match goal > zone.samples {
                true => ZoneRow { goal: Some(goal), time_estimated, ..row.clone() },
                false => ZoneRow { state: ZoneState::Done, ..row.clone() },
            };
            assignments.write(now, row, RowFollowUp::TakenBack, actions);
        }
    }

    /// Returns the reference-machine seconds painted per second during the pass, including all losses; `None`: nothing
    /// was painted.
    fn speed(&self, now: Time) -> Option<f64> {
        let painted = self.painted.as_secs_f64();
        let took = (now - self.begun).as_secs_f64();
        (painted > 0.0 && took > 0.0).then(|| painted / took)
    }
}

impl Waiting {
    fn of(row: &ZoneRow) -> Option<Self> {
        let choice = row.choice.filter(|_| row.is_waiting())?;
        let cost = row.time_estimated.map_or(0.0, |time| time.as_secs_f64()).max(1e-9);
        Some(Self { zone: row.zone, samples: row.samples_done(), samples_max: choice.samples, cost, error: row.error })
    }
}

/// Returns the number of samples each zone should reach, for a total cost of `budget` reference-machine seconds.
/// Noisy zones get more: the least error of the whole picture for a given time needs additional samples in proportion
/// to error × √(samples / cost). Unchanged if the budget is too small for one more sample.
fn next_samples(waiting: &[Waiting], budget: f64) -> Vec<u32> {
    // Compute the weight of each zone from its error
    let known = |zone: &Waiting| zone.error.map(|error| error * (f64::from(zone.samples) / zone.cost).sqrt());
    let area_cost: f64 = waiting.iter().map(|zone| zone.cost).sum();
    let mean = budget / area_cost;
    if mean.is_nan() || mean < 1.0 {
        return waiting.iter().map(|zone| zone.samples).collect();
    }
    let wanted: Vec<f64> = waiting.iter().map(|zone| known(zone).unwrap_or(0.0)).collect();
    let cost_of = |weights: &[f64]| weights.iter().zip(waiting).map(|(w, zone)| w * zone.cost).sum::<f64>();
    // Normalize the weights by cost and clamp them
    let scale = cost_of(&wanted) / area_cost;
    let weight = |wanted: &f64| if scale > 0.0 { (wanted / scale).clamp(WEIGHT_RANGE.0, WEIGHT_RANGE.1) } else { 1.0 };
    let weights: Vec<f64> = wanted.iter().map(weight).collect();
    // Scale them to the budget
    let scale = mean * area_cost / cost_of(&weights);
    let next = |(zone, weight): (&Waiting, f64)| {
        let more = (weight * scale).round().max(1.0) as u32;
        zone.samples.saturating_add(more).min(zone.samples_max)
    };
    waiting.iter().zip(weights).map(next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(cost: f64, error: Option<f64>) -> Waiting {
        Waiting { zone: ZoneId(0), samples: 8, samples_max: 1000, cost, error }
    }

    #[test]
    fn a_budget_is_spent_and_noisy_zones_get_more_of_it() {
        let zones = [zone(0.1, Some(0.1)), zone(0.1, Some(0.3)), zone(0.2, Some(0.1))];
        let next = next_samples(&zones, 40.0);
        let spent: f64 = zones.iter().zip(&next).map(|(zone, next)| zone.cost * f64::from(next - 8)).sum();
        assert!((spent / 40.0 - 1.0).abs() < 0.02, "{spent}");
        assert!(next[1] > next[0] && next[0] > next[2], "{next:?}");
        assert_eq!(next_samples(&zones, 0.3), [8, 8, 8]);
        assert_eq!(next_samples(&zones, f64::NAN), [8, 8, 8]);
        assert_eq!(next_samples(&[zone(0.1, None)], 4.0), [48]);
        assert_eq!(next_samples(&[zone(0.1, None)], 1e9), [1000]);
    }
}
