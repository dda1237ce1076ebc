//! Subdivision surfaces.

use bottega_scene::{LoadOptions, Scene, Shutter};
use glam::Vec3;

use super::support::{bounds, clean, stage, stage_with, warnings, warns};

/// The properties of a cube with sides of length 2.
const CUBE: &str = "int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]\n\
    int[] faceVertexIndices = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]\n";

const SMOOTH: &str = "uniform token subdivisionScheme = \"catmullClark\"\n";

const POINTS: &str =
    "[(-1, -1, -1), (1, -1, -1), (-1, 1, -1), (1, 1, -1), (-1, -1, 1), (1, -1, 1), (-1, 1, 1), (1, 1, 1)]";

/// A cube with a scheme: that of `more`, else Catmull and Clark's.
fn cube(more: &str) -> String {
    let usual = if more.contains("subdivisionScheme") { "" } else { SMOOTH };
    cube_as_given(&format!("{usual}{more}"))
}

fn cube_as_given(more: &str) -> String {
    format!("def Mesh \"m\" {{ {CUBE}point3f[] points = {POINTS}\n{more} }}")
}

fn with_level(text: &str, level: Option<u8>) -> Scene {
    stage_with(text, &LoadOptions { subdivision: level, ..LoadOptions::default() }).unwrap().scene
}

#[test]
fn a_mesh_without_a_scheme_is_its_polygons_unless_a_level_is_asked_for() {
    let scene = clean(&cube_as_given(""));
    assert_eq!((scene.triangle_count(), bounds(&scene)), (12, (Vec3::NEG_ONE, Vec3::ONE)));
    assert_eq!(with_level(&cube_as_given(""), Some(2)).meshes, clean(&cube("")).meshes);
    // Its own normals count then
    let text = cube_as_given("normal3f[] normals = [(0, 0, 1)] ( interpolation = \"constant\" )");
    assert!(clean(&text).meshes[0].normals.iter().all(|&normal| normal == Vec3::Z));
}

#[test]
fn a_mesh_with_a_scheme_is_a_smooth_surface() {
    let scene = clean(&cube(""));
    assert_eq!(scene.triangle_count(), 6 * 16 * 2);
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.positions.len(), mesh.normals.len()), (98, 98));
    // The limit of a corner, and of the middle of a face
    let corner = mesh.positions.iter().map(|point| point.min_element()).fold(0.0, f32::max);
    assert!((corner - 0.5).abs() < 1e-6, "{corner}");
    for (point, normal) in mesh.positions.iter().zip(&mesh.normals) {
        assert!(normal.dot(point.normalize()) > 0.95);
    }
    assert_eq!(with_level(&cube(""), Some(2)).meshes, scene.meshes);
    for (level, triangles) in [(0, 12), (1, 48), (3, 768), (6, 49152)] {
        assert_eq!(with_level(&cube(""), Some(level)).triangle_count(), triangles);
    }
    // Without levels the polygons have smooth normals
    let flat = with_level(&cube(""), Some(0));
    assert!(flat.meshes[0].positions.len() == 8 && flat.meshes[0].normals.len() == 8);
    let left = clean(&cube("uniform token orientation = \"leftHanded\""));
    let mesh = &left.meshes[0];
    assert!(mesh.triangles.iter().all(|&[a, b, c]| {
        let [a, b, c, n] = [
            mesh.positions[a as usize],
            mesh.positions[b as usize],
            mesh.positions[c as usize],
            mesh.normals[a as usize],
        ];
        (b - a).cross(c - a).dot(a) < 0.0 && n.dot(a) < 0.0
    }));
}

#[test]
fn polygons_stay_as_they_are_at_any_level() {
    let text = cube(
        "uniform token subdivisionScheme = \"none\"\nnormal3f[] normals = [(0, 0, 1)] ( interpolation = \"constant\" )",
    );
    let first = with_level(&text, None);
    assert_eq!(first.triangle_count(), 12);
    assert_eq!(with_level(&text, Some(5)).meshes, first.meshes);
    assert!(first.meshes[0].normals.iter().all(|&normal| normal == Vec3::Z));
    // Normals of subdivision surfaces are ignored
    let loaded = stage(&cube("normal3f[] normals = [(0, 0, 1)] ( interpolation = \"constant\" )"));
    assert!(warns(&loaded, "/m", "are ignored"));
    assert_eq!(loaded.scene.meshes, clean(&cube("")).meshes);
}

