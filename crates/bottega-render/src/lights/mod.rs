//! Everything that shines, and the choice of one light for a point.
//!
//! Light indices: the environment first (where it is sampled), then lights without extent, then spheres that shine, then the triangles
//! of instances that shine. A light is chosen by power. What light sampling never chooses has probability 0 in both
//! directions, and so is left to BSDF sampling with full weight.

mod alias;
mod environment;
mod punctual;
mod sphere;
mod spherical;
mod triangle;

use std::f32::consts::PI;

use bottega_scene::{Scene, Sides, Spectrum};
use glam::Vec3;

use crate::{
    luminance,
    prepare::{PreparedInstance, PreparedMaterial, PreparedScene},
    sampler::Quad,
};
use alias::AliasTable;
use environment::EnvironmentLight;

/// Stands for "no light" in a light index.
pub(crate) const NO_LIGHT: u32 = u32::MAX;

/// Light that reaches a point from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LightSample {
    /// Unit length, from the point to the light.
    pub(crate) wi: Vec3,
    /// How far the light is; infinite for one infinitely far away.
    pub(crate) distance: f32,
    /// Radiance along `wi`, if nothing is between. Of a light without extent: intensity over squared distance.
    pub(crate) radiance: Spectrum,
    /// Density per solid angle, or the probability alone of a light without extent.
    pub(crate) pdf: f32,
    /// Whether only light sampling can find it.
    pub(crate) is_delta: bool,
}

/// A point that asks for light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    /// World space.
    pub(crate) p: Vec3,
    /// Normal of an opaque surface on the side that is lit; 0 where light counts from everywhere: in a medium, and on a
    /// surface that lets light through.
    pub(crate) n: Vec3,
}

/// All lights of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights {
    environment: Option<EnvironmentLight>,
    /// Index of the first light without extent: 1 where the environment is a light, else 0.
    first_punctual: u32,
    first_sphere: u32,
    /// The shining spheres, as indices into the scene's.
    spheres: Vec<u32>,
    first_triangle: u32,
    /// The shining instances, as (light index of the first triangle, instance), ascending.
    instances: Vec<(u32, u32)>,
    /// By light index.
    choice: AliasTable,
    light_count: usize,
}

impl Lights {
    /// Collects the lights and writes into `instances` where theirs begin.
    ///
    /// - `radius`: of a sphere around all surfaces.
    pub(crate) fn new(
        scene: &Scene,
        radius: f32,
        materials: &[PreparedMaterial],
        instances: &mut [PreparedInstance],
        compensate_environment: bool,
    ) -> Self {
        let disk = PI * radius * radius;
        let mut powers = Vec::new();

        let environment = scene
            .environment
            .as_ref()
            .map(|environment| EnvironmentLight::new(scene, environment, compensate_environment));
        if let Some(light) = environment.as_ref().filter(|light| light.is_sampled()) {
            powers.push(disk * light.integral());
        }
        let first_punctual = powers.len() as u32;
        powers.extend((0..scene.lights.len() as u32).map(|light| punctual::power(scene, light, disk)));

        let first_sphere = powers.len() as u32;
        let shines = |material: u32| materials[material as usize].shines;
        let spheres: Vec<u32> =
            (0..scene.spheres.len() as u32).filter(|&sphere| shines(scene.spheres[sphere as usize].material)).collect();
        powers.extend(spheres.iter().map(|&index| sphere::power(scene, index)));

        let first_triangle = powers.len() as u32;
        let mut shining = Vec::new();
        for (index, prepared) in instances.iter_mut().enumerate() {
            let mesh = &scene.meshes[scene.instances[index].mesh as usize];
            if shines(mesh.material) {
                prepared.first_light = powers.len() as u32;
                shining.push((prepared.first_light, index as u32));
                powers.extend(
                    (0..mesh.triangles.len() as u32).map(|triangle| triangle::power(scene, index as u32, triangle)),
                );
            }
        }
        Self {
            environment,
            first_punctual,
            first_sphere,
            spheres,
            first_triangle,
            instances: shining,
            choice: AliasTable::new(&powers),
            light_count: powers.len(),
        }
    }

