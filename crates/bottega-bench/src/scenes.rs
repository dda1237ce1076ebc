//! Generated scenes for measurements: a rough ball, a furnished room, a pot in a stadium, a hall of a million triangles.

use std::f32::consts::{PI, TAU};

use bottega_kernels::{Aabb, MeshGeometry, Ray, math};
use bottega_scene::{Camera, Environment, Material, Projection, Scene, Spectrum};
use glam::{Mat3, Vec3};

use crate::random::Random;

/// A function that generates a scene.
type SceneMaker = fn() -> BenchScene;

/// The built-in scenes, by name.
pub(crate) const BUILT_IN: [(&str, SceneMaker); 4] =
    [("noisy sphere", noisy_sphere), ("interior", interior), ("pot in stadium", stadium), ("hall", hall)];

/// A mesh with a camera and a light.
#[derive(Clone, Debug)]
pub(crate) struct BenchScene {
    /// The name used in tables.
    pub(crate) name: String,
    /// The positions of the vertices.
    pub(crate) positions: Vec<Vec3>,
    /// Three indices per triangle.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The position of the camera.
    pub(crate) eye: Vec3,
    /// The point that the camera looks at.
    pub(crate) target: Vec3,
    /// A corner of the light and its two edges.
    pub(crate) light: [Vec3; 3],
}

impl BenchScene {
    /// Creates a scene from a mesh, such as an interior.
    pub(crate) fn from_mesh(
        name: &str,
        positions: Vec<Vec3>,
        triangles: Vec<[u32; 3]>,
        eye: Vec3,
        target: Vec3,
    ) -> Self {
        let bounds = positions.iter().fold(Aabb::EMPTY, |b, &p| b.with(p));
        let size = bounds.max - bounds.min;
        let corner = bounds.center() + size * Vec3::new(-0.15, 0.45, -0.15);
        let light = [corner, Vec3::X * 0.3 * size.x, Vec3::Z * 0.3 * size.z];
        Self { name: name.to_owned(), positions, triangles, eye, target, light }
    }

    /// Creates a scene from a mesh on the floor of a closed room, so that paths do not escape.
    pub(crate) fn in_room(name: &str, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let bounds = positions.iter().fold(Aabb::EMPTY, |b, &p| b.with(p));
        let (center, size) = (bounds.center(), (bounds.max - bounds.min).length());
        let mut mesh = Mesh { positions, triangles };
        let (low, high) = (center - Vec3::new(1.0, 0.0, 1.0) * size, center + Vec3::splat(size));
        let low = Vec3::new(low.x, bounds.min.y, low.z);
        let [x, y, z] = [Vec3::X * (high.x - low.x), Vec3::Y * (high.y - low.y), Vec3::Z * (high.z - low.z)];
        for (corner, u, v) in [(low, z, x), (low, x, y), (low, y, z), (high, -x, -z), (high, -y, -x), (high, -z, -y)] {
            mesh.quad(corner, u, v);
        }
        let Mesh { positions, triangles } = mesh;
        let mut scene = Self::from_mesh(name, positions, triangles, center + Vec3::new(0.3, 0.2, 0.4) * size, center);
        scene.light = [high - Vec3::new(1.2, 0.01, 1.2) * size, Vec3::X * 0.4 * size, Vec3::Z * 0.4 * size];
        scene
    }

    /// Returns a scene of grey surfaces with this albedo under a uniform sky, with the camera of the camera rays.
    pub(crate) fn scene(&self, albedo: f32) -> Scene {
        let camera = Camera {
            world_from_camera: Camera::looking(self.eye, self.target, Vec3::Y).unwrap_or_default(),
            projection: Projection::Perspective { vertical_fov: 1.0 },
            ..Camera::default()
        };
        let environment = Some(Environment::uniform(Spectrum::ONE));
        let mut scene = Scene { environment, cameras: vec![camera], ..Scene::default() };
        let material = scene.push_material(Material::matte(Spectrum::splat(albedo)));
        scene.push_surface(bottega_scene::Mesh {
            name: self.name.clone(),
            positions: self.positions.clone(),
            triangles: self.triangles.clone(),
            material,
            ..bottega_scene::Mesh::default()
        });
        scene
    }

