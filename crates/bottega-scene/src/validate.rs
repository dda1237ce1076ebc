//! Validation of the scene model.

use std::borrow::Cow;
use std::fmt::Display;

use rayon::prelude::*;

use crate::camera::{Aperture, BLADES_MAX, Camera, Clip, Projection, Stereo};
use crate::color::Spectrum;
use crate::displacement::Displacement;
use crate::emission::{EmissionProfile, is_orthonormal};
use crate::error::{SceneError, Violation};
use crate::keys::{check_instance_keys, check_times, check_transform_keys};
use crate::light::{Environment, LightKind, Portal};
use crate::material::{AlphaMode, Back, Material, ReliefSource};
use crate::medium::{Medium, MediumId};
use crate::model::{COORDINATE_MAX, Mesh, Scene, Sphere, is_placeable};

use crate::param::ColorParam;
use crate::surface::Surface;
use crate::texture::SURFACE_UV_SETS;
use crate::values::{FACTOR_MAX, VALUE_MAX};

impl Scene {
    /// Checks the invariants that every user of a scene relies on: no index out of range, no array of the wrong length,
    /// no NaN, no coordinate beyond [`COORDINATE_MAX`], no singular or mirroring instance, no empty sphere. Triangles
    /// of zero area and a missing camera are allowed.
    ///
    /// # Errors
    ///
    /// [`SceneError::Inconsistent`] names the first part that violates one.
    pub fn validate(&self) -> Result<(), SceneError> {
        let meshes = self.meshes.shared().par_iter().enumerate();
        let checked: Vec<Result<(), SceneError>> = meshes
            .map(|(index, mesh)| self.check_mesh(mesh).map_err(|problem| broken("meshes", index, problem)))
            .collect();
        checked.into_iter().collect::<Result<(), SceneError>>()?;
        let bounds: Vec<_> = self.meshes.shared().par_iter().map(|mesh| mesh.bounds()).collect();
        for (index, instance) in self.instances.iter().enumerate() {
            let problem = match bounds.get(instance.mesh as usize) {
                None => format!("there is no mesh {}", instance.mesh),
                Some(&bounds) if !is_placeable(bounds, &instance.world_from_object) => {
                    "its transformation is singular, mirrors, or moves the mesh out of reach".into()
                }
                Some(_) if instance.material.is_some_and(|material| material as usize >= self.materials.len()) => {
                    "its material does not exist".into()
                }
                Some(&bounds) => match check_instance_keys(bounds, &instance.motion) {
                    Err(Violation(problem)) => problem.into_owned(),
                    Ok(()) => continue,
                },
            };
            return Err(broken("instances", index, problem));
        }
        each("spheres", &self.spheres, |sphere| {
            check_sphere(sphere)?;
            self.check_material(sphere.material)
        })?;
        each("materials", &self.materials, |material| self.check_parameters(material))?;
        each("mappings", &self.mappings, |mapping| {
            check(mapping.mapping_from_world.is_finite() && mapping.kind.is_sound(), "it is not finite")
        })?;
        each("media", &self.media, check_medium)?;
        each("lights", &self.lights, |light| {
            self.check_light(&light.kind)?;
            check_transform_keys(&light.motion)
        })?;
        if let Some(environment) = &self.environment {
            self.check_environment(environment).map_err(|problem| place("environment", problem))?;
        }
        each("cameras", &self.cameras, |camera| self.check_camera(camera))?;
        let problem = "it closes before it opens, its times are not finite, or its ramp is not from 0 to 0.5";
        check(self.shutter.is_sound(), problem).map_err(|problem| place("shutter", problem))
    }

    /// Checks an environment of the scene.
    pub(crate) fn check_environment(&self, environment: &Environment) -> Result<(), Violation> {
        let has_image = environment.image.is_none_or(|image| (image.0 as usize) < self.images.len());
        check(has_image, "its image does not exist")?;
        check(is_color_factor(environment.factor), FACTOR)?;
        check(is_orthonormal(&environment.world_from_environment), "its orientation is not a rotation")?;
        check(environment.portals.iter().all(is_rectangle), "a portal is not a rectangle")
    }

