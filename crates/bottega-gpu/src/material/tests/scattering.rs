//! Tests of every kind of surface: values, densities, samples and properties.

use bottega_render::bsdf::{BsdfAt, SurfacePoint, scattering};
use bottega_scene::{AlphaMode, Back, Material, Scene, Sides, Spectrum};
use glam::Vec3;

use super::compare::{CaseTally, Match, NUDGE, RARELY, agree};
use super::device::Bench;
use super::kinds::{KINDS, SurfaceKind, WALKED};
use super::numbers::{Numbers, images};
use crate::material::{EncodedMaterials, Features};

const MATERIALS: usize = 120;
const POINTS: usize = 60;

/// The query to the shader.
struct Case {
    material: u32,
    point: SurfacePoint,
    lifted: Option<(Vec3, bool)>,
    wo: Vec3,
    wi: Vec3,
    u: [f32; 3],
    carried: Spectrum,
}

impl Case {
    fn random(n: &mut Numbers, scene: &Scene, material: u32) -> Self {
        let (point, lifted) = n.point();
        let mut case = Self {
            material,
            point,
            lifted,
            wo: if n.chance(0.02) { -n.above() } else { n.above() },
            wi: n.direction(),
            u: [n.next(), n.next(), n.next()],
            carried: if n.chance(0.5) { Spectrum::ONE } else { n.color() + 0.01 },
        };
        // Half of them where the surface itself scatters to, to hit narrow lobes.
        let bsdf = scattering(scene, &scene.materials[material as usize], &case.point);
        if let Some(sample) = bsdf.at_carrying(case.wo, case.carried).sample(n.next(), [n.next(), n.next()])
            && n.chance(0.5)
        {
            case.wi = (sample.wi + 1e-3 * n.direction()).normalize();
        }
        case
    }

    fn words(&self) -> Vec<u32> {
        let point = &self.point;
        let (normal, lifts) = self.lifted.map_or((Vec3::Z, -1.0), |(n, shadows)| (n, f32::from(u8::from(shadows))));
        let mut numbers = vec![point.uvs[0].x, point.uvs[0].y, point.uvs[1].x, point.uvs[1].y];
        numbers.extend([point.footprint, point.chance]);
        numbers.extend(point.vertex_color.to_array());
        let vectors = [point.coat_normal, normal].map(|v| v.to_array());
        numbers.extend(vectors.as_flattened());
        numbers.push(lifts);
        numbers.extend([self.wo, self.wi, self.u.into(), self.carried].map(|v| v.to_array()).as_flattened());
        let mut words = vec![self.material, u32::from(point.front)];
        words.extend(numbers.iter().map(|x| x.to_bits()));
        words.resize(32, 0);
        words
    }

    /// The same query with slightly changed directions and numbers.
    fn nudged(&self, n: &mut Numbers) -> Self {
        let mut turned = |v: Vec3| (v + NUDGE * n.direction()).normalize();
        let (wo, wi) = (turned(self.wo), turned(self.wi));
        let u = self.u.map(|u| (u + NUDGE * n.within(-1.0, 1.0)).clamp(0.0, 0.999_999_9));
        Self { wo, wi, u, ..*self }
    }
}

/// The answers to one case, in the order of the shader.
struct KnownCase {
    /// f and density.
    value: Vec<f32>,
    /// The sampled direction; empty: none.
    way: Vec<f32>,
    /// The expected weight and density.
    weight: Vec<f32>,
    /// The expected relative index of refraction and lobe.
    lobe: [f32; 2],
    albedo: Vec<f32>,
    /// Roughness, and black, delta, transmissive as bits.
    rest: [f32; 2],
}

impl KnownCase {
    fn expected(scene: &Scene, case: &Case) -> Self {
        let material = &scene.materials[case.material as usize];
        let bsdf = scattering(scene, material, &case.point);
        let at: BsdfAt<'_> = bsdf.at_carrying(case.wo, case.carried);
        let (value, pdf) = at.eval_pdf(case.wi);
        let [u_lobe, u, v] = case.u;
        let sample = at.sample(u_lobe, [u, v]);
        let lobe_bits = |lobe: bottega_render::bsdf::LobeFlags| {
            use bottega_render::bsdf::LobeFlags as Flags;
            [Flags::REFLECTION, Flags::TRANSMISSION, Flags::DIFFUSE, Flags::GLOSSY, Flags::DELTA]
                .iter()
                .zip([1.0, 2.0, 4.0, 8.0, 16.0])
                .map(|(&flag, bit)| if lobe.contains(flag) { bit } else { 0.0 })
                .sum()
        };
        let sees = case.wo.z > 0.0;
        let bits = [
            (!sees || bsdf.is_black(), 1.0),
            (sees && bsdf.is_delta_only(), 2.0),
            (sees && bsdf.is_transmissive(), 4.0),
        ];
        Self {
            value: [&value.to_array()[..], &[pdf]].concat(),
            way: sample.map_or(vec![], |sample| sample.wi.to_array().to_vec()),
            weight: sample.map_or(vec![], |sample| [&sample.weight().to_array()[..], &[sample.pdf]].concat()),
            lobe: sample.map_or([1.0, 0.0], |sample| [sample.eta, lobe_bits(sample.lobe)]),
            albedo: bsdf.albedo(case.wo).to_array().to_vec(),
            rest: [if sees { bsdf.roughness() } else { 1.0 }, bits.iter().filter(|bit| bit.0).map(|bit| bit.1).sum()],
        }
    }

