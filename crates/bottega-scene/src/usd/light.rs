//! Lights: the values of UsdLux.

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use openusd::usd::Prim;

use super::context::{VisitedPrim, Walk};
use super::light_profile::{self, LightProfile};
use super::shaping::{Cone, cone, input};
use super::source::StageSource;
use super::texture::{SourceSpace, StandIn, WantedTexture};
use crate::model::Mesh;
use crate::spectrum::sampled::SampledSpectrum;
use crate::text::shortened;
use crate::texture::ImageId;
use crate::values::FACTOR_MAX;

/// A light, before it is placed.
pub(super) struct LightSpec {
    pub(super) shape: LightShape,
    pub(super) strength: Strength,
    pub(super) texture: Option<ImageId>,
    pub(super) cone: Option<Cone>,
    /// A profile, which contains the cone.
    pub(super) profile: Option<LightProfile>,
}

/// The shape of a light, in its own space. Flat ones emit towards −z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LightShape {
    /// From infinitely far away, with an angular diameter in radians.
    Distant { angle: f64 },
    /// The environment. `turn`: from the picture's space, whose pole is y and whose centre is z, to that of the light.
    Dome { turn: DMat3 },
    /// A rectangle by its width along x and height along y.
    Rect { width: f64, height: f64 },
    /// A disk.
    Disk { radius: f64 },
    /// A sphere.
    Sphere { radius: f64 },
    /// A sphere that shines like a point.
    Point { radius: f64 },
    /// The side of a cylinder along x.
    Cylinder { radius: f64, length: f64 },
}

/// The radiance of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Strength {
    /// `intensity × 2^exposure × color`, times the colour of the temperature.
    pub(super) radiance: DVec3,
    /// `true`: it is divided by the size of the light.
    pub(super) is_normalized: bool,
}

impl Strength {
    /// Returns the radiance of a light of a size: its area in world space, or the projected solid angle of a distant one.
    pub(super) fn of_size(&self, size: f64) -> Vec3 {
        let radiance = if self.is_normalized && size > 0.0 { self.radiance / size } else { self.radiance };
        radiance.min(DVec3::splat(FACTOR_MAX.into())).as_vec3()
    }

    /// Returns the radiance of a mesh that shines.
    pub(super) fn radiance_of_mesh(&self, mesh: &Mesh, world: &DAffine3) -> Vec3 {
        self.of_size(area(mesh, world))
    }

    /// Returns the radiance of a sphere that shines.
    pub(super) fn radiance_of_sphere(&self, radius: f64, world: &DAffine3) -> Vec3 {
        let mesh = Mesh::uv_sphere(Vec3::ZERO, radius as f32, 64);
        self.of_size(area(&mesh, world))
    }
}

/// Returns the area of a mesh in world space.
pub(super) fn area(mesh: &Mesh, world: &DAffine3) -> f64 {
    let area = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| world.transform_point3(mesh.positions[vertex as usize].as_dvec3()));
        0.5 * (b - a).cross(c - a).length()
    };
    mesh.triangles.iter().map(area).sum()
}

/// Reads a light by its type; `None`: it is not a light, or it is left out.
pub(super) fn read(walk: &mut Walk<'_, '_, '_>, visited: &VisitedPrim<'_>, kind: &str) -> Option<LightSpec> {
    let (source, prim, time) = (walk.source, visited.prim, walk.time);
    let path = prim.path().as_str();
    let shape = shape(source, prim, time, kind)?;
    let schemas = source.schemas(prim);
    report_unused(source, prim, time, &schemas);
    let is_flat = matches!(shape, LightShape::Rect { .. } | LightShape::Disk { .. });
    let cone = if schemas.iter().any(|name| name == "ShapingAPI")
        || input(source, prim, "shaping:cone:angle", time).is_some()
    {
        cone(source, prim, time, is_flat)
    } else {
        None
    };
    let takes_cone = !matches!(shape, LightShape::Distant { .. } | LightShape::Dome { .. });
    if cone.is_some() && !takes_cone {
        source.unsupported(path, "the cone of a light at infinity is left out");
    }
    let takes_texture = matches!(shape, LightShape::Dome { .. } | LightShape::Rect { .. });
    let file = source.file(prim, "inputs:texture:file", time).or_else(|| source.file(prim, "texture:file", time));
    let texture = file.filter(|_| takes_texture).map(|file| {
        let stand_in = StandIn::Color([1.0_f32.to_bits(); 3]);
        walk.materials.textures.want(WantedTexture::new(&file, SourceSpace::Auto, stand_in), path)
    });
    let layout = source.text(prim, "inputs:texture:format", time);
    if texture.is_some() && layout.as_deref().is_some_and(|layout| !matches!(layout, "automatic" | "latlong")) {
        source.unsupported(path, "only environment pictures by latitude and longitude are supported");
    }
    // The fallback of the schema: the illuminance of sunlight
    let usual = if kind == "DistantLight" { 50_000.0 } else { 1.0 };
    let strength = strength(source, prim, time, usual);
    let cone = cone.filter(|_| takes_cone);
    if !takes_cone {
        if light_profile::file_of(source, prim, time).is_some() {
            source.unsupported(path, "the profile of a light at infinity is left out");
        }
        return Some(LightSpec { shape, strength, texture, cone, profile: None });
    }
    let profile = light_profile::read(source, &mut walk.materials.textures, prim, time, cone);
    Some(LightSpec { shape, strength, texture, cone: cone.filter(|_| profile.is_none()), profile })
}

