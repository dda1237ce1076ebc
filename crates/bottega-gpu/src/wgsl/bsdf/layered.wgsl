// Twin: `bottega-render/src/bsdf/layered.rs`.
//
// The layered material seen from one direction: base, coat and sheen combined.

// The energy left over along one direction, and the transmittance of coat and sheen.
struct LayeredProfile {
    multiple: f32,
    diffuse: f32,
    boundary: f32,
    coat: f32,
    sheen: f32,
}

// The energy left over by the lobes.
struct LayeredCover {
    single: f32,
    rise: f32,
    constant: f32,
}

// The lobe that `u` selects (LAYERED_LOBES: none), its probability, and `u` rescaled to [0, 1).
struct LayeredChoice {
    lobe: u32,
    chance: f32,
    rest: f32,
}

// d[0]: α, fractions of metal and dielectric; d[1]: metal's f₀, η; d[2]: f₀, specular; d[3]: tint, exact F₀; d[4]: film, spread;
// d[5]: √roughness and index for the tables, transmittance of coat and sheen for wo; d[6]: cover, probability of the uniform
// lobe; d[7..10]: colours of the cosine lobes times their weights for wo (diffuse, multiple, boundary on the side of wo), with
// strength of the coat, roughness of the coat, and α of the sheen in w; d[10]: the diffuse lobe on the far side, position of the
// sheen; d[11]: the other lobes there; d[12]: probabilities of the other lobes; d[13]: normal of the coat; d[14]: colour of the
// sheen; words.x: LAYERED_USES_….
fn layered_interface(b: ptr<function, Bsdf>) -> Interface {
    let d0 = (*b).d[0];
    let d1 = (*b).d[1];
    let d2 = (*b).d[2];
    let d3 = (*b).d[3];
    let d4 = (*b).d[4];
    let film = Film(d4.x, d4.y, d4.z);
    let through = (*b).words.x >> LAYERED_THROUGH_SHIFT;
    return Interface(d0.xy, d0.z, d1.xyz, d0.w, d1.w, d2.xyz, d2.w, d3.w, through, d3.xyz, film, d4.w);
}

fn layered_coat(b: ptr<function, Bsdf>) -> Coat {
    return Coat((*b).d[7].w, (*b).d[8].w, (*b).d[13].xyz);
}

fn layered_sheen(b: ptr<function, Bsdf>) -> Sheen {
    return Sheen((*b).d[14].xyz, (*b).d[9].w, (*b).d[10].w);
}

fn layered_cover_at(cover: LayeredCover, single: f32, rise: f32) -> f32 {
    return clamp(cover.single * single + cover.rise * rise + cover.constant, 0.0, 1.0);
}

// Looks up the rise of the reflectance, for an index or for total reflection.
fn layered_rise(is_total: bool, index: TablePlace, rough: TablePlace, mu: TablePlace) -> f32 {
    if is_total {
        return tables_by_rough(TABLE_SCHLICK, rough, mu);
    }
    return tables_by_index(TABLE_RISE, index, rough, mu);
}

// Returns the profile of wi, on either side.
fn layered_profile(b: ptr<function, Bsdf>, wi: vec3f) -> LayeredProfile {
    let bits = (*b).words.x;
    let crosses = wi.z < 0.0 && (bits >> LAYERED_THROUGH_SHIFT) == THROUGH_SOLID;
    let inside = ((bits & LAYERED_INSIDE) != 0u) != crosses;
    let mu = tables_mu_new(abs(wi.z));
    let rough = tables_rough_at((*b).d[5].x);
    let index = tables_index_new((*b).d[5].y);
    let d6 = (*b).d[6];
    var single = 1.0;
    var rise = 0.0;
    var boundary = 1.0;
    if (bits & LAYERED_USES_SINGLE) != 0u {
        single = tables_by_rough(TABLE_SINGLE, rough, mu);
    }
    if (bits & LAYERED_USES_RISE) != 0u {
        rise = layered_rise((*b).d[3].w >= 1.0, index, rough, mu);
    }
    if (bits & LAYERED_USES_BOUNDARY) != 0u {
        boundary = tables_by_index(select(TABLE_OUTSIDE, TABLE_INSIDE, inside), index, rough, mu);
    }
    let cover = layered_cover_at(LayeredCover(d6.x, d6.y, d6.z), single, rise);
    var profile = LayeredProfile(1.0 - single, 1.0 - cover, 1.0 - boundary, 1.0, 1.0);
    if !inside {
        profile.coat = coat_passed(layered_coat(b), wi);
        if HAS_SHEEN && math_max3((*b).d[14].xyz) > 0.0 {
            profile.sheen = sheen_passed(layered_sheen(b), mu);
        }
    }
    return profile;
}

