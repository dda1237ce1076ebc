//! Shapes: their positions and their front sides.

use std::f64::consts::PI;

use bottega_scene::{CurveLook, Mesh, Scene, Sides, Surface};
use glam::{Affine3A, Quat, Vec2, Vec3};

use crate::mitsuba::support::{Folder, bare, read, silent, warnings};

/// The front normal of the first triangle of an instance, world space.
fn front(scene: &Scene, instance: usize) -> Vec3 {
    let instance = &scene.instances[instance];
    let mesh = &scene.meshes[instance.mesh as usize];
    let [a, b, c] =
        mesh.triangles[0].map(|vertex| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]));
    (b - a).cross(c - a).normalize()
}

fn world_area(scene: &Scene) -> f64 {
    let area = |transform: &Affine3A, mesh: &Mesh| -> f64 {
        let corners = |triangle: &[u32; 3]| triangle.map(|v| transform.transform_point3(mesh.positions[v as usize]));
        mesh.triangles.iter().map(corners).map(|[a, b, c]| f64::from((b - a).cross(c - a).length()) / 2.0).sum()
    };
    scene.instances.iter().map(|i| area(&i.world_from_object, &scene.meshes[i.mesh as usize])).sum()
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 -1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1/1 2/2/1 3/3/1\n";
const BARE_TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// The fronts are those of Mitsuba 3.9: by the normals of a mesh that has them, else by the winding.
#[test]
fn the_front_of_a_mesh_is_that_of_its_shading_normals() {
    let mirror = "<transform name='to_world'><scale x='-1'/></transform>";
    let cases = [
        (TRIANGLE, "", -1.0),
        (TRIANGLE, "<boolean name='flip_normals' value='true'/>", 1.0),
        (TRIANGLE, "<boolean name='face_normals' value='true'/>", 1.0),
        (TRIANGLE, "<boolean name='face_normals' value='true'/><boolean name='flip_normals' value='true'/>", -1.0),
        (TRIANGLE, mirror, -1.0),
        (BARE_TRIANGLE, "", 1.0),
        (BARE_TRIANGLE, "<boolean name='flip_normals' value='true'/>", -1.0),
        (BARE_TRIANGLE, mirror, -1.0),
    ];
    for (file, properties, z) in cases {
        let content = format!("<shape type='obj'><string name='filename' value='a.obj'/>{properties}</shape>");
        let loaded = Folder::new().with("a.obj", file).scene(&content).load(&bare()).unwrap();
        assert_eq!(front(&loaded.scene, 0), Vec3::Z * z, "{file} {properties}");
    }
}

#[test]
fn solids_look_outwards_also_when_they_are_mirrored() {
    for (plugin, area) in [("rectangle", 4.0), ("cube", 24.0), ("disk", PI), ("cylinder", 2.0 * PI)] {
        for (transform, z) in [("", 1.0), ("<scale x='-1'/>", 1.0), ("<scale z='-1'/>", -1.0)] {
            let text = format!("<shape type='{plugin}'><transform name='to_world'>{transform}</transform></shape>");
            let loaded = silent(&text);
            assert!((world_area(&loaded.scene) / area - 1.0).abs() < 3e-4, "{plugin}");
            if plugin == "rectangle" || plugin == "disk" {
                assert_eq!(front(&loaded.scene, 0), Vec3::Z * z, "{plugin} {transform}");
            } else {
                let mesh = &loaded.scene.meshes[0];
                let [a, b, c] = mesh.triangles[0].map(|vertex| mesh.positions[vertex as usize]);
                // The normal must not point to the axis of the solid.
                let outwards = (a + b + c) / 3.0 - if plugin == "cylinder" { Vec3::Z * a.z } else { Vec3::ZERO };
                assert!((b - a).cross(c - a).dot(outwards * Vec3::new(1.0, 1.0, 0.0)) >= 0.0, "{plugin} {transform}");
            }
        }
    }
}

#[test]
fn round_spheres_stay_spheres_and_others_become_triangles() {
    let loaded = silent(
        "<shape type='sphere'><point name='center' value='1 2 3'/><float name='radius' value='0.5'/>
            <transform name='to_world'><rotate y='1' angle='90'/><scale value='2'/><translate x='10'/></transform></shape>",
    );
    let sphere = &loaded.scene.spheres[0];
    assert!((sphere.center - Vec3::new(16.0, 4.0, -2.0)).length() < 1e-5, "{}", sphere.center);
    assert!((sphere.radius - 1.0).abs() < 1e-6);
    let loaded = silent("<shape type='sphere'><transform name='to_world'><scale x='2'/></transform></shape>");
    assert!(loaded.scene.spheres.is_empty());
    // Knud Thomsen's formula for the surface of an ellipsoid (within 1.1 %).
    let p = 1.6075f64;
    let mean = (2.0 * 2f64.powf(p) + 1.0) / 3.0;
    let expected = 4.0 * std::f64::consts::PI * mean.powf(1.0 / p);
    assert!((world_area(&loaded.scene) / expected - 1.0).abs() < 0.011);
}

/// The points of a sphere with the texture coordinates (0, ½), (¼, ½) and (½, 0), in Mitsuba: +x, +y, +z.
#[test]
fn the_poles_of_a_sphere_lie_along_z() {
    let loaded = silent("<shape type='sphere'/>");
    let ours = loaded.scene.spheres[0].world_from_object;
    let uv = |n: Vec3| {
        let n = ours.inverse() * n;
        Vec2::new((0.5 + n.x.atan2(n.z) / std::f32::consts::TAU).rem_euclid(1.0), n.y.acos() / std::f32::consts::PI)
    };
    for (n, expected) in [
        (Vec3::new(0.933, 0.3, 0.2), Vec2::new(0.0495, 0.4359)),
        (Vec3::new(0.2, 0.933, 0.3), Vec2::new(0.2164, 0.403)),
        (Vec3::new(0.3, -0.2, -0.933), Vec2::new(0.9064, 0.8826)),
    ] {
        assert!((uv(n.normalize()) - expected).length() < 1e-3, "{n}: {}", uv(n.normalize()));
    }
    assert!(ours.is_normalized() && ours != Quat::IDENTITY);
}

#[test]
fn a_sphere_that_looks_inwards_shines_inwards() {
    let loaded =
        silent("<shape type='sphere'><boolean name='flip_normals' value='true'/><emitter type='area'/></shape>");
    let sphere = &loaded.scene.spheres[0];
    assert_eq!(loaded.scene.materials[sphere.material as usize].emission_sides, Sides::Back);
    let loaded = silent(
        "<shape type='sphere'><boolean name='flip_normals' value='true'/><bsdf type='dielectric'>
            <float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/></bsdf></shape>",
    );
    let material = &loaded.scene.materials[loaded.scene.spheres[0].material as usize];
    assert!(matches!(&material.surface, Surface::Dielectric(d) if (d.eta - 1.0 / 1.5).abs() < 1e-6));
}

/// Mitsuba 3.9 renders both of these, the first dark and the second lit, seen from outside.
#[test]
fn a_sphere_turns_inwards_by_its_own_mirror_but_not_by_that_of_its_instance() {
    let bsdf = "<bsdf type='diffuse'/>";
    let mirror = "<transform name='to_world'><scale x='-1'/></transform>";
    let scene = silent(&format!("<shape type='sphere'>{bsdf}{mirror}</shape>")).scene;
    let material = &scene.materials[scene.spheres[0].material as usize];
    assert_eq!(material.surface, Surface::matte(Vec3::ZERO));
    assert_eq!(material.back, bottega_scene::Back::Other(Box::new(Surface::matte(Vec3::splat(0.5)))));
    let group = |stretch: &str| {
        let place = format!("<transform name='to_world'><scale x='-1' z='{stretch}'/></transform>");
        let group = format!("<shape type='shapegroup' id='g'><shape type='sphere'>{bsdf}</shape></shape>");
        silent(&format!("{group}<shape type='instance'><ref id='g'/>{place}</shape>")).scene
    };
    let scene = group("1");
    assert_eq!(scene.materials[scene.spheres[0].material as usize].back, bottega_scene::Back::Black);
    // A stretched sphere becomes triangles.
    let scene = group("2");
    let mesh = &scene.meshes[0];
    let [a, b, c] = mesh.triangles[0].map(|vertex| mesh.positions[vertex as usize]);
    assert!((b - a).cross(c - a).dot(a) > 0.0 && mesh.normals[0].dot(mesh.positions[0]) > 0.0);
}

#[test]
fn instances_of_instances_are_placed_one_by_one() {
    let loaded = silent(
        "<shape type='shapegroup' id='inner'><shape type='rectangle'/><shape type='sphere'/></shape>
         <shape type='shapegroup' id='outer'>
            <shape type='instance'><ref id='inner'/><transform name='to_world'><translate x='1'/></transform></shape>
            <shape type='instance'><ref id='inner'/><transform name='to_world'><scale x='-1'/><translate x='-1'/></transform></shape>
         </shape>
         <shape type='instance'><ref id='outer'/><transform name='to_world'><translate y='5'/></transform></shape>
         <shape type='instance'><ref id='outer'/><transform name='to_world'><scale value='2'/></transform></shape>",
    );
    let scene = &loaded.scene;
    assert_eq!((scene.instances.len(), scene.spheres.len()), (4, 4));
    // One mesh and its mirrored copy.
    assert_eq!(scene.meshes.len(), 2);
    let origins: Vec<Vec3> = scene.instances.iter().map(|i| i.world_from_object.transform_point3(Vec3::ZERO)).collect();
    assert_eq!(
        origins,
        [Vec3::new(1.0, 5.0, 0.0), Vec3::new(-1.0, 5.0, 0.0), Vec3::new(2.0, 0.0, 0.0), Vec3::new(-2.0, 0.0, 0.0)]
    );
    for index in 0..4 {
        assert_eq!(front(scene, index), Vec3::Z);
    }
    let radii: Vec<f32> = scene.spheres.iter().map(|sphere| sphere.radius).collect();
    assert!(radii.iter().zip([1.0, 1.0, 2.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{radii:?}");
}

#[test]
fn texture_coordinates_are_kept_where_a_texture_asks_for_them() {
    let textured = "<bsdf type='diffuse'><texture name='reflectance' type='checkerboard'/></bsdf>";
    let obj = |bsdf: &str| {
        let content = format!("<shape type='obj'><string name='filename' value='a.obj'/>{bsdf}</shape>");
        Folder::new().with("a.obj", TRIANGLE).scene(&content).load(&bare()).unwrap()
    };
    assert!(obj("").scene.meshes[0].uvs[0].is_empty());
    // v of an OBJ file points up.
    assert_eq!(obj(textured).scene.meshes[0].uvs[0], [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::ZERO]);
    let rectangle = silent(&format!("<shape type='rectangle'>{textured}</shape>"));
    assert_eq!(rectangle.scene.meshes[0].uvs[0][2], Vec2::ONE);
}

#[test]
fn a_mesh_and_a_picture_that_are_used_often_are_there_once() {
    // Enough triangles to pay for an instance.
    let mut obj = String::new();
    (0..300).for_each(|i| obj += &format!("v {i} 0 0\nv {i} 1 0\n"));
    (1..599).for_each(|i| obj += &format!("f {i} {} {}\n", i + 1, i + 2));
    let picture =
        "<texture name='reflectance' type='bitmap'><string name='filename' value='./sub/../a.pfm'/></texture>";
    let shape = |bsdf: &str, place: &str| {
        format!(
            "<shape type='obj'><string name='filename' value='a.obj'/>{bsdf}<transform name='to_world'>{place}</transform></shape>"
        )
    };
    let shared = format!("<bsdf type='diffuse' id='a'>{picture}</bsdf>");
    let other =
        format!("<bsdf type='twosided'><bsdf type='diffuse'>{}</bsdf></bsdf>", picture.replace("./sub/../", ""));
    let content = shared
        + &shape("<ref id='a'/>", "")
        + &shape("<ref id='a'/>", "<translate x='5'/>")
        + &shape("<ref id='a'/>", "<scale x='-1'/>")
        + &shape("<ref id='a'/>", "<scale y='-2'/>")
        + &shape(&other, "");
    let picture = [b"PF\n1 1\n-1.0\n".to_vec(), vec![0; 12]].concat();
    let folder = Folder::new().with("a.obj", obj).with("a.pfm", picture).scene(&content);
    let loaded = folder.load(&bare()).unwrap();
    let scene = &loaded.scene;
    assert_eq!(warnings(&loaded), Vec::<String>::new());
    // One with that material, its mirror image, and one with the other material.
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.images.len()), (3, 5, 1));
    assert_eq!(scene.instances[1].mesh, scene.instances[0].mesh);
    assert_eq!(scene.instances[3].mesh, scene.instances[2].mesh);
    assert_eq!(scene.instances[1].world_from_object.translation, Vec3::new(5.0, 0.0, 0.0).into());
    assert!(scene.instances.iter().all(|instance| instance.world_from_object.matrix3.determinant() > 0.0));
}

#[test]
fn normal_maps_bring_tangents_as_mitsuba_has_them() {
    let content = "<shape type='rectangle'><bsdf type='normalmap'><texture name='normalmap' type='checkerboard'/>
        <bsdf type='diffuse'/></bsdf></shape>";
    let loaded = silent(content);
    let mesh = &loaded.scene.meshes[0];
    assert!(mesh.tangents.iter().all(|t| t.truncate().abs_diff_eq(Vec3::X, 1e-6) && t.w == 1.0), "{:?}", mesh.tangents);
}

#[test]
fn vertex_colors_are_kept_where_a_texture_uses_them() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float r\nproperty float g\nproperty float b\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0\n1 0 0 0 1 0\n0 1 0 0 0.5 0\n3 0 1 2\n";
    let load = |bsdf: &str| {
        let content = format!("<shape type='ply'><string name='filename' value='a.ply'/>{bsdf}</shape>");
        Folder::new().with("a.ply", ply).scene(&content).load(&bare()).unwrap()
    };
    assert!(load("").scene.meshes[0].colors.is_empty());
    let attribute = "<bsdf type='diffuse'><texture type='mesh_attribute' name='reflectance'><string name='name' value='vertex_color'/></texture></bsdf>";
    let colors = load(attribute).scene.meshes[0].colors.clone();
    assert!((colors[2].truncate() - Vec3::new(0.0, 0.5, 0.0)).length() < 1e-6, "{colors:?}");
}

#[test]
fn faces_have_colors_of_their_own() {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             element face 2\nproperty float r\nproperty list uchar int vertex_indices\nproperty float g\nproperty float b\nend_header\n"
        )
    };
    let ascii = header("ascii") + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 4 0 1 2 3 0 1\n0 3 0 1 2 0.25 nan\n";
    let mut binary = header("binary_little_endian").into_bytes();
    let floats = |bytes: &mut Vec<u8>, list: &[f32]| list.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    floats(&mut binary, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.5]);
    let corners = |bytes: &mut Vec<u8>, list: &[i32]| {
        bytes.push(list.len() as u8);
        list.iter().for_each(|corner| bytes.extend(corner.to_le_bytes()));
    };
    corners(&mut binary, &[0, 1, 2, 3]);
    floats(&mut binary, &[0.0, 1.0, 0.0]);
    corners(&mut binary, &[0, 1, 2]);
    floats(&mut binary, &[0.25, f32::NAN]);
    let content = "<shape type='ply'><string name='filename' value='a.ply'/><bsdf type='diffuse'>
        <texture type='mesh_attribute' name='reflectance'><string name='name' value='face_color'/></texture></bsdf></shape>";
    for ply in [ascii.into_bytes(), binary] {
        let loaded = Folder::new().with("a.ply", ply).scene(content).load(&bare()).unwrap();
        let mesh = &loaded.scene.meshes[0];
        assert_eq!(warnings(&loaded), Vec::<String>::new());
        // A square is two triangles of its colour; each has corners of its own.
        let colors: Vec<Vec3> = mesh.triangles.iter().map(|t| mesh.colors[t[0] as usize].truncate()).collect();
        assert_eq!(colors, [Vec3::new(0.5, 0.0, 1.0), Vec3::new(0.5, 0.0, 1.0), Vec3::new(0.0, 0.25, 0.0)]);
        assert_eq!(mesh.positions.len(), 9);
    }
}