    /// Checks a camera of the scene.
    pub(crate) fn check_camera(&self, camera: &Camera) -> Result<(), Violation> {
        check(camera.world_from_camera.is_finite(), "its transformation is not finite")?;
        check(
            camera.lens_radius >= 0.0 && camera.lens_radius.is_finite(),
            "its lens radius is negative or not finite",
        )?;
        check(camera.focus_distance > 0.0, "its focus distance is not above 0")?;
        check(camera.lens_shift.is_finite(), "its lens shift is not finite")?;
        check(camera.pixel_aspect.is_normal() && camera.pixel_aspect > 0.0, "its pixel aspect ratio is not above 0")?;
        let Clip { near, far } = camera.clip;
        check(near >= 0.0 && near.is_finite() && far > near, "its clip planes are negative or out of order")?;
        self.check_medium_id(camera.medium)?;
        let is_sound = match camera.projection {
            Projection::Perspective { vertical_fov } => vertical_fov > 0.0 && vertical_fov < std::f32::consts::PI,
            Projection::Orthographic { height } => height > 0.0 && height.is_finite(),
            Projection::Fisheye { field_of_view, height, .. } => {
                field_of_view > 0.0
                    && field_of_view <= 2.0 * std::f32::consts::PI + 1e-5
                    && height > 0.0
                    && height.is_finite()
            }
            Projection::Panorama(_) => true,
        };
        check(is_sound, "its field of view or height is out of range")?;
        let Aperture { blades, rotation, ratio } = camera.aperture;
        check(blades == 0 || (3..=BLADES_MAX).contains(&blades), "its aperture has neither 0 nor 3 to 1000 blades")?;
        let is_shape = rotation.is_finite() && ratio.is_normal() && ratio > 0.0;
        check(is_shape, "its aperture's rotation is not finite, or its ratio not above 0")?;
        let has_eyes =
            |stereo: Stereo| stereo.eye_distance >= 0.0 && stereo.eye_distance.is_finite() && stereo.convergence > 0.0;
        check(camera.stereo.is_none_or(has_eyes), "the distance of its eyes or their convergence is out of range")?;
        let is_share = |exposure: f32| (0.0..=1.0).contains(&exposure);
        check(camera.rolling_shutter.is_none_or(is_share), "the exposure of its rows is not between 0 and 1")?;
        check_transform_keys(&camera.motion)
    }

    fn check_material(&self, material: u32) -> Result<(), Violation> {
        check((material as usize) < self.materials.len(), format!("there is no material {material}"))
    }

    fn check_mesh(&self, mesh: &Mesh) -> Result<(), Violation> {
        self.check_material(mesh.material)?;
        let count = mesh.positions.len();
        let lengths =
            [mesh.normals.len(), mesh.tangents.len(), mesh.uvs[0].len(), mesh.uvs[1].len(), mesh.colors.len()];
        check(lengths.iter().all(|&length| length == 0 || length == count), "its vertex arrays differ in length")?;
        let is_in_range = |triangle: &[u32; 3]| triangle.iter().all(|&vertex| (vertex as usize) < count);
        check(mesh.triangles.par_iter().all(is_in_range), "a triangle refers to a vertex that does not exist")?;
        let is_in_reach = |p: &glam::Vec3| p.abs().max_element() <= COORDINATE_MAX && p.is_finite();
        check(mesh.positions.par_iter().all(is_in_reach), "a position is not finite, or out of reach")?;
        let is_unit = |length_squared: f32| (length_squared - 1.0).abs() < 1e-3;
        check(mesh.normals.par_iter().all(|n| is_unit(n.length_squared())), "a normal is not of unit length")?;
        let is_tangent = |t: &glam::Vec4| is_unit(t.truncate().length_squared()) && t.w.abs() == 1.0;
        check(mesh.tangents.par_iter().all(is_tangent), "a tangent is not of unit length")?;
        check(mesh.uvs.iter().flatten().all(|uv| uv.is_finite()), "a texture coordinate is not finite")?;
        let is_color = |c: &glam::Vec4| c.is_finite() && c.min_element() >= 0.0 && c.max_element() <= VALUE_MAX;
        check(mesh.colors.iter().all(is_color), "a vertex colour is not a colour")?;
        mesh.check_keys()?;
        mesh.curves.as_ref().map_or(Ok(()), |curves| curves.check(mesh.triangles.len()))
    }

