// Twin: `bottega-render/src/bsdf/scattering.rs`.
//
// The BSDF at one point seen from one direction: one of a closed set of kinds, with a block of numbers that each kind reads in
// its own way. Directions are in the frame whose +z is the shading normal on the side of wo.

struct Bsdf {
    kind: u32,
    lobes: u32,
    // Direction to the viewer, above the surface.
    wo: vec3f,
    // Ratios of the path's throughput in the channels.
    carried: vec3f,
    // The relief's normal, see `lifted_factor`; w below 0: no relief.
    lifted: vec4f,
    albedo: vec3f,
    // Perceptual roughness of the sharpest lobe.
    roughness: f32,
    // Integers of the kind.
    words: vec3u,
    // Always indexed by constants, so that it stays in registers.
    d: array<vec4f, 15>,
}

struct BsdfValue {
    // f in sr⁻¹, without the cosine.
    value: vec3f,
    // Density in sr⁻¹.
    pdf: f32,
}

struct BsdfSample {
    wi: vec3f,
    // f |cos θi| / pdf.
    weight: vec3f,
    // Density in sr⁻¹; of a Dirac lobe its probability.
    pdf: f32,
    // Flags of the lobe; 0: nothing is scattered, and the path ends.
    flags: u32,
    // Index of refraction on the side of wi, relative to the side of wo.
    eta: f32,
}

// A sampled direction; for a Dirac lobe (or if `chance` is not 0) also its energy and probability.
struct BsdfDrawn {
    wi: vec3f,
    // Flags of the lobe; 0: no direction.
    flags: u32,
    eta: f32,
    // f |cos θi|, and the probability or pdf.
    energy: vec3f,
    chance: f32,
}

const BSDF_NONE: BsdfDrawn = BsdfDrawn(vec3f(0.0), 0u, 1.0, vec3f(0.0), 0.0);

fn bsdf_black(wo: vec3f) -> Bsdf {
    var b: Bsdf;
    b.kind = BSDF_KIND_BLACK;
    b.wo = wo;
    b.carried = vec3f(1.0);
    b.lifted = vec4f(0.0, 0.0, 1.0, -1.0);
    b.roughness = 1.0;
    return b;
}

fn bsdf_spread(wi: vec3f, flags: u32, eta: f32) -> BsdfDrawn {
    return BsdfDrawn(wi, flags, eta, vec3f(0.0), 0.0);
}

fn bsdf_delta(wi: vec3f, energy: vec3f, chance: f32, side: u32, eta: f32) -> BsdfDrawn {
    return BsdfDrawn(wi, side | BSDF_DELTA, eta, energy, chance);
}

// Returns f and the pdf with which `bsdf_sample` samples `wi`, without Dirac lobes.
fn bsdf_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    if (*b).kind == BSDF_KIND_BLACK || wi.z == 0.0 {
        return BsdfValue(vec3f(0.0), 0.0);
    }
    var factor = 1.0;
    if (*b).lifted.w >= 0.0 {
        factor = lifted_factor((*b).lifted, wi);
        if factor == 0.0 {
            return BsdfValue(vec3f(0.0), 0.0);
        }
    }
    let all = bsdf_eval_pdf_of_kind(b, wi);
    return BsdfValue(all.value * factor, all.pdf);
}

// Samples a direction. `u`: the lobe, and the position in it, each in [0, 1).
fn bsdf_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfSample {
    let drawn = bsdf_sample_kind(b, u);
    var value = BsdfValue(drawn.energy, drawn.chance);
    let cosine = abs(drawn.wi.z);
    if drawn.flags == 0u || cosine == 0.0 {
        return BsdfSample(drawn.wi, vec3f(0.0), 0.0, 0u, 1.0);
    }
    if (drawn.flags & BSDF_DELTA) == 0u && drawn.chance == 0.0 {
        value = bsdf_eval_pdf_of_kind(b, drawn.wi);
        value.value *= cosine;
    }
    if (*b).lifted.w >= 0.0 {
        value.value *= lifted_factor((*b).lifted, drawn.wi);
    }
    if value.pdf <= 0.0 || math_max3(value.value) <= 0.0 {
        return BsdfSample(drawn.wi, vec3f(0.0), 0.0, 0u, 1.0);
    }
    return BsdfSample(drawn.wi, value.value / value.pdf, value.pdf, drawn.flags, drawn.eta);
}

