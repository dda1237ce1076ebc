//! Scenes whose radiance is known in closed form.

use std::f32::consts::PI;

use crate::render::scenes::{add_mesh, add_quad, add_sphere, camera, color, glass, lamp, matte, paint, prepare};
use bottega_image::{Aov, AovSet, Layout, Rect, Tile};
use bottega_render::{DirectLight, Filter, PathSettings, View};
use bottega_scene::{
    AlphaMode, Environment, Image, ImageId, Layered, Light, LightKind, Material, Medium, Scene, SpotFalloff, Surface,
};
use glam::{Mat3, Vec3, Vec4};

/// A matte floor of albedo ½ at y = 0 and a camera that looks straight down at its origin.
pub(crate) fn floor() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 4.0, 0.0), Vec3::ZERO, 0.001)], ..Scene::default() };
    add_quad(&mut scene, Vec3::new(-50.0, 0.0, -50.0), Vec3::Z * 100.0, Vec3::X * 100.0, matte(Vec3::splat(0.5)));
    scene
}

/// Irradiance at the origin of the floor under direct light alone.
pub(crate) fn irradiance(scene: Scene, direct_light: DirectLight) -> f32 {
    let settings = PathSettings { max_depth: 1, direct_light, ..PathSettings::default() };
    let tile = paint(&prepare(scene), (1, 1), 4096, settings);
    color(&tile, 0, 0).x * PI / 0.5
}

/// A prism with a vertical edge of 30°, entered at a right angle, and a sky that shines within half a degree of the direction in which the colour
/// of that index of refraction leaves it.
fn prism(material: Material, index: f32) -> Vec3 {
    const COLUMNS: u32 = 720;
    let apex = PI / 6.0;
    let deviation = (index * apex.sin()).asin() - apex;
    let texel = |i: u32| {
        // The middle column is −z; the other columns are to the right of it by the angle around +y.
        let angle = ((i % COLUMNS) as f32 + 0.5) / COLUMNS as f32 * 2.0 * PI - PI;
        [f32::from(u8::from((angle - deviation).abs() < 0.5_f32.to_radians())); 3]
    };
    let sky = Image::from_linear_rgb("sky", COLUMNS, 2, (0..COLUMNS * 2).map(texel).collect());
    let mut scene = Scene {
        cameras: vec![camera(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 1e-4)],
        images: vec![sky].into(),
        environment: Some(Environment::picture(ImageId(0), Vec3::ONE, Mat3::IDENTITY)),
        ..Scene::default()
    };
    // Seen from above: the base to the right, the face away from the camera leans towards it on the left.
    let (left, near, far) = (-1.0, 2.0, 2.0 - 3.0 * apex.tan());
    let corners = [(left, near), (2.0, near), (2.0, far)];
    let positions = [-1.0, 1.0].into_iter().flat_map(|y| corners.map(|(x, z)| Vec3::new(x, y, z))).collect();
    let triangles = vec![[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]];
    add_mesh(&mut scene, positions, triangles, material);
    let settings = PathSettings { max_depth: 8, ..PathSettings::default() };
    color(&paint(&prepare(scene), (1, 1), 16384, settings), 0, 0)
}

/// Share of unpolarized light that a boundary transmits from inside, at an angle whose sine inside is ½.
fn through(index: f32) -> f32 {
    let (inside, outside) = (0.75_f32.sqrt(), (1.0 - 0.25 * index * index).sqrt());
    let s = (index * inside - outside) / (index * inside + outside);
    let p = (inside - index * outside) / (inside + index * outside);
    let entered = 1.0 - ((index - 1.0) / (index + 1.0)).powi(2);
    entered * (1.0 - 0.5 * (s * s + p * p))
}

