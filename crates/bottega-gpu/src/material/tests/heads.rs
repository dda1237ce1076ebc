//! Tests of rotated frames, and of a material's properties other than its BSDF.

use bottega_render::bsdf::{LiftedNormal, SurfacePoint, scattering};
use bottega_scene::{
    Anisotropy, Layered, Material, Medium, MediumId, Relief, ReliefRule, ReliefSource, Scene, Sides, Spectrum, Surface,
};
use glam::{Vec2, Vec3};

use super::compare::{CaseTally, RARELY, agree};
use super::device::Bench;
use super::numbers::{Numbers, images};
use crate::material::{EncodedMaterials, Features};

const STRIDE: usize = 32;
const ANSWERS: usize = 32;

const SHADER: &str = "
fn case_f32(at: u32) -> f32 {
    return bitcast<f32>(cases[at]);
}

fn case_vec3(at: u32) -> vec3f {
    return vec3f(case_f32(at), case_f32(at + 1u), case_f32(at + 2u));
}

fn answer_vec3(at: u32, v: vec3f) {
    answers[at] = v.x;
    answers[at + 1u] = v.y;
    answers[at + 2u] = v.z;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x * 32u;
    if c >= arrayLength(&cases) {
        return;
    }
    let a = id.x * 32u;
    let material = cases[c];
    let uv0 = vec2f(case_f32(c + 1u), case_f32(c + 2u));
    let uv1 = vec2f(case_f32(c + 3u), case_f32(c + 4u));
    let footprint = case_f32(c + 5u);
    let relief = material_relief(material);
    let ns = case_vec3(c + 6u);
    let along_u = case_vec3(c + 9u);
    let along_v = case_vec3(c + 12u);
    var normal = ns;
    if relief.kind != RELIEF_NONE {
        let uv = select(uv0, uv1, lookup_uv_set(relief.map) == 1u);
        if relief.kind == RELIEF_NORMALS {
            normal = relief_mapped_normal(relief.map, relief.scale, uv, footprint, ns, vec4f(along_u, case_f32(c + 15u)));
        } else {
            normal = relief_bumped_normal(relief.map, relief.scale, uv, footprint, ns, along_u, along_v);
        }
    }
    answer_vec3(a, normal);
    let way = material_anisotropy_way(material, uv0, uv1, footprint);
    answers[a + 3u] = way.x;
    answers[a + 4u] = way.y;
    answer_vec3(a + 5u, material_unlit(material, uv0, uv1, footprint));
    answer_vec3(a + 8u, material_absorption(material, true));
    answer_vec3(a + 11u, material_absorption(material, false));
    answers[a + 14u] = f32(material_flags(material));
    answers[a + 15u] = select(0.0, 1.0, relief.mitsuba) + select(0.0, 2.0, relief.turns) + select(0.0, 4.0, relief.shadows)
        + select(0.0, 8.0, relief.mirrored);
    var coat = ns;
    let map = material_coat_map(material);
    if map != 0u {
        let uv = select(uv0, uv1, lookup_uv_set(map) == 1u);
        coat = relief_mapped_normal(map, material_coat_scale(material), uv, footprint, ns, vec4f(along_u, case_f32(c + 15u)));
    }
    answer_vec3(a + 16u, coat);
    answers[a + 19u] = lifted_factor(lifted_new(along_u, relief.shadows), along_v);
}
";

/// The position, and the orientation of its coordinates.
struct Case {
    material: usize,
    uvs: [Vec2; 2],
    footprint: f32,
    ns: Vec3,
    along: [Vec3; 2],
    sign: f32,
}

