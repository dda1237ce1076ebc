//! Meshes, shapes, transformations, cameras, curves, points and instances.

use bottega_scene::{AlphaMode, CurveLook, FovAxis, LoadOptions, Projection, Shutter};
use glam::{Vec2, Vec3};

use super::support::{TRIANGLE, bounds, clean, corners, stage, stage_with, warns};

fn near(a: Vec3, b: Vec3) -> bool {
    a.distance(b) < 1e-5
}

#[test]
fn a_mesh_has_the_faces_of_the_file() {
    let mesh = |more: &str| {
        clean(&format!(
            "def Mesh \"m\" {{ int[] faceVertexCounts = [3, 4]\nint[] faceVertexIndices = [0, 1, 2, 0, 2, 3, 4]\n\
             point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0.2, 0.4, 0), (0, 1, 0)]\n\
             uniform token subdivisionScheme = \"none\"\n{more} }}"
        ))
    };
    let scene = mesh("");
    assert_eq!((scene.triangle_count(), scene.meshes.len()), (3, 1));
    let side = |scene: &bottega_scene::Scene| {
        let corners = corners(scene);
        corners.chunks(3).map(|c| (c[1] - c[0]).cross(c[2] - c[0])).sum::<Vec3>().z
    };
    // The concave quadrangle is covered once: the faces have the areas 0.5 and 0.2, twice that here
    assert!((side(&scene) - 1.4).abs() < 1e-5, "{}", side(&scene));
    assert!(side(&mesh("uniform token orientation = \"leftHanded\"")) < 0.0);
    assert_eq!(mesh("int[] holeIndices = [1]").triangle_count(), 1);
    assert!(scene.meshes[0].normals.is_empty(), "flat");
}

#[test]
fn primvars_have_their_interpolation() {
    let mesh = |more: &str| {
        clean(&format!(
            "def Mesh \"m\" {{ int[] faceVertexCounts = [3, 3]\nint[] faceVertexIndices = [0, 1, 2, 0, 2, 3]\n\
             point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]\n\
             uniform token subdivisionScheme = \"none\"\n{more} }}"
        ))
    };
    let colors = |scene: &bottega_scene::Scene| -> Vec<Vec3> {
        let mesh = &scene.meshes[0];
        mesh.triangles.iter().flatten().map(|&vertex| mesh.colors[vertex as usize].truncate()).collect()
    };
    let (r, g, b) = (Vec3::X, Vec3::Y, Vec3::Z);
    let text = "color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = \"uniform\" )";
    assert_eq!(colors(&mesh(text)), [r, r, r, g, g, g]);
    let text = "color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = \"vertex\" )\n\
        int[] primvars:displayColor:indices = [0, 1, 1, 0]";
    assert_eq!(colors(&mesh(text)), [r, g, g, r, g, r]);
    let text = "color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] ( interpolation = \"faceVarying\" )\n\
        int[] primvars:displayColor:indices = [2, 1, 0, 0, 0, 0]";
    let scene = mesh(text);
    assert_eq!(colors(&scene), [b, g, r, r, r, r]);
    // One value is in the material
    let scene = mesh("color3f[] primvars:displayColor = [(0, 0.25, 0)]\nfloat[] primvars:displayOpacity = [0.5]");
    let material = &scene.materials[scene.meshes[0].material as usize];
    assert_eq!(material.layered().unwrap().base_color.factor, Vec3::Y * 0.25);
    assert_eq!((material.opacity.factor, material.alpha_mode), (0.5, AlphaMode::Blend));
    let loaded = stage(&format!("def Mesh \"m\" {{ {TRIANGLE} normal3f[] normals = [(0, 0, 1)] }}"));
    assert!(warns(&loaded, "/m", "has 1 values for 3 points"));
}

#[test]
fn wrong_meshes_are_left_out_with_their_name() {
    for (text, problem) in [
        ("int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2]", "have 4 corners"),
        ("int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 3]", "has 3, and there are 3 points"),
        ("int[] faceVertexCounts = [-3, 6]\nint[] faceVertexIndices = [0, 1, 2]", "has -3 corners"),
    ] {
        let points = "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]";
        let loaded = stage(&format!("def Mesh \"bad\" {{ {text}\n{points} }}"));
        assert!(loaded.scene.instances.is_empty() && warns(&loaded, "/bad", problem), "{:?}", loaded.warnings);
    }
    let far = stage(
        "def Mesh \"m\" { int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n\
        point3f[] points = [(0, 0, 0), (nan, 0, 0), (0, inf, 0)] }",
    );
    assert!(warns(&far, "/m", "not finite"));
}

