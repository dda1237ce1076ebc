//! Motion vectors: the movement of the first surface of a sample in the picture, while the shutter is open.

use bottega_kernels::Hit;
use glam::{Vec2, Vec3};

use super::path::PathIntegrator;
use crate::interaction::place_at;

impl PathIntegrator<'_> {
    /// Returns the motion vectors of a point, in pixels to the right and up: from where the picture shows it at the time
    /// of its path to where it shows it when the shutter is closed, then to where it shows it when the shutter opens. With a
    /// rolling shutter, these are the times of the pixel's row.
    ///
    /// - `p`: the point at the time of the path.
    /// - `hit`: the hit at the point; [`Hit::NONE`]: it lies in a medium, which stands still.
    /// - `time`: the time of the path, from 0 to 1.
    pub(super) fn motion_vectors(&self, p: Vec3, hit: &Hit, time: f32, (x, y): (u32, u32)) -> [f32; 4] {
        let prepared = self.prepared();
        if !prepared.motion().moves() {
            return [0.0; 4];
        }
        let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let vector_to = |moment: f32| {
            let other = self.time_of_row(moment, y);
            let there = if hit.is_none() { p } else { place_at(prepared, hit, p, [time, other]) };
            self.camera().vector_between(center, (p, time), (there, other))
        };
        let [forward, backward] = [1.0, 0.0].map(vector_to);
        [forward.x, forward.y, backward.x, backward.y]
    }
}
