//! The interface of ray tracing kernels, and our own.

use std::time::{Duration, Instant};

use bottega_kernels::{Accel, BuildError, BuildOptions, InstanceGeometry, Ray};
use glam::Affine3A;

use crate::scenes::BenchScene;

/// A ray tracing kernel.
pub(crate) trait RayKernel {
    /// Returns the name used in tables.
    fn name(&self) -> String;
    /// Finds the closest hit of every ray; returns the number of hits and the sum of their parameters.
    fn closest(&self, rays: &[Ray]) -> (usize, f64);
    /// Returns the number of rays that hit anything.
    fn any(&self, rays: &[Ray]) -> usize;
    /// Returns the mean number of nodes and leaves visited per ray, if the kernel can count them. Independent of the machine.
    fn steps(&self, _rays: &[Ray]) -> Option<f64> {
        None
    }
    /// Returns the build time.
    fn build_time(&self) -> Duration;
    /// Returns all bytes that traversal needs.
    fn bytes(&self) -> usize;
}

/// Our own kernel.
pub(crate) struct BottegaKernel {
    name: String,
    accel: Accel,
    build_time: Duration,
}

impl BottegaKernel {
    /// Builds over a scene.
    pub(crate) fn build(name: &str, scene: &BenchScene, options: &BuildOptions) -> Result<Self, BuildError> {
        let instance = InstanceGeometry { mesh: 0, world_from_object: Affine3A::IDENTITY };
        let start = Instant::now();
        let accel = Accel::build(&[scene.geometry()], &[instance], &[], options)?;
        Ok(Self { name: name.to_owned(), accel, build_time: start.elapsed() })
    }

    /// Returns the acceleration structure.
    pub(crate) fn accel(&self) -> &Accel {
        &self.accel
    }
}

impl RayKernel for BottegaKernel {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn closest(&self, rays: &[Ray]) -> (usize, f64) {
        rays.iter().fold((0, 0.0), |(count, sum), ray| {
            let hit = self.accel.intersect(ray);
            if hit.is_some() { (count + 1, sum + f64::from(hit.t)) } else { (count, sum) }
        })
    }

    fn any(&self, rays: &[Ray]) -> usize {
        rays.iter().filter(|ray| self.accel.occluded(ray)).count()
    }

    fn steps(&self, rays: &[Ray]) -> Option<f64> {
        let mut steps = 0u64;
        for ray in rays {
            let mut count = 0;
            self.accel.intersect_counted(ray, &mut count);
            steps += u64::from(count);
        }
        Some(steps as f64 / rays.len().max(1) as f64)
    }

    fn build_time(&self) -> Duration {
        self.build_time
    }

    fn bytes(&self) -> usize {
        self.accel.memory_bytes()
    }
}