#[test]
fn shapes_have_their_size_and_axis() {
    let (min, max) = bounds(&clean("def Cube \"c\" { double size = 3 }"));
    assert!(near(min, Vec3::splat(-1.5)) && near(max, Vec3::splat(1.5)));
    for (axis, long) in [("X", Vec3::X), ("Y", Vec3::Y), ("Z", Vec3::Z)] {
        for (kind, half) in [("Cylinder", 2.0), ("Cone", 2.0), ("Capsule", 2.5)] {
            let text = format!(
                "def {kind} \"s\" {{ double height = 4\ndouble radius = 0.5\nuniform token axis = \"{axis}\" }}"
            );
            let (_, max) = bounds(&clean(&text));
            assert!(
                (max.dot(long) - half).abs() < 1e-5 && (max.dot(Vec3::ONE) - half - 1.0).abs() < 2e-3,
                "{kind} {max}"
            );
        }
    }
    let scene = clean(
        "def Sphere \"s\" { double radius = 2\nfloat3 xformOp:scale = (0.5, 0.5, 0.5)\n\
        double3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:scale\"] }",
    );
    assert!(scene.spheres[0].radius == 1.0 && near(scene.spheres[0].center, Vec3::new(1.0, 2.0, 3.0)));
    let scene = clean(
        "def Sphere \"s\" { float3 xformOp:scale = (1, 2, 3)\nuniform token[] xformOpOrder = [\"xformOp:scale\"] }",
    );
    assert!(scene.spheres.is_empty() && near(bounds(&scene).1, Vec3::new(1.0, 2.0, 3.0)));
}

#[test]
fn transformations_follow_their_order() {
    let place = |text: &str| {
        let scene = clean(&format!(
            "def Xform \"a\" {{ double3 xformOp:translate = (10, 0, 0)\nuniform token[] xformOpOrder = [\"xformOp:translate\"]\n\
             def Mesh \"m\" {{ {TRIANGLE}{text} }} }}"
        ));
        corners(&scene)
    };
    let turned = place(
        "float xformOp:rotateZ = 90\nfloat3 xformOp:scale = (2, 1, 1)\n\
        uniform token[] xformOpOrder = [\"xformOp:rotateZ\", \"xformOp:scale\"]",
    );
    assert!(near(turned[1], Vec3::new(10.0, 2.0, 0.0)) && near(turned[2], Vec3::new(9.0, 0.0, 0.0)), "{turned:?}");
    let pivot = place(
        "float xformOp:rotateZ = 180\ndouble3 xformOp:translate:pivot = (1, 0, 0)\n\
        uniform token[] xformOpOrder = [\"xformOp:translate:pivot\", \"xformOp:rotateZ\", \"!invert!xformOp:translate:pivot\"]",
    );
    assert!(near(pivot[0], Vec3::new(12.0, 0.0, 0.0)) && near(pivot[1], Vec3::new(11.0, 0.0, 0.0)));
    let reset = place(
        "double3 xformOp:translate = (0, 5, 0)\n\
        uniform token[] xformOpOrder = [\"!resetXformStack!\", \"xformOp:translate\"]",
    );
    assert!(near(reset[0], Vec3::Y * 5.0));
    let matrix = place(
        "matrix4d xformOp:transform = ((0, 1, 0, 0), (-1, 0, 0, 0), (0, 0, 1, 0), (1, 2, 3, 1))\n\
        uniform token[] xformOpOrder = [\"xformOp:transform\"]",
    );
    assert!(near(matrix[1], Vec3::new(11.0, 3.0, 3.0)));
    let quaternion = place(
        "quatf xformOp:orient = (0.70710678, 0, 0, 0.70710678)\nuniform token[] xformOpOrder = [\"xformOp:orient\"]",
    );
    assert!(near(quaternion[1], Vec3::new(10.0, 1.0, 0.0)));
}

#[test]
fn a_stage_with_z_up_is_turned() {
    let scene = clean(&format!("#usda 1.0\n(\n upAxis = \"Z\"\n)\ndef Mesh \"m\" {{ {TRIANGLE} }}"));
    // y, which pointed away, is −z now; z is y
    assert!(near(corners(&scene)[2], Vec3::NEG_Z));
}

#[test]
fn invisible_prims_are_left_out() {
    let text = |more: &str| format!("def Xform \"a\" {{ {more}\ndef Mesh \"m\" {{ {TRIANGLE} }} }}");
    for hidden in
        ["token visibility = \"invisible\"", "uniform token purpose = \"proxy\"", "uniform token purpose = \"guide\""]
    {
        assert!(clean(&text(hidden)).instances.is_empty(), "{hidden}");
    }
    for shown in [
        "token visibility = \"inherited\"",
        "uniform token purpose = \"render\"",
        "uniform token purpose = \"default\"",
    ] {
        assert_eq!(clean(&text(shown)).instances.len(), 1, "{shown}");
    }
    for prim in ["over", "class Mesh"] {
        assert!(clean(&format!("{prim} \"m\" {{ {TRIANGLE} }}")).instances.is_empty(), "{prim}");
    }
    assert!(clean(&format!("def Mesh \"m\" ( active = false ) {{ {TRIANGLE} }}")).instances.is_empty());
}

