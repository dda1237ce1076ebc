//! Scenes for pbrt-v4: what they become, and what is said of those that are wrong.

use std::path::Path;

use crate::mutation::{Random, damage, survive};
use bottega_scene::{
    AlphaMode, CurveLook, FilmFilter, FovAxis, Hair, LightKind, LoadOptions, Loaded, Mesh, Panorama, PhotonHints,
    Pigment, Projection, RadiusMeaning, Scene, SceneError, Sides, Spectrum, Substance, Surface, TransportPaths, Wrap,
    load,
};
use glam::{Vec2, Vec3};

const CORPUS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/pbrt");

/// Loads a scene whose text this is.
fn load_text(text: &str) -> Result<Loaded, SceneError> {
    load_with(text, &LoadOptions::default())
}

fn load_with(text: &str, options: &LoadOptions) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, text).unwrap();
    load(&path, options)
}

/// Loads the text that follows `WorldBegin`, without warnings.
fn world(text: &str) -> Scene {
    let loaded = load_text(&format!("WorldBegin\n{text}")).unwrap();
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    let expected = ["no light", "no surface"];
    assert!(warnings.iter().all(|warning| expected.iter().any(|text| warning.contains(text))), "{warnings:?}");
    loaded.scene
}

/// The side of the first triangle of an instance, in world space.
fn front(scene: &Scene, instance: usize) -> Vec3 {
    let instance = &scene.instances[instance];
    let mesh: &Mesh = &scene.meshes[instance.mesh as usize];
    let [a, b, c] =
        mesh.triangles[0].map(|vertex| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]));
    (b - a).cross(c - a).normalize()
}

const TRIANGLE: &str = r#"Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ]"#;

#[test]
fn the_corpus_becomes_the_scenes_it_describes() {
    let loaded = load(&Path::new(CORPUS).join("box.pbrt"), &LoadOptions::default()).unwrap();
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(warnings, Vec::<String>::new());
    assert_eq!(loaded.hints.resolution, Some([64, 48]));
    assert_eq!(loaded.hints.crop, Some([16, 0, 32, 48]));
    assert_eq!((loaded.hints.samples, loaded.hints.max_depth), (Some(32), Some(9)));
    assert_eq!(loaded.hints.filter, Some(FilmFilter::Gaussian { radius: 2.0, sigma: 0.5 }));
    let scene = &loaded.scene;
    // Two spheres of the object, the glass ball, and the included one.
    assert_eq!((scene.spheres.len(), scene.lights.len(), scene.media.len()), (4, 3, 1));
    assert!((scene.media[0].absorption - Vec3::new(0.2, 0.4, 0.6)).length() < 1e-6);
    // ISO 200 doubles all light.
    let environment = scene.environment.as_ref().unwrap();
    assert!((environment.factor - Spectrum::new(0.2, 0.2, 0.4)).length() < 1e-6);
    let lamp = scene.materials.iter().find(|material| material.is_emissive()).unwrap();
    assert_eq!((lamp.emission.factor, lamp.emission_sides), (Spectrum::splat(10.0), Sides::Both));
    assert!(scene.materials.iter().any(|m| matches!(m.surface, Surface::Blend { .. })));
    assert!(scene.materials.iter().any(|m| m.alpha_mode == AlphaMode::Blend));
    // Reading it again gives the same, bit for bit.
    let again = load(&Path::new(CORPUS).join("box.pbrt"), &LoadOptions::default()).unwrap().scene;
    assert_eq!((&again.meshes, &again.materials, &again.digest), (&scene.meshes, &scene.materials, &scene.digest));
}

