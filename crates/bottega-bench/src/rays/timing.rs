//! A fair clock for kernels: interleaved, one repetition of each in turn, and medians. On a busy machine only ratios of the same
//! run mean anything.

use std::{
    fmt::Write,
    time::{Duration, Instant},
};

use bottega_platform::processor_time::thread_seconds;

use super::{kernel::RayKernel, sets::RaySets};
use crate::scenes::BenchScene;

/// Figures of one kernel on one scene.
#[derive(Clone, Debug)]
pub(crate) struct KernelRow {
    /// The kernel.
    pub(crate) name: String,
    /// Millions of rays a second by kind: see [`KINDS`].
    pub(crate) mrays: [f64; 4],
    /// Hits found, by kind.
    pub(crate) hits: [usize; 4],
    /// How long the build took.
    pub(crate) build_time: Duration,
    /// Bytes per triangle, all in.
    pub(crate) bytes_per_triangle: f64,
    /// Nodes and leaves that an average diffuse ray visits.
    pub(crate) steps: Option<f64>,
}

/// Names of the columns of [`KernelRow::mrays`].
pub(crate) const KINDS: [&str; 4] = ["primary", "diffuse", "bounce 2", "shadow"];

/// Rays that one kernel traces before the next has its turn: a millisecond or so.
const CHUNK: usize = 1 << 13;

/// Time that this thread has had of a processor, where the system tells; else the time of day since `begun`. Other work on the
/// machine then disturbs by what it leaves in caches, not by its share of the processor.
fn clock(begun: Instant) -> f64 {
    thread_seconds().unwrap_or_else(|| begun.elapsed().as_secs_f64())
}

/// Times all kernels on all kinds of rays. They take turns chunk by chunk, and of each chunk's repetitions the median counts, so
/// that a burst of other work on the machine falls on all alike.
pub(crate) fn measure(
    scene: &BenchScene,
    rays: &RaySets,
    kernels: &[&dyn RayKernel],
    repetitions: usize,
) -> Vec<KernelRow> {
    let begun = Instant::now();
    let sets = [&rays.primary, &rays.diffuse, &rays.bounce, &rays.shadow];
    let mut times = vec![[0.0; 4]; kernels.len()];
    let mut hits = vec![[0; 4]; kernels.len()];
    for (kind, set) in sets.iter().enumerate() {
        for chunk in set.chunks(CHUNK) {
            let mut turns = vec![Vec::with_capacity(repetitions); kernels.len()];
            let mut found = vec![0; kernels.len()];
            for turn in 0..repetitions * kernels.len() {
                let i = turn % kernels.len();
                let start = clock(begun);
                found[i] = if kind == 3 { kernels[i].any(chunk) } else { kernels[i].closest(chunk).0 };
                turns[i].push(clock(begun) - start);
            }
            for (i, turns) in turns.iter_mut().enumerate() {
                times[i][kind] += median(turns);
                hits[i][kind] += found[i];
            }
        }
    }
    let row = |(i, kernel): (usize, &&dyn RayKernel)| KernelRow {
        name: kernel.name(),
        mrays: std::array::from_fn(|kind| sets[kind].len() as f64 / times[i][kind] / 1e6),
        hits: hits[i],
        build_time: kernel.build_time(),
        bytes_per_triangle: kernel.bytes() as f64 / scene.triangles.len().max(1) as f64,
        steps: kernel.steps(&rays.diffuse),
    };
    kernels.iter().enumerate().map(row).collect()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A table of figures as text.
pub(crate) fn table(name: &str, triangles: usize, rows: &[KernelRow]) -> String {
    let mut out = format!("{name} ({triangles} triangles), Mrays/s\n");
    _ = writeln!(
        out,
        "  {:<22} {:>8} {:>8} {:>8} {:>8}  {:>9} {:>6} {:>6}  hits",
        "kernel", KINDS[0], KINDS[1], KINDS[2], KINDS[3], "build", "B/tri", "steps"
    );
    for row in rows {
        let [a, b, c, d] = row.mrays;
        let steps = row.steps.map_or_else(String::new, |steps| format!("{steps:.2}"));
        let build = row.build_time.as_secs_f64() * 1e3;
        _ = writeln!(
            out,
            "  {:<22} {a:>8.2} {b:>8.2} {c:>8.2} {d:>8.2}  {build:>6.1} ms {:>6.1} {steps:>6}  {:?}",
            row.name, row.bytes_per_triangle, row.hits
        );
    }
    out
}
