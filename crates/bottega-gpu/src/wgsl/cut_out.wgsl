// No twin.
//
// The opacity test of candidate hits in scenes with cut-out surfaces. The result depends only on the path's segment and the
// surface, so candidates of a ray can be tested in any order and repeatedly.

var<private> asking: Sampler;
var<private> asking_depth: u32;

// The bit by which shadow rays get other opacity numbers than paths, so that the two are independent.
var<private> asking_shadow: u32;

fn ask_as(path: u32, depth: u32, is_shadow: bool) {
    asking = sampler_from(path);
    asking_depth = depth;
    asking_shadow = select(0u, ASKS_AS_SHADOW, is_shadow);
}

fn is_there(hit: Hit, ray: Ray) -> bool {
    var place: SurfacePlace;
    var is_left = 0u;
    if (hit.instance & HIT_SPHERE) != 0u {
        let sphere = sphere_at(hit.instance & ~HIT_SPHERE);
        place.material = scene_words[sphere + SPHERE_MATERIAL];
        place.vertex_alpha = 1.0;
        // A ray enters and leaves a sphere: these count as two surfaces.
        let from_center = ray.origin + hit.t * ray.direction - vec3_at(sphere + SPHERE_CENTER);
        is_left = select(0u, 1u, dot(from_center, ray.direction) > 0.0);
    } else {
        place.material = scene_words[scene_words[instance_at(hit.instance) + INSTANCE_MESH] + MESH_MATERIAL];
    }
    let flags = material_flags(place.material);
    if (flags & MATERIAL_HAS_OPACITY) == 0u {
        return true;
    }
    if (flags & MATERIAL_NULL) != 0u {
        return false;
    }
    if (hit.instance & HIT_SPHERE) == 0u {
        place = place_of(hit.instance, hit.primitive, vec2(hit.u, hit.v));
    } else if (flags & MATERIAL_TEXTURED) != 0u {
        let sphere = sphere_at(hit.instance & ~HIT_SPHERE);
        let n = direction_or(ray.origin + hit.t * ray.direction - vec3_at(sphere + SPHERE_CENTER), vec3(0.0, 1.0, 0.0));
        place.uv0 = sphere_uv(sphere, n);
        place.uv1 = place.uv0;
    }
    let there = opacity(place);
    if there >= 1.0 {
        return true;
    }
    let number = vec2(hit.primitive ^ asking_shadow ^ is_left, hit.instance ^ (asking_depth << DEPTH_SHIFT));
    return there > 0.0 && hashed(asking, number) < there;
}