#[test]
fn subsurface_materials_have_the_substance_of_the_file() {
    let substance = |params: &str| {
        let scene = world(&format!(r#"Material "subsurface" {params} Shape "sphere""#));
        let layered = scene.materials[scene.spheres[0].material as usize].layered().expect("layers").clone();
        (*layered.subsurface.expect("a substance"), layered.base_color.factor, layered.ior, layered.roughness.factor)
    };
    let coefficients = |params: &str| match substance(params).0.substance {
        Substance::Coefficients { absorption, scattering } => [absorption.factor, scattering.factor],
        other => panic!("{other:?}"),
    };
    // Whole milk by default; named, by coefficients, scaled
    assert_eq!(coefficients(""), [Vec3::new(0.0011, 0.0024, 0.014), Vec3::new(2.55, 3.21, 3.77)]);
    assert_eq!(coefficients(r#""string name" "Wholemilk" "float scale" 2"#)[1], 2.0 * Vec3::new(2.55, 3.21, 3.77));
    let given = r#""rgb sigma_a" [ 1 2 3 ] "rgb sigma_s" [ 4 5 6 ] "float scale" 0.5"#;
    assert_eq!(coefficients(given), [Vec3::new(0.5, 1.0, 1.5), Vec3::new(2.0, 2.5, 3.0)]);
    // By reflectance and mean free path
    let given = r#""rgb reflectance" [ 0.5 0.25 0.125 ] "rgb mfp" [ 1 2 4 ] "float eta" 1.5 "float g" 0.5 "float roughness" 0.0081"#;
    let (below, color, ior, roughness) = substance(given);
    let Substance::Colored { radius, meaning } = below.substance else { panic!("{below:?}") };
    assert_eq!((radius.factor, meaning), (Vec3::new(1.0, 2.0, 4.0), RadiusMeaning::MeanFreePath));
    assert_eq!((below.g, below.inner_eta, ior), (0.5, 1.5, 1.5));
    assert!(
        (color - Vec3::new(0.5, 0.25, 0.125)).length() < 1e-6 && (roughness - 0.3).abs() < 1e-6,
        "{color} {roughness}"
    );
    // Faults are named with their place
    for (params, message) in [
        (r#""string name" "Ink""#, "there is no substance \"Ink\""),
        (r#""rgb sigma_a" [ 1 2 3 ]"#, "together"),
        (r#""float g" 1"#, "between -1 and 1"),
    ] {
        let error = load_text(&format!(r#"WorldBegin Material "subsurface" {params} Shape "sphere""#)).unwrap_err();
        assert!(error.to_string().contains(message), "{error}");
    }
}

#[test]
fn fronts_follow_normals_orientation_and_handedness_as_in_pbrt() {
    let side = |text: &str| front(&world(text), 0);
    assert_eq!(side(TRIANGLE), Vec3::Z);
    assert_eq!(side(&format!("ReverseOrientation {TRIANGLE}")), Vec3::NEG_Z);
    // pbrt turns a triangle over where the transformation mirrors: mirrored in x, it runs clockwise, and shows +z again.
    assert_eq!(side(&format!("Scale -1 1 1 {TRIANGLE}")), Vec3::Z);
    assert_eq!(side(&format!("ReverseOrientation Scale -1 1 1 {TRIANGLE}")), Vec3::NEG_Z);
    let with_normals = format!(r#"{TRIANGLE} "normal N" [ 0 0 -1 0 0 -1 0 0 -1 ]"#);
    assert_eq!(side(&with_normals), Vec3::NEG_Z);
    assert_eq!(side(&format!("ReverseOrientation {with_normals}")), Vec3::Z);
    assert_eq!(side(&format!("Scale 1 1 -1 {with_normals}")), Vec3::Z);
    let disk = |text: &str| side(&format!(r#"{text} Shape "disk""#));
    assert_eq!(disk(""), Vec3::Z);
    assert_eq!(disk("ReverseOrientation"), Vec3::NEG_Z);
    assert_eq!(disk("Rotate 90 0 1 0").round(), Vec3::X);
}

#[test]
fn a_sphere_that_is_turned_over_shines_inwards() {
    let scene = world(r#"AreaLightSource "diffuse" ReverseOrientation Shape "sphere""#);
    assert_eq!(scene.materials[scene.spheres[0].material as usize].emission_sides, Sides::Back);
    let scene = world(r#"ReverseOrientation Material "dielectric" Shape "sphere""#);
    let Surface::Dielectric(dielectric) = &scene.materials[scene.spheres[0].material as usize].surface else {
        panic!("no dielectric")
    };
    assert!((dielectric.eta - 1.0 / 1.5).abs() < 1e-6);
    // A shape that is not a sphere is replaced by triangles.
    let scene = world(r#"Scale 1 2 1 Shape "sphere" Shape "sphere" "float zmin" 0"#);
    assert!(scene.spheres.is_empty() && scene.instances.len() == 2);
}

/// The position of a point in the picture: from −1 at the left and lower edge to 1 at the right and upper one.
fn project(scene: &Scene, aspect: f32, point: Vec3) -> Vec2 {
    let camera = &scene.cameras[0];
    let local = camera.world_from_camera.inverse().transform_point3(point);
    let place = match camera.projection {
        Projection::Perspective { vertical_fov } => local.truncate() / (-local.z * (0.5 * vertical_fov).tan()),
        Projection::Orthographic { height } => local.truncate() / (0.5 * height),
        Projection::Fisheye { .. } | Projection::Panorama(_) => panic!("all around"),
    };
    place / Vec2::new(aspect * camera.pixel_aspect, 1.0) + camera.lens_shift
}

#[test]
fn cameras_have_the_view_of_pbrt() {
    let camera = |head: &str| load_text(&format!("{head} WorldBegin {TRIANGLE}")).unwrap().scene;
    let wide = r#"Film "rgb" "integer xresolution" 200 "integer yresolution" 100"#;
    // Left-handed: from −z towards +z, +x is on the right.
    let scene = camera(&format!(r#"{wide} LookAt 0 0 -2 0 0 0 0 1 0 Camera "perspective" "float fov" 90"#));
    assert!((project(&scene, 2.0, Vec3::new(2.0, 1.0, 0.0)) - Vec2::new(0.5, 0.5)).length() < 1e-5);
    // The angle is that of the shorter side.
    let high = r#"Film "rgb" "integer xresolution" 100 "integer yresolution" 200 Camera "perspective" "float fov" 90"#;
    let scene = camera(high);
    assert_eq!(scene.cameras[0].fov_axis, FovAxis::Smaller);
    assert!((project(&scene, 0.5, Vec3::new(1.0, 2.0, 1.0)) - Vec2::ONE).length() < 1e-5);
    // Mirrored and scaled, the same things are seen.
    let scene = camera(&format!(r#"{wide} Scale -3 3 3 LookAt 0 0 2 0 0 0 0 1 0 Camera "perspective""#));
    assert!((project(&scene, 2.0, Vec3::new(2.0, 1.0, 0.0)) - Vec2::new(0.5, 0.5)).length() < 1e-5);
    let scene = camera(&format!(r#"{wide} Camera "orthographic" "float screenwindow" [ -1 3 0 2 ]"#));
    assert!((project(&scene, 2.0, Vec3::new(3.0, 2.0, 5.0)) - Vec2::ONE).length() < 1e-5);
    assert!((project(&scene, 2.0, Vec3::new(-1.0, 0.0, 5.0)) + Vec2::ONE).length() < 1e-5);
    let scene = camera(&format!(r#"{wide} Camera "perspective" "float screenwindow" [ 0 2 0 1 ]"#));
    assert_eq!((scene.cameras[0].fov_axis, scene.cameras[0].pixel_aspect), (FovAxis::Y, 1.0));
    assert!((project(&scene, 2.0, Vec3::new(2.0, 1.0, 1.0)) - Vec2::ONE).length() < 1e-5);
    // A window of another shape than the film is stretched over it.
    for square in [r#""float screenwindow" [ -1 1 -1 1 ]"#, r#""float frameaspectratio" 1"#] {
        let scene = camera(&format!(r#"{wide} Camera "perspective" {square}"#));
        assert!((project(&scene, 2.0, Vec3::ONE) - Vec2::ONE).length() < 1e-5, "{square}");
    }
}

#[test]
fn spherical_cameras_see_all_around() {
    let camera = |text: &str| load_text(&format!("{text} WorldBegin {TRIANGLE}"));
    let one = |text: &str| {
        let loaded = camera(text).unwrap();
        assert!(
            loaded.warnings.iter().all(|warning| warning.to_string().contains("no light")),
            "{:?}",
            loaded.warnings
        );
        loaded.scene.cameras[0].clone()
    };
    assert_eq!(one(r#"Camera "spherical""#).projection, Projection::Panorama(Panorama::EqualArea));
    // A window, a lens and a scale that is the same along all axes are nothing to it.
    let text = r#"Scale 2 2 2 LookAt 1 2 3 1 2 4 0 1 0
        Camera "spherical" "string mapping" "equirectangular" "float screenwindow" [ 1 -1 -1 1 ] "float lensradius" 3"#;
    let seen = one(text);
    assert_eq!(seen.projection, Projection::Panorama(Panorama::Equirectangular));
    assert_eq!((seen.lens_radius, seen.lens_shift), (0.0, Vec2::ZERO));
    let place = seen.world_from_camera;
    // pbrt's camera looks along +z with +x on the right, and its picture begins at +x; the middle of ours is ahead.
    assert!((place.transform_vector3(Vec3::NEG_Z) - Vec3::NEG_X).length() < 1e-6, "{place}");
    assert!((place.transform_vector3(Vec3::X) - Vec3::NEG_Z).length() < 1e-6, "{place}");
    assert!((place.transform_point3(Vec3::ZERO) - Vec3::new(1.0, 2.0, 3.0)).length() < 1e-5, "{place}");
    let error = camera("\nCamera \"spherical\"\n\"string mapping\" \"mercator\"").unwrap_err().to_string();
    assert!(error.contains("line 3, ") && error.contains("mercator"), "{error}");
    assert!(camera(r#"Scale 0 1 1 Camera "spherical""#).unwrap_err().to_string().contains("singular"));
    let loaded = camera("\nScale 1 2 1\nCamera \"spherical\"").unwrap();
    assert!(loaded.warnings.iter().any(|warning| warning.to_string().starts_with("scene.pbrt:3:")));
}

#[test]
fn lights_have_pbrts_units() {
    let scene = world(&format!(
        r#"{TRIANGLE}
        LightSource "point" "rgb I" [ 1 2 3 ] "float scale" 2 "point3 from" [ 1 0 0 ]
        LightSource "point" "float power" 12.566371
        LightSource "distant" "point3 from" [ 0 0 0 ] "point3 to" [ 0 -2 0 ] "float illuminance" 7
        LightSource "point" "blackbody I" 3000"#
    ));
    let kinds: Vec<&LightKind> = scene.lights.iter().map(|light| &light.kind).collect();
    let LightKind::Point { position, intensity } = kinds[0] else { panic!("{:?}", kinds[0]) };
    assert_eq!((*position, *intensity), (Vec3::X, Spectrum::new(2.0, 4.0, 6.0)));
    let LightKind::Point { intensity, .. } = kinds[1] else { panic!("{:?}", kinds[1]) };
    assert!((*intensity - Spectrum::ONE).length() < 1e-5);
    let LightKind::Directional { direction, irradiance, .. } = kinds[2] else { panic!("{:?}", kinds[2]) };
    assert_eq!((*direction, *irradiance), (Vec3::NEG_Y, Spectrum::splat(7.0)));
    // Every light's spectrum is scaled to the luminance 1, and keeps its colour.
    let LightKind::Point { intensity, .. } = kinds[3] else { panic!("{:?}", kinds[3]) };
    let luminance = intensity.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    assert!((luminance - 1.0).abs() < 1e-3 && intensity.x > 2.0 * intensity.z, "{intensity}");
    // The power of an area light goes to each of its primitives.
    let scene = world(r#"AreaLightSource "diffuse" "float power" 12.566371 Shape "sphere" "float radius" 0.5"#);
    let emission = scene.materials[scene.spheres[0].material as usize].emission.factor;
    assert!((emission - Spectrum::splat(4.0 / std::f32::consts::PI)).length() < 1e-5, "{emission}");
}

/// A scene with the file `a.pfm` of equal values beside it.
fn with_picture(width: u32, height: u32, value: f32, text: &str) -> Result<Scene, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let mut picture = format!("PF\n{width} {height}\n-1.0\n").into_bytes();
    (0..3 * width * height).for_each(|_| picture.extend(value.to_le_bytes()));
    std::fs::write(folder.path().join("a.pfm"), picture).unwrap();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, format!("WorldBegin\n{text}\n{TRIANGLE}")).unwrap();
    load(&path, &LoadOptions { strict: true, ..LoadOptions::default() }).map(|loaded| loaded.scene)
}

#[test]
fn portals_look_outwards_from_the_side_that_pbrt_lets_light_into() {
    let text = r#"LightSource "infinite" "string filename" "a.pfm" "point3 portal" [ 0 0 5 0 2 5 3 2 5 3 0 5 ]
        Translate 9 9 9 LightSource "infinite" "string filename" "a.pfm" "point3 portal" [ 0 0 7 0 2 7 3 2 7 3 0 7 ]"#;
    let environment = with_picture(2, 2, 0.5, text).unwrap().environment.unwrap();
    // World space, whatever the transformation; one sky through both.
    assert_eq!(environment.portals.len(), 2);
    let portal = environment.portals[0];
    assert_eq!((portal.corner, portal.edges), (Vec3::new(0.0, 0.0, 5.0), [3.0 * Vec3::X, 2.0 * Vec3::Y]));
    assert_eq!(portal.edges[0].cross(portal.edges[1]).normalize(), Vec3::Z);
    let scene = world(r#"LightSource "infinite" "rgb L" [ 2 2 2 ] "point3 portal" [ 0 0 5 0 2 5 3 2 5 3 0 5 ]"#);
    let environment = scene.environment.unwrap();
    assert_eq!((environment.image, environment.factor, environment.portals.len()), (None, Spectrum::splat(2.0), 1));
    for bad in [
        "[ 0 0 5 0 2 5 3 2 5 ]",
        "[ 0 0 5 0 2 5 3 0 5 3 2 5 ]",
        "[ 0 0 5 1 2 5 4 2 5 3 0 5 ]",
        "[ 0 0 5 0 0 5 0 0 5 0 0 5 ]",
    ] {
        assert!(load_text(&format!("WorldBegin LightSource \"infinite\" \"point3 portal\" {bad}")).is_err(), "{bad}");
    }
    // Two skies, of which one cannot be shown.
    let two = r#"LightSource "infinite" "string filename" "a.pfm" "point3 portal" [ 0 0 5 0 2 5 3 2 5 3 0 5 ]
        LightSource "infinite" "rgb L" [ 1 1 1 ]"#;
    assert!(matches!(with_picture(2, 2, 0.5, two), Err(SceneError::Unsupported { .. })));
}

#[test]
fn lights_with_pictures_have_the_power_that_they_say() {
    let gonio =
        with_picture(4, 4, 0.5, r#"LightSource "goniometric" "string filename" "a.pfm" "float power" 8"#).unwrap();
    let LightKind::Goniometric { intensity, world_from_light, .. } = gonio.lights[0].kind else { panic!("no light") };
    // 4 π × intensity × mean = power.
    assert!((intensity.y * 0.5 * 4.0 * std::f32::consts::PI - 8.0).abs() < 1e-4, "{intensity}");
    // The centre of the picture, +z, is +y of the light.
    assert_eq!(world_from_light * Vec3::Z, Vec3::Y);
    assert!(with_picture(4, 2, 0.5, r#"LightSource "goniometric" "string filename" "a.pfm""#).is_err());
    // A square of 90°: the sum of cos³ over it is the solid angle of a side of a cube, 4 π ∕ 6.
    let text = r#"LightSource "projection" "string filename" "a.pfm" "float power" 8"#;
    let scene = with_picture(64, 64, 0.5, text).unwrap();
    let LightKind::Projector { intensity, .. } = scene.lights[0].kind else { panic!("no light") };
    let solid_angle = 4.0 * std::f32::consts::PI / 6.0;
    assert!((intensity.y * 0.5 * solid_angle / 8.0 - 1.0).abs() < 1e-3, "{intensity}");
}

#[test]
fn a_picture_that_shines_ends_at_its_edges() {
    let light = r#"AreaLightSource "diffuse" "string filename" "a.pfm""#;
    let scene = with_picture(2, 2, 0.5, light).unwrap();
    let map = scene.materials.iter().find_map(|material| material.emission.texture.as_ref()).unwrap();
    assert_eq!((map.wrap_u, map.wrap_v, map.smooth), (Wrap::Clamp, Wrap::Clamp, true));
}

#[test]
fn a_texel_that_is_thrown_is_as_strong_all_over() {
    let scene = with_picture(2, 2, 0.5, r#"LightSource "projection" "string filename" "a.pfm""#).unwrap();
    let LightKind::Projector { picture, .. } = scene.lights[0].kind else { panic!("no light") };
    assert!(!picture.smooth);
    for place in [Vec2::splat(0.03), Vec2::new(0.45, 0.1), Vec2::splat(0.49)] {
        let texel = scene.images[picture.image.0 as usize].eval(&picture, place, 0.0).x;
        // At the distance 1 the picture reaches from −1 to 1.
        let strength = texel * (1.0 + (2.0 * place - 1.0).length_squared()).powf(1.5);
        assert!((strength - 0.5).abs() < 2e-3, "{place}: {strength}");
    }
}

#[test]
fn a_mesh_and_a_picture_that_are_used_often_are_there_once() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.pfm"), [b"PF\n1 1\n-1.0\n".to_vec(), vec![0; 12]].concat()).unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    std::fs::write(folder.path().join("a.ply"), ply).unwrap();
    let text = r#"WorldBegin
        Texture "one" "spectrum" "imagemap" "string filename" "a.pfm"
        Texture "two" "spectrum" "imagemap" "string filename" "./a.pfm" "float scale" 0.5
        Material "diffuse" "texture reflectance" "one" Shape "plymesh" "string filename" "a.ply"
        Translate 1 0 0 Shape "plymesh" "string filename" "./a.ply"
        Material "coateddiffuse" "texture reflectance" "two" Shape "plymesh" "string filename" "a.ply""#;
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, text).unwrap();
    let scene = load(&path, &LoadOptions { add_sky: false, ..LoadOptions::default() }).unwrap().scene;
    // One for each of the two materials.
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.images.len()), (2, 3, 1));
}

/// pbrt takes 0 for each texel beyond the edge before it interpolates (`wrap`, its file format's Textures).
#[test]
fn pictures_that_wrap_black_end_at_their_edges() {
    let folder = tempfile::tempdir().unwrap();
    let texels: Vec<u8> = [1.0f32; 4 * 2 * 3].iter().flat_map(|value| value.to_le_bytes()).collect();
    std::fs::write(folder.path().join("a.pfm"), [b"PF\n4 2\n-1.0\n".to_vec(), texels].concat()).unwrap();
    let path = folder.path().join("scene.pbrt");
    let load_text = |more: &str| {
        let text = format!(
            r#"WorldBegin Texture "a" "spectrum" "imagemap" "string filename" "a.pfm" "string wrap" "black" {more}
            Material "diffuse" "texture reflectance" "a" {TRIANGLE} "point2 uv" [ 0 0 1 0 0 1 ]"#
        );
        std::fs::write(&path, text).unwrap();
        let loaded = load(&path, &LoadOptions { add_sky: false, strict: true, ..LoadOptions::default() });
        loaded.unwrap_or_else(|error| panic!("{error}")).scene
    };
    let at = |scene: &Scene, u: f32, v: f32| {
        let material = scene.meshes[0].material as usize;
        let Surface::Diffuse(diffuse) = &scene.materials[material].surface else { panic!("not matte") };
        diffuse.reflectance.eval(scene, [Vec2::new(u, 1.0 - v); 2], 0.0).x
    };
    let scene = load_text("");
    // Within, on the edge, half of a texel beyond it, and far away.
    for (u, v, expected) in
        [(0.5, 0.5, 1.0), (0.0, 0.5, 0.5), (0.5, 1.0, 0.5), (0.0, 0.0, 0.25), (1.0625, 0.5, 0.25), (-0.2, 0.5, 0.0)]
    {
        assert!((at(&scene, u, v) - expected).abs() < 1e-5, "{u} {v}: {}", at(&scene, u, v));
    }
    assert!(at(&scene, 7.5, 0.5) == 0.0 && at(&scene, 0.5, -100.0) == 0.0);
    let scene = load_text(r#""string filter" "point" "float uscale" 2 "bool invert" true"#);
    for (u, expected) in [(0.25, 0.0), (0.49, 0.0), (0.51, 1.0), (-0.01, 1.0)] {
        assert!((at(&scene, u, 0.5) - expected).abs() < 1e-5, "{u}: {}", at(&scene, u, 0.5));
    }
}

#[test]
fn textures_that_no_picture_shows_are_baked() {
    let scene = world(&format!(
        r#"Texture "c" "spectrum" "checkerboard" "float uscale" 2 "float vscale" 2 "rgb tex1" [ 1 0 0 ] "rgb tex2" [ 0 0 1 ]
        Texture "s" "spectrum" "scale" "texture tex" "c" "float scale" 0.5
        Texture "m" "spectrum" "mix" "texture tex1" "s" "rgb tex2" [ 0 1 0 ] "float amount" 0.25
        Material "diffuse" "texture reflectance" "c" {TRIANGLE} "point2 uv" [ 0 0 1 0 0 1 ]
        Material "diffuse" "texture reflectance" "s" {TRIANGLE} "point2 uv" [ 0 0 1 0 0 1 ]
        Material "diffuse" "texture reflectance" "m" {TRIANGLE}"#
    ));
    let color = |instance: usize, u: f32, v: f32| {
        let material = scene.meshes[scene.instances[instance].mesh as usize].material;
        let Surface::Diffuse(diffuse) = &scene.materials[material as usize].surface else { panic!("not matte") };
        // pbrt's v grows upwards.
        diffuse.reflectance.eval(&scene, [Vec2::new(u, 1.0 - v); 2], 0.0)
    };
    // Even cells are the first: that at (0, 0) is even.
    for (u, v, expected) in [(0.2, 0.2, Vec3::X), (0.7, 0.2, Vec3::Z), (0.7, 0.7, Vec3::X), (1.2, 0.7, Vec3::Z)] {
        assert_eq!(color(0, u, v), expected, "{u} {v}");
        assert!((color(1, u, v) - 0.5 * expected).length() < 1e-6);
        let mixed = 0.375 * expected + Vec3::Y * 0.25;
        assert!((color(2, u, v) - mixed).length() < 1e-5, "{u} {v}: {}", color(2, u, v));
    }
    // A mesh without texture coordinates has pbrt's: (0, 0), (1, 0) and (1, 1).
    let mesh = &scene.meshes[scene.instances[2].mesh as usize];
    assert_eq!(mesh.uvs[0], [Vec2::Y, Vec2::ONE, Vec2::X]);
}

#[test]
fn a_surface_that_parts_nothing_has_no_media() {
    let fog = r#"MakeNamedMedium "fog" "string type" "homogeneous""#;
    let scene = world(&format!(r#"{fog} MediumInterface "fog" Material "interface" Shape "sphere""#));
    let material = &scene.materials[0];
    assert_eq!((material.interior, material.exterior, &material.surface), (None, None, &Surface::Null));
    let scene = world(&format!(r#"{fog} MediumInterface "" "fog" Material "dielectric" Shape "sphere""#));
    assert!(scene.materials[0].interior.is_none() && scene.materials[0].exterior.is_some());
}

#[test]
fn integrators_say_from_where_they_follow_light() {
    let hint = |text: &str| {
        let loaded = load_text(&format!("{text}\nWorldBegin\n{TRIANGLE}\nLightSource \"infinite\"")).unwrap();
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        loaded.hints.integrator
    };
    assert_eq!(hint(""), None);
    for (name, follows) in [
        ("volpath", TransportPaths::Paths { is_ours: true }),
        ("simplepath", TransportPaths::Paths { is_ours: false }),
        ("bdpt", TransportPaths::BothEnds),
        ("mlt", TransportPaths::BothEnds),
        ("lightpath", TransportPaths::BothEnds),
    ] {
        let hint = hint(&format!("Integrator \"{name}\"")).expect(name);
        assert_eq!((hint.name.as_str(), hint.follows), (name, follows));
        assert_eq!(hint.place, "scene.pbrt:1:1");
    }
    let photons = |text: &str| hint(text).map(|hint| hint.follows);
    let film = "Film \"rgb\" \"integer xresolution\" 20 \"integer yresolution\" 10";
    let by_pixels = PhotonHints { count: Some(200), radius: Some(1.0), ..PhotonHints::default() };
    assert_eq!(photons(&format!("{film} Integrator \"sppm\"")), Some(TransportPaths::Photons(by_pixels)));
    let given = PhotonHints { count: Some(5000), radius: Some(0.075), ..PhotonHints::default() };
    let text = "Integrator \"sppm\" \"integer photonsperiteration\" 5000 \"float radius\" 0.075";
    assert_eq!(photons(text), Some(TransportPaths::Photons(given)));
}

#[test]
fn media_that_vary_in_space_have_pbrts_densities() {
    let around = |medium: &str| {
        format!(r#"MakeNamedMedium "fog" {medium} MediumInterface "fog" "" Material "interface" Shape "sphere""#)
    };
    let grid = r#""string type" "uniformgrid" "integer nx" 2 "integer ny" 1 "integer nz" 1 "float density" [ 1 3 ]"#;
    let placed = format!(r#"Translate 5 0 0 {}"#, around(&format!(r#"{grid} "point3 p1" [ 2 1 1 ] "float scale" 2"#)));
    let scene = world(&placed);
    let medium = &scene.media[0];
    let variation = medium.variation.as_ref().unwrap();
    let at = |x: f32| {
        let p = variation.grid_from_world.transform_point3(Vec3::new(x, 0.5, 0.5));
        medium.coefficients(variation, p).scattering.x
    };
    // Between the centres of cells linearly, and to 0 beyond the outermost; nothing outside.
    for (x, expected) in [(5.5, 2.0), (6.0, 4.0), (6.5, 6.0), (7.0, 3.0), (4.9, 0.0), (7.1, 0.0)] {
        assert!((at(x) - expected).abs() < 1e-5, "{x}: {}", at(x));
    }
    let colored = r#""string type" "rgbgrid" "integer nz" 2 "rgb sigma_a" [ 1 2 3 4 5 6 ] "float scale" 10"#;
    let scene = world(&around(colored));
    let medium = &scene.media[0];
    let there = medium.coefficients(medium.variation.as_ref().unwrap(), Vec3::new(0.5, 0.5, 0.75));
    assert_eq!((there.absorption, there.scattering), (Vec3::new(40.0, 50.0, 60.0), Vec3::splat(10.0)));
    let short = around(r#""string type" "uniformgrid" "integer nx" 3 "float density" [ 1 3 ]"#);
    let error = load_text(&format!("WorldBegin {short}")).unwrap_err().to_string();
    assert!(error.contains("3 cells has 2 values"), "{error}");
    let error = load_text(&format!("WorldBegin {}", around(r#""string type" "nanovdb" "string filename" "x.nvdb""#)));
    assert!(error.unwrap_err().to_string().contains("x.nvdb"));
}

#[test]
fn many_small_meshes_of_one_material_are_joined() {
    let text: String = (0..500).map(|i| format!("Translate 0 0 1 {TRIANGLE} # {i}\n")).collect();
    let scene = world(&text);
    assert_eq!((scene.meshes.len(), scene.triangle_count()), (1, 500));
    assert_eq!(scene.bounds().1.z, 500.0);
}

#[test]
fn unsupported_parts_are_named_and_refused_when_strict() {
    let text = "WorldBegin\nMaterial \"felt\"\n  Shape \"sphere\" \"float wobble\" 1\n";
    let loaded = load_text(text).unwrap();
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert!(warnings[0].starts_with("scene.pbrt:3:18: ") && warnings[0].contains("float wobble"), "{warnings:?}");
    assert!(warnings[1].starts_with("scene.pbrt:2:1: ") && warnings[1].contains("\"felt\" is unknown"), "{warnings:?}");
    let strict = LoadOptions { strict: true, ..LoadOptions::default() };
    let error = load_with(text, &strict).unwrap_err();
    let SceneError::Unsupported { places, .. } = &error else { panic!("{error}") };
    assert_eq!(places.len(), 2);
    assert!(error.to_string().contains("\n  scene.pbrt:2:1: "), "{error}");
    assert!(load_with(&format!("WorldBegin {TRIANGLE}"), &strict).is_ok());
}

#[test]
fn every_error_names_the_place() {
    let cases = [
        ("Shape \"sphere\"", (1, 1), "after WorldBegin"),
        ("WorldBegin\nCamera \"perspective\"", (2, 1), "before WorldBegin"),
        ("WorldBegin AttributeBegin", (1, 12), "no AttributeEnd"),
        ("WorldBegin\n AttributeEnd", (2, 2), "without AttributeBegin"),
        ("WorldBegin AttributeBegin TransformEnd", (1, 27), "still open"),
        ("WorldBegin Translate 1 2", (1, 12), "ends within Translate"),
        ("WorldBegin Translate 1 2 x", (1, 26), "3 numbers"),
        ("WorldBegin Translate 1 2 nan", (1, 26), "3 numbers"),
        ("WorldBegin Scale 1e200 1 1 Scale 1e200 1 1", (1, 28), "all bounds"),
        ("WorldBegin Rotate 90 0 0 0", (1, 12), "axis"),
        ("WorldBegin LookAt 0 0 0 0 0 0 0 1 0", (1, 12), "eye"),
        ("WorldBegin Transform [ 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1 ]", (1, 12), "affine"),
        ("WorldBegin Sphere", (1, 12), "no directive"),
        ("WorldBegin \"Shape\"", (1, 12), "directive is expected"),
        ("WorldBegin Shape", (1, 12), "ends within Shape"),
        ("WorldBegin Shape sphere", (1, 18), "in quotes"),
        ("WorldBegin Shape \"sphere\" \"float radius\"", (1, 27), "ends before the value"),
        ("WorldBegin Shape \"sphere\" \"float radius\" [ 1", (1, 27), "ends before the value"),
        ("WorldBegin Shape \"sphere\" \"float radius\" [ 1 2 ]", (1, 27), "2 values"),
        ("WorldBegin Shape \"sphere\" \"float radius\" \"1\"", (1, 42), "takes numbers"),
        ("WorldBegin Shape \"sphere\" \"float radius\" 0", (1, 12), "above 0"),
        ("WorldBegin Shape \"sphere\" \"float radius", (1, 27), "within quotes"),
        (
            "WorldBegin Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 3 ]",
            (1, 66),
            "no vertex 3",
        ),
        (
            "WorldBegin Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ] \"integer indices\" [ 0 1 -1 ]",
            (1, 66),
            "no vertex -1",
        ),
        ("WorldBegin Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1 ]", (1, 33), "not a multiple of 3"),
        ("WorldBegin Shape \"trianglemesh\" \"point3 P\" [ 0 0 0 1 0 0 0 1e30 0 ]", (1, 33), "beyond"),
        ("WorldBegin Scale 1e30 1e30 1e30 Shape \"disk\"", (1, 33), "out of reach"),
        ("WorldBegin NamedMaterial \"m\" Shape \"sphere\"", (1, 26), "no material"),
        (
            "WorldBegin Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\"",
            (1, 31),
            "no spectrum texture",
        ),
        (
            "WorldBegin Texture \"t\" \"spectrum\" \"scale\" \"texture tex\" \"t\" Material \"diffuse\" \"texture reflectance\" \"t\" Shape \"sphere\"",
            (1, 43),
            "refers to itself",
        ),
        (
            "WorldBegin MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [ \"m\" \"m\" ] NamedMaterial \"m\" Shape \"sphere\"",
            (1, 12),
            "mixture of itself",
        ),
        ("WorldBegin MediumInterface \"m\" \"\" Shape \"sphere\"", (1, 12), "no medium"),
        ("WorldBegin ObjectInstance \"o\"", (1, 12), "no object"),
        ("WorldBegin ObjectBegin \"o\" ObjectBegin \"p\"", (1, 28), "within an object"),
        ("WorldBegin LightSource \"point\" \"rgb I\" [ -1 0 0 ]", (1, 32), "negative"),
        ("WorldBegin LightSource \"point\" \"spectrum I\" \"nothing\"", (1, 32), "no spectrum of the name"),
        ("WorldBegin LightSource \"point\" \"spectrum I\" [ 500 1 400 1 ]", (1, 32), "increase"),
        ("Film \"rgb\" \"integer xresolution\" 0 WorldBegin", (1, 12), "xresolution"),
        ("Film \"rgb\" \"float cropwindow\" [ 0.5 0.5 0 1 ] WorldBegin", (1, 12), "no pixel"),
        ("Camera \"perspective\" \"float fov\" 180 WorldBegin", (1, 22), "fov"),
        ("Scale 0 1 1 Camera \"perspective\" WorldBegin", (1, 13), "singular"),
        ("Film \"rgb\"", (1, 11), "before WorldBegin"),
        ("", (1, 1), "before WorldBegin"),
    ];
    for (text, (line, column), problem) in cases {
        match load_text(text) {
            Err(SceneError::Text { line: at_line, column: at_column, problem: found, .. }) => {
                assert!(found.contains(problem), "{text:?}: {found}");
                assert_eq!((at_line, at_column), (line, column), "{text:?}: {found}");
            }
            other => panic!("{text:?}: {:?}", other.map(|loaded| loaded.warnings)),
        }
    }
}

#[test]
fn files_for_pbrt_v3_are_recognized() {
    for text in [
        "Film \"image\" WorldBegin",
        "Sampler \"lowdiscrepancy\" WorldBegin",
        "WorldBegin Material \"matte\" \"rgb Kd\" [ 1 1 1 ]",
        "WorldBegin MakeNamedMaterial \"m\" \"string type\" \"uber\"",
        "WorldBegin Texture \"t\" \"color\" \"constant\"",
        "WorldBegin LightSource \"point\" \"color I\" [ 1 1 1 ]",
        "SurfaceIntegrator \"path\"",
    ] {
        let error = load_text(text).unwrap_err().to_string();
        assert!(error.contains("pbrt-v3") && error.contains("--upgrade"), "{text}: {error}");
    }
}

#[test]
fn includes_stay_in_the_folder_and_do_not_run_in_circles() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene");
    std::fs::create_dir(&scene).unwrap();
    let write = |name: &str, text: &str| std::fs::write(scene.join(name), text).unwrap();
    let main = scene.join("main.pbrt");
    let options = LoadOptions::default();
    write("a.pbrt", "Include \"b.pbrt\"");
    write("b.pbrt", "\n Include \"a.pbrt\"");
    write("main.pbrt", "WorldBegin Include \"a.pbrt\"");
    let error = load(&main, &options).unwrap_err().to_string();
    assert!(error.contains("b.pbrt`, line 2, column 10") && error.contains("includes itself"), "{error}");
    write("main.pbrt", "WorldBegin Include \"main.pbrt\"");
    assert!(load(&main, &options).unwrap_err().to_string().contains("includes itself"));
    write("main.pbrt", "WorldBegin Include \"missing.pbrt\"");
    assert!(matches!(load(&main, &options), Err(SceneError::Read { .. })));
    std::fs::write(folder.path().join("secret.pbrt"), "Shape \"sphere\"").unwrap();
    for reference in ["../secret.pbrt", "a/../../secret.pbrt", "/etc/passwd"] {
        write("main.pbrt", &format!("WorldBegin Include \"{reference}\""));
        assert!(matches!(load(&main, &options), Err(SceneError::ForbiddenReference { .. })), "{reference}");
        write("main.pbrt", &format!("WorldBegin Shape \"plymesh\" \"string filename\" \"{reference}\""));
        assert!(matches!(load(&main, &options), Err(SceneError::ForbiddenReference { .. })), "{reference}");
    }
    // What is imported leaves the state as it was, what is included does not.
    write("move.pbrt", "Translate 1 0 0");
    write("main.pbrt", "WorldBegin Import \"move.pbrt\" Shape \"sphere\" Include \"move.pbrt\" Shape \"sphere\"");
    let spheres = load(&main, &options).unwrap().scene.spheres;
    assert_eq!((spheres[0].center, spheres[1].center), (Vec3::ZERO, Vec3::X));
    write("open.pbrt", "AttributeBegin");
    write("main.pbrt", "WorldBegin Import \"open.pbrt\"");
    assert!(load(&main, &options).unwrap_err().to_string().contains("does not end"));
}

#[test]
fn memory_is_bounded() {
    let options = LoadOptions { max_memory_bytes: 4 << 20, ..LoadOptions::default() };
    let subdivided = "WorldBegin Shape \"loopsubdiv\" \"integer levels\" 9 \"integer indices\" [ 0 1 2 ] \"point3 P\" [ 0 0 0 1 0 0 0 1 0 ]";
    let object = "ObjectBegin \"o\" ".to_owned() + &"Translate 1 0 0 Shape \"sphere\" ".repeat(1000) + "ObjectEnd ";
    let squared = format!("WorldBegin {object} {}", "ObjectInstance \"o\" ".repeat(1000));
    let nested = format!("WorldBegin {}", "AttributeBegin ".repeat(100_000));
    let materials = format!("WorldBegin {}", "Material \"diffuse\" ".repeat(100_000));
    for text in [subdivided, &squared, &materials] {
        assert!(matches!(load_with(text, &options), Err(SceneError::Limit { .. })), "{}", &text[..80]);
    }
    let finer = subdivided.replace(" 9 ", " 12 ");
    assert!(load_with(&finer, &options).unwrap_err().to_string().contains("make more than"));
    assert!(load_with(&nested, &options).unwrap_err().to_string().contains("blocks within each other"));
    // Twice as many textures in each step.
    let mut text = String::from("WorldBegin Texture \"t0\" \"spectrum\" \"checkerboard\" ");
    for step in 1..60 {
        let inner = step - 1;
        text += &format!(
            "Texture \"t{step}\" \"spectrum\" \"mix\" \"texture tex1\" \"t{inner}\" \"texture tex2\" \"t{inner}\" "
        );
    }
    text += "Material \"diffuse\" \"texture reflectance\" \"t59\" Shape \"sphere\"";
    assert!(load_text(&text).unwrap().warnings.iter().any(|warning| warning.message.contains("parts")));
}

/// Files that are almost right: no panic, no endless loop, no more memory than allowed.
fn survive_mutations_of(name: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.pbrt");
    let included = std::fs::read(Path::new(CORPUS).join("more.pbrt")).unwrap();
    std::fs::write(folder.path().join("more.pbrt"), &included).unwrap();
    let original = std::fs::read_to_string(Path::new(CORPUS).join(name)).unwrap();
    // On one line, a comment hides the rest.
    let original: String =
        original.lines().filter(|line| !line.starts_with('#')).flat_map(|line| [line, "\n"]).collect();
    let original = original.as_bytes();
    let words: Vec<&[u8]> = original.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).collect();
    let odd: [&[u8]; 8] = [b"nan", b"-1", b"1e308", b"[", b"]", b"\"", b"4294967296", b"\xff\xfe"];
    let extreme: [&[u8]; 8] = [b"0", b"-1", b"1e30", b"1e-30", b"1e308", b"2", b"7", b"0.5"];
    let options = LoadOptions { max_memory_bytes: 64 << 20, ..LoadOptions::default() };
    let mutated = |random: &mut Random| {
        let mut text = words.clone();
        for _ in 0..=random.below(3) {
            let at = random.below(text.len());
            match random.below(10) {
                0 => text[at] = odd[random.below(odd.len())],
                1 => text[at] = words[random.below(words.len())],
                2 => drop(text.remove(at)),
                3 => text.insert(at, words[random.below(words.len())]),
                4 => text.truncate(at.max(1)),
                // Numbers that are wrong leave a file that can be read so far.
                _ => {
                    let is_number = |word: &&[u8]| word.iter().all(|byte| b"0123456789.-".contains(byte));
                    let places: Vec<usize> = (0..text.len()).filter(|&index| is_number(&text[index])).collect();
                    if !places.is_empty() {
                        text[places[random.below(places.len())]] = extreme[random.below(extreme.len())];
                    }
                }
            }
        }
        let mut bytes = text.join(&b' ');
        if random.below(4) == 0 {
            let at = random.below(bytes.len());
            damage(&mut bytes, at, random);
        }
        bytes
    };
    let good = survive(name, 300, mutated, |bytes| {
        std::fs::write(&path, bytes).unwrap();
        match load(&path, &options) {
            Ok(loaded) => loaded.scene.validate().is_ok(),
            // Only the model itself may not be broken by what was read.
            Err(SceneError::Invalid { place, problem, .. })
                if place.contains('[') && !problem.contains("above 1e15") =>
            {
                panic!("{place}: {problem}")
            }
            Err(_) => false,
        }
    });
    assert!((0.05..0.95).contains(&good), "{good} of the mutations were scenes");
}

#[test]
fn mutations_of_a_box_are_survived() {
    survive_mutations_of("box.pbrt");
}

#[test]
fn mutations_of_grids_are_survived() {
    let loaded = load(&Path::new(CORPUS).join("smoke.pbrt"), &LoadOptions::default()).unwrap();
    assert_eq!(loaded.scene.media.iter().filter(|medium| medium.variation.is_some()).count(), 2);
    survive_mutations_of("smoke.pbrt");
}

#[test]
fn text_may_be_in_any_encoding() {
    let text = format!(
        "# grün\nWorldBegin\nMakeNamedMaterial \"grün\" \"string type\" \"diffuse\"\nNamedMaterial \"grün\"\n{TRIANGLE}\n"
    );
    let marked = format!("\u{feff}{text}");
    let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
    let utf16: Vec<u8> = marked.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let returns = text.replace('\n', "\r").into_bytes();
    for (bytes, is_guessed) in [
        (text.clone().into_bytes(), false),
        (marked.into_bytes(), false),
        (utf16, false),
        (returns, false),
        (latin, true),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.pbrt");
        std::fs::write(&path, &bytes).unwrap();
        let loaded = load(&path, &LoadOptions::default()).unwrap();
        assert_eq!(loaded.scene.triangle_count(), 1);
        let guess = loaded.warnings.iter().find(|warning| warning.message.contains("windows-1252"));
        assert_eq!(guess.map(|guess| guess.place.as_str()), is_guessed.then_some("scene.pbrt:1:1"));
    }
    let error = load_text("WorldBegin\n\0").unwrap_err().to_string();
    assert!(error.contains("line 2, column 1") && error.contains("save it as UTF-8"), "{error}");
}

#[test]
fn errors_about_missing_files_name_the_line_that_needs_them() {
    for text in
        ["WorldBegin\nInclude \"no.pbrt\"\n", "WorldBegin\nShape \"plymesh\" \"string filename\" [ \"no.ply\" ]\n"]
    {
        let error = load_text(text).unwrap_err();
        assert!(matches!(error, SceneError::Read { .. }), "{error:?}");
        assert!(error.to_string().contains("(requested by scene.pbrt:2:"), "{error}");
    }
}

#[test]
fn known_but_unsupported_parameters_are_refused_when_strict() {
    let heads = [
        r#"Integrator "path" "bool regularize" true"#,
        r#"Integrator "bdpt" "bool visualizestrategies" true"#,
        r#"Integrator "simplepath" "bool samplelights" false"#,
        r#"Film "gbuffer""#,
        r#"Film "spectral""#,
        r#"Film "rgb" "float wobble" 1"#,
    ];
    let worlds = [
        r#"Material "diffuse" "string normalmap" "none.png""#,
        r#"Material "dielectric" "spectrum eta" [400 1.6 700 1.4]"#,
        r#"Texture "t" "spectrum" "imagemap" "string filename" "none.png" Material "diffuse" "texture reflectance" "t""#,
    ];
    let all = heads.map(|head| format!("{head} WorldBegin {TRIANGLE}")).into_iter();
    for text in all.chain(worlds.map(|world| format!("WorldBegin {world} {TRIANGLE}"))) {
        let loaded = load_with(&text, &LoadOptions { strict: true, ..LoadOptions::default() });
        assert!(matches!(loaded, Err(SceneError::Unsupported { .. })), "{text}: {loaded:?}");
        load_text(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
    }
    let needless = r#"Integrator "path" "bool regularize" false "string lightsampler" "uniform" "float rrthreshold" .5
        Sampler "halton" "integer seed" 3 "string randomization" "owen"
        Film "rgb" "float diagonal" 20 "bool savefp16" false"#;
    load_with(&format!("{needless} WorldBegin {TRIANGLE}"), &LoadOptions { strict: true, ..LoadOptions::default() })
        .unwrap();
}

#[test]
fn films_bound_the_samples() {
    let most = |film: &str| load_text(&format!("Film {film} WorldBegin {TRIANGLE}")).unwrap().hints.sample_max;
    assert_eq!(most(r#""rgb""#), None);
    for film in ["rgb", "gbuffer", "spectral"] {
        assert_eq!(most(&format!(r#""{film}" "float maxcomponentvalue" .2"#)), Some(0.2));
    }
}

#[test]
fn lamps_with_alpha_0_are_absent_and_others_are_as_they_were() {
    let alpha = |shape: &str| world(&format!(r#"AreaLightSource "diffuse" {shape}"#)).materials[0].alpha_mode;
    assert_eq!(alpha(&format!(r#"{TRIANGLE} "float alpha" 0"#)), AlphaMode::Absent);
    assert_eq!(alpha(r#"Shape "sphere" "float alpha" 0"#), AlphaMode::Absent);
    assert_eq!(alpha(&format!(r#"{TRIANGLE} "float alpha" .5"#)), AlphaMode::Blend);
    assert_eq!(alpha(TRIANGLE), AlphaMode::Opaque);
    assert_eq!(world(&format!(r#"{TRIANGLE} "float alpha" 0"#)).materials[0].alpha_mode, AlphaMode::Blend);
}

#[test]
fn curves_face_each_ray_but_for_ribbons_and_lamps() {
    let points = r#""point3 P" [ -1 0 0 -.5 1 0 .5 1 0 1 0 0 ] "float width" .2"#;
    let mesh = |text: &str| world(text).meshes[0].clone();
    let curve = |kind: &str| mesh(&format!(r#"Shape "curve" "string type" "{kind}" {points}"#));
    for (kind, look) in [("flat", CurveLook::Flat), ("cylinder", CurveLook::Round)] {
        let mesh = curve(kind);
        let curves = mesh.curves.as_deref().expect("a curve");
        assert_eq!((curves.look, curves.pieces.len()), (look, mesh.triangles.len()));
        assert!(curves.points.iter().all(|point| (point.radius - 0.1).abs() < 1e-6));
    }
    let ribbon = mesh(&format!(r#"Shape "curve" "string type" "ribbon" "normal N" [ 0 0 1 0 0 1 ] {points}"#));
    let lamp = mesh(&format!(r#"AreaLightSource "diffuse" Shape "curve" {points}"#));
    assert!(ribbon.curves.is_none() && lamp.curves.is_none());
}

#[test]
fn an_interface_within_a_mixture_lets_light_through() {
    let scene = world(&format!(
        r#"MakeNamedMaterial "air" "string type" "interface" MakeNamedMaterial "red" "string type" "diffuse"
        Material "mix" "string materials" [ "air" "red" ] "float amount" .3 {TRIANGLE}"#
    ));
    let Surface::Blend { weight, surfaces } = &scene.materials[0].surface else { panic!("no blend") };
    assert_eq!((weight.factor, &surfaces[0]), (0.3, &Surface::clear_sheet(Spectrum::ONE.into())));
}

#[test]
fn hair_is_read_in_all_its_parametrisations() {
    let hair = |params: &str| match &world(&format!("Material \"hair\" {params} {TRIANGLE}")).materials[0].surface {
        Surface::Hair(hair) => (**hair).clone(),
        other => panic!("{other:?}"),
    };
    let melanin = |eumelanin: f32, pheomelanin: f32| Pigment::Melanin {
        eumelanin: eumelanin.into(),
        pheomelanin: pheomelanin.into(),
    };
    assert_eq!(hair(""), Hair::default());
    assert_eq!(hair("\"float pheomelanin\" .5").pigment, melanin(0.0, 0.5));
    assert_eq!(hair("\"float eumelanin\" .3 \"float pheomelanin\" .5").pigment, melanin(0.3, 0.5));
    let sigma_a = Pigment::SigmaA(Vec3::new(0.5, 1.5, 2.5).into());
    assert_eq!(hair("\"rgb sigma_a\" [.5 1.5 2.5] \"rgb reflectance\" [.1 .2 .3]").pigment, sigma_a);
    for name in ["reflectance", "color"] {
        let reflectance = Pigment::Reflectance(Vec3::new(0.5, 0.25, 0.125).into());
        assert_eq!(hair(&format!("\"rgb {name}\" [.5 .25 .125]")).pigment, reflectance);
    }
    let shaped = hair("\"float eta\" 1.4 \"float beta_m\" .2 \"float beta_n\" .6 \"float alpha\" -3");
    assert_eq!((shaped.eta, shaped.beta_m.factor, shaped.beta_n.factor, shaped.alpha), (1.4, 0.2, 0.6, -3.0));
    // Textures stay textures.
    let checks = "Texture \"c\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [.1 .2 .3] \"rgb tex2\" [.4 .5 .6]
        Texture \"f\" \"float\" \"checkerboard\" \"float tex1\" .2 \"float tex2\" .4 Material \"hair\" \"texture sigma_a\" \"c\"
        \"texture beta_m\" \"f\"";
    let scene = world(&format!("{checks} {TRIANGLE}"));
    assert_eq!(scene.materials[0].textures().len(), 2);
    for (params, reason) in [("\"float beta_m\" 2", "from 0 to 1"), ("\"float alpha\" 91", "from -90 to 90")] {
        let error = load_text(&format!("WorldBegin Material \"hair\" {params} {TRIANGLE}")).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    }
}
