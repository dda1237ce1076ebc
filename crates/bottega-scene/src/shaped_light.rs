//! Lights with a shape of their own, which become a sphere or a mesh with a material when they are put into a scene.
//!
//! They emit and are otherwise clear sheets: they cast no shadow and hide nothing, as in Cycles.

use glam::{Affine3A, Vec2, Vec3, Vec3A};
use serde::{Deserialize, Serialize};

use crate::color::Spectrum;
use crate::emission::{DirectionPicture, EmissionProfile};
use crate::light::SpotFalloff;
use crate::material::Material;
use crate::model::{COORDINATE_MAX, Instance, Mesh, Scene};
use crate::param::ColorParam;
use crate::surface::Surface;
use crate::texture::TextureMap;
use crate::values::FACTOR_MAX;
use crate::visibility::Visibility;

/// Number of corners of the polygon that stands for an ellipse; its area is the ellipse's.
const ELLIPSE_CORNERS: u32 = 48;

/// A sphere that emits everywhere, into a cone or by a picture of directions: a point or spot light with soft shadows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SphereLight {
    /// Centre, world space.
    #[serde(with = "crate::numbers")]
    pub position: Vec3,
    /// Radius, above 0, in scene units.
    pub radius: f32,
    /// Radiant intensity in W·sr⁻¹ from afar, of a spot on its axis. The radiance is that over π times the squared radius.
    #[serde(with = "crate::numbers")]
    pub intensity: Spectrum,
    /// Cone of a spot; `None`: it emits in all directions.
    pub spot: Option<SpotCone>,
    /// Factor of the intensity by direction, in place of a cone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<DirectionPicture>,
}

/// The cone of a spot. The radiance of every point of the light falls off by the angle of its direction to the axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpotCone {
    /// Axis of the cone, unit length, world space.
    #[serde(with = "crate::numbers")]
    pub direction: Vec3,
    /// Cosine of the half angle inside which the intensity is full.
    pub cos_inner: f32,
    /// Cosine of the half angle outside which the intensity is 0; below `cos_inner`.
    pub cos_outer: f32,
    /// Falloff of the intensity between the two angles.
    pub falloff: SpotFalloff,
}

/// A rectangle or an ellipse that emits from its front.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AreaLight {
    /// Light space to world space; may scale. The light lies around the origin in the plane z = 0 and emits towards −z.
    #[serde(with = "crate::numbers")]
    pub world_from_light: Affine3A,
    /// Extent along x and y, light space, above 0.
    #[serde(with = "crate::numbers")]
    pub size: Vec2,
    /// `true`: an ellipse; `false`: a rectangle.
    pub is_ellipse: bool,
    /// Power in W, whatever size and spread. The radiance of a light without spread is that over π times the area.
    #[serde(with = "crate::numbers")]
    pub power: Spectrum,
    /// Full angle of the cone around the normal into which each point emits, in radians; π: all directions. See
    /// [`EmissionProfile::Spread`].
    pub spread: f32,
    /// Factor of the radiance by position. The first texture coordinates run from (0, 0) at (−x, +y) of light space to (1, 1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texture: Option<TextureMap>,
    /// Factor of the radiance by direction, in place of a spread.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub profile: Option<DirectionPicture>,
}

impl SphereLight {
    /// Returns the light's material, or the reason why there is none.
    pub(crate) fn material(&self) -> Result<Material, &'static str> {
        let is_in_reach = self.position.is_finite() && self.position.abs().max_element() <= COORDINATE_MAX;
        if !is_in_reach {
            return Err("its position is not finite, or out of reach");
        }
        if !(self.radius > 0.0 && self.radius <= COORDINATE_MAX) {
            return Err("its radius is not above 0");
        }
        let profile = match (self.spot, self.profile) {
            (None, None) => EmissionProfile::Diffuse,
            (Some(SpotCone { direction: axis, cos_inner, cos_outer, falloff }), None) => {
                EmissionProfile::Spot { axis, cos_inner, cos_outer, falloff }
            }
            (None, Some(picture)) => EmissionProfile::Picture(picture),
            (Some(_), Some(_)) => return Err("it has both a cone and a profile: put the cone into the profile"),
        };
        if !profile.is_sound() {
            return Err(match profile {
                EmissionProfile::Picture(_) => "its orientation is not a rotation",
                _ => "its cone is inside out, or its direction not of unit length",
            });
        }
        emitter(self.intensity / (std::f32::consts::PI * self.radius * self.radius), profile)
    }

    /// Puts it into a scene.
    fn place(&self, scene: &mut Scene, material: u32, visibility: Visibility) {
        scene.push_sphere(self.position, self.radius, material);
        if let Some(sphere) = scene.spheres.last_mut() {
            sphere.visibility = visibility;
        }
    }
}

impl AreaLight {
    /// Returns half of its extents in world space, and its area.
    fn extents(&self) -> ([Vec3A; 2], f32) {
        let axes = self.world_from_light.matrix3;
        let [x, y] = [axes.x_axis * (0.5 * self.size.x), axes.y_axis * (0.5 * self.size.y)];
        let shape = if self.is_ellipse { std::f32::consts::PI } else { 4.0 };
        ([x, y], shape * x.cross(y).length())
    }

