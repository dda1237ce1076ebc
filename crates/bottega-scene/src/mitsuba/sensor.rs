//! Cameras and render hints: film, sampler, integrator.

use glam::{Affine3A, DMat3, DMat4, DVec3, Vec2};

use super::document::{Class, Object, ObjectId};
use super::importer::Importer;
use super::value::{Value, number};
use crate::hints::FilmFilter;
use crate::text::shortened;
use crate::{Camera, Clip, FovAxis, Projection, SceneError};

/// Default columns and rows of a film.
const FILM: [u32; 2] = [768, 576];

impl Importer<'_> {
    /// Adds a camera. The first one gives the render hints.
    pub(super) fn add_sensor(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let object = self.visit(id)?;
        let mut film = None;
        let mut medium = None;
        for child in &object.children {
            match self.document.get(child.object).class {
                Class::Film => film = Some(child.object),
                Class::Sampler => self.read_sampler(child.object)?,
                Class::Medium => medium = self.medium(child.object)?,
                _ => continue,
            }
            child.used.set(true);
        }
        let resolution = match film {
            Some(film) => self.read_film(film)?,
            None => FILM,
        };
        let aspect = f64::from(resolution[0]) / f64::from(resolution[1]);
        let to_world = self.to_world(object)?;
        let Some((rotation, position, is_pure)) = standing(&to_world) else {
            return Err(self.report.invalid(object.at, "the transformation of the sensor is singular"));
        };
        let is_orthographic = object.plugin == "orthographic";
        if !is_pure && !is_orthographic {
            self.report.warn(object.at, "the scale of the sensor is left out");
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
                self.perspective(object, &mut camera, aspect)?;
                self.clip(object, &mut camera, 1.0)?;
            }
            "orthographic" => {
                // The view is [−1, 1] wide; the scales of its transformation scale that, and stretch pixels.
                let (x, y) = (to_world.x_axis.truncate().length(), to_world.y_axis.truncate().length());
                camera.projection = Projection::Orthographic { height: (2.0 * y / aspect) as f32 };
                camera.pixel_aspect = (x / y) as f32;
                camera.fov_axis = FovAxis::X;
                self.clip(object, &mut camera, to_world.z_axis.truncate().length())?;
            }
            _ => {
                self.clip(object, &mut camera, 1.0)?;
                let message = format!("the {} is not supported; `perspective` stands for it", object.describe());
                self.report.warn(object.at, message);
                self.accept_all(object);
            }
        }
        let is_sound = match camera.projection {
            Projection::Perspective { vertical_fov } => vertical_fov > 0.0,
            Projection::Orthographic { height } => height.is_finite() && height > 0.0,
            Projection::Panorama(_) => true,
        };
        if !is_sound {
            return Err(self.report.invalid(object.at, "the sensor sees nothing"));
        }
        self.scene.cameras.push(camera);
        Ok(())
    }

    /// Reads the clip planes of a projective sensor.
    ///
    /// - `scale`: length of its viewing axis, which scales the near distance; the far plane keeps its unscaled distance
    ///   from the near one.
    fn clip(&mut self, object: &Object, camera: &mut Camera, scale: f64) -> Result<(), SceneError> {
        let near = self.bad(object.float("near_clip"))?.unwrap_or(1e-2);
        let far = self.bad(object.float("far_clip"))?.unwrap_or(1e4);
        if near <= 0.0 {
            return Err(self.report.invalid(object.at, format!("a near clip plane in the distance {near} cannot be")));
        }
        camera.clip =
            self.bad(Clip::new(near * scale, near * scale + (far - near)).map_err(|problem| (object.at, problem)))?;
        Ok(())
    }

    fn perspective(&mut self, object: &Object, camera: &mut Camera, aspect: f64) -> Result<(), SceneError> {
        let axis = fov_axis(self, object)?;
        let fov = self.fov(object)?;
        camera.fov_axis = axis;
        camera.projection = Projection::Perspective { vertical_fov: vertical_fov(fov, axis, aspect) as f32 };
        let offset_x = self.bad(object.float("principal_point_offset_x"))?.unwrap_or(0.0);
        let offset_y = self.bad(object.float("principal_point_offset_y"))?.unwrap_or(0.0);
        // In widths to the left, and in heights up.
        camera.lens_shift = Vec2::new(-2.0 * offset_x as f32, 2.0 * offset_y as f32);
        if object.plugin == "thinlens" {
            camera.lens_radius = self.number_at_least(object, "aperture_radius", 0.0, 0.0)? as f32;
            camera.focus_distance = self.number_at_least(object, "focus_distance", 1e-6, 1e4)? as f32;
        } else {
            if object.plugin == "perspective_rdist" {
                object.property("kc");
                self.report.warn(object.at, "the distortion of the lens is left out");
            }
        }
        Ok(())
    }

    /// Returns the field of view in radians, along the axis of [`fov_axis`]; a focal length gives the diagonal.
    pub(super) fn fov(&mut self, object: &Object) -> Result<f64, SceneError> {
        if let Some(fov) = self.bad(object.float("fov"))? {
            if !(fov > 0.0 && fov < 180.0) {
                return Err(self.report.invalid(object.at, format!("a field of view of {fov}° shows nothing")));
            }
            return Ok(fov.to_radians());
        }
        let millimetres = match object.property("focal_length") {
            None => 50.0,
            Some(property) => match &property.value {
                Value::String(text) => number(text.trim().trim_end_matches("mm"))
                    .map_err(|problem| self.report.invalid(property.at, problem))?,
                Value::Float(length) => *length,
                Value::Integer(length) => *length as f64,
                _ => return self.bad(Err(property.wrong("a focal length"))),
            },
        };
        if millimetres <= 0.0 {
            return Err(self.report.invalid(object.at, "the focal length is not above 0"));
        }
        // On film of 36 mm × 24 mm.
        Ok(2.0 * (0.5 * f64::hypot(36.0, 24.0) / millimetres).atan())
    }

    fn read_sampler(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let object = self.visit(id)?;
        if let Some(count) = self.bad(object.integer("sample_count"))?
            && self.hints.samples.is_none()
        {
            self.hints.samples = Some(u32::try_from(count).unwrap_or(u32::MAX).clamp(1, 1 << 24));
        }
        Ok(())
    }

    /// Reads a film. Returns columns and rows.
    fn read_film(&mut self, id: ObjectId) -> Result<[u32; 2], SceneError> {
        let object = self.visit(id)?;
        let format = self.bad(object.string("pixel_format"))?.unwrap_or_default().to_ascii_lowercase();
        let has_alpha = matches!(&*format, "rgba" | "luminance_alpha" | "luminancealpha" | "xyza");
        if !matches!(&*format, "" | "rgb" | "rgba") {
            let message = format!("the pixels are RGB, and not `{}` as `pixel_format` says", shortened(&format));
            self.report.warn(object.at, message);
        }
        // In Mitsuba 0.x, −1 is sRGB.
        if object.plugin != "specfilm" && self.bad(object.float("gamma"))?.is_some_and(|gamma| gamma != -1.0) {
            self.report.warn(object.at, "`gamma` of the film is left out: a PNG is sRGB");
        }
        let side = |name: &str, default: u32| {
            let value = self.bad(object.integer(name))?.unwrap_or(i64::from(default));
            match u32::try_from(value) {
                Ok(value) if (1..=1 << 20).contains(&value) => Ok(value),
                _ => Err(self.report.invalid(object.at, format!("a film cannot have {value} pixels as its {name}"))),
            }
        };
        let resolution = [side("width", FILM[0])?, side("height", FILM[1])?];
        let crop_names = ["crop_offset_x", "crop_offset_y", "crop_width", "crop_height"];
        let mut crop = [0, 0, resolution[0], resolution[1]].map(i64::from);
        for (slot, name) in crop_names.iter().enumerate() {
            if let Some(value) = self.bad(object.integer(name))? {
                crop[slot] = value;
            }
        }
        let fits = |axis: usize| {
            crop[axis] >= 0
                && crop[axis + 2] >= 1
                && crop[axis].saturating_add(crop[axis + 2]) <= i64::from(resolution[axis])
        };
        if !(fits(0) && fits(1)) {
            return Err(self.report.invalid(object.at, "the crop window lies outside of the film"));
        }
        let crop = crop.map(|value| value as u32);
        let mut filter = FilmFilter::Gaussian { radius: 2.0, sigma: 0.5 };
        for child in object.children.iter().filter(|child| self.document.get(child.object).class == Class::Filter) {
            child.used.set(true);
            filter = self.read_filter(child.object)?;
        }
        if self.hints.resolution.is_none() {
            self.hints.resolution = Some(resolution);
            self.hints.crop = (crop != [0, 0, resolution[0], resolution[1]]).then_some(crop);
            self.hints.filter = Some(filter);
            self.hints.alpha = has_alpha;
        }
        Ok(resolution)
    }

    fn read_filter(&mut self, id: ObjectId) -> Result<FilmFilter, SceneError> {
        let object = self.visit(id)?;
        let size =
            |name: &str, default: f64| Ok::<_, SceneError>(self.number_at_least(object, name, 0.01, default)? as f32);
        Ok(match object.plugin.as_str() {
            "box" => FilmFilter::Box { radius: size("radius", 0.5)? },
            "tent" => FilmFilter::Tent { radius: size("radius", 1.0)? },
            "gaussian" => {
                let sigma = size("stddev", 0.5)?;
                FilmFilter::Gaussian { radius: 4.0 * sigma, sigma }
            }
            "mitchell" => {
                let (b, c) = (self.mitchell_parameter(object, "b")?, self.mitchell_parameter(object, "c")?);
                FilmFilter::Mitchell { radius: 2.0, b, c }
            }
            "catmullrom" => FilmFilter::Mitchell { radius: 2.0, b: 0.0, c: 0.5 },
            _ => {
                let message = format!("the {} is not supported; `catmullrom` stands for it", object.describe());
                self.report.warn(object.at, message);
                self.accept_all(object);
                FilmFilter::Mitchell { radius: 2.0, b: 0.0, c: 0.5 }
            }
        })
    }

    /// Reads Mitchell and Netravali's parameter B or C.
    fn mitchell_parameter(&mut self, object: &Object, name: &str) -> Result<f32, SceneError> {
        let given = self.bad(object.float(name))?.unwrap_or(1.0 / 3.0);
        let number = given.clamp(0.0, 1.0);
        if number != given {
            self.report.warn(object.at, format!("`{name}` of a filter is from 0 to 1: {number} stands for {given}"));
        }
        Ok(number as f32)
    }
}

