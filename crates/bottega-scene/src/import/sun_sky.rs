//! Sun and sky, rendered to an environment picture.
//!
//! The sky is the RGB version of Hosek and Wilkie 2012, *An Analytic Model for Full Spectral Sky-Dome Radiance*; the
//! sun is a disk with the radiance of Mitsuba 3.9, without limb darkening. Both match Mitsuba's `*_rgb` variants.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat3, DVec3, Vec3};
use hw_skymodel::rgb::{Channel, SkyParams, SkyState};
use rayon::prelude::*;

use crate::color::Spectrum;
use crate::image::Image;

/// Size of the picture, in texels.
pub(crate) const WIDTH: u32 = 1024;
pub(crate) const HEIGHT: u32 = 512;

/// Angular diameter of the sun, in degrees.
pub(crate) const SUN_APERTURE: f64 = 0.5358;

/// Factor from the model's radiance, in W·m⁻²·sr⁻¹ with 683 lm·W⁻¹, to Mitsuba's unit. Measured as their ratio, which
/// is the same for all directions, sun positions and turbidities.
const MITSUBA_PER_MODEL: f64 = 0.009_367_66;

/// The radiance of a clear sky with its sun.
pub(crate) struct SunSky {
    /// Direction to the sun; +z is the zenith.
    sun: DVec3,
    turbidity: f64,
    /// State of the sky model; `None`: the sun is below the horizon.
    state: Option<SkyState>,
}

/// A time and a place on the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SunTime {
    pub(crate) year: f64,
    /// From 1 to 12.
    pub(crate) month: f64,
    /// Day of the month.
    pub(crate) day: f64,
    /// Universal time, in hours.
    pub(crate) universal: f64,
    /// In degrees, north.
    pub(crate) latitude: f64,
    /// In degrees, east.
    pub(crate) longitude: f64,
}

impl SunTime {
    /// Returns the direction to the sun, accurate to about half a degree: +z up, +x south, +y west.
    ///
    /// Source: Meeus, *Astronomical Algorithms*, chapter 25 (low accuracy), without the small terms of the equation of
    /// time.
    pub(crate) fn direction(&self) -> DVec3 {
        let &Self { year, month, day, universal, latitude, longitude } = self;
        // Days since noon of 1 January 2000.
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
        DVec3::new(south, west, up)
    }
}

impl SunSky {
    /// Makes a sky.
    ///
    /// - `sun`: direction to the sun, unit length; +z is the zenith.
    /// - `turbidity`: from 1, very clear, to 10, hazy.
    /// - `albedo`: reflectance of the ground.
    pub(crate) fn new(sun: DVec3, turbidity: f64, albedo: Spectrum) -> Self {
        let elevation = sun.z.clamp(0.0, 1.0).asin() as f32;
        let params = SkyParams { elevation, turbidity: turbidity as f32, albedo: albedo.to_array() };
        let state = if sun.z >= 0.0 { SkyState::new(&params).ok() } else { None };
        Self { sun, turbidity, state }
    }

    /// Returns the radiance of the sky; black below the horizon.
    fn radiance(&self, direction: DVec3) -> DVec3 {
        let Some(state) = self.state.as_ref().filter(|_| direction.z >= 0.0) else { return DVec3::ZERO };
        let theta = direction.z.clamp(0.0, 1.0).acos() as f32;
        let gamma = direction.dot(self.sun).clamp(-1.0, 1.0).acos() as f32;
        let [r, g, b] = [Channel::R, Channel::G, Channel::B].map(|channel| state.radiance(theta, gamma, channel));
        Vec3::new(r, g, b).as_dvec3().max(DVec3::ZERO) * MITSUBA_PER_MODEL
    }

