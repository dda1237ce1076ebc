//! The measured cost of zones, by complexity.

use std::{collections::BTreeMap, time::Duration};

use crate::{MemberId, Painting, ZoneRow, adaptation::scaled};

/// The measurements of all agents and of each one. Sums over many zones, so that single wrong measurements have little
/// weight.
#[derive(Clone, Debug, Default)]
pub(super) struct ZoneWorth {
    all: Measured,
    by_agent: BTreeMap<MemberId, Measured>,
}

/// The measurement of a promise to paint a zone.
#[derive(Clone, Copy, Debug)]
pub(super) struct KeptPromise {
    /// Time from order to report, by this Master's clock.
    pub(super) taken: Duration,
    /// Time expected for the order from other agents' measurements, in reference-machine time; `None`: no measurements.
    pub(super) worth: Option<Duration>,
}

/// Sums over painted zones.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    /// Reference-machine time, in seconds.
    seconds: f64,
    /// Complexity times samples.
    volume: f64,
}

impl Measured {
    fn add(&mut self, other: Self) {
        self.seconds += other.seconds;
        self.volume += other.volume;
    }

    fn but(self, other: Self) -> Self {
        Self { seconds: self.seconds - other.seconds, volume: self.volume - other.volume }
    }

    /// Returns the reference-machine seconds per sample and average pixel; `None`: too few measurements.
    fn rate(self) -> Option<f64> {
        (self.volume > 1e-6 && self.seconds > 0.0).then(|| self.seconds / self.volume)
    }
}

impl ZoneWorth {
    /// Takes in an agent's measured painting, which continues from the samples in `before`.
    pub(super) fn see(&mut self, agent: MemberId, before: &ZoneRow, painting: &Painting) {
        let samples = painting.result.samples.saturating_sub(before.samples_done());
        let measured =
            Measured { seconds: painting.time_measured.as_secs_f64(), volume: before.complexity * f64::from(samples) };
        if samples > 0 && measured.volume.is_finite() {
            self.all.add(measured);
            self.by_agent.entry(agent).or_default().add(measured);
        }
    }

    /// Returns the expected time of samples of a zone, in reference-machine time, from the measurements of agents
    /// other than `agent`; from all, if there are no others. `None`: no measurements.
    pub(super) fn of(&self, agent: Option<MemberId>, row: &ZoneRow, samples: u32) -> Option<Duration> {
        // Subtract the agent's own measurements from those of all
        let own = agent.and_then(|agent| self.by_agent.get(&agent)).copied().unwrap_or_default();
        let rate = self.all.but(own).rate().or_else(|| self.all.rate())?;
        let seconds = rate * row.complexity * f64::from(samples);
        seconds.is_finite().then(|| scaled(Duration::from_secs(1), seconds.max(0.0)))
    }
}

#[cfg(test)]
mod tests {
    use bottega_agents::{BlobId, Revision};
    use bottega_engines::Tunables;
    use bottega_image::{Rect, Sides};

    use super::*;
    use crate::{Choice, NeighborDifference, ResultRef, WorkId, ZoneId};

    fn row(complexity: f64) -> ZoneRow {
        ZoneRow::open(WorkId(1), ZoneId(0), Rect::of_size(8, 8), complexity, NeighborDifference::default())
    }

    fn painting(samples: u32, seconds: f64) -> Painting {
        let tunables = Tunables { max_depth: 8, light_samples: 1 };
        Painting {
            choice: Choice { tunables, samples: 64, bands: Sides::all(0) },
            result: ResultRef { fence: Revision(1), samples, digest: BlobId([0; 32]) },
            time_measured: Duration::from_secs_f64(seconds),
            busy: Duration::from_secs_f64(seconds),
            is_measured: true,
            was_ready: true,
            goal: samples,
            time_left: Duration::ZERO,
            error: None,
        }
    }

    #[test]
    fn a_zone_is_worth_what_others_found() {
        let mut worth = ZoneWorth::default();
        let [honest, odd] = [MemberId(0), MemberId(1)];
        assert_eq!(worth.of(Some(honest), &row(10.0), 4), None);
        // 20 ms for each sample and unit of complexity.
        worth.see(honest, &row(10.0), &painting(4, 0.8));
        worth.see(odd, &row(10.0), &painting(4, 400.0));
        assert_eq!(worth.of(Some(odd), &row(5.0), 64), Some(Duration::from_secs_f64(6.4)));
        let of_all = worth.of(None, &row(5.0), 64).unwrap().as_secs_f64();
        assert!((of_all - 320.0 * 400.8 / 80.0).abs() < 1e-6, "{of_all}");
        // An agent alone is measured by its own zones.
        let mut alone = ZoneWorth::default();
        alone.see(odd, &row(10.0), &painting(4, 0.4));
        assert_eq!(alone.of(Some(odd), &row(10.0), 8), Some(Duration::from_secs_f64(0.8)));
    }
}
