//! Directions of view for which a measured material has tables, and interpolation between them.

use super::error::MeasuredError;

/// The greatest angle of a direction of view against the normal, with some rounding.
const THETA_MAX: f32 = std::f32::consts::FRAC_PI_2 + 0.01;
/// The greatest angle around the normal.
const PHI_MAX: f32 = 2.0 * std::f32::consts::TAU;

/// The nodes: directions of view in a grid of angles, in radians. Those of one angle around the normal follow each other.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NodeGrid {
    /// Angles around the normal, strictly increasing, at least one.
    pub(super) phi: Vec<f32>,
    /// Angles against the normal, strictly increasing, at least one.
    pub(super) theta: Vec<f32>,
}

impl NodeGrid {
    /// Makes a grid. An error if angles do not increase or are out of range.
    pub(super) fn new(phi: Vec<f32>, theta: Vec<f32>) -> Result<Self, MeasuredError> {
        let is_sound = |angles: &[f32], least: f32, most: f32| {
            let increases = angles.windows(2).all(|pair| pair[0] < pair[1]);
            !angles.is_empty() && increases && angles.iter().all(|angle| (least..=most).contains(angle))
        };
        if !is_sound(&phi, -PHI_MAX, PHI_MAX) {
            return Err(MeasuredError::Directions { name: "phi_i" });
        }
        if !is_sound(&theta, 0.0, THETA_MAX) {
            return Err(MeasuredError::Directions { name: "theta_i" });
        }
        Ok(Self { phi, theta })
    }

    /// Returns the number of nodes.
    pub(super) fn len(&self) -> usize {
        self.phi.len() * self.theta.len()
    }

    /// Returns the nodes around a direction. Beyond the grid, its edge counts.
    pub(super) fn around(&self, phi: f32, theta: f32) -> NodeWeights {
        let ((row, along), (column, across)) = (place(&self.phi, phi), place(&self.theta, theta));
        let mut found = NodeWeights { nodes: [0; 4], weights: [0.0; 4], count: 0 };
        for (row, row_weight) in [(row, 1.0 - along), (row + 1, along)] {
            for (column, weight) in [(column, 1.0 - across), (column + 1, across)] {
                let weight = weight * row_weight;
                if weight > 0.0 {
                    found.nodes[found.count] = (row * self.theta.len() + column) as u32;
                    found.weights[found.count] = weight;
                    found.count += 1;
                }
            }
        }
        found
    }
}

/// Returns the node at or before an angle, and the fraction of the way to the next one; 0 at the last node.
fn place(angles: &[f32], angle: f32) -> (usize, f32) {
    let after = angles.partition_point(|node| *node <= angle);
    match (after.checked_sub(1), angles.get(after)) {
        (Some(index), Some(next)) => (index, (angle - angles[index]) / (next - angles[index])),
        (Some(index), None) => (index, 0.0),
        (None, _) => (0, 0.0),
    }
}

/// The nodes around a direction of view, with their weights of bilinear interpolation, which sum to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeWeights {
    nodes: [u32; 4],
    weights: [f32; 4],
    count: usize,
}

impl NodeWeights {
    /// Returns the mean of the nodes' values.
    #[inline(always)]
    pub(super) fn mean<T: std::ops::Mul<f32, Output = T> + std::iter::Sum>(&self, value: impl Fn(usize) -> T) -> T {
        (0..self.count).map(|index| value(self.nodes[index] as usize) * self.weights[index]).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_those_of_bilinear_interpolation() {
        let grid = NodeGrid::new(vec![-1.0, 1.0], vec![0.0, 0.5, 1.5]).unwrap();
        let value = |phi: f32, theta: f32| {
            let nodes = [(-1.0, 0.0), (-1.0, 0.5), (-1.0, 1.5), (1.0, 0.0), (1.0, 0.5), (1.0, 1.5)];
            grid.around(phi, theta).mean(|node| 10.0 * nodes[node].0 + nodes[node].1)
        };
        for (phi, theta) in [(0.0, 0.25), (-1.0, 0.5), (0.75, 1.0), (1.0, 1.5)] {
            assert!((value(phi, theta) - (10.0 * phi + theta)).abs() < 1e-5, "{phi} {theta}");
        }
        assert_eq!(value(-3.0, 1.57), -10.0 + 1.5);
        assert_eq!(value(f32::NAN, f32::NAN), -10.0);
    }

    #[test]
    fn angles_must_increase() {
        for (phi, theta) in
            [(vec![], vec![0.0]), (vec![0.0], vec![]), (vec![1.0, 1.0], vec![0.0]), (vec![0.0], vec![2.0])]
        {
            assert!(NodeGrid::new(phi.clone(), theta.clone()).is_err(), "{phi:?} {theta:?}");
        }
    }
}
