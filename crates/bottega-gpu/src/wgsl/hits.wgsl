// No twin.
//
// Intersection of rays with shapes.
//
// WGSL lets an implementation assume that no infinity and no NaN occurs; the CPU replaces values that could be either before the
// upload.

struct Hit {
    t: f32,
    u: f32,
    v: f32,
    instance: u32,
    primitive: u32,
    // Index among the shapes.
    shape: u32,
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

// Accepts a candidate if it is nearer, or as near with lower numbers.
fn consider(hit: Hit, ray: Ray, best: ptr<function, Hit>) {
    if !(hit.t > ray.t_min) || hit.t > (*best).t {
        return;
    }
    if hit.t == (*best).t && (*best).instance != HIT_NOTHING {
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
