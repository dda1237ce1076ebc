//! Photons that find out where others must leave the lights to come to mirrors and glass.

use std::ops::Range;

use bottega_kernels::compiled::{self, Task};
use rayon::prelude::*;

use super::{
    lookouts::Lookouts,
    projection::{CELLS, Projection, cell_of, ordered},
    trace::{TracedPhotons, Tracer},
};
use crate::{
    lights::{Emission, EmissionPlan},
    parts::parts,
    prepare::PreparedScene,
};

/// Photons that try it out.
const TRIALS: u32 = 1 << 17;
/// Surfaces that these may come to.
const TRIAL_BOUNCES: u32 = 6;

/// How much a caustic matters that no lookout sees: what lies between them is narrow.
const UNSEEN: f64 = 0.05;
/// Photons that one processor tries out in a row.
const BATCH: u32 = 4096;

/// Tries out a scene on the threads that are meant for what is made once.
///
/// - `lookouts`: what they see matters; without them all that comes to mirrors or glass does.
pub(super) fn try_out(
    prepared: &PreparedScene,
    emission: &Emission,
    plan: &EmissionPlan,
    lookouts: Option<&Lookouts>,
) -> Projection {
    let tracer = Tracer {
        prepared,
        emission,
        plan,
        seed: 0,
        pass: 0,
        bounces: TRIAL_BOUNCES,
        with_shadows: false,
        only_caustics: true,
        strength: 1.0,
        projection: None,
    };
    let batches: Vec<Range<u32>> = parts(TRIALS, BATCH).collect();
    let try_batch = |indices| compiled::run(Trial { tracer, lookouts, indices });
    let met: Vec<Vec<(usize, f64)>> = prepared.on_threads(|| batches.into_par_iter().map(try_batch).collect());
    let mut counts = vec![[0.0; 2]; CELLS.iter().product()];
    for (cell, seen) in met.into_iter().flatten() {
        counts[cell][0] += 1.0 - seen;
        counts[cell][1] += seen;
    }
    let wanted =
        |unseen: f64| Projection::new(&counts.iter().map(|[hidden, seen]| seen + unseen * hidden).collect::<Vec<_>>());
    let blind = wanted(1.0);
    if lookouts.is_none() {
        return blind;
    }
    let sent = wanted(UNSEEN);
    let seen = [&blind, &sent].map(|projection| projection.share_seen(&counts));
    sent.with_shares_seen(seen)
}

/// Some of the photons that try it out.
struct Trial<'a> {
    tracer: Tracer<'a>,
    lookouts: Option<&'a Lookouts>,
    indices: Range<u32>,
}

impl Task for Trial<'_> {
    /// The cells of those that came to mirrors or glass, and how much is seen of what they brought.
    type Output = Vec<(usize, f64)>;

    #[inline(always)]
    fn run(self) -> Vec<(usize, f64)> {
        let (mut traced, mut met) = (TracedPhotons::default(), Vec::new());
        for index in self.indices {
            traced.caustic.clear();
            let [u, v] = self.tracer.numbers(index);
            self.tracer.trace(index, &mut traced);
            let seen = |photon| self.lookouts.map_or(1.0, |lookouts| lookouts.importance(photon));
            if let Some(most) = traced.caustic.iter().map(seen).reduce(f64::max) {
                let cell =
                    ordered(u, v).iter().zip(CELLS).fold(0, |cell, (&u, count)| cell * count + cell_of(u, count));
                met.push((cell, most));
            }
        }
        met
    }
}
