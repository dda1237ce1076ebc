//! Layers of the first surface, of direct and indirect light, and Cryptomattes.

use bottega_image::{Aov, AovSet, Layout, Rect, Tile, identity};
use bottega_render::{
    AgentUse, Filter, PathSettings, PhotonSettings, RenderOutput, RenderWork, WaveWork,
    integrator::{Wave, WaveAnswers},
};
use bottega_scene::{AlphaMode, Environment, Material, Medium, Scene, Surface};
use glam::{Vec2, Vec3};

use crate::render::{
    media::smoke,
    motion::moving_scene,
    photon_scenes::{by_photons, few, many_things},
    scenes::{Subject, add_quad, add_sphere, camera, cornell, matte, prepare},
};

/// Renders a picture with some layers.
fn paint(scene: &Subject, (width, height): (u32, u32), spp: u32, settings: PathSettings, aovs: &[Aov]) -> Tile {
    let layout = Layout::new(aovs.iter().copied().collect::<AovSet>());
    let tile = Tile::new(Rect::of_size(width, height), layout);
    scene.block(&scene.view((width, height)), settings, tile, 0..spp).perform().expect("a picture").tile
}

/// Mean of a layer at a pixel.
fn mean(tile: &Tile, aov: Aov, x: u32, y: u32) -> Vec<f32> {
    let start = tile.layout().offset(aov).expect("a layer of the picture");
    let sums = tile.pixel(x, y);
    sums[start..start + aov.channel_count()].iter().map(|sum| sum / sums[Layout::SAMPLE_COUNT]).collect()
}

fn color(tile: &Tile, x: u32, y: u32) -> Vec3 {
    let sums = tile.pixel(x, y);
    Vec3::new(sums[0], sums[1], sums[2]) / sums[Layout::SAMPLE_COUNT]
}

/// Coverage of a part at a pixel.
fn coverage(tile: &Tile, aov: Aov, name: &str, x: u32, y: u32) -> f32 {
    let ranks = mean(tile, aov, x, y);
    // A mean divides identities, too; they are taken from the sums
    let sums = &tile.pixel(x, y)[tile.layout().offset(aov).expect("a layer")..];
    let pairs = ranks.as_chunks::<2>().0.iter().zip(sums.as_chunks::<2>().0);
    pairs.filter(|(_, [id, _])| id.to_bits() == identity(name).to_bits()).map(|([_, coverage], _)| coverage).sum()
}

/// Sum of the coverages of all parts at a pixel.
fn covered(tile: &Tile, aov: Aov, x: u32, y: u32) -> f32 {
    mean(tile, aov, x, y).as_chunks::<2>().0.iter().map(|[_, coverage]| coverage).sum()
}

/// The smoke of the tests of media.
fn smoky() -> Scene {
    smoke(Medium { scattering: Vec3::splat(0.8), g: 0.3, ..Medium::absorbing(Vec3::ZERO) })
}

/// Cornell's box with a veil and a sky.
fn veiled() -> Scene {
    let mut scene = cornell();
    let veil = Material { alpha_mode: AlphaMode::Blend, opacity: 0.4.into(), ..matte(Vec3::splat(0.5)) };
    add_quad(&mut scene, Vec3::new(-0.5, -0.5, 0.8), Vec3::X, Vec3::Y, veil);
    scene
}

