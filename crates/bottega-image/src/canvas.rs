//! 8-bit pictures for display: heat maps, importance maps, zones, comparisons.

use std::path::Path;

use crate::{
    ColorMap, ImageError, Picture, Rect, ToneMap, displayed,
    png_write::{png_bytes_rgb8, write_png_rgb8},
    srgb_from_linear,
};

/// A picture of 8-bit sRGB values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Canvas {
    /// Width, in pixels.
    pub width: u32,
    /// Height, in pixels.
    pub height: u32,
    /// Pixels, `[height × width]`, row by row from the top.
    pub pixels: Vec<[u8; 3]>,
}

impl Canvas {
    /// Returns a canvas of one color. `width` and `height` are in pixels.
    pub fn new(width: u32, height: u32, color: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![color; width as usize * height as usize] }
    }

    /// Returns a picture as a display shows it, without dithering.
    ///
    /// - `exposure_stops`: exposure in stops; positive: brighter.
    pub fn of_picture(picture: &Picture, exposure_stops: f32, tone: ToneMap) -> Self {
        let pixels = picture.data.iter().map(|&color| shown(displayed(color, exposure_stops, tone))).collect();
        Self { width: picture.width, height: picture.height, pixels }
    }

    /// Returns a picture of values in false colors.
    ///
    /// - `values`: `[height × width]`; panics if the length differs.
    /// - `white`: the value of the brightest color, 1 if it is not positive; the darkest is at 0.
    pub fn heat_map(width: u32, height: u32, values: &[f32], white: f32, colors: ColorMap) -> Self {
        assert_eq!(values.len(), width as usize * height as usize, "values of a map of {width} × {height}");
        let scale = if white > 0.0 { 1.0 / white } else { 1.0 };
        Self { width, height, pixels: values.iter().map(|value| colors.color(value * scale)).collect() }
    }

    /// Returns a picture of values in shades of gray, from black at 0 to white at 1.
    ///
    /// - `values`: `[height × width]`; panics if the length differs.
    pub fn gray_map(width: u32, height: u32, values: &[f32]) -> Self {
        assert_eq!(values.len(), width as usize * height as usize, "values of a map of {width} × {height}");
        let gray = |value: &f32| [(value.clamp(0.0, 1.0) * 255.0).round() as u8; 3];
        Self { width, height, pixels: values.iter().map(gray).collect() }
    }

    /// Draws the outline of `rect`, one pixel wide, along its inside, clipped to the canvas.
    pub fn draw_rect(&mut self, rect: Rect, color: [u8; 3]) {
        if rect.is_empty() {
            return;
        }
        let Rect { x0, y0, x1, y1 } = rect;
        let edges = [
            Rect { y1: y0 + 1, ..rect },
            Rect { y0: y1 - 1, ..rect },
            Rect { x1: x0 + 1, ..rect },
            Rect { x0: x1 - 1, ..rect },
        ];
        edges.into_iter().for_each(|edge| self.fill_rect(edge, color));
    }

    /// Fills the part of `rect` that is on the canvas.
    pub fn fill_rect(&mut self, rect: Rect, color: [u8; 3]) {
        let whole = Rect::of_size(self.width, self.height);
        let Some(part) = rect.intersection(&whole) else { return };
        for y in part.y0..part.y1 {
            let start = whole.index(part.x0, y);
            self.pixels[start..start + part.width() as usize].fill(color);
        }
    }

    /// Returns the canvas with every pixel enlarged to a block of `factor` × `factor`.
    #[must_use]
    pub fn enlarged(&self, factor: u32) -> Self {
        let (width, height) = (self.width * factor, self.height * factor);
        let whole = Rect::of_size(self.width, self.height);
        let pixel = |(x, y): (u32, u32)| self.pixels[whole.index(x / factor, y / factor)];
        Self { width, height, pixels: Rect::of_size(width, height).pixels().map(pixel).collect() }
    }

    /// Returns a canvas with the given ones side by side, aligned at the top, with `gap` white pixels between them. It
    /// is as tall as the tallest.
    pub fn beside(canvases: &[Self], gap: u32) -> Self {
        let width = canvases.iter().map(|c| c.width).sum::<u32>() + gap * (canvases.len().max(1) as u32 - 1);
        let height = canvases.iter().map(|c| c.height).max().unwrap_or(0);
        let mut all = Self::new(width, height, [255; 3]);
        let mut left = 0;
        for canvas in canvases {
            for y in 0..canvas.height {
                let from = (y * canvas.width) as usize;
                let to = y as usize * width as usize + left as usize;
                let row = canvas.width as usize;
                all.pixels[to..to + row].copy_from_slice(&canvas.pixels[from..from + row]);
            }
            left += canvas.width + gap;
        }
        all
    }

    /// Encodes the canvas as a PNG file.
    ///
    /// # Errors
    ///
    /// The canvas has no pixels, or more than a PNG file can have.
    pub fn to_png(&self) -> Result<Vec<u8>, ImageError> {
        let width = self.width as usize;
        png_bytes_rgb8((self.width, self.height), |row, out| {
            let row = row as usize * width;
            out.extend_from_slice(self.pixels[row..row + width].as_flattened());
        })
    }

    /// Writes the canvas as PNG, atomically: the file is complete or unchanged.
    ///
    /// # Errors
    /// The canvas has no pixels, or the file cannot be written.
    pub fn write_png(&self, path: impl AsRef<Path>) -> Result<(), ImageError> {
        write_png_rgb8(path, self.width, self.height, self.pixels.as_flattened())
    }
}

/// Encodes linear display values as 8-bit sRGB.
pub(crate) fn shown(display: [f32; 3]) -> [u8; 3] {
    display.map(|value| (srgb_from_linear(value) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [u8; 3] = [255, 0, 0];

    #[test]
    fn an_outline_is_one_pixel_wide_inside_and_clipped() {
        let mut canvas = Canvas::new(6, 5, [0; 3]);
        canvas.draw_rect(Rect::new(1, 1, 4, 4), RED);
        let red: Vec<usize> = (0..30).filter(|&i| canvas.pixels[i] == RED).collect();
        assert_eq!(red, [7, 8, 9, 13, 15, 19, 20, 21]);
        canvas.draw_rect(Rect::new(4, 3, 90, 90), RED);
        assert_eq!(canvas.pixels[3 * 6 + 5], RED);
        canvas.draw_rect(Rect::new(2, 2, 2, 9), RED);
        assert_eq!(canvas.pixels[2 * 6 + 2], [0; 3]);
    }

    #[test]
    fn canvases_stand_beside_each_other() {
        let (a, b) = (Canvas::new(2, 1, RED), Canvas::new(1, 2, [0; 3]));
        let both = Canvas::beside(&[a, b], 1);
        assert_eq!((both.width, both.height), (4, 2));
        let w = [255; 3];
        assert_eq!(both.pixels, [RED, RED, w, [0; 3], w, w, w, [0; 3]]);
        assert_eq!(both.enlarged(3).pixels[3 * 12 + 6], w);
        assert_eq!(Canvas::beside(&[], 1).pixels.len(), 0);
    }

    #[test]
    fn a_written_canvas_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        Canvas::heat_map(3, 1, &[0.0, 1.0, 2.0], 2.0, ColorMap::Inferno).write_png(&path).unwrap();
        let read = crate::read_picture(&path).unwrap();
        let again = Canvas::of_picture(&read, 0.0, ToneMap::Linear);
        assert_eq!(again.pixels, [0.0, 0.5, 1.0].map(crate::false_color));
    }
}
