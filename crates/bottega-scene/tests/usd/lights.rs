//! UsdLux: radiance, power and shape of lights.

use std::f32::consts::PI;

use bottega_scene::{DirectionPicture, EmissionProfile, LightKind, Scene};
use glam::Vec3;

use super::support::{Folder, bounds, clean, stage, warns};

/// The radiance of the only emitting surface.
fn radiance(scene: &Scene) -> f32 {
    let glowing: Vec<f32> = scene.materials.iter().map(|it| it.emission.factor.x).filter(|&it| it > 0.0).collect();
    assert_eq!(glowing.len(), 1, "{glowing:?}");
    glowing[0]
}

#[test]
fn radiance_is_intensity_by_exposure_and_color() {
    let scene = clean(
        "def RectLight \"l\" { float inputs:intensity = 3\nfloat inputs:exposure = 2\ncolor3f inputs:color = (0.5, 1, 0.25) }",
    );
    let emission = scene.materials[0].emission.factor;
    assert_eq!(emission, Vec3::new(6.0, 12.0, 3.0));
    let (min, max) = bounds(&scene);
    assert_eq!((min, max), (Vec3::new(-0.5, -0.5, 0.0), Vec3::new(0.5, 0.5, 0.0)));
    // It shines towards −z
    let mesh = &scene.meshes[0];
    let [a, b, c] = mesh.triangles[0].map(|vertex| mesh.positions[vertex as usize]);
    assert!((b - a).cross(c - a).z < 0.0);
    // Names from before `inputs:`
    assert_eq!(radiance(&clean("def RectLight \"l\" { float intensity = 3 }")), 3.0);
}

#[test]
fn a_normalized_light_is_divided_by_its_area_in_the_world() {
    let light = |kind: &str, more: &str| {
        radiance(&clean(&format!(
            "def {kind} \"l\" {{ float inputs:intensity = 6\nbool inputs:normalize = 1\n{more}\n\
             float3 xformOp:scale = (2, 2, 2)\nuniform token[] xformOpOrder = [\"xformOp:scale\"] }}"
        )))
    };
    for (kind, more, area) in [
        ("RectLight", "float inputs:width = 3\nfloat inputs:height = 0.5", 6.0),
        ("DiskLight", "float inputs:radius = 1.5", 9.0 * PI),
        ("SphereLight", "float inputs:radius = 0.25", PI),
        ("CylinderLight", "float inputs:radius = 0.25\nfloat inputs:length = 3", 6.0 * PI),
    ] {
        let found = light(kind, more);
        assert!((found * area / 6.0 - 1.0).abs() < 1e-4, "{kind}: {found}");
    }
}

fn directional(text: &str) -> (Vec3, f32, f32) {
    let scene = clean(&format!("def DistantLight \"l\" {{ {text} }}"));
    let LightKind::Directional { direction, irradiance, angle } = scene.lights[0].kind else { panic!("not distant") };
    (direction, irradiance.x, angle)
}

#[test]
fn a_distant_light_gives_its_radiance_over_its_disc() {
    let (direction, irradiance, angle) = directional("float inputs:intensity = 100\nfloat inputs:angle = 20");
    assert_eq!(direction, Vec3::NEG_Z);
    assert!((angle - 20.0_f32.to_radians()).abs() < 1e-6);
    // The integral of the cosine over a cap of the half angle 10°
    let expected = 100.0 * PI * 10.0_f32.to_radians().sin().powi(2);
    assert!((irradiance / expected - 1.0).abs() < 1e-5, "{irradiance} {expected}");
    let (_, irradiance, _) =
        directional("float inputs:intensity = 100\nfloat inputs:angle = 20\nbool inputs:normalize = 1");
    assert!((irradiance - 100.0).abs() < 1e-3);
    let (_, irradiance, angle) = directional("float inputs:intensity = 5\nfloat inputs:angle = 0");
    assert_eq!((irradiance, angle), (5.0, 0.0));
}

#[test]
fn a_point_has_the_intensity_of_its_sphere() {
    let intensity = |text: &str| {
        let scene =
            clean(&format!("def SphereLight \"l\" {{ float inputs:intensity = 8\nbool treatAsPoint = 1\n{text} }}"));
        let LightKind::Point { intensity, .. } = scene.lights[0].kind else { panic!("not a point") };
        intensity.x
    };
    assert!((intensity("float inputs:radius = 0.25") - 8.0 * PI / 16.0).abs() < 1e-5);
    assert!((intensity("float inputs:radius = 0.25\nbool inputs:normalize = 1") - 2.0).abs() < 1e-5);
}

#[test]
fn a_cone_shapes_a_light() {
    let scene = clean(
        "def DiskLight \"l\" ( prepend apiSchemas = [\"ShapingAPI\"] ) { float inputs:shaping:cone:angle = 40\nfloat inputs:shaping:cone:softness = 0.5 }",
    );
    let EmissionProfile::Spot { axis, cos_inner, cos_outer, .. } = scene.materials[0].emission_profile else {
        panic!("no cone")
    };
    assert_eq!(axis, Vec3::NEG_Z);
    assert!(
        (cos_outer - 40.0_f32.to_radians().cos()).abs() < 1e-6
            && (cos_inner - 20.0_f32.to_radians().cos()).abs() < 1e-6
    );
}

