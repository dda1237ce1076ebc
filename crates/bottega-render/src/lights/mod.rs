//! All lights of a scene, and light sampling at a point.
//!
//! Lights at a position are the leaves of a tree, which chooses one by an estimate of the light that arrives at the
//! point; lights at infinity, the environment and suns, are separate. Light that light sampling never chooses
//! has pdf 0 and is left to BSDF sampling with full MIS weight.

mod bounds;
mod choice;
mod direction_picture;
mod distribution;
mod emission;
mod environment;
mod far;
mod groups;
mod moving;
mod panel;
mod path_kind;
mod portal;
mod posed;
mod profile;
mod punctual;
mod rectangle;
mod sample;
mod sphere;
mod sun;
mod surface;
mod tree;
mod triangle;
mod window;

#[cfg(test)]
mod tests;

use bottega_kernels::Hit;
use bottega_scene::{LightKind, Scene, Sphere, Visibility};
use glam::Vec3;

use crate::{bsdf::warp::ONE_MINUS_EPSILON, density::SolidAnglePdf, sampler::Quad, surfaces::Surfaces};
use bounds::LightBounds;
pub(crate) use choice::{Choice, NUMBERS as CHOICE_NUMBERS, RequestedLight};
pub(crate) use distribution::{Bilinear, Cells};
pub(crate) use emission::{AimCone, Emission, EmissionPlan, EmittedPhoton};
pub(crate) use environment::{EnvironmentLight, EnvironmentRows, EnvironmentTable, direction_of_square, square_of};
pub(crate) use far::FarLight;
pub use groups::LightGroups;
pub(crate) use panel::{Grid, Panel, PanelPart, PanelShape};
pub(crate) use path_kind::PathEnd;
pub use path_kind::{LightFinder, PathKind};
pub(crate) use profile::Profile;
pub(crate) use sample::{LightSample, NO_LIGHT, Receiver};
pub(crate) use sun::Sun;
pub use surface::SOLID_ANGLE_MIN;
pub(crate) use surface::SurfaceLight;
pub use tree::DISTANCE_SQUARED_MIN;
pub(crate) use tree::{Arc, LightNode, LightTree, Segment};

/// Smallest probability of sampling lights at infinity, and of sampling the others, where both exist; their estimates
/// ignore visibility.
pub const SHARE_MIN: f32 = 0.1;

/// All lights of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights {
    pub(crate) environment: Option<EnvironmentLight>,
    /// Lights at infinity with a direction.
    pub(crate) suns: Vec<Sun>,
    pub(crate) tree: LightTree,
    /// Lights by number in the tree.
    pub(crate) lights: Vec<Light>,
    /// Emitting spheres as (index in the scene, number in the tree), ascending; [`NO_LIGHT`] for dark ones.
    spheres: Vec<(u32, u32)>,
    /// Emitting triangles, instance by instance.
    pub(crate) triangles: Vec<TriangleLight>,
    /// Numbers in the tree of the parts of all panels; [`NO_LIGHT`] for dark ones.
    pub(crate) parts: Vec<u32>,
    /// Kinds of ray that find the lights of the tree; empty: all that leave an event.
    visibilities: Vec<Visibility>,
}

/// A light of the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Light {
    /// A light without extent; index into the scene's lights.
    Punctual(u32),
    /// An emitting sphere; index into the scene's spheres.
    Sphere(u32),
    Surface(SurfaceLight),
}

/// The light that a triangle belongs to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleLight {
    /// Index in [`Lights::parts`] of the first part of its panel.
    pub(crate) first_part: u32,
    /// Shape of its panel.
    pub(crate) shape: PanelShape,
    /// `true`: the second triangle of a rectangle.
    pub(crate) is_second: bool,
    /// Division of its panel.
    pub(crate) grid: Grid,
}

/// Lights and their bounds, collected before the tree is built.
#[derive(Default)]
struct CollectedLights {
    lights: Vec<Light>,
    bounds: Vec<LightBounds>,
}

impl CollectedLights {
    /// Adds a light and returns its number; [`NO_LIGHT`] for a dark one, which is not added.
    fn push(&mut self, light: Light, bounds: LightBounds) -> u32 {
        if !(bounds.intensity > 0.0 && bounds.intensity.is_finite()) {
            return NO_LIGHT;
        }
        self.lights.push(light);
        self.bounds.push(bounds);
        self.lights.len() as u32 - 1
    }
}

