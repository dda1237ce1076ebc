//! The results as text, as JSON and as an image.

use std::{fmt::Write, path::Path};

use bottega_image::{Canvas, srgb_from_linear};
use serde_json::{Value, json};

use super::{
    options::WorkDivision,
    paper,
    ray_scene::{BOUNCES_MAX, SIDE},
    report::{BlockColumn, BlockRow, HraBenchReport, RayColumn, RayRow},
    walk::WalkResult,
};
use crate::{error::Error, report::Report};

impl Report for HraBenchReport {
    fn as_text(&self) -> String {
        as_text(self)
    }

    fn as_json(&self) -> Value {
        as_json(self)
    }
}

fn as_text(report: &HraBenchReport) -> String {
    let HraBenchReport { processors, is_kept, batch, rows, blocks } = report;
    let kept = if *is_kept { "kept to" } else { "NOT KEPT to (this system does not do that):" };
    let mut text = format!(
        "{kept} {processors} of the processors; batches of {batch} paths, at most {BOUNCES_MAX} bounces\n\
         averages are without the best and the worst run, as the paper's; max - min is of all runs\n"
    );
    for row in rows {
        _ = writeln!(text, "\nscene {}: {}; {} paths, {} rays", row.scene, row.kind, row.paths, row.rays);
        let direct = row.columns.first().map_or(1.0, RayColumn::average);
        for column in &row.columns {
            let average = column.average();
            let mrays = row.rays as f64 / average / 1e6;
            _ = writeln!(
                text,
                "  {:<17} {average:9.3} s  {:6.1} %  {mrays:7.2} Mrays/s  max - min {:.3} s{}",
                column.way.name(),
                100.0 * average / direct,
                column.range(),
                occupied(&column.resources)
            );
        }
        if let Some(share) = share_of_sum(row) {
            _ = writeln!(text, "  CPU+GPU reach {:.1} % of the sum of what each does alone", 100.0 * share);
        }
    }
    for row in blocks {
        _ = writeln!(text, "\npictures of scene {}: {}; samples of blocks of pixels", row.scene, row.kind);
        for column in &row.columns {
            let rate = column.average() / 1e6;
            _ = writeln!(
                text,
                "  {:<17} {rate:9.2} Msamples/s  max - min {:.2}{}",
                column.way.name(),
                column.range() / 1e6,
                occupied(&column.resources)
            );
        }
        if let Some(share) = row.share_of_sum() {
            _ = writeln!(text, "  CPU+GPU reach {:.1} % of the sum of what each does alone", 100.0 * share);
        }
    }
    _ = writeln!(text, "\nthe paper, for 100,000,000 rays:");
    for paper::PaperRow { machine, scene, seconds } in &paper::ROWS {
        let [direct, cpu, both] = *seconds;
        let percent = |time: f64| 100.0 * time / direct;
        _ = writeln!(
            text,
            "  {machine} scene {scene}: {direct:.2} s 100 %, with HRA {cpu:.2} s {:.0} %, CPU+GPU {both:.2} s {:.0} %",
            percent(cpu),
            percent(both)
        );
    }
    text
}

fn occupied(resources: &[(String, f64, u64)]) -> String {
    let each = resources.iter().map(|(name, busy, units)| format!("{name} {:.0} % {units}", 100.0 * busy));
    let each: Vec<String> = each.collect();
    if each.is_empty() { String::new() } else { format!("   (busy, units: {})", each.join(", ")) }
}

/// Returns the throughput of both together, relative to the sum of each alone.
fn share_of_sum(row: &RayRow) -> Option<f64> {
    let rate = |way| row.columns.iter().find(|column| column.way == way).map(|column| column.average().recip());
    Some(rate(WorkDivision::CpuAndGpu)? / (rate(WorkDivision::Cpu)? + rate(WorkDivision::Gpu)?))
}

fn as_json(report: &HraBenchReport) -> Value {
    let column = |column: &RayColumn, direct: f64| {
        json!({
            "way": column.way.key(),
            "seconds": column.seconds,
            "average_seconds": column.average(),
            "range_seconds": column.range(),
            "relative_index": column.average() / direct,
            "resources": resources(&column.resources),
        })
    };
    let row = |row: &RayRow| {
        let direct = row.columns.first().map_or(1.0, RayColumn::average);
        let columns: Vec<Value> = row.columns.iter().map(|it| column(it, direct)).collect();
        json!({
            "scene": row.scene, "kind": row.kind, "paths": row.paths, "rays": row.rays, "ways": columns,
            "share_of_sum": share_of_sum(row),
        })
    };
    let block_column = |it: &BlockColumn| {
        json!({
            "way": it.way.key(),
            "samples_per_second": it.samples_per_second,
            "average_samples_per_second": it.average(),
            "range_samples_per_second": it.range(),
            "resources": resources(&it.resources),
        })
    };
    let block_row = |row: &BlockRow| {
        let columns: Vec<Value> = row.columns.iter().map(block_column).collect();
        json!({"scene": row.scene, "kind": row.kind, "ways": columns, "share_of_sum": row.share_of_sum()})
    };
    let of_paper = |row: &paper::PaperRow| json!({"machine": row.machine, "scene": row.scene, "seconds": row.seconds});
    json!({
        "processors": report.processors, "kept_to_processors": report.is_kept, "batch": report.batch, "bounces": BOUNCES_MAX,
        "scenes": report.rows.iter().map(row).collect::<Vec<_>>(),
        "pictures": report.blocks.iter().map(block_row).collect::<Vec<_>>(),
        "paper": {"rays": paper::RAYS, "rows": paper::ROWS.iter().map(of_paper).collect::<Vec<_>>()},
    })
}

fn resources(all: &[(String, f64, u64)]) -> Vec<Value> {
    all.iter().map(|(name, busy, units)| json!({"name": name, "busy": busy, "units": units})).collect()
}

/// Writes the light found by the rays as an image.
pub(super) fn picture(path: &Path, found: &WalkResult) -> Result<(), Error> {
    let bright = 5.0 * found.light().max(1e-12);
    let mut values = vec![0.0; found.film.len()];
    // Rays come in blocks of 8 × 8 pixels.
    for (at, &light) in found.film.iter().enumerate() {
        let (block, inner) = (at as u32 / 64, at as u32 % 64);
        let (x, y) = (block % (SIDE / 8) * 8 + inner % 8, block / (SIDE / 8) * 8 + inner / 8);
        let value = light as f64 / f64::from(super::walk::LIGHT_UNITS) / bright;
        values[(y * SIDE + x) as usize] = srgb_from_linear(value.min(1.0) as f32);
    }
    Canvas::gray_map(SIDE, SIDE, &values).write_png(path).map_err(Error::from)
}
