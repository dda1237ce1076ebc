//! Tests of systems of lenses against formulas.

use std::f32::consts::PI;

use super::*;

fn surface(radius: f32, thickness: f32, eta: f32, aperture_radius: f32) -> LensSurface {
    LensSurface { radius, thickness, eta, aperture_radius }
}

/// A lens of glass that bulges on both sides, with a stop behind it.
fn biconvex(stop: f32) -> LensDescription {
    let surfaces =
        vec![surface(0.04, 0.006, 1.5, 0.012), surface(-0.05, 0.002, 1.0, 0.012), surface(0.0, 0.04, 1.0, stop)];
    LensDescription { surfaces, film_diagonal: 0.01, focus_distance: None }
}

/// A lens with its film where a plane is in focus.
fn focused(stop: f32, distance: f32) -> Result<LensSystem, LensError> {
    LensSystem::new(LensDescription { focus_distance: Some(distance), ..biconvex(stop) })
}

/// The mean weight of rays from a place of the film, by a grid of numbers; blocked rays count as 0.
fn mean_weight(system: &LensSystem, film: Vec2) -> f32 {
    const SIDE: usize = 256;
    let number = |index: usize| (index as f32 + 0.5) / SIDE as f32;
    let weight =
        |index: usize| system.ray(film, [number(index % SIDE), number(index / SIDE)]).map_or(0.0, |ray| ray.weight);
    (0..SIDE * SIDE).map(weight).sum::<f32>() / (SIDE * SIDE) as f32
}

#[test]
fn the_focal_length_is_that_of_the_lensmakers_equation() {
    let (n, r1, r2, d) = (1.5, 0.04, -0.05, 0.006);
    let power = (n - 1.0) * (1.0 / r1 - 1.0 / r2 + (n - 1.0) * d / (n * r1 * r2));
    let length = biconvex(0.01).focal_length();
    assert!((length * power - 1.0).abs() < 1e-5, "{length}");
}

#[test]
fn rays_from_the_middle_of_the_film_meet_in_the_plane_in_focus() {
    for distance in [0.3, 1.0, 20.0] {
        let system = focused(0.0005, distance).unwrap();
        for numbers in [[0.5, 0.52], [0.48, 0.5], [0.52, 0.48]] {
            let ray = system.ray(Vec2::ZERO, numbers).unwrap();
            // Where the ray is nearest to the axis
            let (o, d) = (ray.origin.truncate(), ray.direction.truncate());
            let t = -o.dot(d) / d.length_squared();
            let met = -(ray.origin + ray.direction * t).z;
            assert!((met / distance - 1.0).abs() < 0.01, "{met} instead of {distance}");
        }
    }
    assert!(matches!(focused(0.01, 0.1), Err(LensError::Focus(_))));
}

#[test]
fn a_place_off_the_axis_sees_the_opposite_side() {
    let system = focused(0.004, 1.0).unwrap();
    let film = Vec2::new(0.003, -0.001);
    let middle = system.ray(film, [0.5, 0.5]).unwrap();
    let at = middle.origin + middle.direction * ((1.0 + middle.origin.z) / -middle.direction.z);
    // The magnification is the distance of the plane over that of the film, from the principal planes
    let film_distance = system.image_distance();
    let scale = (1.0 - film_distance) / film_distance;
    assert!((at.truncate() + film * scale).length() < 0.05 * film.length() * scale, "{at}");
}

#[test]
fn a_lone_stop_gives_the_irradiance_of_its_cone() {
    for (radius, distance) in [(0.001, 0.05), (0.01, 0.02)] {
        let surfaces = vec![surface(0.0, distance, 1.0, radius)];
        let system = LensSystem::new(LensDescription { surfaces, film_diagonal: 0.02, focus_distance: None }).unwrap();
        let sin_squared = radius * radius / (radius * radius + distance * distance);
        let ratio = mean_weight(&system, Vec2::ZERO) / (PI * sin_squared);
        assert!((ratio - 1.0).abs() < 5e-3, "{ratio}");
        // Off the axis the light of a small opening falls with cos⁴
        if radius < 0.1 * distance {
            let film = Vec2::new(0.006, 0.008);
            let cos_squared = distance * distance / (distance * distance + film.length_squared());
            let ratio = mean_weight(&system, film) / (PI * sin_squared * cos_squared * cos_squared);
            assert!((ratio - 1.0).abs() < 1e-2, "{ratio}");
        }
    }
}

#[test]
fn half_the_opening_lets_a_quarter_of_the_light_through() {
    let light = |stop| mean_weight(&focused(stop, 2.0).unwrap(), Vec2::new(0.002, 0.0));
    let ratio = light(0.002) / light(0.004);
    assert!((ratio - 0.25).abs() < 4e-3, "{ratio}");
}

#[test]
fn systems_that_show_nothing_are_refused() {
    let one = |surface| LensDescription { surfaces: vec![surface], film_diagonal: 0.02, focus_distance: None };
    let error = |description: LensDescription| LensSystem::new(description).unwrap_err();
    assert_eq!(error(LensDescription { surfaces: Vec::new(), ..biconvex(0.01) }), LensError::Count(0));
    for wrong in [
        surface(f32::NAN, 0.1, 1.5, 0.1),
        surface(0.1, -0.1, 1.5, 0.1),
        surface(0.1, 0.1, 0.0, 0.1),
        surface(0.1, 0.1, 1.5, 0.0),
        surface(0.1, f32::INFINITY, 1.5, 0.1),
    ] {
        assert_eq!(error(one(wrong)), LensError::Surface(0));
    }
    assert_eq!(error(LensDescription { film_diagonal: 0.0, ..biconvex(0.01) }), LensError::Film);
    let spread = LensDescription { focus_distance: Some(1.0), ..one(surface(-0.04, 0.02, 1.5, 0.01)) };
    assert_eq!(error(spread), LensError::Diverging);
    let text = serde_json::to_string(&LensSystem::new(biconvex(0.01)).unwrap()).unwrap();
    let read: LensSystem = serde_json::from_str(&text).unwrap();
    assert_eq!(read.description(), &biconvex(0.01));
    assert!(serde_json::from_str::<LensSystem>(&text.replace("0.006", "-1")).is_err());
}