#[test]
fn a_camera_has_its_film_and_lens() {
    let scene = clean(
        "def Camera \"eye\" { float horizontalAperture = 36\nfloat verticalAperture = 24\nfloat focalLength = 50\n\
         float horizontalApertureOffset = 9\nfloat fStop = 2\nfloat focusDistance = 7\nfloat2 clippingRange = (0.5, 100)\n\
         double3 xformOp:translate = (1, 2, 3)\nuniform token[] xformOpOrder = [\"xformOp:translate\"] }\n\
         def Camera \"flat\" { token projection = \"orthographic\"\nfloat horizontalAperture = 40\nfloat verticalAperture = 20 }",
    );
    let [camera, flat] = &scene.cameras[..] else { panic!("two cameras") };
    let Projection::Perspective { vertical_fov } = camera.projection else { panic!("not perspective") };
    assert!((vertical_fov - 2.0 * (12.0f32 / 50.0).atan()).abs() < 1e-6);
    assert_eq!((camera.name.as_str(), camera.aspect, camera.fov_axis), ("eye", Some(1.5), FovAxis::X));
    // A focal length of 50 tenths of a unit, over twice the f-number
    assert!((camera.lens_radius - 1.25).abs() < 1e-6 && camera.focus_distance == 7.0);
    assert_eq!((camera.lens_shift, camera.clip.near, camera.clip.far), (Vec2::new(-0.5, 0.0), 0.5, 100.0));
    assert!(near(camera.world_from_camera.translation.into(), Vec3::new(1.0, 2.0, 3.0)));
    assert_eq!(flat.projection, Projection::Orthographic { height: 2.0 });
}

#[test]
fn render_settings_choose_camera_and_size() {
    let loaded = stage(
        "def Camera \"a\" {}\ndef Camera \"b\" {}\ndef Scope \"Render\" { def RenderSettings \"s\" {\n\
         int2 resolution = (640, 360)\nrel camera = </b> } }",
    );
    assert_eq!(loaded.hints.resolution, Some([640, 360]));
    assert_eq!(loaded.scene.cameras[0].name, "b");
}

#[test]
fn instances_of_a_point_instancer_share_their_meshes() {
    let scene = clean(&format!(
        "def PointInstancer \"p\" {{ int[] protoIndices = [0, 1, 0, 0]\nint64[] ids = [7, 8, 9, 10]\nint64[] invisibleIds = [9]\n\
         point3f[] positions = [(0, 0, 0), (5, 0, 0), (9, 0, 0), (0, 7, 0)]\n\
         quath[] orientations = [(1, 0, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0), (0, 0, 0, 1)]\n\
         float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 1), (-1, 1, 1)]\n\
         rel prototypes = [</p/m>, </p/s>]\n\
         def Mesh \"m\" {{ {TRIANGLE} }}\ndef Sphere \"s\" {{ double radius = 0.5 }} }}"
    ));
    // The last instance mirrors: it has a mirrored copy of the mesh
    assert_eq!((scene.instances.len(), scene.spheres.len(), scene.meshes.len()), (2, 1, 2));
    assert!(scene.spheres[0].radius == 1.0 && near(scene.spheres[0].center, Vec3::X * 5.0));
    let mut ends = corners(&scene)[3..].to_vec();
    ends.sort_by(|a, b| a.x.total_cmp(&b.x).then(b.y.total_cmp(&a.y)));
    assert!(near(ends[2], Vec3::new(1.0, 7.0, 0.0)), "{ends:?}");
}

#[test]
fn native_instances_share_their_meshes() {
    let scene = clean(&format!(
        "class Xform \"_c\" {{ def Mesh \"m\" {{ {TRIANGLE} }} }}\n\
         def \"a\" ( instanceable = true\n inherits = </_c> ) {{}}\n\
         def \"b\" ( instanceable = true\n inherits = </_c> ) {{ double3 xformOp:translate = (3, 0, 0)\n\
         uniform token[] xformOpOrder = [\"xformOp:translate\"] }}"
    ));
    assert_eq!((scene.instances.len(), scene.meshes.len(), scene.materials.len()), (2, 1, 1));
    assert!(corners(&scene).iter().any(|&corner| near(corner, Vec3::X * 4.0)));
}

