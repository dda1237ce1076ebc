//! Tests of unsupported materials, and of encodings at their limits.

use bottega_render::bsdf::{SurfacePoint, scattering};
use bottega_scene::{
    Channel, Coated, CoatedBase, ColorParam, Diffuse, Facets, Image, ImageId, Mapping, MappingKind, Material, Measured,
    Phong, SURFACE_UV_SETS, ScalarParam, Scene, Spectrum, Surface, TextureMap,
};
use glam::{Affine3A, Vec2, Vec3};

use super::device::Bench;
use crate::material::{EncodedMaterials, Features};

/// A clear coat over a matte base, its thickness by the red of an image.
fn coat(facets: Facets, most: f32) -> Surface {
    let map = TextureMap { smooth: false, ..TextureMap::new(ImageId(0)) };
    Surface::Coated(Box::new(Coated {
        eta: 1.5,
        facets,
        thickness: ScalarParam { factor: most, texture: Some((map, Channel::R)) },
        albedo: Spectrum::ZERO.into(),
        g: 0.0.into(),
        max_depth: 20,
        base: CoatedBase::Diffuse(Diffuse { reflectance: Spectrum::new(0.9, 0.5, 0.2).into(), roughness: 0.0.into() }),
    }))
}

fn scene(surface: Surface) -> Scene {
    let texels = [0.0, 1e-5, 3e-4, 0.004, 0.03, 0.2, 0.6, 1.0].map(|share| [share; 3]).to_vec();
    let images = vec![Image::from_linear_rgb("thickness", 8, 1, texels)];
    Scene { images: images.into(), materials: vec![surface.into()], ..Scene::default() }
}

const SHADER: &str = "
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&cases) {
        return;
    }
    var point = surface_point_plain(1u);
    point.uv0 = vec2f(bitcast<f32>(cases[id.x]), 0.5);
    var b = surface_scattering(0u, point, normalize(vec3f(0.3, 0.4, 1.0)), vec3f(1.0));
    let value = bsdf_eval_pdf(&b, normalize(vec3f(0.5, -0.4, 0.3)));
    answers[id.x * 4u] = value.value.x;
    answers[id.x * 4u + 1u] = value.value.y;
    answers[id.x * 4u + 2u] = value.value.z;
    answers[id.x * 4u + 3u] = value.pdf;
}
";

#[test]
fn clear_coats_may_differ_in_thickness_from_place_to_place() {
    let Some(bench) = Bench::new(SHADER, Features::ALL) else { return };
    let (wo, wi) = (Vec3::new(0.3, 0.4, 1.0).normalize(), Vec3::new(0.5, -0.4, 0.3).normalize());
    for (facets, most) in [(Facets::smooth(), 2.0), (Facets::from(0.3), 2.0), (Facets::from(0.3), 40.0)] {
        let scene = scene(coat(facets, most));
        let encoded = EncodedMaterials::new(&scene, &[]).unwrap();
        let places = [0, 1, 2, 3, 4, 5, 6, 7].map(|texel| (texel as f32 + 0.5) / 8.0);
        let answers = bench.run(&encoded, &places.map(f32::to_bits), 1, 4);
        for (u, found) in places.into_iter().zip(answers.chunks(4)) {
            let point = SurfacePoint { uvs: [Vec2::new(u, 0.5); 2], ..SurfacePoint::plain(true) };
            let (value, pdf) = scattering(&scene, &scene.materials[0], &point).eval_pdf(wo, wi);
            // The CPU has thickness in steps of a 64th of an octave, which bounds the precision of its logarithm.
            let near = |a: f32, b: f32| (a - b).abs() < 0.02 * a.max(b) + 1e-5;
            let is_near = (0..3).all(|i| near(value[i], found[i])) && near(pdf, found[3]);
            assert!(is_near, "{most} at {u}: {value} {pdf}, on the device {found:?}");
        }
    }
}

#[test]
fn unsupported_features_are_named() {
    let mut rough = Facets::from(0.3);
    rough.roughness[0].texture = Some((TextureMap::new(ImageId(0)), Channel::G));
    let unsupported = EncodedMaterials::new(&scene(coat(rough, 1.0)), &[]).unwrap_err();
    assert_eq!(unsupported.to_string(), "not for a GPU: clear coats whose thickness and roughness are both textures");
    let unsupported = EncodedMaterials::new(&scene(Surface::Hair(Box::default())), &[]).unwrap_err();
    assert_eq!(unsupported.to_string(), "not for a GPU: hair");
    let white = || Spectrum::ONE.into();
    let phong = Surface::Phong(Phong { diffuse: white(), specular: white(), exponent: 30.0.into() });
    let unsupported = EncodedMaterials::new(&scene(phong), &[]).unwrap_err();
    assert_eq!(unsupported.to_string(), "not for a GPU: highlights of Phong and Ward");
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/models/measured.bsdf");
    let measured = Surface::Measured(Measured::read(file.as_ref(), 1 << 20).unwrap().into());
    let unsupported = EncodedMaterials::new(&scene(measured), &[]).unwrap_err();
    assert_eq!(unsupported.to_string(), "not for a GPU: measured materials");
    let mapping = Mapping { kind: MappingKind::Planar, mapping_from_world: Affine3A::IDENTITY };
    let in_space = TextureMap { uv_set: SURFACE_UV_SETS, ..TextureMap::new(ImageId(0)) };
    let color = ColorParam { factor: Spectrum::ONE, texture: Some(in_space) };
    let scene = Scene { mappings: vec![mapping], ..scene(Surface::Unlit(color)) };
    let unsupported = EncodedMaterials::new(&scene, &[]).unwrap_err();
    assert_eq!(unsupported.to_string(), "not for a GPU: textures mapped by world position");
}

#[test]
fn blends_within_blends_reach_their_last_surface_and_too_deep_ones_are_reported() {
    let Some(bench) = Bench::new(SHADER, Features::ALL) else { return };
    let nested = |depth: u32| {
        (0..depth).fold(Surface::matte(Spectrum::splat(0.5)), |inner, _| Surface::Blend {
            weight: 1.0.into(),
            surfaces: Box::new([Surface::matte(Spectrum::ONE), inner]),
        })
    };
    let scene = |depth| Scene { materials: vec![Material::from(nested(depth))], ..Scene::default() };
    let encoded = EncodedMaterials::new(&scene(64), &[]).unwrap();
    let answers = bench.run(&encoded, &[0.5f32.to_bits()], 1, 4);
    assert!((answers[0] * std::f32::consts::PI - 0.5).abs() < 1e-5, "{answers:?}");
    let unsupported = EncodedMaterials::new(&scene(65), &[]).unwrap_err();
    assert_eq!(unsupported.to_string(), "not for a GPU: more than 64 blends within each other");
}
