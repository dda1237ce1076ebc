//! Tests of camera rays.

use bottega_scene::{FisheyeMapping, LensDescription, LensSurface, Stereo, StereoLayout};

use super::*;

fn camera(projection: Projection, lens_radius: f32) -> Camera {
    Camera {
        world_from_camera: Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0)),
        projection,
        lens_radius,
        focus_distance: 4.0,
        ..Camera::default()
    }
}

#[test]
fn the_edges_of_a_perspective_picture_are_half_the_angle_away() {
    let fov = 1.0_f32;
    let rays = CameraRays::new(&camera(Projection::Perspective { vertical_fov: fov }, 0.0), 40, 20);
    let middle = rays.ray(Vec2::new(20.0, 10.0), [0.0; 2]);
    assert!((middle.direction - Vec3::NEG_Z).length() < 1e-6);
    assert_eq!(middle.origin, Vec3::new(1.0, 2.0, 3.0));
    let upper = rays.ray(Vec2::new(20.0, 0.0), [0.0; 2]).direction;
    assert!((upper - Vec3::new(0.0, 0.5_f32.sin(), -0.5_f32.cos())).length() < 1e-6);
    let right = rays.ray(Vec2::new(40.0, 10.0), [0.0; 2]).direction;
    assert!((right.x / -right.z - 2.0 * 0.5_f32.tan()).abs() < 1e-5);
}

#[test]
fn pictures_of_another_shape_keep_the_extent_that_the_axis_names() {
    use bottega_scene::FovAxis;
    // Half extents of a picture twice as high as wide, for a camera made for twice as wide as high
    let cases = [
        (FovAxis::X, Vec2::new(2.0, 4.0)),
        (FovAxis::Y, Vec2::new(0.5, 1.0)),
        (FovAxis::Diagonal, Vec2::new(1.0, 2.0)),
        (FovAxis::Smaller, Vec2::new(1.0, 2.0)),
        (FovAxis::Larger, Vec2::new(1.0, 2.0)),
    ];
    for projection in [
        Projection::Perspective { vertical_fov: std::f32::consts::FRAC_PI_2 },
        Projection::Orthographic { height: 2.0 },
    ] {
        for (fov_axis, expected) in cases {
            let camera = Camera { aspect: Some(2.0), fov_axis, ..camera(projection, 0.0) };
            let extent = CameraRays::new(&camera, 10, 20).half_extent;
            assert!((extent - expected).length() < 1e-5, "{fov_axis:?}: {extent}");
            assert_eq!(CameraRays::new(&camera, 20, 10).half_extent, CameraRays::new(&camera, 40, 20).half_extent);
        }
    }
}

#[test]
fn pixels_need_not_be_square() {
    use bottega_scene::FovAxis;
    for projection in [
        Projection::Perspective { vertical_fov: std::f32::consts::FRAC_PI_2 },
        Projection::Orthographic { height: 2.0 },
    ] {
        for fov_axis in [FovAxis::X, FovAxis::Y, FovAxis::Diagonal, FovAxis::Smaller, FovAxis::Larger] {
            let camera = Camera { aspect: Some(2.0), pixel_aspect: 1.5, fov_axis, ..camera(projection, 0.0) };
            let extent = CameraRays::new(&camera, 40, 20).half_extent;
            assert!((extent - Vec2::new(3.0, 1.0)).length() < 1e-5, "{fov_axis:?}: {extent}");
        }
    }
}

#[test]
fn parallel_rays_are_parallel_and_a_picture_height_apart() {
    let rays = CameraRays::new(&camera(Projection::Orthographic { height: 6.0 }, 0.0), 10, 10);
    let upper = rays.ray(Vec2::new(0.0, 0.0), [0.0; 2]);
    let lower = rays.ray(Vec2::new(10.0, 10.0), [0.0; 2]);
    assert_eq!(upper.direction, lower.direction);
    assert!((upper.origin - lower.origin - Vec3::new(-6.0, 6.0, 0.0)).length() < 1e-5);
}

