// The layered material's parameters at a point, in their ranges. See `bsdf/params.rs`.

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

fn layered_params(
    record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>,
) -> LayeredParams {
    var it: LayeredParams;
    it.base_color = surface_share((*p)[0] * (*point).vertex_color.xyz);
    it.specular_color = clamp((*p)[1], vec3f(0.0), vec3f(1e6));
    it.through_color = surface_share((*p)[2]);
    it.sheen_color = surface_share((*p)[3]);
    it.metallic = surface_unit((*p)[4].x);
    it.roughness = surface_unit((*p)[5].x);
    it.specular = surface_unit((*p)[6].x);
    it.transmission = surface_unit((*p)[7].x);
    it.diffuse_transmission = surface_unit((*p)[8].x);
    it.sheen_roughness = surface_unit((*p)[11].x);
    it.anisotropy = surface_unit((*p)[14].z);
    it.ior = material_f32(record + 2u);
    it.dispersion = material_f32(record + 3u);
    it.thin = material_words[record + 1u] != 0u;
    it.front = (*point).front != 0u;
    let least = material_f32(record + 5u);
    let thickness = clamp(least + (material_f32(record + 6u) - least) * (*p)[13].x, 0.0, 1e5);
    it.film = film_of(surface_unit((*p)[12].x), material_f32(record + 4u), thickness);
    var normal = math_normalize_or((*point).coat_normal, vec3f(0.0, 0.0, 1.0));
    if normal.z <= 0.0 || all((*point).coat_normal == vec3f(0.0, 0.0, 1.0)) {
        normal = vec3f(0.0, 0.0, 1.0);
    }
    it.coat = Coat(surface_unit((*p)[9].x), surface_unit((*p)[10].x), normal);
    return it;
}

fn layered_surface(
    record: u32, point: ptr<function, SurfacePoint>, p: ptr<function, SurfaceParams>, wo: vec3f, carried: vec3f,
) -> Bsdf {
    return layered_of(wo, carried, layered_params(record, point, p));
}
