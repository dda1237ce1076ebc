//! A path that waits for the results of its rays.

use bottega_kernels::Ray;
use bottega_scene::Spectrum;

use super::{
    super::record::PathRecord,
    state::{Branch, Path},
};
use crate::integrator::PathIntegrator;

/// A light sample whose visibility is not known yet.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct DeferredLight {
    /// Shadow ray from the path to the light.
    pub(in crate::integrator) ray: Ray,
    /// Radiance added to the path if the ray hits nothing.
    pub(in crate::integrator) light: Spectrum,
    /// Groups of the light, if light is kept apart by groups.
    pub(in crate::integrator) groups: u32,
}

/// The state of a path between two of its vertices.
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
    /// Returns the ray that the path waits for.
    pub(in crate::integrator) fn ray(&self) -> Ray {
        let t_max = if self.at.depth == 0 { self.reach } else { f32::INFINITY };
        Ray { t_max, ..Ray::new(self.at.origin, self.at.direction) }
    }

    /// Adds light that is not occluded.
    pub(in crate::integrator) fn add(&mut self, light: Spectrum) {
        self.radiance += light;
    }

    /// Continues with a branch.
    pub(in crate::integrator) fn go_back(&mut self, branch: Branch) {
        self.at = branch;
    }
}

impl<'a> PathIntegrator<'a> {
    /// Returns a suspended path as a [`Path`] that can be traced on.
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
            groups: None,
        }
    }
}

impl Path<'_> {
    /// Returns the state that is needed to resume the path later.
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