    fn of_device(a: &[f32]) -> Self {
        let is_some = a[12] != 0.0;
        let part = |from: usize, to: usize| if is_some { a[from..to].to_vec() } else { vec![] };
        Self {
            value: a[..4].to_vec(),
            way: part(4, 7),
            weight: part(7, 11),
            lobe: [a[11], a[12]],
            albedo: a[13..16].to_vec(),
            rest: [a[16], a[17]],
        }
    }
}

fn material(n: &mut Numbers, make: fn(&mut Numbers, u32) -> bottega_scene::Surface, images: u32) -> Material {
    let back = match n.below(6) {
        0 => Back::Black,
        1 => Back::Other(Box::new(make(n, images))),
        _ => Back::Same,
    };
    Material {
        surface: make(n, images),
        back,
        opacity: n.scalar_param(images, 0.0, 1.0),
        alpha_mode: n.pick(&[AlphaMode::Opaque, AlphaMode::Mask { cutoff: 0.5 }, AlphaMode::Blend]),
        emission: n.color_param(images),
        emission_sides: n.pick(&[Sides::Front, Sides::Back, Sides::Both]),
        ..Material::default()
    }
}

/// A GPU divides to 2.5 units in the last place and takes roots to 3 (Vulkan's "Precision of SPIR-V Instructions"), so it is so
/// many times as often that a last bit decides. (On an H100 0.6 % of blends and an eighth of walks, instead of 0.1 and 3 %.)
const GPU_SLACK: f32 = 8.0;

/// Returns the differences; `None` without a device. The shader has exactly the features of this kind.
fn compare((name, make): SurfaceKind, seed: u64) -> Option<Vec<String>> {
    let mut n = Numbers(seed);
    let images = images(&mut n);
    let count = images.len() as u32;
    let materials = (0..MATERIALS).map(|_| material(&mut n, make, count)).collect();
    let scene = Scene { images: images.into(), materials, ..Scene::default() };
    let encoded = EncodedMaterials::new(&scene, &[]).unwrap();
    let bench = Bench::new(include_str!("probe.wgsl"), encoded.features)?;
    let all = (0..MATERIALS * POINTS).map(|i| (i % MATERIALS) as u32);
    let cases: Vec<_> = all.map(|material| Case::random(&mut n, &scene, material)).collect();
    let words: Vec<u32> = cases.iter().flat_map(Case::words).collect();
    let answers = bench.run(&encoded, &words, 32, 24);
    let labels = [
        "value",
        "sample exists",
        "sample's way",
        "sample's weight",
        "lobe",
        "albedo",
        "queries",
        "opacity",
        "emission",
    ];
    let mut tallies: [CaseTally; 9] = Default::default();
    let mut shown = 0;
    for (case, numbers) in cases.iter().zip(answers.chunks(24)) {
        let (expected, found) = (KnownCase::expected(&scene, case), KnownCase::of_device(numbers));
        let mut near: Option<Vec<KnownCase>> = None;
        let mut nudged = |part: &dyn Fn(&KnownCase) -> Vec<f32>| -> Vec<Vec<f32>> {
            let near =
                near.get_or_insert_with(|| (0..6).map(|_| KnownCase::expected(&scene, &case.nudged(&mut n))).collect());
            near.iter().map(part).collect()
        };
        let material = &scene.materials[case.material as usize];
        let point = &case.point;
        let opacity = material.opacity_at(&scene, point.uvs, point.footprint, point.vertex_color.w);
        let emission = material.emission.eval(&scene, point.uvs, point.footprint);
        let both = !expected.way.is_empty() && !found.way.is_empty();
        let results = [
            Some(agree(&expected.value, &found.value, || nudged(&|it| it.value.clone()))),
            Some(if expected.way.is_empty() == found.way.is_empty() { Match::Close } else { Match::Off }),
            both.then(|| agree(&expected.way, &found.way, || nudged(&|it| it.way.clone()))),
            both.then(|| agree(&expected.weight, &found.weight, || nudged(&|it| it.weight.clone()))),
            both.then(|| agree(&expected.lobe, &found.lobe, Vec::new)),
            Some(agree(&expected.albedo, &found.albedo, || nudged(&|it| it.albedo.clone()))),
            Some(agree(&expected.rest, &found.rest, Vec::new)),
            Some(agree(&[opacity], &[numbers[18]], Vec::new)),
            Some(agree(&emission.to_array(), &numbers[19..22], Vec::new)),
        ];
        for ((result, tally), label) in results.into_iter().zip(&mut tallies).zip(labels) {
            let Some(result) = result else { continue };
            tally.count(result);
            if result == Match::Off && shown < 6 {
                shown += 1;
                eprintln!("{name}, {label}: {:?} {:?} u {:?}", case.wo, case.wi, case.u);
                eprintln!("  value {:?} {:?}", expected.value, found.value);
                eprintln!("  way {:?} {:?}", expected.way, found.way);
                eprintln!("  weight {:?} {:?}", expected.weight, found.weight);
                eprintln!("  lobe {:?} {:?}", expected.lobe, found.lobe);
                eprintln!(
                    "  albedo {:?} {:?} rest {:?} {:?}",
                    expected.albedo, found.albedo, expected.rest, found.rest
                );
                eprintln!("  {:?}", material.surface_of(point.front));
            }
        }
    }
    // A walk's random numbers are made from the last bits of what chose it: now and then it is another one, as likely.
    let walked = |label: &str| name == WALKED && label.contains("sample");
    let share =
        |label: &str| (if walked(label) { 0.03 } else { RARELY }) * if bench.is_software { 1.0 } else { GPU_SLACK };
    let off = |(label, tally): (&&str, &CaseTally)| {
        (!tally.is_sound(share(label))).then(|| format!("{name}, {label}: {tally:?}"))
    };
    let counts: Vec<_> = tallies.iter().map(|tally| (tally.conditioned, tally.off)).collect();
    eprintln!("{name}: {} cases, (conditioned, off) {counts:?}", cases.len());
    Some(labels.iter().zip(&tallies).filter_map(off).collect())
}

