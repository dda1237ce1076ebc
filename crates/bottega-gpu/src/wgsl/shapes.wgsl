// The scene's shapes and the tree over them, in world space.

// A triangle's vertices, or center (p0) and radius (p1.x) of a sphere, which SPHERE in `instance` tells.
struct Shape {
    p0: vec3<f32>,
    instance: u32,
    p1: vec3<f32>,
    primitive: u32,
    p2: vec3<f32>,
    padding: u32,
}

const SPHERE: u32 = 0x80000000u;
const NOTHING: u32 = 0xffffffffu;

@group(0) @binding(1) var<storage, read> shapes: array<Shape>;
