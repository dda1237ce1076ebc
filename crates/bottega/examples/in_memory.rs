//! A scene made in memory, of no file: `cargo run --release -p bottega --example in_memory -- picture.png`.

use std::sync::Arc;

use bottega::{
    Event, Request, Session, StopSwitch,
    glam::{Affine3A, Vec3},
    scene::{Camera, Environment, Instance, Material, Mesh, Projection, Scene, Spectrum},
};

/// A rectangle in the plane y = `height`, seen from above or from below.
fn square(name: &str, half: f32, height: f32, is_seen_from_above: bool, material: u32) -> Mesh {
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
    let positions = corners.map(|[x, z]| Vec3::new(x, height, z)).to_vec();
    let triangles = if is_seen_from_above { vec![[0, 2, 1], [0, 3, 2]] } else { vec![[0, 1, 2], [0, 2, 3]] };
    Mesh { name: name.to_owned(), positions, triangles, material, ..Mesh::default() }
}

/// A four-sided pyramid that stands on y = 0.
fn pyramid(material: u32) -> Mesh {
    let positions = [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [0.0, 1.5, 0.0]];
    let positions = positions.map(Vec3::from).to_vec();
    let triangles = vec![[1, 0, 4], [2, 1, 4], [3, 2, 4], [0, 3, 4]];
    Mesh { name: "pyramid".to_owned(), positions, triangles, material, ..Mesh::default() }
}

fn scene() -> Scene {
    let meshes = vec![square("floor", 6.0, 0.0, true, 0), pyramid(1), square("lamp", 1.0, 5.0, false, 2)];
    let (eye, target) = (Vec3::new(3.0, 2.5, 5.0), Vec3::new(0.0, 0.6, 0.0));
    let instances = (0..meshes.len()).map(|mesh| Instance::new(mesh as u32, Affine3A::IDENTITY));
    Scene {
        instances: instances.collect(),
        materials: vec![
            Material::matte(Spectrum::splat(0.7)),
            Material::matte(Spectrum::from_array([0.7, 0.3, 0.1])),
            Material::emitter(Spectrum::splat(12.0)),
        ],
        environment: Some(Environment::uniform(Spectrum::splat(0.1))),
        cameras: vec![Camera {
            world_from_camera: Camera::looking(eye, target, Vec3::Y).unwrap_or_default(),
            projection: Projection::Perspective { vertical_fov: 0.6 },
            ..Camera::default()
        }],
        meshes: meshes.into(),
        ..Scene::default()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let picture = std::env::args().nth(1).ok_or("PICTURE")?;
    let mut request = Request::new("a pyramid under a lamp");
    request.film.size = Some([320, 240]);
    request.goal.samples = Some(32);
    let watcher = |event: Event| {
        if let Event::Progress(progress) = event {
            eprintln!("{:.0} %", 100.0 * progress.share);
        }
    };
    let painted = Session::of_scene(&request, scene())?.render(Arc::new(watcher), &StopSwitch::new())?;
    painted.save(&picture)?;
    eprintln!("{picture}: {} zones", painted.report().rows.len());
    Ok(())
}
