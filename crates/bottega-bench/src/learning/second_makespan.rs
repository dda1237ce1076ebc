//! The makespan of a job on three unequal machines, replayed with and without what an earlier job has taught.

use std::sync::Arc;

use bottega_agents::driver::Faults;
use bottega_farm::{
    ZoneForecast,
    simulate::{FarmSpec, MachineSpec, Plan, Record, Workpiece, simulate},
};

use crate::error::Error;

/// Speeds of the machines.
pub(super) const SPEEDS: [f64; 3] = [1.0, 0.5, 0.25];
/// Number of seeds per case.
const SEEDS: u64 = 5;

/// A way in which machines differ from what is known of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct FarmCase {
    /// Time of a message, in milliseconds.
    pub(super) latency_ms: f64,
    /// Maximum relative error of a machine's benchmark.
    pub(super) benchmark_error: f64,
}

/// The cases that are replayed.
pub(super) const CASES: [FarmCase; 4] = [
    FarmCase { latency_ms: 0.5, benchmark_error: 0.0 },
    FarmCase { latency_ms: 0.5, benchmark_error: 0.5 },
    FarmCase { latency_ms: 5.0, benchmark_error: 0.0 },
    FarmCase { latency_ms: 5.0, benchmark_error: 0.5 },
];

/// Replays the second of two jobs, and returns its makespan with what was learned over that without, for each case; means over
/// seeds.
///
/// - `forecasts`: the times of the second job's zones as the first one has taught them.
pub(super) fn ratios(
    first: &Record,
    second: &Record,
    forecasts: &Arc<[ZoneForecast]>,
) -> Result<[f64; CASES.len()], Error> {
    let piece = |record| Workpiece::recorded(record, 1).map(Arc::new).map_err(Error::Workpiece);
    let (first, second) = (piece(first)?, piece(second)?);
    let mut ratios = [0.0; CASES.len()];
    for (ratio, case) in ratios.iter_mut().zip(CASES) {
        for seed in 0..SEEDS {
            let mut farm = FarmSpec::default();
            SPEEDS.iter().for_each(|&speed| farm.add(1, MachineSpec { processors: 1, speed }));
            let latency_min = std::time::Duration::from_secs_f64(1e-3 * case.latency_ms);
            let unlearnt = Plan {
                faults: Faults { latency_min, ..Faults::NONE },
                benchmark_error: case.benchmark_error,
                ..Plan::calm(farm, seed)
            };
            let taught = simulate(&first, &unlearnt).map_err(Error::Simulation)?;
            let without = simulate(&second, &unlearnt).map_err(Error::Simulation)?;
            let learnt = Plan {
                powers: Arc::new(taught.powers()),
                credits: Arc::new(taught.credits()),
                forecasts: Arc::clone(forecasts),
                ..unlearnt
            };
            let with = simulate(&second, &learnt).map_err(Error::Simulation)?;
            *ratio += with.makespan.as_secs_f64() / without.makespan.as_secs_f64() / SEEDS as f64;
        }
    }
    Ok(ratios)
}
