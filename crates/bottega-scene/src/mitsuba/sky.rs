//! The emitters `sunsky`, `sky` and `sun`. Those of Mitsuba 0.x, which has other units, are treated alike.

use glam::{DMat3, DMat4, DVec3};

use super::context::ImportContext;
use super::document::Object;
use super::orientation::rotation;
use super::texture::MitsubaTextures;
use crate::color::Spectrum;
use crate::import::sun_sky::{HEIGHT, SUN_APERTURE, SunSky, SunTime, WIDTH};
use crate::import::text_place::{ImportError, ImportResult};
use crate::light::Environment;
use crate::spectrum::role::ColorRole;

/// Returns the environment of the emitter `sunsky`, `sky` or `sun`.
pub(super) fn sun_and_sky(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
    to_world: &DMat4,
) -> ImportResult<Environment> {
    if object.boolean("complex_sun", false)? {
        context.warn(object.at, "the sun is as bright at its rim as in its middle, though `complex_sun` is true");
    }
    if context.document.is_old {
        context.warn(object.at, format!("the {} is as bright as that of Mitsuba 3", object.describe()));
    }
    let turbidity = object.float_at_least("turbidity", 1.0, 3.0)?.clamp(1.0, 10.0);
    let albedo = textures.plain_color(context, object, "albedo", ColorRole::Reflectance, Spectrum::splat(0.3))?;
    let scale = object.float_at_least("scale", 0.0, 1.0)?;
    let has = |part: &str| object.plugin.contains(part);
    let share = |name: &str| Ok::<f64, ImportError>(object.float_at_least(name, 0.0, 1.0)? * scale);
    let (sky_scale, sun_scale) = (share("sky_scale")?, share("sun_scale")?);
    let (sky_scale, sun_scale) = (if has("sky") { sky_scale } else { 0.0 }, if has("sun") { sun_scale } else { 0.0 });
    let aperture = object.float_at_least("sun_aperture", 0.01, SUN_APERTURE)?.min(90.0)
        * object.float_at_least("sun_radius_scale", 0.0, 1.0)?.clamp(0.05, 100.0);
    // The zenith is +y in Mitsuba 0.x; rotate it to +z.
    let zenith_up =
        if context.document.is_old { DMat3::from_cols(DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y) } else { DMat3::IDENTITY };
    let world_from_sky = rotation(context, object, to_world) * zenith_up;
    let sun = match object.vector("sun_direction")? {
        // A world direction, independent of the sky's rotation.
        Some(direction) => world_from_sky.transpose() * direction,
        None => sun_by_time(object)?,
    };
    let sun = sun.try_normalize().unwrap_or(DVec3::Z);
    if sun.z < 0.0 {
        context.warn(object.at, "the sun is below the horizon: it is night");
    }
    // The zenith of the picture is +y: x of the sky is −z of the picture, y is −x.
    let sky_from_picture = DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X);
    let bytes = (WIDTH * HEIGHT * 16) as usize;
    context.take(object.at, bytes)?;
    let sky = SunSky::new(sun, turbidity, albedo);
    let image = textures.pictures.add(sky.image(&sky_from_picture, sky_scale, sun_scale, aperture));
    let world_from_environment = (world_from_sky * sky_from_picture).as_mat3();
    Ok(Environment::picture(image, Spectrum::ONE, world_from_environment))
}

/// Returns the direction to the sun by date, time and location: +z up, +x south, +y west.
fn sun_by_time(object: &Object) -> ImportResult<DVec3> {
    let number = |name: &str, default: f64| Ok::<_, ImportError>(object.float(name)?.unwrap_or(default));
    let (latitude, longitude) = (number("latitude", 35.6894)?, number("longitude", 139.6917)?);
    let (year, month, day) = (number("year", 2010.0)?, number("month", 7.0)?, number("day", 10.0)?);
    let hour = number("hour", 15.0)? + number("minute", 0.0)? / 60.0 + number("second", 0.0)? / 3600.0;
    let universal = hour - number("timezone", 9.0)?;
    Ok(SunTime { year, month, day, universal, latitude, longitude }.direction())
}