#[test]
fn a_prism_bends_blue_more_than_red() {
    let glass = |dispersion: f32| -> Material {
        Layered { dispersion, roughness: 0.0.into(), transmission: 1.0.into(), ..Layered::default() }.into()
    };
    // KHR_materials_dispersion: the indices are apart by (n − 1) · 0.025 · dispersion on either side.
    let indices = [1.45, 1.5, 1.55];
    for (channel, index) in indices.into_iter().enumerate() {
        let found = prism(glass(4.0), index);
        for other in 0..3 {
            if other == channel {
                assert!((found[other] - through(index)).abs() < 0.05, "{channel}: {found}, {}", through(index));
            } else {
                assert!(found[other] < 0.01, "{channel}: {found}");
            }
        }
        // Without dispersion all colours are refracted like green.
        let found = prism(glass(0.0), index);
        let expected = if index == 1.5 { through(index) } else { 0.0 };
        assert!((found - expected).abs().max_element() < 0.03, "{channel}: {found}, {expected}");
    }
}

pub(crate) fn assert_near(found: f32, exact: f32, tolerance: f32) {
    assert!((found / exact - 1.0).abs() < tolerance, "found {found}, exact {exact}");
}

/// Every strategy for direct light.
pub(crate) const ALL: [DirectLight; 3] = [DirectLight::Combined, DirectLight::LightSampling, DirectLight::BsdfSampling];

#[test]
fn a_point_light_gives_intensity_over_squared_distance() {
    let mut scene = floor();
    let kind = LightKind::Point { position: Vec3::new(3.0, 4.0, 0.0), intensity: Vec3::splat(10.0) };
    scene.lights.push(Light::new("", kind));
    // I cos θ / d², cos θ = 4/5, d = 5.
    assert_near(irradiance(scene, DirectLight::Combined), 10.0 * 0.8 / 25.0, 1e-3);
}

#[test]
fn each_ray_tests_each_side_of_a_half_transparent_ball_again() {
    let mut scene = floor();
    let veil = Material { alpha_mode: AlphaMode::Blend, opacity: 0.4.into(), ..matte(Vec3::ZERO) };
    add_sphere(&mut scene, Vec3::new(0.0, 2.0, 0.0), 0.5, veil);
    let kind = LightKind::Point { position: Vec3::new(0.0, 4.0, 0.0), intensity: Vec3::splat(10.0) };
    scene.lights.push(Light::new("", kind));
    // The ray of the camera passes two walls, and so does the shadow ray.
    let passing = 0.6_f32.powi(4);
    // Four standard errors of 4096 samples with this share of passing ones.
    let tolerance = 4.0 * ((1.0 - passing) / passing / 4096.0).sqrt();
    assert_near(irradiance(scene, DirectLight::Combined), passing * 10.0 / 16.0, tolerance);
}

#[test]
fn several_lights_add_up() {
    let mut scene = floor();
    for (x, watts) in [(3.0, 10.0), (-3.0, 2.0), (0.0, 0.5)] {
        let kind = LightKind::Point { position: Vec3::new(x, 4.0, 0.0), intensity: Vec3::splat(watts) };
        scene.lights.push(Light::new("", kind));
    }
    let kind =
        LightKind::Directional { direction: Vec3::new(0.6, -0.8, 0.0), irradiance: Vec3::splat(0.3), angle: 0.0 };
    scene.lights.push(Light::new("", kind));
    let exact = 12.0 * 0.8 / 25.0 + 0.5 / 16.0 + 0.3 * 0.8;
    assert_near(irradiance(scene, DirectLight::Combined), exact, 0.01);
}

#[test]
fn a_spot_lights_its_cone_alone() {
    let spot = |direction: Vec3| {
        let mut scene = floor();
        let position = Vec3::new(3.0, 4.0, 0.0);
        let intensity = Vec3::splat(10.0);
        let kind = LightKind::Spot {
            position,
            direction,
            intensity,
            cos_inner: 0.9,
            cos_outer: 0.8,
            falloff: SpotFalloff::SquaredCosine,
        };
        scene.lights.push(Light::new("", kind));
        irradiance(scene, DirectLight::Combined)
    };
    assert_near(spot(Vec3::new(-0.6, -0.8, 0.0)), 10.0 * 0.8 / 25.0, 1e-3);
    assert_eq!(spot(Vec3::new(0.6, -0.8, 0.0)), 0.0);
}