    /// Whether light sampling finds nothing anywhere.
    pub(crate) fn is_empty(&self) -> bool {
        self.choice.is_empty()
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.light_count * AliasTable::ENTRY_BYTES
            + size_of_val(&*self.instances)
            + size_of_val(&*self.spheres)
            + self.environment.as_ref().map_or(0, EnvironmentLight::memory_bytes)
    }

    /// Draws one light and a place on it. `None`: these numbers give no light.
    #[inline]
    pub(crate) fn sample(&self, prepared: &PreparedScene, receiver: &Receiver, u: Quad) -> Option<LightSample> {
        let p = receiver.p;
        let (index, pmf) = self.choice.sample(u[0])?;
        let index = index as u32;
        let place = [u[1], u[2]];
        let sample = if index >= self.first_triangle {
            let (instance, triangle) = self.triangle(index);
            triangle::sample(prepared, instance, triangle, p, place)?
        } else if index >= self.first_sphere {
            sphere::sample(prepared.scene(), self.spheres[(index - self.first_sphere) as usize], p, place)?
        } else if index >= self.first_punctual {
            punctual::sample(prepared.scene(), index - self.first_punctual, p)?
        } else {
            let (wi, radiance, pdf) = self.environment.as_ref()?.sample(prepared.scene(), place)?;
            LightSample { wi, distance: f32::INFINITY, radiance, pdf, is_delta: false }
        };
        Some(LightSample { pdf: sample.pdf * pmf, ..sample })
    }

    /// The instance and triangle of a light index at or above `first_triangle`.
    #[inline]
    fn triangle(&self, index: u32) -> (u32, u32) {
        let after = self.instances.partition_point(|&(first, _)| first <= index);
        let (first, instance) = self.instances[after - 1];
        (instance, index - first)
    }

    /// Radiance of the environment in a direction of unit length.
    pub(crate) fn environment_radiance(&self, scene: &Scene, direction: Vec3) -> Spectrum {
        self.environment.as_ref().map_or(Spectrum::ZERO, |light| light.radiance(scene, direction))
    }

    /// Density per solid angle with which [`Self::sample`] draws a direction that meets no surface.
    pub(crate) fn environment_pdf(&self, _receiver: &Receiver, direction: Vec3) -> f32 {
        match &self.environment {
            Some(light) if self.first_punctual == 1 => light.pdf(direction) * self.choice.pmf(0),
            _ => 0.0,
        }
    }

    /// Density per solid angle with which [`Self::sample`] draws a place on a triangle.
    ///
    /// - `p`, `ng`: the place, and the unit normal there.
    pub(crate) fn triangle_pdf(
        &self,
        prepared: &PreparedScene,
        instance: u32,
        triangle: u32,
        receiver: &Receiver,
        p: Vec3,
        ng: Vec3,
    ) -> f32 {
        let first = prepared.instance(instance).first_light;
        if first == NO_LIGHT {
            return 0.0;
        }
        let pmf = self.choice.pmf((first + triangle) as usize);
        if pmf > 0.0 { pmf * triangle::pdf(prepared, instance, triangle, receiver.p, p, ng) } else { 0.0 }
    }

    /// Density per solid angle with which [`Self::sample`] draws a place on a sphere.
    pub(crate) fn sphere_pdf(&self, scene: &Scene, sphere: u32, receiver: &Receiver, p: Vec3) -> f32 {
        match self.spheres.binary_search(&sphere) {
            Ok(place) => {
                self.choice.pmf(self.first_sphere as usize + place) * sphere::pdf(scene, sphere, receiver.p, p)
            }
            Err(_) => 0.0,
        }
    }
}

/// Luminous exitance of a surface that shines with this radiance, on one side or both.
fn exitance(radiance: Spectrum, sides: Sides) -> f32 {
    sides.count() as f32 * PI * luminance(radiance).max(0.0)
}