#[test]
fn direct_and_indirect_light_sum_to_the_picture() {
    let progressive = PhotonSettings { progressive: true, ..few() };
    let subjects = [
        ("veil", veiled(), PathSettings::default()),
        ("smoke", smoky(), PathSettings::default()),
        ("motion", moving_scene(), PathSettings::default()),
        ("photons", many_things(), by_photons(few(), 1, 8)),
        ("progressive", many_things(), by_photons(progressive, 1, 8)),
        ("clamped", cornell(), PathSettings { sample_max: 0.5, ..PathSettings::default() }),
    ];
    for (name, scene, settings) in subjects {
        let scene = prepare(scene);
        let tile = paint(&scene, (16, 12), 8, settings, &[Aov::Direct, Aov::Indirect]);
        let plain = paint(&scene, (16, 12), 8, settings, &[]);
        let mut total = [Vec3::ZERO; 2];
        for (x, y) in tile.rect().pixels() {
            // The layers change nothing in the picture
            assert_eq!(tile.pixel(x, y)[..6], *plain.pixel(x, y), "{name} {x} {y}");
            let parts = [Aov::Direct, Aov::Indirect].map(|aov| Vec3::from_slice(&mean(&tile, aov, x, y)));
            let (sum, whole) = (parts[0] + parts[1], color(&tile, x, y));
            assert!((sum - whole).abs().max_element() <= 1e-5 * whole.max_element().max(1.0), "{name}: {sum} {whole}");
            assert!(parts.iter().all(|light| light.min_element() >= -1e-5), "{name} {x} {y}: {parts:?}");
            total = [total[0] + parts[0], total[1] + parts[1]];
        }
        assert!(total.iter().all(|light| light.max_element() > 0.0), "{name}: {total:?}");
    }
}

#[test]
fn direct_light_is_the_picture_of_paths_that_scatter_once() {
    let settings = PathSettings { max_depth: 5, ..PathSettings::default() };
    for (name, scene) in [("veil", veiled()), ("motion", moving_scene())] {
        let scene = prepare(scene);
        let tile = paint(&scene, (16, 12), 8, settings, &[Aov::Direct]);
        let once = paint(&scene, (16, 12), 8, PathSettings { max_depth: 1, ..settings }, &[]);
        for (x, y) in tile.rect().pixels() {
            let (direct, expected) = (Vec3::from_slice(&mean(&tile, Aov::Direct, x, y)), color(&once, x, y));
            let error = (direct - expected).abs().max_element();
            assert!(error <= 1e-5 * expected.max_element().max(1.0), "{name} {x} {y}: {direct} {expected}");
        }
    }
    // In smoke, paths that end sooner pass it without a random decision: only the means are equal
    let scene = prepare(smoky());
    let tile = paint(&scene, (16, 12), 256, settings, &[Aov::Direct]);
    let once = paint(&scene, (16, 12), 256, PathSettings { max_depth: 1, ..settings }, &[]);
    let sums = tile.rect().pixels().fold([Vec3::ZERO; 2], |sums, (x, y)| {
        [sums[0] + Vec3::from_slice(&mean(&tile, Aov::Direct, x, y)), sums[1] + color(&once, x, y)]
    });
    let ratio = sums[0] / sums[1];
    assert!((ratio - 1.0).abs().max_element() < 0.01, "{ratio}");
}

#[test]
fn agents_that_split_paths_split_direct_and_indirect_light_alike() {
    const SIDE: u32 = 128;
    let scene = prepare(cornell());
    let agents = AgentUse { roulette: true, shadows: true, lights: true };
    let settings = PathSettings { agents, planned_samples: 64, ..PathSettings::default() };
    let tile = paint(&scene, (SIDE, SIDE), 2, settings, &[Aov::Direct, Aov::Indirect]);
    let once = paint(&scene, (SIDE, SIDE), 8, PathSettings { max_depth: 1, ..PathSettings::default() }, &[]);
    let mut sums = [Vec3::ZERO; 2];
    for (x, y) in tile.rect().pixels() {
        let parts = [Aov::Direct, Aov::Indirect].map(|aov| Vec3::from_slice(&mean(&tile, aov, x, y)));
        let (sum, whole) = (parts[0] + parts[1], color(&tile, x, y));
        assert!((sum - whole).abs().max_element() <= 1e-5 * whole.max_element().max(1.0), "{sum} {whole}");
        sums = [sums[0] + parts[0], sums[1] + color(&once, x, y)];
    }
    let ratio = sums[0] / sums[1];
    assert!((ratio - 1.0).abs().max_element() < 0.03, "{ratio}");
}

