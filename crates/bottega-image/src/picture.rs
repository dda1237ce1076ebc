//! Pictures: RGB of a film, a reference or a file.

/// Returns the luminance of linear Rec. 709 RGB.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// A rectangle of linear Rec. 709 RGB values, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width, in pixels.
    pub width: u32,
    /// Height, in pixels.
    pub height: u32,
    /// Pixels, `[height × width]`, row by row from the top.
    pub data: Vec<[f32; 3]>,
}

impl Picture {
    /// Returns a black picture. `width` and `height` are in pixels.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, data: vec![[0.0; 3]; width as usize * height as usize] }
    }

    /// Returns the picture whose pixel (x, y) is `color(x, y)`.
    pub fn from_fn(width: u32, height: u32, mut color: impl FnMut(u32, u32) -> [f32; 3]) -> Self {
        let data = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| color(x, y)).collect();
        Self { width, height, data }
    }

    /// Returns width and height, in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns pixel (x, y). Panics if it is outside.
    pub fn pixel(&self, x: u32, y: u32) -> [f32; 3] {
        assert!(x < self.width && y < self.height, "pixel {x},{y} outside a picture");
        self.data[y as usize * self.width as usize + x as usize]
    }

    /// Returns the part inside `rect`. Panics if that is not within the picture.
    #[must_use]
    pub fn cropped(&self, rect: crate::Rect) -> Self {
        Self::from_fn(rect.width(), rect.height(), |x, y| self.pixel(rect.x0 + x, rect.y0 + y))
    }
}
