//! From a scene's material to the scattering at one point of it.

use bottega_scene::{
    ColorParam, Conductor, Facets, Layered, Material, RoughnessScale, ScalarParam, Scene, Spectrum, Surface,
};
use glam::{Vec2, Vec3, Vec4};

use super::{Bsdf, SurfaceParams};

/// What the lookup of a material needs to know of a point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Both sets of texture coordinates.
    pub uvs: [Vec2; 2],
    /// Width of texture lookups in texture coordinates, 0 for sharp ones.
    pub footprint: f32,
    /// Multiplies the base colour; white where a mesh has none.
    pub vertex_color: Vec4,
    /// Whether wo is on the front side.
    pub front: bool,
    /// Normal of the coat in the local frame, above the surface; +z: that of the base.
    pub coat_normal: Vec3,
    /// A number in [0, 1) that chooses between blended surfaces.
    pub chance: f32,
}

impl SurfacePoint {
    /// A point of an untextured surface.
    pub fn plain(front: bool) -> Self {
        Self { uvs: [Vec2::ZERO; 2], footprint: 0.0, vertex_color: Vec4::ONE, front, coat_normal: Vec3::Z, chance: 0.0 }
    }

    fn color(&self, scene: &Scene, param: &ColorParam) -> Spectrum {
        param.eval(scene, self.uvs, self.footprint)
    }

    fn scalar(&self, scene: &Scene, param: &ScalarParam) -> f32 {
        param.eval(scene, self.uvs, self.footprint)
    }
}

/// The scattering of `material` at a point.
pub fn scattering(scene: &Scene, material: &Material, point: &SurfacePoint) -> Bsdf {
    match material.surface_of(point.front) {
        Some(surface) => of_surface(scene, surface, point),
        None => Bsdf::new(&SurfaceParams::BLACK),
    }
}

fn of_surface(scene: &Scene, surface: &Surface, point: &SurfacePoint) -> Bsdf {
    let tint = point.vertex_color.truncate();
    let params = match surface {
        Surface::Null | Surface::Unlit(_) => SurfaceParams::BLACK,
        Surface::Layered(layered) => of_layered(scene, layered, point),
        Surface::Diffuse(diffuse) => matte(point.color(scene, &diffuse.reflectance) * tint, point),
        Surface::DiffuseTransmission { reflectance, .. } => matte(point.color(scene, reflectance) * tint, point),
        Surface::Conductor(conductor) => of_conductor(scene, conductor, point),
        Surface::Dielectric(dielectric) => SurfaceParams {
            base_color: point.color(scene, &dielectric.transmittance),
            roughness: perceptual_roughness(scene, &dielectric.facets, point),
            ior: dielectric.eta,
            transmission: 1.0,
            thin: dielectric.thin,
            front: point.front,
            ..SurfaceParams::default()
        },
        Surface::Plastic(plastic) => SurfaceParams {
            base_color: point.color(scene, &plastic.diffuse) * tint,
            roughness: perceptual_roughness(scene, &plastic.facets, point),
            ior: plastic.eta,
            front: point.front,
            ..SurfaceParams::default()
        },
        Surface::Coated(coated) => match &coated.base {
            bottega_scene::CoatedBase::Diffuse(diffuse) => SurfaceParams {
                base_color: point.color(scene, &diffuse.reflectance) * tint,
                roughness: perceptual_roughness(scene, &coated.facets, point),
                ior: coated.eta,
                front: point.front,
                ..SurfaceParams::default()
            },
            bottega_scene::CoatedBase::Conductor(conductor) => of_conductor(scene, conductor, point),
        },
        Surface::Principled(principled) => SurfaceParams {
            base_color: point.color(scene, &principled.base_color) * tint,
            metallic: point.scalar(scene, &principled.metallic),
            roughness: point.scalar(scene, &principled.roughness),
            ior: principled.eta,
            transmission: point.scalar(scene, &principled.spec_trans),
            thin: principled.thin,
            front: point.front,
            ..SurfaceParams::default()
        },
        Surface::Blend { weight, surfaces } => {
            let weight = point.scalar(scene, weight).clamp(0.0, 1.0);
            // The chosen part's share of the number is a number for the next choice.
            let is_second = point.chance < weight;
            let chance = if is_second { point.chance / weight } else { (point.chance - weight) / (1.0 - weight) };
            let point = SurfacePoint { chance, ..*point };
            return of_surface(scene, &surfaces[usize::from(is_second)], &point);
        }
    };
    Bsdf::new(&params)
}

fn matte(color: Spectrum, point: &SurfacePoint) -> SurfaceParams {
    SurfaceParams { base_color: color, specular: 0.0, front: point.front, ..SurfaceParams::default() }
}