#[test]
fn the_first_surface_is_where_the_camera_looks() {
    // A tilted square that fills the picture, seen from behind, with texture coordinates but without a texture
    let mut scene = Scene { cameras: vec![camera(Vec3::Z * 4.0, Vec3::ZERO, 0.4)], ..Scene::default() };
    let (corner, u, v) = (Vec3::new(-5.0, -5.0, 1.0), Vec3::new(10.0, 0.0, -1.0), Vec3::Y * 10.0);
    add_quad(&mut scene, corner, v, u, matte(Vec3::splat(0.5)));
    scene.meshes[0].uvs[0] = vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X];
    let aovs = [Aov::Position, Aov::GeometricNormal, Aov::Uv, Aov::Depth];
    let tile = paint(&prepare(scene), (9, 9), 16, PathSettings::default(), &aovs);
    let normal = u.cross(v).normalize();
    for (x, y) in tile.rect().pixels() {
        let p = Vec3::from_slice(&mean(&tile, Aov::Position, x, y));
        assert!((p - corner).dot(normal).abs() < 1e-4, "{p} is not on the surface");
        let found = Vec3::from_slice(&mean(&tile, Aov::GeometricNormal, x, y));
        assert!((found - normal).length() < 1e-5, "{found} {normal}");
        let uv = mean(&tile, Aov::Uv, x, y);
        assert!((corner + u * uv[0] + v * uv[1] - p).length() < 1e-4, "{uv:?} {p}");
        // The mean of the distances is that to the mean position, but for the curvature within a pixel
        let distance = (Vec3::Z * 4.0 - p).length();
        assert!((mean(&tile, Aov::Depth, x, y)[0] / distance - 1.0).abs() < 1e-3, "{distance}");
    }
    let middle = Vec3::from_slice(&mean(&tile, Aov::Position, 4, 4));
    assert!((middle - Vec3::Z * 0.5).length() < 0.05, "{middle}");
}

#[test]
fn the_matte_of_an_object_is_the_picture_of_that_object_in_white() {
    for filter in [Filter::PIXEL, Filter::BlackmanHarris { radius: 1.5 }] {
        // A white ball of the name `ball` before black squares, all unlit: its picture is its mask
        let unlit =
            |value: f32| Material { name: format!("gray {value}"), ..Surface::Unlit(Vec3::splat(value).into()).into() };
        let mut scene = Scene { cameras: vec![camera(Vec3::Z * 4.0, Vec3::ZERO, 0.6)], ..Scene::default() };
        add_sphere(&mut scene, Vec3::new(0.2, 0.1, 0.0), 0.7, unlit(1.0));
        add_quad(&mut scene, Vec3::new(-0.9, -0.9, -1.0), Vec3::X * 1.3, Vec3::Y * 1.7, unlit(0.0));
        let half = Material { alpha_mode: AlphaMode::Blend, opacity: 0.5.into(), ..unlit(0.0) };
        add_quad(&mut scene, Vec3::new(0.0, 0.0, 1.0), Vec3::X, Vec3::Y, half);
        scene.meshes[0].name = "back".to_owned();
        let settings = PathSettings { filter, ..PathSettings::default() };
        let mut aovs = Aov::MATTES.to_vec();
        aovs.push(Aov::Uv);
        let tile = paint(&prepare(scene), (24, 24), 32, settings, &aovs);
        let mut edges = 0;
        for (x, y) in tile.rect().pixels() {
            let ball = coverage(&tile, Aov::CryptoObject, "sphere.0", x, y);
            let white = color(&tile, x, y).x;
            assert!((ball - white).abs() < 1e-6, "{x} {y}: {ball} {white}");
            edges += u32::from(ball > 0.01 && ball < 0.99);
            // Materials and assets divide it in the same way here, and all that is covered is named
            assert_eq!(coverage(&tile, Aov::CryptoMaterial, "gray 1", x, y), ball);
            assert_eq!(coverage(&tile, Aov::CryptoAsset, "sphere.0", x, y), ball);
            let alpha = tile.pixel(x, y)[Layout::ALPHA] / 32.0;
            let all = covered(&tile, Aov::CryptoObject, x, y);
            assert!((all - alpha).abs() < 1e-5 && all < 1.0 + 1e-5, "{all} {alpha}");
        }
        assert!(edges > 20, "{edges}");
    }
}

