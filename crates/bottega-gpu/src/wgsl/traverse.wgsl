// No twin.
//
// Closest hit and any hit of a ray: an eight-wide tree with quantized boxes (Ylitie, Karras and Laine, "Efficient Incoherent Ray
// Traversal on GPUs Through Compressed Wide BVHs", 2017). The stack holds STACK_SIZE groups of nodes, at least the depth of the
// tree. The including shader defines `is_there`, which accepts or rejects hits.

// NODE_VECTORS per node, as `node_of` takes them.
@group(0) @binding(0) var<storage, read> nodes: array<vec4<u32>>;

// Returns which of four children of a node a ray enters, as bits: inner children in the upper eight, the nearest by octant in the
// highest bit; shapes of leaf children in the lower 24, counted from the node's first one. (Ylitie et al. 2017, section 4.)
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
    // Decode the kinds: bits of inner children, and the place of each child's bits.
    let is_inner = (kinds & (kinds << 1u)) & NODE_INNER_BITS;
    let inner_mask = (is_inner >> NODE_INNER_SHIFT) * 0xffu;
    let places = (kinds ^ (octants & inner_mask)) & NODE_PLACE_BITS;
    let bits = (kinds >> NODE_PLACE_WIDTH) & NODE_SHAPE_BITS;
    var entered = 0u;
    // Intersect the four boxes (slab test).
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

// Returns the closest hit, or with `any` the first hit found.
fn traverse(ray: Ray, any: bool) -> Hit {
    var best = Hit(ray.t_max, 0.0, 0.0, HIT_NOTHING, HIT_NOTHING, HIT_NOTHING);
    if !(ray.t_min < ray.t_max) {
        return best;
    }
    let inverse = inverse_of(ray.direction);
    let is_negative = inverse < vec3(0.0);
    // The octant entered first gets the highest number.
    let signs = vec3<u32>(is_negative);
    let octant = 7u - (signs.x * 4u + signs.y * 2u + signs.z);
    let octants = octant * NODE_EACH;
    var stack: array<vec2<u32>, STACK_SIZE>;
    var top = 0u;
    // Inner nodes still to enter: index of the first child, children to enter (upper 8 bits), children that exist (lower 8 bits).
    var group = vec2(0u, NODE_GROUP_ROOT);
    loop {
        // Take the nearest inner child of the group; push the rest.
        let bit = firstLeadingBit(group.y);
        group.y &= ~(1u << bit);
        let slot = (bit - NODE_INNER) ^ octant;
        let index = NODE_VECTORS * (group.x + countOneBits(group.y & ((1u << slot) - 1u)));
        if group.y > NODE_GROUP_SHAPES && top < STACK_SIZE {
            stack[top] = group;
            top += 1u;
        }
        // Load the node, and sort its planes by the ray's direction.
        let node = node_of(nodes[index], nodes[index + 1u], nodes[index + 2u], nodes[index + 3u], nodes[index + 4u]);
        let size = bitcast<vec3<f32>>(node.exponents << vec3(23u));
        let step = size * inverse;
        let base = (node.corner - ray.origin) * inverse;
        let low_0 = vec3(node.low_x.x, node.low_y.x, node.low_z.x);
        let low_1 = vec3(node.low_x.y, node.low_y.y, node.low_z.y);
        let high_0 = vec3(node.high_x.x, node.high_y.x, node.high_z.x);
        let high_1 = vec3(node.high_x.y, node.high_y.y, node.high_z.y);
        let near_0 = select(low_0, high_0, is_negative);
        let near_1 = select(low_1, high_1, is_negative);
        let far_0 = select(high_0, low_0, is_negative);
        let far_1 = select(high_1, low_1, is_negative);
        // Intersect the eight boxes.
        let entered = enter_four(node.kinds.x, near_0, far_0, step, base, octants, ray.t_min, best.t)
            | enter_four(node.kinds.y, near_1, far_1, step, base, octants, ray.t_min, best.t);
        group = vec2(node.children, (entered & ~NODE_GROUP_SHAPES) | node.inner);
        // Intersect the shapes of the entered leaves.
        var leaves = entered & NODE_GROUP_SHAPES;
        while leaves != 0u {
            let shape_index = node.shapes + firstTrailingBit(leaves);
            leaves &= leaves - 1u;
            let shape = shapes[shape_index];
            if (shape.instance & HIT_SPHERE) != 0u {
                hit_sphere(shape_index, shape, ray, &best);
            } else {
                hit_triangle(shape_index, shape, ray, &best);
            }
            if any && best.instance != HIT_NOTHING {
                return best;
            }
        }
        // Without an inner child to enter, pop a group.
        if group.y <= NODE_GROUP_SHAPES {
            if top == 0u {
                return best;
            }
            top -= 1u;
            group = stack[top];
        }
    }
    return best;
}
