//! Something that traces rays.

use crate::Ray;
use std::time::Duration;

/// Something that traces rays.
pub trait RayKernel {
    /// For the table.
    fn name(&self) -> String;
    /// Finds the closest hit of every ray; returns the number of hits and the sum of their parameters.
    fn closest(&self, rays: &[Ray]) -> (usize, f64);
    /// Returns how many rays hit anything.
    fn any(&self, rays: &[Ray]) -> usize;
    /// Nodes and leaves visited by an average ray, where the kernel can tell. Does not depend on the machine.
    fn steps(&self, _rays: &[Ray]) -> Option<f64> {
        None
    }
    /// How long it took to build.
    fn build_time(&self) -> Duration;
    /// Bytes that traversal needs, all in.
    fn bytes(&self) -> usize;
}
