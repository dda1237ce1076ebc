//! Cameras for scenes that have none.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use crate::camera::{Camera, Projection};
use crate::model::{Mesh, Scene, corners};

/// Half the field of view of a framing camera, from the centre to the edge of the shorter side: 20°, in radians.
const HALF_FOV: f64 = std::f64::consts::PI / 9.0;

/// Factor of the camera's distance that leaves a margin around the subject.
const FRAMING_MARGIN: f32 = 1.08;

/// Direction from the subject to the camera: in front of it, above it and to the right.
const THREE_QUARTER: Vec3 = Vec3::new(0.55, 0.4, 1.0);

/// Number of triangles sampled to choose the side.
const SAMPLE_COUNT: u64 = 4_000_000;

impl Camera {
    /// Returns a camera that sees a box from the front, above and the right, as close as possible with all of it in
    /// view.
    ///
    /// - `bounds`: least and greatest corner, world space; may be flat or a single point.
    /// - `aspect`: width over height of the picture.
    pub fn framing(bounds: (Vec3, Vec3), aspect: f32) -> Self {
        Self::framing_from(THREE_QUARTER, bounds, aspect)
    }

    /// Returns a camera that sees a box from a given side, as close as possible with all of it in view.
    ///
    /// - `toward_camera`: direction from the box to the camera, of any length but 0.
    /// - `bounds`, `aspect`: as for [`framing`](Self::framing).
    pub fn framing_from(toward_camera: Vec3, bounds: (Vec3, Vec3), aspect: f32) -> Self {
        frame(toward_camera, bounds, corners(bounds), aspect)
    }

    /// Returns a camera that frames a scene: from the front, above and the right, unless that shows many more back
    /// faces than the best of the six sides, as of a room that is open on one side only. Then it looks from such a
    /// side.
    ///
    /// - `aspect`: width over height of the picture; a camera for 1 also frames wider pictures.
    ///
    /// # Panics
    ///
    /// If an instance places a mesh that does not exist.
    pub fn framing_scene(scene: &Scene, aspect: f32) -> Self {
        let bounds = scene.bounds();
        let mesh_bounds: Vec<(Vec3, Vec3)> = scene.meshes.iter().map(Mesh::bounds).collect();
        let turned_boxes = scene.instances.iter().flat_map(|instance| {
            let world_from_object = instance.world_from_object;
            corners(mesh_bounds[instance.mesh as usize]).map(move |corner| world_from_object.transform_point3(corner))
        });
        let spheres = scene.spheres.iter();
        let spheres =
            spheres.flat_map(|sphere| corners((sphere.center - sphere.radius, sphere.center + sphere.radius)));
        // A scene without surfaces is framed like a point.
        let points = turned_boxes.chain(spheres).filter(|point| point.is_finite());
        frame(framing_side(scene), bounds, points, aspect)
    }
}

/// Returns a camera that looks at the centre of `bounds` and sees all of `points`, which lie within.
fn frame(toward_camera: Vec3, (min, max): (Vec3, Vec3), points: impl Iterator<Item = Vec3>, aspect: f32) -> Camera {
    let z = toward_camera.normalize();
    let up = if z.y.abs() > 0.99 { Vec3::NEG_Z } else { Vec3::Y };
    let x = up.cross(z).normalize();
    let y = z.cross(x);
    let aspect = if aspect.is_finite() && aspect > 0.0 { aspect } else { 1.0 };
    // Compute in double precision, then round: platforms differ in the last bit of a tangent.
    let tan = HALF_FOV.tan();
    let tan_upper = if aspect > 1.0 { tan } else { tan / f64::from(aspect) };
    let (tan_x, tan_y) = (tan_upper as f32 * aspect, tan_upper as f32);

    let center = 0.5 * min + 0.5 * max;
    // Distance from the centre at which a point is at the edge of the picture.
    let distance = |point: Vec3| {
        let offset = point - center;
        (offset.dot(x).abs() / tan_x).max(offset.dot(y).abs() / tan_y) + offset.dot(z)
    };
    let nearest = points.map(distance).fold(0.0, f32::max);
    // A point has no size, and far from the origin the distance must exceed rounding.
    let least = (center.abs().max_element() * 1e-4).max(f32::MIN_POSITIVE.sqrt());
    let distance = if nearest > 0.0 { (nearest * FRAMING_MARGIN).max(least) } else { least.max(1.0) };
    let rotation = Mat3A::from_cols(x.into(), y.into(), z.into());
    Camera {
        name: "framing".into(),
        world_from_camera: Affine3A { matrix3: rotation, translation: Vec3A::from(center + z * distance) },
        projection: Projection::Perspective { vertical_fov: (2.0 * tan_upper.atan()) as f32 },
        focus_distance: distance,
        ..Camera::default()
    }
}

