//! Bsdfs of Mitsuba 0.6 with empirical highlights.

use super::context::ImportContext;
use super::document::Object;
use super::texture::MitsubaTextures;
use crate::color::Spectrum;
use crate::import::text_place::ImportResult;
use crate::param::ColorParam;
use crate::spectrum::role::ColorRole;
use crate::surface::{Phong, Ward, WardVariant};
use crate::text::shortened;

/// Converts a `phong`.
pub(super) fn phong(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<Phong> {
    let [diffuse, specular] = reflectances(context, textures, object)?;
    Ok(Phong { diffuse, specular, exponent: textures.scalar(context, object, "exponent", 30.0)? })
}

/// Converts a `ward`.
pub(super) fn ward(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<Ward> {
    let variant = match object.string("variant")?.map(str::to_ascii_lowercase).as_deref() {
        None | Some("balanced") => WardVariant::Balanced,
        Some("ward") => WardVariant::Ward,
        Some("ward-duer") => WardVariant::Duer,
        Some(other) => {
            let message =
                format!("the variant `{}` of Ward's model is unknown: `balanced` replaces it", shortened(other));
            context.warn(object.at, message);
            WardVariant::Balanced
        }
    };
    let [diffuse, specular] = reflectances(context, textures, object)?;
    let alpha = textures.scalar(context, object, "alpha", 0.1)?;
    let mut roughness = [alpha.clone(), alpha];
    for (roughness, name) in roughness.iter_mut().zip(["alpha_u", "alpha_v"]) {
        if object.has(name) {
            *roughness = textures.scalar(context, object, name, 0.1)?;
        }
    }
    Ok(Ward { diffuse, specular, roughness, variant })
}

/// Returns the diffuse and the specular reflectance.
fn reflectances(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<[ColorParam; 2]> {
    let mut reflectance = |name: &str, default: f32| {
        textures.color(context, object, name, ColorRole::Reflectance, Spectrum::splat(default))
    };
    Ok([reflectance("diffuse_reflectance", 0.5)?, reflectance("specular_reflectance", 0.2)?])
}