fn layered_sample(b: ptr<function, Bsdf>, u: vec3f) -> BsdfDrawn {
    let wo = (*b).wo;
    let it = layered_interface(b);
    let choice = layered_choose((*b).d[12], (*b).d[6].w, u.x);
    var drawn = BSDF_NONE;
    switch choice.lobe {
        case LAYERED_LOBE_INTERFACE: { drawn = interface_sample(it, wo, choice.rest, u.yz, (*b).carried); }
        case LAYERED_LOBE_COSINE: { drawn = bsdf_spread(warp_cosine_hemisphere(u.yz), BSDF_REFLECTION | BSDF_DIFFUSE, 1.0); }
        case LAYERED_LOBE_COSINE_THROUGH: { drawn = bsdf_spread(-warp_cosine_hemisphere(u.yz), BSDF_TRANSMISSION | BSDF_DIFFUSE, interface_eta(it)); }
        case LAYERED_LOBE_COAT: { if HAS_COAT { drawn = coat_sample(layered_coat(b), wo, u.yz); } }
        case LAYERED_LOBE_UNIFORM: { drawn = bsdf_spread(warp_uniform_hemisphere(u.yz), BSDF_REFLECTION | BSDF_DIFFUSE, 1.0); }
        default: {}
    }
    if (drawn.flags & BSDF_DELTA) != 0u {
        let seen = (*b).d[5].zw;
        let other = layered_profile(b, drawn.wi);
        let below_coat = select(min(seen.x, other.coat), 1.0, choice.lobe == LAYERED_LOBE_COAT);
        drawn.energy *= below_coat * min(seen.y, other.sheen);
        drawn.chance *= choice.chance;
    }
    return drawn;
}

fn layered_eval_pdf(b: ptr<function, Bsdf>, wi: vec3f) -> BsdfValue {
    let wo = (*b).wo;
    let it = layered_interface(b);
    let chances = (*b).d[12];
    let seen = (*b).d[5].zw;
    let other = layered_profile(b, wi);
    let facets = interface_eval_pdf(it, wo, wi, (*b).carried);
    var diffuse = vec3f(0.0);
    var diffuse_chance = chances.y;
    if wi.z > 0.0 {
        diffuse = (*b).d[7].xyz * other.diffuse + (*b).d[8].xyz * other.multiple + (*b).d[9].xyz * other.boundary;
    } else {
        let eta = interface_eta(it);
        let rest = select(other.multiple, other.boundary, it.through == THROUGH_SOLID);
        diffuse = ((*b).d[10].xyz * other.diffuse + (*b).d[11].xyz * rest) / (eta * eta);
        diffuse_chance = chances.z;
    }
    var value = (facets.value + diffuse) * (min(seen.x, other.coat) * min(seen.y, other.sheen));
    var pdf = chances.x * facets.pdf + diffuse_chance * warp_cosine_hemisphere_pdf(abs(wi.z));
    if wi.z < 0.0 {
        return BsdfValue(value, pdf);
    }
    pdf += (*b).d[6].w * WARP_UNIFORM_PDF;
    if ((*b).words.x & LAYERED_INSIDE) != 0u {
        return BsdfValue(value, pdf);
    }
    let coat = layered_coat(b);
    if HAS_COAT && coat.weight > 0.0 {
        let varnish = coat_eval_pdf(coat, wo, wi);
        value += min(seen.y, other.sheen) * varnish.x;
        pdf += chances.w * varnish.y;
    }
    let sheen = layered_sheen(b);
    if HAS_SHEEN && math_max3(sheen.color) > 0.0 {
        value += sheen_eval(sheen, wo, wi);
    }
    return BsdfValue(value, pdf);
}

fn layered_choose(chances: vec4f, last: f32, u: f32) -> LayeredChoice {
    var choice = LayeredChoice(LAYERED_LOBES, 0.0, 0.0);
    var below = 0.0;
    for (var lobe = 0u; lobe < LAYERED_LOBES; lobe++) {
        var chance = last;
        switch lobe {
            case LAYERED_LOBE_INTERFACE: { chance = chances.x; }
            case LAYERED_LOBE_COSINE: { chance = chances.y; }
            case LAYERED_LOBE_COSINE_THROUGH: { chance = chances.z; }
            case LAYERED_LOBE_COAT: { chance = chances.w; }
            default: {}
        }
        if chance > 0.0 {
            choice = LayeredChoice(lobe, chance, clamp((u - below) / chance, 0.0, ONE_MINUS_EPSILON));
            below += chance;
            if u < below {
                break;
            }
        }
    }
    return choice;
}
