//! A generated scene for measuring devices: a furnished room under a uniform sky.
//!
//! The room is closed and has some 75,000 triangles, most of them long and thin: pipes, slats and boards at all angles,
//! together with a finely tessellated carpet and a few huge walls.

use std::f32::consts::TAU;

use bottega_scene::{Camera, Environment, Material, Mesh, Projection, Scene, Spectrum};
use glam::{Affine3A, Quat, Vec2, Vec3};

/// Albedo of all surfaces.
const ALBEDO: f32 = 0.7;
/// Number of squares along each side of the carpet.
const CARPET: u32 = 150;
const SLATS: u32 = 120;
const PIPES: u32 = 220;
const PIPE_SIDES: u32 = 48;
const BOARDS: u32 = 700;

/// Returns the room, with a camera that sees most of it.
pub(super) fn room() -> Scene {
    let mut scene = Scene {
        environment: Some(Environment::uniform(Spectrum::ONE)),
        cameras: vec![Camera {
            world_from_camera: Camera::looking(Vec3::new(1.0, 1.7, 1.0), Vec3::new(6.0, 1.2, 7.0), Vec3::Y)
                .unwrap_or_default(),
            projection: Projection::Perspective { vertical_fov: 1.0 },
            ..Camera::default()
        }],
        ..Scene::default()
    };
    let material = scene.push_material(Material::matte(Spectrum::splat(ALBEDO)));
    scene.push_surface(Mesh { material, ..furniture() });
    scene
}

/// Returns walls and furniture as one mesh.
fn furniture() -> Mesh {
    let (cube, pipe) = (cube(), pipe());
    let mut mesh = Mesh { name: "room".to_owned(), ..Mesh::default() };
    let half = Vec3::new(5.0, 2.0, 5.0);
    add(&mut mesh, &cube, Affine3A::from_scale_rotation_translation(half, Quat::IDENTITY, half));
    add(&mut mesh, &carpet(), Affine3A::from_translation(Vec3::new(2.0, 0.01, 2.0)));
    for n in 0..SLATS {
        let (size, turn) = (Vec3::new(4.0, 0.001, 0.012), Quat::from_rotation_x(0.6));
        let at = Vec3::new(5.0, 0.8 + 0.025 * n as f32, 9.8);
        add(&mut mesh, &cube, Affine3A::from_scale_rotation_translation(size, turn, at));
    }
    for n in 0..PIPES {
        // A pipe spans half of the way between two points in the room.
        let place = |n| Vec3::splat(0.2) + evenly(n) * Vec3::new(9.6, 3.7, 9.6);
        let (from, way) = (place(n), 0.5 * (place(n + 5 * PIPES) - place(n)));
        let radius = 0.004 + 0.02 * evenly(n + 9 * PIPES).x;
        let turn = Quat::from_rotation_arc(Vec3::Z, way.normalize_or(Vec3::Z));
        let size = Vec3::new(radius, radius, way.length());
        add(&mut mesh, &pipe, Affine3A::from_scale_rotation_translation(size, turn, from));
    }
    for n in 0..BOARDS {
        let [at, size, turn] = [n, n + 3 * BOARDS, n + 7 * BOARDS].map(evenly);
        let at = Vec3::new(0.5, 0.0, 0.5) + at * Vec3::new(9.0, 1.2, 9.0);
        let size = Vec3::new(0.02 + 0.05 * size.x, 0.1 + 0.5 * size.y, 0.02);
        let turn = Quat::from_rotation_y(TAU * turn.x) * Quat::from_rotation_x(0.8 * turn.y - 0.4);
        add(&mut mesh, &cube, Affine3A::from_scale_rotation_translation(size, turn, at));
    }
    mesh
}

/// Vertices and triangles of a part, to be placed in the room.
struct RoomPart {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

fn add(mesh: &mut Mesh, part: &RoomPart, place: Affine3A) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(part.positions.iter().map(|&position| place.transform_point3(position)));
    mesh.triangles.extend(part.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
}

/// Returns the cube from −1 to 1 on each axis.
fn cube() -> RoomPart {
    const SIDES: [[u32; 4]; 6] = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let corner = |i: u32| 2.0 * Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) - 1.0;
    let triangles = SIDES.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    RoomPart { positions: (0..8).map(corner).collect(), triangles: triangles.collect() }
}

/// Returns the open cylinder of radius 1 from z = 0 to 1.
fn pipe() -> RoomPart {
    let edge = |i: u32| {
        let around = Vec2::from_angle(TAU * i as f32 / PIPE_SIDES as f32);
        [around.extend(0.0), around.extend(1.0)]
    };
    let side = |i: u32| {
        let (a, b) = (2 * i, 2 * ((i + 1) % PIPE_SIDES));
        [[a, b, a + 1], [b, b + 1, a + 1]]
    };
    RoomPart {
        positions: (0..PIPE_SIDES).flat_map(edge).collect(),
        triangles: (0..PIPE_SIDES).flat_map(side).collect(),
    }
}

/// Returns the carpet: 6 m × 6 m, with heights of 0 to 3 cm.
fn carpet() -> RoomPart {
    let row = CARPET + 1;
    let knot = |i: u32| {
        let across = 6.0 / CARPET as f32;
        Vec3::new((i % row) as f32 * across, 0.03 * evenly(i).x, (i / row) as f32 * across)
    };
    let square = |i: u32| {
        let a = i / CARPET * row + i % CARPET;
        [[a, a + 1, a + row], [a + 1, a + row + 1, a + row]]
    };
    RoomPart {
        positions: (0..row * row).map(knot).collect(),
        triangles: (0..CARPET * CARPET).flat_map(square).collect(),
    }
}

/// Returns the `n`-th point of a sequence that fills the unit cube evenly: the additive recurrence of Roberts 2018, "The
/// Unreasonable Effectiveness of Quasirandom Sequences".
fn evenly(n: u32) -> Vec3 {
    let place = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3];
    Vec3::from_array(place.map(|step: f64| (f64::from(n) * step).fract() as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_has_as_many_triangles_as_figures_of_devices_are_compared_on() {
        let scene = room();
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.triangles.len(), 12 + 45_000 + 12 * 120 + 96 * 220 + 12 * 700);
        // Everything is in the room, except for tips that pierce a wall.
        let is_inside = |p: &&Vec3| p.cmpge(Vec3::splat(-1.0)).all() && p.cmple(Vec3::new(11.0, 5.0, 11.0)).all();
        assert_eq!(mesh.positions.iter().filter(is_inside).count(), mesh.positions.len());
    }
}
