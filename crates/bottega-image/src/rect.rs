//! Rectangles of pixels.

/// A rectangle of pixels, half open: `x0 <= x < x1`, `y0 <= y < y1`. The origin is the upper left corner of the
/// picture; y grows downwards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Rect {
    /// First column of pixels.
    pub x0: u32,
    /// First row of pixels.
    pub y0: u32,
    /// One past the last column.
    pub x1: u32,
    /// One past the last row.
    pub y1: u32,
}

/// A value for each side of a rectangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Sides<T> {
    /// Value at the least x.
    pub left: T,
    /// Value at the least y.
    pub top: T,
    /// Value at the greatest x.
    pub right: T,
    /// Value at the greatest y.
    pub bottom: T,
}

impl<T> Sides<T> {
    /// Returns sides that all have one value.
    pub fn all(value: T) -> Self
    where
        T: Copy,
    {
        Self { left: value, top: value, right: value, bottom: value }
    }

    /// Returns the values of a function for each side.
    pub fn map<U>(self, mut to: impl FnMut(T) -> U) -> Sides<U> {
        Sides { left: to(self.left), top: to(self.top), right: to(self.right), bottom: to(self.bottom) }
    }

    /// Returns the values: left, top, right, bottom.
    pub fn into_array(self) -> [T; 4] {
        [self.left, self.top, self.right, self.bottom]
    }
}

impl Rect {
    /// Returns the rectangle from the corner (x0, y0) to the corner (x1, y1), whose column and row are outside. Panics
    /// if a side is negative.
    pub fn new(x0: u32, y0: u32, x1: u32, y1: u32) -> Self {
        assert!(x0 <= x1 && y0 <= y1, "rectangle with negative side: {x0},{y0},{x1},{y1}");
        Self { x0, y0, x1, y1 }
    }

    /// Returns the rectangle of a whole picture, in pixels.
    pub fn of_size(width: u32, height: u32) -> Self {
        Self { x0: 0, y0: 0, x1: width, y1: height }
    }

    /// Returns the number of columns.
    pub fn width(&self) -> u32 {
        self.x1 - self.x0
    }

    /// Returns the number of rows.
    pub fn height(&self) -> u32 {
        self.y1 - self.y0
    }

    /// Returns the number of pixels.
    pub fn area(&self) -> u64 {
        u64::from(self.width()) * u64::from(self.height())
    }

    /// Returns true if the rectangle contains no pixel.
    pub fn is_empty(&self) -> bool {
        self.x0 >= self.x1 || self.y0 >= self.y1
    }

    /// Returns true if pixel (x, y) is inside.
    pub fn contains(&self, x: u32, y: u32) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
    }

    /// Returns true if every pixel of `other` is inside.
    pub fn encloses(&self, other: &Self) -> bool {
        self.x0 <= other.x0 && self.y0 <= other.y0 && self.x1 >= other.x1 && self.y1 >= other.y1
    }

    /// Returns the intersection; `None` if it contains no pixel.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let r = Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        };
        (r.x0 < r.x1 && r.y0 < r.y1).then_some(r)
    }

    /// Returns the rectangle grown by `margin` pixels on every side, but not beyond `limit`.
    pub fn grown(&self, margin: u32, limit: &Self) -> Self {
        self.grown_by(Sides::all(margin), limit)
    }

    /// Returns the rectangle grown by a margin in pixels for each side, but not beyond `limit`.
    pub fn grown_by(&self, margins: Sides<u32>, limit: &Self) -> Self {
        Self {
            x0: self.x0.saturating_sub(margins.left).max(limit.x0),
            y0: self.y0.saturating_sub(margins.top).max(limit.y0),
            x1: self.x1.saturating_add(margins.right).min(limit.x1),
            y1: self.y1.saturating_add(margins.bottom).min(limit.y1),
        }
    }

    /// Returns the index of pixel (x, y) in row-major order within this rectangle. The pixel must be inside.
    pub fn index(&self, x: u32, y: u32) -> usize {
        debug_assert!(self.contains(x, y));
        (y - self.y0) as usize * self.width() as usize + (x - self.x0) as usize
    }

    /// Iterates over all pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let r = *self;
        (r.y0..r.y1).flat_map(move |y| (r.x0..r.x1).map(move |x| (x, y)))
    }

    /// Returns the rectangle's blocks of at most `side` × `side` pixels, aligned to multiples of `side`, row by row.
    /// Panics if `side` is 0.
    pub fn blocks(&self, side: u32) -> impl Iterator<Item = Self> + use<> {
        assert!(side > 0);
        let r = *self;
        let first = move |v: u32| v / side;
        let last = move |v: u32| v.div_ceil(side);
        (first(r.y0)..last(r.y1)).flat_map(move |by| {
            (first(r.x0)..last(r.x1)).filter_map(move |bx| {
                let block = Self {
                    x0: bx * side,
                    y0: by * side,
                    x1: (bx + 1).saturating_mul(side),
                    y1: (by + 1).saturating_mul(side),
                };
                block.intersection(&r)
            })
        })
    }
}

impl std::fmt::Display for Rect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{},{},{},{}", self.x0, self.y0, self.x1, self.y1)
    }
}