#[test]
fn an_edge_covers_its_share_of_a_pixel() {
    // Parallel rays: a square ends at 0.3 of the second pixel
    let mut scene = Scene { cameras: vec![camera(Vec3::Z * 4.0, Vec3::ZERO, 0.5)], ..Scene::default() };
    scene.cameras[0].projection = bottega_scene::Projection::Orthographic { height: 1.0 };
    add_quad(&mut scene, Vec3::new(-9.0, -9.0, 0.0), Vec3::X * (9.0 - 0.2), Vec3::Y * 18.0, matte(Vec3::splat(0.5)));
    let settings = PathSettings { filter: Filter::PIXEL, ..PathSettings::default() };
    let tile = paint(&prepare(scene), (4, 1), 1024, settings, &[Aov::CryptoObject]);
    // The picture is 4 wide; x = −0.2 is at 1.8 pixels
    for (x, expected) in [1.0, 0.8, 0.0, 0.0].into_iter().enumerate() {
        let found = coverage(&tile, Aov::CryptoObject, "mesh.0", x as u32, 0);
        assert!((found - expected).abs() < 4e-3, "{x}: {found} {expected}");
    }
}

#[test]
fn the_first_surface_is_that_of_the_alpha_whatever_follows_the_path() {
    // Moving things, media and photons
    let clear = many_things();
    for (name, scene, settings) in [
        ("motion", moving_scene(), PathSettings::default()),
        ("photons", clear, by_photons(few(), 1, 4)),
        ("veil", Scene { environment: Some(Environment::uniform(Vec3::ONE)), ..veiled() }, PathSettings::default()),
    ] {
        let aovs = [Aov::CryptoObject, Aov::Position, Aov::GeometricNormal];
        let tile = paint(&prepare(scene), (16, 12), 8, PathSettings { filter: Filter::PIXEL, ..settings }, &aovs);
        for (x, y) in tile.rect().pixels() {
            let alpha = tile.pixel(x, y)[Layout::ALPHA] / 8.0;
            let all = covered(&tile, Aov::CryptoObject, x, y);
            assert!((all - alpha).abs() < 1e-5, "{name} {x} {y}: {all} {alpha}");
            assert!(Vec3::from_slice(&mean(&tile, Aov::GeometricNormal, x, y)).length() <= 1.0 + 1e-5);
        }
    }
}

#[test]
fn a_wave_makes_the_layers_of_paths() {
    let scene = prepare(cornell());
    let view = scene.view((12, 9));
    let aovs: Vec<Aov> = Aov::ALL.into_iter().filter(|&aov| aov != Aov::Cost).collect();
    let expected = paint(&scene, (12, 9), 4, PathSettings::default(), &aovs);
    let mut tile = Tile::new(expected.rect(), expected.layout().clone());
    let mut wave = Wave::of_block(tile.rect(), &(0..4));
    let mut answers = WaveAnswers::default();
    loop {
        let work = WaveWork {
            scene: scene.scene.clone(),
            prepass: scene.prepass.clone(),
            view: view.clone(),
            settings: PathSettings::default().into(),
            layout: tile.layout().clone(),
            wave,
            answers,
        };
        wave = work.perform().expect("a picture");
        if wave.is_over() {
            break;
        }
        let trace = |rays: RenderWork| match rays.perform() {
            RenderOutput::Hits(hits) => WaveAnswers { hits, ..WaveAnswers::default() },
            RenderOutput::Occlusion(occluded) => WaveAnswers { occluded, ..WaveAnswers::default() },
            other => panic!("{other:?}"),
        };
        let hits = trace(RenderWork::Rays { scene: scene.scene.clone(), rays: wave.rays().clone() }).hits;
        let shadows = RenderWork::Occlusion { scene: scene.scene.clone(), rays: wave.shadow_rays().clone() };
        answers = WaveAnswers { hits, occluded: trace(shadows).occluded };
    }
    wave.add_to(&mut tile);
    assert_eq!(tile, expected);
}
