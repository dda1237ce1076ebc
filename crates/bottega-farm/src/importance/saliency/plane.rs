//! A level of an image pyramid.

/// A grid of numbers, row-major.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    width: u32,
    height: u32,
    /// `[width × height]`, row-major.
    pub(super) values: Vec<f32>,
}

impl Plane {
    /// Makes a plane of values.
    ///
    /// - `values`: `[width × height]`, at least one pixel.
    pub(super) fn new(width: u32, height: u32, values: Vec<f32>) -> Self {
        debug_assert_eq!(values.len(), width as usize * height as usize);
        Self { width, height, values }
    }

    /// Makes a plane of zeros.
    pub(super) fn zero((width, height): (u32, u32)) -> Self {
        Self { width, height, values: vec![0.0; width as usize * height as usize] }
    }

    /// Returns columns and rows.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the value at (x, y), clamped to the edge.
    pub(super) fn at(&self, x: i64, y: i64) -> f32 {
        let x = x.clamp(0, i64::from(self.width) - 1) as usize;
        let y = y.clamp(0, i64::from(self.height) - 1) as usize;
        self.values[y * self.width as usize + x]
    }

    /// Returns the difference from a plane of the same size.
    pub(super) fn minus(&self, other: &Self) -> Self {
        debug_assert_eq!(self.size(), other.size());
        let values = self.values.iter().zip(&other.values).map(|(a, b)| a - b).collect();
        Self { values, ..*self }
    }

    /// Adds a plane of the same size.
    pub(super) fn add(&mut self, other: &Self) {
        debug_assert_eq!(self.size(), other.size());
        self.values.iter_mut().zip(&other.values).for_each(|(a, b)| *a += b);
    }

    /// Returns the plane at half size: low-pass filtered by the binomial weights 1 4 6 4 1 in both directions, with
    /// every second value kept. Source: Burt and Adelson 1983, *The Laplacian Pyramid as a Compact Image Code*.
    pub(super) fn halved(&self) -> Self {
        const WEIGHTS: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let weighted = |value: &dyn Fn(i64) -> f32| WEIGHTS.iter().zip(-2..).map(|(w, k)| w * value(k)).sum::<f32>();
        let mut narrow = Self::zero((width, self.height));
        for y in 0..i64::from(self.height) {
            for x in 0..i64::from(width) {
                narrow.values[(y * i64::from(width) + x) as usize] = weighted(&|k| self.at(2 * x + k, y));
            }
        }
        let mut half = Self::zero((width, height));
        for y in 0..i64::from(height) {
            for x in 0..i64::from(width) {
                half.values[(y * i64::from(width) + x) as usize] = weighted(&|k| narrow.at(x, 2 * y + k));
            }
        }
        half
    }

    /// Returns the plane at another size: halved while at least twice as large, then interpolated bilinearly between
    /// pixel centers.
    pub(super) fn resized(&self, size: (u32, u32)) -> Self {
        let mut from = self.clone();
        while from.width.div_ceil(2) >= size.0 && from.height.div_ceil(2) >= size.1 && from.size() != size {
            from = from.halved();
        }
        if from.size() == size {
            return from;
        }
        let place = |i: u32, from: u32, to: u32| (i as f32 + 0.5) * from as f32 / to as f32 - 0.5;
        let mut to = Self::zero(size);
        for y in 0..size.1 {
            let v = place(y, from.height, size.1);
            let (row, down) = (v.floor() as i64, v - v.floor());
            for x in 0..size.0 {
                let u = place(x, from.width, size.0);
                let (column, right) = (u.floor() as i64, u - u.floor());
                let across = |row: i64| from.at(column, row) * (1.0 - right) + from.at(column + 1, row) * right;
                to.values[(y * size.0 + x) as usize] = across(row) * (1.0 - down) + across(row + 1) * down;
            }
        }
        to
    }

    /// Returns the values of all local maxima: pixels not below any of their eight neighbors and above at least one.
    /// Each pixel at the rim of a plateau counts.
    pub(super) fn peaks(&self) -> Vec<f32> {
        let around = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        let is_peak = |x: i64, y: i64| {
            let here = self.at(x, y);
            let near = || around.iter().map(|&(dx, dy)| self.at(x + dx, y + dy));
            near().all(|value| value <= here) && near().any(|value| value < here)
        };
        (0..i64::from(self.height))
            .flat_map(|y| (0..i64::from(self.width)).map(move |x| (x, y)))
            .filter(|&(x, y)| is_peak(x, y))
            .map(|(x, y)| self.at(x, y))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_plane_stays_what_it_is() {
        let even = Plane::new(7, 5, vec![3.0; 35]);
        for other in [even.halved(), even.resized((13, 9)), even.resized((2, 1))] {
            assert!(other.values.iter().all(|value| (value - 3.0).abs() < 1e-6), "{other:?}");
        }
        assert_eq!(even.halved().size(), (4, 3));
        assert!(even.peaks().is_empty());
    }

    #[test]
    fn enlarging_interpolates_between_centers() {
        let two = Plane::new(2, 1, vec![0.0, 1.0]);
        assert_eq!(two.resized((4, 1)).values, [0.0, 0.25, 0.75, 1.0]);
    }

    #[test]
    fn peaks_are_found_at_the_rim_too() {
        let mut plane = Plane::zero((5, 5));
        plane.values[0] = 2.0;
        plane.values[12] = 1.0;
        let mut peaks = plane.peaks();
        peaks.sort_by(f32::total_cmp);
        assert_eq!(peaks, [1.0, 2.0]);
    }
}
