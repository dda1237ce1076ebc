// Twin: `bottega-render/src/bsdf/coated.rs`.
//
// A base below a dielectric boundary and a layer that may scatter, with all interreflections: random walks of at most `max_depth`
// events, with random numbers hashed from the directions.

struct Stack {
    eta: f32,
    facets: Microfacets,
    // The layer: thickness in mean free paths, single-scattering albedo, asymmetry, maximum number of events.
    thickness: f32,
    albedo: vec3f,
    g: f32,
    max_depth: u32,
    // The base: metal, or matte of this colour.
    is_metal: bool,
    color: vec3f,
    metal: Conductor,
    // α of facets at the outside that approximate the base's reflection, for sampling.
    proxy: vec2f,
}

// A direction sampled from the base; pdf below 0: a Dirac lobe.
struct StackBounce {
    exists: bool,
    w: vec3f,
    share: vec3f,
    density: f32,
}

struct StackExit {
    exists: bool,
    w: vec3f,
    carried: vec3f,
}

// Multiplies 64-bit numbers given as low and high words.
fn coated_product(a: vec2u, b: vec2u) -> vec2u {
    let a0 = a.x & 0xffffu;
    let a1 = a.x >> 16u;
    let b0 = b.x & 0xffffu;
    let b1 = b.x >> 16u;
    let low = a0 * b0;
    let p = a0 * b1;
    let q = a1 * b0;
    let middle = (low >> 16u) + (p & 0xffffu) + (q & 0xffffu);
    let high = a1 * b1 + (p >> 16u) + (q >> 16u) + (middle >> 16u);
    return vec2u((low & 0xffffu) | (middle << 16u), high + a.x * b.y + a.y * b.x);
}

fn stack_new(wo: vec3f, given: Stack) -> Bsdf {
    var it = given;
    let below = select(vec2f(1.0), it.metal.facets.alpha, it.is_metal);
    // From outside, slopes of the base look η times as steep, and each crossing of a rough boundary adds its own.
    let a = it.eta * below;
    let c = (it.eta - 1.0) * it.facets.alpha;
    it.proxy = microfacets_new(0u, min(sqrt(a * a + c * c), vec2f(1.0))).alpha;
    var b = bsdf_black(wo);
    b.kind = BSDF_KIND_STACK;
    b.lobes = select(BSDF_HAS_NON_DELTA, 0u, stack_is_smooth(it));
    b.roughness = min(microfacets_roughness(it.facets), microfacets_roughness(Microfacets(it.proxy, 0u)));
    let surface = fresnel_dielectric(wo.z, it.eta);
    let cosine = stack_cos_below(it, wo.z);
    var base = it.color;
    if it.is_metal {
        base = conductor_reflectance(it.metal, cosine);
    }
    let passed = math_exp(-2.0 * it.thickness / cosine);
    b.albedo = base * ((1.0 - surface) * passed) + surface + it.albedo * ((1.0 - surface) * (1.0 - passed) * 0.5);
    b.d[0] = vec4f(it.eta, it.thickness, it.g, 0.0);
    b.d[1] = vec4f(it.albedo, 0.0);
    b.d[2] = vec4f(it.facets.alpha, it.proxy);
    b.d[3] = vec4f(select(it.color, it.metal.tint, it.is_metal), 0.0);
    b.d[4] = vec4f(it.metal.eta, it.metal.facets.alpha.x);
    b.d[5] = vec4f(it.metal.k, it.metal.facets.alpha.y);
    b.d[6] = vec4f(stack_chances(it, wo.z), 0.0, 0.0);
    let facets = it.facets.bits | (it.metal.facets.bits << STACK_METAL_SHIFT);
    b.words = vec3u(facets | select(0u, STACK_IS_METAL, it.is_metal), it.max_depth, 0u);
    return b;
}

