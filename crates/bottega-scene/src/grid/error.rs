//! Errors of making a grid.

/// The reason why arrays cannot become a [`Grid`](crate::Grid).
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GridError {
    /// The grid has no cells or too many.
    #[error("a grid cannot have {} × {} × {} cells", .0[0], .0[1], .0[2])]
    Size([u32; 3]),
    /// The number of values does not match the size.
    #[error("a grid of {cells} cells has {values} values")]
    Count {
        /// Number of cells.
        cells: usize,
        /// Number of values given.
        values: usize,
    },
    /// The table of bricks names some that are not there.
    #[error("the table of a grid names bricks beyond the {stored} that it has")]
    Bricks {
        /// Number of bricks with values.
        stored: usize,
    },
}
