//! Branches: a path goes on as several, or as none.

use std::ops::RangeInclusive;

use super::{
    super::transport::ROULETTE_SURVIVAL_MAX,
    state::{Branch, Path},
};
use crate::guide::Agent;

/// Least and greatest number of paths that one goes on as on the average, and numbers that count as one.
const SURVIVAL_MIN: f32 = 0.3;
const SPLIT_MAX: f32 = 8.0;
const ONE: RangeInclusive<f32> = 0.7..=1.4;

impl Path<'_> {
    /// The path as it is.
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

    /// Goes on as a branch does, with what all have found.
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

    /// Looks up what light is worth to the pixel at `place` in the picture, in [0, 1)².
    #[inline(always)]
    pub(in crate::integrator) fn expect(&mut self, place: [f32; 2]) {
        if let Some(guide) = self.guide {
            self.worth = guide.expected().at(place);
        }
    }

    /// Decides as how many paths this one goes on, each of which carries its part; `room`: one more at most.
    #[inline(always)]
    pub(super) fn split(&mut self, agent: Option<&Agent>, u: f32, room: usize) -> u32 {
        let settings = self.integrator.settings;
        if !self.integrator.splits {
            return 1;
        }
        // As paths do who know no agents.
        let usual = if self.depth <= settings.roulette_depth {
            1.0
        } else {
            (self.throughput.max_element() * self.roulette_scale).sqrt().min(ROULETTE_SURVIVAL_MAX)
        };
        let many = match agent {
            Some(agent) if self.worth > 0.0 => {
                let worth = agent.worth(self.throughput.max_element() * self.worth);
                // About one is one: there is little to be won, and what is decided by chance is noise.
                if ONE.contains(&worth) || worth < 1.0 && self.depth == 0 {
                    1.0
                } else {
                    worth.clamp(SURVIVAL_MIN, SPLIT_MAX).min(room as f32 + 1.0)
                }
            }
            _ => usual,
        };
        // (Nothing is carried, or what is no number.)
        if many <= 0.0 || many.is_nan() {
            return 0;
        }
        self.throughput /= many;
        self.roulette_scale *= many.max(1.0);
        let whole = many.floor();
        whole as u32 + u32::from(u < many - whole)
    }
}
