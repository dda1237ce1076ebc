//! Branches: splitting of paths and adjoint-driven Russian roulette.

use std::ops::RangeInclusive;

use super::{
    super::transport::ROULETTE_SURVIVAL_MAX,
    state::{Branch, Path},
};
use crate::guide::RegionAgent;

/// Least expected number of branches per vertex.
const SURVIVAL_MIN: f32 = 0.3;
/// Greatest expected number of branches per vertex.
const SPLIT_MAX: f32 = 8.0;
/// Expected numbers that count as exactly one branch.
const ONE: RangeInclusive<f32> = 0.7..=1.4;

impl Path<'_> {
    /// Returns the current state as a branch.
    #[inline(always)]
    pub(super) fn branch(&self) -> Branch {
        Branch {
            sampler: self.sampler,
            throughput: self.throughput,
            absorption: self.absorption,
            roulette_scale: self.roulette_scale,
            depth: self.depth,
            origin: self.origin,
            direction: self.direction,
            cone: self.cone,
            previous: self.previous,
        }
    }

    /// Continues with a branch; radiance and record stay, as all branches share them.
    #[inline(always)]
    pub(in crate::integrator) fn go_back(&mut self, branch: &Branch) {
        self.sampler = branch.sampler;
        self.throughput = branch.throughput;
        self.absorption = branch.absorption;
        self.roulette_scale = branch.roulette_scale;
        self.depth = branch.depth;
        self.origin = branch.origin;
        self.direction = branch.direction;
        self.cone = branch.cone;
        self.previous = branch.previous;
    }

    /// Looks up the importance of light to the pixel at `place` in the picture, in [0, 1)².
    #[inline(always)]
    pub(in crate::integrator) fn expect(&mut self, place: [f32; 2]) {
        if let Some(guide) = self.guide {
            self.worth = guide.expected().at(place);
        }
    }

    /// Returns the number of branches that continue, 0 if the path ends, and divides the throughput by the expected
    /// number.
    ///
    /// - `agent`: of the region; `None`: ordinary Russian roulette.
    /// - `u`: uniform random number.
    /// - `room`: how many branches more may wait.
    #[inline(always)]
    pub(super) fn split(&mut self, agent: Option<&RegionAgent>, u: f32, room: usize) -> u32 {
        let settings = self.integrator.settings;
        if !self.integrator.splits {
            return 1;
        }
        // Compute the survival probability of ordinary Russian roulette
        let usual = if self.depth <= settings.roulette_depth {
            1.0
        } else {
            (self.throughput.max_element() * self.roulette_scale).sqrt().min(ROULETTE_SURVIVAL_MAX)
        };
        let many = match agent {
            // Compute the expected number of branches from what the agent learned
            Some(agent) if self.worth > 0.0 => {
                let worth = agent.worth(self.throughput.max_element() * self.worth);
                // Keep one branch where about one is expected: little to gain, and each random decision adds noise
                if ONE.contains(&worth) || worth < 1.0 && self.depth == 0 {
                    1.0
                } else {
                    worth.clamp(SURVIVAL_MIN, SPLIT_MAX).min(room as f32 + 1.0)
                }
            }
            _ => usual,
        };
        // End paths that carry nothing or NaN
        if many <= 0.0 || many.is_nan() {
            return 0;
        }
        // Round the expected number up or down at random
        self.throughput /= many;
        self.roulette_scale *= many.max(1.0);
        let whole = many.floor();
        whole as u32 + u32::from(u < many - whole)
    }
}
