// Twin: `bottega-render/src/bsdf/interface.rs`.
//
// The layered material's GGX facets: metal and dielectric, mirrored light and light that goes through.

struct Interface {
    alpha: vec2f,
    // Share of the surface that is metal, and its reflectance at normal incidence.
    metal: f32,
    metal_f0: vec3f,
    // Share of the surface that reflects as a dielectric.
    dielectric: f32,
    // Index beyond the boundary over that on the side of wo.
    eta: f32,
    // Tinted reflectance at normal incidence, strength, and the untinted reflectance; 1 stands for total reflection.
    f0: vec3f,
    specular: f32,
    f0_exact: f32,
    through: u32,
    // Share of the surface that lets light through, times its colour.
    tint: vec3f,
    film: Film,
    // Half of how much the index of a solid differs between red and blue.
    spread: f32,
}

// What one facet does with the light, and with which probability a sample is reflected.
struct InterfaceSplit {
    reflected: vec3f,
    transmitted: vec3f,
    reflection: f32,
}

fn interface_is_smooth(it: Interface) -> bool {
    return max(it.alpha.x, it.alpha.y) < GGX_SMOOTH_ALPHA;
}

// For the directions.
fn interface_eta(it: Interface) -> f32 {
    return select(1.0, it.eta, it.through == THROUGH_SOLID);
}

// Of each channel.
fn interface_etas(it: Interface) -> vec3f {
    let inside = it.eta < 1.0;
    let ior = max(select(it.eta, 1.0 / it.eta, inside) + vec3f(-1.0, 0.0, 1.0) * it.spread, vec3f(1.0));
    return select(ior, 1.0 / ior, inside);
}

// F for a share s of the rise from normal incidence to the horizon.
fn interface_of_rise(f0: vec3f, specular: f32, rise: f32) -> vec3f {
    return specular * max(f0 + (1.0 - f0) * rise, vec3f(0.0));
}

// The dielectric's reflectance, with one index for all colours.
fn interface_fresnel(specular: f32, eta: f32, f0: vec3f, f0_exact: f32, cosine: f32) -> vec3f {
    if f0_exact >= 1.0 {
        return interface_of_rise(f0, specular, fresnel_schlick_weight(cosine));
    }
    let exact = fresnel_dielectric(cosine, eta);
    if exact >= 1.0 && eta < 1.0 {
        // There is nowhere else for the light to go, however weak `specular` is.
        return vec3f(1.0);
    }
    return interface_of_rise(f0, specular, (exact - f0_exact) / (1.0 - f0_exact));
}

// How far the exact reflectance has risen, seen from outside.
fn interface_rise(it: Interface, cosine: f32) -> f32 {
    if it.f0_exact >= 1.0 {
        return fresnel_schlick_weight(cosine);
    }
    return (fresnel_dielectric(cosine, max(it.eta, 1.0 / it.eta)) - it.f0_exact) / (1.0 - it.f0_exact);
}

// Of one channel with an index of its own.
fn interface_dispersed(it: Interface, eta: f32, f0: f32, cosine: f32) -> f32 {
    let f0_exact = fresnel_at_normal_incidence(eta);
    let own = min(f0 * (f0_exact / max(it.f0_exact, 1e-9)), 1.0);
    return interface_fresnel(it.specular, eta, vec3f(own), f0_exact, cosine).x;
}

fn interface_split(it: Interface, cosine: f32, carried: vec3f) -> InterfaceSplit {
    let disperses = it.spread > 0.0;
    var dielectric = vec3f(0.0);
    if disperses {
        let etas = interface_etas(it);
        dielectric = vec3f(interface_dispersed(it, etas.x, it.f0.x, cosine), interface_dispersed(it, etas.y, it.f0.y, cosine),
            interface_dispersed(it, etas.z, it.f0.z, cosine));
    } else {
        dielectric = interface_fresnel(it.specular, it.eta, it.f0, it.f0_exact, cosine);
    }
    var metal = it.metal_f0 + (1.0 - it.metal_f0) * fresnel_schlick_weight(cosine);
    if HAS_FILM && it.film.factor > 0.0 {
        // The film is outside, and light from within that does not get there does not see it.
        let eta = select(1.0, it.eta, it.through == THROUGH_SOLID && it.eta < 1.0);
        let cos2 = 1.0 - max(1.0 - cosine * cosine, 0.0) / (eta * eta);
        if cos2 > 0.0 {
            dielectric = film_mix(it.film, dielectric, film_reflectance(it.film, sqrt(cos2), it.f0) * it.specular);
            if it.metal > 0.0 {
                metal = film_mix(it.film, metal, film_reflectance(it.film, sqrt(cos2), it.metal_f0));
            }
        }
    }
    let reflected = it.metal * metal + it.dielectric * dielectric;
    if it.through == THROUGH_NOTHING {
        return InterfaceSplit(reflected, vec3f(0.0), 1.0);
    }
    let passed = select(vec3f(1.0 - math_max3(dielectric)), 1.0 - dielectric, disperses);
    let transmitted = it.tint * passed;
    // Where colours go apart, what the path carries decides which way it goes.
    let r = select(math_mean(reflected), dot(carried, reflected), disperses);
    let t = select(math_mean(transmitted), dot(carried, transmitted), disperses);
    var reflection = 1.0;
    if r + t > 0.0 {
        reflection = r / (r + t);
    }
    return InterfaceSplit(reflected, transmitted, reflection);
}

