//! Light that is scattered below surfaces, against known answers and against paths through the same medium.

use bottega_render::PathSettings;
use bottega_scene::{
    Back, Environment, Layered, Material, Medium, RadiusMeaning, Scene, Spectrum, Substance, Subsurface, Surface,
};
use glam::Vec3;

use crate::render::scenes::{add_mesh, add_quad, add_sphere, camera, color, mean_color, paint, prepare};

fn below(substance: Substance, g: f32, inner_eta: f32) -> Option<Box<Subsurface>> {
    Some(Box::new(Subsurface { weight: 1.0.into(), substance, g, inner_eta }))
}

fn colored(radius: Vec3) -> Substance {
    Substance::Colored { radius: radius.into(), meaning: RadiusMeaning::MeanFreePath }
}

fn before_a_sky(radiance: Vec3) -> Scene {
    Scene {
        cameras: vec![camera(Vec3::new(0.0, 0.0, 2.6), Vec3::ZERO, 0.5)],
        environment: Some(Environment::uniform(radiance)),
        ..Scene::default()
    }
}

#[test]
fn white_wax_below_any_gloss_vanishes_before_a_white_sky() {
    for (roughness, inner_eta) in [(0.0, 1.0), (0.4, 1.5), (1.0, 1.0)] {
        let mut scene = before_a_sky(Vec3::ONE);
        let subsurface = below(colored(Vec3::new(0.4, 0.2, 0.1)), 0.3, inner_eta);
        let wax = Layered { subsurface, roughness: roughness.into(), ..Layered::default() };
        add_sphere(&mut scene, Vec3::ZERO, 1.0, wax.into());
        let mean = mean_color(&paint(&prepare(scene), (8, 8), 512, PathSettings::default()));
        assert!((mean - 1.0).abs().max_element() < 0.015, "{roughness} {inner_eta}: {mean}");
    }
}

#[test]
fn a_thick_substance_reflects_the_base_color() {
    let base = Vec3::new(0.2, 0.5, 0.9);
    for (g, inner_eta) in [(0.0, 1.0), (0.7, 1.0), (0.0, 1.4), (-0.4, 1.4)] {
        let mut scene = before_a_sky(Vec3::ONE);
        let subsurface = below(colored(Vec3::splat(1e-3)), g, inner_eta);
        let wax = Layered { base_color: base.into(), subsurface, specular: 0.0.into(), ..Layered::default() };
        add_sphere(&mut scene, Vec3::ZERO, 1.0, wax.into());
        let mean = mean_color(&paint(&prepare(scene), (8, 8), 256, PathSettings::default()));
        // Van de Hulst's formula has this error
        assert!((mean / base - 1.0).abs().max_element() < 0.02, "{g} {inner_eta}: {mean}");
    }
}

/// A ball and a slab of a substance, lit by a lamp from behind and a sky.
fn lit(material: &Material, medium: Option<Medium>) -> Scene {
    let mut scene = before_a_sky(Vec3::splat(0.2));
    let mut material = material.clone();
    material.interior = medium.map(|medium| scene.push_medium(medium));
    add_sphere(&mut scene, Vec3::new(-0.35, 0.0, 0.0), 0.3, material.clone());
    // A tetrahedron, which has edges
    let corners = vec![Vec3::new(0.0, -0.3, 0.3), Vec3::new(0.7, -0.3, 0.2), Vec3::new(0.4, -0.3, -0.4), Vec3::Y * 0.4];
    add_mesh(&mut scene, corners, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], material);
    add_quad(
        &mut scene,
        Vec3::new(-0.7, 0.9, -1.2),
        Vec3::X,
        Vec3::new(0.0, 0.4, -0.4),
        Material::emitter(Vec3::splat(9.0)),
    );
    scene
}

#[test]
fn a_walk_is_the_path_through_the_same_medium() {
    let (absorption, scattering, g) = (Vec3::new(0.5, 1.0, 3.0), Vec3::new(8.0, 6.0, 3.0), 0.4);
    for inner_eta in [1.0, 1.33] {
        // The walk
        let substance = Substance::Coefficients { absorption: absorption.into(), scattering: scattering.into() };
        let wax = Layered { subsurface: below(substance, g, inner_eta), specular: 0.0.into(), ..Layered::default() };
        let walked = paint(&prepare(lit(&wax.into(), None)), (24, 16), 1024, PathSettings::default());
        // Paths through a medium behind a surface that transmits diffusely, and reflects some light from behind
        let through = |reflectance: f32| Surface::DiffuseTransmission {
            reflectance: Spectrum::splat(reflectance).into(),
            transmittance: Spectrum::splat(1.0 - reflectance).into(),
        };
        let inner = if inner_eta == 1.0 { 0.0 } else { diffuse_inner_reflectance(f64::from(inner_eta)) };
        let back = Back::Other(Box::new(through(inner)));
        let skin = Material { back, ..through(0.0).into() };
        let medium = Medium { scattering, g, ..Medium::absorbing(absorption) };
        let settings = PathSettings { max_depth: 1000, ..PathSettings::default() };
        let traced = paint(&prepare(lit(&skin, Some(medium))), (24, 16), 1024, settings);
        let (walked_mean, traced_mean) = (mean_color(&walked), mean_color(&traced));
        assert!((walked_mean / traced_mean - 1.0).abs().max_element() < 0.005, "{walked_mean} {traced_mean}");
        let differs = |x, y| (color(&walked, x, y) - color(&traced, x, y)).abs().max_element();
        let worst = walked.rect().pixels().map(|(x, y)| differs(x, y)).fold(0.0, f32::max);
        assert!(worst < 0.15, "{inner_eta}: {worst}");
    }
}

