//! The gold miner: how many sensors an agent deploys, and at which distances (§4.3, algorithm 1).

/// Initial γ. The paper prints 0, with which no agent ever digs.
const GAMMA: f32 = 1.0;
/// Factor of the sum of σ that lowers γ (the paper's Σσ ∕ 10).
const SATIETY: f32 = 0.1;
/// Greatest absolute coefficient of interest.
const SIGMA_MAX: f32 = 1.0;
/// Change of γ while there are few sensors, and once there are many.
const FEW: f32 = 0.5;
const MANY: f32 = -1.0;

/// Parameters of one kind of sensor.
#[derive(Clone, Copy, Debug)]
pub(super) struct SensorParams {
    /// Number of sensors up to which they are few.
    pub(super) few: u32,
    /// Number of sensors from which they are many.
    pub(super) many: u32,
    /// Greatest number of sensors.
    pub(super) most: u32,
    /// Distance between successive sensors, in scene units (ε).
    pub(super) step: f32,
    /// Excitement of the agent by its earlier sensors: positive stimulates, negative discourages.
    pub(super) excitement: f32,
}

/// An agent that deploys sensors of one kind.
#[derive(Clone, Debug)]
pub(super) struct Miner {
    params: SensorParams,
    gamma: f32,
    sum: f32,
    count: u32,
}

impl Miner {
    /// Starts digging with initial stimulation.
    pub(super) fn new(params: SensorParams) -> Self {
        Self { params, gamma: GAMMA, sum: 0.0, count: 0 }
    }

    /// Returns the number of the next sensor and its distance from the agent; `None`: stop digging.
    pub(super) fn next(&self) -> Option<(u32, f32)> {
        let digs_on = self.gamma > 0.0 && self.count < self.params.most;
        digs_on.then_some((self.count, self.count as f32 * self.params.step))
    }

    /// Updates γ by the coefficient of interest σ of the deployed sensor.
    pub(super) fn take(&mut self, sigma: f32) {
        let sigma = if sigma.is_nan() { 0.0 } else { sigma.clamp(-SIGMA_MAX, SIGMA_MAX) };
        self.count += 1;
        self.gamma += sigma - SATIETY * self.sum + self.params.excitement;
        self.gamma += if self.count <= self.params.few { FEW } else { 0.0 };
        self.gamma += if self.count >= self.params.many { MANY } else { 0.0 };
        // Only interesting sensors satiate
        self.sum += sigma.max(0.0);
    }

    /// Returns the number of sensors deployed.
    pub(super) fn count(&self) -> u32 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARAMS: SensorParams = SensorParams { few: 4, many: 16, most: 24, step: 0.5, excitement: -0.25 };

    fn dig(params: SensorParams, sigma: impl Fn(u32) -> f32) -> Vec<f32> {
        let mut miner = Miner::new(params);
        let mut distances = Vec::new();
        while let Some((number, distance)) = miner.next() {
            distances.push(distance);
            miner.take(sigma(number));
        }
        assert_eq!(miner.count() as usize, distances.len());
        distances
    }

    #[test]
    fn a_miner_stops_without_gold_and_continues_with_it() {
        // 1 + 4 × (0.5 − 0.25) = 2, and then eight times 0.25 less.
        let bored = dig(PARAMS, |_| 0.0);
        assert_eq!(bored.len(), 12);
        assert_eq!((bored[0], bored[11]), (0.0, 5.5));
        assert!(dig(PARAMS, |_| 0.5).len() > bored.len() + 2);
        assert_eq!(dig(PARAMS, |_| -1.0).len(), 2);
    }

    #[test]
    fn digging_always_ends() {
        for sigma in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            let count = dig(PARAMS, |_| sigma).len();
            assert!((1..=24).contains(&count), "{sigma}: {count}");
        }
        let forever = SensorParams { excitement: 100.0, ..PARAMS };
        assert_eq!(dig(forever, |_| 1.0).len(), 24);
    }
}
