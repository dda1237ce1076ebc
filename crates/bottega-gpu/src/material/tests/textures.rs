//! Tests of lookups in images of all formats: values and derivatives.

use bottega_scene::{ColorParam, Material, Scene};
use glam::Vec2;

use super::compare::{CaseTally, RARELY, agree};
use super::device::Bench;
use super::numbers::{Numbers, images};
use crate::material::{EncodedMaterials, Features};

const SHADER: &str = "
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x * 4u;
    if c >= arrayLength(&cases) {
        return;
    }
    let handle = material_words[material_head(cases[c]) + 11u];
    let uv = vec2f(bitcast<f32>(cases[c + 1u]), bitcast<f32>(cases[c + 2u]));
    let footprint = bitcast<f32>(cases[c + 3u]);
    let value = image_eval(handle, uv, footprint);
    let slopes = image_slopes(handle, uv, footprint);
    for (var i = 0u; i < 4u; i++) {
        answers[id.x * 12u + i] = value[i];
        answers[id.x * 12u + 4u + i] = slopes.u[i];
        answers[id.x * 12u + 8u + i] = slopes.v[i];
    }
}
";

#[test]
fn pictures_are_looked_up_as_on_the_processor() {
    let Some(bench) = Bench::new(SHADER, Features::ALL) else { return };
    let mut n = Numbers(7);
    let images = images(&mut n);
    let maps: Vec<_> = (0..300).map(|_| n.map(images.len() as u32)).collect();
    let emits = |map| Material {
        emission: ColorParam { texture: Some(map), ..ColorParam::default() },
        ..Material::matte(bottega_scene::Spectrum::ONE)
    };
    let scene =
        Scene { images: images.into(), materials: maps.iter().copied().map(emits).collect(), ..Scene::default() };
    let encoded = EncodedMaterials::new(&scene, &[]).unwrap();
    let mut cases: Vec<(usize, Vec2, f32)> = Vec::new();
    for index in 0..30_000 {
        let size = n.pick(&[1.0, 3.0, 1000.0]);
        let uv = match n.below(12) {
            // Where texels meet.
            0 => Vec2::new(n.below(33) as f32 / 16.0 - 1.0, n.below(33) as f32 / 16.0 - 1.0),
            1 => Vec2::splat(1e9),
            _ => Vec2::new(n.within(-size, size), n.within(-size, size)),
        };
        let footprint = n.pick(&[0.0, -1.0, 1e20, 2f32.powf(n.0 as f32 / u64::MAX as f32 * 12.0 - 10.0)]);
        cases.push((index % maps.len(), uv, footprint));
    }
    let words =
        cases.iter().flat_map(|&(map, uv, width)| [map as u32, uv.x.to_bits(), uv.y.to_bits(), width.to_bits()]);
    let answers = bench.run(&encoded, &words.collect::<Vec<_>>(), 4, 12);
    let (mut values, mut slopes) = (CaseTally::default(), CaseTally::default());
    for (&(map, uv, footprint), found) in cases.iter().zip(answers.chunks(12)) {
        let map = &maps[map];
        let image = &scene.images[map.image.0 as usize];
        // One unit in the last place of the image coordinate.
        let step = 4e-7 * (1.0 + map.picture_from_uv.transform_point2(uv).abs().max_element());
        let near = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|[x, y]| uv + step * Vec2::new(x, y));
        let value = |uv: Vec2| image.eval(map, uv, footprint).to_array().to_vec();
        let slope = |uv: Vec2| image.slopes(map, uv, footprint).map(|slope| slope.to_array()).as_flattened().to_vec();
        values.count(agree(&value(uv), &found[..4], || near.iter().map(|&uv| value(uv)).collect()));
        slopes.count(agree(&slope(uv), &found[4..], || near.iter().map(|&uv| slope(uv)).collect()));
    }
    eprintln!("values {values:?}, slopes {slopes:?}");
    assert!(values.is_sound(RARELY) && slopes.is_sound(RARELY), "{values:?} {slopes:?}");
}
