//! Projection maps: directions in which photons must leave the lights to hit mirrors and glass (Jensen 2001, §5.2).
//!
//! Jensen's map covers directions from a point. This one covers the random numbers that a photon is emitted by: source,
//! position on it, and direction. So it works for all kinds of sources. Cells in which trial photons found nothing are
//! sampled less, but never omitted: the estimate stays unbiased.

use crate::sampler::Quad;

/// Cells along each number, in the order in which they are chosen: source, position (2), direction (2).
pub(super) const CELLS: [usize; 5] = [4, 4, 4, 8, 8];
/// Weight of the findings of neighbouring cells.
const NEIGHBOR: f64 = 0.1;
/// Share of the photons that are emitted as without a map.
const BLIND: f64 = 0.2;
/// One caustic photon is sent per this many photons of all light.
pub(super) const SHARE: u32 = 4;

/// Probabilities of the cells, as a tree.
#[derive(Debug)]
pub(crate) struct Projection {
    /// Probabilities, by number of choices made: the last level has single cells. Empty: no photon hits mirrors or
    /// glass.
    levels: Vec<Vec<f32>>,
    /// Share of the caustic photons that lookouts see: if emitted without their importance, and with it.
    shares_seen: Option<[f64; 2]>,
}

impl Projection {
    /// Builds a map from the trial photons found per cell.
    pub(super) fn new(found: &[f64]) -> Self {
        if found.iter().all(|&found| found == 0.0) {
            return Self { levels: Vec::new(), shares_seen: None };
        }
        // A hit probability p has the mean square p: its root minimizes the variance
        let wanted: Vec<f64> = spread(found).into_iter().map(f64::sqrt).collect();
        let (all, blind) = (wanted.iter().sum::<f64>(), BLIND / found.len() as f64);
        let mut level: Vec<f32> = wanted.iter().map(|wanted| (blind + (1.0 - BLIND) * wanted / all) as f32).collect();
        let mut levels = Vec::new();
        for count in CELLS.into_iter().rev() {
            let above = level.chunks_exact(count).map(|cells| cells.iter().sum()).collect();
            levels.push(std::mem::replace(&mut level, above));
        }
        levels.reverse();
        Self { levels, shares_seen: None }
    }

    /// Returns the share of caustic photons that lookouts see.
    ///
    /// - `counts`: number of trial photons of each cell that are unseen, and seen.
    pub(super) fn share_seen(&self, counts: &[[f64; 2]]) -> f64 {
        let Some(probabilities) = self.levels.last() else { return 0.0 };
        let sums = probabilities.iter().zip(counts).fold([0.0; 2], |[all, seen], (&probability, count)| {
            let probability = f64::from(probability);
            [all + probability * (count[0] + count[1]), seen + probability * count[1]]
        });
        sums[1] / sums[0].max(f64::MIN_POSITIVE)
    }

    /// Returns this map with the shares that lookouts see: without and with their importance.
    #[must_use]
    pub(super) fn with_shares_seen(self, shares: [f64; 2]) -> Self {
        Self { shares_seen: Some(shares).filter(|_| !self.is_empty()), ..self }
    }

    /// Returns the shares that lookouts see, without and with their importance; `None`: none were used.
    pub(super) fn shares_seen(&self) -> Option<[f64; 2]> {
        self.shares_seen
    }

    /// Returns `true` if no photon hits mirrors or glass.
    pub(crate) fn is_empty(&self) -> bool {
        self.levels.is_empty()
    }

    /// Warps the random numbers of a photon. Returns them with the weight of the photon: 1 over its relative density.
    #[inline(always)]
    pub(super) fn sent(&self, mut u: Quad, mut v: Quad) -> (Quad, Quad, f32) {
        let (mut cell, mut weight) = (0, 1.0);
        let mut numbers = ordered(u, v);
        for ((number, count), level) in numbers.iter_mut().zip(CELLS).zip(&self.levels) {
            let cells = &level[cell * count..(cell + 1) * count];
            let mut rest = *number * cells.iter().sum::<f32>();
            let mut chosen = 0;
            while chosen + 1 < count && rest >= cells[chosen] {
                rest -= cells[chosen];
                chosen += 1;
            }
            let share = (rest / cells[chosen]).clamp(0.0, 1.0 - f32::EPSILON);
            weight *= cells.iter().sum::<f32>() / (cells[chosen] * count as f32);
            *number = ((chosen as f32 + share) / count as f32).min(1.0 - f32::EPSILON);
            cell = cell * count + chosen;
        }
        [u[0], u[2], u[3], v[0], v[1]] = numbers;
        (u, v, weight)
    }
}

/// Adds a little of each cell to its neighbours.
fn spread(found: &[f64]) -> Vec<f64> {
    let mut all = found.to_vec();
    let mut step = found.len();
    for count in CELLS {
        step /= count;
        for (cell, &found) in found.iter().enumerate() {
            let place = cell / step % count;
            if place > 0 {
                all[cell - step] += NEIGHBOR * found;
            }
            if place + 1 < count {
                all[cell + step] += NEIGHBOR * found;
            }
        }
    }
    all
}

/// Returns the random numbers that select a cell, in the order of [`CELLS`].
pub(super) fn ordered(u: Quad, v: Quad) -> [f32; 5] {
    [u[0], u[2], u[3], v[0], v[1]]
}

/// Returns the cell of a number in [0, 1), of `count`.
pub(super) fn cell_of(u: f32, count: usize) -> usize {
    ((u * count as f32) as usize).min(count - 1)
}

#[cfg(test)]
mod tests {
    use bottega_kernels::mix64;

    use super::*;

    #[test]
    fn all_numbers_occur_and_have_their_weight() {
        // One corner of the directions has half of the probability.
        let count: usize = CELLS.iter().product();
        let mut cells = vec![0.5 / (count - 1) as f32; count];
        cells[13] = 0.5;
        let mut levels = vec![cells];
        for count in CELLS.into_iter().skip(1).rev() {
            let above = levels[0].chunks_exact(count).map(|cells| cells.iter().sum()).collect();
            levels.insert(0, above);
        }
        let projection = Projection { levels, shares_seen: None };
        let (all, mut sum, mut inside) = (1 << 17, 0.0, 0.0);
        for i in 0..all {
            let at = |place: u64| (mix64(8 * i + place) >> 40) as f32 / (1 << 24) as f32;
            let (u, v, weight) = projection.sent([at(0), 0.3, at(1), at(2)], [at(3), at(4), 0.0, 0.0]);
            assert!(u.iter().chain(&v).all(|number| (0.0..1.0).contains(number)), "{u:?} {v:?}");
            sum += f64::from(weight);
            let cells = ordered(u, v).iter().zip(CELLS).fold(0, |cell, (&u, count)| cell * count + cell_of(u, count));
            inside += f64::from(u8::from(cells == 13));
        }
        // The mean of the weights is the integral of 1. Weights are 2 at most: standard errors are below 0.003.
        assert!((sum / all as f64 - 1.0).abs() < 0.012, "{}", sum / all as f64);
        assert!((inside / all as f64 - 0.5).abs() < 0.006, "{}", inside / all as f64);
    }
}