/// Returns the axis of a sensor's or projector's field of view.
pub(super) fn fov_axis(importer: &mut Importer<'_>, object: &Object) -> Result<FovAxis, SceneError> {
    let axis = importer.bad(object.string("fov_axis"))?;
    if object.property("fov").is_none() {
        return Ok(FovAxis::Diagonal);
    }
    Ok(match axis {
        None | Some("x") => FovAxis::X,
        Some("y") => FovAxis::Y,
        Some("diagonal") => FovAxis::Diagonal,
        Some("smaller") => FovAxis::Smaller,
        Some("larger") => FovAxis::Larger,
        Some(other) => {
            let message = format!("`fov_axis` cannot be `{}`; `x` stands for it", shortened(other));
            importer.report.warn(object.at, message);
            FovAxis::X
        }
    })
}

/// Returns the angle from the lower to the upper edge, in radians.
///
/// - `aspect`: width over height.
pub(super) fn vertical_fov(fov: f64, axis: FovAxis, aspect: f64) -> f64 {
    let tan = (0.5 * fov).tan();
    let tan_y = match axis {
        FovAxis::X => tan / aspect,
        FovAxis::Y => tan,
        FovAxis::Diagonal => tan / (1.0 + aspect * aspect).sqrt(),
        FovAxis::Smaller => tan / aspect.min(1.0),
        FovAxis::Larger => tan / aspect.max(1.0),
    };
    2.0 * tan_y.atan()
}

