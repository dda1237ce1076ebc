// Closest hit and any hit of a ray: an eight-child tree with quantized boxes (Ylitie, Karras and Laine, "Efficient Incoherent Ray
// Traversal on GPUs Through Compressed Wide BVHs", 2017). STACK_SIZE groups of nodes fit on the stack, as many as the tree is deep.
// Who uses it says by `is_there` which hits count.

// Five a node: corner, and exponents and which children are nodes; first child, first shape, kinds of the children; their boxes, a byte
// a plane: all low x, low y, low z, high x, high y, high z.
@group(0) @binding(0) var<storage, read> nodes: array<vec4<u32>>;

// Which of four children of a node a ray enters, as bits: node children in the upper eight, the nearest by its octant highest; shapes of leaf
// children in the lower 24, counted from the node's first one. (Ylitie et al. 2017, section 4.)

fn enter_four(
    kinds: u32,
    near: vec3<u32>,
    far: vec3<u32>,
    step: vec3<f32>,
    base: vec3<f32>,
    octants: u32,
    t_min: f32,
    t_max: f32,
) -> u32 {
    let is_inner = (kinds & (kinds << 1u)) & 0x10101010u;
    let inner_mask = (is_inner >> 4u) * 0xffu;
    let places = (kinds ^ (octants & inner_mask)) & 0x1f1f1f1fu;
    let bits = (kinds >> 5u) & 0x07070707u;
    var entered = 0u;
    for (var child = 0u; child < 4u; child += 1u) {
        let shift = 8u * child;
        let low = vec3<f32>((near >> vec3(shift)) & vec3(0xffu)) * step + base;
        let high = vec3<f32>((far >> vec3(shift)) & vec3(0xffu)) * step + base;
        let first = max(max(low.x, low.y), max(low.z, t_min));
        let last = min(min(high.x, high.y), min(high.z, t_max)) * SLAB_SLACK;
        let found = ((bits >> shift) & 0xffu) << ((places >> shift) & 31u);
        entered |= select(0u, found, first <= last);
    }
    return entered;
}

fn traverse(ray: Ray, any: bool) -> Hit {
    var best = Hit(ray.t_max, 0.0, 0.0, NOTHING, NOTHING, NOTHING);
    if !(ray.t_min < ray.t_max) {
        return best;
    }
    let inverse = inverse_of(ray.direction);
    let is_negative = inverse < vec3(0.0);
    // The place of the octant that comes first has the highest number.
    let signs = vec3<u32>(is_negative);
    let octant = 7u - (signs.x * 4u + signs.y * 2u + signs.z);
    let octants = octant * 0x01010101u;
    var stack: array<vec2<u32>, STACK_SIZE>;
    var top = 0u;
    // Nodes that are still to be entered: the first of all that are there, those to enter (upper 8 bits), those that are there (lower 8).
    var group = vec2(0u, 0x80000000u);
    loop {
        let bit = firstLeadingBit(group.y);
        group.y &= ~(1u << bit);
        let slot = (bit - 24u) ^ octant;
        let index = 5u * (group.x + countOneBits(group.y & ((1u << slot) - 1u)));
        if group.y > 0x00ffffffu && top < STACK_SIZE {
            stack[top] = group;
            top += 1u;
        }
        let a = nodes[index];
        let b = nodes[index + 1u];
        let c = nodes[index + 2u];
        let d = nodes[index + 3u];
        let e = nodes[index + 4u];
        let size = bitcast<vec3<f32>>(((a.www >> vec3(0u, 8u, 16u)) & vec3(0xffu)) << vec3(23u));
        let step = size * inverse;
        let base = (bitcast<vec3<f32>>(a.xyz) - ray.origin) * inverse;
        let low_0 = vec3(c.x, c.z, d.x);
        let low_1 = vec3(c.y, c.w, d.y);
        let high_0 = vec3(d.z, e.x, e.z);
        let high_1 = vec3(d.w, e.y, e.w);
        let near_0 = select(low_0, high_0, is_negative);
        let near_1 = select(low_1, high_1, is_negative);
        let far_0 = select(high_0, low_0, is_negative);
        let far_1 = select(high_1, low_1, is_negative);
        let entered = enter_four(b.z, near_0, far_0, step, base, octants, ray.t_min, best.t)
            | enter_four(b.w, near_1, far_1, step, base, octants, ray.t_min, best.t);
        group = vec2(b.x, (entered & 0xff000000u) | (a.w >> 24u));
        var leaves = entered & 0x00ffffffu;
        while leaves != 0u {
            let shape_index = b.y + firstTrailingBit(leaves);
            leaves &= leaves - 1u;
            let shape = shapes[shape_index];
            if (shape.instance & SPHERE) != 0u {
                hit_sphere(shape_index, shape, ray, &best);
            } else {
                hit_triangle(shape_index, shape, ray, &best);
            }
            if any && best.instance != NOTHING {
                return best;
            }
        }
        if group.y <= 0x00ffffffu {
            if top == 0u {
                return best;
            }
            top -= 1u;
            group = stack[top];
        }
    }
    return best;
}
