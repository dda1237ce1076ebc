//! What a unit costs beyond its work. Measures only; run with
//! `cargo test -p bottega-hra --release --test overhead -- --ignored --nocapture`.

mod support;

use std::time::{Duration, Instant};

use bottega_hra::{Hra, HraConfig, Primitive, VirtualCpu};
use support::{Job, double, unit};

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

#[test]
#[ignore = "measures, proves nothing"]
fn cost_beside_calling_directly() {
    const UNITS: u64 = 100;
    for steps in [100_000, 2_000_000] {
        let work = move |job: Job| {
            let step = |n: u64, k: u64| std::hint::black_box(n.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(k));
            (0..steps).fold(job.number, step)
        };
        let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(1, work));
        let client = hra.client();
        let units = || (0..UNITS).map(|n| unit(n, Primitive::PixelBlock));
        let (mut direct, mut through) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..9 {
            direct = direct.min(best(1, UNITS, || {
                units().for_each(|unit| {
                    std::hint::black_box(work(unit.work));
                });
            }));
            through = through.min(best(1, UNITS, || {
                client.submit_group(units().collect()).unwrap();
                while client.take().is_some() {}
            }));
        }
        let ratio = through / direct;
        eprintln!("units of {:.0} µs: {ratio:.4} of the time of direct calls", direct / 1e3);
    }
}