impl Lights {
    /// Collects the lights, and sets the first light of each emitting instance.
    pub(crate) fn new(surfaces: &mut Surfaces, compensate_environment: bool) -> Self {
        let scene = &*std::sync::Arc::clone(surfaces.scene());
        let environment = scene
            .environment
            .as_ref()
            .map(|environment| EnvironmentLight::new(scene, environment, compensate_environment));
        let mut lights = Self { environment, ..Self::default() };
        let mut collected = CollectedLights::default();
        // Collect suns and lights without extent
        for (light, index) in scene.lights.iter().zip(0..) {
            if let LightKind::Directional { direction, irradiance, angle } = light.kind {
                lights.suns.push(Sun::new(direction, irradiance, angle, light.visibility));
            } else if !light.visibility.has_bounces() {
                continue;
            } else if let Some(bounds) = punctual::bounds(scene, &light.kind) {
                let bounds = moving::along_light(surfaces, index, bounds);
                collected.push(Light::Punctual(index), bounds);
            }
        }
        // Collect emitting spheres and meshes
        let shines = |surfaces: &Surfaces, material: u32| surfaces.materials[material as usize].shines;
        let is_light = |sphere: &Sphere| shines(surfaces, sphere.material) && sphere.visibility.has_bounces();
        for (sphere, index) in scene.spheres.iter().zip(0..).filter(|(sphere, _)| is_light(sphere)) {
            let bounds = moving::along_sphere(surfaces, index, sphere::bounds(scene, sphere));
            let number = collected.push(Light::Sphere(index), bounds);
            lights.spheres.push((index, number));
        }
        for (index, placed) in scene.instances.iter().enumerate() {
            if shines(surfaces, scene.material_of(placed)) && placed.visibility.has_bounces() {
                surfaces.instances[index].first_light = lights.triangles.len() as u32;
                lights.add_instance(surfaces, index as u32, &mut collected);
            }
        }
        lights.hang(&collected);
        lights.collect_visibilities(scene);
        lights
    }

    /// Keeps the visibilities of the lights of the tree, unless all kinds of ray after an event find all of them.
    fn collect_visibilities(&mut self, scene: &Scene) {
        let of_light = |light: &Light| match light {
            Light::Punctual(index) => scene.lights[*index as usize].visibility,
            Light::Sphere(index) => scene.spheres[*index as usize].visibility,
            Light::Surface(surface) => scene.instances[surface.instance() as usize].visibility,
        };
        if self.lights.iter().any(|light| of_light(light).tells_bounces_apart()) {
            self.visibilities = self.lights.iter().map(of_light).collect();
        }
    }

    /// Returns the kinds of ray that find a light of the tree.
    #[inline(always)]
    fn visibility_of(&self, light: u32) -> Visibility {
        self.visibilities.get(light as usize).copied().unwrap_or(Visibility::ALL)
    }

    fn add_instance(&mut self, surfaces: &Surfaces, instance: u32, collected: &mut CollectedLights) {
        let scene = &**surfaces.scene();
        let panels = Panel::of_instance(scene, instance, surfaces.is_moving(instance));
        for panel in &panels {
            let grid = panel.grid(scene, panels.len());
            let first_part = self.parts.len() as u32;
            self.triangles.extend((0..panel.triangle_count()).map(|i| TriangleLight {
                first_part,
                shape: panel.shape,
                is_second: i > 0,
                grid,
            }));
            let parts = SurfaceLight::of_panel(panel, scene, grid).into_iter();
            self.parts.extend(parts.map(|(light, bounds)| {
                let bounds = moving::along_panel(surfaces, panel, bounds);
                collected.push(Light::Surface(light), bounds)
            }));
        }
    }

    /// Returns the number in the tree of a sphere of the scene; [`NO_LIGHT`] for a dark one.
    pub(crate) fn of_sphere(&self, sphere: u32) -> u32 {
        let place = self.spheres.binary_search_by_key(&sphere, |&(index, _)| index);
        place.map_or(NO_LIGHT, |place| self.spheres[place].1)
    }

    /// Builds the tree and renumbers all lights in its order.
    fn hang(&mut self, collected: &CollectedLights) {
        let (tree, order) = LightTree::new(&collected.bounds);
        let mut number = vec![NO_LIGHT; order.len()];
        for (new, &old) in (0..).zip(&order) {
            number[old as usize] = new;
        }
        let renumber = |light: &mut u32| *light = number.get(*light as usize).copied().unwrap_or(NO_LIGHT);
        self.spheres.iter_mut().for_each(|(_, light)| renumber(light));
        self.parts.iter_mut().for_each(renumber);
        self.lights = order.iter().map(|&old| collected.lights[old as usize]).collect();
        self.tree = tree;
    }

