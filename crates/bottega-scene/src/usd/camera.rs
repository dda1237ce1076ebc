//! Cameras, and the render settings that name one.

use glam::Vec2;
use openusd::sdf::Path;
use openusd::usd::Prim;

use super::context::{VisitedPrim, Walk};
use super::placement::rigid;
use super::source::StageSource;
use super::values;
use crate::camera::{Camera, Clip, FovAxis, Projection};
use crate::model::Scene;

/// Apertures and focal lengths are given in tenths of a scene unit.
const TENTH: f64 = 0.1;

/// Adds a camera to the scene.
pub(super) fn add(walk: &mut Walk<'_, '_, '_>, visited: &VisitedPrim<'_>) {
    let (source, prim, time) = (walk.source, visited.prim, walk.time);
    let path = prim.path().as_str();
    let number = |name: &str, usual: f64| source.number(prim, name, time).unwrap_or(usual);
    let Some(world_from_camera) = rigid(&visited.world_from_prim) else {
        source.warn(path, "its transformation is singular; the camera is left out");
        return;
    };
    let (width, height) = (number("horizontalAperture", 20.955), number("verticalAperture", 15.2908));
    let focal_length = number("focalLength", 50.0);
    let is_orthographic = source.text(prim, "projection", time).as_deref() == Some("orthographic");
    if !(width > 0.0 && height > 0.0 && (focal_length > 0.0 || is_orthographic)) {
        source.warn(path, "a camera without aperture or focal length is left out");
        return;
    }
    let projection = if is_orthographic {
        Projection::Orthographic { height: (TENTH * height) as f32 }
    } else {
        Projection::Perspective { vertical_fov: (2.0 * (0.5 * height / focal_length).atan()) as f32 }
    };
    let offset = |name: &str, extent: f64| -2.0 * number(name, 0.0) / extent;
    let lens_shift =
        Vec2::new(offset("horizontalApertureOffset", width) as f32, offset("verticalApertureOffset", height) as f32);
    let (f_stop, focus) = (number("fStop", 0.0), number("focusDistance", 0.0));
    let has_lens = f_stop > 0.0 && focus > 0.0 && !is_orthographic;
    if f_stop > 0.0 && !has_lens {
        source.warn(path, "a lens without a distance of focus is left out: all is sharp");
    }
    for name in ["exposure", "exposure:time", "exposure:iso", "exposure:fStop", "exposure:responsivity"] {
        let usual = if name == "exposure" { 0.0 } else { 1.0 };
        if source.number(prim, name, time).is_some_and(|value| value != usual && value != 0.0) {
            source.unsupported_once(path, "the exposure of cameras is left out; set `--exposure`");
        }
    }
    if number("shutter:open", 0.0) != number("shutter:close", 0.0) {
        source.unsupported_once(path, "the shutter of cameras is left out; set `--shutter`");
    }
    if source.value(prim, "clippingPlanes", time).is_some() {
        source.unsupported(path, "`clippingPlanes` are left out");
    }
    walk.scene.cameras.push(Camera {
        name: prim.path().name().unwrap_or_default().to_owned(),
        world_from_camera,
        projection,
        aspect: Some((width / height) as f32),
        fov_axis: FovAxis::X,
        lens_radius: if has_lens { (0.5 * TENTH * focal_length / f_stop) as f32 } else { 0.0 },
        focus_distance: if focus > 0.0 { focus as f32 } else { 1.0 },
        lens_shift,
        clip: clip(source, prim, time),
        ..Camera::default()
    });
}

/// Returns the clip planes, if the file has some. (The schema's fallback of 1 for the near plane hides what is close in a
/// scene in metres.)
fn clip(source: &StageSource<'_>, prim: &Prim, time: f64) -> Clip {
    let Some([near, far]) = source.read(prim, "clippingRange", time, values::pair) else { return Clip::NONE };
    Clip::new(near.max(0.0), far).unwrap_or_else(|problem| {
        source.warn(prim.path().as_str(), format!("{problem}; they are left out"));
        Clip::NONE
    })
}

/// The render settings of a stage.
#[derive(Default)]
pub(super) struct RenderSettings {
    /// Columns and rows of the picture.
    pub(super) resolution: Option<[u32; 2]>,
    camera: Option<Path>,
}

impl RenderSettings {
    /// Reads the settings that the stage names, or those below `/Render` if there is one.
    pub(super) fn find(source: &StageSource<'_>, time: f64) -> Self {
        let named = source.or_warn("renderSettingsPrimPath", source.stage.stage_metadata("renderSettingsPrimPath"));
        let named = named.and_then(|path| values::text(&path)).filter(|path| path.starts_with('/'));
        let prim = named.map(|path| source.stage.prim(path.as_str())).or_else(|| {
            let scope = source.stage.prim("/Render");
            let children = scope.children().unwrap_or_default();
            children.into_iter().find(|child| source.type_of(child) == "RenderSettings")
        });
        let Some(prim) = prim else { return Self::default() };
        let size = source.read(&prim, "resolution", time, values::pair);
        let is_size = |side: f64| (1.0..=65_536.0).contains(&side);
        let resolution =
            size.filter(|size| size.iter().all(|&side| is_size(side))).map(|size| size.map(|side| side as u32));
        Self { resolution, camera: source.targets(&prim, "camera").into_iter().next() }
    }

    /// Makes the camera of the settings the first one of the scene.
    pub(super) fn put_camera_first(&self, source: &StageSource<'_>, scene: &mut Scene) {
        let Some(path) = &self.camera else { return };
        let name = path.name().unwrap_or_default();
        match scene.cameras.iter().position(|camera| camera.name == name) {
            Some(index) => scene.cameras[..=index].rotate_right(1),
            None => source.warn(path.as_str(), "the camera of the render settings does not exist"),
        }
    }
}
