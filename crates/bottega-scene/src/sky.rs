//! The neutral sky for scenes without light.

use glam::{Mat3, Vec3};

use crate::color::Spectrum;
use crate::image::Image;
use crate::light::Environment;
use crate::model::Scene;
use crate::texture::ImageId;

const WIDTH: u32 = 128;
const HEIGHT: u32 = 64;

/// Direction to the sun behind thin cloud: high, to the left, in front of the subject.
const SUN: Vec3 = Vec3::new(-0.48, 0.64, 0.6);

impl Scene {
    /// Replaces the environment with a neutral sky: a gray picture with a soft sun, whose mean radiance is about 1
    /// W·sr⁻¹·m⁻².
    pub fn add_sky(&mut self) {
        self.images.push(image());
        self.environment =
            Some(Environment::picture(ImageId(self.images.len() as u32 - 1), Spectrum::ONE, Mat3::IDENTITY));
    }
}

/// Renders a gray sky, slightly brighter towards the zenith and much brighter towards a soft sun, over a darker ground.
/// Its mean radiance over the sphere is about 1.
fn image() -> Image {
    let texel = |index: u32| {
        let (x, y) = (index % WIDTH, index / WIDTH);
        let direction = direction((x as f64 + 0.5) / f64::from(WIDTH), (y as f64 + 0.5) / f64::from(HEIGHT));
        radiance(direction)
    };
    Image::from_linear_rgb("neutral sky", WIDTH, HEIGHT, (0..WIDTH * HEIGHT).map(texel).collect())
}

/// Returns the direction of a point of a latitude-longitude picture; see [`Environment`].
fn direction(u: f64, v: f64) -> Vec3 {
    let (sin_azimuth, cos_azimuth) = ((u - 0.5) * std::f64::consts::TAU).sin_cos();
    let (sin_polar, cos_polar) = (v * std::f64::consts::PI).sin_cos();
    Vec3::new((sin_polar * sin_azimuth) as f32, cos_polar as f32, (-sin_polar * cos_azimuth) as f32)
}

fn radiance(direction: Vec3) -> [f32; 3] {
    // Blend from ground to sky over a few degrees about the horizon.
    let above = ((direction.y + 0.05) / 0.1).clamp(0.0, 1.0);
    let above = above * above * (3.0 - 2.0 * above);
    let sky = 0.85 + 0.35 * direction.y.max(0.0);
    let ground = 0.45;
    // cos¹⁶: a glow of about 25 degrees.
    let toward_sun = direction.dot(SUN.normalize()).max(0.0);
    let glow = 9.0 * (0..4).fold(toward_sun, |power, _| power * power);
    let gray = ground + (sky - ground) * above;
    let (cool, warm) = (Vec3::new(0.97, 1.0, 1.04), Vec3::new(1.04, 1.0, 0.95));
    (cool * gray + warm * (glow * above)).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_mean_radiance_over_the_sphere_is_about_one() {
        let image = image();
        let (mut sum, mut solid_angle) = (Vec3::ZERO, 0.0);
        for y in 0..HEIGHT {
            let weight = (std::f32::consts::PI * (y as f32 + 0.5) / HEIGHT as f32).sin();
            for x in 0..WIDTH {
                sum += image.texel(x, y).truncate() * weight;
                solid_angle += weight;
            }
        }
        let mean = sum / solid_angle;
        assert!((mean - Vec3::ONE).abs().max_element() < 0.1, "{mean}");
    }

    #[test]
    fn the_centre_column_shows_minus_z_and_u_grows_towards_x() {
        assert!((direction(0.5, 0.5) - Vec3::NEG_Z).length() < 1e-6);
        assert!((direction(0.75, 0.5) - Vec3::X).length() < 1e-6);
        assert!((direction(0.3, 0.0) - Vec3::Y).length() < 1e-6);
    }
}
