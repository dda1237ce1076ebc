//! Where on a picture a point of a surface is.

use glam::{Affine2, Vec2};

use super::context::{Context, Outcome};
use super::params::Params;
use crate::text::shortened;

/// From a picture of that size to the same with an edge of one texel around it.
pub(super) fn within_frame((width, height): (u32, u32)) -> Affine2 {
    let size = Vec2::new(width as f32, height as f32);
    Affine2::from_scale_angle_translation(size / (size + 2.0), 0.0, 1.0 / (size + 2.0))
}

/// Where on a picture (v downwards) a point of a surface is.
pub(super) fn mapping(context: &mut Context<'_>, params: &Params) -> Outcome<Affine2> {
    let kind = params.text("mapping")?.unwrap_or("uv");
    if kind != "uv" {
        params.ignore(&["v1", "v2"]);
        let message = format!("the mapping \"{}\" is replaced by the surface's own coordinates", shortened(kind));
        context.unsupported(params.place_of("mapping"), message);
    }
    let scale = |name| params.float(name).map(|scale| scale.unwrap_or(1.0));
    let delta = |name| params.float(name).map(|delta| delta.unwrap_or(0.0));
    let (scale_u, scale_v, delta_u, delta_v) = (scale("uscale")?, scale("vscale")?, delta("udelta")?, delta("vdelta")?);
    // t = scale_v · (1 − v) + delta_v, counted upwards; 1 − t, downwards.
    let mapping = Affine2::from_cols_array(&[
        scale_u as f32,
        0.0,
        0.0,
        scale_v as f32,
        delta_u as f32,
        (1.0 - scale_v - delta_v) as f32,
    ]);
    if mapping.is_finite() { Ok(mapping) } else { Err(params.at.fault("the mapping exceeds all bounds").into()) }
}
