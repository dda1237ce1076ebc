//! Rays and paths per second, as text and as JSON.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::{
    builds::BuildTimes,
    gpu::{self, GpuRow},
    obvhs,
    paths::PathsRow,
    timing::{KINDS, KernelRow, table},
};
use crate::report::Report;

/// Our watertight kernel: no ray passes between two triangles that share an edge.
pub(super) const ROBUST: &str = "bottega robust";
/// Our fast kernel, which is not watertight, like most others.
pub(super) const FAST: &str = "bottega fast";

/// Our kernels, and the prefixes of the names of kernels that each is compared with.
const COMPARED: [(&str, &[&str]); 3] =
    [(FAST, &["Embree medium", "Embree high"]), (ROBUST, &["Embree robust"]), (ROBUST, &[obvhs::PREFIX])];

/// The results of all scenes.
pub(super) struct RaysReport {
    pub(super) scenes: Vec<SceneRays>,
    pub(super) gpu: Vec<GpuRow>,
    pub(super) paths: Vec<PathsRow>,
}

/// Rays per second of all kernels on one scene.
pub(super) struct SceneRays {
    pub(super) scene: String,
    pub(super) triangles: usize,
    pub(super) rows: Vec<KernelRow>,
    pub(super) builds: Vec<BuildTimes>,
}

/// The rate of one of our kernels over the best of the others, by kind of ray.
type Ratio = [f64; 4];

impl SceneRays {
    /// Returns the ratio of each of [`COMPARED`]; `None`: none of the others was measured.
    fn ratios(&self) -> [Option<Ratio>; COMPARED.len()] {
        COMPARED.map(|(ours, others)| {
            let ours = self.rows.iter().find(|row| row.name == ours)?;
            let is_other = |row: &&KernelRow| others.iter().any(|other| row.name.starts_with(other));
            let others: Vec<&KernelRow> = self.rows.iter().filter(is_other).collect();
            let best = |kind: usize| others.iter().map(|row| row.mrays[kind]).fold(0.0, f64::max);
            (!others.is_empty()).then(|| std::array::from_fn(|kind| ours.mrays[kind] / best(kind)))
        })
    }
}

impl RaysReport {
    /// Returns the geometric means of each comparison over all scenes, by kind of ray.
    fn means(&self) -> [Option<Ratio>; COMPARED.len()] {
        let all: Vec<_> = self.scenes.iter().map(SceneRays::ratios).collect();
        std::array::from_fn(|which| {
            let ratios: Vec<Ratio> = all.iter().filter_map(|ratios| ratios[which]).collect();
            (!ratios.is_empty()).then(|| std::array::from_fn(|kind| geometric_mean(ratios.iter().map(|it| it[kind]))))
        })
    }
}

fn geometric_mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    (values.map(f64::ln).sum::<f64>() / count).exp()
}

impl Report for RaysReport {
    fn as_text(&self) -> String {
        let mut text = "rays on one thread, one at a time\n\n".to_owned();
        for scene in &self.scenes {
            text += &table(&scene.scene, scene.triangles, &scene.rows);
            for ((ours, others), ratio) in COMPARED.iter().zip(scene.ratios()) {
                if let Some(ratio) = ratio {
                    _ = writeln!(text, "  {ours} over the best of {}: {ratio:.2?}", others.join(", "));
                }
            }
            scene.builds.iter().for_each(|times| text += &times.line());
            text += "\n";
        }
        for ((ours, others), mean) in COMPARED.iter().zip(self.means()) {
            if let Some(mean) = mean {
                let all = geometric_mean(mean.into_iter());
                let others = others.join(", ");
                _ = writeln!(text, "geometric mean of {ours} over the best of {others}: {mean:.2?}, all {all:.3}");
            }
        }
        text += &gpu::as_text(&self.gpu);
        for PathsRow { scene, threads, on_one, on_all } in &self.paths {
            _ = writeln!(text, "{scene:?}: {on_one:?} Mpaths/s on one thread, {on_all:?} on {threads}");
        }
        text
    }