fn of_conductor(scene: &Scene, conductor: &Conductor, point: &SurfacePoint) -> SurfaceParams {
    let (eta, k) = (point.color(scene, &conductor.eta), point.color(scene, &conductor.k));
    // Reflectance at normal incidence; 1 for the perfect mirror.
    let (a, b) = (eta - Spectrum::ONE, eta + Spectrum::ONE);
    let mirror =
        if eta == Spectrum::ZERO && k == Spectrum::ZERO { Spectrum::ONE } else { (a * a + k * k) / (b * b + k * k) };
    SurfaceParams {
        base_color: mirror * point.color(scene, &conductor.reflectance),
        metallic: 1.0,
        roughness: perceptual_roughness(scene, &conductor.facets, point),
        front: point.front,
        ..SurfaceParams::default()
    }
}

/// The roughness whose square is the geometric mean of both α.
fn perceptual_roughness(scene: &Scene, facets: &Facets, point: &SurfacePoint) -> f32 {
    let [u, v] = [0, 1].map(|axis| {
        let roughness = point.scalar(scene, &facets.roughness[axis]).max(0.0);
        match facets.scale {
            RoughnessScale::Alpha => roughness,
            RoughnessScale::SquareRoot => roughness.sqrt(),
            RoughnessScale::Square => roughness * roughness,
        }
    });
    (u * v).sqrt().sqrt()
}

/// Looks up the textures, but for normal maps, which take a frame: see [`frame`](super::frame).
fn of_layered(scene: &Scene, layered: &Layered, point: &SurfacePoint) -> SurfaceParams {
    let color = |param: &ColorParam| point.color(scene, param);
    let scalar = |param: &ScalarParam| point.scalar(scene, param);
    SurfaceParams {
        base_color: color(&layered.base_color) * point.vertex_color.truncate(),
        metallic: scalar(&layered.metallic),
        roughness: scalar(&layered.roughness),
        ior: layered.ior,
        specular: scalar(&layered.specular),
        specular_color: color(&layered.specular_color),
        transmission: scalar(&layered.transmission),
        thin: layered.thin,
        coat: scalar(&layered.coat),
        coat_roughness: scalar(&layered.coat_roughness),
        coat_normal: point.coat_normal,
        sheen_color: color(&layered.sheen_color),
        sheen_roughness: scalar(&layered.sheen_roughness),
        front: point.front,
    }
}

#[cfg(test)]
mod tests {
    use bottega_scene::{Channel, Image, ImageId, TextureMap};

    use super::*;

    fn picture(uv_set: u8) -> TextureMap {
        TextureMap { uv_set, smooth: false, ..TextureMap::new(ImageId(0)) }
    }

    #[test]
    fn textures_and_vertex_colours_multiply_the_factors() {
        let texels = vec![[1.0, 0.5, 0.25], [0.0, 0.5, 1.0]];
        let scene = Scene { images: vec![Image::from_linear_rgb("two", 2, 1, texels)], ..Scene::default() };
        let layered = Layered {
            base_color: ColorParam { factor: Spectrum::new(0.5, 1.0, 1.0), texture: Some(picture(0)) },
            roughness: ScalarParam { factor: 0.5, texture: Some((picture(1), Channel::G)) },
            metallic: 1.0.into(),
            thin: true,
            ..Layered::default()
        };
        let uvs = [Vec2::new(0.25, 0.5), Vec2::new(0.75, 0.5)];
        let vertex_color = Vec4::new(1.0, 1.0, 0.5, 0.3);
        let point = SurfacePoint { uvs, vertex_color, ..SurfacePoint::plain(false) };
        let params = of_layered(&scene, &layered, &point);
        assert!((params.base_color - Spectrum::new(0.5, 0.5, 0.125)).length() < 1e-3, "{}", params.base_color);
        assert!((params.roughness - 0.25).abs() < 1e-3, "{}", params.roughness);
        assert!(params.metallic == 1.0 && params.thin && !params.front);
    }

    #[test]
    fn an_unlit_material_scatters_nothing() {
        let material = Surface::Unlit(Spectrum::ONE.into()).into();
        assert!(scattering(&Scene::default(), &material, &SurfacePoint::plain(true)).is_black());
    }

    #[test]
    fn a_blend_is_one_of_its_surfaces_as_often_as_its_weight_says() {
        let surfaces = Box::new([Surface::matte(Spectrum::ZERO), Surface::matte(Spectrum::ONE)]);
        let material = Surface::Blend { weight: 0.25.into(), surfaces }.into();
        let is_white = |chance: f32| {
            let point = SurfacePoint { chance, ..SurfacePoint::plain(true) };
            !scattering(&Scene::default(), &material, &point).is_black()
        };
        assert_eq!((0..100).filter(|&i| is_white((i as f32 + 0.5) / 100.0)).count(), 25);
    }
}
