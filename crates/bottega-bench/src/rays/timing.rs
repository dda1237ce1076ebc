//! Fair timing of kernels: repetitions of all kernels are interleaved, and medians count. On a busy machine only ratios within
//! one run are meaningful.

use std::{
    fmt::Write,
    time::{Duration, Instant},
};

use bottega_platform::processor_time::thread_seconds;

use super::{kernel::RayKernel, sets::RaySets};
use crate::scenes::BenchScene;

/// The results of one kernel on one scene.
#[derive(Clone, Debug)]
pub(crate) struct KernelRow {
    /// The kernel's name.
    pub(crate) name: String,
    /// Millions of rays per second by kind: see [`KINDS`].
    pub(crate) mrays: [f64; 4],
    /// Number of hits, by kind.
    pub(crate) hits: [usize; 4],
    /// The build time.
    pub(crate) build_time: Duration,
    /// All bytes per triangle.
    pub(crate) bytes_per_triangle: f64,
    /// Nodes and leaves visited per diffuse ray, on average.
    pub(crate) steps: Option<f64>,
}

/// The names of the columns of [`KernelRow::mrays`].
pub(crate) const KINDS: [&str; 4] = ["primary", "diffuse", "bounce 2", "shadow"];

/// The number of rays per turn of a kernel: about a millisecond.
const CHUNK: usize = 1 << 13;

/// Returns the processor time of this thread if the system reports it, else the time since `begun`. Processor time is disturbed
/// by other load only through the caches.
fn clock(begun: Instant) -> f64 {
    thread_seconds().unwrap_or_else(|| begun.elapsed().as_secs_f64())
}

/// Times all kernels on all kinds of rays. Kernels alternate chunk by chunk, and the median of each chunk's repetitions counts,
/// so that a burst of other load affects all kernels alike.
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

/// Formats the results as a table.
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
