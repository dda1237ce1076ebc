//! Profiles of IES on lights: `shaping:ies` of ShapingAPI.
//!
//! A profile is multiplied to the radiance, in candela, or over its mean if it is normalized. It becomes a picture by
//! direction, with the cone of the light in it.
//!
//! Source: UsdLuxShapingAPI of OpenUSD 25.05, and its reference implementation in hdEmbree.

use std::f64::consts::PI;
use std::path::Path;

use glam::{DMat3, DVec3, Mat3, Vec3};
use openusd::usd::Prim;

use super::shaping::{Cone, input};
use super::source::{NamedFile, StageSource};
use super::texture::Textures;
use crate::emission::DirectionPicture;
use crate::ies::{IesInterpolation, IesPicture, IesProfile};
use crate::text::shortened;
use crate::texture::ImageId;

/// A profile of a light, ready to be placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LightProfile {
    /// The picture.
    image: ImageId,
    /// Factor of the radiance where the picture has 1.
    pub(super) scale: f32,
}

impl LightProfile {
    /// Returns the picture with its orientation in the world.
    pub(super) fn placed(&self, world_from_light: &DMat3) -> DirectionPicture {
        // Horizontal angles are those of the way to the light, which is against the direction of emission
        let turned = orthonormal(world_from_light) * Mat3::from_diagonal(Vec3::new(-1.0, -1.0, 1.0));
        DirectionPicture { image: self.image, world_from_light: DirectionPicture::along_axis(turned) }
    }
}

/// Reads the profile of a light; `None`: it has none, or one that is left out, with a warning. A profile contains the cone.
pub(super) fn read(
    source: &StageSource<'_>,
    textures: &mut Textures<'_>,
    prim: &Prim,
    time: f64,
    cone: Option<Cone>,
) -> Option<LightProfile> {
    let path = prim.path().as_str();
    let file = file_of(source, prim, time)?;
    let shown = shortened(&file.reference).into_owned();
    let left_out = |problem: String| {
        source
            .unsupported(path, format!("the profile `{shown}`: {problem}; the light shines equally in all directions"));
    };
    let profile = match parsed(source, &file) {
        Ok(profile) => profile,
        Err(problem) => {
            left_out(problem);
            return None;
        }
    };
    let peak = profile.peak();
    let is_normalized = input(source, prim, "shaping:ies:normalize", time).is_some_and(|value| value != 0.0);
    let mean = profile.lumens() / if profile.covers_sphere() { 4.0 * PI } else { 2.0 * PI };
    let scale = if is_normalized { peak / mean } else { peak };
    if !(scale.is_finite() && scale <= f64::from(crate::values::FACTOR_MAX)) {
        left_out("it is black, or too bright to be computed with".into());
        return None;
    }
    let angle_scale = input(source, prim, "shaping:ies:angleScale", time).unwrap_or(0.0);
    let name = format!("{} {angle_scale} {cone:?}", file.name.as_deref().unwrap_or(&file.reference));
    let make = || picture(&profile, angle_scale, cone).to_image(&shown);
    let image = textures.add(source, path, &name, make)?;
    Some(LightProfile { image, scale: scale as f32 })
}

/// Returns the file of a light's profile; `None`: it has none.
pub(super) fn file_of(source: &StageSource<'_>, prim: &Prim, time: f64) -> Option<NamedFile> {
    let file = |name: &str| source.file(prim, name, time);
    file("inputs:shaping:ies:file").or_else(|| file("shaping:ies:file"))
}

fn parsed(source: &StageSource<'_>, file: &NamedFile) -> Result<IesProfile, String> {
    let name = file.name.as_ref().ok_or("there is no such file")?;
    let bytes = source.files.read(name).map_err(|error| error.to_string())?;
    let path = Path::new(name);
    IesProfile::of_bytes(&bytes, path.file_name().map_or(path, Path::new)).map_err(|error| error.to_string())
}

/// Returns the picture of a profile whose vertical angles are scaled, within a cone.
fn picture(profile: &IesProfile, angle_scale: f64, cone: Option<Cone>) -> IesPicture {
    if angle_scale == 0.0 && cone.is_none() {
        return profile.picture(IesInterpolation::Linear);
    }
    profile.changed_picture(|angle| {
        (scaled(angle, angle_scale), cone.map_or(1.0, |cone| within(cone, angle.to_radians())))
    })
}

/// Returns the vertical angle of the profile that is seen at one of the light, both in degrees. A positive scale keeps 0°, a
/// negative one 180°.
fn scaled(angle: f64, scale: f64) -> f64 {
    let scaled = match scale {
        0.0 => angle,
        scale if scale > 0.0 => angle / scale,
        scale => 180.0 + (angle - 180.0) / -scale,
    };
    scaled.clamp(0.0, 180.0)
}

/// Returns how much of the light a cone lets through at an angle to its axis.
fn within(cone: Cone, angle: f64) -> f64 {
    let (inner, outer) = (cone.inner.cos(), cone.outer.cos());
    let share = ((angle.cos() - outer) / (inner - outer)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// Returns the axes of a matrix, perpendicular and of unit length; the third stays where it is.
fn orthonormal(matrix: &DMat3) -> Mat3 {
    let z = matrix.z_axis.try_normalize().unwrap_or(DVec3::Z);
    let x = matrix.x_axis.reject_from_normalized(z).try_normalize().unwrap_or(z.any_orthonormal_vector());
    let side = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    let axes = [x, z.cross(x) * side, z].map(DVec3::as_vec3);
    Mat3::from_cols(axes[0], axes[1], axes[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_narrows_and_widens_from_one_end() {
        assert_eq!((scaled(30.0, 0.0), scaled(30.0, 0.5), scaled(30.0, 2.0)), (30.0, 60.0, 15.0));
        assert_eq!((scaled(150.0, -0.5), scaled(150.0, -2.0), scaled(170.0, 0.5)), (120.0, 165.0, 180.0));
    }

    #[test]
    fn axes_stay_perpendicular() {
        let skewed = DMat3::from_cols(DVec3::new(2.0, 0.0, 1.0), DVec3::Y, DVec3::new(0.0, 0.0, -3.0));
        let axes = orthonormal(&skewed);
        assert!(crate::emission::is_orthonormal(&axes) && axes.z_axis == glam::Vec3::NEG_Z);
        assert!(axes.determinant() < 0.0, "a mirroring matrix stays one");
    }
}
