//! `sunsky`, `sky` and `sun`: painted into an environment picture when they are read.
//!
//! The sky is that of Preetham, Shirley and Smits 1999, *A Practical Analytic Model for Daylight*, appendix A; the sun is a
//! black body seen through the air of its section A.1 without ozone. Radiance is in the unit of Mitsuba 3, whose own
//! model is another one, so that colours and strengths are only near.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat3, DMat4, DVec3};

use super::Importer;
use super::document::Object;
use crate::spectrum::Sampled;
use crate::{Environment, Image, SceneError, Spectrum};

/// Columns and rows of the picture.
const WIDTH: u32 = 1024;
const HEIGHT: u32 = 512;

/// The angle that the sun takes, in degrees.
const SUN_APERTURE: f64 = 0.5358;

/// From kcd·m⁻² to the luminance of spectral radiance in W·m⁻²·sr⁻¹·nm⁻¹ as Mitsuba counts it: 1 everywhere is 1.
const PER_KILOCANDELA: f64 = 1000.0 / (683.0 * 106.857);

struct Sky {
    /// Towards the sun, +z the zenith.
    sun: DVec3,
    turbidity: f64,
    /// Perez's five numbers, and the value at the zenith over the function there: of Y, x and y.
    channels: [([f64; 5], f64); 3],
}

impl Importer<'_> {
    pub(super) fn sun_and_sky(&mut self, object: &Object, to_world: &DMat4) -> Result<(), SceneError> {
        object.ignore(&["albedo", "stretch", "resolution", "extend", "complex_sun"]);
        let message = format!(
            "the {} is painted as a picture of {WIDTH} × {HEIGHT} by the model of Preetham, which is not that of Mitsuba",
            object.describe()
        );
        self.report.warn(object.at, message);
        let turbidity = self.number_at_least(object, "turbidity", 1.0, 3.0)?.clamp(1.7, 10.0);
        let scale = self.number_at_least(object, "scale", 0.0, 1.0)?;
        let has = |part: &str| object.plugin.contains(part);
        let share = |name: &str| Ok::<f64, SceneError>(self.number_at_least(object, name, 0.0, 1.0)? * scale);
        let (sky_scale, sun_scale) = (share("sky_scale")?, share("sun_scale")?);
        let (sky_scale, sun_scale) =
            (if has("sky") { sky_scale } else { 0.0 }, if has("sun") { sun_scale } else { 0.0 });
        let aperture = self.number_at_least(object, "sun_aperture", 0.01, SUN_APERTURE)?.min(90.0)
            * self.number_at_least(object, "sun_radius_scale", 0.0, 1.0)?.clamp(0.05, 100.0);
        // The old line has its zenith along +y; both are turned to +z here.
        let zenith_up =
            if self.document.is_old { DMat3::from_cols(DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y) } else { DMat3::IDENTITY };
        let sun = match self.bad(object.vector("sun_direction"))? {
            Some(direction) => zenith_up.transpose() * direction,
            None => self.sun_by_time(object)?,
        };
        let sun = sun.try_normalize().unwrap_or(DVec3::Z);
        if sun.z < 0.0 {
            self.report.warn(object.at, "the sun is below the horizon: it is night");
        }
        // What is painted has +y as its zenith: x of the sky is −z of the picture, y is −x.
        let world_from_sky = self.rotation(object, to_world) * zenith_up;
        let sky_from_picture = DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X);
        let bytes = (WIDTH * HEIGHT * 16) as usize;
        self.resources.budget().take(self.report.path(object.at.file), "", bytes)?;
        let sky = Sky::new(sun, turbidity);
        let image = self.pictures.add(sky.image(&sky_from_picture, sky_scale, sun_scale, aperture));
        let world_from_environment = (world_from_sky * sky_from_picture).as_mat3();
        self.set_environment(object, Environment::picture(image, Spectrum::ONE, world_from_environment));
        Ok(())
    }

    /// Where the sun is by date, hour and place, to about half a degree: +z up, +x south, +y west.
    ///
    /// Source: Meeus, *Astronomical Algorithms*, chapter 25 (low accuracy), without the equation of time's small terms.
    fn sun_by_time(&self, object: &Object) -> Result<DVec3, SceneError> {
        let number = |name: &str, default: f64| Ok::<_, SceneError>(self.bad(object.float(name))?.unwrap_or(default));
        let (latitude, longitude) = (number("latitude", 35.6894)?, number("longitude", 139.6917)?);
        let (year, month, day) = (number("year", 2010.0)?, number("month", 7.0)?, number("day", 10.0)?);
        let hour = number("hour", 15.0)? + number("minute", 0.0)? / 60.0 + number("second", 0.0)? / 3600.0;
        let universal = hour - number("timezone", 9.0)?;
        // Days since noon of the first of January 2000.
        let months = (month - 14.0) / 12.0;
        let months = months.trunc();
        let julian = ((1461.0 * (year + 4800.0 + months)) / 4.0).trunc()
            + ((367.0 * (month - 2.0 - 12.0 * months)) / 12.0).trunc()
            - ((3.0 * ((year + 4900.0 + months) / 100.0).trunc()) / 4.0).trunc()
            + day
            - 32075.0
            - 0.5
            + universal / 24.0;
        let days = julian - 2_451_545.0;
        let mean_longitude = (280.460 + 0.985_647_4 * days).to_radians();
        let anomaly = (357.528 + 0.985_600_3 * days).to_radians();
        let ecliptic = mean_longitude + (1.915 * anomaly.sin() + 0.020 * (2.0 * anomaly).sin()).to_radians();
        let obliquity = (23.439 - 0.000_000_4 * days).to_radians();
        let right_ascension = (obliquity.cos() * ecliptic.sin()).atan2(ecliptic.cos());
        let declination = (obliquity.sin() * ecliptic.sin()).asin();
        let sidereal = (280.460_618 + 360.985_647_37 * days + longitude).to_radians();
        let hour_angle = sidereal - right_ascension;
        let latitude = latitude.to_radians();
        let up = latitude.sin() * declination.sin() + latitude.cos() * declination.cos() * hour_angle.cos();
        let west = declination.cos() * hour_angle.sin();
        let south = latitude.sin() * declination.cos() * hour_angle.cos() - latitude.cos() * declination.sin();
        Ok(DVec3::new(south, west, up))
    }
}

