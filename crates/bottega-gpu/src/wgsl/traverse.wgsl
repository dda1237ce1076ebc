// Closest hit and any hit of a ray: a stack in registers, a two-child BVH. Who uses it says by `is_there` which hits count.
//
// WGSL lets an implementation assume that there is no infinity and no NaN: whatever could be either is replaced on the
// processor's side before it comes here.

struct Ray {
    origin: vec3<f32>,
    t_min: f32,
    direction: vec3<f32>,
    t_max: f32,
}

struct Hit {
    t: f32,
    u: f32,
    v: f32,
    instance: u32,
    primitive: u32,
    // Where it is among the shapes.
    shape: u32,
}

const LEAF: u32 = 0x80000000u;
const COUNT_SHIFT: u32 = 28u;
const COUNT_MASK: u32 = 7u;
const FIRST_MASK: u32 = 0x0fffffffu;
// The builder keeps the tree so flat that this is never exceeded.
const STACK_SIZE: u32 = 32u;
// Rounding of a slab test, conservatively: 1 + 2 γ₃ (Ize, "Robust BVH Ray Traversal", 2013).
const SLAB_SLACK: f32 = 1.0000008;
// Tolerance of the edge tests, relative to the sum of the three: rays through a shared edge must not slip between.
const EDGE_SLACK: f32 = 0.0000019;

// Where the ray enters a box, or −1 where it misses it within (t_min, t_max].
fn enter(low: vec3<f32>, high: vec3<f32>, origin: vec3<f32>, inverse: vec3<f32>, t_min: f32, t_max: f32) -> f32 {
    let a = (low - origin) * inverse;
    let b = (high - origin) * inverse;
    let near = min(a, b);
    let far = max(a, b);
    let first = max(max(near.x, near.y), max(near.z, t_min));
    let last = min(min(far.x, far.y), min(far.z, t_max)) * SLAB_SLACK;
    return select(-1.0, first, first <= last && low.x <= high.x);
}

// Edge tests in Plücker coordinates: two triangles that share an edge compute the same number for it, up to its sign.
// (Davidovič et al., "3D Rasterization: A Bridge between Rasterization and Ray Casting", 2012.)
fn hit_triangle(index: u32, shape: Shape, ray: Ray, best: ptr<function, Hit>) {
    let v0 = shape.p0 - ray.origin;
    let v1 = shape.p1 - ray.origin;
    let v2 = shape.p2 - ray.origin;
    let e0 = v2 - v0;
    let e1 = v0 - v1;
    let e2 = v1 - v2;
    let u = dot(cross(e0, v2 + v0), ray.direction);
    let v = dot(cross(e1, v0 + v1), ray.direction);
    let w = dot(cross(e2, v1 + v2), ray.direction);
    let sum = u + v + w;
    let slack = EDGE_SLACK * abs(sum);
    if min(u, min(v, w)) < -slack && max(u, max(v, w)) > slack {
        return;
    }
    let normal = cross(e2, e1);
    let denominator = dot(normal, ray.direction);
    if denominator == 0.0 || sum == 0.0 {
        return;
    }
    let t = dot(v0, normal) / denominator;
    consider(Hit(t, clamp(u / sum, 0.0, 1.0), clamp(v / sum, 0.0, 1.0), shape.instance, shape.primitive, index), ray, best);
}

// Both roots of |o + t d − c|² = r², from the point of the ray that is nearest to the center, which keeps the digits of
// a sphere that is small or far away (Haines et al., "Precision Improvements for Ray/Sphere Intersection", 2019).
fn hit_sphere(index: u32, shape: Shape, ray: Ray, best: ptr<function, Hit>) {
    let radius = shape.p1.x;
    let f = ray.origin - shape.p0;
    let a = dot(ray.direction, ray.direction);
    let middle = -dot(f, ray.direction) / a;
    let offset = f + middle * ray.direction;
    let discriminant = radius * radius - dot(offset, offset);
    if discriminant < 0.0 || !(a > 0.0) {
        return;
    }
    let half_chord = sqrt(discriminant / a);
    // The root with the larger magnitude, and the other by Vieta: no cancellation.
    let larger = middle + select(-half_chord, half_chord, middle >= 0.0);
    let product = (dot(f, f) - radius * radius) / a;
    let other = select(0.0, product / larger, larger != 0.0);
    consider(Hit(min(larger, other), 0.0, 0.0, shape.instance, shape.primitive, index), ray, best);
    consider(Hit(max(larger, other), 0.0, 0.0, shape.instance, shape.primitive, index), ray, best);
}

// Takes a candidate if it is nearer, or as near and of lower numbers.
fn consider(hit: Hit, ray: Ray, best: ptr<function, Hit>) {
    if !(hit.t > ray.t_min) || hit.t > (*best).t {
        return;
    }
    if hit.t == (*best).t && (*best).instance != NOTHING {
        let later = hit.instance > (*best).instance
            || (hit.instance == (*best).instance && hit.primitive >= (*best).primitive);
        if later {
            return;
        }
    }
    if is_there(hit, ray) {
        *best = hit;
    }
}

fn inverse_of(direction: vec3<f32>) -> vec3<f32> {
    let size = max(abs(direction.x), max(abs(direction.y), abs(direction.z)));
    let smallest = vec3<f32>(size * 1e-12);
    let magnitude = max(abs(direction), smallest);
    return select(-1.0 / magnitude, 1.0 / magnitude, direction >= vec3<f32>(0.0));
}

fn traverse(ray: Ray, any: bool) -> Hit {
    var best = Hit(ray.t_max, 0.0, 0.0, NOTHING, NOTHING, NOTHING);
    if !(ray.t_min < ray.t_max) {
        return best;
    }
    let inverse = inverse_of(ray.direction);
    var stack: array<u32, 32>;
    var top = 0u;
    var current = 0u;
    loop {
        if (current & LEAF) != 0u {
            let first = current & FIRST_MASK;
            let end = first + ((current >> COUNT_SHIFT) & COUNT_MASK) + 1u;
            for (var index = first; index < end; index += 1u) {
                let shape = shapes[index];
                if (shape.instance & SPHERE) != 0u {
                    hit_sphere(index, shape, ray, &best);
                } else {
                    hit_triangle(index, shape, ray, &best);
                }
            }
            if any && best.instance != NOTHING {
                return best;
            }
        } else {
            let node = nodes[current];
            let left = enter(node.left_min, node.left_max, ray.origin, inverse, ray.t_min, best.t);
            let right = enter(node.right_min, node.right_max, ray.origin, inverse, ray.t_min, best.t);
            if left >= 0.0 || right >= 0.0 {
                let left_first = left >= 0.0 && (right < 0.0 || left <= right);
                current = select(node.right, node.left, left_first);
                if left >= 0.0 && right >= 0.0 && top < STACK_SIZE {
                    stack[top] = select(node.left, node.right, left_first);
                    top += 1u;
                }
                continue;
            }
        }
        if top == 0u {
            return best;
        }
        top -= 1u;
        current = stack[top];
    }
    return best;
}