fn stack_from(b: ptr<function, Bsdf>) -> Stack {
    let bits = (*b).words.x;
    let d0 = (*b).d[0];
    let d2 = (*b).d[2];
    let d4 = (*b).d[4];
    let d5 = (*b).d[5];
    let color = (*b).d[3].xyz;
    let metal = Conductor(d4.xyz, d5.xyz, color, Microfacets(vec2f(d4.w, d5.w), (bits >> STACK_METAL_SHIFT) & FACETS_MASK));
    let facets = Microfacets(d2.xy, bits & FACETS_MASK);
    let is_metal = (bits & STACK_IS_METAL) != 0u;
    return Stack(d0.x, facets, d0.y, (*b).d[1].xyz, d0.z, (*b).words.y, is_metal, color, metal, d2.zw);
}

// Returns the reflectance without scattering, of smooth boundary and smooth base.
fn stack_mirrored_unscattered(it: Stack, cosine: f32) -> vec3f {
    let surface = fresnel_dielectric(cosine, it.eta);
    if !it.is_metal || !microfacets_is_smooth(it.metal.facets) {
        return vec3f(surface);
    }
    let below = stack_cos_below(it, cosine);
    let once = conductor_reflectance(it.metal, below) * math_exp(-2.0 * it.thickness / below);
    var sum = vec3f(0.0);
    var term = once * ((1.0 - surface) * (1.0 - surface));
    for (var i = 0u; i < (it.max_depth + 1u) / 2u; i++) {
        sum += term;
        term *= once * surface;
    }
    return sum + surface;
}

fn stack_cos_below(it: Stack, cosine: f32) -> f32 {
    return sqrt(max(1.0 - max(1.0 - cosine * cosine, 0.0) / (it.eta * it.eta), 1e-8));
}

fn stack_is_smooth(it: Stack) -> bool {
    return it.is_metal && microfacets_is_smooth(it.metal.facets) && microfacets_is_smooth(it.facets) && math_max3(it.albedo) <= 0.0;
}

// Returns the probabilities of sampling the boundary's lobe and the proxy's.
fn stack_chances(it: Stack, cosine: f32) -> vec2f {
    if stack_is_smooth(it) {
        return vec2f(1.0, 0.0);
    }
    let top_is_smooth = microfacets_is_smooth(it.facets);
    var surface = fresnel_dielectric(cosine, it.eta);
    if top_is_smooth {
        surface = math_mean(stack_mirrored_unscattered(it, cosine));
    }
    let below = stack_cos_below(it, cosine);
    let passed = math_exp(-2.0 * it.thickness / below) * (1.0 - surface);
    var sharp = 0.0;
    var even = math_mean(it.color);
    if it.is_metal {
        even = 0.05;
        if !(microfacets_is_smooth(it.metal.facets) && top_is_smooth) {
            sharp = math_mean(conductor_reflectance(it.metal, below)) * passed;
        }
    }
    even += max(1.0 - surface - passed, 0.0) * math_mean(it.albedo);
    return vec2f(surface, sharp) / (surface + sharp + even);
}

// Samples a direction inside that `w` refracts to; w component: its weight; z = 0: none.
fn stack_enter(it: Stack, w: vec3f, u: vec2f) -> vec4f {
    let h = microfacets_sample_visible_normal(it.facets, w, u);
    let below = fresnel_refract(w, h, it.eta).xyz;
    if below.z >= 0.0 {
        return vec4f(0.0);
    }
    let weight = microfacets_shadowing(it.facets, w, below) / microfacets_masking(it.facets, w);
    return vec4f(below, weight * (1.0 - fresnel_dielectric(dot(w, h), it.eta)));
}

// Returns f of the boundary from `below` to `above` in importance mode, and the pdf with which `stack_enter` samples `below`.
fn stack_crossing(it: Stack, above: vec3f, below: vec3f) -> vec2f {
    let bounce = microfacets_bounce(it.facets, above, below, it.eta);
    return vec2f(bounce.value * (1.0 - fresnel_dielectric(bounce.cosine, it.eta)), bounce.pdf);
}

fn stack_passed(depth: f32, w: vec3f) -> f32 {
    return math_exp(-depth / max(abs(w.z), 1e-6));
}

