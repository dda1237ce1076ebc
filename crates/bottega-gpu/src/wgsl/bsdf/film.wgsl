// Twin: `bottega-render/src/bsdf/film.rs`.
//
// A thin film whose interference colours the reflection.

struct Film {
    // Strength in [0, 1]; 0: no film.
    factor: f32,
    ior: f32,
    // Thickness in nanometres.
    thickness: f32,
}

fn film_new(factor: f32, ior: f32, thickness: f32) -> Film {
    if factor <= 0.0 || thickness <= 0.0 {
        return Film(0.0, 1.0, 0.0);
    }
    // Fade out a film whose thickness goes to 0.
    let t = min(thickness / FILM_FADING, 1.0);
    return Film(factor, 1.0 + (ior - 1.0) * t * t * (3.0 - 2.0 * t), thickness);
}

fn film_schlick(f0: vec3f, cosine: f32) -> vec3f {
    return f0 + (1.0 - f0) * fresnel_schlick_weight(cosine);
}

// Returns the reflectance at a cosine outside; `f0`: the reflectance of the bare base at normal incidence.
fn film_reflectance(film: Film, cosine: f32, f0: vec3f) -> vec3f {
    let cos2 = 1.0 - max(1.0 - cosine * cosine, 0.0) / (film.ior * film.ior);
    if cos2 <= 0.0 {
        return vec3f(1.0);
    }
    let within = sqrt(cos2);
    let outer = film_schlick(vec3f(fresnel_at_normal_incidence(film.ior)), cosine).x;
    let passed = 1.0 - outer;
    let path = 2.0 * film.ior * film.thickness * within;
    let root = sqrt(clamp(f0, vec3f(0.0), vec3f(0.9999)));
    let base = (1.0 + root) / (1.0 - root);
    let step = (base / film.ior - 1.0) / (base / film.ior + 1.0);
    let inner = film_schlick(step * step, within);
    let product = clamp(outer * inner, vec3f(1e-5), vec3f(0.9999));
    let repeated = passed * passed * inner / (1.0 - product);
    let ratio = sqrt(product);
    // Reflection at a denser medium shifts the phase by half a turn.
    let turn = 0.5 + select(vec3f(0.0), vec3f(0.5), base < vec3f(film.ior));
    var sum = outer + repeated;
    var term = repeated - passed;
    for (var order = 1u; order <= FILM_TERMS; order++) {
        term *= ratio;
        sum += term * film_sensitivity(f32(order) * path, f32(order) * turn) * 2.0;
    }
    return clamp(sum, vec3f(0.0), vec3f(1.0));
}

// Returns the f₀ for which Schlick's term has the film's mean reflectance over the hemisphere.
fn film_mean_f0(film: Film, f0: vec3f) -> vec3f {
    var sum = vec3f(0.0);
    for (var step = 0u; step < FILM_MEAN_STEPS; step++) {
        sum += film_reflectance(film, sqrt((f32(step) + 0.5) / f32(FILM_MEAN_STEPS)), f0);
    }
    return clamp((sum / f32(FILM_MEAN_STEPS) - 1.0 / 21.0) * (21.0 / 20.0), vec3f(0.0), vec3f(1.0));
}

// Interpolates between the bare reflectance and the film's, by the film's strength.
fn film_mix(film: Film, bare: vec3f, coloured: vec3f) -> vec3f {
    return bare + (coloured - bare) * film.factor;
}

// Returns the response of the three colour channels to a spectrum that is a cosine, fitted by Gaussians. `path` in nanometres;
// `turn` per channel, in turns.
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

fn film_gauss(gauss: vec3f, path: f32, turn: f32) -> f32 {
    let turns = gauss.y * path + turn;
    return gauss.x * math_sin_cos_of_turns(turns - floor(turns)).y * math_exp(-gauss.z * path * path);
}