    /// Returns the radiance of the sun's disk at its true size.
    fn sun_radiance(&self) -> DVec3 {
        if self.sun.z <= 0.0 {
            return DVec3::ZERO;
        }
        let table: Vec<Vec<f64>> = include_str!("sun.txt")
            .lines()
            .filter(|line| !line.starts_with('#'))
            .map(|line| line.split(' ').filter_map(|number| number.parse().ok()).collect())
            .collect();
        let steps = (table.first().map_or(0, Vec::len) / 3).saturating_sub(1);
        // Interpolate between four entries.
        let at = (self.sun.z.min(1.0).asin() / FRAC_PI_2).cbrt() * steps as f64;
        let (column, row) =
            ((at as usize).min(steps.saturating_sub(1)), ((self.turbidity - 1.0) as usize).min(table.len() - 2));
        let (dx, dy) = (at - column as f64, self.turbidity - 1.0 - row as f64);
        let entry = |row: usize, column: usize| DVec3::from_slice(&table[row][3 * column..]);
        let between = |row: usize| entry(row, column).lerp(entry(row, column + 1), dx);
        between(row).lerp(between(row + 1), dy)
    }

    /// Renders the latitude-longitude picture of an environment.
    ///
    /// - `sky_from_picture`: space of the picture to that of the sky.
    /// - `sky_scale`, `sun_scale`: factors of their radiances.
    /// - `aperture`: angular diameter of the sun, in degrees.
    pub(crate) fn image(&self, sky_from_picture: &DMat3, sky_scale: f64, sun_scale: f64, aperture: f64) -> Image {
        // A sun of another size emits the same light.
        let size = |aperture: f64| 1.0 - (0.5 * aperture.to_radians()).cos();
        let sun = self.sun_radiance() * (sun_scale * size(SUN_APERTURE) / size(aperture));
        let cos_sun = (0.5 * aperture.to_radians()).cos();
        // Supersample texels near the sun, and preserve its total light.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sky_and_sun_are_those_of_mitsuba() {
        // Mitsuba 3.9's sunsky: elevation of a sun towards +y, turbidity, direction, radiance.
        let skies = [
            (45.0f64, 3.0, DVec3::new(0.0, -1.0, 1.0), [0.0247031, 0.0484970, 0.0993946]),
            (20.0, 3.0, DVec3::new(-0.9, 0.2, 0.2), [0.0646161, 0.0990592, 0.1315213]),
            (5.0, 6.0, DVec3::Z, [0.0084098, 0.0134601, 0.0192218]),
        ];
        for (elevation, turbidity, direction, expected) in skies {
            let sky = at(elevation, turbidity);
            let ratio = sky.radiance(direction.normalize()) / DVec3::from_array(expected);
            assert!((ratio - 1.0).abs().max_element() < 1e-3, "{elevation} {turbidity}: {ratio}");
        }
        let suns = [
            (45.0, 3.0, [21369.2, 17551.5, 12928.0]),
            (10.0, 5.0, [10672.7, 6303.7, 2301.4]),
            (60.0, 8.5, [17331.7, 14158.9, 11048.1]),
        ];
        for (elevation, turbidity, expected) in suns {
            let ratio = at(elevation, turbidity).sun_radiance() / DVec3::from_array(expected);
            assert!((ratio - 1.0).abs().max_element() < 0.02, "{elevation} {turbidity}: {ratio}");
        }
        assert!(at(45.0, 3.0).radiance(DVec3::NEG_Z) == DVec3::ZERO);
        assert!(at(-1.0, 3.0).radiance(DVec3::Z) == DVec3::ZERO && at(-1.0, 3.0).sun_radiance() == DVec3::ZERO);
    }

    fn at(elevation: f64, turbidity: f64) -> SunSky {
        let (sin, cos) = elevation.to_radians().sin_cos();
        SunSky::new(DVec3::new(0.0, cos, sin), turbidity, Spectrum::splat(0.3))
    }

    #[test]
    fn the_sun_keeps_its_light_whatever_the_texels_are() {
        let sky = SunSky::new(DVec3::new(0.3, 0.2, 0.6).normalize(), 3.0, Spectrum::ZERO);
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