#[test]
fn schemes_and_rules_of_the_file_count() {
    let bilinear = clean(&cube("uniform token subdivisionScheme = \"bilinear\""));
    assert_eq!((bilinear.triangle_count(), bounds(&bilinear).1), (192, Vec3::ONE));
    assert!(bilinear.meshes[0].normals.is_empty());
    let loaded = stage(&cube("uniform token subdivisionScheme = \"loop\""));
    assert!(warns(&loaded, "/m", "needs triangles") && loaded.scene.triangle_count() == 12);
    // A cube whose edges are all sharp stays one
    let creases = "int[] creaseIndices = [0, 1, 3, 2, 0, 4, 5, 7, 6, 4, 0, 4, 1, 5, 2, 6, 3, 7]\n\
        int[] creaseLengths = [5, 5, 2, 2, 2, 2]\nfloat[] creaseSharpnesses = [10, 10, 10, 10, 10, 10]";
    let sharp = clean(&cube(creases));
    assert_eq!(bounds(&sharp), (Vec3::NEG_ONE, Vec3::ONE));
    assert!(sharp.meshes[0].normals.iter().all(|normal| normal.abs().max_element() > 0.9999));
    let holes = clean(&cube("int[] holeIndices = [1]"));
    assert_eq!(holes.triangle_count(), 5 * 32);
    let wrong =
        stage(&cube("int[] creaseIndices = [0, 1, 3]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [1]"));
    assert!(warns(&wrong, "/m", "the creases are left out"));
    let missing = stage(&cube(
        "int[] cornerIndices = [99]\nfloat[] cornerSharpnesses = [1]\nint[] creaseIndices = [0, 7]\n\
        int[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [1]",
    ));
    assert!(warns(&missing, "/m", "1 creases are not along edges"));
}

#[test]
fn primvars_follow_their_interpolation() {
    let colors = |values: &str, interpolation: &str| {
        let text = format!("color3f[] primvars:displayColor = [{values}] ( interpolation = \"{interpolation}\" )");
        let scene = clean(&cube(&text));
        scene.meshes[0].colors.iter().map(|color| color.x).collect::<Vec<f32>>()
    };
    let values =
        |count: usize| (0..count).map(|i| format!("({}, 0, 0)", u32::from(i == 7))).collect::<Vec<_>>().join(", ");
    let largest = |colors: &[f32]| colors.iter().copied().fold(0.0, f32::max);
    // The limit at a vertex of valence 3 has the weight 3/8
    assert!((largest(&colors(&values(8), "vertex")) - 0.375).abs() < 1e-6);
    assert_eq!(largest(&colors(&values(8), "varying")), 1.0);
    let uniform = colors("(1, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)", "uniform");
    assert_eq!(uniform.iter().filter(|&&value| value == 1.0).count(), 25);
    // The values of one corner: a region of one face, which keeps its corners
    assert_eq!(largest(&colors(&values(24), "faceVarying")), 1.0);
}

#[test]
fn moving_points_are_refined_at_each_key() {
    let moved = POINTS.replace('1', "3");
    let text = format!(
        "def Mesh \"m\" {{ {SMOOTH}{CUBE}point3f[] points.timeSamples = {{ 0: {POINTS}, 24: {moved} }}\n\
        int[] creaseIndices = [4, 5, 7, 6, 4]\nint[] creaseLengths = [5]\nfloat[] creaseSharpnesses = [10] }}"
    );
    let shutter = Some(Shutter { open: 0.0, close: 0.5, ramp: 0.0 });
    let loaded = stage_with(&text, &LoadOptions { shutter, ..LoadOptions::default() }).unwrap();
    assert!(!warnings(&loaded).iter().any(|warning| warning.contains("other triangles")));
    let mesh = &loaded.scene.meshes[0];
    let last = mesh.motion.last().unwrap();
    assert_eq!(last.positions.len(), mesh.positions.len());
    for (from, to) in mesh.positions.iter().zip(&last.positions) {
        assert!((*to - *from * 2.0).length() < 1e-5, "{from} {to}");
    }
}

#[test]
fn a_mesh_is_refined_no_further_than_faces_and_memory_allow() {
    let text = cube("");
    let options = LoadOptions { subdivision: Some(6), max_memory_bytes: 2 << 20, ..LoadOptions::default() };
    let loaded = stage_with(&text, &options).unwrap();
    assert!(warns(&loaded, "/m", "instead of 6"), "{:?}", warnings(&loaded));
    assert_eq!(loaded.scene.triangle_count(), 24 * 64 * 2);
    // Levels beyond the greatest one are the greatest one
    let options = LoadOptions { subdivision: Some(255), ..LoadOptions::default() };
    assert_eq!(stage_with(&text, &options).unwrap().scene.triangle_count(), 49152);
}
