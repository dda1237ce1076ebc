// A thin film whose interference colours a reflection. See `bsdf/film.rs`.

struct Film {
    // Strength; 0: there is none.
    factor: f32,
    ior: f32,
    // In nanometres.
    thickness: f32,
}

fn film_of(factor: f32, ior: f32, thickness: f32) -> Film {
    if factor <= 0.0 || thickness <= 0.0 {
        return Film(0.0, 1.0, 0.0);
    }
    // A film that is too thin to be one fades into the outside.
    let t = min(thickness / 0.03, 1.0);
    return Film(factor, 1.0 + (ior - 1.0) * t * t * (3.0 - 2.0 * t), thickness);
}

fn film_schlick(f0: vec3f, cosine: f32) -> vec3f {
    return f0 + (1.0 - f0) * fresnel_schlick_weight(cosine);
}

// Reflectance for a direction at a cosine outside, `f0` that of the bare base at normal incidence.
fn film_reflectance(film: Film, cosine: f32, f0: vec3f) -> vec3f {
    let cos2 = 1.0 - max(1.0 - cosine * cosine, 0.0) / (film.ior * film.ior);
    if cos2 <= 0.0 {
        return vec3f(1.0);
    }
    let within = sqrt(cos2);
    let outer = film_schlick(vec3f(fresnel_f0(film.ior)), cosine).x;
    let passed = 1.0 - outer;
    let path = 2.0 * film.ior * film.thickness * within;
    let root = sqrt(clamp(f0, vec3f(0.0), vec3f(0.9999)));
    let base = (1.0 + root) / (1.0 - root);
    let step = (base / film.ior - 1.0) / (base / film.ior + 1.0);
    let inner = film_schlick(step * step, within);
    let product = clamp(outer * inner, vec3f(1e-5), vec3f(0.9999));
    let repeated = passed * passed * inner / (1.0 - product);
    let ratio = sqrt(product);
    // Light turns by half a turn where it is reflected by something denser.
    let turn = 0.5 + select(vec3f(0.0), vec3f(0.5), base < vec3f(film.ior));
    var sum = outer + repeated;
    var term = repeated - passed;
    for (var order = 1u; order <= 2u; order++) {
        term *= ratio;
        sum += term * film_sensitivity(f32(order) * path, f32(order) * turn) * 2.0;
    }
    return clamp(sum, vec3f(0.0), vec3f(1.0));
}

// How the observer's three colours see light whose spectrum is a cosine, fitted by Gaussians. `path` in nanometres; `turn` in
// turns, by channel.
fn film_sensitivity(path: f32, turn: vec3f) -> vec3f {
    let x = film_gauss(FILM_X0, path, turn.x) + film_gauss(FILM_X1, path, turn.x);
    let y = film_gauss(FILM_Y, path, turn.y);
    let z = film_gauss(FILM_Z, path, turn.z);
    return vec3f(
        3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
        -0.969266 * x + 1.8760108 * y + 0.041556 * z,
        0.0556434 * x - 0.2040259 * y + 1.0572252 * z,
    );
}

// Height, turns per nanometre, variance per square nanometre.
const FILM_X0: vec3f = vec3f(0.846590002, 0.001681, 1.70854696e-07);
const FILM_X1: vec3f = vec3f(0.153868307, 0.0022399, 1.78766171e-07);
const FILM_Y: vec3f = vec3f(1.00022189, 0.0017953, 3.67330884e-07);
const FILM_Z: vec3f = vec3f(1.00112249, 0.0022084, 2.61035245e-07);

fn film_gauss(gauss: vec3f, path: f32, turn: f32) -> f32 {
    let turns = gauss.y * path + turn;
    return gauss.x * math_turns(turns - floor(turns)).y * math_exp(-gauss.z * path * path);
}

// The f₀ with which Schlick's term reflects as much of evenly spread light as the film does.
fn film_mean_f0(film: Film, f0: vec3f) -> vec3f {
    var sum = vec3f(0.0);
    for (var step = 0u; step < 8u; step++) {
        sum += film_reflectance(film, sqrt((f32(step) + 0.5) / 8.0), f0);
    }
    return clamp((sum / 8.0 - 1.0 / 21.0) * (21.0 / 20.0), vec3f(0.0), vec3f(1.0));
}

// Between the bare reflectance and that of the film, by its strength.
fn film_mix(film: Film, bare: vec3f, coloured: vec3f) -> vec3f {
    return bare + (coloured - bare) * film.factor;
}