// Returns f and pdf of the base, for directions above it.
fn stack_base(it: Stack, wo: vec3f, wi: vec3f) -> BsdfValue {
    if !it.is_metal {
        return BsdfValue(it.color * FRAC_1_PI, warp_cosine_hemisphere_pdf(wi.z));
    }
    if wi.z <= 0.0 {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    let bounce = microfacets_bounce(it.metal.facets, wo, wi, 1.0);
    return BsdfValue(conductor_reflectance(it.metal, bounce.cosine) * bounce.value, bounce.pdf);
}

fn stack_sample_base(it: Stack, wo: vec3f, u: vec2f) -> StackBounce {
    if !it.is_metal {
        let w = warp_cosine_hemisphere(u);
        return StackBounce(true, w, it.color, warp_cosine_hemisphere_pdf(w.z));
    }
    if microfacets_is_smooth(it.metal.facets) {
        let share = conductor_reflectance(it.metal, wo.z);
        return StackBounce(math_max3(share) > 0.0, vec3f(-wo.xy, wo.z), share, -1.0);
    }
    let w = fresnel_reflect(wo, microfacets_sample_visible_normal(it.metal.facets, wo, u));
    let value = stack_base(it, wo, w);
    let exists = value.pdf > 0.0 && math_max3(value.value) > 0.0;
    return StackBounce(exists, w, value.value * (abs(w.z) / select(1.0, value.pdf, exists)), value.pdf);
}

// Estimates f of all light that enters the layer and leaves it, without purely specular paths.
fn stack_walk(it: Stack, wo: vec3f, wi: vec3f) -> vec3f {
    let scatters = math_max3(it.albedo) > 0.0;
    let rough_top = !microfacets_is_smooth(it.facets);
    var state = walk_random_new(wo, wi);
    let entered = stack_enter(it, wo, walk_random_pair(&state));
    if entered.z == 0.0 {
        return vec3f(0.0);
    }
    // Follow the light in from wi: `way` points down, and light arrives from its opposite.
    let exit = stack_enter(it, wi, walk_random_pair(&state));
    let way = exit.xyz;
    let left = exit.w / max(-way.z, 1e-30);
    let way_density = stack_crossing(it, wi, select(vec3f(0.0, 0.0, -1.0), way, exit.z < 0.0)).y;
    var w = entered.xyz;
    var carried = vec3f(entered.w);
    var sum = vec3f(0.0);
    // Walk below the boundary.
    var depth = 0.0;
    for (var event = 0u; event < it.max_depth; event++) {
        // Terminate with Russian roulette.
        if event > 3u {
            let survival = min(math_max3(carried), 1.0);
            if survival < 0.25 {
                if walk_random_next(&state) >= survival {
                    break;
                }
                carried /= survival;
            }
        }
        // Set if the path goes up: the pdf of its direction, below 0 for a Dirac lobe.
        var goes_up = false;
        var density = 0.0;
        var is_within = false;
        // Sample the distance to the next scattering, or attenuate.
        if scatters {
            let step = -math_ln(1.0 - walk_random_next(&state)) * abs(w.z);
            let next = depth + select(step, -step, w.z > 0.0);
            is_within = next > 0.0 && next < it.thickness;
            depth = select(depth, next, is_within);
        } else {
            carried *= stack_passed(it.thickness, w);
        }
        if is_within {
            // Scatter in the layer: connect to wi, then sample the phase function.
            carried *= it.albedo;
            if exit.z < 0.0 {
                let phase = coated_henyey_greenstein(it.g, dot(w, -way));
                let weight = select(1.0, coated_balance(way_density, phase), rough_top);
                sum += carried * (phase * weight * left * stack_passed(depth, way));
                if !rough_top && it.is_metal && microfacets_is_smooth(it.metal.facets) {
                    // Connect by way of the mirror below, which no other strategy finds.
                    let mirrored = coated_henyey_greenstein(it.g, dot(w, vec3f(-way.xy, way.z)));
                    let passed = stack_passed(2.0 * it.thickness - depth, way);
                    sum += carried * conductor_reflectance(it.metal, -way.z) * (mirrored * left * passed);
                }
            }
            let next = coated_sample_henyey_greenstein(it.g, w, walk_random_pair(&state));
            density = coated_henyey_greenstein(it.g, dot(w, next));
            w = next;
            goes_up = w.z > 0.0;
        } else if w.z > 0.0 {
            // Reflect at the boundary from below and continue.
            depth = 0.0;
            let down = stack_reflected_within(it, w, walk_random_pair(&state));
            if down.z == 0.0 {
                break;
            }
            carried *= down.w;
            w = down.xyz;
        } else {
            // Scatter at the base: connect to wi, then sample the base.
            depth = it.thickness;
            let up = -w;
            if exit.z < 0.0 {
                let value = stack_base(it, up, -way);
                let weight = select(1.0, coated_balance(way_density, value.pdf), rough_top);
                sum += carried * value.value * (weight * exit.w * stack_passed(it.thickness, way));
            }
            let next = stack_sample_base(it, up, walk_random_pair(&state));
            if !next.exists {
                break;
            }
            carried *= next.share;
            w = next.w;
            density = next.density;
            goes_up = true;
        }
        // Add what a rough boundary refracts to wi.
        if goes_up && rough_top {
            sum += carried * stack_left(it, w, wi, density, depth);
        }
    }
    return sum / (it.eta * it.eta);
}

// Returns the light going up along `w` from `depth`, sampled with `density` (below 0: the only direction), that a rough boundary
// refracts to `wi`.
fn stack_left(it: Stack, w: vec3f, wi: vec3f, density: f32, depth: f32) -> f32 {
    let crossing = stack_crossing(it, wi, -w);
    if crossing.x == 0.0 {
        return 0.0;
    }
    return crossing.x * select(coated_balance(density, crossing.y), 1.0, density < 0.0) * stack_passed(depth, w);
}

// Samples the reflection within of light going up along `w`; w component: its weight; z = 0: none.
fn stack_reflected_within(it: Stack, w: vec3f, u: vec2f) -> vec4f {
    let o = vec3f(-w.xy, w.z);
    let h = microfacets_sample_visible_normal(it.facets, o, u);
    let i = fresnel_reflect(o, h);
    if i.z <= 0.0 {
        return vec4f(0.0);
    }
    let weight = microfacets_shadowing(it.facets, o, i) / microfacets_masking(it.facets, o);
    return vec4f(i.xy, -i.z, weight * fresnel_dielectric(dot(o, h), 1.0 / it.eta));
}

// Approximates the pdf with which `stack_sample` samples `wi`.
fn stack_likeness(it: Stack, chances: vec2f, wo: vec3f, wi: vec3f) -> f32 {
    let pdf = max(1.0 - chances.x - chances.y, 0.0) * warp_cosine_hemisphere_pdf(wi.z);
    return pdf + chances.x * microfacets_bounce(it.facets, wo, wi, 1.0).pdf
        + chances.y * microfacets_bounce(Microfacets(it.proxy, 0u), wo, wi, 1.0).pdf;
}

// Traces light that enters the layer until it leaves, without purely specular paths. `u` samples the first facet, or below a
// smooth boundary the first direction from the base.
fn stack_walk_out(it: Stack, wo: vec3f, u: vec2f, seed: vec2u) -> StackExit {
    let nothing = StackExit(false, vec3f(0.0), vec3f(0.0));
    let scatters = math_max3(it.albedo) > 0.0;
    let rough_top = !microfacets_is_smooth(it.facets);
    var state = seed;
    var has_first = !rough_top;
    var at_top = u;
    if !rough_top {
        at_top = walk_random_pair(&state);
    }
    let entered = stack_enter(it, wo, at_top);
    if entered.z == 0.0 {
        return nothing;
    }
    var w = entered.xyz;
    var carried = vec3f(entered.w);
    var is_spread = rough_top;
    var depth = 0.0;
    for (var events = 0u; events <= it.max_depth; events++) {
        // Terminate with Russian roulette.
        if events > 3u {
            let survival = min(math_max3(carried), 1.0);
            if survival < 0.25 {
                if walk_random_next(&state) >= survival {
                    return nothing;
                }
                carried /= survival;
            }
        }
        // Sample the distance to the next scattering, or attenuate.
        var is_within = false;
        if scatters {
            let step = -math_ln(1.0 - walk_random_next(&state)) * abs(w.z);
            let next = depth + select(step, -step, w.z > 0.0);
            is_within = next > 0.0 && next < it.thickness;
            depth = select(depth, next, is_within);
        } else {
            carried *= stack_passed(it.thickness, w);
        }
        if is_within {
            carried *= it.albedo;
            w = coated_sample_henyey_greenstein(it.g, w, walk_random_pair(&state));
            is_spread = true;
        } else if w.z > 0.0 {
            // Reflect or refract at the boundary; seen from inside, its normal points down.
            let o = vec3f(-w.xy, w.z);
            let h = microfacets_sample_visible_normal(it.facets, o, walk_random_pair(&state));
            let mirrors = walk_random_next(&state) < fresnel_dielectric(dot(o, h), 1.0 / it.eta);
            var i = fresnel_reflect(o, h);
            if !mirrors {
                i = fresnel_refract(o, h, 1.0 / it.eta).xyz;
            }
            if (i.z > 0.0) != mirrors || i.z == 0.0 {
                return nothing;
            }
            carried *= microfacets_shadowing(it.facets, o, i) / microfacets_masking(it.facets, o);
            w = vec3f(i.xy, -i.z);
            if !mirrors {
                return StackExit(is_spread, w, carried);
            }
            depth = 0.0;
        } else {
            // Scatter at the base.
            var at_base = u;
            if !has_first {
                at_base = walk_random_pair(&state);
            }
            has_first = false;
            let next = stack_sample_base(it, -w, at_base);
            if !next.exists {
                return nothing;
            }
            is_spread = is_spread || next.density >= 0.0;
            carried *= next.share;
            w = next.w;
            depth = it.thickness;
        }
    }
    return nothing;
}

fn stack_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    let it = stack_from(b);
    let wo = (*b).wo;
    if wi.z <= 0.0 || stack_is_smooth(it) {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    let bounce = microfacets_bounce(it.facets, wo, wi, 1.0);
    let mirrored = fresnel_dielectric(bounce.cosine, it.eta) * bounce.value;
    return BsdfValue(stack_walk(it, wo, wi) + mirrored, stack_likeness(it, (*b).d[6].xy, wo, wi));
}

fn stack_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    let it = stack_from(b);
    let wo = (*b).wo;
    let chances = (*b).d[6].xy;
    let rest = warp_rest(u.x, chances.x);
    var wi = vec3f(-wo.xy, wo.z);
    var weight = vec3f(0.0);
    var kind = BSDF_GLOSSY;
    if u.x >= chances.x {
        let exit = stack_walk_out(it, wo, u.yz, walk_random_new(wo, vec3f(rest, u.yz)));
        if !exit.exists {
            return BSDF_NONE;
        }
        wi = exit.w;
        weight = exit.carried / (1.0 - chances.x);
        kind = BSDF_DIFFUSE;
    } else if microfacets_is_smooth(it.facets) {
        return bsdf_delta(wi, stack_mirrored_unscattered(it, wo.z), chances.x, BSDF_REFLECTION, 1.0);
    } else {
        let h = microfacets_sample_visible_normal(it.facets, wo, u.yz);
        wi = fresnel_reflect(wo, h);
        let share = fresnel_dielectric(dot(wo, h), it.eta) * microfacets_shadowing(it.facets, wo, wi);
        weight = vec3f(share / (microfacets_masking(it.facets, wo) * chances.x));
    }
    if wi.z <= 0.0 {
        return BSDF_NONE;
    }
    let pdf = stack_likeness(it, chances, wo, wi);
    return BsdfDrawn(wi, select(0u, BSDF_REFLECTION | kind, pdf > 0.0), 1.0, weight * pdf, pdf);
}

