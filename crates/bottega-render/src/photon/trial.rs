//! Photons that find out where others must leave the lights to come to mirrors and glass.

use super::{
    projection::{CELLS, Projection, cell_of, ordered},
    trace::{TracedPhotons, Tracer},
};
use crate::{
    lights::{Emission, EmissionPlan},
    prepare::PreparedScene,
};

/// Photons that try it out.
const TRIALS: u32 = 1 << 17;
/// Surfaces that these may come to.
const TRIAL_BOUNCES: u32 = 6;

/// Tries out a scene on the calling thread.
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
    let mut found = vec![0.0; CELLS.iter().product()];
    let (mut traced, mut sum) = (TracedPhotons::default(), 0.0);
    for index in 0..TRIALS {
        traced.caustic.clear();
        let [u, v] = tracer.numbers(index);
        tracer.trace(index, &mut traced);
        if !traced.caustic.is_empty() {
            let cell = ordered(u, v).iter().zip(CELLS).fold(0, |cell, (&u, count)| cell * count + cell_of(u, count));
            found[cell] += 1.0;
            sum += 1.0;
        }
    }
    Projection::new(&found, sum)
}
