//! Scenes of pbrt against the values that its documentation implies.

use std::{f32::consts::PI, fs};

use bottega_render::{AgentSettings, PathSettings, PhotonSettings};
use bottega_scene::{LoadOptions, Loaded, load};
use glam::Vec3;

use crate::render::scenes::{mean_color, paint, prepare};

/// Loads a scene with these `LoadOptions::strict`, and renders it.
fn mean(text: &str, strict: bool, spp: u32, photons: Option<PhotonSettings>) -> Vec3 {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.pbrt");
    fs::write(&path, text).expect("a scene");
    let options = LoadOptions { strict, ..LoadOptions::default() };
    let Loaded { scene, hints, .. } = load(&path, &options).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let [width, height] = hints.resolution.expect("a size");
    let settings = PathSettings {
        max_depth: hints.max_depth.expect("a depth"),
        filter: hints.filter.expect("a filter"),
        sample_max: hints.sample_max.unwrap_or(f32::INFINITY),
        photons,
        ..PathSettings::default()
    };
    mean_color(&paint(&prepare(scene), (width, height), spp, settings))
}

fn assert_near(what: &str, found: Vec3, expected: Vec3, share: f32) {
    let off = (found / expected - 1.0).abs().max_element();
    assert!(off < share, "{what}: {found} instead of {expected}, {:.1} % off", 100.0 * off);
}

/// A square of 2 by 2 in front of the camera, lit from the camera so that its radiance is its reflectance.
fn front(film: &str, size: u32, what: &str) -> String {
    format!(
        "LookAt 0 0 4 0 0 0 0 1 0
        Camera \"orthographic\" \"float screenwindow\" [-1 1 -1 1]
        Integrator \"path\" \"integer maxdepth\" 5
        PixelFilter \"box\"
        Film {film} \"integer xresolution\" {size} \"integer yresolution\" {size} \"string filename\" \"x.exr\"
        WorldBegin
        LightSource \"distant\" \"point3 from\" [0 0 1] \"point3 to\" [0 0 0] \"rgb L\" [{PI} {PI} {PI}]
        Material \"diffuse\" \"rgb reflectance\" [.5 .5 .5]
        {what}"
    )
}

const SQUARE: &str = "Shape \"bilinearmesh\" \"point3 P\" [-1 -1 0 1 -1 0 -1 1 0 1 1 0]";

#[test]
fn curves_turn_their_width_to_each_ray() {
    let straight = "\"point3 P\" [-1 0 0 -.33333 0 0 .33333 0 0 1 0 0] \"float width\" .2";
    let flat = format!("Shape \"curve\" {straight}");
    let round = format!("Shape \"curve\" \"string type\" \"cylinder\" {straight}");
    let ribbon = format!("Shape \"curve\" \"string type\" \"ribbon\" \"normal N\" [0 0 1 0 0 1] {straight}");
    let cases = [
        ("flat", flat.clone(), 0.05),
        ("named so", flat.replace("\"curve\"", "\"curve\" \"string type\" \"flat\""), 0.05),
        ("from behind", format!("Rotate 180 0 1 0 {flat}"), 0.05),
        ("along another axis", format!("Rotate 37 1 0 0 {flat}"), 0.05),
        ("cylinder", round.clone(), 0.05 * PI / 4.0),
        ("ribbon", ribbon.clone(), 0.05),
        // The width of the square and its irradiance are both half.
        ("turned ribbon", format!("Rotate 60 1 0 0 {ribbon}"), 0.05 * 0.25),
        // The square is foreshortened, and its irradiance is lower.
        ("at a slant", format!("Rotate 60 0 1 0 {flat}"), 0.05 * 0.25),
        ("round at a slant", format!("Rotate 60 0 1 0 {round}"), 0.05 * PI / 4.0 * 0.25),
        ("of two widths", flat.replace("\"float width\" .2", "\"float width0\" .1 \"float width1\" .3"), 0.05),
        ("stretched across", format!("Scale 1 2 1 {flat}"), 0.1),
        ("stretched along", format!("Scale .5 1 1 {flat}"), 0.025),
        ("quadratic", "Shape \"curve\" \"integer degree\" 2 \"point3 P\" [-1 0 0 0 0 0 1 0 0] \"float width\" .2".into(), 0.05),
        (
            "spline",
            "Shape \"curve\" \"string basis\" \"bspline\" \"point3 P\" [-2 0 0 -1 0 0 0 0 0 1 0 0 2 0 0] \"float width\" .2".into(),
            0.05,
        ),
        (
            "quadratic spline",
            "Shape \"curve\" \"string basis\" \"bspline\" \"integer degree\" 2 \"point3 P\" [-1.5 0 0 -.5 0 0 .5 0 0 1.5 0 0] \"float width\" .2".into(),
            0.05,
        ),
        (
            "instances",
            format!("ObjectBegin \"hair\" {flat} ObjectEnd Scale .5 .5 .5 Translate 0 1 0 ObjectInstance \"hair\" Translate 0 -2 0 ObjectInstance \"hair\""),
            0.025,
        ),
    ];
    for (what, curve, expected) in cases {
        let found = mean(&front("\"rgb\"", 40, &curve), true, 4, None);
        assert_near(what, found, Vec3::splat(expected), 0.02);
    }
}

