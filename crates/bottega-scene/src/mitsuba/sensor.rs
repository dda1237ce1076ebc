//! Cameras and render hints: film, sampler, filter.

use glam::{DAffine3, DMat4, Vec2};

use super::context::ImportContext;
use super::document::{Class, Object, ObjectId};
use super::fov::{fov, fov_axis, vertical_fov};
use super::looks::SceneLooks;
use super::orientation::{looking, standing};
use crate::camera::{Camera, Clip, FovAxis, Projection};
use crate::hints::{FilmFilter, RenderHints};
use crate::import::text_place::{ImportError, ImportResult};
use crate::motion::{Shutter, TransformKey};
use crate::text::shortened;

/// Default columns and rows of a film.
const FILM: [u32; 2] = [768, 576];

/// Returns the camera of a sensor, and when it is open. The first film and sampler give the render hints.
pub(super) fn read_sensor(
    context: &mut ImportContext<'_>,
    looks: &mut SceneLooks<'_>,
    hints: &mut RenderHints,
    id: ObjectId,
) -> ImportResult<(Camera, Shutter)> {
    let object = context.visit(id)?;
    let mut film = None;
    let mut medium = None;
    for child in &object.children {
        match context.document.get(child.object).class {
            Class::Film => film = Some(child.object),
            Class::Sampler => read_sampler(context, hints, child.object)?,
            Class::Medium => medium = Some(looks.media.medium(context, &mut looks.textures, child.object)?),
            _ => continue,
        }
        child.used.set(true);
    }
    let resolution = match film {
        Some(film) => read_film(context, hints, film)?,
        None => FILM,
    };
    let aspect = f64::from(resolution[0]) / f64::from(resolution[1]);
    let to_world = context.to_world(object)?;
    let Some((rotation, position, is_pure)) = standing(&to_world) else {
        return Err(object.at.fault("the transformation of the sensor is singular").into());
    };
    let is_orthographic = object.plugin == "orthographic";
    if !is_pure && !is_orthographic {
        context.warn(object.at, "the scale of the sensor is left out");
    }
    let mut camera = Camera {
        name: object.label(),
        world_from_camera: looking(&rotation, position),
        aspect: Some(aspect as f32),
        medium,
        ..Camera::default()
    };
    match object.plugin.as_str() {
        "perspective" | "perspective_rdist" | "thinlens" => {
            perspective(context, object, &mut camera, aspect)?;
            clip(object, &mut camera, 1.0)?;
        }
        "orthographic" => {
            // The view is [−1, 1] wide; the scales of its transformation scale that, and stretch pixels.
            let (x, y) = (to_world.x_axis.truncate().length(), to_world.y_axis.truncate().length());
            camera.projection = Projection::Orthographic { height: (2.0 * y / aspect) as f32 };
            camera.pixel_aspect = (x / y) as f32;
            camera.fov_axis = FovAxis::X;
            clip(object, &mut camera, to_world.z_axis.truncate().length())?;
        }
        _ => {
            clip(object, &mut camera, 1.0)?;
            let message = format!("the {} is not supported; `perspective` replaces it", object.describe());
            context.warn(object.at, message);
            object.accept_all();
        }
    }
    let is_sound = match camera.projection {
        Projection::Perspective { vertical_fov } => vertical_fov > 0.0,
        Projection::Orthographic { height } => height.is_finite() && height > 0.0,
        Projection::Fisheye { .. } | Projection::Panorama(_) => true,
    };
    if !is_sound {
        return Err(object.at.fault("the sensor sees nothing").into());
    }
    if let Some(path) = object.animation("to_world") {
        let path = path.then(&DAffine3::from_translation(-context.origin));
        let pose = |(time, to_world): &(f64, DAffine3)| {
            let (rotation, position, _) = standing(&DMat4::from(*to_world))?;
            Some(TransformKey { time: *time, transform: looking(&rotation, position) })
        };
        let keys = path.keys().iter().map(pose).collect::<Option<Vec<_>>>();
        camera.motion = keys.ok_or_else(|| object.at.fault("a transformation of the sensor is singular"))?;
    }
    let open = object.float("shutter_open")?.unwrap_or(0.0);
    let close = object.float("shutter_close")?.unwrap_or(open);
    let shutter = Shutter::new(open, close).ok_or_else(|| object.at.fault("the shutter closes before it opens"))?;
    Ok((camera, shutter))
}

/// Reads the clip planes of a projective sensor.
///
/// - `scale`: length of its viewing axis, which scales the near distance; the far plane keeps its unscaled distance
///   from the near one.
fn clip(object: &Object, camera: &mut Camera, scale: f64) -> ImportResult<()> {
    let near = object.float("near_clip")?.unwrap_or(1e-2);
    let far = object.float("far_clip")?.unwrap_or(1e4);
    if near <= 0.0 {
        return Err(object.at.fault(format!("a near clip plane in the distance {near} cannot be")).into());
    }
    camera.clip = Clip::new(near * scale, near * scale + (far - near)).map_err(|problem| object.at.fault(problem))?;
    Ok(())
}