fn stack_surface(record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f) -> Bsdf {
    var it: Stack;
    let roughness = vec2f((*p)[COATED_PARAM_ROUGHNESS_X].x, (*p)[COATED_PARAM_ROUGHNESS_Y].x);
    it.facets = microfacets_new(material_words[record + COATED_FACETS], roughness);
    it.eta = material_f32(record + COATED_ETA);
    it.albedo = surface_share((*p)[COATED_PARAM_ALBEDO]);
    it.thickness = clamp((*p)[COATED_PARAM_THICKNESS].x, 0.0, 100.0);
    it.g = clamp((*p)[COATED_PARAM_G].x, -0.99, 0.99);
    it.max_depth = material_words[record + COATED_MAX_DEPTH];
    it.is_metal = material_words[record + COATED_IS_METAL] != 0u;
    if it.is_metal {
        it.metal = conductor_param(p, COATED_PARAM_BASE, material_words[record + COATED_BASE_FACETS], it.eta);
        // Tint 0 makes metal black.
        it.is_metal = math_max3(it.metal.tint) > 0.0;
        it.color = vec3f(0.0);
    } else {
        it.color = surface_share((*p)[COATED_PARAM_BASE] * (*point).vertex_color.xyz);
    }
    return stack_new(wo, it);
}