    /// Returns the mesh for the builder.
    pub(crate) fn geometry(&self) -> MeshGeometry<'_> {
        MeshGeometry { positions: &self.positions, triangles: &self.triangles }
    }

    /// Returns a point on the light.
    pub(crate) fn light(&self, u: f32, v: f32) -> Vec3 {
        self.light[0] + self.light[1] * u + self.light[2] * v
    }

    /// Returns rays of a perspective camera of 60 degrees through the centers of `side` × `side` pixels, in blocks of 8 × 8.
    pub(crate) fn camera_rays(&self, side: u32) -> Vec<Ray> {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
        let up = right.cross(forward);
        let half = 0.577_350_3;
        let at = |i: u32| ((i as f32 + 0.5) / side as f32 * 2.0 - 1.0) * half;
        let blocks = side.div_ceil(8);
        let mut rays = Vec::with_capacity(side as usize * side as usize);
        for block in 0..blocks * blocks {
            let (bx, by) = (block % blocks * 8, block / blocks * 8);
            for pixel in 0..64 {
                let (x, y) = (bx + pixel % 8, by + pixel / 8);
                if x < side && y < side {
                    rays.push(Ray::new(self.eye, (forward + right * at(x) - up * at(y)).normalize()));
                }
            }
        }
        rays
    }
}

/// Returns a closed ball of 69,168 triangles whose surface is rough at all scales, seen from inside.
pub(crate) fn noisy_sphere() -> BenchScene {
    const AROUND: u32 = 264;
    const DOWN: u32 = 132;
    let point = |i: u32, j: u32| {
        let (s, c) = math::sin_cos(TAU * (i % AROUND) as f32 / AROUND as f32);
        let (st, ct) = math::sin_cos(PI * j as f32 / DOWN as f32);
        let d = Vec3::new(st * c, ct, st * s);
        let mut noise = Random::new(u64::from(j) * 10_007 + u64::from(i % AROUND));
        let wave = math::sin(d.x * 7.0) * math::sin(d.y * 9.0 + 1.0) * math::sin(d.z * 8.0 + 2.0);
        d * (1.0 + 0.15 * wave + 0.02 * noise.unit())
    };
    let mut positions = vec![point(0, 0)];
    for j in 1..DOWN {
        positions.extend((0..AROUND).map(|i| point(i, j)));
    }
    positions.push(point(0, DOWN));
    let last = positions.len() as u32 - 1;
    let index = |i: u32, j: u32| match j {
        0 => 0,
        DOWN => last,
        _ => 1 + (j - 1) * AROUND + i % AROUND,
    };
    let mut triangles = Vec::new();
    for j in 0..DOWN {
        for i in 0..AROUND {
            let (a, b, c, d) = (index(i, j), index(i + 1, j), index(i, j + 1), index(i + 1, j + 1));
            if j != 0 {
                triangles.push([a, b, c]);
            }
            if j != DOWN - 1 {
                triangles.push([b, d, c]);
            }
        }
    }
    let light = [Vec3::new(-0.2, 0.5, -0.2), Vec3::X * 0.4, Vec3::Z * 0.4];
    let (eye, target) = (Vec3::new(0.3, 0.2, 0.4), Vec3::new(-1.0, -0.3, -0.8));
    BenchScene { name: "noisy sphere".to_owned(), positions, triangles, eye, target, light }
}

struct Mesh {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn quad(&mut self, corner: Vec3, u: Vec3, v: Vec3) {
        let i = self.positions.len() as u32;
        self.positions.extend([corner, corner + u, corner + u + v, corner + v]);
        self.triangles.extend([[i, i + 1, i + 2], [i, i + 2, i + 3]]);
    }

    fn cuboid(&mut self, center: Vec3, axes: Mat3, half: Vec3) {
        let [x, y, z] = [axes.x_axis * half.x, axes.y_axis * half.y, axes.z_axis * half.z];
        for (n, u, v) in [(x, y, z), (y, z, x), (z, x, y)] {
            self.quad(center + n - u - v, u * 2.0, v * 2.0);
            self.quad(center - n - u - v, v * 2.0, u * 2.0);
        }
    }

    /// Adds a grid of `n` × `m` squares, with corners at `at(i / n, j / m)`.
    fn grid(&mut self, n: u32, m: u32, mut at: impl FnMut(f32, f32) -> Vec3) {
        let first = self.positions.len() as u32;
        for j in 0..=m {
            self.positions.extend((0..=n).map(|i| at(i as f32 / n as f32, j as f32 / m as f32)));
        }
        for j in 0..m {
            for i in 0..n {
                let a = first + j * (n + 1) + i;
                self.triangles.extend([[a, a + 1, a + n + 1], [a + 1, a + n + 2, a + n + 1]]);
            }
        }
    }

