// The scene's shapes and the tree over them, in world space.

// Both children's boxes. A child is an index of a node, or LEAF | (count − 1) << COUNT_SHIFT | first shape; the box of a
// child that is not there is never entered, for its minimum is above its maximum.
struct Node {
    left_min: vec3<f32>,
    left: u32,
    left_max: vec3<f32>,
    padding_0: u32,
    right_min: vec3<f32>,
    right: u32,
    right_max: vec3<f32>,
    padding_1: u32,
}

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

@group(0) @binding(0) var<storage, read> nodes: array<Node>;
@group(0) @binding(1) var<storage, read> shapes: array<Shape>;