    fn as_json(&self) -> Value {
        let rays: Vec<Value> =
            self.scenes.iter().flat_map(|scene| scene.rows.iter().map(|row| row_as_json(&scene.scene, row))).collect();
        let builds: Vec<Value> =
            self.scenes.iter().flat_map(|scene| scene.builds.iter().map(|times| times.as_json(&scene.scene))).collect();
        let compared = |((ours, others), mean): (&(&str, &[&str]), Option<Ratio>)| {
            mean.map(|mean| json!({"kernel": ours, "over_the_best_of": others, "geometric_mean": by_kind(mean)}))
        };
        let ratios: Vec<Value> = COMPARED.iter().zip(self.means()).filter_map(compared).collect();
        let paths =
            |row: &PathsRow| json!({"scene": row.scene, "threads": row.threads, "one": row.on_one, "all": row.on_all});
        let paths: Vec<Value> = self.paths.iter().map(paths).collect();
        json!({"rays": rays, "ratios": ratios, "builds": builds, "gpu": gpu::as_json(&self.gpu), "paths": paths})
    }
}

impl BuildTimes {
    fn line(&self) -> String {
        let Self { threads, ours, quick, embree_medium, embree_high } = self;
        let [a, b, c, d] = [ours, quick, embree_medium, embree_high].map(|seconds| 1e3 * seconds);
        format!(
            "  build, {threads} threads: ours {a:.1} ms, quick {b:.1} ms, Embree medium {c:.1} ms, high {d:.1} ms; ours / high \
             {:.2}, quick / medium {:.2}\n",
            ours / embree_high,
            quick / embree_medium
        )
    }

    fn as_json(&self, scene: &str) -> Value {
        let Self { threads, ours, quick, embree_medium, embree_high } = self;
        json!({
            "scene": scene, "threads": threads, "seconds": ours, "quick_seconds": quick,
            "embree_medium_seconds": embree_medium, "embree_high_seconds": embree_high,
        })
    }
}

fn row_as_json(scene: &str, row: &KernelRow) -> Value {
    json!({
        "scene": scene,
        "kernel": row.name,
        "mrays_per_second": by_kind(row.mrays),
        "build_seconds": row.build_time.as_secs_f64(),
        "bytes_per_triangle": row.bytes_per_triangle,
    })
}

fn by_kind(values: Ratio) -> Map<String, Value> {
    KINDS.iter().zip(values).map(|(kind, value)| ((*kind).to_owned(), json!(value))).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn row(name: &str, rate: f64) -> KernelRow {
        let (mrays, hits) = ([rate, rate, rate, 2.0 * rate], [1; 4]);
        KernelRow {
            name: name.to_owned(),
            mrays,
            hits,
            build_time: Duration::ZERO,
            bytes_per_triangle: 60.0,
            steps: None,
        }
    }

    #[test]
    fn ours_are_compared_with_the_best_of_others_and_over_scenes_by_the_geometric_mean() {
        let scene = |fast: f64, medium: f64, high: f64| SceneRays {
            scene: "a".to_owned(),
            triangles: 1,
            rows: vec![row(FAST, fast), row("Embree medium", medium), row("Embree high", high)],
            builds: vec![BuildTimes { threads: 1, ours: 0.2, quick: 0.1, embree_medium: 0.1, embree_high: 0.4 }],
        };
        let report =
            RaysReport { scenes: vec![scene(8.0, 1.0, 2.0), scene(1.0, 1.0, 0.5)], gpu: vec![], paths: vec![] };
        assert_eq!(report.scenes[0].ratios(), [Some([4.0; 4]), None, None]);
        let [Some(mean), None, None] = report.means() else { panic!("one comparison") };
        assert!(mean.iter().all(|mean| (mean - 2.0).abs() < 1e-12), "{mean:?}");
        assert!(report.as_text().contains("ours / high 0.50, quick / medium 1.00"), "{}", report.as_text());
        assert_eq!(report.as_json()["ratios"][0]["over_the_best_of"], json!(["Embree medium", "Embree high"]));
    }
}