/// Returns the direction from which to view a scene: the first candidate that shows hardly more back faces than the
/// best one.
fn framing_side(scene: &Scene) -> Vec3 {
    // A closed surface shows as much front as back from everywhere, an open box more of one.
    const SIDES: [Vec3; 7] = [THREE_QUARTER, Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y];
    let mut facing = [(0.0f64, 0.0f64); SIDES.len()];
    // Visit every n-th triangle of all instances if there are many.
    let stride = (scene.triangle_count() / SAMPLE_COUNT + 1) as usize;
    let mut next = 0;
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        // Projected area of a transformed surface along d: |cofactors(M)·n · d| = |n · cofactors(M)ᵀ·d|.
        let m = instance.world_from_object.matrix3;
        let cofactors = Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        let sides = SIDES.map(|side| Vec3::from(cofactors.transpose() * Vec3A::from(side.normalize())));
        while let Some(&triangle) = mesh.triangles.get(next) {
            let cross = mesh.cross(triangle);
            for (facing, side) in facing.iter_mut().zip(&sides) {
                let area = f64::from(cross.dot(*side));
                if area > 0.0 { facing.0 += area } else { facing.1 -= area }
            }
            next += stride;
        }
        next -= mesh.triangles.len();
    }
    let share = |(front, back): (f64, f64)| if front + back > 0.0 { front / (front + back) } else { 0.5 };
    let best = facing.iter().copied().map(share).fold(0.0, f64::max);
    let chosen = facing.iter().position(|&facing| share(facing) >= 0.8 * best);
    SIDES[chosen.unwrap_or(0)]
}

#[cfg(test)]
mod tests {
    use crate::material::Material;
    use proptest::prelude::*;

    use super::*;

    /// The corners of the box in the picture plane, where [−1, 1]² is the picture.
    fn projected(camera: &Camera, (min, max): (Vec3, Vec3), aspect: f32) -> Vec<Vec3> {
        let Projection::Perspective { vertical_fov } = camera.projection else { panic!("not perspective") };
        let tan = (0.5 * vertical_fov).tan();
        let corner = |index: u32| {
            let pick = |axis: u32| if index >> axis & 1 == 0 { min[axis as usize] } else { max[axis as usize] };
            let p = camera.world_from_camera.inverse().transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
            Vec3::new(p.x / (-p.z * tan * aspect), p.y / (-p.z * tan), -p.z)
        };
        (0..8).map(corner).collect()
    }

    proptest! {
        #[test]
        fn a_framing_camera_shows_all_of_any_box_and_not_much_more(
            center in prop::array::uniform3(-10.0f32..10.0), extent in prop::array::uniform3(0.0f32..5.0),
            flat in prop::array::uniform3(any::<bool>()), scale in -6i32..6, aspect in 0.3f32..3.0,
        ) {
            let scale = 10.0f32.powi(scale);
            let mut extent = Vec3::from_array(extent) + 0.1;
            for axis in 0..3 {
                if flat[axis] { extent[axis] = 0.0; }
            }
            let center = Vec3::from_array(center) * scale;
            let bounds = (center - extent * scale, center + extent * scale);
            let camera = Camera::framing(bounds, aspect);
            let corners = projected(&camera, bounds, aspect);
            let reach = corners.iter().map(|p| p.x.abs().max(p.y.abs())).fold(0.0, f32::max);
            prop_assert!(corners.iter().all(|p| p.z > 0.0));
            prop_assert!(reach <= 1.0, "{reach}");
            if flat != [true; 3] {
                prop_assert!(reach > 0.6, "{reach}");
            }
        }
    }

    #[test]
    fn a_room_is_seen_through_its_open_side() {
        use crate::model::Mesh;
        let mut scene = Scene::default();
        scene.push_material(Material::default());
        let mut room = Mesh::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0));
        // Fronts inside; the side at −z is open.
        let positions = room.positions.clone();
        room.triangles.retain(|triangle| triangle.iter().any(|&vertex| positions[vertex as usize].z > -1.0));
        room.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        scene.push_surface(room);
        assert_eq!(framing_side(&scene), Vec3::NEG_Z);
        let mut closed = Scene::default();
        closed.push_material(Material::default());
        closed.push_surface(Mesh::cuboid(Vec3::splat(-1.0), Vec3::splat(1.0)));
        assert_eq!(framing_side(&closed), THREE_QUARTER);
    }

    #[test]
    fn a_turned_plate_is_framed_by_itself_and_not_by_the_box_around_it() {
        use crate::model::Mesh;
        let mut scene = Scene::default();
        scene.push_material(Material::default());
        let plate = scene.push_mesh(Mesh::quad(Vec3::new(-1.0, 0.0, 1.0), Vec3::X * 2.0, Vec3::NEG_Z * 2.0));
        let flat = Camera::framing_scene(&scene, 1.0);
        assert!((flat.focus_distance - 1.0).abs() < 1e-6, "nothing is there yet");
        scene.push_instance(plate, Affine3A::from_rotation_y(0.7));
        let turned = Camera::framing_scene(&scene, 1.0).focus_distance;
        assert!(turned < Camera::framing(scene.bounds(), 1.0).focus_distance * 0.9, "{turned}");
    }
}
