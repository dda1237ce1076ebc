// Twin: `bottega-render/src/bsdf/base.rs`.
//
// The energy balance of the layered material: lobe weights that reflect what single scattering loses.

// A lobe colour · g(μo) g(μi) / (π (1 − E̅)).
struct LayeredLobe {
    color: vec3f,
    // 1 / (π (1 − E̅)).
    scale: f32,
    // `true`: the missing energy 1 − E is mostly near the horizon.
    is_grazing: bool,
}

fn base_coupled(color: vec3f, mean: f32) -> LayeredLobe {
    let rest = 1.0 - mean;
    // Almost no energy is lost, so the lobe is empty.
    if rest <= 1e-4 {
        return LayeredLobe(vec3f(0.0), 0.0, false);
    }
    return LayeredLobe(color, 1.0 / (PI * rest), rest < 0.1);
}

// Returns the colour of multiply scattered light, relative to the energy that single scattering loses.
fn base_multiply_scattered(fresnel: vec3f, single: f32) -> vec3f {
    return fresnel * fresnel * single / (1.0 - fresnel * (1.0 - single));
}

fn base_is_some(color: vec3f) -> bool {
    return math_max3(color) > 0.0;
}

fn layered_of(wo: vec3f, carried: vec3f, p: LayeredParams) -> Bsdf {
    let is_bare = p.coat.weight == 0.0 && !base_is_some(p.sheen_color) && p.diffuse_transmission == 0.0;
    if is_bare && p.specular == 0.0 && p.metallic == 0.0 && p.transmission == 0.0 && base_is_some(p.base_color) {
        return lambert_new(wo, p.base_color);
    }
    var b = bsdf_black(wo);
    b.carried = carried;

    // The base: a mix of metal, opaque dielectric and transmitting dielectric that share their facets.
    let refracting = p.ior != 0.0 && (1.0 - p.metallic) * p.transmission > 0.0;
    let through = select(THROUGH_NOTHING, select(THROUGH_SOLID, THROUGH_SHEET, p.thin), refracting);
    let is_solid = through == THROUGH_SOLID;
    let inside = is_solid && !p.front;
    let narrow_alpha = p.roughness * p.roughness;
    var alpha = vec2f(narrow_alpha);
    var position = sqrt(p.roughness);
    if p.anisotropy > 0.0 {
        let along = narrow_alpha + (1.0 - narrow_alpha) * p.anisotropy * p.anisotropy;
        alpha = vec2f(along, select(narrow_alpha, max(narrow_alpha, GGX_SMOOTH_ALPHA), along >= GGX_SMOOTH_ALPHA));
        // The tables are isotropic: use the α whose slopes are as large on average.
        position = sqrt(sqrt(sqrt(0.5 * dot(alpha, alpha))));
    }
    let is_smooth = max(alpha.x, alpha.y) < GGX_SMOOTH_ALPHA;
    let ior = select(p.ior, max(p.ior, 1.0 + FRESNEL_IOR_STEP_MIN), is_solid && !is_smooth);
    let transmitting = select(0.0, (1.0 - p.metallic) * p.transmission, refracting);
    let opaque = max(1.0 - p.metallic - transmitting, 0.0);
    let is_total = ior == 0.0;
    let f0_exact = select(fresnel_at_normal_incidence(ior), 1.0, is_total);
    let inner_eta = select(ior, 1.0, is_total);
    let f0 = min(p.specular_color * f0_exact, vec3f(1.0));
    var dielectric = 1.0 - p.metallic;
    if inside {
        // From inside, the opaque part has no dielectric: that is on the other side.
        dielectric = transmitting;
    } else if through == THROUGH_NOTHING && p.specular == 0.0 {
        dielectric = 0.0;
    }
    let spread = select(0.0, (ior - 1.0) * DISPERSION_SCALE * p.dispersion, is_solid);
    let it = Interface(alpha, p.metallic, p.base_color, dielectric, select(inner_eta, 1.0 / inner_eta, inside), f0, p.specular,
        f0_exact, through, p.base_color * transmitting, p.film, spread);

    // Find reflectances at normal incidence with the same means as under the film.
    var mean_metal = p.base_color;
    var mean_f0 = f0;
    if HAS_FILM && p.film.factor > 0.0 {
        for (var i = 0u; i < 2u; i++) {
            let bare = select(f0, p.base_color, i == 0u);
            let mixed = film_mix(p.film, bare, film_mean_f0(p.film, bare));
            mean_metal = select(mean_metal, mixed, i == 0u);
            mean_f0 = select(mean_f0, mixed, i == 1u);
        }
    }

    // Compute the energy lost by the facets, and the diffuse base.
    let rough = tables_rough_at(position);
    let sharp = tables_rough_at(0.0);
    let index_ior = max(ior, 1.0);
    let index = tables_index_new(index_ior);
    let single_mean = tables_by_rough(TABLE_SINGLE, rough, TABLE_MEAN);
    let rise_mean = layered_rise(is_total, index, rough, TABLE_MEAN);
    // At zero roughness the table of s is s itself, and its mean that of the Fresnel term.
    let sharp_rise_mean = layered_rise(is_total, index, sharp, TABLE_MEAN);
    let fresnel_mean = interface_of_rise(mean_f0, p.specular, sharp_rise_mean);
    let lost_metal = base_multiply_scattered(mean_metal * (20.0 / 21.0) + 1.0 / 21.0, single_mean);
    let lost_dielectric = base_multiply_scattered(fresnel_mean, single_mean);
    // The far side of a solid is not matte.
    let beyond_share = select(p.diffuse_transmission, 0.0, is_solid);
    let beyond = opaque * beyond_share;
    var multiple_color = p.metallic * lost_metal;
    var cover = LayeredCover(0.0, 0.0, 0.0);
    if !inside {
        // Both parts of `opaque` lie below the dielectric.
        multiple_color += (opaque * (1.0 - beyond_share) + beyond) * lost_dielectric;
        var cover_f0 = mean_f0;
        if HAS_FILM && p.film.factor > 0.0 {
            // Keep the base from reflecting where the film is brightest.
            var peak = 0.0;
            for (var step = 1u; step <= FILM_PEAK_STEPS; step++) {
                let cosine = f32(step) / f32(FILM_PEAK_STEPS);
                let rise = min(interface_rise(it, cosine), 0.99);
                peak = max(peak, (math_max3(film_reflectance(p.film, cosine, f0)) - rise) / (1.0 - rise));
            }
            cover_f0 = film_mix(p.film, f0, max(f0, vec3f(peak)));
        }
        let multiple = math_max3(lost_dielectric);
        // Use the strongest channel for all, so that the base does not take on the complementary colour.
        let strongest = p.specular * math_max3(cover_f0);
        cover = LayeredCover(strongest - multiple, p.specular - strongest, multiple);
    }
    let cover_mean = layered_cover_at(cover, single_mean, rise_mean);
    let diffuse = base_coupled(p.base_color * (opaque * (1.0 - beyond_share)), cover_mean);
    var diffuse_through = base_coupled(vec3f(0.0), 1.0);
    if beyond_share > 0.0 {
        diffuse_through = base_coupled(p.through_color * beyond, cover_mean);
    }
    var boundary = base_coupled(vec3f(0.0), 1.0);
    // Transmission lobes of a sheet's facets, or of a solid's boundary.
    var other_through = base_coupled(vec3f(0.0), 1.0);
    if through == THROUGH_SHEET {
        multiple_color += transmitting * fresnel_mean;
        other_through = base_coupled(transmitting * (1.0 - math_max3(fresnel_mean)) * p.base_color, single_mean);
    } else if is_solid {
        // These weights make f(wo, wi) / η_i² symmetric.
        let near = tables_by_index(select(TABLE_OUTSIDE, TABLE_INSIDE, inside), index, rough, TABLE_MEAN);
        let far = tables_by_index(select(TABLE_INSIDE, TABLE_OUTSIDE, inside), index, rough, TABLE_MEAN);
        let outside = f0_exact + (1.0 - f0_exact) * sharp_rise_mean;
        // Hemispherical transmittance; from inside it is smaller by n².
        let passed = (1.0 - outside) * select(1.0, it.eta * it.eta, inside);
        let crossed = passed * (1.0 - far) / max(max(1.0 - near, 1.0 - far), 1e-9);
        // The tables hold for full strength and a white tint; otherwise reduce the compensation.
        let tint = min(math_min3(f0 / max(f0_exact, 1e-9)), 1.0);
        let weight = transmitting * p.specular * tint;
        boundary = base_coupled(vec3f(weight * (1.0 - crossed)), near);
        other_through = base_coupled(p.base_color * (weight * crossed), far);
    }
    let multiple = base_coupled(multiple_color, single_mean);

    // Record which tables the cosine lobes use, and which lobes exist.
    let has_diffuse = base_is_some(diffuse.color) || base_is_some(diffuse_through.color);
    let is_covered = has_diffuse && !(cover.single == 0.0 && cover.rise == 0.0);
    let sheet_through = through == THROUGH_SHEET && base_is_some(other_through.color);
    let uses_single = is_covered || base_is_some(multiple.color) || sheet_through;
    let has_cosine = has_diffuse || base_is_some(multiple.color) || base_is_some(boundary.color) || base_is_some(other_through.color);
    let sheen = sheen_new(p.sheen_color, p.sheen_roughness);
    let has_coat = HAS_COAT && p.coat.weight > 0.0;
    let has_sheen = HAS_SHEEN && base_is_some(p.sheen_color);
    let interface_black = interface_is_black(it);
    let is_black = interface_black && !has_cosine && !has_coat && !has_sheen;
    if is_black {
        return b;
    }
    // From inside, coat and sheen only attenuate transmitted light.
    let above = !inside && (has_sheen || (has_coat && !coat_is_smooth(p.coat)));
    let has_non_delta = (!is_smooth && !interface_black) || has_cosine || above;
    let is_boundary_alone = !has_coat && !has_sheen && !has_non_delta;

    // Evaluate the weights for wo.
    let mu = tables_mu_new(wo.z);
    var single = 1.0;
    var all = 1.0;
    var rest = LayeredProfile(0.0, 0.0, 0.0, 1.0, 1.0);
    var facets_albedo = vec3f(0.0);
    if inside || is_boundary_alone {
        if !is_boundary_alone {
            if uses_single {
                single = tables_by_rough(TABLE_SINGLE, rough, mu);
            }
            all = tables_by_index(TABLE_INSIDE, index, rough, mu);
        }
        let seen = interface_split(it, wo.z, vec3f(1.0));
        facets_albedo = (seen.reflected + seen.transmitted) * all;
        rest.diffuse = 1.0 - layered_cover_at(cover, single, 0.0);
    } else {
        single = tables_by_rough(TABLE_SINGLE, rough, mu);
        var rise = 0.0;
        var schlick = 0.0;
        all = single;
        if dielectric > 0.0 {
            rise = layered_rise(is_total, index, rough, mu);
        }
        if p.metallic > 0.0 {
            schlick = tables_by_rough(TABLE_SCHLICK, rough, mu);
        }
        if is_solid {
            all = tables_by_index(TABLE_OUTSIDE, index, rough, mu);
        }
        rest.diffuse = 1.0 - layered_cover_at(cover, single, rise);
        let metal = mean_metal * (single - schlick) + schlick;
        let clear = p.specular * max(mean_f0 * (single - rise) + rise, vec3f(0.0));
        facets_albedo = p.metallic * metal + dielectric * clear + it.tint * max(all - math_max3(clear), 0.0);
    }
    rest.multiple = 1.0 - single;
    rest.boundary = 1.0 - all;
    if !inside {
        rest.coat = coat_passed(p.coat, wo);
        if has_sheen {
            rest.sheen = sheen_passed(sheen, mu);
        }
    }
    let rest_through = select(rest.multiple, rest.boundary, is_solid);
    let lost = multiple.color * rest.multiple;
    let lost_boundary = boundary.color * rest.boundary;
    var cosine = diffuse.color * rest.diffuse;
    var uniform_part = vec3f(0.0);
    cosine += select(lost, vec3f(0.0), multiple.is_grazing) + select(lost_boundary, vec3f(0.0), boundary.is_grazing);
    uniform_part += select(vec3f(0.0), lost, multiple.is_grazing) + select(vec3f(0.0), lost_boundary, boundary.is_grazing);
    let cosine_through = diffuse_through.color * rest.diffuse + other_through.color * rest_through;
    let below = rest.coat * rest.sheen;
    let coat_part = vec3f(rest.sheen * (1.0 - rest.coat));
    uniform_part *= below;
    if has_sheen {
        uniform_part += sheen.color * ((1.0 - rest.sheen) / math_max3(sheen.color));
    }
    b.albedo = below * (facets_albedo + cosine + cosine_through) + coat_part + uniform_part;
    var weights = vec4f(math_mean(below * facets_albedo), math_mean(below * cosine), math_mean(below * cosine_through), coat_part.x);
    var last = math_mean(uniform_part);
    let sum = weights.x + weights.y + weights.z + weights.w + last;
    b.kind = select(BSDF_KIND_NOTHING, BSDF_KIND_LAYERED, sum > 0.0);
    if is_boundary_alone {
        b.kind = BSDF_KIND_LAYERED;
        weights = vec4f(1.0, 0.0, 0.0, 0.0);
        last = 0.0;
    } else if sum > 0.0 {
        weights /= sum;
        last /= sum;
    }

    let is_translucent = base_is_some(diffuse_through.color);
    b.lobes = select(0u, BSDF_HAS_NON_DELTA, has_non_delta)
        | select(0u, BSDF_IS_TRANSMISSIVE, through != THROUGH_NOTHING || (is_translucent && !is_boundary_alone));
    let base_roughness = select(sqrt(select(sqrt(alpha.x * alpha.y), alpha.x, alpha.x == alpha.y)), 1.0, interface_black);
    b.roughness = select(base_roughness, min(base_roughness, p.coat.roughness), has_coat && !inside);
    b.words.x = select(0u, LAYERED_USES_SINGLE, uses_single) | select(0u, LAYERED_USES_RISE, is_covered)
        | select(0u, LAYERED_USES_BOUNDARY, is_solid) | select(0u, LAYERED_INSIDE, inside) | (through << LAYERED_THROUGH_SHIFT);
    if is_boundary_alone {
        // No lobe needs the tables.
        b.words.x &= ~(LAYERED_USES_SINGLE | LAYERED_USES_RISE | LAYERED_USES_BOUNDARY);
    }
    b.d[0] = vec4f(alpha, p.metallic, dielectric);
    b.d[1] = vec4f(p.base_color, it.eta);
    b.d[2] = vec4f(f0, p.specular);
    b.d[3] = vec4f(it.tint, f0_exact);
    b.d[4] = vec4f(p.film.factor, p.film.ior, p.film.thickness, spread);
    b.d[5] = vec4f(position, index_ior, rest.coat, rest.sheen);
    b.d[6] = vec4f(cover.single, cover.rise, cover.constant, last);
    b.d[7] = vec4f(diffuse.color * (diffuse.scale * rest.diffuse), p.coat.weight);
    b.d[8] = vec4f(multiple.color * (multiple.scale * rest.multiple), p.coat.roughness);
    b.d[9] = vec4f(boundary.color * (boundary.scale * rest.boundary), sheen.alpha);
    b.d[10] = vec4f(diffuse_through.color * (diffuse_through.scale * rest.diffuse), sheen.position);
    b.d[11] = vec4f(other_through.color * (other_through.scale * rest_through), 0.0);
    b.d[12] = weights;
    b.d[13] = vec4f(p.coat.normal, 0.0);
    b.d[14] = vec4f(sheen.color, 0.0);
    return b;
}
