//! A work with a time: passes over the whole picture, each as large as the time that is left allows.

use super::*;
use crate::Goal;

/// Of the time asked for; what is less is left: it goes into composing the picture and writing it.
const REST: f64 = 0.01;
/// A zone gets so much more, or less, than the mean, at most: its error is an estimate.
const WEIGHT_RANGE: (f64, f64) = (0.5, 2.0);

/// A zone that waits for what comes next.
struct Waiting {
    zone: ZoneId,
    samples: u32,
    samples_max: u32,
    /// Of one sample of all its pixels, in reference-machine seconds.
    cost: f64,
    error: Option<f64>,
}

impl Master {
    /// Gives all zones their next samples when all have those of the pass before; or ends the work.
    pub(super) fn plan_pass(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let Some(&Goal::Time(limit)) = self.board.work().map(|work| &work.settings.goal) else { return };
        if !self.ledger.all_wait() || !self.writes.is_empty() {
            return;
        }
        let waiting: Vec<Waiting> = self.board.zones().filter_map(Waiting::of).collect();
        if waiting.is_empty() {
            return;
        }
        let left = limit.as_secs_f64() * (1.0 - REST) - now.elapsed().as_secs_f64();
        let share = self.config.goals.time_share(left / limit.as_secs_f64().max(1e-9));
        let budget = left * share * self.speed(now);
        let goals = next_samples(&waiting, budget);
        (self.pass_begun, self.pass_painted) = (now, Duration::ZERO);
        for (zone, goal) in waiting.iter().zip(goals) {
            let Some((_, row)) = self.board.zone(zone.zone) else { continue };
            let time_estimated = Some(Duration::from_secs_f64(zone.cost * f64::from(goal - zone.samples)));
            let row = match goal > zone.samples {
                true => ZoneRow { goal: Some(goal), time_estimated, ..row.clone() },
                false => ZoneRow { state: ZoneState::Done, ..row.clone() },
            };
            self.write(now, row, RowFollowUp::TakenBack, actions);
        }
    }

    /// Reference-machine seconds that were painted in a second, over the pass before: waiting, learning and the loss
    /// among many processors are in it.
    fn speed(&self, now: Time) -> f64 {
        let painted = self.pass_painted.as_secs_f64();
        let took = (now - self.pass_begun).as_secs_f64();
        if painted > 0.0 && took > 0.0 { painted / took } else { self.roster.field().speed() }
    }
}

impl Waiting {
    fn of(row: &ZoneRow) -> Option<Self> {
        let choice = row.choice.filter(|_| row.is_waiting())?;
        let cost = row.time_estimated.map_or(0.0, |time| time.as_secs_f64()).max(1e-9);
        Some(Self { zone: row.zone, samples: row.samples_done(), samples_max: choice.samples, cost, error: row.error })
    }
}

/// How many samples each zone should have next, so that all of them cost `budget` reference-machine seconds. Noisy zones
/// get more: for the least error of the whole picture in a given time, samples go with error × √(samples / cost). All as
/// they are: the budget is not enough for one sample more.
fn next_samples(waiting: &[Waiting], budget: f64) -> Vec<u32> {
    let known = |zone: &Waiting| zone.error.map(|error| error * (f64::from(zone.samples) / zone.cost).sqrt());
    let area_cost: f64 = waiting.iter().map(|zone| zone.cost).sum();
    let mean = budget / area_cost;
    if mean.is_nan() || mean < 1.0 {
        return waiting.iter().map(|zone| zone.samples).collect();
    }
    let wanted: Vec<f64> = waiting.iter().map(|zone| known(zone).unwrap_or(0.0)).collect();
    let cost_of = |weights: &[f64]| weights.iter().zip(waiting).map(|(w, zone)| w * zone.cost).sum::<f64>();
    let scale = cost_of(&wanted) / area_cost;
    let weight = |wanted: &f64| if scale > 0.0 { (wanted / scale).clamp(WEIGHT_RANGE.0, WEIGHT_RANGE.1) } else { 1.0 };
    let weights: Vec<f64> = wanted.iter().map(weight).collect();
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