#[test]
fn a_panorama_sees_all_around() {
    let rays = |panorama| CameraRays::new(&camera(Projection::Panorama(panorama), 0.5), 200, 100);
    let close = |a: Vec3, b: Vec3| assert!((a - b).length() < 1e-5, "{a} {b}");
    let round = rays(Panorama::Equirectangular);
    let at = |x, y| round.ray(Vec2::new(x, y), [0.3; 2]);
    assert_eq!(at(17.0, 33.0).origin, Vec3::new(1.0, 2.0, 3.0));
    close(at(100.0, 50.0).direction, Vec3::NEG_Z);
    close(at(150.0, 50.0).direction, Vec3::X);
    close(at(50.0, 50.0).direction, Vec3::NEG_X);
    close(at(0.0, 50.0).direction, Vec3::Z);
    close(at(77.0, 0.0).direction, Vec3::Y);
    close(at(77.0, 100.0).direction, Vec3::NEG_Y);
    let square = rays(Panorama::EqualArea);
    let at = |x, y| square.ray(Vec2::new(x, y), [0.3; 2]).direction;
    close(at(100.0, 50.0), Vec3::Y);
    close(at(200.0, 50.0), Vec3::X);
    close(at(100.0, 100.0), Vec3::NEG_Z);
    close(at(0.0, 0.0), Vec3::NEG_Y);
    close(at(200.0, 100.0), Vec3::NEG_Y);
    // Beyond an edge, the sphere continues
    for (inside, beyond) in [((0.1, 30.0), (-0.1, 70.0)), ((60.0, 99.9), (140.0, 100.1))] {
        close(at(inside.0, inside.1), at(beyond.0, beyond.1));
    }
    close(round.ray(Vec2::new(30.0, -0.5), [0.0; 2]).direction, round.ray(Vec2::new(130.0, 0.5), [0.0; 2]).direction);
}

#[test]
fn a_panorama_of_equal_areas_has_equal_areas() {
    let rays = CameraRays::new(&camera(Projection::Panorama(Panorama::EqualArea), 0.0), 64, 64);
    // Great circles halve the sphere, and second moments are a third
    let mut moments = glam::Mat3::ZERO;
    for i in 0..64 * 64 {
        let d = rays.ray(Vec2::new((i % 64) as f32 + 0.5, (i / 64) as f32 + 0.5), [0.0; 2]).direction;
        moments += glam::Mat3::from_cols(d * d.x, d * d.y, d * d.z) * (1.0 / 4096.0);
    }
    assert!(moments.abs_diff_eq(glam::Mat3::IDENTITY * (1.0 / 3.0), 1e-3), "{moments}");
}

#[test]
fn rays_go_from_the_near_plane_to_the_far_one() {
    let clip = Clip { near: 2.0, far: 7.0 };
    for (projection, lens_radius) in [
        (Projection::Perspective { vertical_fov: 1.2 }, 0.0),
        (Projection::Perspective { vertical_fov: 1.2 }, 0.5),
        (Projection::Orthographic { height: 3.0 }, 0.0),
        (Projection::Orthographic { height: 3.0 }, 0.5),
    ] {
        let plain = camera(projection, lens_radius);
        let rays = [plain.clone(), Camera { clip, ..plain }].map(|camera| CameraRays::new(&camera, 8, 6));
        for (place, lens) in [(Vec2::new(4.0, 3.0), [0.5; 2]), (Vec2::new(0.5, 5.0), [0.9, 0.2])] {
            let [whole, cut] = [&rays[0], &rays[1]].map(|rays| rays.ray(place, lens));
            assert_eq!(whole.direction, cut.direction);
            assert_eq!((whole.start, whole.reach), (0.0, f32::INFINITY));
            assert!((cut.origin - whole.origin - whole.direction * cut.start).length() < 1e-5);
            let depth = |distance: f32| 3.0 - (cut.origin + cut.direction * distance).z;
            assert!((depth(0.0) - 2.0).abs() < 1e-5 && (depth(cut.reach) - 7.0).abs() < 1e-5, "{projection:?}");
        }
    }
    let around = Camera { clip, ..camera(Projection::Panorama(Panorama::EqualArea), 0.0) };
    let ray = CameraRays::new(&around, 8, 8).ray(Vec2::new(1.0, 6.0), [0.5; 2]);
    assert_eq!((ray.origin, ray.start, ray.reach), (Vec3::new(1.0, 2.0, 3.0), 0.0, f32::INFINITY));
}

#[test]
fn rays_through_a_lens_meet_in_the_plane_in_focus() {
    let rays = CameraRays::new(&camera(Projection::Perspective { vertical_fov: 0.7 }, 0.3), 8, 8);
    let meet = |lens| {
        let ray = rays.ray(Vec2::new(2.0, 7.0), lens);
        ray.origin + ray.direction * (4.0 / -ray.direction.z)
    };
    let (a, b) = (meet([0.1, 0.2]), meet([0.9, 0.6]));
    assert!((a - b).length() < 1e-5, "{a} {b}");
    let ray = rays.ray(Vec2::new(2.0, 7.0), [0.9, 0.6]);
    assert!((ray.origin - Vec3::new(1.0, 2.0, 3.0)).length() <= 0.3);
}

/// The ray of a picture's pixel, through a place of it.
fn seen(camera: &Camera, [width, height]: [u32; 2], place: [f32; 2]) -> CameraRay {
    CameraRays::new(camera, width, height).ray(Vec2::from(place), [0.3, 0.6])
}