/// Returns rotation (which may mirror) and position of a transformation, and true if it has no other part. `None`: it
/// is singular.
pub(super) fn standing(to_world: &DMat4) -> Option<(DMat3, DVec3, bool)> {
    let linear = DMat3::from_mat4(*to_world);
    // Keep the viewing direction and make the other axes perpendicular to it.
    let z = linear.z_axis.try_normalize()?;
    let y = (linear.y_axis - z * z.dot(linear.y_axis)).try_normalize()?;
    let x = linear.x_axis - z * z.dot(linear.x_axis);
    let x = (x - y * y.dot(x)).try_normalize()?;
    let rotation = DMat3::from_cols(x, y, z);
    let position = to_world.w_axis.truncate();
    (rotation.is_finite() && position.is_finite()).then(|| (rotation, position, linear.abs_diff_eq(rotation, 1e-3)))
}

/// Returns world from camera space. Our camera looks along −z with +x to the right, Mitsuba's along +z with +x to the
/// left.
pub(super) fn looking(rotation: &DMat3, position: DVec3) -> Affine3A {
    let turned = *rotation * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
    Affine3A { matrix3: turned.as_mat3().into(), translation: position.as_vec3().into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_view_are_those_of_mitsuba() {
        // tan of half the vertical angle for 90° on a film of 2 : 1, as Mitsuba 3.9 has it.
        let cases = [
            (FovAxis::X, 0.5),
            (FovAxis::Y, 1.0),
            (FovAxis::Diagonal, 0.4472),
            (FovAxis::Smaller, 1.0),
            (FovAxis::Larger, 0.5),
        ];
        for (axis, expected) in cases {
            let tan = (0.5 * vertical_fov(std::f64::consts::FRAC_PI_2, axis, 2.0)).tan();
            assert!((tan - expected).abs() < 1e-4, "{axis:?}: {tan}");
        }
    }
}