#[test]
fn a_sphere_overhead_gives_pi_l_sin_squared() {
    for (height, radius) in [(2.0, 0.5), (2.0, 1.9), (3.0, 0.01)] {
        let exact = PI * 3.0 * (radius / height) * (radius / height);
        for direct_light in ALL {
            if direct_light == DirectLight::BsdfSampling && radius < 0.1 {
                continue; // a needle in a haystack
            }
            let mut scene = floor();
            scene.cameras[0] = camera(Vec3::new(3.0, 0.05, 0.0), Vec3::ZERO, 0.001);
            add_sphere(&mut scene, Vec3::new(0.0, height, 0.0), radius, lamp(Vec3::splat(3.0)));
            // Some 250 of 4096 directions hit the lamp: their number is accurate to a few percent.
            let tolerance = if direct_light == DirectLight::BsdfSampling { 0.04 } else { 0.02 };
            assert_near(irradiance(scene, direct_light), exact, tolerance);
        }
    }
}

#[test]
fn a_square_overhead_gives_its_configuration_factor() {
    // From a small surface to a parallel square of half side a at height h, above its center: four times the factor
    // of a corner (Howell, catalog of configuration factors, B-3).
    for (half, height) in [(0.5_f32, 2.0_f32), (2.0, 0.5), (0.05, 3.0)] {
        let x = half / height;
        let root = (1.0 + x * x).sqrt();
        let factor = 4.0 / (2.0 * PI) * 2.0 * (x / root) * (x / root).atan();
        for direct_light in ALL {
            if direct_light == DirectLight::BsdfSampling && half < 0.1 {
                continue;
            }
            let mut scene = floor();
            scene.cameras[0] = camera(Vec3::new(3.0, 0.4, 0.0), Vec3::ZERO, 0.001);
            let corner = Vec3::new(-half, height, -half);
            let light = Material::emitter(Vec3::splat(3.0));
            add_quad(&mut scene, corner, Vec3::X * (2.0 * half), Vec3::Z * (2.0 * half), light);
            assert_near(irradiance(scene, direct_light), PI * 3.0 * factor, 0.02);
        }
    }
}

