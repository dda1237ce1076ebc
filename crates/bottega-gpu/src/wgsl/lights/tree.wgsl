// Twin: `bottega-render/src/lights/tree.rs`.
//
// Selection of one light by a light tree. A node holds values of four children.

// A point that receives light; n is 0 if light arrives from all sides.
struct Receiver {
    p: vec3<f32>,
    n: vec3<f32>,
}

// A light and its probability; 0: no light.
struct Choice {
    light: u32,
    probability: f32,
}

// Returns the importance of all children of a node: intensity over squared distance, times bounds of both cosines.
fn receiver_of(node: u32, receiver: Receiver) -> vec4<f32> {
    let x = vec4_at(node + TREE_NODE_CENTER_X) - receiver.p.x;
    let y = vec4_at(node + TREE_NODE_CENTER_Y) - receiver.p.y;
    let z = vec4_at(node + TREE_NODE_CENTER_Z) - receiver.p.z;
    let squared = max(x * x + y * y + z * z, vec4(DISTANCE_SQUARED_MIN));
    let inverse = 1.0 / sqrt(squared);
    let radius = vec4_at(node + TREE_NODE_RADIUS);
    let cos_spread = vec4_at(node + TREE_NODE_COS_SPREAD);
    let sin_spread = vec4_at(node + TREE_NODE_SIN_SPREAD);
    let cos_emission = vec4_at(node + TREE_NODE_COS_EMISSION);
    let two_sided = vec4_at(node + TREE_NODE_TWO_SIDED);
    let intensity = vec4_at(node + TREE_NODE_INTENSITY);
    // Bounding sphere of the box as an angle; from inside, the whole sphere.
    let is_inside = radius * radius >= squared;
    let sin_box = radius * inverse;
    let cos_box = co(sin_box);
    let toward = -(x * vec4_at(node + TREE_NODE_AXIS_X) + y * vec4_at(node + TREE_NODE_AXIS_Y) + z * vec4_at(node + TREE_NODE_AXIS_Z)) * inverse;
    let cos_axis = select(toward, abs(toward), two_sided > vec4<f32>(0.0));
    let sin_axis = co(cos_axis);
    let cos_beyond = cos_difference(cos_axis, sin_axis, cos_spread, sin_spread);
    let sin_beyond = sin_difference(cos_axis, sin_axis, cos_spread, sin_spread);
    let cos_seen = select(cos_difference(cos_beyond, sin_beyond, cos_box, sin_box), vec4<f32>(1.0), is_inside);
    let arriving = intensity * cos_seen / max(squared, radius * radius);
    let seen = select(vec4<f32>(0.0), arriving, cos_seen > cos_emission);
    let n = receiver.n;
    if is_black(n) {
        return seen;
    }
    let above = x * n.x + y * n.y + z * n.z;
    let reach = vec4_at(node + TREE_NODE_HALF_X) * abs(n.x) + vec4_at(node + TREE_NODE_HALF_Y) * abs(n.y) + vec4_at(node + TREE_NODE_HALF_Z) * abs(n.z);
    let cos_n = above * inverse;
    let cos_receiver = max(cos_difference(cos_n, co(cos_n), cos_box, sin_box), vec4<f32>(0.0));
    let lit = seen * select(cos_receiver, vec4<f32>(1.0), is_inside);
    return select(vec4<f32>(0.0), lit, above + reach > vec4<f32>(0.0));
}

fn sum_of(parts: vec4<f32>) -> f32 {
    return parts.x + parts.y + parts.z + parts.w;
}

// Returns cos max(0, a − b) for two angles in [0, π].
fn cos_difference(cos_a: vec4<f32>, sin_a: vec4<f32>, cos_b: vec4<f32>, sin_b: vec4<f32>) -> vec4<f32> {
    return select(cos_a * cos_b + sin_a * sin_b, vec4<f32>(1.0), cos_a > cos_b);
}

// Returns sin max(0, a − b).
fn sin_difference(cos_a: vec4<f32>, sin_a: vec4<f32>, cos_b: vec4<f32>, sin_b: vec4<f32>) -> vec4<f32> {
    return select(sin_a * cos_b - cos_a * sin_b, vec4<f32>(0.0), cos_a > cos_b);
}

// Returns √(1 − x²).
fn co(x: vec4<f32>) -> vec4<f32> {
    return sqrt(max(1.0 - x * x, vec4<f32>(0.0)));
}

// Estimates the illuminance by all lights of the tree.
fn light_tree_total(receiver: Receiver) -> f32 {
    if scene_words[HEADER_LIGHT_COUNT] == 0u {
        return 0.0;
    }
    return sum_of(receiver_of(scene_words[HEADER_TREE], receiver)) * number_at(HEADER_TREE_INTENSITY);
}

// Samples a light in proportion to the importance of the nodes on its path.
fn light_tree_sample(receiver: Receiver, number: f32) -> Choice {
    if scene_words[HEADER_LIGHT_COUNT] <= 1u {
        return Choice(0u, select(0.0, 1.0, scene_words[HEADER_LIGHT_COUNT] == 1u));
    }
    var u = number;
    var probability = 1.0;
    var node = scene_words[HEADER_TREE];
    var first_light = 0u;
    loop {
        let parts = receiver_of(node, receiver);
        let total = sum_of(parts);
        if !(total > 0.0) || !(total < FAR) {
            return Choice(0u, 0.0);
        }
        // Select a child in proportion to its importance.
        var rest = u * total;
        var chosen = 0u;
        // Rounding may leave a remainder beyond the last child: give it to that one.
        for (var i = 0u; i < 4u; i += 1u) {
            let part = parts[i];
            if part > 0.0 {
                chosen = i;
                var later = 0.0;
                for (var j = i + 1u; j < 4u; j += 1u) {
                    later = max(later, parts[j]);
                }
                if rest < part || later <= 0.0 {
                    break;
                }
                rest -= part;
            }
        }
        // Rescale the random number, and descend.
        let part = parts[chosen];
        probability *= part / total;
        u = min(rest / part, ONE_MINUS_EPSILON);
        let child = scene_words[node + TREE_NODE_CHILD + chosen];
        let begins = select(first_light, scene_words[node + TREE_NODE_END + chosen - 1u], chosen > 0u);
        if child == NONE {
            return Choice(begins, probability);
        }
        first_light = begins;
        node = scene_words[HEADER_TREE] + TREE_NODE_WORDS * child;
    }
    return Choice(0u, 0.0);
}

// Returns the probability with which `light_tree_sample` selects a light.
fn light_tree_pmf(receiver: Receiver, light: u32) -> f32 {
    if scene_words[HEADER_LIGHT_COUNT] <= 1u {
        return 1.0;
    }
    var probability = 1.0;
    var node = scene_words[HEADER_TREE];
    loop {
        let parts = receiver_of(node, receiver);
        // Find the child that contains the light.
        var chosen = 3u;
        for (var i = 0u; i < 3u; i += 1u) {
            if light < scene_words[node + TREE_NODE_END + i] {
                chosen = i;
                break;
            }
        }
        let part = parts[chosen];
        let total = sum_of(parts);
        if !(part > 0.0) || !(total < FAR) {
            return 0.0;
        }
        probability *= part / total;
        let child = scene_words[node + TREE_NODE_CHILD + chosen];
        if child == NONE {
            return probability;
        }
        node = scene_words[HEADER_TREE] + TREE_NODE_WORDS * child;
    }
    return 0.0;
}