    /// Returns true if light sampling finds no light at any point.
    pub(crate) fn is_empty(&self) -> bool {
        self.lights.is_empty() && !self.has_far()
    }

    /// Returns true if light sampling alone finds all light; false if a part of the environment is left to BSDF sampling.
    pub(crate) fn are_all_found(&self) -> bool {
        self.environment.as_ref().is_none_or(EnvironmentLight::is_found)
    }

    /// Returns true if some sun has a disc.
    pub(crate) fn has_discs(&self) -> bool {
        self.suns.iter().any(|sun| !sun.is_parallel())
    }

    /// Returns true if there are sampled lights at infinity.
    pub(crate) fn has_far(&self) -> bool {
        !self.suns.is_empty() || self.environment.as_ref().is_some_and(EnvironmentLight::is_sampled)
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.tree.memory_bytes()
            + size_of_val(&*self.lights)
            + size_of_val(&*self.triangles)
            + size_of_val(&*self.parts)
            + size_of_val(&*self.spheres)
            + size_of_val(&*self.visibilities)
            + size_of_val(&*self.suns)
            + self.environment.as_ref().map_or(0, EnvironmentLight::memory_bytes)
    }

    /// Samples one light and a point on it. `None`: no light for these random numbers.
    #[inline(always)]
    pub(crate) fn sample(&self, surfaces: &Surfaces, receiver: &Receiver, u: Quad) -> Option<LightSample> {
        self.sample_by_place(surfaces, receiver, u, |light, place| {
            self.sample_place(surfaces, light, receiver.p, place)
        })
    }

    /// Samples one light, and a point on it.
    ///
    /// - `sample_place`: samples a point on a light of the tree, which has that number, by two random numbers.
    #[inline(always)]
    fn sample_by_place(
        &self,
        surfaces: &Surfaces,
        receiver: &Receiver,
        u: Quad,
        sample_place: impl FnOnce(u32, [f32; 2]) -> Option<LightSample>,
    ) -> Option<LightSample> {
        // Choose between lights at infinity and those of the tree
        let share = self.far_share(receiver);
        if u[0] < share {
            return self.sample_far(surfaces.scene(), receiver, u[0] / share, share, [u[1], u[2]]);
        }
        // Choose a light of the tree, then a point on it
        let choice = if share > 0.0 { ((u[0] - share) / (1.0 - share)).min(ONE_MINUS_EPSILON) } else { u[0] };
        let (light, pmf) = self.tree.sample(receiver, choice)?;
        let pmf = pmf * (1.0 - share);
        let sample = sample_place(light, [u[1], u[2]])?;
        Some(LightSample { pdf: sample.pdf * pmf, pmf, ..sample })
    }

    /// Samples a point on a given light: `pdf` is the density of the direction alone. `None`: no light arrives.
    #[inline(always)]
    pub(crate) fn sample_place(&self, surfaces: &Surfaces, light: u32, from: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let sample = match &self.lights[light as usize] {
            Light::Surface(surface) => surface.sample(surfaces, from, u)?,
            Light::Sphere(index) => sphere::sample(surfaces, &surfaces.scene().spheres[*index as usize], from, u)?,
            Light::Punctual(index) => {
                let scene = &**surfaces.scene();
                punctual::sample(scene, &scene.lights[*index as usize].kind, from)?
            }
        };
        Some(LightSample { light, visibility: self.visibility_of(light), ..sample })
    }

    /// Returns the density with which [`Self::sample_place`] draws the direction to the point `p` on a light with extent.
    pub(crate) fn place_pdf(&self, scene: &Scene, light: u32, from: Vec3, p: Vec3) -> SolidAnglePdf {
        match &self.lights[light as usize] {
            Light::Surface(surface) => surface.pdf(from, p),
            Light::Sphere(index) => sphere::pdf(&scene.spheres[*index as usize], from, p),
            Light::Punctual(_) => SolidAnglePdf::ZERO,
        }
    }

    /// Returns the probability of sampling lights at infinity.
    #[inline(always)]
    fn far_share(&self, receiver: &Receiver) -> f32 {
        if !self.has_far() {
            return 0.0;
        }
        if self.lights.is_empty() {
            return 1.0;
        }
        let far = self.far_total(receiver);
        let near = self.tree.total(receiver);
        if far <= 0.0 {
            0.0
        } else if near <= 0.0 {
            1.0
        } else {
            (far / (far + near)).clamp(SHARE_MIN, 1.0 - SHARE_MIN)
        }
    }