#[test]
fn the_faces_of_a_cube_are_pictures_of_a_turned_camera() {
    let cube = CameraRays::new(&camera(Projection::Panorama(Panorama::Cube), 0.0), 60, 10);
    // Direction ahead, and the upper edge's direction, of each face
    let faces = [
        (Vec3::X, Vec3::Y),
        (Vec3::NEG_X, Vec3::Y),
        (Vec3::Y, Vec3::Z),
        (Vec3::NEG_Y, Vec3::NEG_Z),
        (Vec3::Z, Vec3::Y),
        (Vec3::NEG_Z, Vec3::Y),
    ];
    for (face, (ahead, up)) in faces.into_iter().enumerate() {
        let turned = Camera {
            world_from_camera: Camera::looking(Vec3::ZERO, ahead, up).unwrap(),
            ..camera(Projection::Perspective { vertical_fov: 0.5 * PI }, 0.0)
        };
        let flat = CameraRays::new(&turned, 10, 10);
        for (x, y) in [(0.5, 0.5), (9.5, 0.5), (3.5, 8.5)] {
            // Filters that reach beyond the face stay in its plane
            let offset = Vec2::new(1.4, -1.2);
            let a = cube.ray_of_pixel(Vec2::new(10.0 * face as f32 + x, y), offset, [0.0; 2]).direction;
            let b = flat.ray_of_pixel(Vec2::new(x, y), offset, [0.0; 2]).direction;
            assert!((a - b).length() < 1e-5, "face {face}: {a} {b}");
        }
    }
}

#[test]
fn a_fisheye_maps_angles_by_its_law_and_is_black_beyond_its_rim() {
    for (mapping, fov) in [(FisheyeMapping::Equidistant, PI), (FisheyeMapping::Equisolid, 2.0 * PI)] {
        let eye = camera(Projection::Fisheye { mapping, field_of_view: fov, height: 1.0 }, 0.0);
        let rim = 0.5 * fov;
        for share in [0.25, 0.5, 0.9_f32] {
            let angle = match mapping {
                FisheyeMapping::Equidistant => share * rim,
                FisheyeMapping::Equisolid => 2.0 * (share * (0.5 * rim).sin()).asin(),
            };
            let right = seen(&eye, [100, 100], [50.0 + 50.0 * share, 50.0]);
            assert!((right.direction - Vec3::new(angle.sin(), 0.0, -angle.cos())).length() < 1e-4, "{mapping:?}");
            let up = seen(&eye, [100, 100], [50.0, 50.0 - 50.0 * share]);
            assert!((up.direction - Vec3::new(0.0, angle.sin(), -angle.cos())).length() < 1e-4, "{mapping:?}");
            assert_eq!((right.weight, up.weight), (1.0, 1.0));
        }
        let outside = seen(&eye, [100, 100], [1.0, 1.0]);
        assert_eq!((outside.weight, outside.reach), (0.0, 0.0));
        // A circle of half the picture's height, in a wide picture
        let small = camera(Projection::Fisheye { mapping, field_of_view: fov, height: 2.0 }, 0.0);
        assert_eq!(seen(&small, [200, 100], [126.0, 50.0]).weight, 0.0);
        assert_eq!(seen(&small, [200, 100], [124.0, 50.0]).weight, 1.0);
    }
}

#[test]
fn an_aperture_with_blades_is_a_polygon_of_its_rotation_and_ratio() {
    let aperture = Aperture { blades: 5, rotation: 0.2, ratio: 2.0 };
    let bladed = Camera { aperture, ..camera(Projection::Perspective { vertical_fov: 0.7 }, 0.3) };
    let rays = CameraRays::new(&bladed, 8, 8);
    let (mut center, mut count) = (Vec2::ZERO, [0; 10]);
    let side = 100;
    for index in 0..side * side {
        let number = |index: usize| (index as f32 + 0.5) / side as f32;
        let ray = rays.ray(Vec2::new(4.0, 4.0), [number(index % side), number(index / side)]);
        // The point on the lens, as if the opening were regular
        let point = (ray.origin - Vec3::new(1.0, 2.0, 3.0)).truncate() * Vec2::new(2.0, 1.0) / 0.3;
        let angle = (point.y.atan2(point.x) - 0.2 + 2.0 * PI).rem_euclid(2.0 * PI);
        // The angle from the middle of an edge; these are multiples of a fifth of a turn
        let from_middle = (angle + PI / 5.0).rem_euclid(2.0 * PI / 5.0) - PI / 5.0;
        assert!(point.length() * from_middle.cos() <= (PI / 5.0).cos() + 1e-4, "{point}");
        center += point;
        count[(angle / (2.0 * PI) * 10.0) as usize % 10] += 1;
    }
    assert!((center / (side * side) as f32).length() < 1e-2);
    assert!(count.iter().all(|&count| (900..1100).contains(&count)), "{count:?}");
}

