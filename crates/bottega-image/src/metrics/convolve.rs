//! Planes of floats, and convolution with separable kernels.

/// One value per pixel, row-major.
#[derive(Clone)]
pub(super) struct FloatPlane {
    /// Values per row.
    pub(super) width: usize,
    pub(super) values: Vec<f32>,
}

impl FloatPlane {
    /// Makes a plane of rows of `width` values.
    pub(super) fn new(width: usize, values: Vec<f32>) -> Self {
        Self { width, values }
    }

    /// Convolves with the product of two centered kernels of odd length; outside, the nearest edge pixel is used.
    pub(super) fn convolved(&self, along_x: &[f32], along_y: &[f32]) -> Self {
        self.convolved_x(along_x).convolved_y(along_y)
    }

    /// Convolves each row with a kernel.
    pub(super) fn convolved_x(&self, kernel: &[f32]) -> Self {
        let (width, radius) = (self.width, kernel.len() / 2);
        let mut values = vec![0.0; self.values.len()];
        let mut padded = vec![0.0; width + 2 * radius];
        for (from, to) in self.values.chunks_exact(width).zip(values.chunks_exact_mut(width)) {
            padded[..radius].fill(from[0]);
            padded[radius..radius + width].copy_from_slice(from);
            padded[radius + width..].fill(from[width - 1]);
            for (shift, &weight) in kernel.iter().enumerate() {
                add_scaled(to, &padded[shift..shift + width], weight);
            }
        }
        Self { width, values }
    }

    /// Convolves each column with a kernel.
    pub(super) fn convolved_y(&self, kernel: &[f32]) -> Self {
        let (width, radius) = (self.width, kernel.len() / 2);
        let height = self.values.len() / width;
        let mut values = vec![0.0; self.values.len()];
        for (y, to) in values.chunks_exact_mut(width).enumerate() {
            for (shift, &weight) in kernel.iter().enumerate() {
                let from = (y + shift).saturating_sub(radius).min(height - 1);
                add_scaled(to, &self.values[from * width..(from + 1) * width], weight);
            }
        }
        Self { width, values }
    }
}

fn add_scaled(to: &mut [f32], from: &[f32], weight: f32) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += weight * from;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_separable_convolution_is_that_with_the_product(
            width in 1usize..9,
            height in 1usize..9,
            kx in prop::collection::vec(-1.0f32..1.0, 5),
            ky in prop::collection::vec(-1.0f32..1.0, 3),
        ) {
            let values: Vec<f32> = (0..width * height).map(|i| ((i * 37) % 11) as f32).collect();
            let plane = FloatPlane::new(width, values);
            let result = plane.convolved(&kx, &ky);
            let at = |x: i64, y: i64| {
                let (x, y) = (x.clamp(0, width as i64 - 1) as usize, y.clamp(0, height as i64 - 1) as usize);
                plane.values[y * width + x]
            };
            for y in 0..height as i64 {
                for x in 0..width as i64 {
                    let mut expected = 0.0;
                    for j in 0..3 {
                        for i in 0..5 {
                            expected += kx[i as usize] * ky[j as usize] * at(x + i - 2, y + j - 1);
                        }
                    }
                    let got = result.values[y as usize * width + x as usize];
                    prop_assert!((got - expected).abs() < 1e-4, "{} {}", got, expected);
                }
            }
        }
    }
}