impl Sky {
    fn new(sun: DVec3, turbidity: f64) -> Self {
        let t = turbidity;
        let theta = sun.z.clamp(0.0, 1.0).acos();
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * theta);
        let zenith_luminance = ((4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192).max(0.0);
        let cubic = |m: [[f64; 4]; 3]| {
            let row = |c: [f64; 4]| ((c[0] * theta + c[1]) * theta + c[2]) * theta + c[3];
            (row(m[0]) * t + row(m[1])) * t + row(m[2])
        };
        let zenith_x = cubic([
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        ]);
        let zenith_y = cubic([
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        ]);
        let linear = |m: [[f64; 2]; 5]| m.map(|[slope, offset]| slope * t + offset);
        let luminance =
            linear([[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]]);
        let x =
            linear([[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]]);
        let y =
            linear([[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]]);
        let channel = |perez: [f64; 5], zenith: f64| (perez, zenith / perez_function(&perez, 1.0, theta));
        let channels = [channel(luminance, zenith_luminance), channel(x, zenith_x), channel(y, zenith_y)];
        Self { sun, turbidity, channels }
    }

    /// Radiance of the sky; black below the horizon.
    fn radiance(&self, direction: DVec3) -> DVec3 {
        if direction.z <= 0.0 || self.sun.z < 0.0 {
            return DVec3::ZERO;
        }
        let gamma = direction.dot(self.sun).clamp(-1.0, 1.0).acos();
        // At the very horizon its brightness would be taken from the limit.
        let cos = direction.z.max(1e-3);
        let [luminance, x, y] =
            [0, 1, 2].map(|index| self.channels[index].1 * perez_function(&self.channels[index].0, cos, gamma));
        let luminance = (luminance * PER_KILOCANDELA).max(0.0);
        if y <= 1e-6 {
            return DVec3::ZERO;
        }
        let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y) * luminance;
        // IEC 61966-2-1.
        let r = 3.240_97 * xyz.x - 1.537_383 * xyz.y - 0.498_611 * xyz.z;
        let g = -0.969_244 * xyz.x + 1.875_968 * xyz.y + 0.041_555 * xyz.z;
        let b = 0.055_63 * xyz.x - 0.203_977 * xyz.y + 1.056_972 * xyz.z;
        DVec3::new(r, g, b).max(DVec3::ZERO)
    }

    /// Radiance of the sun's disk.
    fn sun_radiance(&self) -> DVec3 {
        if self.sun.z <= 0.0 {
            return DVec3::ZERO;
        }
        let theta = self.sun.z.clamp(-1.0, 1.0).acos();
        let air_mass = 1.0 / (self.sun.z + 0.15 * (93.885 - theta.to_degrees()).powf(-1.253));
        let beta = (0.046_08 * self.turbidity - 0.045_86).max(0.0);
        let body = Sampled::blackbody(5778.0);
        let seen = |step: u32| {
            let nm = 360.0 + 5.0 * f64::from(step);
            let micrometres = nm / 1000.0;
            let rayleigh = 0.008_735 * micrometres.powf(-4.08);
            let aerosols = beta * micrometres.powf(-1.3);
            (nm, body.at(nm) * (-(rayleigh + aerosols) * air_mass).exp())
        };
        Sampled::new((0..=94).map(seen).collect()).map_or(DVec3::ZERO, |sun| sun.mitsuba_radiance().as_dvec3())
    }

    fn image(&self, sky_from_picture: &DMat3, sky_scale: f64, sun_scale: f64, aperture: f64) -> Image {
        use rayon::prelude::*;
        let sun = self.sun_radiance() * sun_scale;
        let cos_sun = (0.5 * aperture.to_radians()).cos();
        // Texels that may touch the sun are looked at more closely, and the sun's light is kept as a whole.
        let texel_angle = PI / f64::from(HEIGHT);
        let cos_near = (0.5 * aperture.to_radians() + 1.5 * texel_angle).min(FRAC_PI_2).cos();
        let toward = |u: f64, v: f64| {
            let (sin_azimuth, cos_azimuth) = ((u - 0.5) * TAU).sin_cos();
            let (sin_polar, cos_polar) = (v * PI).sin_cos();
            *sky_from_picture * DVec3::new(sin_polar * sin_azimuth, cos_polar, -sin_polar * cos_azimuth)
        };
        let at = |x: u32, y: u32, dx: f64, dy: f64| {
            toward((f64::from(x) + dx) / f64::from(WIDTH), (f64::from(y) + dy) / f64::from(HEIGHT))
        };
        const GRID: u32 = 16;
        let coverage = |x: u32, y: u32| {
            if at(x, y, 0.5, 0.5).dot(self.sun) < cos_near {
                return 0.0;
            }
            let center = |index: u32| (f64::from(index) + 0.5) / f64::from(GRID);
            let inside = (0..GRID * GRID)
                .filter(|index| at(x, y, center(index % GRID), center(index / GRID)).dot(self.sun) >= cos_sun);
            inside.count() as f64 / f64::from(GRID * GRID)
        };
        let covered: Vec<f64> = (0..WIDTH * HEIGHT).into_par_iter().map(|i| coverage(i % WIDTH, i / WIDTH)).collect();
        let solid_angle =
            |y: u32| ((f64::from(y) + 0.5) / f64::from(HEIGHT) * PI).sin() * texel_angle * TAU / f64::from(WIDTH);
        let painted: f64 = covered.iter().zip(0u32..).map(|(share, i)| share * solid_angle(i / WIDTH)).sum();
        let correction = if painted > 0.0 { TAU * (1.0 - cos_sun) / painted } else { 0.0 };
        let texel = |index: u32| {
            let (x, y) = (index % WIDTH, index / WIDTH);
            let sky = self.radiance(at(x, y, 0.5, 0.5)) * sky_scale;
            (sky + sun * (covered[index as usize] * correction)).as_vec3().to_array()
        };
        let texels = (0..WIDTH * HEIGHT).into_par_iter().map(texel).collect();
        Image::from_linear_rgb("sun and sky", WIDTH, HEIGHT, texels)
    }
}

