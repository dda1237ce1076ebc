//! Photons that find out where others must leave the lights to come to mirrors and glass.

use std::ops::Range;

use bottega_kernels::compiled::{self, Task};
use rayon::prelude::*;

use super::{
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

/// Photons that one processor tries out in a row.
const BATCH: u32 = 4096;

/// Tries out a scene on the threads that are meant for what is made once.
pub(super) fn try_out(prepared: &PreparedScene, emission: &Emission, plan: &EmissionPlan) -> Projection {
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
    let try_batch = |indices| compiled::run(Trial { tracer, indices });
    let met: Vec<Vec<usize>> = prepared.on_threads(|| batches.into_par_iter().map(try_batch).collect());
    let (mut found, mut sum) = (vec![0.0; CELLS.iter().product()], 0.0);
    for cell in met.into_iter().flatten() {
        found[cell] += 1.0;
        sum += 1.0;
    }
    Projection::new(&found, sum)
}

/// Some of the photons that try it out.
struct Trial<'a> {
    tracer: Tracer<'a>,
    indices: Range<u32>,
}

impl Task for Trial<'_> {
    /// The cells of those that came to mirrors or glass.
    type Output = Vec<usize>;

    #[inline(always)]
    fn run(self) -> Vec<usize> {
        let (mut traced, mut met) = (TracedPhotons::default(), Vec::new());
        for index in self.indices {
            traced.caustic.clear();
            let [u, v] = self.tracer.numbers(index);
            self.tracer.trace(index, &mut traced);
            if !traced.caustic.is_empty() {
                met.push(ordered(u, v).iter().zip(CELLS).fold(0, |cell, (&u, count)| cell * count + cell_of(u, count)));
            }
        }
        met
    }
}
