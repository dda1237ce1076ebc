//! Positions that OpenSubdiv gives, by Blender's modifier *Subdivision Surface*.

use glam::Vec3;

use super::tests::TestMesh;
use super::*;

/// Refined points, and those of the limit surface.
type Expected = ([[f32; 3]; 5], [[f32; 3]; 5]);

/// Compares points of level 2.
fn check(mesh: &TestMesh, control: &ControlMesh<'_>, (refined, limits): &Expected) {
    let subdivision = Subdivision::new(control, 2).0.unwrap();
    let points: Vec<Vec3> =
        subdivision.refined(|point| mesh.points[point].as_dvec3()).into_iter().map(glam::DVec3::as_vec3).collect();
    let on_surface = subdivision.points(&mesh.points).0;
    for (expected, found) in [(refined, points), (limits, on_surface)] {
        for expected in expected.map(Vec3::from_array) {
            let distance = found.iter().map(|point| point.distance(expected)).fold(f32::MAX, f32::min);
            assert!(distance < 1e-5, "{expected}: {distance}");
        }
    }
}

#[test]
fn creases_are_those_of_opensubdiv() {
    let mesh = TestMesh::cube();
    let mut control = mesh.control(Scheme::CatmullClark);
    let top = [[4, 5], [5, 7], [6, 7], [4, 6]].map(|edge| (edge, 10.0));
    control.creases = top.into_iter().chain([([0, 1], 2.5), ([1, 3], 1.6)]).collect();
    check(
        &mesh,
        &control,
        &(
            [
                [0.665278, -0.665278, -0.911111],
                [-0.875, -0.375, 1.0],
                [-0.665365, 0.665365, 0.049479],
                [0.46875, 0.0, 1.0],
                [0.326389, 0.763889, -0.326389],
            ],
            [
                [0.634111, -0.647392, -0.837876],
                [-0.854167, -0.364583, 1.0],
                [-0.638117, 0.638117, 0.063272],
                [0.458333, 0.0, 1.0],
                [0.322969, 0.733511, -0.31377],
            ],
        ),
    );
}

#[test]
fn sharp_vertices_are_those_of_opensubdiv() {
    let mesh = TestMesh::cube();
    let mut control = mesh.control(Scheme::CatmullClark);
    control.corners = vec![(7, 10.0), (0, 1.6)];
    check(
        &mesh,
        &control,
        &(
            [
                [0.509259, -0.509259, -0.509259],
                [-0.598958, -0.302083, 0.598958],
                [-0.643229, 0.643229, 0.0],
                [0.378472, 0.027778, 0.847222],
                [0.326389, 0.763889, -0.326389],
            ],
            [
                [0.5, -0.5, -0.5],
                [-0.572933, -0.29665, 0.572933],
                [-0.609568, 0.609568, 0.0],
                [0.368634, 0.035494, 0.817323],
                [0.320594, 0.733427, -0.31172],
            ],
        ),
    );
}

#[test]
fn faces_of_many_corners_are_those_of_opensubdiv() {
    let around = |i: u32| (std::f32::consts::TAU * i as f32 / 7.0).sin_cos();
    let mut points: Vec<[f32; 3]> = (0..7).map(|i| [around(i).1, around(i).0, 0.2 * (i % 2) as f32]).collect();
    points.push([0.3, 0.2, 1.5]);
    let sides: Vec<[u32; 3]> = (0..7).map(|i| [i, (i + 1) % 7, 7]).collect();
    let faces: Vec<&[u32]> =
        std::iter::once(&[6u32, 5, 4, 3, 2, 1, 0][..]).chain(sides.iter().map(|side| &side[..])).collect();
    let mesh = TestMesh::new(&points, &faces);
    check(
        &mesh,
        &mesh.control(Scheme::CatmullClark),
        &(
            [
                [0.397013, 0.463852, 0.376609],
                [0.296865, 0.502085, 0.316567],
                [0.014275, -0.384649, 0.675289],
                [0.588223, 0.296127, 0.419643],
                [-0.474567, -0.069773, 0.446164],
            ],
            [
                [0.391466, 0.456624, 0.378175],
                [0.292821, 0.485129, 0.328816],
                [0.014093, -0.375393, 0.658918],
                [0.569218, 0.28738, 0.428485],
                [-0.454935, -0.066332, 0.450704],
            ],
        ),
    );
}

#[test]
fn boundaries_are_those_of_opensubdiv() {
    let mesh = TestMesh::grid(3, |x, y| (1.3 * x).sin() + 0.3 * y * y);
    check(
        &mesh,
        &mesh.control(Scheme::CatmullClark),
        &(
            [
                [1.0, 0.0, 0.742993],
                [1.25, 1.0, 1.15707],
                [0.0, 2.25, 1.6125],
                [1.25, 0.5, 0.922693],
                [2.25, 1.25, 0.729984],
            ],
            [
                [1.0, 0.0, 0.728289],
                [1.25, 1.0, 1.15032],
                [0.0, 2.25, 1.61719],
                [1.25, 0.5, 0.912823],
                [2.25, 1.25, 0.730334],
            ],
        ),
    );
}
