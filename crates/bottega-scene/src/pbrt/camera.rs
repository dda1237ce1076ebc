//! Cameras of a pbrt scene, with their screen windows and films.

use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec2, Vec3A};

use super::context::Context;
use super::needless::Directive;
use super::transform::axes_and_scale;
use super::world::{Entity, PbrtWorld};
use crate::camera::{Camera, Clip, FovAxis, Panorama, Projection};
use crate::import::text_place::ImportResult;
use crate::medium::MediumId;
use crate::motion::Shutter;
use crate::text::shortened;

impl PbrtWorld {
    /// Returns the span of time that the camera sees.
    pub(super) fn shutter(&self) -> ImportResult<Shutter> {
        let plain = Entity::plain("perspective");
        let params = &self.camera.as_ref().unwrap_or(&plain).params;
        let open = params.float("shutteropen")?.unwrap_or(0.0);
        let close = params.float("shutterclose")?.unwrap_or(1.0);
        let wrong = || params.place_of("shutterclose").fault("the shutter closes before it opens");
        Shutter::new(open, close).ok_or_else(|| wrong().into())
    }

    /// Returns the camera of the file; pbrt's default if it has none.
    ///
    /// - `resolution`: columns and rows of the picture.
    pub(super) fn camera(
        &self,
        context: &mut Context<'_>,
        [width, height]: [u32; 2],
        medium: Option<MediumId>,
    ) -> ImportResult<Camera> {
        let plain = Entity::plain("perspective");
        let entity = self.camera.as_ref().unwrap_or(&plain);
        let (params, at) = (&entity.params, entity.at);
        let world_from_camera = entity.ctm.inverse();
        let (axes, scale) = axes_and_scale(&world_from_camera);
        let is_perpendicular = (axes * axes.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-3);
        if !world_from_camera.is_finite() || scale.min_element() <= 0.0 || !scale.is_finite() || !is_perpendicular {
            return Err(at.fault("the transformation of the camera is singular or skewed").into());
        }

        // Compute the visible part of the plane one unit before the camera: pbrt's screen window times the tangent of
        // half the angle.
        let film_aspect = f64::from(width) / f64::from(height);
        let aspect = params.float("frameaspectratio")?.unwrap_or(film_aspect);
        if !(aspect > 1e-6 && aspect < 1e6) {
            return Err(params
                .place_of("frameaspectratio")
                .fault("the aspect ratio is not between 1e-6 and 1e6")
                .into());
        }
        let mut window =
            if aspect > 1.0 { [-aspect, aspect, -1.0, 1.0] } else { [-1.0, 1.0, -1.0 / aspect, 1.0 / aspect] };
        if let Some(given) = params.floats("screenwindow") {
            let place = params.place_of("screenwindow");
            window = *given.as_array().ok_or_else(|| place.fault("`screenwindow` has not four values"))?;
        }
        // The default window spans one unit to the nearer edges; a given one does not depend on the picture's aspect.
        let is_own = params.floats("screenwindow").is_none() && params.float("frameaspectratio")?.is_none();
        let fov_axis = if is_own { FovAxis::Smaller } else { FovAxis::Y };
        let [x0, x1, y0, y1] = window;
        // Scales of the camera's axes widen its view.
        let half = DVec3::new(0.5 * (x1 - x0) * scale.x, 0.5 * (y1 - y0) * scale.y, scale.z);
        let center = DVec3::new(0.5 * (x0 + x1) * scale.x, 0.5 * (y0 + y1) * scale.y, scale.z);
        let sees_all_around = entity.kind == "spherical";
        // A flipped window mirrors the picture.
        let flip = if sees_all_around { DVec3::ONE } else { DVec3::new(half.x.signum(), half.y.signum(), 1.0) };
        let half = half.abs();
        if sees_all_around && scale.max_element() > scale.min_element() * 1.001 {
            context.unsupported(at, "the scales of the camera are treated as equal");
        }
        if half.min_element().is_nan() || half.min_element() <= 0.0 {
            return Err(at.fault("the screen window of the camera is empty").into());
        }
        // A window of another aspect than the film stretches pixels.
        let pixel_aspect = match half.x / half.y / film_aspect {
            square if (square - 1.0).abs() < 1e-5 => 1.0,
            stretched => stretched,
        };
        let mut lenses = None;
        let projection = match entity.kind.as_str() {
            "orthographic" => Projection::Orthographic { height: (2.0 * half.y) as f32 },
            "spherical" => Projection::Panorama(match params.text("mapping")?.unwrap_or("equalarea") {
                "equalarea" => Panorama::EqualArea,
                "equirectangular" => Panorama::Equirectangular,
                other => {
                    let problem =
                        format!("the mapping \"{}\" is neither equalarea nor equirectangular", shortened(other));
                    return Err(params.place_of("mapping").fault(problem).into());
                }
            }),
            "realistic" => {
                let system = self.lenses(context, params, at, scale.z)?;
                let diagonal = f64::from(system.description().film_diagonal);
                let half_film = 0.5 * diagonal / (film_aspect * film_aspect + 1.0).sqrt();
                let vertical_fov = (2.0 * (half_film / f64::from(system.image_distance())).atan()) as f32;
                lenses = Some(system);
                Projection::Perspective { vertical_fov }
            }
            kind => {
                if kind != "perspective" {
                    let message = format!("the camera \"{}\" is replaced by a perspective one", shortened(kind));
                    context.unsupported(at, message);
                }
                let degrees = params.float("fov")?.unwrap_or(90.0);
                if !(degrees > 0.0 && degrees < 180.0) {
                    return Err(params.place_of("fov").fault("`fov` must be between 0 and 180 degrees").into());
                }
                let tan = (0.5 * degrees.to_radians()).tan();
                Projection::Perspective { vertical_fov: (2.0 * (tan * half.y / half.z).atan()) as f32 }
            }
        };
        let lens_radius = params.float("lensradius")?.unwrap_or(0.0) * scale.x;
        let focus_distance = params.float("focaldistance")?.unwrap_or(1e6) * scale.z;
        if !(lens_radius >= 0.0 && focus_distance > 0.0) {
            return Err(at.fault("the lens has a negative radius, or its focus is behind it").into());
        }
        if lens_radius > 1e18 || !world_from_camera.translation.as_vec3().is_finite() {
            return Err(at.fault("the position of the camera is not finite, or its lens too large").into());
        }
        context.report_unused(Directive::Camera, &entity.kind, params);
        // pbrt's camera looks along +z, ours along −z.
        let mut turned = DMat3::from_diagonal(DVec3::new(flip.x, flip.y, -1.0));
        if projection == Projection::Panorama(Panorama::Equirectangular) {
            // pbrt's picture begins at its +x and continues over −z; ours begins at +z and continues over −x
            turned *= DMat3::from_cols(DVec3::Z, DVec3::Y, DVec3::X);
        }
        let upright = |world_from_camera: &DAffine3| Affine3A {
            matrix3: Mat3A::from((axes_and_scale(world_from_camera).0 * turned).as_mat3()),
            translation: Vec3A::from(world_from_camera.translation.as_vec3()),
        };
        let motion = entity.path(self, DAffine3::inverse).motion(upright);
        if !motion.iter().all(|key| key.transform.is_finite()) {
            return Err(at.fault("the transformation of the camera is singular when the shutter closes").into());
        }
        let is_sound = match projection {
            Projection::Perspective { vertical_fov } => vertical_fov > 0.0 && vertical_fov < std::f32::consts::PI,
            Projection::Orthographic { height } => height > 0.0 && height.is_finite(),
            Projection::Fisheye { .. } | Projection::Panorama(_) => true,
        };
        let lens_radius = if sees_all_around { 0.0 } else { lens_radius };
        let lens_shift = Vec2::new((-center.x * flip.x / half.x) as f32, (-center.y * flip.y / half.y) as f32);
        if !is_sound || !lens_shift.is_finite() {
            return Err(at.fault("the camera shows nothing, or everything").into());
        }
        Ok(Camera {
            name: String::new(),
            world_from_camera: upright(&world_from_camera),
            projection,
            aspect: Some(film_aspect as f32),
            pixel_aspect: pixel_aspect as f32,
            fov_axis,
            lens_radius: lens_radius as f32,
            focus_distance: focus_distance.clamp(1e-30, 1e30) as f32,
            lens_shift: if sees_all_around || lenses.is_some() { Vec2::ZERO } else { lens_shift },
            medium,
            clip: Clip::NONE,
            lenses,
            motion,
            ..Camera::default()
        })
    }
}