/// A lamp that shines downwards with 50 cd within 90°, and twice as strong at the axis.
const LAMP: &str = "IESNA91\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0 1 1 0\n0 45 90\n0\n100 50 50\n";

#[test]
fn a_profile_shapes_a_light_by_direction() {
    let load = |light: &str| {
        let text = format!(
            "#usda 1.0\ndef {light} \"l\" {{ float inputs:intensity = 3\nasset inputs:shaping:ies:file = @lamp.ies@\n\
             float inputs:radius = 1\nfloat inputs:shaping:cone:angle = 60\n\
             float3 xformOp:rotateXYZ = (90, 0, 0)\nuniform token[] xformOpOrder = [\"xformOp:rotateXYZ\"]\n"
        );
        let folder = Folder::new(&[("scene.usda", &(text + "}")), ("lamp.ies", LAMP)]);
        let loaded = folder.load("scene.usda").unwrap();
        assert!(loaded.warnings.iter().all(|it| it.message.contains("no camera")), "{:?}", loaded.warnings);
        loaded.scene
    };
    for kind in ["RectLight", "DiskLight", "SphereLight", "CylinderLight"] {
        let scene = load(kind);
        assert_eq!(radiance(&scene), 300.0, "{kind}");
        let EmissionProfile::Picture(DirectionPicture { image, world_from_light }) =
            scene.materials[0].emission_profile
        else {
            panic!("no profile")
        };
        // The axis −z, turned to +y, is the upper row; 0° is −x
        let found = [world_from_light * Vec3::Y, world_from_light * Vec3::Z];
        assert!((found[0] - Vec3::Y).length() < 1e-6 && (found[1] - Vec3::NEG_X).length() < 1e-6, "{kind}: {found:?}");
        let image = &scene.images[image.0 as usize];
        let (width, height) = image.size();
        let at = |degrees: f32| image.texel(0, (degrees / 180.0 * (height - 1) as f32) as u32).x;
        assert_eq!((width, at(0.0)), (1, 1.0));
        assert!((at(22.5) - 0.75).abs() < 1e-2 && (at(50.0) - 0.5).abs() < 1e-5 && at(61.0) == 0.0, "{kind}");
    }
}

#[test]
fn a_dome_has_its_picture_and_pole() {
    let dome = |head: &str, kind: &str, more: &str| {
        let text = format!(
            "#usda 1.0\n{head}def {kind} \"d\" {{ float inputs:intensity = 2\n{more}\nasset inputs:texture:file = @sky.png@ }}"
        );
        let folder = Folder::new(&[("scene.usda", &text)]);
        std::fs::write(folder.path("sky.png"), crate::gltf::support::png(2, 1, &[[255; 4]; 2])).unwrap();
        let environment = folder.load("scene.usda").unwrap().scene.environment.unwrap();
        assert!(environment.image.is_some() && environment.factor == Vec3::splat(2.0));
        environment.world_from_environment
    };
    // The centre of our pictures is −z, that of the file's is +z; u grows towards +x here, towards −x there
    let plain = dome("", "DomeLight", "");
    assert!((plain * Vec3::NEG_Z - Vec3::Z).length() < 1e-6 && (plain * Vec3::X - Vec3::NEG_X).length() < 1e-6);
    assert!((plain * Vec3::Y - Vec3::Y).length() < 1e-6);
    // A pole of y lies on its side in a stage whose z is up: its y is our −z
    let lying = dome("(\n upAxis = \"Z\"\n)\n", "DomeLight", "");
    assert!((lying * Vec3::Y - Vec3::NEG_Z).length() < 1e-6);
    let upright = dome("(\n upAxis = \"Z\"\n)\n", "DomeLight_1", "");
    assert!((upright * Vec3::Y - Vec3::Y).length() < 1e-6);
}

#[test]
fn a_surface_that_is_a_light_shines() {
    let scene = clean(
        "def Cube \"c\" ( prepend apiSchemas = [\"MeshLightAPI\"] ) { double size = 2\nfloat inputs:intensity = 12\nbool inputs:normalize = 1 }",
    );
    assert!((radiance(&scene) - 0.5).abs() < 1e-6, "an area of 24");
}

#[test]
fn unsupported_properties_of_lights_are_named() {
    let loaded = stage(
        "def SphereLight \"l\" ( prepend apiSchemas = [\"ShapingAPI\"] ) { float inputs:specular = 0\nasset inputs:shaping:ies:file = @a.ies@\n\
         float inputs:shaping:focus = 2 }\ndef PortalLight \"p\" {}\n\
         def DomeLight \"d\" {}\ndef DomeLight \"e\" {}",
    );
    for (place, text) in [
        ("/l", "`inputs:specular`"),
        ("/l", "the profile `a.ies`: there is no such file"),
        ("/l", "focus"),
        ("/p", "`PortalLight` is not supported"),
        ("/e", "second environment"),
    ] {
        assert!(warns(&loaded, place, text), "{place} {text}: {:?}", loaded.warnings);
    }
}
