//! Cameras (glTF 2.0, section 3.10) and KHR_lights_punctual.

use std::collections::BTreeSet;
use std::f32::consts::{FRAC_PI_2, PI};

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::accessor::find;
use super::document;
use super::error::GltfError;
use super::hierarchy::Hierarchy;
use super::source::GltfSource;
use crate::camera::{Camera, Clip, Projection};
use crate::error::{SceneError, Warnings};
use crate::light::{Light, LightKind, SpotFalloff};
use crate::model::Scene;

/// Adds the cameras of the scene, in the order of its nodes.
pub(super) fn add_cameras(
    source: &GltfSource<'_>,
    hierarchy: &Hierarchy,
    scene: &mut Scene,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let mut taken: BTreeSet<&str> = BTreeSet::new();
    for &index in &hierarchy.nodes {
        let node = &source.document.nodes[index];
        let (Some(camera), Some(world)) = (node.camera, hierarchy.world_from_node[index]) else { continue };
        let description = find("camera", &source.document.cameras, camera);
        let description = description.map_err(|problem| source.invalid(format!("nodes[{index}].camera"), problem))?;
        let place = || format!("cameras[{camera}]");
        let (projection, aspect) = projection(description).map_err(|problem| source.invalid(place(), problem))?;
        let Some(world_from_camera) = without_scale(&world) else {
            warnings.add(format!("nodes[{index}]"), "its transformation is singular; its camera is left out");
            continue;
        };
        let clip = clip(description).unwrap_or_else(|problem| {
            warnings.add(place(), format!("{problem}; they are left out"));
            Clip::NONE
        });
        // Use the camera's name if it is unique, otherwise the node's.
        let is_own = !description.name.is_empty() && taken.insert(&description.name);
        let name = if is_own { &description.name } else { &node.name };
        scene.cameras.push(Camera {
            name: name.clone(),
            world_from_camera: world_from_camera.as_affine3a(),
            projection,
            aspect,
            clip,
            ..Camera::default()
        });
    }
    Ok(())
}

fn projection(camera: &document::Camera) -> Result<(Projection, Option<f32>), GltfError> {
    match (camera.kind.as_str(), &camera.perspective, &camera.orthographic) {
        ("perspective", Some(perspective), _) => {
            if !(perspective.yfov > 0.0 && perspective.yfov < PI) {
                return Err(GltfError::FieldOfView(perspective.yfov));
            }
            let aspect = perspective.aspect_ratio.filter(|aspect| aspect.is_finite() && *aspect > 0.0);
            Ok((Projection::Perspective { vertical_fov: perspective.yfov }, aspect))
        }
        ("orthographic", _, Some(orthographic)) => {
            // Some exporters write negative magnifications.
            let (width, height) = (2.0 * orthographic.xmag.abs(), 2.0 * orthographic.ymag.abs());
            if !(width > 0.0 && height > 0.0 && width.is_finite() && height.is_finite()) {
                return Err(GltfError::Window { width, height });
            }
            Ok((Projection::Orthographic { height }, Some(width / height)))
        }
        (kind, ..) => Err(GltfError::CameraType(kind.into())),
    }
}

/// Returns the clip planes; without a far plane it is infinite.
fn clip(camera: &document::Camera) -> Result<Clip, GltfError> {
    let planes = match camera.kind.as_str() {
        "orthographic" => camera.orthographic.as_ref().map(|it| (it.znear, it.zfar)),
        _ => camera.perspective.as_ref().map(|it| (it.znear, it.zfar)),
    };
    let (near, far) = planes.unwrap_or_default();
    Ok(Clip::new(near.unwrap_or(0.0).into(), far.unwrap_or(f32::INFINITY).into())?)
}

/// Returns the rotation and translation of a transformation that keep its −z and, as far as possible, its +y. `None`:
/// it has no direction.
fn without_scale(m: &DAffine3) -> Option<DAffine3> {
    let z = m.matrix3.z_axis.try_normalize()?;
    let x = m.matrix3.y_axis.cross(z).try_normalize()?;
    let rigid = DAffine3 { matrix3: DMat3::from_cols(x, z.cross(x), z), translation: m.translation };
    (rigid.is_finite() && rigid.as_affine3a().is_finite()).then_some(rigid)
}

/// Adds the lights of the scene, in the order of its nodes.
pub(super) fn add_lights(
    source: &GltfSource<'_>,
    hierarchy: &Hierarchy,
    scene: &mut Scene,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let lights = source.document.extensions.lights.as_ref().map_or(&[][..], |lights| &lights.lights);
    for index in hierarchy.visible() {
        let node = &source.document.nodes[index];
        let light = node.extensions.as_ref().and_then(|extensions| extensions.light.as_ref());
        let (Some(light), Some(world)) = (light, hierarchy.world_from_node[index]) else { continue };
        let description = find("light", lights, light.light).map_err(|problem| {
            source.invalid(format!("nodes[{index}].extensions.KHR_lights_punctual.light"), problem)
        })?;
        let place = format!("extensions.KHR_lights_punctual.lights[{}]", light.light);
        if description.range.is_some_and(f32::is_finite) && description.kind != "directional" {
            warnings
                .unsupported(format!("{place}.range"), "light does not end at a distance; the range is not followed");
        }
        match kind(description, &world) {
            Ok(kind) => {
                let name = if description.name.is_empty() { &node.name } else { &description.name };
                scene.lights.push(Light::new(name.clone(), kind));
            }
            Err(problem) => warnings.unsupported(place, format!("{problem}; it is left out")),
        }
    }
    Ok(())
}

fn kind(light: &document::Light, world: &DAffine3) -> Result<LightKind, GltfError> {
    let intensity = light.intensity.unwrap_or(1.0);
    let power = Vec3::from_array(light.color.unwrap_or([1.0; 3])) * intensity;
    if !power.is_finite() || power.min_element() < 0.0 {
        return Err(GltfError::LightColor(power));
    }
    let position = world.translation.as_vec3();
    let direction = (-world.matrix3.z_axis).try_normalize().map(DVec3::as_vec3);
    if !position.is_finite() {
        return Err(GltfError::LightPosition);
    }
    let direction = || direction.ok_or(GltfError::LightDirection);
    match light.kind.as_str() {
        "point" => Ok(LightKind::Point { position, intensity: power }),
        "directional" => Ok(LightKind::Directional { direction: direction()?, irradiance: power, angle: 0.0 }),
        "spot" => {
            let (inner, outer) = (light.spot.inner_cone_angle, light.spot.outer_cone_angle.unwrap_or(PI / 4.0));
            if !(inner >= 0.0 && inner <= outer && outer > 0.0 && outer <= FRAC_PI_2 + 1e-4) {
                return Err(GltfError::ConeAngles { inner, outer });
            }
            let cos = |angle: f32| f64::from(angle).cos() as f32;
            let cos_outer = cos(outer).max(0.0);
            // Separate the angles by the margin of the specification.
            let cos_inner = cos(inner).max(cos_outer + 1e-3).min(1.0);
            let cos_outer = cos_outer.min(cos_inner - 1e-3);
            Ok(LightKind::Spot {
                position,
                direction: direction()?,
                intensity: power,
                cos_inner,
                cos_outer,
                falloff: SpotFalloff::SquaredCosine,
            })
        }
        other => Err(GltfError::LightType(other.into())),
    }
}