fn perspective(context: &mut ImportContext<'_>, object: &Object, camera: &mut Camera, aspect: f64) -> ImportResult<()> {
    let axis = fov_axis(context, object)?;
    let fov = fov(object)?;
    camera.fov_axis = axis;
    camera.projection = Projection::Perspective { vertical_fov: vertical_fov(fov, axis, aspect) as f32 };
    let offset_x = object.float("principal_point_offset_x")?.unwrap_or(0.0);
    let offset_y = object.float("principal_point_offset_y")?.unwrap_or(0.0);
    // In widths to the left, and in heights up.
    camera.lens_shift = Vec2::new(-2.0 * offset_x as f32, 2.0 * offset_y as f32);
    if object.plugin == "thinlens" {
        camera.lens_radius = object.float_at_least("aperture_radius", 0.0, 0.0)? as f32;
        camera.focus_distance = object.float_at_least("focus_distance", 1e-6, 1e4)? as f32;
    } else {
        if object.plugin == "perspective_rdist" {
            object.property("kc");
            context.warn(object.at, "the distortion of the lens is left out");
        }
    }
    Ok(())
}

fn read_sampler(context: &mut ImportContext<'_>, hints: &mut RenderHints, id: ObjectId) -> ImportResult<()> {
    let object = context.visit(id)?;
    if let Some(count) = object.integer("sample_count")?
        && hints.samples.is_none()
    {
        hints.samples = Some(u32::try_from(count).unwrap_or(u32::MAX).clamp(1, 1 << 24));
    }
    Ok(())
}

/// Reads a film. Returns columns and rows.
fn read_film(context: &mut ImportContext<'_>, hints: &mut RenderHints, id: ObjectId) -> ImportResult<[u32; 2]> {
    let object = context.visit(id)?;
    let format = object.string("pixel_format")?.unwrap_or_default().to_ascii_lowercase();
    let has_alpha = matches!(&*format, "rgba" | "luminance_alpha" | "luminancealpha" | "xyza");
    if !matches!(&*format, "" | "rgb" | "rgba") {
        let message = format!("the pixels are RGB, and not `{}` as `pixel_format` says", shortened(&format));
        context.warn(object.at, message);
    }
    // In Mitsuba 0.x, −1 is sRGB.
    if object.plugin != "specfilm" && object.float("gamma")?.is_some_and(|gamma| gamma != -1.0) {
        context.warn(object.at, "`gamma` of the film is left out: a PNG is sRGB");
    }
    let side = |name: &str, default: u32| {
        let value = object.integer(name)?.unwrap_or(i64::from(default));
        match u32::try_from(value) {
            Ok(value) if (1..=1 << 20).contains(&value) => Ok(value),
            _ => Err(object.at.fault(format!("a film cannot have {value} pixels as its {name}"))),
        }
    };
    let resolution = [side("width", FILM[0])?, side("height", FILM[1])?];
    let crop_names = ["crop_offset_x", "crop_offset_y", "crop_width", "crop_height"];
    let mut crop = [0, 0, resolution[0], resolution[1]].map(i64::from);
    for (slot, name) in crop_names.iter().enumerate() {
        if let Some(value) = object.integer(name)? {
            crop[slot] = value;
        }
    }
    let fits = |axis: usize| {
        crop[axis] >= 0
            && crop[axis + 2] >= 1
            && crop[axis].saturating_add(crop[axis + 2]) <= i64::from(resolution[axis])
    };
    if !(fits(0) && fits(1)) {
        return Err(object.at.fault("the crop window lies outside of the film").into());
    }
    let crop = crop.map(|value| value as u32);
    let mut filter = FilmFilter::Gaussian { radius: 2.0, sigma: 0.5 };
    for child in object.children.iter().filter(|child| context.document.get(child.object).class == Class::Filter) {
        child.used.set(true);
        filter = read_filter(context, child.object)?;
    }
    if hints.resolution.is_none() {
        hints.resolution = Some(resolution);
        hints.crop = (crop != [0, 0, resolution[0], resolution[1]]).then_some(crop);
        hints.filter = Some(filter);
        hints.alpha = has_alpha;
    }
    Ok(resolution)
}

fn read_filter(context: &mut ImportContext<'_>, id: ObjectId) -> ImportResult<FilmFilter> {
    let object = context.visit(id)?;
    let size = |name: &str, default: f64| Ok::<_, ImportError>(object.float_at_least(name, 0.01, default)? as f32);
    Ok(match object.plugin.as_str() {
        "box" => FilmFilter::Box { radius: size("radius", 0.5)? },
        "tent" => FilmFilter::Tent { radius: size("radius", 1.0)? },
        "gaussian" => {
            let sigma = size("stddev", 0.5)?;
            FilmFilter::Gaussian { radius: 4.0 * sigma, sigma }
        }
        "mitchell" => {
            let (b, c) = (mitchell_parameter(context, object, "b")?, mitchell_parameter(context, object, "c")?);
            FilmFilter::Mitchell { radius: 2.0, b, c }
        }
        "catmullrom" => FilmFilter::Mitchell { radius: 2.0, b: 0.0, c: 0.5 },
        _ => {
            let message = format!("the {} is not supported; `catmullrom` replaces it", object.describe());
            context.warn(object.at, message);
            object.accept_all();
            FilmFilter::Mitchell { radius: 2.0, b: 0.0, c: 0.5 }
        }
    })
}

/// Reads Mitchell and Netravali's parameter B or C.
fn mitchell_parameter(context: &mut ImportContext<'_>, object: &Object, name: &str) -> ImportResult<f32> {
    let given = object.float(name)?.unwrap_or(1.0 / 3.0);
    let number = given.clamp(0.0, 1.0);
    if number != given {
        context.warn(object.at, format!("`{name}` of a filter is from 0 to 1: {number} replaces {given}"));
    }
    Ok(number as f32)
}
