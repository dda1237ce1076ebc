//! Rays per second of a GPU's kernels alone: the rays stay on the device.

use std::fmt::Write;

use bottega_gpu::{GpuOptions, GpuRays};
use bottega_kernels::{Accel, BuildOptions, InstanceGeometry};
use glam::Affine3A;
use serde_json::{Map, Value, json};

use super::{sets::RaySets, timing::KINDS};
use crate::{error::Error, scenes::BenchScene};

/// The side of the square of primary rays, enough to keep a large device busy.
const SIDE: u32 = 1400;
/// Passes over the same rays per repetition.
const PASSES: u32 = 8;

/// The rates on one scene.
pub(super) struct GpuRow {
    adapter: String,
    scene: String,
    triangles: usize,
    bytes_per_triangle: f64,
    /// Rays per second by kind: medians.
    rates: [f64; 4],
}

/// Measures the GPU whose name contains `name` on these scenes.
pub(super) fn measure(name: &str, repeat: u16, scenes: &[BenchScene]) -> Result<Vec<GpuRow>, Error> {
    let row = |scene: &BenchScene| {
        let instances = [InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY }];
        let accel = Accel::build(&[scene.geometry()], &instances, &[], &BuildOptions::default())?;
        let sets = RaySets::new(&accel, scene, SIDE);
        let options = GpuOptions { adapter: Some(name.to_owned()), tile_rays: 1 << 21, ..GpuOptions::default() };
        let mut gpu = GpuRays::from_geometry(&[scene.geometry()], &instances, &[], &options)?;
        let mut rates = [0.0; 4];
        for (kind, rays) in [&sets.primary, &sets.diffuse, &sets.bounce, &sets.shadow].into_iter().enumerate() {
            let once = |_| gpu.rate(rays, kind == 3, PASSES);
            let mut all = (0..repeat).map(once).collect::<Result<Vec<_>, _>>()?;
            all.sort_by(f64::total_cmp);
            rates[kind] = all[all.len() / 2];
        }
        let triangles = scene.triangles.len();
        let bytes_per_triangle = gpu.memory_bytes() as f64 / triangles.max(1) as f64;
        let scene = scene.name.clone();
        Ok(GpuRow { adapter: gpu.adapter().name.clone(), scene, triangles, bytes_per_triangle, rates })
    };
    scenes.iter().map(row).collect()
}

pub(super) fn as_text(rows: &[GpuRow]) -> String {
    let mut text = String::new();
    if let Some(first) = rows.first() {
        let [a, b, c, d] = KINDS;
        _ = writeln!(text, "{}, Mrays/s\n  {:<24} {a:>9} {b:>9} {c:>9} {d:>9}  B/tri", first.adapter, "scene");
    }
    for GpuRow { scene, triangles, bytes_per_triangle, rates, .. } in rows {
        let [a, b, c, d] = rates.map(|rate| rate / 1e6);
        let scene = format!("{scene} ({triangles})");
        _ = writeln!(text, "  {scene:<24} {a:>9.1} {b:>9.1} {c:>9.1} {d:>9.1}  {bytes_per_triangle:.1}");
    }
    text
}

pub(super) fn as_json(rows: &[GpuRow]) -> Vec<Value> {
    let row = |row: &GpuRow| {
        let rates: Map<String, Value> =
            KINDS.iter().zip(row.rates).map(|(kind, rate)| ((*kind).to_owned(), json!(rate / 1e6))).collect();
        json!({
            "device": row.adapter, "scene": row.scene, "triangles": row.triangles, "mrays_per_second": rates,
            "bytes_per_triangle": row.bytes_per_triangle,
        })
    };
    rows.iter().map(row).collect()
}
