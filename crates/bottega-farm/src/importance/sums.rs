//! Summed-area tables: values per cell, with their integral over any rectangle of pixels in constant time.

use bottega_image::Rect;

/// Values of cells that cover a picture evenly, with their summed-area table.
///
/// Source: Crow 1984, *Summed-Area Tables for Texture Mapping*.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sums {
    surveyed: Rect,
    width: u32,
    height: u32,
    /// The values, row-major, `[width × height]`.
    values: Vec<f32>,
    /// The sums, row-major, `[(width + 1) × (height + 1)]`.
    sums: Vec<f64>,
}

impl Sums {
    /// Sums values over cells, for queries in constant time.
    ///
    /// - `surveyed`: the pixels that the cells cover.
    /// - `values`: `[width × height]`, row-major; panics if the length differs.
    pub(super) fn new(surveyed: Rect, (width, height): (u32, u32), values: Vec<f32>) -> Self {
        assert_eq!(values.len(), width as usize * height as usize, "values of {width} × {height} cells");
        let sums = summed(width as usize, height as usize, &values);
        Self { surveyed, width, height, values, sums }
    }

    /// Returns the same grid of cells with each value mapped.
    pub(super) fn map(&self, value: impl Fn(f32) -> f32) -> Self {
        Self::new(self.surveyed, self.size(), self.values.iter().map(|&old| value(old)).collect())
    }

    /// Returns the numbers of columns and rows of cells.
    pub(super) fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the value of each cell, row-major.
    pub(super) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns the sum over the pixels of `rect` of the values of their cells. Panics if `rect` reaches beyond the
    /// surveyed picture.
    pub(super) fn integral(&self, rect: &Rect) -> f64 {
        assert!(self.surveyed.encloses(rect), "{rect} is not in the surveyed picture {}", self.surveyed);
        let pixels_per_cell = self.surveyed.area() as f64 / (f64::from(self.width) * f64::from(self.height));
        let cells =
            self.sum_before(rect.x1, rect.y1) - self.sum_before(rect.x0, rect.y1) - self.sum_before(rect.x1, rect.y0)
                + self.sum_before(rect.x0, rect.y0);
        cells * pixels_per_cell
    }

    /// Returns the sum of everything above and left of a pixel's corner, in cells. The integral of a function that is
    /// constant per cell is bilinear in each cell, so bilinear interpolation is exact.
    fn sum_before(&self, x: u32, y: u32) -> f64 {
        let (column, u) = cell_of(x - self.surveyed.x0, self.surveyed.width(), self.width);
        let (row, v) = cell_of(y - self.surveyed.y0, self.surveyed.height(), self.height);
        let stride = self.width as usize + 1;
        let at = |column: usize, row: usize| self.sums[row * stride + column];
        let (next_column, next_row) = ((column + 1).min(self.width as usize), (row + 1).min(self.height as usize));
        let above = at(column, row) * (1.0 - u) + at(next_column, row) * u;
        let below = at(column, next_row) * (1.0 - u) + at(next_column, next_row) * u;
        above * (1.0 - v) + below * v
    }
}

/// Returns the cell that contains a pixel's edge, and the position in it, 0..1.
fn cell_of(offset: u32, pixels: u32, cells: u32) -> (usize, f64) {
    // Integer arithmetic, so that rounding never misses a cell's edge.
    let scaled = u64::from(offset) * u64::from(cells);
    let cell = scaled / u64::from(pixels);
    (cell as usize, (scaled % u64::from(pixels)) as f64 / f64::from(pixels))
}

fn summed(width: usize, height: usize, values: &[f32]) -> Vec<f64> {
    let stride = width + 1;
    let mut sums = vec![0.0; stride * (height + 1)];
    for y in 0..height {
        let mut row = 0.0;
        for x in 0..width {
            row += f64::from(values[y * width + x]);
            sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row;
        }
    }
    sums
}