    /// Checks a material of the scene.
    pub(crate) fn check_parameters(&self, material: &Material) -> Result<(), Violation> {
        for map in material.textures() {
            check((map.image.0 as usize) < self.images.len(), format!("there is no image {}", map.image.0))?;
            let sets = usize::from(SURFACE_UV_SETS) + self.mappings.len();
            check(usize::from(map.uv_set) < sets, "a texture uses coordinates that do not exist")?;
            check(map.picture_from_uv.is_finite(), "a texture transformation is not finite")?;
        }
        let emission = material.emission.texture.as_ref();
        // Emission is sampled per triangle, so it needs the surface's coordinates.
        check(
            emission.is_none_or(|map| map.uv_set < SURFACE_UV_SETS),
            "its emission has other texture coordinates than those of the surface",
        )?;
        self.check_surface(&material.surface)?;
        if let Back::Other(back) = &material.back {
            self.check_surface(back)?;
        }
        check(is_color(&material.emission), FACTOR)?;
        check(material.emission_profile.is_sound(), "its emission has no cone: from 0.1° to below 90° is allowed")?;
        if let EmissionProfile::Picture(picture) = &material.emission_profile {
            check((picture.image.0 as usize) < self.images.len(), "the picture of its emission does not exist")?;
        }
        check(is_factor(material.opacity.factor), FACTOR)?;
        check(
            material.displacement.as_ref().is_none_or(Displacement::is_sound),
            "a number of its displacement is not finite",
        )?;
        if let AlphaMode::Mask { cutoff } = material.alpha_mode {
            check(is_factor(cutoff), FACTOR)?;
        }
        match material.relief.as_ref().map(|relief| &relief.source) {
            Some(ReliefSource::Normals(_, scale)) => check(scale.is_finite(), "a normal map's scale is not finite")?,
            Some(ReliefSource::Heights(height)) => {
                check(height.factor.is_finite(), "a bump map's scale is not finite")?;
            }
            None => {}
        }
        self.check_medium_id(material.interior)?;
        self.check_medium_id(material.exterior)
    }

    fn check_surface(&self, surface: &Surface) -> Result<(), Violation> {
        check(
            !surface.blends_null(),
            "a part of a blend is `Null`: use `Surface::blend`, which makes a clear sheet of it",
        )?;
        let (colors, scalars) = surface.params();
        check(colors.into_iter().all(is_color), FACTOR)?;
        check(scalars.into_iter().all(|scalar| is_factor(scalar.factor)), FACTOR)?;
        check(surface.has_sound_varnish(), "a varnish lies on a surface that cannot be its base")?;
        check(surface.has_sound_scales(), "the scales of its hair have an angle beyond 90°")?;
        check(surface.has_sound_subsurface(), "the asymmetry g of its subsurface scattering is not between −1 and 1")?;
        check(surface.indices_of_refraction().into_iter().all(is_factor), "an index of refraction is negative")
    }

    fn check_medium_id(&self, medium: Option<MediumId>) -> Result<(), Violation> {
        check(medium.is_none_or(|medium| (medium.0 as usize) < self.media.len()), "there is no such medium")
    }