/// Light that diffuse light from below a smooth boundary is reflected back, by an integral over the angles below.
fn diffuse_inner_reflectance(eta: f64) -> f32 {
    const STEPS: u32 = 20_000;
    let reflected = |i: u32| {
        let cos2 = (f64::from(i) + 0.5) / f64::from(STEPS);
        let (cos, sin2) = (cos2.sqrt(), eta * eta * (1.0 - cos2));
        if sin2 >= 1.0 {
            return 1.0;
        }
        let beyond = (1.0 - sin2).sqrt();
        let parallel = (cos - eta * beyond) / (cos + eta * beyond);
        let perpendicular = (eta * cos - beyond) / (eta * cos + beyond);
        0.5 * (parallel * parallel + perpendicular * perpendicular)
    };
    ((0..STEPS).map(reflected).sum::<f64>() / f64::from(STEPS)) as f32
}

#[test]
fn light_passes_through_a_thin_edge_and_not_through_a_thick_body() {
    // A lamp behind a plate of wax: what comes through falls with its thickness
    let behind = |thickness: f32| {
        let mut scene = Scene { cameras: vec![camera(Vec3::Z * 4.0, Vec3::ZERO, 0.05)], ..Scene::default() };
        let substance =
            Substance::Coefficients { absorption: Vec3::splat(0.5).into(), scattering: Vec3::splat(5.0).into() };
        let wax: Material = Layered { subsurface: below(substance, 0.0, 1.0), ..Layered::default() }.into();
        let (x, y, half) = (Vec3::X * 4.0, Vec3::Y * 4.0, 0.5 * thickness);
        let corner = Vec3::new(-2.0, -2.0, 0.0);
        add_quad(&mut scene, corner + Vec3::Z * half, x, y, wax.clone());
        add_quad(&mut scene, corner - Vec3::Z * half, y, x, wax);
        add_quad(&mut scene, corner - Vec3::Z * 3.0, x, y, Material::emitter(Vec3::splat(10.0)));
        mean_color(&paint(&prepare(scene), (4, 4), 256, PathSettings::default())).x
    };
    let [thin, middle, thick] = [0.1, 0.5, 2.0].map(behind);
    assert!(thin > 2.0 * middle && middle > 8.0 * thick && thick > 0.0, "{thin} {middle} {thick}");
}

#[test]
fn an_open_mesh_and_absurd_substances_end() {
    let absurd = [
        (colored(Vec3::ZERO), 0.0),
        (colored(Vec3::splat(1e15)), 0.99),
        (Substance::Coefficients { absorption: Vec3::ZERO.into(), scattering: Vec3::splat(1e6).into() }, 0.0),
        (Substance::Coefficients { absorption: Vec3::ZERO.into(), scattering: Vec3::ZERO.into() }, 0.0),
        (Substance::Coefficients { absorption: Vec3::splat(1e15).into(), scattering: Vec3::ZERO.into() }, 0.0),
    ];
    for (substance, g) in absurd {
        let mut scene = before_a_sky(Vec3::ONE);
        let wax = Layered { subsurface: below(substance, g, 1.3), ..Layered::default() };
        add_quad(&mut scene, Vec3::new(-0.5, -0.5, 0.0), Vec3::X, Vec3::Y, wax.into());
        let tile = paint(&prepare(scene), (4, 4), 4, PathSettings::default());
        let mean = mean_color(&tile);
        assert!(mean.is_finite() && mean.max_element() < 1.1, "{mean}");
    }
}

#[test]
fn parts_of_different_materials_are_one_solid() {
    let mut scene = before_a_sky(Vec3::ONE);
    let corners = [Vec3::new(-0.5, -0.4, 0.4), Vec3::new(0.5, -0.4, 0.4), Vec3::new(0.0, -0.4, -0.5), Vec3::Y * 0.5];
    let wax = |roughness: f32| -> Material {
        let subsurface = below(colored(Vec3::splat(0.1)), 0.0, 1.0);
        Layered { subsurface, roughness: roughness.into(), ..Layered::default() }.into()
    };
    // Each mesh alone is open
    add_mesh(&mut scene, corners.to_vec(), vec![[0, 2, 1], [0, 1, 3]], wax(0.3));
    add_mesh(&mut scene, corners.to_vec(), vec![[1, 2, 3], [2, 0, 3]], wax(0.8));
    let mean = mean_color(&paint(&prepare(scene), (8, 8), 128, PathSettings::default()));
    assert!((mean - 1.0).abs().max_element() < 0.01, "{mean}");
}