/// Returns the strength of a surface that is a light; `None`: it is not a light.
pub(super) fn of_surface(walk: &Walk<'_, '_, '_>, visited: &VisitedPrim<'_>) -> Option<Strength> {
    let (source, prim, time) = (walk.source, visited.prim, walk.time);
    let schemas = source.schemas(prim);
    if !schemas.iter().any(|name| matches!(name.as_str(), "MeshLightAPI" | "LightAPI")) {
        return None;
    }
    report_unused(source, prim, time, &schemas);
    if light_profile::file_of(source, prim, time).is_some() {
        source.unsupported(prim.path().as_str(), "the profile of a surface that is a light is left out");
    }
    let sync = source.text(prim, "light:materialSyncMode", time);
    if sync.as_deref().is_some_and(|mode| mode != "materialGlowTintsLight") {
        source.unsupported(
            prim.path().as_str(),
            "`light:materialSyncMode` is left out: the surface glows as its light shines",
        );
    }
    Some(strength(source, prim, time, 1.0))
}

fn shape(source: &StageSource<'_>, prim: &Prim, time: f64, kind: &str) -> Option<LightShape> {
    let path = prim.path().as_str();
    let number = |name: &str, usual: f64| input(source, prim, name, time).unwrap_or(usual);
    let flag = |name: &str| source.boolean(prim, name, time) == Some(true);
    let shape = match kind {
        "DistantLight" => {
            let angle = number("angle", 0.53);
            if angle > 180.0 {
                source.unsupported(path, "a distant light of more than 180° counts as one of 180°");
            }
            LightShape::Distant { angle: angle.clamp(0.0, 180.0).to_radians() }
        }
        "DomeLight" | "DomeLight_1" => LightShape::Dome { turn: dome_turn(source, prim, time, kind) },
        "RectLight" => LightShape::Rect { width: number("width", 1.0), height: number("height", 1.0) },
        "DiskLight" => LightShape::Disk { radius: number("radius", 0.5) },
        "SphereLight" if flag("treatAsPoint") => LightShape::Point { radius: number("radius", 0.5) },
        "SphereLight" => LightShape::Sphere { radius: number("radius", 0.5) },
        "CylinderLight" => {
            if flag("treatAsLine") {
                source.warn(path, "a cylinder that may be treated as a line keeps its radius");
            }
            LightShape::Cylinder { radius: number("radius", 0.5), length: number("length", 1.0) }
        }
        "GeometryLight" | "PortalLight" | "PluginLight" => {
            source.unsupported(path, format!("a `{kind}` is not supported and is left out"));
            return None;
        }
        _ => return None,
    };
    let sizes = match shape {
        LightShape::Rect { width, height } => [width, height],
        LightShape::Disk { radius } | LightShape::Sphere { radius } => [radius; 2],
        LightShape::Cylinder { radius, length } => [radius, length],
        _ => [1.0; 2],
    };
    if sizes.iter().any(|&size| !(size > 0.0 && size <= f64::from(f32::MAX))) {
        source.warn(path, format!("a light of the size {sizes:?} is left out"));
        return None;
    }
    Some(shape)
}

/// Returns the rotation that puts the pole of a dome's picture where its schema says.
fn dome_turn(source: &StageSource<'_>, prim: &Prim, time: f64, kind: &str) -> DMat3 {
    if kind == "DomeLight" {
        return DMat3::IDENTITY;
    }
    let is_z = match source.text(prim, "poleAxis", time).as_deref() {
        Some("Y") => false,
        Some("Z") => true,
        _ => {
            let up = source.or_warn("upAxis", source.stage.stage_metadata("upAxis"));
            up.and_then(|up| super::values::text(&up)).as_deref() == Some("Z")
        }
    };
    if is_z { DMat3::from_rotation_x(0.5 * PI) } else { DMat3::IDENTITY }
}

