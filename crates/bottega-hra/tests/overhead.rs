//! What a unit costs beyond its work. Measures only; run with
//! `cargo test -p bottega-hra --release --test overhead -- --ignored --nocapture`.

mod support;

use std::time::{Duration, Instant};

use bottega_hra::{Hra, HraConfig, Primitive, VirtualCpu};
use support::{double, unit};

/// The fastest of `repetitions` runs, in nanoseconds a unit.
fn best(repetitions: usize, units: u64, mut run: impl FnMut()) -> f64 {
    let run = |_| {
        let start = Instant::now();
        run();
        start.elapsed()
    };
    (0..repetitions).map(run).min().unwrap_or(Duration::ZERO).as_nanos() as f64 / units as f64
}

#[test]
#[ignore = "measures, proves nothing"]
fn cost_of_empty_units() {
    const UNITS: u64 = 50_000;
    for threads in [1, 2] {
        let config = HraConfig { bin_capacity: 1024, ..HraConfig::default() };
        let hra = Hra::new(config, VirtualCpu::lanes(threads, double));
        let client = hra.client();
        let singly = best(9, UNITS, || {
            for n in 0..UNITS {
                client.submit(unit(n, Primitive::PixelBlock)).unwrap();
            }
            while client.take().is_some() {}
        });
        let grouped = best(9, UNITS, || {
            client.submit_group((0..UNITS).map(|n| unit(n, Primitive::PixelBlock)).collect()).unwrap();
            while client.take().is_some() {}
        });
        let in_turn = best(9, UNITS / 10, || {
            for n in 0..UNITS / 10 {
                client.submit(unit(n, Primitive::PixelBlock)).unwrap();
                client.take().unwrap();
            }
        });
        eprintln!("{threads} lanes: singly {singly:.0}, grouped {grouped:.0}, one at a time {in_turn:.0} ns a unit");
    }
}