fn material(n: &mut Numbers, images: u32) -> Material {
    let mut layered =
        Layered { coat: n.pick(&[0.0, 1.0]).into(), transmission: n.pick(&[0.0, 1.0]).into(), ..Layered::default() };
    layered.coat_normal = n.chance(0.6).then(|| (n.map(images), n.within(0.2, 2.0)));
    layered.anisotropy = n.chance(0.6).then(|| Anisotropy {
        strength: n.next(),
        rotation: n.within(-3.0, 3.0),
        texture: n.chance(0.6).then(|| n.map(images)),
    });
    let source = if n.chance(0.5) {
        ReliefSource::Normals(n.map(images), n.within(0.2, 2.0))
    } else {
        let channel = n.pick(&[bottega_scene::Channel::R, bottega_scene::Channel::A]);
        ReliefSource::Heights(bottega_scene::ScalarParam {
            factor: n.within(0.001, 0.1),
            texture: Some((n.map(images), channel)),
        })
    };
    let rule = if n.chance(0.5) {
        ReliefRule::Bent
    } else {
        ReliefRule::Mitsuba { turns: n.chance(0.5), shadows: n.chance(0.5), mirrored: n.chance(0.5) }
    };
    Material {
        surface: match n.below(4) {
            0 => Surface::Unlit(n.color_param(images)),
            1 => Surface::Null,
            _ => layered.into(),
        },
        relief: n.chance(0.8).then_some(Relief { source, rule }),
        interior: n.chance(0.5).then_some(MediumId(0)),
        exterior: n.chance(0.3).then_some(MediumId(1)),
        emission: n.pick(&[Spectrum::ZERO, Spectrum::ONE]).into(),
        emission_sides: n.pick(&[Sides::Front, Sides::Back, Sides::Both]),
        ..Material::default()
    }
}

/// The formula of `bottega_render` (`interaction/relief.rs`), which has no function for a single normal.
fn mapped(scene: &Scene, (map, scale): (&bottega_scene::TextureMap, f32), case: &Case) -> Vec3 {
    let (uv, ns) = (case.uvs[usize::from(map.uv_set & 1)], case.ns);
    let texel = scene.images[map.image.0 as usize].eval(map, uv, case.footprint).truncate();
    let bent = (texel * 2.0 - 1.0) * Vec3::new(scale, scale, 1.0);
    let along = (case.along[0] - ns * ns.dot(case.along[0])).normalize();
    (along * bent.x + ns.cross(along) * case.sign * bent.y + ns * bent.z).normalize_or(ns)
}

fn normal(scene: &Scene, case: &Case) -> Vec3 {
    let ns = case.ns;
    match scene.materials[case.material].relief.as_ref().map(|relief| &relief.source) {
        None => ns,
        Some(ReliefSource::Normals(map, scale)) => mapped(scene, (map, *scale), case),
        Some(ReliefSource::Heights(height)) => {
            let (map, channel) = height.texture.as_ref().unwrap();
            let uv = case.uvs[usize::from(map.uv_set & 1)];
            let slopes = scene.images[map.image.0 as usize].slopes(map, uv, case.footprint);
            let lifted = [0, 1]
                .map(|i| case.along[i] + ns * (height.factor * slopes[i][*channel as usize] - ns.dot(case.along[i])));
            let normal = lifted[0].cross(lifted[1]).normalize_or(ns);
            if normal.dot(ns) < 0.0 { -normal } else { normal }
        }
    }
}

fn anisotropy_way(scene: &Scene, anisotropy: Option<&Anisotropy>, case: &Case) -> Vec2 {
    let Some(anisotropy) = anisotropy else { return Vec2::X };
    let way = anisotropy.texture.as_ref().map_or(Vec2::X, |map| {
        let texel = scene.images[map.image.0 as usize].eval(map, case.uvs[usize::from(map.uv_set & 1)], case.footprint);
        (2.0 * Vec2::new(texel.x, texel.y) - 1.0).normalize_or(Vec2::X)
    });
    Vec2::from_angle(anisotropy.rotation).rotate(way)
}

/// The factor of a lifted normal, by a white matte surface.
fn lifted_factor(normal: Vec3, shadows: bool, wi: Vec3) -> f32 {
    let point = SurfacePoint { lifted: Some(LiftedNormal::new(normal, shadows)), ..SurfacePoint::plain(true) };
    let white = Material::matte(Spectrum::ONE);
    scattering(&Scene::default(), &white, &point).eval(Vec3::Z, wi).x * std::f32::consts::PI
}

