// Twin: `bottega-render/src/bsdf/scattering.rs`.
//
// The scattering at one point seen from one direction: one of a closed set of kinds, in a block of numbers that each kind
// reads in its own way. Directions are in the frame whose +z is the shading normal on the side of wo.

struct Bsdf {
    kind: u32,
    lobes: u32,
    // Above the surface.
    wo: vec3f,
    // By which ratios the path carries the channels.
    carried: vec3f,
    // See `lifted_factor`; w below 0: no relief.
    lifted: vec4f,
    albedo: vec3f,
    // Perceptual, of the sharpest lobe.
    roughness: f32,
    // What is no number.
    words: vec3u,
    // Always indexed by constants, so that it lies in registers.
    d: array<vec4f, 15>,
}

struct BsdfValue {
    // f in sr⁻¹, without the cosine.
    value: vec3f,
    // In sr⁻¹.
    pdf: f32,
}

struct BsdfSample {
    wi: vec3f,
    // f |cos θi| / pdf.
    weight: vec3f,
    // Of a Dirac lobe: the probability that it was chosen.
    pdf: f32,
    // Of the lobe; 0: nothing is scattered, and the path ends.
    flags: u32,
    // Index of refraction on the side of wi over that on the side of wo.
    eta: f32,
}

// A direction that was drawn, and for a Dirac lobe (or where `chance` is not 0) all there is to say.
struct BsdfDrawn {
    wi: vec3f,
    // 0: none.
    flags: u32,
    eta: f32,
    // f |cos θi|, and the probability or density.
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

// f and the density with which `bsdf_sample` draws `wi`, Dirac lobes left out.
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

// Draws a direction, from three numbers in [0, 1): the lobe, and the place in it.
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

// Share of the light arriving along wo that is scattered anywhere: an estimate.
fn bsdf_albedo(b: ptr<function, Bsdf>) -> vec3f {
    return (*b).albedo;
}

// Whether nothing is scattered at all.
fn bsdf_is_black(b: ptr<function, Bsdf>) -> bool {
    return (*b).kind == BSDF_KIND_BLACK;
}

// Whether light can go to the other side.
fn bsdf_is_transmissive(b: ptr<function, Bsdf>) -> bool {
    return ((*b).lobes & BSDF_IS_TRANSMISSIVE) != 0u;
}

// Whether all light goes into single directions.
fn bsdf_is_delta_only(b: ptr<function, Bsdf>) -> bool {
    return (*b).kind != BSDF_KIND_BLACK && ((*b).lobes & BSDF_HAS_NON_DELTA) == 0u;
}

fn bsdf_roughness(b: ptr<function, Bsdf>) -> f32 {
    return (*b).roughness;
}

// Of the kind alone, without relief. wi is not in the surface.
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

// Of the kind alone: a direction, and the whole of a Dirac lobe.
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