// Estimates the albedo for wo.
fn bsdf_albedo(b: ptr<function, Bsdf>) -> vec3f {
    return (*b).albedo;
}

// Checks for a BSDF that scatters nothing.
fn bsdf_is_black(b: ptr<function, Bsdf>) -> bool {
    return (*b).kind == BSDF_KIND_BLACK;
}

// Checks for transmission to the other side.
fn bsdf_is_transmissive(b: ptr<function, Bsdf>) -> bool {
    return ((*b).lobes & BSDF_IS_TRANSMISSIVE) != 0u;
}

// Checks for a BSDF with Dirac lobes only.
fn bsdf_is_delta_only(b: ptr<function, Bsdf>) -> bool {
    return (*b).kind != BSDF_KIND_BLACK && ((*b).lobes & BSDF_HAS_NON_DELTA) == 0u;
}

fn bsdf_roughness(b: ptr<function, Bsdf>) -> f32 {
    return (*b).roughness;
}

// Evaluates the kind alone, without relief. wi is not in the plane of the surface.
fn bsdf_eval_pdf_of_kind(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    switch (*b).kind {
        case BSDF_KIND_LAMBERT: { return lambert_eval_pdf(b, wi); }
        case BSDF_KIND_ROUGH_MATTE: { return rough_matte_eval_pdf(b, wi); }
        case BSDF_KIND_TRANSLUCENT: { return translucent_eval_pdf(b, wi); }
        case BSDF_KIND_CONDUCTOR: { if HAS_CONDUCTOR { return conductor_eval_pdf(b, wi); } }
        case BSDF_KIND_DIELECTRIC: { if HAS_DIELECTRIC { return dielectric_eval_pdf(b, wi); } }
        case BSDF_KIND_PLASTIC: { if HAS_PLASTIC { return plastic_eval_pdf(b, wi); } }
        case BSDF_KIND_STACK: { if HAS_STACK { return stack_eval_pdf(b, wi); } }
        case BSDF_KIND_PRINCIPLED: { if HAS_PRINCIPLED { return principled_eval_pdf(b, wi); } }
        case BSDF_KIND_SHEET: { if HAS_PRINCIPLED { return principled_sheet_eval_pdf(b, wi); } }
        case BSDF_KIND_LAYERED: { if HAS_LAYERED { return layered_eval_pdf(b, wi); } }
        default: {}
    }
    return BsdfValue(vec3f(0.0), 0.0);
}

// Samples the kind alone: a direction, and for a Dirac lobe its energy.
fn bsdf_sample_kind(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    switch (*b).kind {
        case BSDF_KIND_LAMBERT, BSDF_KIND_ROUGH_MATTE: {
            return bsdf_spread(warp_cosine_hemisphere(u.yz), BSDF_REFLECTION | BSDF_DIFFUSE, 1.0);
        }
        case BSDF_KIND_TRANSLUCENT: { return translucent_sample(b, u); }
        case BSDF_KIND_CONDUCTOR: { if HAS_CONDUCTOR { return conductor_sample(b, u); } }
        case BSDF_KIND_DIELECTRIC: { if HAS_DIELECTRIC { return dielectric_sample(b, u); } }
        case BSDF_KIND_PLASTIC: { if HAS_PLASTIC { return plastic_sample(b, u); } }
        case BSDF_KIND_STACK: { if HAS_STACK { return stack_sample(b, u); } }
        case BSDF_KIND_PRINCIPLED: { if HAS_PRINCIPLED { return principled_sample(b, u); } }
        case BSDF_KIND_SHEET: { if HAS_PRINCIPLED { return principled_sheet_sample(b, u); } }
        case BSDF_KIND_LAYERED: { if HAS_LAYERED { return layered_sample(b, u); } }
        default: {}
    }
    return BSDF_NONE;
}
