//! Boundaries of bsdfs: their indices of refraction and microfacets.

use super::context::ImportContext;
use super::document::Object;
use super::texture::MitsubaTextures;
use super::value::Value;
use crate::import::text_place::{ImportResult, TextFault};
use crate::spectrum::named::mitsuba_ior;
use crate::surface::{Distribution, Facets, RoughnessScale, Shadowing};
use crate::text::shortened;

/// Returns the index of refraction of the inside over the outside.
pub(super) fn eta(object: &Object, interior: &str) -> Result<f32, TextFault> {
    let (inside, outside) = (ior(object, "int_ior", interior)?, ior(object, "ext_ior", "air")?);
    Ok(inside / outside)
}

/// Returns an index of refraction, given by number or name.
pub(super) fn ior(object: &Object, name: &str, default: &str) -> Result<f32, TextFault> {
    let by_name = |name: &str| mitsuba_ior(name).unwrap_or(1.5);
    let Some(property) = object.property(name) else { return Ok(by_name(default)) };
    match &property.value {
        Value::Float(number) if (0.01..=100.0).contains(number) => Ok(*number as f32),
        Value::Integer(number) if (1..=100).contains(number) => Ok(*number as f32),
        Value::String(text) => mitsuba_ior(text)
            .ok_or_else(|| property.at.fault(format!("the substance `{}` is unknown", shortened(text)))),
        _ => Err(property.at.fault(format!("`{name}` is not an index of refraction"))),
    }
}

/// Returns the microfacets of a rough boundary; a smooth one for other plugins.
pub(super) fn facets(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
    is_rough: bool,
) -> ImportResult<Facets> {
    if !is_rough {
        return Ok(Facets::smooth());
    }
    let distribution = match object.string("distribution")? {
        Some("ggx") => Distribution::Ggx,
        None | Some("beckmann") => Distribution::Beckmann,
        Some(other) => {
            let message = format!("the distribution `{}` is not supported; Beckmann's replaces it", shortened(other));
            context.warn(object.at, message);
            Distribution::Beckmann
        }
    };
    let alpha = textures.scalar(context, object, "alpha", 0.1)?;
    let mut roughness = [alpha.clone(), alpha];
    for (roughness, name) in roughness.iter_mut().zip(["alpha_u", "alpha_v"]) {
        if object.has(name) {
            *roughness = textures.scalar(context, object, name, 0.1)?;
        }
    }
    Ok(Facets { distribution, roughness, scale: RoughnessScale::Alpha, shadowing: Shadowing::Separable })
}