#[test]
fn white_hair_cannot_be_seen_before_a_white_sky() {
    let kinds = [
        ("\"flat\"", 0.3),
        ("\"cylinder\"", 0.3),
        ("\"cylinder\"", 0.6),
        ("\"ribbon\" \"normal N\" [0 0 1 0 1 1]", 0.3),
    ];
    for (kind, beta) in kinds {
        let strand = |i: u32| {
            let (y, z) = (0.12 * i as f32 - 0.7, 0.3 * (i % 4) as f32);
            let points = format!("-1 {y} {z} -.3 {} 0 .3 {} .5 1 {y} {z}", y + 0.4, y - 0.3);
            format!("Shape \"curve\" \"string type\" {kind} \"float width\" .15 \"point3 P\" [{points}]\n")
        };
        let text = format!(
            "LookAt 0 0 4 0 0 0 0 1 0
            Camera \"orthographic\" \"float screenwindow\" [-1 1 -1 1]
            Integrator \"path\" \"integer maxdepth\" 200
            Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 24 \"string filename\" \"x.exr\"
            WorldBegin
            LightSource \"infinite\" \"rgb L\" [1 1 1]
            Material \"hair\" \"rgb sigma_a\" [0 0 0] \"float beta_m\" {beta} \"float beta_n\" {beta}
            {}",
            (0..12).map(strand).collect::<String>()
        );
        assert_near(kind, mean(&text, true, 32, None), Vec3::ONE, 0.01);
    }
}

#[test]
fn bent_curves_are_as_long_as_they_are() {
    // A quarter of a circle of radius 1 and width 0.2, by Bézier's approximation.
    let arc = "\"point3 P\" [.8 -.2 0 .8 .3523 0 .3523 .8 0 -.2 .8 0] \"float width\" .2";
    let area = 0.5 * PI * 0.2 / 4.0;
    for (kind, share) in [("flat", 1.0), ("cylinder", PI / 4.0)] {
        let curve = format!("Shape \"curve\" \"string type\" \"{kind}\" {arc}");
        assert_near(kind, mean(&front("\"rgb\"", 40, &curve), true, 4, None), Vec3::splat(0.5 * area * share), 0.02);
    }
}

#[test]
fn curves_cast_their_shadows() {
    // A lamp behind the camera, a curve in front of a wall: the shadow on the wall has the area that the curve hides.
    let wall = "AttributeBegin Translate 0 0 -1 Shape \"bilinearmesh\" \"point3 P\" [-3 -3 0 3 -3 0 -3 3 0 3 3 0] AttributeEnd";
    let curve = "Material \"diffuse\" \"rgb reflectance\" [0 0 0]
        Shape \"curve\" \"point3 P\" [-1 0 0 -.33333 0 0 .33333 0 0 1 0 0] \"float width\" .2";
    let text =
        front("\"rgb\"", 40, &format!("{wall} {curve}")).replace("[0 0 1] \"point3 to\"", "[0 1 1] \"point3 to\"");
    // Lit at 45°: the shadow lies one unit below the curve, and is √2 times as wide as the curve seen from the light.
    let lit = 0.5 * 0.5_f32.sqrt();
    let expected = lit * (1.0 - 0.1 - 0.1 * 2.0_f32.sqrt());
    let half = text.replace("[-1 1 -1 1]", "[-1 1 -1.5 .5]");
    assert_near("shadow", mean(&half, true, 4, None), Vec3::splat(expected), 0.01);
}

#[test]
fn samples_are_limited_by_the_film() {
    let square = SQUARE.replace("Shape", "Material \"diffuse\" \"rgb reflectance\" [.8 .4 .2] Shape");
    let clamped = |film: &str| front(&format!("{film} \"float maxcomponentvalue\" .2"), 4, &square);
    let expected = Vec3::new(0.2, 0.1, 0.05);
    assert_near("rgb", mean(&clamped("\"rgb\""), true, 4, None), expected, 1e-4);
    for film in ["\"gbuffer\"", "\"spectral\""] {
        assert_near(film, mean(&clamped(film), false, 4, None), expected, 1e-4);
    }
    let photons = PhotonSettings { count: 1000, ..PhotonSettings::default() };
    assert_near("photons", mean(&clamped("\"rgb\""), true, 4, Some(photons)), expected, 1e-4);
    let progressive = PhotonSettings { progressive: true, ..photons };
    assert_near("progressive", mean(&clamped("\"rgb\""), true, 4, Some(progressive)), expected, 1e-4);
    let loose = front("\"rgb\" \"float maxcomponentvalue\" .9", 4, &square);
    assert_near("loose", mean(&loose, true, 4, None), Vec3::new(0.8, 0.4, 0.2), 1e-4);
}