#[test]
fn the_back_of_a_one_sided_lamp_is_dark() {
    let mut scene = floor();
    scene.cameras[0] = camera(Vec3::new(3.0, 0.4, 0.0), Vec3::ZERO, 0.001);
    let light = Material::emitter(Vec3::splat(3.0));
    add_quad(&mut scene, Vec3::new(-1.0, 1.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, light);
    assert_eq!(irradiance(scene, DirectLight::Combined), 0.0);
}

#[test]
fn a_uniform_sky_gives_pi_times_its_radiance() {
    for direct_light in ALL {
        let mut scene = floor();
        scene.environment = Some(Environment::uniform(Vec3::splat(0.7)));
        assert_near(irradiance(scene, direct_light), PI * 0.7, 0.01);
    }
}

#[test]
fn a_sun_in_a_picture_shines_from_its_place() {
    // One bright texel straight below the upper pole's row.
    let (width, height) = (64_u32, 32_u32);
    let texels = (0..width * height).map(|i| if i / width == 4 && i % width == 20 { [1000.0; 3] } else { [0.0; 3] });
    let image = Image::from_linear_rgb("sun", width, height, texels.collect());
    let by = |direct_light| {
        let mut scene = floor();
        scene.images.push(image.clone());
        scene.environment = Some(Environment::picture(ImageId(0), Vec3::ONE, Mat3::from_rotation_y(1.0)));
        irradiance(scene, direct_light)
    };
    // A bilinear peak integrates to one texel: L · cos θ · sin θ dθ dφ.
    let theta = PI * 4.5 / 32.0;
    let exact = 1000.0 * theta.cos() * theta.sin() * (PI / 32.0) * (2.0 * PI / 64.0);
    assert_near(by(DirectLight::LightSampling), exact, 0.02);
    assert_near(by(DirectLight::Combined), exact, 0.02);
}

#[test]
fn depth_counts_bounces() {
    let mut scene = floor();
    let kind = LightKind::Point { position: Vec3::new(0.0, 2.0, 0.0), intensity: Vec3::ONE };
    scene.lights.push(Light::new("", kind));
    add_sphere(&mut scene, Vec3::new(0.0, 0.0, 0.3), 0.1, lamp(Vec3::ONE));
    let scene = prepare(scene);
    let at_depth =
        |max_depth| color(&paint(&scene, (1, 1), 16, PathSettings { max_depth, ..PathSettings::default() }), 0, 0).x;
    assert_eq!(at_depth(0), 0.0);
    assert!(at_depth(1) > 0.0);
}

#[test]
fn emission_seen_directly_needs_no_bounce() {
    let mut scene = floor();
    add_sphere(&mut scene, Vec3::ZERO, 1.0, lamp(Vec3::new(1.0, 2.0, 3.0)));
    let settings = PathSettings { max_depth: 0, ..PathSettings::default() };
    assert_eq!(color(&paint(&prepare(scene), (1, 1), 4, settings), 0, 0), Vec3::new(1.0, 2.0, 3.0));
}

#[test]
fn a_half_transparent_lamp_shines_half_as_much() {
    let by = |alpha_mode, alpha: f32, direct_light| {
        let mut scene = floor();
        scene.cameras[0] = camera(Vec3::new(3.0, 0.4, 0.0), Vec3::ZERO, 0.001);
        let light = Material { alpha_mode, opacity: alpha.into(), ..lamp(Vec3::splat(3.0)) };
        add_quad(&mut scene, Vec3::new(-1.0, 1.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, light);
        irradiance(scene, direct_light)
    };
    for direct_light in ALL {
        let full = by(AlphaMode::Opaque, 0.5, direct_light);
        assert_near(by(AlphaMode::Blend, 0.5, direct_light), 0.5 * full, 0.04);
        assert_eq!(by(AlphaMode::Mask { cutoff: 0.6 }, 0.5, direct_light), 0.0);
        assert_near(by(AlphaMode::Mask { cutoff: 0.4 }, 0.5, direct_light), full, 0.02);
    }
}

#[test]
fn a_half_transparent_blind_lets_half_the_light_through() {
    let mut scene = floor();
    let kind = LightKind::Point { position: Vec3::new(3.0, 4.0, 0.0), intensity: Vec3::splat(10.0) };
    scene.lights.push(Light::new("", kind));
    let blind = Material { alpha_mode: AlphaMode::Blend, opacity: 0.5.into(), ..matte(Vec3::ZERO) };
    add_quad(&mut scene, Vec3::new(1.0, 2.0, -1.0), Vec3::X * 2.0, Vec3::Z * 2.0, blind);
    assert_near(irradiance(scene, DirectLight::Combined), 0.5 * 10.0 * 0.8 / 25.0, 0.03);
}

#[test]
fn a_solid_absorbs_by_the_length_of_the_way() {
    // Through the middle of a slab that absorbs and does not refract, in front of a white sky.
    let mut scene = Scene {
        cameras: vec![camera(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 0.001)],
        environment: Some(Environment::uniform(Vec3::ONE)),
        ..Scene::default()
    };
    let tinted = Layered { ior: 1.0, roughness: 0.0.into(), transmission: 1.0.into(), ..Layered::default() };
    let medium = scene.push_medium(Medium::absorbing(Vec3::new(2.0f32.ln() / 2.0, 4.0f32.ln() / 2.0, 0.0)));
    let tinted = Material { interior: Some(medium), ..tinted.into() };
    add_sphere(&mut scene, Vec3::ZERO, 1.0, tinted);
    let settings = PathSettings { filter: Filter::PIXEL, ..PathSettings::default() };
    let found = color(&paint(&prepare(scene), (1, 1), 64, settings), 0, 0);
    assert!((found - Vec3::new(0.5, 0.25, 1.0)).abs().max_element() < 5e-3, "{found}");
}

#[test]
fn unlit_surfaces_show_their_color_and_light_up_nothing_by_light_sampling() {
    let mut scene = floor();
    scene.materials[0] = Surface::Unlit(Vec3::new(0.2, 0.4, 0.6).into()).into();
    let tile = paint(&prepare(scene), (1, 1), 4, PathSettings::default());
    assert!((color(&tile, 0, 0) - Vec3::new(0.2, 0.4, 0.6)).length() < 1e-6);
    // Vertex colours above 1 do not raise a base colour above white.
    let mut scene = floor();
    scene.materials[0] = Surface::Unlit(Vec3::new(0.2, 0.4, 0.6).into()).into();
    scene.meshes[0].colors = vec![Vec4::new(2.0, 2.0, 2.0, 1.0); scene.meshes[0].positions.len()];
    let tile = paint(&prepare(scene), (1, 1), 4, PathSettings::default());
    assert!((color(&tile, 0, 0) - Vec3::new(0.4, 0.8, 1.0)).length() < 1e-6);
}

#[test]
fn other_values_tell_of_the_first_surface() {
    let mut scene = floor();
    add_sphere(&mut scene, Vec3::new(0.0, 2.0, 0.0), 0.5, glass());
    let aovs: AovSet = Aov::ALL.into_iter().collect();
    let layout = Layout::new(aovs);
    let tile = Tile::new(Rect::of_size(1, 1), layout.clone());
    let settings = PathSettings { filter: Filter::PIXEL, ..PathSettings::default() };
    let scene = prepare(scene);
    let tile = scene.block(&scene.view((1, 1)), settings, tile, 0..256).perform().unwrap().tile;
    let mean = |aov, channel: usize| tile.pixel(0, 0)[layout.offset(aov).unwrap() + channel] / 256.0;
    assert!((mean(Aov::Depth, 0) - 1.5).abs() < 1e-3);
    assert!((mean(Aov::Normal, 1) - 1.0).abs() < 1e-3);
    // The floor is seen through the glass, except for some 8 % that are reflected into the dark.
    assert!((mean(Aov::Albedo, 0) - 0.5 * 0.92).abs() < 0.03, "{}", mean(Aov::Albedo, 0));
    assert!(mean(Aov::Cost, 0) > 10.0);
}

#[test]
fn wrong_views_are_refused() {
    let scene = prepare(floor());
    let tile = || Tile::new(Rect::of_size(1, 1), Layout::new(AovSet::NONE));
    assert!(View::of_scene(scene.scene.scene(), 1, 1, 1).is_err());
    assert!(scene.block(&scene.view((0, 1)), PathSettings::default(), tile(), 0..1).perform().is_err());
}

#[test]
fn scenes_without_sound_surfaces_are_painted_all_the_same() {
    let mut scene = Scene { cameras: vec![camera(Vec3::Z * 3.0, Vec3::ZERO, 1.0)], ..Scene::default() };
    let black = paint(&prepare(scene.clone()), (4, 4), 4, PathSettings::default());
    assert!(black.sums().iter().all(|sum| *sum == 0.0 || *sum == 4.0));
    // An emitting triangle without area.
    add_mesh(&mut scene, vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0], vec![[0, 1, 2]], lamp(Vec3::ONE));
    add_quad(&mut scene, Vec3::new(-1.0, -1.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0, matte(Vec3::ONE));
    let tile = paint(&prepare(scene), (4, 4), 16, PathSettings::default());
    assert!(tile.sums().iter().all(|sum| sum.is_finite()));
}