#[test]
fn missing_mesh_colors_are_reported() {
    let loaded = read("<shape type='sphere'><bsdf type='roughconductor'>
        <texture type='mesh_attribute' name='alpha'><string name='name' value='vertex_color'/></texture></bsdf></shape>");
    assert!(
        warnings(&loaded)[0].contains("has no attribute `vertex_color`; 0.5 replaces it"),
        "{:?}",
        warnings(&loaded)
    );
}

#[test]
fn a_shape_without_volume_is_reported_and_left_out() {
    let loaded = read("<shape type='cube'><transform name='to_world'><scale x='0'/></transform></shape>");
    assert!(loaded.scene.instances.is_empty());
    assert!(warnings(&loaded)[0].contains("squeezed flat"), "{:?}", warnings(&loaded));
}

#[test]
fn a_mesh_without_triangles_is_left_out() {
    let folder = Folder::new()
        .with("points.obj", "v 0 0 0\nv 1 0 0\n")
        .scene("<shape type='obj'><string name='filename' value='points.obj'/></shape><shape type='rectangle'/>");
    let loaded = folder.load(&bare()).unwrap();
    assert_eq!((loaded.scene.instances.len(), loaded.scene.triangle_count()), (1, 2));
    assert!(warnings(&loaded)[0].contains("has no triangles"), "{:?}", warnings(&loaded));
}

/// The file in Mitsuba's documentation of `linearcurve`, shortened, and one for `bsplinecurve`.
const CURVES: &str = "-1 0 0 0.1\n1 0 0 0.1\n\n0 -2 0 0.2\n0 -1 0 0.2\n0 0 0 0.2\n0 1 0 0.2\n";

fn curves(plugin: &str, file: &str, inner: &str) -> bottega_scene::Loaded {
    let content = format!("<shape type='{plugin}'><string name='filename' value='hair.txt'/>{inner}</shape>");
    let folder = Folder::new().with("hair.txt", file).scene(&content);
    folder.load(&bare()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn curves_keep_their_radii_whatever_moves_them() {
    let scaled = "<transform name='to_world'><scale x='3' y='-2'/></transform>";
    for (inner, x, y) in [("", 1.0, 1.0), (scaled, 3.0, 2.0)] {
        let loaded = curves("linearcurve", CURVES, inner);
        assert_eq!(warnings(&loaded), Vec::<String>::new());
        // Cylinders between, spheres at the ends.
        let expected = 2.0 * PI * (0.1 * 2.0 * x + 0.2 * 3.0 * y) + 4.0 * PI * (0.01 + 0.04);
        assert!((world_area(&loaded.scene) / expected - 1.0).abs() < 5e-3, "{} {expected}", world_area(&loaded.scene));
        let mesh = &loaded.scene.meshes[0];
        assert!(mesh.triangles.iter().all(|triangle| {
            let [a, b, c] = triangle.map(|vertex| mesh.positions[vertex as usize]);
            (b - a).cross(c - a).dot(mesh.normals[triangle[0] as usize]) > 0.0
        }));
    }
    // Of four control points, the one piece between the inner two, open at its ends.
    let spline = curves("bsplinecurve", CURVES.split_once("\n\n").unwrap().1, "");
    assert!((world_area(&spline.scene) / (2.0 * PI * 0.2) - 1.0).abs() < 5e-3, "{}", world_area(&spline.scene));
}

#[test]
fn curves_of_hair_stay_curves() {
    let bspline = CURVES.split_once("\n\n").unwrap().1;
    let hair = "<bsdf type='twosided'><bsdf type='hair'/></bsdf>";
    for (plugin, file, count) in [("bsplinecurve", bspline, 1), ("linearcurve", CURVES, 2)] {
        let loaded = curves(plugin, file, hair);
        let mesh = &loaded.scene.meshes[0];
        let strands = mesh.curves.as_deref().expect("curves");
        assert_eq!(strands.look, CurveLook::Round);
        assert_eq!(strands.points.iter().filter(|point| point.is_last).count(), count);
        assert!(
            strands.points.iter().all(|point| [0.1, 0.2].iter().any(|radius| (point.radius - radius).abs() < 1e-6))
        );
        let last = strands.points.last().unwrap();
        assert!((last.along - 1.0).abs() < 1e-6 && (last.tangent - Vec3::Y).length() < 1e-6, "{last:?}");
        // What is not hair, or shines, is a tube.
        let lamp = format!("{hair}<emitter type='area'><rgb name='radiance' value='1'/></emitter>");
        for inner in ["<bsdf type='diffuse'/>", &lamp] {
            assert!(curves(plugin, file, inner).scene.meshes[0].curves.is_none(), "{inner}");
        }
    }
}

#[test]
fn instances_scale_curves_as_a_whole() {
    let group = "<shape type='shapegroup' id='g'><shape type='linearcurve'><string name='filename' value='hair.txt'/>
        </shape></shape>
        <shape type='instance'><ref id='g'/><transform name='to_world'><scale value='2'/></transform></shape>";
    let once = world_area(&curves("linearcurve", CURVES, "").scene);
    let scene = Folder::new().with("hair.txt", CURVES).scene(group).load(&bare()).unwrap().scene;
    assert!((world_area(&scene) / once / 4.0 - 1.0).abs() < 1e-5);
}

#[test]
fn curves_that_cannot_be_are_refused_by_file_and_place() {
    for (plugin, file, place) in [
        ("bsplinecurve", CURVES, "line 1, column 1"),
        ("linearcurve", "0 0 0 1\n0 0 one 1\n", "line 2, column 5"),
        ("linearcurve", "", "no control points"),
    ] {
        let content = format!("<shape type='{plugin}'><string name='filename' value='hair.txt'/></shape>");
        let folder = Folder::new().with("hair.txt", file).scene(&content);
        let error = folder.load(&bare()).unwrap_err().to_string();
        assert!(error.contains("hair.txt") && error.contains(place), "{error}");
    }
    let content = "<shape type='linearcurve'><string name='filename' value='hair.txt'/></shape>";
    let small = bottega_scene::LoadOptions { max_memory_bytes: 10_000, ..bare() };
    let error = Folder::new().with("hair.txt", CURVES).scene(content).load(&small).unwrap_err().to_string();
    assert!(error.contains("scene.xml:2:1"), "{error}");
}