    /// Adds a tube from `a` to `b`, each side two triangles as long as the tube.
    fn tube(&mut self, a: Vec3, b: Vec3, radius: f32, sides: u32) {
        let (u, v) = (b - a).normalize().any_orthonormal_pair();
        let first = self.positions.len() as u32;
        for i in 0..sides {
            let (s, c) = math::sin_cos(TAU * i as f32 / sides as f32);
            let offset = (u * c + v * s) * radius;
            self.positions.extend([a + offset, b + offset]);
        }
        for i in 0..sides {
            let (p, q) = (first + 2 * i, first + 2 * ((i + 1) % sides));
            self.triangles.extend([[p, q, p + 1], [q, q + 1, p + 1]]);
        }
    }
}

/// Returns a furnished room of about 75,000 triangles, most of them long and thin: pipes, slats, beams at all angles, next to
/// a finely tessellated carpet and a few huge walls.
pub(crate) fn interior() -> BenchScene {
    let mut random = Random::new(42);
    let mut mesh = Mesh { positions: Vec::new(), triangles: Vec::new() };
    let (w, h) = (10.0, 4.0);
    mesh.quad(Vec3::ZERO, Vec3::Z * w, Vec3::X * w);
    mesh.quad(Vec3::Y * h, Vec3::X * w, Vec3::Z * w);
    for (corner, side) in [(Vec3::ZERO, Vec3::X), (Vec3::ZERO, Vec3::Z), (Vec3::Z * w, Vec3::X), (Vec3::X * w, Vec3::Z)]
    {
        mesh.quad(corner, side * w, Vec3::Y * h);
    }
    for i in 0..120 {
        let tilt = Mat3::from_rotation_x(0.6);
        mesh.cuboid(Vec3::new(5.0, 0.8 + 0.025 * i as f32, 9.8), tilt, Vec3::new(4.0, 0.001, 0.012));
    }
    for _ in 0..220 {
        let mut point = || Vec3::new(random.between(0.2, 9.8), random.between(0.1, 3.9), random.between(0.2, 9.8));
        let (a, d) = (point(), point());
        let b = a + (d - a) * 0.5;
        mesh.tube(a, b, 0.004 + 0.02 * random.unit(), 48);
    }
    for _ in 0..700 {
        let axes = Mat3::from_rotation_y(TAU * random.unit()) * Mat3::from_rotation_x(random.between(-0.4, 0.4));
        let center = Vec3::new(random.between(0.5, 9.5), random.between(0.0, 1.2), random.between(0.5, 9.5));
        let half = Vec3::new(0.02 + 0.05 * random.unit(), 0.1 + 0.5 * random.unit(), 0.02);
        mesh.cuboid(center, axes, half);
    }
    mesh.grid(150, 150, |u, v| Vec3::new(2.0 + 6.0 * u, 0.01 + 0.03 * random.unit(), 2.0 + 6.0 * v));
    let light = [Vec3::new(4.0, 3.95, 4.0), Vec3::X * 2.0, Vec3::Z * 2.0];
    let (eye, target) = (Vec3::new(1.0, 1.7, 1.0), Vec3::new(6.0, 1.2, 7.0));
    let Mesh { positions, triangles } = mesh;
    BenchScene { name: "interior".to_owned(), positions, triangles, eye, target, light }
}

/// Returns the classic hard case for grids and simple trees: a pot of 27,648 small triangles on the field of a stadium of about
/// 400,000 large ones, a thousand times its size; the camera looks at the pot.
pub(crate) fn stadium() -> BenchScene {
    let mut random = Random::new(11);
    let mut mesh = Mesh { positions: Vec::new(), triangles: Vec::new() };
    let around = |radius: f32, turn: f32, y: f32| {
        let (s, c) = math::sin_cos(TAU * turn);
        Vec3::new(1.4 * radius * c, y, radius * s)
    };
    mesh.grid(96, 96, |u, v| Vec3::new(320.0 * u - 160.0, 0.05 * random.unit() - 0.05, 240.0 * v - 120.0));
    // Forty rows of seats around the field, each a back, a seat and a rail.
    for row in 0..40 {
        let (radius, y) = (125.0 + row as f32 * 1.4, 2.0 + row as f32 * 0.9);
        mesh.grid(400, 1, |u, v| around(radius + 1.4 * v, u, y));
        mesh.grid(400, 1, |u, v| around(radius, u, y - 0.9 * v));
        for seat in 0..360 {
            let turn = seat as f32 / 360.0;
            let axes = Mat3::from_rotation_y(-TAU * turn);
            let at = around(radius + 0.7, turn, y + 0.25);
            mesh.cuboid(at, axes, Vec3::new(0.25, 0.05, 0.3));
            mesh.cuboid(at + axes * Vec3::new(0.28, 0.3, 0.0), axes, Vec3::new(0.03, 0.3, 0.3));
        }
    }
    // Masts that carry a roof of beams.
    for mast in 0..40 {
        let turn = mast as f32 / 40.0;
        mesh.tube(around(182.0, turn, 0.0), around(182.0, turn, 52.0), 0.8, 24);
        mesh.tube(around(182.0, turn, 52.0), around(120.0, turn, 46.0), 0.3, 16);
    }
    pot(&mut mesh, Vec3::new(12.0, 0.0, -7.0), 0.1);
    let (eye, target) = (Vec3::new(12.25, 0.22, -6.7), Vec3::new(12.0, 0.08, -7.0));
    let light = [Vec3::new(-20.0, 60.0, -20.0), Vec3::X * 40.0, Vec3::Z * 40.0];
    let Mesh { positions, triangles } = mesh;
    BenchScene { name: "pot in stadium".to_owned(), positions, triangles, eye, target, light }
}