    /// Returns the light's material, or the reason why there is none.
    pub(crate) fn material(&self) -> Result<Material, &'static str> {
        let ([x, y], area) = self.extents();
        let is_in_reach = self.world_from_light.is_finite()
            && (self.world_from_light.translation.abs() + x.abs() + y.abs()).max_element() <= COORDINATE_MAX;
        if !is_in_reach {
            return Err("its transformation is not finite, or out of reach");
        }
        if !(self.size.min_element() > 0.0 && area.is_normal()) {
            return Err("it has no area");
        }
        let is_wide = self.spread >= std::f32::consts::PI;
        let half_angle = 0.5 * self.spread;
        let profile = match (self.profile, is_wide) {
            (None, true) => EmissionProfile::Diffuse,
            (None, false) => EmissionProfile::Spread { half_angle },
            (Some(picture), true) => EmissionProfile::Picture(picture),
            (Some(_), false) => return Err("it has both a spread and a profile: put the spread into the profile"),
        };
        if !profile.is_sound() {
            return Err("its spread is not from 0.2° to 180°, or the orientation of its profile is not a rotation");
        }
        // The camera does not see its back
        let material = emitter(self.power / (std::f32::consts::PI * area), profile)?;
        let emission = ColorParam { texture: self.texture, ..material.emission };
        Ok(Material { culls_back: true, emission, ..material })
    }

    /// Puts it into a scene.
    fn place(&self, scene: &mut Scene, material: u32, visibility: Visibility) {
        let ([x, y], _) = self.extents();
        let middle = self.world_from_light.translation;
        // The front is where it emits: −z of light space, which a mirroring transformation turns
        let axes = self.world_from_light.matrix3;
        let is_turned = x.cross(y).dot(axes.z_axis) > 0.0;
        let y = if is_turned { -y } else { y };
        // Texture coordinates of a point by its shares of x and y, from −1 to 1
        let uv = |[x, y]: [f32; 2]| 0.5 + 0.5 * Vec2::new(x, if is_turned { y } else { -y });
        let (positions, shares, triangles) = if self.is_ellipse {
            let turn = 2.0 * std::f64::consts::PI / f64::from(ELLIPSE_CORNERS);
            // The polygon with the area of the ellipse
            let scale = (turn / turn.sin()).sqrt();
            let corner = |index: u32| {
                let (sin, cos) = (turn * f64::from(index)).sin_cos();
                [(scale * cos) as f32, (scale * sin) as f32]
            };
            let mut shares = vec![[0.0; 2]];
            shares.extend((0..ELLIPSE_CORNERS).map(corner));
            let mut positions = vec![Vec3::from(middle)];
            positions.extend(shares[1..].iter().map(|&[cos, sin]| Vec3::from(middle + x * cos + y * sin)));
            let triangles = (0..ELLIPSE_CORNERS).map(|i| [0, 1 + i, 1 + (i + 1) % ELLIPSE_CORNERS]);
            (positions, shares, triangles.collect())
        } else {
            let corners = [-x - y, x - y, x + y, y - x].map(|corner| Vec3::from(middle + corner));
            let shares = vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            (corners.to_vec(), shares, vec![[0, 1, 2], [0, 2, 3]])
        };
        let mesh = scene.meshes.len() as u32;
        let uvs = if self.texture.is_some() { shares.into_iter().map(uv).collect() } else { Vec::new() };
        scene.meshes.push(Mesh { positions, triangles, material, uvs: [uvs, Vec::new()], ..Mesh::default() });
        scene.instances.push(Instance { visibility, ..Instance::new(mesh, Affine3A::IDENTITY) });
    }
}

/// Returns the material of a light of this radiance.
fn emitter(radiance: Spectrum, emission_profile: EmissionProfile) -> Result<Material, &'static str> {
    let is_sound = radiance.to_array().into_iter().all(|channel| (0.0..=FACTOR_MAX).contains(&channel));
    if !is_sound {
        return Err("its strength is negative or not finite, or more than 1e15 for its size");
    }
    let surface = Surface::clear_sheet(Spectrum::ONE.into());
    Ok(Material { surface, see_through: true, emission_profile, ..Material::emitter(radiance) })
}

/// A light with a shape.
pub(crate) enum ShapedLight<'a> {
    Sphere(&'a SphereLight),
    Area(&'a AreaLight),
}

impl Scene {
    /// Adds a light with a shape. It casts no shadow. One that is not sound is left out.
    pub(crate) fn push_shaped_light(&mut self, name: &str, light: &ShapedLight<'_>, visibility: Visibility) {
        let material = match light {
            ShapedLight::Sphere(light) => light.material(),
            ShapedLight::Area(light) => light.material(),
        };
        let Ok(material) = material else { return };
        let material = self.push_material(Material { name: name.to_owned(), ..material });
        let visibility = visibility.without(Visibility::SHADOW);
        match light {
            ShapedLight::Sphere(light) => light.place(self, material, visibility),
            ShapedLight::Area(light) => light.place(self, material, visibility),
        }
    }
}
