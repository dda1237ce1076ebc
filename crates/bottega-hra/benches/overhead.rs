//! The overhead of a unit beyond its work: `cargo bench -p bottega-hra`. Numbers of submitting threads may be named behind `--`;
//! each is measured with as many lanes, and with as many as there are processors, which is how a program has them.
#![allow(clippy::print_stdout, reason = "prints what it measures")]

use std::collections::BTreeSet;
use std::fs;
use std::hint::black_box;
use std::num::NonZero;
use std::sync::Barrier;
use std::thread;
use std::time::{Duration, Instant};

use bottega_hra::{Hra, HraClient, HraConfig, Primitive, VirtualCpu, Work, WorkUnit};

const REPETITIONS: usize = 7;
/// Units of a measurement, so many that it takes much longer than starting its threads.
const UNITS: u64 = 1_000_000;

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

/// Time of all processors that this process had so far, where the system tells: what others do on the machine makes it
/// less wrong than it makes the time on the wall.
fn processor_time() -> Option<Duration> {
    const TICKS_A_SECOND: f64 = 100.0; // Of Linux, towards programs, on every machine.
    let stat = fs::read_to_string("/proc/self/stat").ok()?;
    let (_, behind_name) = stat.rsplit_once(')')?;
    let ticks = behind_name.split_whitespace().skip(11).take(2).map(str::parse::<f64>);
    let ticks = ticks.sum::<Result<f64, _>>().ok()?;
    Some(Duration::from_secs_f64(ticks / TICKS_A_SECOND))
}

/// The way in which a thread submits units and takes answers.
#[derive(Clone, Copy)]
enum Way {
    /// A unit and an answer at a time, some thousand under way.
    Singly,
    /// Groups of units, and all answers that are there.
    Grouped(usize),
}

fn work_through(client: &HraClient<Job>, units: u64, way: Way) {
    match way {
        Way::Singly => {
            for number in 0..units {
                client.submit(unit(number)).expect("open");
                if number >= 4096 {
                    black_box(client.take());
                }
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

/// Nanoseconds a unit, all threads together, that each submit units of no work and take the answers: those of the fastest run, and of
/// processors on the average.
fn throughput(submitters: usize, lanes: usize, way: Way) -> (f64, f64) {
    let units = UNITS / submitters as u64;
    let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(lanes, double));
    let before = processor_time();
    let wall = best(units * submitters as u64, || {
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
    });
    let spent = processor_time().zip(before).map_or(Duration::ZERO, |(after, before)| after - before);
    (wall, spent.as_nanos() as f64 / (units * submitters as u64) as f64 / REPETITIONS as f64)
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
    let processors = thread::available_parallelism().map_or(1, NonZero::get);
    for &submitters in &threads {
        for lanes in BTreeSet::from([submitters, processors]) {
            let [singly, by_64, by_1024] = [Way::Singly, Way::Grouped(64), Way::Grouped(1024)].map(|way| {
                let (wall, spent) = throughput(submitters, lanes, way);
                format!("{wall:.0} ({spent:.0})")
            });
            println!(
                "{submitters} submitters, {lanes} lanes, {processors} processors: singly {singly}, by 64 {by_64}, by 1024 \
                 {by_1024} ns a unit in all (of processors); one after the other {:.0} ns",
                round_trip(lanes)
            );
        }
    }
    for steps in [100, 10_000, 400_000] {
        let (direct, ratio) = beside_direct_calls(steps);
        println!("units of {:.1} µs: {ratio:.4} of the time of direct calls", direct * 1e6);
    }
}
