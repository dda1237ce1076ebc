//! What a unit costs beyond its work: `cargo bench -p bottega-hra`. A number of threads may be named behind `--`.
#![allow(clippy::print_stdout, reason = "prints what it measures")]

use std::hint::black_box;
use std::sync::Barrier;
use std::thread;
use std::time::{Duration, Instant};

use bottega_hra::{Hra, HraClient, HraConfig, Primitive, VirtualCpu, Work, WorkUnit};

const REPETITIONS: usize = 9;

struct Job(u64);

impl Work for Job {
    type Output = u64;
    fn primitive(&self) -> Primitive {
        Primitive::PixelBlock
    }
    fn size(&self) -> u64 {
        1
    }
}

#[allow(clippy::needless_pass_by_value, reason = "work moves in")]
fn double(job: Job) -> u64 {
    2 * job.0
}

fn unit(number: u64) -> WorkUnit<Job> {
    WorkUnit::new(Job(number), number)
}

/// The fastest of some runs, in nanoseconds a unit.
fn best(units: u64, mut run: impl FnMut()) -> f64 {
    let run = |_| {
        let start = Instant::now();
        run();
        start.elapsed()
    };
    (0..REPETITIONS).map(run).min().unwrap_or(Duration::ZERO).as_nanos() as f64 / units as f64
}

/// How a thread submits and takes.
#[derive(Clone, Copy)]
enum Way {
    /// A unit and an answer at a time, many under way.
    Singly,
    /// Groups of units, and all answers that are there.
    Grouped(usize),
}

fn work_through(client: &HraClient<Job>, units: u64, way: Way) {
    match way {
        Way::Singly => {
            for number in 0..units {
                client.submit(unit(number)).expect("open");
            }
            while client.take().is_some() {}
        }
        Way::Grouped(size) => {
            let mut taken = 0;
            for start in (0..units).step_by(size) {
                let end = (start + size as u64).min(units);
                client.submit_group((start..end).map(unit).collect()).expect("open");
                while start > taken + 4 * size as u64 {
                    taken += client.take_many(4 * size).len() as u64;
                }
            }
            while !client.take_many(1024).is_empty() {}
        }
    }
}

/// Nanoseconds a unit, all threads together, that each submit units of no work and take the answers.
fn throughput(submitters: usize, lanes: usize, way: Way) -> f64 {
    let units = 200_000 / submitters as u64;
    let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(lanes, double));
    best(units * submitters as u64, || {
        let barrier = Barrier::new(submitters);
        thread::scope(|scope| {
            for _ in 0..submitters {
                let client = hra.client();
                let barrier = &barrier;
                scope.spawn(move || {
                    barrier.wait();
                    work_through(&client, units, way);
                });
            }
        });
    })
}

/// Nanoseconds for a unit that is submitted when the one before was answered.
fn round_trip(lanes: usize) -> f64 {
    const UNITS: u64 = 5_000;
    let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(lanes, double));
    let client = hra.client();
    best(UNITS, || {
        for number in 0..UNITS {
            client.submit(unit(number)).expect("open");
            black_box(client.take());
        }
    })
}

/// Time of units through the allocator with one lane, as a part of calling them directly.
fn beside_direct_calls(steps: u64) -> (f64, f64) {
    const UNITS: u64 = 200;
    #[allow(clippy::needless_pass_by_value, reason = "work moves in")]
    let work = move |job: Job| {
        (0..steps).fold(job.0, |n, k| black_box(n.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(k)))
    };
    let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(1, work));
    let client = hra.client();
    let (mut direct, mut through) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..REPETITIONS {
        let start = Instant::now();
        for number in 0..UNITS {
            black_box(work(Job(number)));
        }
        direct = direct.min(start.elapsed().as_secs_f64());
        let start = Instant::now();
        client.submit_group((0..UNITS).map(unit).collect()).expect("open");
        while client.take().is_some() {}
        through = through.min(start.elapsed().as_secs_f64());
    }
    (direct / UNITS as f64, through / direct)
}

fn main() {
    let named: Vec<usize> = std::env::args().skip(1).filter_map(|text| text.parse().ok()).collect();
    let threads = if named.is_empty() { vec![1, 2] } else { named };
    for &threads in &threads {
        let figures = [Way::Singly, Way::Grouped(64), Way::Grouped(1024)].map(|way| throughput(threads, threads, way));
        println!(
            "{threads} submitters, {threads} lanes: singly {:.0}, by 64 {:.0}, by 1024 {:.0} ns a unit in all; \
             one after the other {:.0} ns",
            figures[0],
            figures[1],
            figures[2],
            round_trip(threads)
        );
    }
    for steps in [100, 10_000, 400_000] {
        let (direct, ratio) = beside_direct_calls(steps);
        println!("units of {:.1} µs: {ratio:.4} of the time of direct calls", direct * 1e6);
    }
}