// Probabilities of the channels among the light that goes through.
fn interface_channels(split: InterfaceSplit, carried: vec3f) -> vec3f {
    let weights = split.transmitted * carried;
    let sum = weights.x + weights.y + weights.z;
    if sum <= 0.0 {
        return vec3f(0.0);
    }
    return weights / sum;
}

fn interface_is_black(it: Interface) -> bool {
    return it.metal <= 0.0 && it.dielectric * it.specular <= 0.0 && math_max3(it.tint) <= 0.0;
}

// f and density of a rough boundary; nothing of a smooth one.
fn interface_eval_pdf(it: Interface, wo: vec3f, wi: vec3f, carried: vec3f) -> BsdfValue {
    var all = BsdfValue(vec3f(0.0), 0.0);
    let crosses = wi.z < 0.0;
    if interface_is_smooth(it) || interface_is_black(it) || (crosses && it.through == THROUGH_NOTHING) {
        return all;
    }
    let refracts = crosses && it.through == THROUGH_SOLID;
    // Each channel by its own index, and with its own facet.
    let goes_apart = refracts && it.spread > 0.0;
    let etas = interface_etas(it);
    for (var channel = 0u; channel < 3u; channel++) {
        var only = vec3f(1.0);
        var eta = it.eta;
        if goes_apart {
            only = vec3f(vec3u(0u, 1u, 2u) == vec3u(channel));
            eta = dot(etas, only);
        }
        // A sheet mirrors downwards.
        let sum = wo + select(vec3f(wi.xy, abs(wi.z)), eta * wi, refracts);
        let length2 = dot(sum, sum);
        if length2 > 1e-30 {
            let h = sum / sqrt(length2) * select(1.0, math_sign(sum.z), refracts);
            let cos_o = dot(wo, h);
            let cos_i = dot(wi, h);
            if !refracts || (cos_o > 0.0 && cos_i < 0.0) {
                let split = interface_split(it, cos_o, carried);
                let density = ggx_density(it.alpha, h);
                let area = ggx_visible_area(it.alpha, wo);
                var color = select(split.reflected, split.transmitted, crosses);
                var chance = select(split.reflection, 1.0 - split.reflection, crosses);
                if goes_apart {
                    color *= only;
                    chance *= dot(interface_channels(split, carried), only);
                }
                if refracts {
                    // Walter et al. 2007, eq. 16 to 21, with separable shadowing; radiance gets less by η².
                    let jacobian = eta * eta * -cos_i / length2;
                    let facets = density * ggx_masking(it.alpha, wo) * ggx_masking(it.alpha, wi);
                    all.value += color * (facets * cos_o * jacobian / (wo.z * -wi.z) / (eta * eta));
                    all.pdf += chance * cos_o * density / area * jacobian;
                } else {
                    let above = vec3f(wi.xy, abs(wi.z));
                    all.value += color * (density * ggx_visibility(it.alpha, wo, above));
                    all.pdf += chance * 0.25 * density / area;
                }
            }
        }
        if !goes_apart {
            break;
        }
    }
    return all;
}

// Draws a facet, then one of its two ways.
fn interface_sample(it: Interface, wo: vec3f, u_way: f32, u: vec2f, carried: vec3f) -> BsdfDrawn {
    let is_smooth = interface_is_smooth(it);
    var h = vec3f(0.0, 0.0, 1.0);
    if !is_smooth {
        h = ggx_sample_visible_normal(it.alpha, wo, u);
    }
    let split = interface_split(it, dot(wo, h), carried);
    let sharp = select(BSDF_GLOSSY, BSDF_DELTA, is_smooth);
    let mirrored = fresnel_reflect(wo, h);
    if u_way < split.reflection {
        if mirrored.z <= 0.0 {
            return BSDF_NONE;
        }
        return BsdfDrawn(mirrored, BSDF_REFLECTION | sharp, 1.0, split.reflected, select(0.0, split.reflection, is_smooth));
    }
    if it.through == THROUGH_NOTHING {
        return BSDF_NONE;
    }
    var eta = interface_eta(it);
    var color = split.transmitted;
    var chance = 1.0;
    if it.spread > 0.0 {
        let at = (u_way - split.reflection) / (1.0 - split.reflection);
        let chances = interface_channels(split, carried);
        var only = vec3f(0.0, 0.0, 1.0);
        if at < chances.x {
            only = vec3f(1.0, 0.0, 0.0);
        } else if at < chances.x + chances.y {
            only = vec3f(0.0, 1.0, 0.0);
        }
        eta = dot(interface_etas(it), only);
        color *= only;
        chance = dot(chances, only);
    }
    var wi = mirrored * vec3f(1.0, 1.0, -1.0);
    if it.through == THROUGH_SOLID {
        wi = fresnel_refract(wo, h, eta).xyz;
    }
    if wi.z >= 0.0 {
        return BSDF_NONE;
    }
    chance = select(0.0, (1.0 - split.reflection) * chance, is_smooth);
    return BsdfDrawn(wi, BSDF_TRANSMISSION | sharp, eta, color / (eta * eta), chance);
}
