//! Known answers.

use glam::{DVec2, DVec3, Vec3};

use super::*;

/// A mesh with owned arrays.
#[derive(Clone, Default)]
pub(super) struct TestMesh {
    pub(super) points: Vec<Vec3>,
    sizes: Vec<usize>,
    corners: Vec<u32>,
}

impl TestMesh {
    pub(super) fn new(points: &[[f32; 3]], faces: &[&[u32]]) -> Self {
        Self {
            points: points.iter().map(|&point| Vec3::from_array(point)).collect(),
            sizes: faces.iter().map(|face| face.len()).collect(),
            corners: faces.concat(),
        }
    }

    pub(super) fn cube() -> Self {
        let points: Vec<[f32; 3]> =
            (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|bit| if bit == 1 { 1.0 } else { -1.0 })).collect();
        let faces: [&[u32]; 6] =
            [&[0, 2, 3, 1], &[4, 5, 7, 6], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 4, 6, 2], &[1, 3, 7, 5]];
        Self::new(&points, &faces)
    }

    fn tetrahedron() -> Self {
        let points = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        Self::new(&points, &[&[0, 1, 2], &[0, 2, 3], &[0, 3, 1], &[1, 3, 2]])
    }

    /// A grid of squares in the plane z = 0, lifted by a function.
    pub(super) fn grid(size: u32, lift: impl Fn(f32, f32) -> f32) -> Self {
        let at = |x: u32, y: u32| y * (size + 1) + x;
        let points = (0..=size).flat_map(|y| (0..=size).map(move |x| (x as f32, y as f32)));
        let points: Vec<[f32; 3]> = points.map(|(x, y)| [x, y, lift(x, y)]).collect();
        let faces: Vec<[u32; 4]> = (0..size)
            .flat_map(|y| (0..size).map(move |x| [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]))
            .collect();
        Self::new(&points, &faces.iter().map(|face| &face[..]).collect::<Vec<_>>())
    }

    pub(super) fn control(&self, scheme: Scheme) -> ControlMesh<'_> {
        ControlMesh {
            point_count: self.points.len(),
            face_sizes: &self.sizes,
            corner_points: &self.corners,
            is_hole: Vec::new(),
            creases: Vec::new(),
            corners: Vec::new(),
            scheme,
            boundary: BoundaryRule::EdgeAndCorner,
            seams: SeamRule::Junctions,
            has_smooth_triangles: false,
        }
    }
}

fn subdivide(control: &ControlMesh<'_>, level: u32) -> Subdivision {
    let (subdivision, problems) = Subdivision::new(control, level);
    assert_eq!(problems, Vec::<String>::new());
    subdivision.unwrap()
}

/// Refined points, before they are moved to their limits.
fn refined(mesh: &TestMesh, subdivision: &Subdivision) -> Vec<DVec3> {
    subdivision.refined(|point| mesh.points[point].as_dvec3())
}

fn close(a: DVec3, b: DVec3) -> bool {
    (a - b).length() < 1e-9
}