/// Perez's function of the angle to the zenith, by its cosine, and of that to the sun.
fn perez_function([a, b, c, d, e]: &[f64; 5], cos: f64, gamma: f64) -> f64 {
    (1.0 + a * (b / cos).exp()) * (1.0 + c * (d * gamma).exp() + e * gamma.cos().powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_brightness_is_near_that_of_mitsuba() {
        // Mitsuba 3.9's sunsky with turbidity 3 and albedo 0.3, sun at 45°: 45° opposite, and the sun's disk.
        let sky = Sky::new(DVec3::new(0.0, 1.0, 1.0).normalize(), 3.0);
        let luminance = |rgb: DVec3| rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722));
        let opposite = luminance(sky.radiance(DVec3::new(0.0, -1.0, 1.0).normalize()));
        assert!((0.5..2.0).contains(&(opposite / luminance(DVec3::new(0.0247, 0.0485, 0.0994)))), "{opposite}");
        let sun = luminance(sky.sun_radiance());
        assert!((0.7..1.4).contains(&(sun / luminance(DVec3::new(21369.0, 17551.0, 12928.0)))), "{sun}");
        assert!(sky.radiance(DVec3::NEG_Z) == DVec3::ZERO);
    }

    #[test]
    fn the_sun_keeps_its_light_whatever_the_texels_are() {
        let sky = Sky::new(DVec3::new(0.3, 0.2, 0.6).normalize(), 3.0);
        let image = sky.image(&DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X), 0.0, 1.0, SUN_APERTURE);
        let mut sum = 0.0;
        for y in 0..HEIGHT {
            let weight =
                ((f64::from(y) + 0.5) / f64::from(HEIGHT) * PI).sin() * PI / f64::from(HEIGHT) * TAU / f64::from(WIDTH);
            sum += (0..WIDTH).map(|x| f64::from(image.texel(x, y).x)).sum::<f64>() * weight;
        }
        let expected = sky.sun_radiance().x * TAU * (1.0 - (0.5 * SUN_APERTURE.to_radians()).cos());
        assert!((sum / expected - 1.0).abs() < 1e-3, "{sum} {expected}");
    }
}
