//! Trial photons that find the emission directions of caustic photons.

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

/// Number of trial photons.
const TRIALS: u32 = 1 << 17;
/// Greatest number of surfaces that a trial photon hits.
const TRIAL_BOUNCES: u32 = 6;

/// Importance of caustics that no lookout sees; the gaps between lookouts are narrow.
const UNSEEN: f64 = 0.05;
/// Trial photons that one thread traces in a row.
const BATCH: u32 = 4096;

/// Traces trial photons and builds the projection map, on the scene's threads.
///
/// - `lookouts`: weigh photons by what they see; `None`: all caustic photons count.
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
    let try_batch = |indices| compiled::run(PhotonRange { tracer, lookouts, indices });
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

/// A range of trial photons.
struct PhotonRange<'a> {
    tracer: Tracer<'a>,
    lookouts: Option<&'a Lookouts>,
    indices: Range<u32>,
}

impl Task for PhotonRange<'_> {
    /// Cells of the photons that hit mirrors or glass, with the greatest importance of what each stored.
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
