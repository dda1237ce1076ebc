//! A path that waits while others follow its rays.

use bottega_kernels::Ray;
use bottega_scene::Spectrum;

use super::{
    super::record::PathRecord,
    state::{Branch, Path},
};
use crate::integrator::PathIntegrator;

/// Light that reaches a path, unless something is in between.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct DeferredLight {
    /// From the path to the light.
    pub(in crate::integrator) ray: Ray,
    /// What it adds to the path's radiance.
    pub(in crate::integrator) light: Spectrum,
}

/// What a path is between two of its vertices.
#[derive(Clone)]
pub(in crate::integrator) struct SuspendedPath {
    at: Branch,
    radiance: Spectrum,
    start: f32,
    reach: f32,
    worth: f32,
    due: Option<f32>,
    wants_albedo: bool,
    record: PathRecord,
}

impl SuspendedPath {
    /// The ray that it waits for.
    pub(in crate::integrator) fn ray(&self) -> Ray {
        let t_max = if self.at.depth == 0 { self.reach } else { f32::INFINITY };
        Ray { t_max, ..Ray::new(self.at.origin, self.at.direction) }
    }

    /// Adds light that nothing was in front of.
    pub(in crate::integrator) fn add(&mut self, light: Spectrum) {
        self.radiance += light;
    }

    /// Goes on as a branch does.
    pub(in crate::integrator) fn go_back(&mut self, branch: Branch) {
        self.at = branch;
    }
}

impl<'a> PathIntegrator<'a> {
    /// Takes up a path that waited.
    pub(in crate::integrator) fn resume<'b>(&'b self, path: &SuspendedPath) -> Path<'b> {
        let SuspendedPath { at, radiance, start, reach, worth, due, wants_albedo, record } = path;
        Path {
            integrator: self,
            sampler: at.sampler,
            guide: self.guide(),
            trail: None,
            throughput: at.throughput,
            radiance: *radiance,
            absorption: at.absorption,
            roulette_scale: at.roulette_scale,
            depth: at.depth,
            origin: at.origin,
            direction: at.direction,
            cone: at.cone,
            start: *start,
            reach: *reach,
            previous: at.previous,
            worth: *worth,
            due: *due,
            wants_albedo: *wants_albedo,
            record: *record,
        }
    }
}

impl Path<'_> {
    /// What is needed to take it up later.
    pub(in crate::integrator) fn suspend(&self) -> SuspendedPath {
        SuspendedPath {
            at: self.branch(),
            radiance: self.radiance,
            start: self.start,
            reach: self.reach,
            worth: self.worth,
            due: self.due,
            wants_albedo: self.wants_albedo,
            record: self.record,
        }
    }
}