/// The uniform cubic B-spline of four numbers.
fn spline(p: [f64; 4], t: f64) -> f64 {
    let s = 1.0 - t;
    let weights = [
        s * s * s / 6.0,
        (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0,
        (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0,
        t * t * t / 6.0,
    ];
    p.iter().zip(weights).map(|(p, weight)| p * weight).sum()
}

#[test]
fn a_cube_is_refined_as_by_hand() {
    let mesh = TestMesh::cube();
    let once = subdivide(&mesh.control(Scheme::CatmullClark), 1);
    let points = refined(&mesh, &once);
    assert_eq!((points.len(), once.limit.topology().face_count()), (26, 24));
    // A vertex of valence 3: v/3 + the sum of 3 neighbours and 3 centres over 9; 1/3 + (1/9) + (1/9)
    assert!(close(points[7], DVec3::splat(5.0 / 9.0)), "{}", points[7]);
    // Edges: the mean of two ends (1, 1, ±1) and two centres, thus (3/4, 3/4, 0); then faces
    assert!(points[8..20].iter().all(|edge| {
        let mut sizes = edge.abs().to_array();
        sizes.sort_by(f64::total_cmp);
        close(DVec3::from_array(sizes), DVec3::new(0.0, 0.75, 0.75))
    }));
    assert!(points[20..].iter().all(|face| (face.length() - 1.0).abs() < 1e-12));
    // Level 2: v/3 + the sum of 3 edges (3/4, 3/4, 0) and of the centres of 3 faces, over 9
    let twice = subdivide(&mesh.control(Scheme::CatmullClark), 2);
    let points = refined(&mesh, &twice);
    let [along, across] = [(5.0 / 9.0 + 0.75 + 1.0 + 0.75) / 4.0, (5.0 / 9.0 + 0.75) / 4.0];
    let expected = 5.0 / 27.0 + (1.5 + along + 2.0 * across) / 9.0;
    assert!(close(points[7], DVec3::splat(expected)), "{} {expected}", points[7]);
    assert_eq!(twice.limit.topology().face_count(), 96);
}

#[test]
fn the_limit_does_not_depend_on_the_level() {
    let mut open = TestMesh::grid(3, |x, y| (x * 1.7 + y * y * 0.4).sin());
    open.sizes.pop();
    open.corners.truncate(open.corners.len() - 4);
    let pentagon = TestMesh::new(
        &[[0.0, 0.0, 1.0], [2.0, 0.0, 0.0], [1.0, 2.0, 0.0], [-1.0, 1.5, 0.0], [-2.0, 0.0, 0.5], [0.0, -2.0, 0.0]],
        &[&[1, 2, 3, 4, 5], &[0, 2, 1], &[0, 3, 2], &[0, 4, 3], &[0, 5, 4], &[0, 1, 5]],
    );
    let cases = [
        (TestMesh::cube(), Scheme::CatmullClark),
        (pentagon, Scheme::CatmullClark),
        (open, Scheme::CatmullClark),
        (TestMesh::tetrahedron(), Scheme::Loop),
    ];
    for (mesh, scheme) in cases {
        let mut control = mesh.control(scheme);
        if mesh.sizes == [4; 6] {
            control.creases = [[0, 1], [1, 3], [3, 2], [2, 0]].map(|edge| (edge, 10.0)).into();
        }
        let (coarse, _) = Subdivision::new(&control, 1);
        let (fine, _) = Subdivision::new(&control, 3);
        let [coarse, fine] = [coarse, fine].map(|it| it.unwrap().points(&mesh.points));
        let count = mesh.points.len();
        for vertex in 0..count {
            let (a, b) = (coarse.0[vertex], fine.0[vertex]);
            assert!((a - b).length() < 1e-5, "{scheme:?} {vertex}: {a} {b}");
            let (a, b) = (coarse.1[vertex], fine.1[vertex]);
            let is_tangential = a.length() == 0.0 || a.dot(b) > 0.99;
            assert!(is_tangential, "{scheme:?} {vertex}: {a} {b}");
        }
    }
}

#[test]
fn a_regular_patch_is_a_bicubic_spline() {
    let height = |x: f32, y: f32| (x * 0.9).sin() + (y * x * 0.3).cos();
    let mesh = TestMesh::grid(3, height);
    let subdivision = subdivide(&mesh.control(Scheme::CatmullClark), 2);
    let (points, normals) = subdivision.points(&mesh.points);
    let spline = |f: &dyn Fn(usize, usize) -> f64, u: f64, v: f64| {
        spline([0, 1, 2, 3].map(|y| spline([0, 1, 2, 3].map(|x| f(x, y)), u)), v)
    };
    let z = |x: usize, y: usize| f64::from(height(x as f32, y as f32));
    let mut compared = 0;
    for (point, normal) in points.iter().zip(&normals) {
        let (u, v) = (f64::from(point.x) - 1.0, f64::from(point.y) - 1.0);
        if (-1e-6..=1.000001).contains(&u) && (-1e-6..=1.000001).contains(&v) {
            assert!((spline(&z, u, v) - f64::from(point.z)).abs() < 1e-6, "{point}");
            let h = 1e-4;
            let du = (spline(&z, u + h, v) - spline(&z, u - h, v)) / (2.0 * h);
            let dv = (spline(&z, u, v + h) - spline(&z, u, v - h)) / (2.0 * h);
            let expected = DVec3::new(-du, -dv, 1.0).normalize();
            assert!(normal.as_dvec3().dot(expected) > 1.0 - 1e-7, "{normal} {expected}");
            compared += 1;
        }
    }
    assert_eq!(compared, 25);
}

#[test]
fn a_boundary_is_a_cubic_spline() {
    let mesh = TestMesh::grid(3, |x, y| (x * 1.3).sin() * (1.0 + y));
    for boundary in [BoundaryRule::EdgeOnly, BoundaryRule::EdgeAndCorner] {
        let control = ControlMesh { boundary, ..mesh.control(Scheme::CatmullClark) };
        let (points, normals) = subdivide(&control, 3).points(&mesh.points);
        let row: Vec<f64> = (0..4).map(|x| f64::from(mesh.points[x].z)).collect();
        let mut compared = 0;
        for point in points.iter().filter(|point| point.y.abs() < 1e-6) {
            let u = f64::from(point.x) - 1.0;
            if (0.0..=1.0).contains(&u) {
                assert!((spline([row[0], row[1], row[2], row[3]], u) - f64::from(point.z)).abs() < 1e-6);
                compared += 1;
            }
        }
        assert_eq!(compared, 9);
        assert!(normals.iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5));
        // A corner stays, or becomes round
        assert_eq!(points[0] == mesh.points[0], boundary == BoundaryRule::EdgeAndCorner);
    }
}

#[test]
fn a_tetrahedron_is_refined_by_loop_as_by_hand() {
    let mesh = TestMesh::tetrahedron();
    let once = subdivide(&mesh.control(Scheme::Loop), 1);
    let points = refined(&mesh, &once);
    assert_eq!((points.len(), once.limit.topology().face_count()), (10, 16));
    // Valence 3: beta is 3/16; v (1 - 9/16) + 3/16 × the sum of the others, which is -v
    assert!(close(points[0], DVec3::splat(1.0) * (7.0 / 16.0 - 3.0 / 16.0)), "{}", points[0]);
    // Edges: 3/8 (a + b) + 1/8 (c + d), and c + d = -(a + b)
    assert!(points[4..].iter().all(|edge| (edge.length() - 0.5).abs() < 1e-12));
    // Limit: 1/(3 + 2) of each neighbour: v 2/5 - v/5
    let (limits, normals) = once.points(&mesh.points);
    assert!((limits[0] - Vec3::splat(0.2)).length() < 1e-6, "{}", limits[0]);
    for (normal, limit) in normals.iter().zip(&limits) {
        assert!(normal.dot(limit.normalize()) > 0.8, "{normal} {limit}");
    }
}

#[test]
fn sharp_edges_stay() {
    let mesh = TestMesh::cube();
    let mut control = mesh.control(Scheme::CatmullClark);
    let top = [[4, 5], [5, 7], [7, 6], [6, 4]];
    control.creases = top.map(|edge| (edge, 10.0)).into();
    control.corners = [4, 5, 6, 7].map(|corner| (corner, 10.0)).into();
    let subdivision = subdivide(&control, 3);
    let (points, normals) = subdivision.points(&mesh.points);
    // The top is the square it was: with normals of its own along its edges
    let mut area = 0.0;
    for (face, source) in subdivision.corner_points().chunks(4).zip(subdivision.face_sources()) {
        if source == Some(1) {
            for &vertex in face {
                assert!((points[vertex as usize].z - 1.0).abs() < 1e-6);
                assert!(normals[vertex as usize].z > 0.999_999, "{}", normals[vertex as usize]);
            }
            let [a, b, c, d] = [0, 1, 2, 3].map(|corner| points[face[corner] as usize].as_dvec3());
            area += 0.5 * (c - a).cross(d - b).length();
        }
    }
    assert!((area - 4.0).abs() < 1e-5, "{area}");
    assert_eq!(points[4..8], mesh.points[4..8]);
}

#[test]
fn a_semi_sharp_crease_lies_between_smooth_and_sharp() {
    let mesh = TestMesh::cube();
    let middle = |sharpness: f32| {
        let mut control = mesh.control(Scheme::CatmullClark);
        control.creases = vec![([6, 7], sharpness)];
        let subdivision = subdivide(&control, 1);
        let points = refined(&mesh, &subdivision);
        points[8..20].iter().map(|point| point.y + point.z).fold(0.0, f64::max)
    };
    let [smooth, half, sharp] = [0.0, 0.5, 1.0].map(middle);
    assert!((smooth - 1.5).abs() < 1e-9 && (sharp - 2.0).abs() < 1e-9 && (half - 1.75).abs() < 1e-9, "{half}");
}

#[test]
fn weights_sum_to_one() {
    let mut mesh = TestMesh::grid(4, |_, _| 0.0);
    mesh.points.push(Vec3::ZERO);
    // A fin on an inner edge, and a fan of its own at a vertex
    mesh.sizes.extend([3, 3, 5]);
    mesh.corners.extend([6, 7, 25, 12, 25, 0, 1, 2, 7, 6, 5]);
    for scheme in [Scheme::CatmullClark, Scheme::Bilinear] {
        let mut control = mesh.control(scheme);
        control.creases = vec![([6, 11], 1.5), ([11, 16], 0.5), ([16, 17], 3.0), ([12, 13], 0.3), ([12, 7], 10.0)];
        control.corners = vec![(8, 0.7), (18, 2.5)];
        let subdivision = Subdivision::new(&control, 3).0.unwrap();
        let is_one = |value: &f64| (value - 1.0).abs() < 1e-12;
        assert!(subdivision.refined(|_| 1.0).iter().all(is_one));
        assert!(subdivision.by_point(|_| 1.0).iter().all(is_one));
        assert!(subdivision.linear(|_| 1.0).iter().all(is_one));
        assert!(subdivision.by_corner(|_| 1.0, |corner| corner as u32 / 7).iter().all(is_one));
    }
}

#[test]
fn holes_support_their_neighbours() {
    let mesh = TestMesh::grid(3, |x, y| x * y * 0.1);
    let mut control = mesh.control(Scheme::CatmullClark);
    let whole = subdivide(&control, 2);
    control.is_hole = vec![false; 9];
    control.is_hole[4] = true;
    let holed = subdivide(&control, 2);
    assert_eq!(holed.points(&mesh.points), whole.points(&mesh.points));
    let counted = |subdivision: &Subdivision| subdivision.face_sources().flatten().count();
    assert_eq!((counted(&whole), counted(&holed)), (9 * 16, 8 * 16));
    // Without interpolation of boundaries only the inner face is part of the surface
    control.is_hole.clear();
    control.boundary = BoundaryRule::None;
    let inner = subdivide(&control, 2);
    assert_eq!(inner.face_sources().flatten().collect::<Vec<_>>(), [4; 16]);
    // Unless all boundary edges are sharp
    let ring = [0, 1, 2, 3, 7, 11, 15, 14, 13, 12, 8, 4, 0];
    control.creases = ring.windows(2).map(|edge| ([edge[0], edge[1]], 10.0)).collect();
    assert_eq!(counted(&subdivide(&control, 1)), 9 * 4);
}

#[test]
fn strange_faces_are_named() {
    let mesh = TestMesh::new(
        &[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
        &[&[0, 1, 2, 3], &[0, 1, 4], &[1, 0, 5], &[2, 2, 2], &[0, 1], &[3, 2, 2, 4], &[]],
    );
    let mut control = mesh.control(Scheme::CatmullClark);
    control.creases = vec![([0, 2], 2.0), ([9, 9], 1.0)];
    let (subdivision, problems) = Subdivision::new(&control, 2);
    let expected = [
        "3 faces with fewer than 3 distinct corners are left out, the first is face 3",
        "1 faces lose corners that repeat others, the first is face 5",
        "1 edges of more than two faces, or of faces that turn against each other, are sharp",
        "2 creases are not along edges of the mesh",
    ];
    assert_eq!(problems, expected);
    let (points, normals) = subdivision.unwrap().points(&mesh.points);
    assert!(points.iter().chain(&normals).all(|value| value.is_finite()));
    let nothing = TestMesh::new(&[[0.0; 3]], &[&[0, 0, 0]]);
    assert!(Subdivision::new(&nothing.control(Scheme::Loop), 1).0.is_none());
}

#[test]
fn values_of_corners_are_smooth_between_seams() {
    let mesh = TestMesh::grid(4, |_, _| 0.0);
    let uv_of = |point: Vec3| DVec2::new(f64::from(point.x).powi(2), f64::from(point.y + 0.2 * point.x * point.y));
    let point = |corner: usize| uv_of(mesh.points[mesh.corners[corner] as usize]);
    let uvs = |seams: SeamRule, id: &dyn Fn(usize) -> u32| {
        let control = ControlMesh { seams, ..mesh.control(Scheme::CatmullClark) };
        let subdivision = subdivide(&control, 2);
        let smooth = subdivision.by_corner(point, id);
        (smooth, subdivision.linear(point), subdivision.by_point(|index| uv_of(mesh.points[index])))
    };
    let same = |a: &[DVec2], b: &[DVec2]| a.iter().zip(b).all(|(a, b)| (*a - *b).length() < 1e-9);
    for seams in [SeamRule::Smooth, SeamRule::Corners, SeamRule::Junctions, SeamRule::Ends] {
        let (smooth, linear, vertex) = uvs(seams, &|_| 0);
        assert!(same(&smooth, &vertex) && !same(&smooth, &linear), "{seams:?}");
        // Each face a region: everything is linear, unless even corners are smooth
        let (apart, linear, _) = uvs(seams, &|corner| corner as u32 / 4);
        assert_eq!(same(&apart, &linear), seams != SeamRule::Smooth, "{seams:?}");
    }
    let (linear_rule, linear, _) = uvs(SeamRule::AllLinear, &|_| 0);
    assert!(same(&linear_rule, &linear));
    // Linear boundaries keep a boundary's values in place
    let (bounded, linear, _) = uvs(SeamRule::Linear, &|_| 0);
    let at_boundary = |uv: &DVec2| uv.x.min(uv.y).abs() < 1e-9;
    assert!(bounded.iter().zip(&linear).filter(|pair| at_boundary(pair.1)).all(|(a, b)| (*a - *b).length() < 1e-9));
    assert!(!same(&bounded, &linear));
}

#[test]
fn damaged_meshes_are_survived() {
    let mut state = 7u64;
    let mut random = move |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    for _ in 0..300 {
        let mut mesh = if random(2) == 0 { TestMesh::cube() } else { TestMesh::grid(3, |x, y| x - y * y) };
        let count = mesh.points.len() as u64;
        for _ in 0..=random(4) {
            let at = random(mesh.corners.len() as u64) as usize;
            mesh.corners[at] = random(count) as u32;
        }
        if random(3) == 0 {
            // Move corners from one face to the next
            let face = random(mesh.sizes.len() as u64 - 1) as usize;
            mesh.sizes[face] -= 1 + random(3) as usize;
            mesh.sizes[face + 1] += mesh.corners.len() - mesh.sizes.iter().sum::<usize>();
        }
        let mut control = mesh.control(Scheme::CatmullClark);
        control.boundary =
            [BoundaryRule::None, BoundaryRule::EdgeOnly, BoundaryRule::EdgeAndCorner][random(3) as usize];
        control.seams = [SeamRule::Smooth, SeamRule::Corners, SeamRule::Ends, SeamRule::Linear][random(4) as usize];
        let sharpness = [0.5, f32::NAN, -1.0, 3.0, f32::INFINITY];
        control.creases =
            (0..4).map(|_| ([random(count) as u32, random(count + 2) as u32], sharpness[random(5) as usize])).collect();
        control.corners = vec![(random(count + 9) as u32, sharpness[random(5) as usize])];
        if let (Some(subdivision), _) = Subdivision::new(&control, 2) {
            let (points, normals) = subdivision.points(&mesh.points);
            assert_eq!(points.len(), normals.len());
            assert!(points.iter().chain(&normals).all(|value| value.is_finite()));
            assert!(subdivision.corner_points().iter().all(|&point| (point as usize) < points.len()));
            let corners = subdivision.corner_points().len();
            assert_eq!(subdivision.by_corner(|_| 1.0, |corner| corner as u32 % 3).len(), corners);
            assert_eq!(subdivision.linear(|_| 1.0).len(), corners);
        }
    }
    // Triangles of Loop
    for round in 0..100 {
        let mut mesh = TestMesh::tetrahedron();
        for _ in 0..2 {
            mesh.corners[random(12) as usize] = random(4) as u32;
        }
        if let (Some(subdivision), _) = Subdivision::new(&mesh.control(Scheme::Loop), 2) {
            let (points, normals) = subdivision.points(&mesh.points);
            assert!(points.iter().chain(&normals).all(|value| value.is_finite()), "{round}");
        }
    }
}