#[test]
fn every_kind_scatters_as_on_the_processor() {
    let only = std::env::var("BOTTEGA_KIND").unwrap_or_default();
    let kinds = KINDS.iter().filter(|(name, _)| name.contains(&only));
    let off: Option<Vec<_>> = kinds.zip(1..).map(|(kind, seed)| compare(*kind, seed)).collect();
    let off = off.unwrap_or_default().concat();
    assert!(off.is_empty(), "{off:#?}");
}

/// Walks are drawn from other random numbers where a last bit differs: their means are compared here.
#[test]
fn walks_through_coats_come_to_the_same_on_average() {
    const SAMPLES: usize = 4096;
    let Some(bench) = Bench::new(include_str!("probe.wgsl"), Features::ALL) else { return };
    let mut n = Numbers(5);
    let images = images(&mut n);
    let count = images.len() as u32;
    let &(_, make) = KINDS.iter().find(|(name, _)| *name == WALKED).unwrap();
    let materials: Vec<Material> = (0..24).map(|_| make(&mut n, count).into()).collect();
    let scene = Scene { images: images.into(), materials, ..Scene::default() };
    let encoded = EncodedMaterials::new(&scene, &[]).unwrap();
    for material in 0..scene.materials.len() as u32 {
        let first = Case { lifted: None, ..Case::random(&mut n, &scene, material) };
        let point = SurfacePoint { lifted: None, front: true, ..first.point };
        let wo = first.wo.with_z(first.wo.z.abs());
        let mut case = || Case { wo, point, u: [n.next(), n.next(), n.next()], ..first };
        let cases: Vec<_> = (0..SAMPLES).map(|_| case()).collect();
        let words: Vec<u32> = cases.iter().flat_map(Case::words).collect();
        let answers = bench.run(&encoded, &words, 32, 24);
        let own = cases.iter().map(|case| KnownCase::expected(&scene, case));
        let theirs = answers.chunks(24).map(KnownCase::of_device);
        let weights = |answers: &mut dyn Iterator<Item = KnownCase>| -> Vec<f64> {
            answers.map(|it| it.weight.iter().take(3).map(|&x| f64::from(x)).sum()).collect()
        };
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let (a, b) = (weights(&mut own.into_iter()), weights(&mut theirs.into_iter()));
        let variance = mean(&a.iter().map(|x| (x - mean(&a)).powi(2)).collect::<Vec<_>>());
        let error = (2.0 * variance / SAMPLES as f64).sqrt();
        assert!((mean(&a) - mean(&b)).abs() <= 4.5 * error + 1e-5, "{material}: {} {} ± {error}", mean(&a), mean(&b));
    }
}