/// Returns `intensity × 2^exposure × color`, with the colour of the temperature (UsdLuxLightAPI).
fn strength(source: &StageSource<'_>, prim: &Prim, time: f64, usual: f64) -> Strength {
    let number = |name: &str, usual: f64| input(source, prim, name, time).unwrap_or(usual);
    let intensity = number("intensity", usual);
    let exposure = number("exposure", 0.0);
    let color = source.vector(prim, "inputs:color", time).or_else(|| source.vector(prim, "color", time));
    let mut radiance = color.unwrap_or(DVec3::ONE) * intensity * exposure.exp2();
    if number("enableColorTemperature", 0.0) != 0.0 {
        radiance *= temperature_color(number("colorTemperature", 6500.0));
    }
    if !radiance.is_finite() || radiance.min_element() < 0.0 {
        source.unsupported(
            prim.path().as_str(),
            format!("a light of the radiance {radiance} counts as black where it is negative"),
        );
        radiance = if radiance.is_finite() { radiance.max(DVec3::ZERO) } else { DVec3::ZERO };
    }
    Strength { radiance, is_normalized: number("normalize", 0.0) != 0.0 }
}

/// Returns the colour of a black body with luminance 1, as UsdLuxBlackbodyTemperatureAsRgb does.
fn temperature_color(kelvin: f64) -> DVec3 {
    SampledSpectrum::blackbody(kelvin.clamp(1000.0, 10_000.0)).pbrt_illuminant().as_dvec3()
}

/// Warns about inputs that are left out.
fn report_unused(source: &StageSource<'_>, prim: &Prim, time: f64, schemas: &[String]) {
    let path = prim.path().as_str();
    for (name, usual) in [("diffuse", 1.0), ("specular", 1.0), ("shaping:focus", 0.0)] {
        if input(source, prim, name, time).is_some_and(|value| value != usual) {
            source.unsupported(path, format!("`inputs:{name}` is left out"));
        }
    }
    if schemas.iter().any(|name| name == "ShadowAPI")
        && source.boolean(prim, "inputs:shadow:enable", time) == Some(false)
    {
        source.unsupported(path, "the light still casts shadows");
    }
    if !source.targets(prim, "light:filters").is_empty() {
        source.unsupported(path, "filters of lights are left out");
    }
    for name in ["collection:lightLink", "collection:shadowLink"] {
        let is_partial = source.boolean(prim, &format!("{name}:includeRoot"), time) == Some(false)
            || !source.targets(prim, &format!("{name}:includes")).is_empty()
            || !source.targets(prim, &format!("{name}:excludes")).is_empty();
        if is_partial {
            source.unsupported(path, format!("`{}` is left out: the light shines on all surfaces", shortened(name)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normalized_light_has_its_power_whatever_its_size() {
        let strength = Strength { radiance: DVec3::splat(6.0), is_normalized: true };
        assert_eq!(strength.of_size(3.0), Vec3::splat(2.0));
        assert_eq!(Strength { is_normalized: false, ..strength }.of_size(3.0), Vec3::splat(6.0));
        let cube = Mesh::cuboid(Vec3::ZERO, Vec3::ONE);
        let stretched = DAffine3::from_scale(DVec3::new(2.0, 1.0, 1.0));
        assert!((area(&cube, &stretched) - 10.0).abs() < 1e-12);
    }

    /// Expected values: UsdLux.BlackbodyTemperatureAsRgb of usd-core 26.11.
    #[test]
    fn temperatures_have_their_colours() {
        const TEMPERATURES: [(f64, [f64; 3]); 5] = [
            (2000.0, [2.5206, 0.6469, 0.0204]),
            (3000.0, [1.7710, 0.8443, 0.2720]),
            (4500.0, [1.3009, 0.9456, 0.6526]),
            (6500.0, [1.0433, 0.9836, 1.0346]),
            (9000.0, [0.9043, 0.9939, 1.3423]),
        ];
        for (kelvin, expected) in TEMPERATURES {
            let found = temperature_color(kelvin);
            assert!((found - DVec3::from_array(expected)).abs().max_element() < 0.05, "{kelvin} {found}");
        }
    }
}
