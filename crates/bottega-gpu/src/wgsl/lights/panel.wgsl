// Twin: `bottega-render/src/lights/panel.rs`.
//
// The panels of emissive meshes, and the grids of their parts.

// Returns the position along the sides of a panel, for barycentric coordinates of one of its triangles.
fn shape_place_of(shape: u32, is_second: bool, uv: vec2<f32>) -> vec2<f32> {
    if shape == PANEL_TRIANGLE {
        return uv;
    }
    let weights = weights_of(uv);
    let turn = select(shape & PANEL_CORNER_MASK, (shape >> PANEL_OPPOSITE_SHIFT) & PANEL_CORNER_MASK, is_second);
    let along = vec2(weights[(turn + 1u) % 3u], weights[(turn + 2u) % 3u]);
    return select(along, 1.0 - along, is_second);
}

// Returns the barycentric coordinates of a position along the sides, and 1 if it is in the second triangle of a rectangle.
fn panel_triangle_at(shape: u32, place: vec2<f32>) -> vec3<f32> {
    if shape == PANEL_TRIANGLE {
        return vec3(place, 0.0);
    }
    let corner = shape & PANEL_CORNER_MASK;
    let opposite = (shape >> PANEL_OPPOSITE_SHIFT) & PANEL_CORNER_MASK;
    let is_second = place.x + place.y > 1.0;
    let along = select(
        vec3(1.0 - place.x - place.y, place),
        vec3(place.x + place.y - 1.0, 1.0 - place),
        is_second,
    );
    let turn = select(corner, opposite, is_second);
    // weights[(turn + i) % 3] = along[i].
    let b = vec2(along[(4u - turn) % 3u], along[(5u - turn) % 3u]);
    return vec3(b, select(0.0, 1.0, is_second));
}

// Returns the part of a panel at a position, in a grid of `side` × `side` cells.
fn grid_part_at(shape: u32, side: u32, place: vec2<f32>) -> u32 {
    let scaled = place * f32(side);
    let row = min(u32(max(scaled.y, 0.0)), side - 1u);
    let cell = min(u32(max(scaled.x, 0.0)), side - 1u);
    if shape != PANEL_TRIANGLE {
        return row * side + cell;
    }
    let columns = side - row;
    let column = min(cell, columns - 1u);
    let within = scaled.x - f32(column) + scaled.y - f32(row);
    // Rows above have 2n − 1 parts, with n shrinking by one per row.
    let above = side * side - columns * columns;
    return above + 2u * column + select(0u, 1u, within > 1.0 && column + 1u < columns);
}