#[test]
fn missing_maps_of_normals_are_flat() {
    let square =
        format!("Material \"diffuse\" \"rgb reflectance\" [.5 .5 .5] \"string normalmap\" \"no.png\" {SQUARE}");
    assert_near("flat", mean(&front("\"rgb\"", 4, &square), false, 4, None), Vec3::splat(0.5), 1e-3);
}

/// A ball on a ground under a lamp that the camera does not see.
fn under(lamp: &str) -> String {
    format!(
        "LookAt 0 3 8 0 0.5 0 0 1 0
        Camera \"perspective\" \"float fov\" 40
        PixelFilter \"box\"
        Film \"rgb\" \"integer xresolution\" 24 \"integer yresolution\" 18 \"string filename\" \"x.exr\"
        WorldBegin
        AttributeBegin
        Material \"diffuse\" \"rgb reflectance\" [.6 .6 .6]
        Shape \"bilinearmesh\" \"point3 P\" [-4 0 4 4 0 4 -4 0 -4 4 0 -4]
        Material \"diffuse\" \"rgb reflectance\" [.7 .2 .1]
        Translate 0 1 0
        Shape \"sphere\"
        AttributeEnd
        AttributeBegin
        AreaLightSource \"diffuse\" \"rgb L\" [6 6 6]
        Material \"diffuse\" \"rgb reflectance\" [0 0 0]
        Translate 0 4 1
        Rotate 90 1 0 0
        {lamp}
        AttributeEnd"
    )
}

#[test]
fn absent_lamps_shine_as_present_ones() {
    let right = Vec3::new(0.0676, 0.0572, 0.0552);
    let disk = "Shape \"disk\" \"float radius\" 1";
    let cut = under(&format!("{disk} \"float alpha\" 0"));
    assert_near("path", mean(&cut, true, 48, None), right, 0.02);
    let photons = PhotonSettings { count: 20_000, ..PhotonSettings::default() };
    assert_near("photons", mean(&cut, true, 8, Some(photons)), right, 0.04);
    assert_near(
        "progressive",
        mean(&cut, true, 16, Some(PhotonSettings { progressive: true, ..photons })),
        right,
        0.04,
    );
    let agents = PhotonSettings { agents: Some(AgentSettings { cast: 3000, ..AgentSettings::default() }), ..photons };
    assert_near("agents", mean(&cut, true, 8, Some(agents)), right, 0.04);
    let texture = "Texture \"none\" \"float\" \"constant\" \"float value\" 0";
    let by_texture = cut.replace("WorldBegin", &format!("WorldBegin {texture}"));
    let by_texture = by_texture.replace("\"float alpha\" 0", "\"texture alpha\" \"none\"");
    assert_near("texture", mean(&by_texture, true, 48, None), right, 0.02);
}

#[test]
fn lamps_of_all_shapes_may_be_absent() {
    let shapes = [
        "Shape \"sphere\" \"float radius\" .5",
        "Shape \"bilinearmesh\" \"point3 P\" [-1 -1 0 1 -1 0 -1 1 0 1 1 0]",
        "Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 1 -1 0 1 1 0]",
        "Shape \"cylinder\" \"float radius\" .4 \"float zmin\" -.3 \"float zmax\" .3",
    ];
    for shape in shapes {
        let there = mean(&under(shape), true, 32, None);
        let nowhere = mean(&under(&format!("{shape} \"float alpha\" 0")), true, 32, None);
        assert_near(shape, nowhere, there, 0.03);
    }
}

#[test]
fn absent_lamps_are_invisible_and_occlude_nothing() {
    let light = "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [9 9 9] Translate 0 0 1 Shape \"disk\" \"float radius\" .7 \"float alpha\" 0 AttributeEnd";
    // The light emits towards the camera, away from the square, which is seen through it.
    let found = mean(&front("\"rgb\"", 8, &format!("{light} {SQUARE}")), true, 64, None);
    // An opaque disk would hide 38 % of the square; a visible one would be eighteen times as bright.
    assert_near("through it", found, Vec3::splat(0.5), 0.06);
}
