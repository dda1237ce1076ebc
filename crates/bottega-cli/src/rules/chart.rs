//! Figures that can be drawn as SVG or PNG.

use std::{path::Path, sync::Once};

use bottega_image::{Canvas, write_whole};
use plotters::{
    coord::Shift,
    prelude::*,
    style::{FontStyle, register_font},
};

use crate::error::CliError;

/// DejaVu Sans, ASCII and a few more characters: a PNG must not depend on the machine's fonts. The licence is in the same folder.
const FONT: &[u8] = include_bytes!("../../assets/DejaVuSans-ASCII.ttf");

/// The font of figures. In an SVG the viewer's own font of that family is used.
pub(super) const FONT_NAME: &str = "sans-serif";

/// A drawing area.
pub(super) type Area<B> = DrawingArea<B, Shift>;

/// The result of drawing.
pub(super) type DrawResult<B> = Result<(), DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;

/// A figure that can be drawn.
pub(super) trait Figure {
    /// Returns width and height in pixels.
    fn size(&self) -> (u32, u32);

    /// Draws the figure on a white area of that size.
    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> DrawResult<B>;
}

#[derive(Clone, Copy)]
pub(super) enum FigureFormat {
    Svg,
    Png,
}

impl FigureFormat {
    /// Returns the format for the extension of a file.
    pub(super) fn of(path: &Path) -> Result<Self, CliError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            _ => Err(CliError::usage(
                format!("`{}` does not name a format of figures", path.display()),
                "end its name in .svg or .png",
            )),
        }
    }
}

/// Draws a figure and writes it atomically.
pub(super) fn write(figure: &impl Figure, format: FigureFormat, path: &Path) -> Result<(), CliError> {
    static FONT_ONCE: Once = Once::new();
    FONT_ONCE.call_once(|| {
        // Registration cannot fail for this font; the tests draw with it.
        _ = register_font(FONT_NAME, FontStyle::Normal, FONT);
    });
    let (width, height) = figure.size();
    let failed = |error: String| CliError::failed("cannot draw the figure", error);
    match format {
        FigureFormat::Svg => {
            let mut text = String::new();
            draw(figure, SVGBackend::with_string(&mut text, (width, height))).map_err(failed)?;
            write_whole(path, text.as_bytes())?;
        }
        FigureFormat::Png => {
            let mut canvas = Canvas::new(width, height, [255; 3]);
            let pixels = canvas.pixels.as_flattened_mut();
            draw(figure, BitMapBackend::with_buffer(pixels, (width, height))).map_err(failed)?;
            canvas.write_png(path)?;
        }
    }
    Ok(())
}

fn draw<B: DrawingBackend>(figure: &impl Figure, backend: B) -> Result<(), String> {
    let area = backend.into_drawing_area();
    let drawn = area.fill(&WHITE).and_then(|()| figure.draw(&area)).and_then(|()| area.present());
    drawn.map_err(|error| error.to_string())
}
