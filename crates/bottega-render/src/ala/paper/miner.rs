//! The gold miner: how an agent decides how many sensors it deploys, and how far (§4.3, algorithm 1).

/// γ at the beginning. The paper prints 0, with which nobody would ever dig.
const GAMMA: f32 = 1.0;
/// What all that was found takes from the wish to find more (the paper's Σσ ∕ 10).
const SATIETY: f32 = 0.1;
/// The coefficient of interest of a sensor lies between minus and plus this.
const SIGMA_MAX: f32 = 1.0;
/// Stimulation while there are few sensors, discouragement when there are many.
const FEW: f32 = 0.5;
const MANY: f32 = -1.0;

/// The kind of sensor that an agent digs with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tool {
    /// Sensors that are few, that are many, and that are the most.
    pub(super) few: u32,
    pub(super) many: u32,
    pub(super) most: u32,
    /// How much farther from the agent each sensor is than the one before (ε).
    pub(super) step: f32,
    /// What the agent knows of its place before it digs: above 0 stimulates, below discourages.
    pub(super) excitement: f32,
}

/// An agent that deploys sensors of one kind.
#[derive(Clone, Debug)]
pub(super) struct Miner {
    tool: Tool,
    gamma: f32,
    sum: f32,
    count: u32,
}

impl Miner {
    pub(super) fn new(tool: Tool) -> Self {
        Self { tool, gamma: GAMMA, sum: 0.0, count: 0 }
    }

    /// The number of the next sensor and how far from the agent it goes; `None`: no more.
    pub(super) fn next(&self) -> Option<(u32, f32)> {
        let digs_on = self.gamma > 0.0 && self.count < self.tool.most;
        digs_on.then_some((self.count, self.count as f32 * self.tool.step))
    }

    /// Takes the coefficient of interest σ of the sensor that was deployed.
    pub(super) fn take(&mut self, sigma: f32) {
        let sigma = if sigma.is_nan() { 0.0 } else { sigma.clamp(-SIGMA_MAX, SIGMA_MAX) };
        self.count += 1;
        self.gamma += sigma - SATIETY * self.sum + self.tool.excitement;
        self.gamma += if self.count <= self.tool.few { FEW } else { 0.0 };
        self.gamma += if self.count >= self.tool.many { MANY } else { 0.0 };
        // What bores does not make hungry.
        self.sum += sigma.max(0.0);
    }

    pub(super) fn count(&self) -> u32 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOOL: Tool = Tool { few: 4, many: 16, most: 24, step: 0.5, excitement: -0.25 };

    fn dig(tool: Tool, sigma: impl Fn(u32) -> f32) -> Vec<f32> {
        let mut miner = Miner::new(tool);
        let mut distances = Vec::new();
        while let Some((number, distance)) = miner.next() {
            distances.push(distance);
            miner.take(sigma(number));
        }
        assert_eq!(miner.count() as usize, distances.len());
        distances
    }

    #[test]
    fn who_finds_nothing_stops_and_who_finds_gold_digs_on() {
        // 1 + 4 × (0.5 − 0.25) = 2, and then eight times 0.25 less.
        let bored = dig(TOOL, |_| 0.0);
        assert_eq!(bored.len(), 12);
        assert_eq!((bored[0], bored[11]), (0.0, 5.5));
        assert!(dig(TOOL, |_| 0.5).len() > bored.len() + 2);
        assert_eq!(dig(TOOL, |_| -1.0).len(), 2);
    }

    #[test]
    fn digging_ends_whatever_is_found() {
        for sigma in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            let count = dig(TOOL, |_| sigma).len();
            assert!((1..=24).contains(&count), "{sigma}: {count}");
        }
        let forever = Tool { excitement: 100.0, ..TOOL };
        assert_eq!(dig(forever, |_| 1.0).len(), 24);
    }
}
