//! Computation of all tables from their cells.

use super::{super::sheen, AlbedoCurve, INDEX, MU, ROUGHNESS, TableValues, Tables, node_mu};

impl Tables {
    /// Integrates all tables, with fixed nodes in a fixed order.
    pub(super) fn compute() -> Self {
        let cells: Vec<[TableValues; MU]> = (0..ROUGHNESS)
            .map(|i| {
                let root = i as f32 / (ROUGHNESS - 1) as f32;
                std::array::from_fn(|j| TableValues::integrate(node_mu(j), root * root))
            })
            .collect();
        let by_roughness = |value: &dyn Fn(&TableValues) -> f32| -> Vec<AlbedoCurve> {
            cells.iter().map(|row| AlbedoCurve::new(std::array::from_fn(|j| value(&row[j])))).collect()
        };
        let by_index = |value: &dyn Fn(&TableValues, usize) -> f32| -> Vec<AlbedoCurve> {
            (0..INDEX).flat_map(|k| by_roughness(&|cell| value(cell, k))).collect()
        };
        let sheen = |i: usize| {
            let roughness = sheen::roughness_at(i as f32 / (ROUGHNESS - 1) as f32);
            AlbedoCurve::new(std::array::from_fn(|j| sheen::albedo_by_quadrature(node_mu(j), roughness)))
        };
        Self {
            single: by_roughness(&|cell| cell.single),
            schlick: by_roughness(&|cell| cell.schlick),
            rise: by_index(&|cell, k| cell.rise[k]),
            boundary: [by_index(&|cell, k| cell.boundary[0][k]), by_index(&|cell, k| cell.boundary[1][k])],
            sheen: (0..ROUGHNESS).map(sheen).collect(),
        }
    }
}