#[test]
fn the_pictures_of_two_eyes_agree_at_their_convergence() {
    let stereo = |layout, convergence| Some(Stereo { layout, eye_distance: 0.2, convergence });
    let flat = camera(Projection::Perspective { vertical_fov: 0.7 }, 0.0);
    let position = Vec3::new(1.0, 2.0, 3.0);
    for (layout, size, right) in
        [(StereoLayout::SideBySide, [40, 10], [20.0, 0.0]), (StereoLayout::TopBottom, [20, 20], [0.0, 10.0])]
    {
        let both = Camera { stereo: stereo(layout, 5.0), ..flat.clone() };
        let eyes = [[3.0, 4.0], [3.0 + right[0], 4.0 + right[1]]].map(|place| seen(&both, size, place));
        let one = seen(&flat, [20, 10], [3.0, 4.0]);
        for (eye, x) in eyes.iter().zip([-0.1, 0.1]) {
            assert!((eye.origin - position - Vec3::new(x, 0.0, 0.0)).length() < 1e-6);
            let at = |ray: &CameraRay| ray.origin + ray.direction * (5.0 / -ray.direction.z);
            assert!((at(eye) - at(&one)).length() < 1e-5, "{layout:?}");
        }
    }
    for (layout, number) in [(StereoLayout::Left, 0), (StereoLayout::Right, 1)] {
        let single = seen(&Camera { stereo: stereo(layout, 5.0), ..flat.clone() }, [20, 10], [3.0, 4.0]);
        let both = Camera { stereo: stereo(StereoLayout::SideBySide, 5.0), ..flat.clone() };
        assert_eq!(single, seen(&both, [40, 10], [3.0 + 20.0 * number as f32, 4.0]));
    }
    // In a panorama the eyes turn with the direction, and are one at the poles
    let round = Camera {
        stereo: stereo(StereoLayout::TopBottom, f32::INFINITY),
        ..camera(Projection::Panorama(Panorama::Equirectangular), 0.0)
    };
    let right = seen(&round, [100, 100], [75.0, 75.0]);
    assert!((right.direction - Vec3::X).length() < 1e-5);
    assert!((right.origin - position - Vec3::new(0.0, 0.0, 0.1)).length() < 1e-6, "{}", right.origin);
    let left = seen(&round, [100, 100], [50.0, 25.0]);
    assert!((left.direction - Vec3::NEG_Z).length() < 1e-5);
    assert!((left.origin - position - Vec3::new(-0.1, 0.0, 0.0)).length() < 1e-6);
    assert!((seen(&round, [100, 100], [50.0, 0.0]).origin - position).length() < 1e-6);
    let near = Camera { stereo: stereo(StereoLayout::TopBottom, 3.0), ..round };
    let eyes = [25.0, 75.0].map(|y| seen(&near, [100, 100], [30.0, y]));
    let meet = |ray: &CameraRay| {
        let from = ray.origin - position;
        let b = from.dot(ray.direction);
        from + ray.direction * (-b + (b * b - from.length_squared() + 9.0).sqrt())
    };
    assert!((meet(&eyes[0]) - meet(&eyes[1])).length() < 1e-4);
}

#[test]
fn lenses_show_what_a_thin_lens_of_their_angle_shows() {
    let surface = |radius, thickness, eta| LensSurface { radius, thickness, eta, aperture_radius: 0.002 };
    let surfaces = vec![surface(0.1, 0.001, 1.5), surface(-0.1, 0.05, 1.0)];
    let description = LensDescription { surfaces, film_diagonal: 0.01, focus_distance: Some(2.0) };
    let system = LensSystem::new(description).unwrap();
    let half_height = 0.005 / 5.0_f32.sqrt();
    let vertical_fov = 2.0 * (half_height / system.image_distance()).atan();
    let thin = camera(Projection::Perspective { vertical_fov }, 0.0);
    let thick = Camera { lenses: Some(system), ..thin.clone() };
    for place in [[20.0, 10.0], [30.0, 6.0], [2.0, 18.0]] {
        let middle = CameraRays::new(&thick, 40, 20).ray(Vec2::from(place), [0.5, 0.5]);
        let wanted = seen(&thin, [40, 20], place).direction;
        assert!((middle.direction - wanted).length() < 2e-3, "{} {wanted}", middle.direction);
        assert!(middle.weight > 0.0);
    }
}