#[test]
fn curves_become_strands_and_points_spheres() {
    let scene = clean(
        "def BasisCurves \"c\" { uniform token type = \"cubic\"\nuniform token basis = \"bspline\"\nuniform token wrap = \"pinned\"\n\
         int[] curveVertexCounts = [4, 5]\nfloat[] widths = [0.2] ( interpolation = \"constant\" )\n\
         point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0), (0, 1, 0), (1, 1, 0), (2, 2, 0), (3, 1, 0), (4, 1, 0)] }\n\
         def Points \"p\" { point3f[] points = [(1, 0, 0), (2, 0, 0)]\nfloat[] widths = [0.5, 1] }",
    );
    let curves = scene.meshes[0].curves.as_ref().unwrap();
    assert_eq!((curves.look, curves.points.iter().filter(|point| point.is_last).count()), (CurveLook::Round, 2));
    assert!(near(curves.points[0].position, Vec3::ZERO) && (curves.points[0].radius - 0.1).abs() < 1e-6);
    let radii: Vec<f32> = scene.spheres.iter().map(|sphere| sphere.radius).collect();
    assert_eq!(radii, [0.25, 0.5]);
}

#[test]
fn samples_are_taken_at_the_time_and_move_while_the_shutter_is_open() {
    let text = format!(
        "#usda 1.0\n(\n timeCodesPerSecond = 10\n)\ndef Xform \"a\" {{ double3 xformOp:translate.timeSamples = {{ 0: (0, 0, 0), 10: (1, 0, 0) }}\n\
         uniform token[] xformOpOrder = [\"xformOp:translate\"]\ndef Mesh \"m\" {{ {TRIANGLE} }}\ndef Sphere \"s\" {{ }}\n\
         def Camera \"c\" {{ }} }}"
    );
    let at = |options: &LoadOptions| stage_with(&text, options).unwrap().scene;
    let still = at(&LoadOptions { at: Some(0.5), ..LoadOptions::default() });
    assert!(near(corners(&still)[0], Vec3::X * 0.5) && near(still.spheres[0].center, Vec3::X * 0.5));
    assert!(near(corners(&at(&LoadOptions::default()))[0], Vec3::ZERO), "the earliest sample");
    let shutter = Some(Shutter::new(0.0, 0.2).unwrap());
    let moving = at(&LoadOptions { at: Some(0.5), shutter, ..LoadOptions::default() });
    let last = moving.instances[0].motion.last().unwrap();
    assert!((last.time - 0.7).abs() < 1e-6 && (last.transform.translation.x - 0.7).abs() < 1e-6);
    assert!((moving.spheres[0].motion.last().unwrap().center.x - 0.7).abs() < 1e-6);
    assert!(!moving.cameras[0].motion.is_empty());
}

#[test]
fn skins_and_blend_shapes_move_points() {
    let text = format!(
        "#usda 1.0\n(\n timeCodesPerSecond = 1\n)\ndef SkelRoot \"r\" {{\n\
         def Skeleton \"k\" {{ uniform token[] joints = [\"a\", \"a/b\"]\n\
         uniform matrix4d[] bindTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)), ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 1))]\n\
         uniform matrix4d[] restTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)), ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 0, 0, 1))]\n\
         rel skel:animationSource = </r/n> }}\n\
         def SkelAnimation \"n\" {{ uniform token[] joints = [\"a/b\"]\nfloat3[] translations = [(1, 0, 0)]\nhalf3[] scales = [(1, 1, 1)]\n\
         quatf[] rotations.timeSamples = {{ 0: [(1, 0, 0, 0)], 1: [(0.70710678, 0, 0, 0.70710678)] }}\n\
         uniform token[] blendShapes = [\"up\"]\nfloat[] blendShapeWeights.timeSamples = {{ 0: [0], 1: [1] }} }}\n\
         def Mesh \"m\" {{ {TRIANGLE} rel skel:skeleton = </r/k>\nuniform token[] skel:blendShapes = [\"up\"]\nrel skel:blendShapeTargets = </r/m/up>\n\
         int[] primvars:skel:jointIndices = [0, 1, 0] ( elementSize = 1\n interpolation = \"vertex\" )\n\
         float[] primvars:skel:jointWeights = [1, 1, 1] ( elementSize = 1\n interpolation = \"vertex\" )\n\
         def BlendShape \"up\" {{ uniform vector3f[] offsets = [(0, 0, 3), (1, 0, 0)]\nuniform int[] pointIndices = [0, 1] }} }} }}"
    );
    let at = |seconds: f32| {
        corners(&stage_with(&text, &LoadOptions { at: Some(seconds), ..LoadOptions::default() }).unwrap().scene)
    };
    let still = at(0.0);
    assert!(near(still[0], Vec3::ZERO) && near(still[1], Vec3::X), "{still:?}");
    // Its shape moves the second point to 1 beyond the joint b, and there it turns about it by 90°
    let moved = at(1.0);
    assert!(
        near(moved[0], Vec3::Z * 3.0) && near(moved[1], Vec3::new(1.0, 1.0, 0.0)) && near(moved[2], Vec3::Y),
        "{moved:?}"
    );
}
