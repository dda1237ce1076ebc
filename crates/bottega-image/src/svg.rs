//! SVG drawings.

use std::fmt::{Display, Write};

/// An unfinished drawing, on white.
#[derive(Clone, Debug)]
pub struct Svg(String);

impl Svg {
    /// Starts an empty drawing.
    ///
    /// - `width`, `height`, `font_size`: in pixels.
    pub fn new(width: f64, height: f64, font_size: u32) -> Self {
        Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"{font_size}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
        ))
    }

    /// Appends SVG elements and a line break.
    pub fn put(&mut self, elements: impl Display) {
        // Writing to a string cannot fail.
        _ = writeln!(self.0, "{elements}");
    }

    /// Adds a text, escaped, with its left end at a position unless an attribute says otherwise.
    ///
    /// - `[x, y]`: position of its base line, in pixels from the upper left.
    /// - `attributes`: attributes other than the position, such as `fill="red"`.
    pub fn text(&mut self, [x, y]: [f64; 2], attributes: &str, text: impl Display) {
        let text = svg_text(&text.to_string());
        let space = if attributes.is_empty() { "" } else { " " };
        self.put(format_args!("<text x=\"{x:.1}\" y=\"{y:.1}\"{space}{attributes}>{text}</text>"));
    }

    /// Finishes the drawing. Returns its SVG text.
    pub fn finish(mut self) -> String {
        self.0.push_str("</svg>\n");
        self.0
    }
}

/// Returns a text escaped for an element or attribute. Control characters become spaces.
pub fn svg_text(text: &str) -> String {
    let mut out = String::new();
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // XML does not allow these.
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            control if control.is_control() => out.push(' '),
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_others_are_no_markup() {
        let mut svg = Svg::new(10.0, 20.5, 11);
        svg.text([1.0, 2.25], "fill=\"red\"", "a<b> & \"c\"\u{1}");
        svg.put("<path d=\"M0 0h1\"/>");
        let text = svg.finish();
        assert!(text.contains("viewBox=\"0 0 10 20.5\""), "{text}");
        assert!(
            text.contains("<text x=\"1.0\" y=\"2.2\" fill=\"red\">a&lt;b&gt; &amp; &quot;c&quot; </text>"),
            "{text}"
        );
        assert!(text.ends_with("<path d=\"M0 0h1\"/>\n</svg>\n"), "{text}");
    }
}