    /// Checks a light of the scene.
    pub(crate) fn check_light(&self, light: &LightKind) -> Result<(), Violation> {
        let (power, position, direction) = match *light {
            LightKind::Point { position, intensity } => (intensity, position, None),
            LightKind::Spot { position, direction, intensity, cos_inner, cos_outer, .. } => {
                check(cos_outer < cos_inner && cos_outer >= -1.0 && cos_inner <= 1.0, "its cone is inside out")?;
                (intensity, position, Some(direction))
            }
            LightKind::Directional { direction, irradiance, angle } => {
                check((0.0..=std::f32::consts::PI).contains(&angle), "its angle is not from 0 to π")?;
                (irradiance, glam::Vec3::ZERO, Some(direction))
            }
            LightKind::Goniometric { position, world_from_light, image, intensity, .. } => {
                check((image.0 as usize) < self.images.len(), "its picture does not exist")?;
                check(is_orthonormal(&world_from_light), "its orientation is not a rotation")?;
                (intensity, position, None)
            }
            LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect } => {
                check((picture.image.0 as usize) < self.images.len(), "its picture does not exist")?;
                check(picture.picture_from_uv.is_finite(), "the transformation of its picture is not finite")?;
                let is_sound = vertical_fov > 0.0 && vertical_fov < std::f32::consts::PI;
                check(
                    is_sound && aspect > 0.0 && aspect.is_finite(),
                    "its field of view or aspect ratio is out of range",
                )?;
                check(world_from_light.is_finite(), "its transformation is not finite")?;
                (intensity, world_from_light.translation.into(), None)
            }
        };
        check(is_color_factor(power), "its colour is negative, not finite or above 1e15")?;
        check(position.is_finite(), "its position is not finite")?;
        check(direction.is_none_or(glam::Vec3::is_normalized), "its direction is not of unit length")
    }
}

const FACTOR: &str = "a factor is negative, not finite or above 1e15";

fn is_factor(factor: f32) -> bool {
    (0.0..=FACTOR_MAX).contains(&factor)
}

fn is_color(color: &ColorParam) -> bool {
    is_color_factor(color.factor)
}

fn is_color_factor(color: Spectrum) -> bool {
    color.to_array().into_iter().all(is_factor)
}

/// Checks a sphere without its material.
pub(crate) fn check_sphere(sphere: &Sphere) -> Result<(), Violation> {
    check(sphere.radius > 0.0 && sphere.radius <= COORDINATE_MAX, "its radius is not above 0")?;
    let is_in_reach = sphere.center.abs().max_element() <= COORDINATE_MAX && sphere.center.is_finite();
    check(is_in_reach, "its centre is out of reach")?;
    check(sphere.world_from_object.is_normalized(), "its orientation is not a rotation")?;
    check_times(sphere.motion.iter().map(|key| key.time))?;
    for key in &sphere.motion {
        check_sphere(&Sphere {
            center: key.center,
            radius: key.radius,
            world_from_object: key.world_from_object,
            motion: Vec::new(),
            ..*sphere
        })?;
    }
    Ok(())
}

/// Checks a medium.
pub(crate) fn check_medium(medium: &Medium) -> Result<(), Violation> {
    let coefficients = [medium.absorption, medium.scattering, medium.emission];
    check(coefficients.into_iter().all(is_color_factor), "a coefficient is negative, not finite or above 1e15")?;
    check(medium.g > -1.0 && medium.g < 1.0, "its asymmetry is not between -1 and 1")?;
    let is_placed = medium.variation.as_ref().is_none_or(|variation| variation.grid_from_world.is_finite());
    check(is_placed, "the transformation of its grid is not finite")
}

fn is_rectangle(portal: &Portal) -> bool {
    let [x, y] = portal.edges;
    let (lengths, cosine) = (x.length() * y.length(), x.dot(y));
    let is_in_reach = |p: glam::Vec3| p.is_finite() && p.abs().max_element() <= COORDINATE_MAX;
    is_in_reach(portal.corner)
        && is_in_reach(x)
        && is_in_reach(y)
        && lengths.is_normal()
        && cosine.abs() <= 1e-3 * lengths
}

/// Returns the violation of an invariant that does not hold.
fn check(holds: bool, problem: impl Into<Cow<'static, str>>) -> Result<(), Violation> {
    if holds { Ok(()) } else { Err(Violation(problem.into())) }
}

fn each<T>(name: &str, list: &[T], check: impl Fn(&T) -> Result<(), Violation>) -> Result<(), SceneError> {
    list.iter().enumerate().try_for_each(|(index, item)| check(item).map_err(|problem| broken(name, index, problem)))
}

fn broken(name: &str, index: usize, problem: impl Display) -> SceneError {
    place(format!("{name}[{index}]"), problem)
}

fn place(place: impl Display, problem: impl Display) -> SceneError {
    SceneError::Inconsistent { place: place.to_string(), problem: problem.to_string() }
}