    fn sample_far(
        &self,
        scene: &Scene,
        receiver: &Receiver,
        u: f32,
        share: f32,
        place: [f32; 2],
    ) -> Option<LightSample> {
        let total = self.far_total(receiver);
        let mut rest = u * total;
        let far = |sun, wi, radiance, pdf: SolidAnglePdf, pmf: f32, is_delta, visibility| LightSample {
            wi,
            distance: f32::INFINITY,
            radiance,
            pdf: pdf * pmf,
            is_delta,
            light: NO_LIGHT,
            sun,
            pmf,
            visibility,
        };
        // Choose a sun by its share of the illuminance
        for (sun, index) in self.suns.iter().zip(0..) {
            let importance = sun.importance(receiver);
            if rest < importance {
                let (wi, radiance, pdf, is_delta) = sun.sample(place);
                return Some(far(index, wi, radiance, pdf, share * importance / total, is_delta, sun.visibility));
            }
            rest -= importance;
        }
        // Otherwise sample the environment
        let environment = self.environment.as_ref()?;
        let illuminance = environment.illuminance(receiver.p);
        let choice = (rest / illuminance).min(ONE_MINUS_EPSILON);
        let (wi, radiance, pdf) = environment.sample_at(scene, receiver.p, [choice, place[0], place[1], 0.0])?;
        let pmf = share * illuminance / total;
        (pmf > 0.0).then(|| far(NO_LIGHT, wi, radiance, pdf, pmf, false, environment.visibility))
    }

    /// Returns an estimate of the illuminance by sampled lights at infinity.
    #[inline]
    fn far_total(&self, receiver: &Receiver) -> f32 {
        let environment = self.environment.as_ref().map_or(0.0, |light| light.illuminance(receiver.p));
        environment + self.suns.iter().map(|sun| sun.importance(receiver)).sum::<f32>()
    }

    /// Returns the number of the light that was hit; `None` if light sampling never finds it.
    pub(crate) fn light_of(&self, surfaces: &Surfaces, hit: &Hit) -> Option<u32> {
        let number = match hit.sphere() {
            Some(sphere) => self.of_sphere(sphere),
            None => {
                let first = surfaces.instance(hit.instance).first_light;
                if first == NO_LIGHT {
                    return None;
                }
                let light = &self.triangles[(first + hit.primitive) as usize];
                let part = light.grid.part_at(light.shape, light.is_second, (hit.u, hit.v));
                self.parts[(light.first_part + part) as usize]
            }
        };
        (number != NO_LIGHT).then_some(number)
    }

    /// Returns the probability with which [`Self::sample`] chooses a light of the tree.
    #[inline(always)]
    pub(crate) fn pmf(&self, receiver: &Receiver, light: u32) -> f32 {
        let near = 1.0 - self.far_share(receiver);
        if near > 0.0 { near * self.tree.pmf(receiver, light) } else { 0.0 }
    }

    /// Returns the density with which [`Self::sample`] draws the direction to the point `p` of a hit on an emitting
    /// surface.
    pub(crate) fn hit_pdf(&self, surfaces: &Surfaces, hit: &Hit, receiver: &Receiver, p: Vec3) -> SolidAnglePdf {
        self.hit_pdf_by(surfaces, hit, receiver, p, None)
    }

    /// Samples a light of the tree for a segment of a ray in a medium; returns its number and probability. `None`: no
    /// light for this number.
    pub(crate) fn sample_along(&self, segment: &Segment, u: f32) -> Option<(u32, f32)> {
        self.tree.sample(segment, u)
    }

    /// Returns the probability with which [`Self::sample_along`] chooses a light.
    pub(crate) fn pmf_along(&self, segment: &Segment, light: u32) -> f32 {
        self.tree.pmf(segment, light)
    }

    /// Returns the segment as seen from the centre of a light, for equiangular sampling.
    pub(crate) fn arc(&self, scene: &Scene, segment: &Segment, light: u32) -> Arc {
        let (middle, radius_squared) = match &self.lights[light as usize] {
            Light::Surface(surface) => surface.ball(),
            Light::Sphere(index) => {
                let sphere = &scene.spheres[*index as usize];
                (sphere.center, sphere.radius * sphere.radius)
            }
            Light::Punctual(index) => (punctual::position(&scene.lights[*index as usize].kind), 0.0),
        };
        Arc::new(segment, middle, radius_squared)
    }
}
