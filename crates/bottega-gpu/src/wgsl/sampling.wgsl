// Twin: `bottega-render/src/sampling.rs`.
//
// Maps from the unit square to directions and positions, by density.

// Two unit vectors that form a right-handed frame with n (Duff et al. 2017).
struct Basis {
    s: vec3<f32>,
    t: vec3<f32>,
}

// The concentric map (Shirley and Chiu 1997).
fn uniform_disk(u: vec2<f32>) -> vec2<f32> {
    let a = 2.0 * u.x - 1.0;
    let b = 2.0 * u.y - 1.0;
    if a == 0.0 && b == 0.0 {
        return vec2<f32>(0.0);
    }
    let is_flat = abs(a) > abs(b);
    let radius = select(b, a, is_flat);
    let angle = select(0.5 * PI - 0.25 * PI * (a / select(b, 1.0, is_flat)), 0.25 * PI * (b / select(1.0, a, is_flat)), is_flat);
    return radius * sin_cos(angle).yx;
}

fn uniform_sphere(u: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - 2.0 * u.x;
    let r = sqrt(max(1.0 - z * z, 0.0));
    let turn = math_sin_cos_of_turns(u.y);
    return vec3(r * turn.y, r * turn.x, z);
}

// Samples a triangle uniformly; returns barycentric coordinates (Heitz 2019).
fn uniform_triangle(u: vec2<f32>) -> vec2<f32> {
    if u.y > u.x {
        return vec2(0.5 * u.x, u.y - 0.5 * u.x);
    }
    return vec2(u.x - 0.5 * u.y, 0.5 * u.y);
}

fn orthonormal_basis(n: vec3<f32>) -> Basis {
    let side = select(1.0, -1.0, n.z < 0.0);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    return Basis(vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x), vec3(b, side + n.y * n.y * a, -n.y));
}
