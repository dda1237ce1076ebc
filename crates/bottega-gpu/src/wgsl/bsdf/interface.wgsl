// Twin: `bottega-render/src/bsdf/interface.rs`.
//
// GGX facets of the layered material: metal and dielectric, reflection and transmission.

struct Interface {
    alpha: vec2f,
    // Fraction of metal, and its reflectance at normal incidence.
    metal: f32,
    metal_f0: vec3f,
    // Fraction that reflects as a dielectric.
    dielectric: f32,
    // Index of refraction beyond the boundary, relative to the side of wo.
    eta: f32,
    // Tinted reflectance at normal incidence, strength, and untinted reflectance (1: total reflection).
    f0: vec3f,
    specular: f32,
    f0_exact: f32,
    through: u32,
    // Fraction that transmits, times its colour.
    tint: vec3f,
    film: Film,
    // Half of the difference in a solid's index of refraction between red and blue.
    spread: f32,
}

// Reflectance and transmittance of a facet, and the probability of sampling reflection.
struct InterfaceSplit {
    reflected: vec3f,
    transmitted: vec3f,
    reflection: f32,
}

fn interface_is_smooth(it: Interface) -> bool {
    return max(it.alpha.x, it.alpha.y) < GGX_SMOOTH_ALPHA;
}

// Returns the index of refraction for the directions.
fn interface_eta(it: Interface) -> f32 {
    return select(1.0, it.eta, it.through == THROUGH_SOLID);
}

// Returns the index of refraction of each channel.
fn interface_etas(it: Interface) -> vec3f {
    let inside = it.eta < 1.0;
    let ior = max(select(it.eta, 1.0 / it.eta, inside) + vec3f(-1.0, 0.0, 1.0) * it.spread, vec3f(1.0));
    return select(ior, 1.0 / ior, inside);
}

// Returns F for a fraction `rise` of the rise from normal incidence to the horizon.
fn interface_of_rise(f0: vec3f, specular: f32, rise: f32) -> vec3f {
    return specular * max(f0 + (1.0 - f0) * rise, vec3f(0.0));
}

// Returns the dielectric's reflectance, with one index for all channels.
fn interface_fresnel(specular: f32, eta: f32, f0: vec3f, f0_exact: f32, cosine: f32) -> vec3f {
    if f0_exact >= 1.0 {
        return interface_of_rise(f0, specular, fresnel_schlick_weight(cosine));
    }
    let exact = fresnel_dielectric(cosine, eta);
    if exact >= 1.0 && eta < 1.0 {
        // Total reflection: all light is reflected, however small `specular` is.
        return vec3f(1.0);
    }
    return interface_of_rise(f0, specular, (exact - f0_exact) / (1.0 - f0_exact));
}

// Returns the fraction by which the exact reflectance has risen, seen from outside.
fn interface_rise(it: Interface, cosine: f32) -> f32 {
    if it.f0_exact >= 1.0 {
        return fresnel_schlick_weight(cosine);
    }
    return (fresnel_dielectric(cosine, max(it.eta, 1.0 / it.eta)) - it.f0_exact) / (1.0 - it.f0_exact);
}

// Returns the reflectance of one channel with its own index.
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
        // The film is outside, so light from inside sees it only where it gets out.
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
    // With dispersion, the path's throughput decides between reflection and transmission.
    let r = select(math_mean(reflected), dot(carried, reflected), disperses);
    let t = select(math_mean(transmitted), dot(carried, transmitted), disperses);
    var reflection = 1.0;
    if r + t > 0.0 {
        reflection = r / (r + t);
    }
    return InterfaceSplit(reflected, transmitted, reflection);
}

// Returns the probabilities of the channels among transmitted light.
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

// Returns f and pdf of a rough boundary; 0 of a smooth one.
fn interface_eval_pdf(it: Interface, wo: vec3f, wi: vec3f, carried: vec3f) -> BsdfValue {
    var all = BsdfValue(vec3f(0.0), 0.0);
    let crosses = wi.z < 0.0;
    if interface_is_smooth(it) || interface_is_black(it) || (crosses && it.through == THROUGH_NOTHING) {
        return all;
    }
    let refracts = crosses && it.through == THROUGH_SOLID;
    // With dispersion each channel has its own index and its own facet.
    let goes_apart = refracts && it.spread > 0.0;
    let etas = interface_etas(it);
    for (var channel = 0u; channel < 3u; channel++) {
        var only = vec3f(1.0);
        var eta = it.eta;
        if goes_apart {
            only = vec3f(vec3u(0u, 1u, 2u) == vec3u(channel));
            eta = dot(etas, only);
        }
        // A sheet mirrors transmitted light downwards.
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
                    // Walter et al. 2007, eq. 16 to 21, with separable shadowing; radiance scales with η².
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

// Samples a facet, then reflection or transmission.
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
