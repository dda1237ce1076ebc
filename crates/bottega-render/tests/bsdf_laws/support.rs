//! Materials, directions and random numbers for the tests.

use bottega_render::bsdf::{Bsdf, SurfaceParams, SurfacePoint, scattering};
use bottega_scene::{Material, Scene, Spectrum};
use glam::Vec3;
use proptest::prelude::*;

/// A stream of uniform numbers in [0, 1): PCG (O'Neill 2014), 24 bits of its output.
pub(crate) struct Uniform(u64);

impl Uniform {
    pub(crate) fn new(seed: u64) -> Self {
        let mut stream = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x853c_49e6_748f_ea9b);
        stream.next();
        stream
    }

    pub(crate) fn next(&mut self) -> f32 {
        let state = self.0;
        self.0 = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = ((((state >> 18) ^ state) >> 27) as u32).rotate_right((state >> 59) as u32);
        (word >> 8) as f32 / 16_777_216.0
    }

    pub(crate) fn pair(&mut self) -> [f32; 2] {
        [self.next(), self.next()]
    }

    pub(crate) fn color(&mut self) -> Spectrum {
        Spectrum::new(self.next(), self.next(), self.next())
    }

    /// 0 or 1 with probability 1/4 each, else anything between.
    fn often_extreme(&mut self) -> f32 {
        let x = self.next();
        (2.0 * x - 0.5).clamp(0.0, 1.0)
    }

    /// Any material.
    pub(crate) fn material(&mut self) -> SurfaceParams {
        SurfaceParams {
            base_color: if self.next() < 0.5 { Spectrum::ONE } else { self.color() },
            metallic: self.often_extreme(),
            roughness: self.often_extreme(),
            anisotropy: if self.next() < 0.7 { 0.0 } else { self.next() },
            ior: 1.0 + 2.0 * self.next() * self.next(),
            dispersion: 0.0,
            specular: self.often_extreme(),
            specular_color: if self.next() < 0.5 { Spectrum::ONE } else { 1.5 * self.color() },
            transmission: self.often_extreme(),
            diffuse_transmission: if self.next() < 0.7 { 0.0 } else { self.next() },
            diffuse_transmission_color: self.color(),
            thin: self.next() < 0.3,
            iridescence: if self.next() < 0.7 { 0.0 } else { self.next() },
            iridescence_ior: 1.0 + self.next(),
            iridescence_thickness: 1000.0 * self.next(),
            coat: self.often_extreme(),
            coat_roughness: self.often_extreme(),
            coat_normal: if self.next() < 0.5 { Vec3::Z } else { at(0.6 + 0.4 * self.next(), 6.0 * self.next()) },
            sheen_color: if self.next() < 0.5 { Spectrum::ZERO } else { self.color() },
            sheen_roughness: self.often_extreme(),
            front: self.next() < 0.6,
        }
    }
}

/// The scattering of an untextured material.
pub(crate) fn bsdf_of(material: &Material, front: bool) -> Bsdf<'static> {
    // It may refer to the material
    let material = Box::leak(Box::new(material.clone()));
    scattering(&Scene::default(), material, &SurfacePoint::plain(front))
}

/// The direction at cosine `cos` to the normal, in the plane at azimuth `phi`.
pub(crate) fn at(cos: f32, phi: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
}

/// Any material, for `proptest`.
pub(crate) fn materials() -> impl Strategy<Value = SurfaceParams> {
    any::<u32>().prop_map(|seed| Uniform::new(u64::from(seed)).material())
}

/// A direction of the upper hemisphere not nearer to the horizon than `cos_min`.
pub(crate) fn directions(cos_min: f32) -> impl Strategy<Value = Vec3> {
    (cos_min..1.0, 0.0..std::f32::consts::TAU).prop_map(|(cos, phi)| at(cos, phi))
}

/// The same point of the surface, seen from the other side.
pub(crate) fn turned_over(params: &SurfaceParams) -> SurfaceParams {
    let n = params.coat_normal;
    SurfaceParams { front: !params.front, coat_normal: Vec3::new(-n.x, -n.y, n.z), ..*params }
}