fn expected(scene: &Scene, case: &Case) -> Vec<f32> {
    let material = &scene.materials[case.material];
    let layered = material.layered();
    let mut all = normal(scene, case).to_array().to_vec();
    all.extend(anisotropy_way(scene, layered.and_then(|it| it.anisotropy.as_ref()), case).to_array());
    let unlit = match &material.surface {
        Surface::Unlit(color) => color.eval(scene, case.uvs, case.footprint),
        _ => Spectrum::ZERO,
    };
    all.extend(unlit.to_array());
    for medium in [material.interior, material.exterior] {
        let medium = medium.filter(|_| material.transmits());
        all.extend(medium.map_or(Spectrum::ZERO, |it| scene.media[it.0 as usize].absorption).to_array());
    }
    let rule = match material.relief.as_ref().map(|relief| relief.rule) {
        Some(ReliefRule::Mitsuba { turns, shadows, mirrored }) => {
            1.0 + 2.0 * f32::from(u8::from(turns))
                + 4.0 * f32::from(u8::from(shadows))
                + 8.0 * f32::from(u8::from(mirrored))
        }
        _ => 0.0,
    };
    all.push(rule);
    let coat = layered.and_then(|it| it.coat_normal.as_ref());
    all.extend(coat.map_or(case.ns, |(map, scale)| mapped(scene, (map, *scale), case)).to_array());
    all
}

#[test]
fn frames_and_heads_are_as_on_the_processor() {
    let Some(bench) = Bench::new(SHADER, Features::ALL) else { return };
    let mut n = Numbers(11);
    let images = images(&mut n);
    let materials: Vec<_> = (0..200).map(|_| material(&mut n, images.len() as u32)).collect();
    let media = [Spectrum::new(0.1, 0.2, 0.3), Spectrum::new(1.0, 2.0, 3.0)].map(Medium::absorbing).to_vec();
    let scene = Scene { images: images.into(), materials, media, ..Scene::default() };
    let encoded = EncodedMaterials::new(&scene, &[]).unwrap();
    let cases: Vec<_> = (0..10_000)
        .map(|index| Case {
            material: index % scene.materials.len(),
            uvs: [0, 1].map(|_| Vec2::new(n.within(-2.0, 2.0), n.within(-2.0, 2.0))),
            footprint: n.pick(&[0.0, 0.01, 0.3]),
            ns: n.direction(),
            along: [n.direction(), n.direction()],
            sign: n.pick(&[1.0, -1.0]),
        })
        .collect();
    let words = cases.iter().flat_map(|case| {
        let mut numbers = vec![case.uvs[0].x, case.uvs[0].y, case.uvs[1].x, case.uvs[1].y, case.footprint];
        numbers.extend([case.ns, case.along[0], case.along[1]].map(|v| v.to_array()).as_flattened());
        numbers.push(case.sign);
        let mut words = vec![case.material as u32];
        words.extend(numbers.iter().map(|number| number.to_bits()));
        words.resize(STRIDE, 0);
        words
    });
    let answers = bench.run(&encoded, &words.collect::<Vec<_>>(), STRIDE, ANSWERS);
    let (mut heads, mut factors) = (CaseTally::default(), CaseTally::default());
    for (case, found) in cases.iter().zip(answers.chunks(ANSWERS)) {
        let same = [&found[..14], &found[15..19]].concat();
        let nudged = || {
            let moved = |step: Vec2| Case { uvs: case.uvs.map(|uv| uv + step), ..*case };
            [1e-6, -1e-6].map(|step| expected(&scene, &moved(Vec2::splat(step)))).to_vec()
        };
        heads.count(agree(&expected(&scene, case), &same, nudged));
        let material = &scene.materials[case.material];
        let flags = found[14] as u32;
        assert_eq!(flags & 2 != 0, material.surface == Surface::Null);
        assert_eq!(flags & 4 != 0, matches!(material.surface, Surface::Unlit(_)));
        assert_eq!(flags & 8 != 0, material.emission.factor.max_element() > 0.0);
        assert_eq!(flags & 16 != 0, material.transmits());
        assert_eq!(flags & 64 != 0, material.needs_tangents());
        assert_eq!(flags & 256 != 0, material.emission_sides.has(true));
        assert_eq!(flags & 512 != 0, material.emission_sides.has(false));
        assert_eq!(flags & 2048 != 0, material.relief.is_some());
        let shadows = found[15] as u32 & 4 != 0;
        if case.along[1].z > 0.0 {
            factors.count(agree(&[lifted_factor(case.along[0], shadows, case.along[1])], &[found[19]], Vec::new));
        }
    }
    eprintln!("heads {heads:?}, factors {factors:?}");
    assert!(heads.is_sound(RARELY) && factors.is_sound(RARELY), "{heads:?} {factors:?}");
}
