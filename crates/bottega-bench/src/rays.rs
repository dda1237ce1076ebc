//! Rays per second of our kernels and others by kind of ray, and camera paths per second.

mod builds;
mod embree;
mod gpu;
mod kernel;
mod meshes;
mod obvhs;
mod paths;
mod report;
mod sets;
mod timing;

use std::{io::Write, path::PathBuf};

use bottega::devices::processors;
use bottega_kernels::{BuildOptions, Precision};
use clap::Args;

use self::{
    builds::build_times,
    embree::{Embree, EmbreeSetting},
    kernel::{BottegaKernel, RayKernel},
    obvhs::ObvhsKernel,
    report::{RaysReport, SceneRays},
    sets::RaySets,
};
use crate::{
    error::Error,
    report::{Measurement, Report, say},
    scenes::{BUILT_IN, BenchScene},
};

/// Rays per second by kind of ray, and paths per second.
#[derive(Debug, Args)]
#[command(
    after_help = "Kernels take turns on one thread. Embree 4 is measured beside ours where its library is found: BOTTEGA_EMBREE names \
    libembree4.so, or the Python environment that is active (VIRTUAL_ENV) has it from `pip install embreex`. For example:\n  \
    bottega-bench rays scene.glb\n  bottega-bench rays --repeat 7 --builds 5 --obvhs --mesh statue.ply"
)]
pub(crate) struct RaysOptions {
    /// Scenes whose paths per second are measured, beside the rays of built-in ones.
    scenes: Vec<PathBuf>,
    /// Repetitions, interleaved; the median is printed.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=100))]
    repeat: u16,
    /// Measure the rays of a mesh, too: an OBJ or PLY file, or all PLY files of a folder; may be given more than once.
    #[arg(long = "mesh", value_name = "FILE")]
    meshes: Vec<PathBuf>,
    /// Of the built-in scenes only those whose names contain this.
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// Side of the square of primary rays.
    #[arg(long, value_name = "PIXELS", default_value_t = 512, value_parser = clap::value_parser!(u32).range(8..=8192))]
    side: u32,
    /// Measure the trees of `obvhs`, too, the fastest other library of them in Rust: it chooses its vector instructions when it is
    /// compiled, so compile with RUSTFLAGS="-C target-cpu=x86-64-v3".
    #[arg(long)]
    obvhs: bool,
    /// Build each tree so often beside Embree's, with one thread and with two.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=100))]
    builds: Option<u16>,
    /// The GPU whose name contains this is measured too, by itself: its rays do not travel.
    #[arg(long, value_name = "NAME")]
    gpu: Option<String>,
}

impl Measurement for RaysOptions {
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        let gpu = self.gpu.as_deref().map(|name| gpu::measure(name, self.repeat, &self.built_in()));
        let gpu = gpu.transpose()?.unwrap_or_default();
        let embree = Embree::find();
        if let Err(reason) = &embree {
            say(log, format_args!("NOT BESIDE EMBREE: {reason}"));
        }
        let mut scenes = Vec::new();
        for scene in self.built_in().into_iter().map(Ok).chain(self.meshes.iter().map(|file| meshes::read(file))) {
            let scene = scene?;
            say(log, format_args!("tracing rays of the {} …", scene.name));
            scenes.push(self.trace(&scene, embree.as_ref().ok())?);
        }
        let paths = self.scenes.iter().map(|scene| paths::measure(scene, self.repeat)).collect::<Result<_, _>>()?;
        Ok(Box::new(RaysReport { scenes, gpu, paths }))
    }
}

impl RaysOptions {
    fn built_in(&self) -> Vec<BenchScene> {
        let is_wanted = |name: &str| self.only.as_deref().is_none_or(|part| name.contains(part));
        BUILT_IN.iter().filter(|(name, _)| is_wanted(name)).map(|(_, scene)| scene()).collect()
    }

    /// Measures all kernels on a scene.
    fn trace(&self, scene: &BenchScene, embree: Option<&Embree>) -> Result<SceneRays, Error> {
        let threads = processors();
        let build = |name, precision| {
            BottegaKernel::build(name, scene, &BuildOptions { threads, precision, ..BuildOptions::default() })
        };
        let (robust, fast) = (build(report::ROBUST, Precision::Robust)?, build(report::FAST, Precision::Fast)?);
        let rays = RaySets::new(robust.accel(), scene, self.side);
        let mut kernels: Vec<Box<dyn RayKernel>> = vec![Box::new(robust), Box::new(fast)];
        for setting in EmbreeSetting::ALL {
            if let Some(embree) = embree {
                kernels.push(Box::new(embree.build(scene, setting, threads).map_err(Error::Embree)?));
            }
        }
        if self.obvhs {
            kernels.extend(ObvhsKernel::all(scene).into_iter().map(|kernel| Box::new(kernel) as _));
        }
        let kernels: Vec<&dyn RayKernel> = kernels.iter().map(AsRef::as_ref).collect();
        let rows = timing::measure(scene, &rays, &kernels, self.repeat.into());
        let builds = match (self.builds, embree) {
            (Some(count), Some(embree)) => build_times(scene, embree, count)?,
            _ => Vec::new(),
        };
        Ok(SceneRays { scene: scene.name.clone(), triangles: scene.triangles.len(), rows, builds })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_precisions_see_the_same_scenes() {
        let options = RaysOptions {
            scenes: Vec::new(),
            repeat: 1,
            meshes: Vec::new(),
            only: None,
            side: 24,
            obvhs: true,
            builds: None,
            gpu: None,
        };
        for scene in [crate::scenes::noisy_sphere(), crate::scenes::interior()] {
            let SceneRays { rows, triangles, .. } = options.trace(&scene, None).unwrap();
            assert!(triangles > 60_000);
            let [robust, fast, others @ ..] = &rows[..] else { panic!("two rows at least") };
            for kind in 0..4 {
                let difference = robust.hits[kind].abs_diff(fast.hits[kind]);
                assert!(difference <= 2 && (kind == 3 || robust.hits[kind] > 300), "{rows:?}");
                assert!(robust.mrays[kind] > 0.0);
                // Not all trees of other kernels are watertight.
                assert!(others.iter().all(|other| other.hits[kind].abs_diff(robust.hits[kind]) < 20), "{rows:?}");
            }
            assert_eq!(others.len(), 4);
            assert!(robust.bytes_per_triangle < 100.0, "{rows:?}");
        }
    }
}
