// Twin: `bottega-render/src/bsdf/params.rs`.
//
// The layered material's parameters at a point, clamped to their ranges.

struct LayeredParams {
    base_color: vec3f,
    specular_color: vec3f,
    through_color: vec3f,
    sheen_color: vec3f,
    metallic: f32,
    roughness: f32,
    anisotropy: f32,
    ior: f32,
    dispersion: f32,
    specular: f32,
    transmission: f32,
    diffuse_transmission: f32,
    coat: Coat,
    sheen_roughness: f32,
    film: Film,
    thin: bool,
    front: bool,
}

fn params_clamped(
    record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>,
) -> LayeredParams {
    var it: LayeredParams;
    it.base_color = surface_share((*p)[LAYERED_PARAM_BASE_COLOR] * (*point).vertex_color.xyz);
    it.specular_color = clamp((*p)[LAYERED_PARAM_SPECULAR_COLOR], vec3f(0.0), vec3f(1e6));
    it.through_color = surface_share((*p)[LAYERED_PARAM_THROUGH_COLOR]);
    it.sheen_color = surface_share((*p)[LAYERED_PARAM_SHEEN_COLOR]);
    it.metallic = surface_unit((*p)[LAYERED_PARAM_METALLIC].x);
    it.roughness = surface_unit((*p)[LAYERED_PARAM_ROUGHNESS].x);
    it.specular = surface_unit((*p)[LAYERED_PARAM_SPECULAR].x);
    it.transmission = surface_unit((*p)[LAYERED_PARAM_TRANSMISSION].x);
    it.diffuse_transmission = surface_unit((*p)[LAYERED_PARAM_DIFFUSE_TRANSMISSION].x);
    it.sheen_roughness = surface_unit((*p)[LAYERED_PARAM_SHEEN_ROUGHNESS].x);
    it.anisotropy = surface_unit((*p)[LAYERED_PARAM_ANISOTROPY].z);
    it.ior = material_f32(record + LAYERED_IOR);
    it.dispersion = material_f32(record + LAYERED_DISPERSION);
    it.thin = material_words[record + LAYERED_THIN] != 0u;
    it.front = (*point).front != 0u;
    let least = material_f32(record + LAYERED_FILM_LEAST);
    let most = material_f32(record + LAYERED_FILM_MOST);
    let thickness = clamp(least + (most - least) * (*p)[LAYERED_PARAM_FILM_THICKNESS].x, 0.0, 1e5);
    it.film = film_new(surface_unit((*p)[LAYERED_PARAM_FILM].x), material_f32(record + LAYERED_FILM_IOR), thickness);
    var normal = math_normalize_or((*point).coat_normal, vec3f(0.0, 0.0, 1.0));
    if normal.z <= 0.0 || all((*point).coat_normal == vec3f(0.0, 0.0, 1.0)) {
        normal = vec3f(0.0, 0.0, 1.0);
    }
    it.coat = Coat(surface_unit((*p)[LAYERED_PARAM_COAT].x), surface_unit((*p)[LAYERED_PARAM_COAT_ROUGHNESS].x), normal);
    return it;
}

fn layered_surface(
    record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f, carried: vec3f,
) -> Bsdf {
    return layered_of(wo, carried, params_clamped(record, point, p));
}
