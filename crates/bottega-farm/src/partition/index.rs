//! A spatial index of rectangles.

use bottega_image::Rect;

/// A uniform grid over a frame that finds rectangles by position, with about as many cells as rectangles.
pub(crate) struct ZoneIndex<'a> {
    frame: Rect,
    zones: &'a [Rect],
    side: u32,
    columns: u32,
    cells: Vec<Vec<u32>>,
}

impl<'a> ZoneIndex<'a> {
    /// Makes an index of zones by position.
    ///
    /// - `zones`: rectangles within `frame`, which is not empty unless there are none.
    pub(crate) fn new(frame: Rect, zones: &'a [Rect]) -> Self {
        let area_per_zone = frame.area() / (zones.len() as u64).max(1);
        let side = (area_per_zone.isqrt() as u32).max(1);
        let columns = frame.width().div_ceil(side);
        let rows = frame.height().div_ceil(side);
        let mut cells = vec![Vec::new(); columns as usize * rows as usize];
        let mut index = Self { frame, zones, side, columns, cells: Vec::new() };
        for (i, zone) in zones.iter().enumerate() {
            for cell in index.cells_of(zone) {
                cells[cell].push(i as u32);
            }
        }
        index.cells = cells;
        index
    }

    fn cells_of(&self, rect: &Rect) -> impl Iterator<Item = usize> + use<> {
        let (frame, side, columns) = (self.frame, self.side, self.columns);
        let rect = rect.intersection(&frame).unwrap_or_default();
        let columns_hit =
            if rect.is_empty() { 0..0 } else { (rect.x0 - frame.x0) / side..(rect.x1 - frame.x0).div_ceil(side) };
        let rows_hit =
            if rect.is_empty() { 0..0 } else { (rect.y0 - frame.y0) / side..(rect.y1 - frame.y0).div_ceil(side) };
        rows_hit.flat_map(move |row| {
            columns_hit.clone().map(move |column| row as usize * columns as usize + column as usize)
        })
    }

    /// Returns the indices of all rectangles that share a pixel with `rect`, ascending.
    pub(crate) fn touching(&self, rect: &Rect) -> impl Iterator<Item = usize> + use<> {
        let mut found: Vec<usize> = self
            .cells_of(rect)
            .flat_map(|cell| self.cells[cell].iter().map(|&i| i as usize))
            .filter(|&i| self.zones[i].intersection(rect).is_some())
            .collect();
        found.sort_unstable();
        found.dedup();
        found.into_iter()
    }
}

/// Returns the multiple of `grid` nearest to `at`.
pub(crate) fn nearest_multiple(at: u32, grid: u32) -> u32 {
    at.saturating_add(grid / 2) / grid.max(1) * grid.max(1)
}