// Returns the MIS weight of the strategy with pdf `chosen` against the one with pdf `other`.
fn coated_balance(chosen: f32, other: f32) -> f32 {
    if chosen <= 0.0 {
        return 0.0;
    }
    return 1.0 / (1.0 + other / chosen);
}

// Returns the Henyey-Greenstein phase function for the cosine between the directions before and after.
fn coated_henyey_greenstein(g: f32, cosine: f32) -> f32 {
    let t = max(1.0 + g * g - 2.0 * g * cosine, 1e-6);
    return (1.0 - g * g) / (2.0 * TAU * t * sqrt(t));
}

fn coated_sample_henyey_greenstein(g: f32, w: vec3f, u: vec2f) -> vec3f {
    var cosine = 1.0 - 2.0 * u.x;
    if abs(g) >= 1e-3 {
        let t = (1.0 - g * g) / (1.0 + g - 2.0 * g * u.x);
        cosine = clamp((1.0 + g * g - t * t) / (2.0 * g), -1.0, 1.0);
    }
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let turn = math_sin_cos_of_turns(u.y);
    return normalize(frame_from_normal(w) * vec3f(sine * turn.y, sine * turn.x, cosine));
}

// Seeds a walk's random numbers.
fn walk_random_new(wo: vec3f, wi: vec3f) -> vec2u {
    var state = vec2u(0x7f4a7c15u, 0x9e3779b9u);
    state = coated_mixed(state ^ vec2u(bitcast<u32>(wo.x), 0u));
    state = coated_mixed(state ^ vec2u(bitcast<u32>(wo.y), 0u));
    state = coated_mixed(state ^ vec2u(bitcast<u32>(wo.z), 0u));
    state = coated_mixed(state ^ vec2u(bitcast<u32>(wi.x), 0u));
    state = coated_mixed(state ^ vec2u(bitcast<u32>(wi.y), 0u));
    return coated_mixed(state ^ vec2u(bitcast<u32>(wi.z), 0u));
}

fn walk_random_next(state: ptr<function, vec2u>) -> f32 {
    let low = (*state).x + 0x7f4a7c15u;
    *state = vec2u(low, (*state).y + 0x9e3779b9u + select(0u, 1u, low < 0x7f4a7c15u));
    return f32(coated_mixed(*state).y >> 8u) / f32(1u << 24u);
}

fn walk_random_pair(state: ptr<function, vec2u>) -> vec2f {
    let first = walk_random_next(state);
    return vec2f(first, walk_random_next(state));
}

// Steele, Lea and Flood 2014 (`sampler_mix`, Stafford's variant 13).
fn coated_mixed(x: vec2u) -> vec2u {
    let a = coated_product(x ^ vec2u((x.x >> 30u) | (x.y << 2u), x.y >> 30u), vec2u(0x1ce4e5b9u, 0xbf58476du));
    let b = coated_product(a ^ vec2u((a.x >> 27u) | (a.y << 5u), a.y >> 27u), vec2u(0x133111ebu, 0x94d049bbu));
    return b ^ vec2u((b.x >> 31u) | (b.y << 1u), b.y >> 31u);
}