/// Adds a pot with lid, spout and handle, standing on `base`.
fn pot(mesh: &mut Mesh, base: Vec3, size: f32) {
    let profile = |v: f32| 0.55 + 0.45 * math::sin(PI * (0.15 + 0.7 * v)) - 0.35 * v * v;
    mesh.grid(96, 64, |u, v| {
        let (s, c) = math::sin_cos(TAU * u);
        base + size * Vec3::new(profile(v) * c, 1.2 * v, profile(v) * s)
    });
    mesh.grid(96, 24, |u, v| {
        let (s, c) = math::sin_cos(TAU * u);
        let r = profile(1.0) * (1.0 - v);
        base + size * Vec3::new(r * c, 1.2 + 0.25 * math::sin(0.5 * PI * v) + 0.1 * v * v, r * s)
    });
    // A bent tube: its spine by parameter, then a circle around it.
    let mut bend = |spine: &dyn Fn(f32) -> Vec3, radius: f32| {
        mesh.grid(32, 84, |u, v| {
            let along = (spine(v + 0.01) - spine(v - 0.01)).normalize();
            let side = along.cross(Vec3::Z);
            let (s, c) = math::sin_cos(TAU * u);
            base + size * (spine(v) + radius * (side * c + Vec3::Z * s))
        });
    };
    bend(&|v| Vec3::new(0.75 + 0.7 * v, 0.4 + 0.9 * v * v, 0.0), 0.1);
    bend(
        &|v| {
            let (s, c) = math::sin_cos(PI * v);
            Vec3::new(-0.7 - 0.55 * s, 0.65 + 0.4 * c, 0.0)
        },
        0.07,
    );
}

/// Returns a hall with hilly ground, fluted columns and a coffered ceiling, slightly more than 1,000,000 triangles.
pub(crate) fn hall() -> BenchScene {
    let mut random = Random::new(5);
    let mut mesh = Mesh { positions: Vec::new(), triangles: Vec::new() };
    let (w, h) = (40.0, 12.0);
    let hill =
        |x: f32, z: f32| 0.4 * math::sin(x * 0.5) * math::sin(z * 0.4 + 1.0) + 0.1 * math::sin(x * 2.3 + z * 1.7);
    mesh.grid(460, 460, |u, v| {
        let (x, z) = (w * u, w * v);
        Vec3::new(x, hill(x, z) + 0.02 * random.unit(), z)
    });
    for column in 0..36 {
        let (x, z) = (4.0 + (column % 6) as f32 * 6.4, 4.0 + (column / 6) as f32 * 6.4);
        mesh.grid(96, 80, |u, v| {
            let (s, c) = math::sin_cos(TAU * u);
            let swell = 0.5 + 0.08 * math::sin(PI * v) + 0.03 * math::sin(24.0 * TAU * u);
            Vec3::new(x + swell * c, -0.8 + (h + 0.8) * v, z + swell * s)
        });
    }
    mesh.grid(100, 100, |u, v| {
        let wave = math::sin(w * u * 2.0) * math::sin(w * v * 2.0);
        Vec3::new(w * u, h - 0.3 * wave.abs(), w * (1.0 - v))
    });
    for (corner, side) in [(Vec3::ZERO, Vec3::X), (Vec3::ZERO, Vec3::Z), (Vec3::Z * w, Vec3::X), (Vec3::X * w, Vec3::Z)]
    {
        mesh.quad(corner - Vec3::Y, side * w, Vec3::Y * (h + 1.0));
    }
    let light = [Vec3::new(18.0, 11.0, 18.0), Vec3::X * 4.0, Vec3::Z * 4.0];
    let (eye, target) = (Vec3::new(1.0, 3.0, 1.5), Vec3::new(20.0, 3.5, 24.0));
    let Mesh { positions, triangles } = mesh;
    BenchScene { name: "hall".to_owned(), positions, triangles, eye, target, light }
}
