//! The paper's answer to "should I compute incoming irradiance?" (§4.4): a plane fitted to nearby sensors.

use bottega_scene::Spectrum;
use glam::{Mat3, Vec3};

use crate::{
    photon::{IrradianceMap, Nearest, is_alike},
    sampling::orthonormal_basis,
};

/// Number of irradiance sensors to find, and least number of them on the same surface.
const SENSORS: usize = 32;
const SENSORS_MIN: usize = 3;
/// Greatest number of sensors on the same surface that are used.
const TAKEN: usize = 12;
/// Cosine between normals at which a sensor's weight is zero, and least weight of a sensor.
const COSINE_MIN: f32 = 0.6;
const WEIGHT_MIN: f32 = 1e-3;
/// Ridge regularization of the plane's slope.
const SLOPE_RIDGE: f32 = 0.02;
/// Greatest distance of sensors off the plane of the surface, relative to their distance.
const FLATNESS: f32 = 0.35;

/// Irradiance sensors of a swarm.
#[derive(Clone, Debug)]
pub(in crate::ala) struct FittedSensors {
    /// Sensors with their indirect irradiance.
    pub(in crate::ala) sensors: IrradianceMap,
    /// σ of the irradiance sensors: the mean distance between objects.
    pub(in crate::ala) object_distance: f32,
}

impl FittedSensors {
    /// Number of irradiance sensors to find.
    pub(in crate::ala) const SENSORS: usize = SENSORS;

    /// Returns the irradiance fitted to nearby sensors; `None`: it must be computed.
    ///
    /// - `bounces`: greatest number of bounces of the light.
    #[inline(always)]
    pub(in crate::ala) fn at(&self, p: Vec3, normal: Vec3, bounces: u32, found: &mut Nearest) -> Option<Spectrum> {
        self.sensors.nearest(p, f32::INFINITY, found);
        // Keep the nearest sensors on the same surface
        let mut near = [(f32::INFINITY, 0_u32); SENSORS];
        let mut count = 0;
        for (number, distance_squared) in found.iter() {
            let sensor = self.sensors.places().photon(number);
            let off_plane = (sensor.p - p).dot(normal);
            let is_flat = off_plane * off_plane <= FLATNESS * FLATNESS * distance_squared;
            if is_flat && is_alike(sensor.mark().normal(), normal) && count < SENSORS {
                near[count] = (distance_squared, number);
                count += 1;
            }
        }
        let near = &mut near[..count];
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let near = &near[..count.min(TAKEN)];
        let distance: f32 = near.iter().map(|(squared, _)| squared.sqrt()).sum::<f32>() / near.len() as f32;
        // Compute where (Σ |x_j − x|) ∕ n − σ > 0
        if near.len() < SENSORS_MIN || distance > self.object_distance {
            return None;
        }
        Some(self.fitted(p, normal, bounces, near))
    }

    /// Returns the irradiance at a point from a weighted least-squares plane through nearby sensors, clamped to their
    /// range.
    ///
    /// - `near`: squared distances and numbers, ascending; at least one.
    fn fitted(&self, p: Vec3, normal: Vec3, bounces: u32, near: &[(f32, u32)]) -> Spectrum {
        let radius_squared = near[near.len() - 1].0 * 1.1 + f32::MIN_POSITIVE;
        let scale = 1.0 / radius_squared.sqrt();
        let (s, t) = orthonormal_basis(normal);
        let (mut matrix, mut sums) = (Mat3::ZERO, [Vec3::ZERO; 3]);
        let (mut low, mut high) = (Spectrum::INFINITY, Spectrum::ZERO);
        for &(squared, number) in near {
            let sensor = self.sensors.places().photon(number);
            let (mark, way) = (sensor.mark(), (sensor.p - p) * scale);
            let facing = (mark.normal().dot(normal) - COSINE_MIN).max(0.0) / (1.0 - COSINE_MIN);
            let weight = (1.0 - squared / radius_squared) * facing * facing + WEIGHT_MIN;
            let (power, row) = (self.sensors.irradiance(number, bounces), Vec3::new(1.0, way.dot(s), way.dot(t)));
            matrix += Mat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
            for channel in 0..3 {
                sums[channel] += row * (power[channel] * weight);
            }
            (low, high) = (low.min(power), high.max(power));
        }
        // Prefer no slope where sensors do not determine it
        let ridge = SLOPE_RIDGE * matrix.x_axis.x;
        matrix.y_axis.y += ridge;
        matrix.z_axis.z += ridge;
        let inverse = matrix.inverse();
        // Solve for the plane's height only
        let height = Vec3::new(inverse.x_axis.x, inverse.y_axis.x, inverse.z_axis.x);
        let fitted = Vec3::from_array(sums.map(|sum| sum.dot(height)));
        if fitted.is_finite() { fitted.clamp(low, high) } else { low }
    }
}
