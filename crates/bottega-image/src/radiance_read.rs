//! Reading of Radiance pictures: <https://www.radiance-online.org/archived/radsite/radiance/refer/filefmts.pdf>.
//!
//! A header of lines, an empty line, a line with size and orientation, and scanlines: four bytes per pixel (three
//! mantissas and their common exponent), either uncompressed, in the old runs of whole pixels, or in runs per
//! component.

use std::io::{BufRead, ErrorKind, Read};

use glam::Vec3;

use crate::{
    ImageError, Metadata, Picture,
    colorimetry::{Chromaticities, Conversion, WhitePoint},
    limits::{Packing, check_announced},
    source::{ImageFile, PictureSource},
};

/// Maximal size of a header.
const HEADER_BYTES_MAX: u64 = 1 << 16;

/// Number of bytes that [`recognizes`] needs.
pub(crate) const MARK_BYTES: usize = 256;

/// Returns true if the first bytes of a file are those of a Radiance picture: its magic number, or a line that only
/// such a file has.
pub(crate) fn recognizes(start: &[u8]) -> bool {
    if start.starts_with(b"#?") {
        return true;
    }
    let start = String::from_utf8_lossy(&start[..start.len().min(MARK_BYTES)]);
    let has_format = start.lines().any(|line| line.starts_with("FORMAT=32-bit_rle_"));
    has_format || start.lines().next().is_some_and(|line| Size::parse(line).is_some())
}

/// The parsed header.
pub(crate) struct RadianceHeader {
    size: Size,
    /// Factor of the pixels, to undo exposure and color correction.
    factor: Vec3,
    conversion: Conversion,
    /// Notes about unsupported lines.
    notes: Vec<String>,
}

impl RadianceHeader {
    /// Returns columns and rows of the picture.
    pub(crate) fn size(&self) -> (u32, u32) {
        if self.size.is_by_columns { (self.size.lines, self.size.length) } else { (self.size.length, self.size.lines) }
    }

    /// Reads the header up to the first pixel, and checks the size.
    pub(crate) fn read<R: BufRead>(
        source: &PictureSource<'_>,
        input: &mut R,
        file_bytes: u64,
    ) -> Result<Self, ImageError> {
        let mut lines = input.by_ref().take(HEADER_BYTES_MAX);
        let mut words = HeaderWords::default();
        let size = loop {
            let line = read_line(source, &mut lines)?;
            if let Some(size) = Size::parse(&line) {
                break size;
            }
            if line.is_empty() && words.is_ended {
                return Err(malformed(source, "its header has no size"));
            }
            if words.is_ended {
                return Err(malformed(source, &format!("its size is `{}`", line.chars().take(40).collect::<String>())));
            }
            words.is_ended = line.is_empty();
            words.add(&line).map_err(|problem| malformed(source, &problem))?;
        };
        let header = words.header(size, source.white_point);
        let (width, height) = header.size();
        source.check_size(u64::from(width), u64::from(height))?;
        // A run of 127 values in each of four components takes eight bytes; 32 bits per pixel.
        check_announced((u64::from(width), u64::from(height)), 32, Packing::RUNS, file_bytes)
            .map_err(|problem| malformed(source, &problem))?;
        Ok(header)
    }
}

fn malformed(source: &PictureSource<'_>, problem: &str) -> ImageError {
    source.malformed("HDR", problem)
}

fn failed(source: &PictureSource<'_>, error: std::io::Error) -> ImageError {
    if error.kind() == ErrorKind::UnexpectedEof {
        malformed(source, "it ends too early; was it cut off?")
    } else {
        ImageError::read(source.path, error)
    }
}

/// Reads the next line, without its line feed or carriage return.
fn read_line<R: BufRead>(source: &PictureSource<'_>, lines: &mut std::io::Take<R>) -> Result<String, ImageError> {
    let mut line = Vec::new();
    lines.read_until(b'\n', &mut line).map_err(|error| failed(source, error))?;
    if line.pop() != Some(b'\n') {
        let problem = if lines.limit() == 0 { "its header does not end" } else { "it ends too early; was it cut off?" };
        return Err(malformed(source, problem));
    }
    Ok(String::from_utf8_lossy(&line).trim().to_owned())
}

/// The values of the header lines.
#[derive(Default)]
struct HeaderWords {
    is_xyz: bool,
    exposure: Option<f64>,
    correction: Option<[f64; 3]>,
    primaries: Option<[f64; 8]>,
    notes: Vec<String>,
    /// `true`: the empty line was read.
    is_ended: bool,
}

impl HeaderWords {
    /// Parses a line; ignores unknown ones.
    fn add(&mut self, line: &str) -> Result<(), String> {
        let Some((key, value)) = line.split_once('=').filter(|_| !line.starts_with('#')) else { return Ok(()) };
        let value = value.trim();
        match key.trim() {
            "FORMAT" => match value {
                "32-bit_rle_rgbe" => self.is_xyz = false,
                "32-bit_rle_xyze" => self.is_xyz = true,
                other => {
                    let shown: String = other.chars().take(40).collect();
                    return Err(format!("its format is `{shown}`, not 32-bit_rle_rgbe or 32-bit_rle_xyze"));
                }
            },
            // Several of these multiply.
            "EXPOSURE" => match numbers::<1>(value) {
                Some([exposure]) if exposure > 0.0 => *self.exposure.get_or_insert(1.0) *= exposure,
                _ => self.ignore(line),
            },
            "COLORCORR" => match numbers::<3>(value) {
                Some(factors) if factors.iter().all(|factor| *factor > 0.0) => {
                    let correction = self.correction.get_or_insert([1.0; 3]);
                    correction.iter_mut().zip(factors).for_each(|(all, factor)| *all *= factor);
                }
                _ => self.ignore(line),
            },
            "PRIMARIES" => match numbers(value) {
                Some(primaries) => self.primaries = Some(primaries),
                None => self.ignore(line),
            },
            _ => {}
        }
        Ok(())
    }

    fn ignore(&mut self, line: &str) {
        let shown: String = line.chars().take(60).collect();
        self.notes.push(format!("its header says `{shown}`, which is left out"));
    }

    fn header(mut self, size: Size, white_point: WhitePoint) -> RadianceHeader {
        let exposure = self.exposure.unwrap_or(1.0);
        let factors = self.correction.unwrap_or([1.0; 3]).map(|correction| 1.0 / (exposure * correction));
        let mut factor = Vec3::from_array(factors.map(|factor| factor as f32));
        if !(factor.is_finite() && factor.min_element() > 0.0) {
            self.notes.push("its exposure is not a usable number and is ignored".into());
            factor = Vec3::ONE;
        }
        let conversion = match self.primaries {
            // XYZ has no primaries.
            _ if self.is_xyz => Conversion::from_xyz(),
            None => Conversion::NONE,
            Some(numbers) => Chromaticities::from_numbers(numbers).to_rec709(white_point).unwrap_or_else(|problem| {
                self.notes.push(format!("{problem}, and count as those of Rec. 709"));
                Conversion::NONE
            }),
        };
        RadianceHeader { size, factor, conversion, notes: self.notes }
    }
}

/// Parses exactly `N` finite numbers.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let numbers: [f64; N] = numbers?.try_into().ok()?;
    numbers.iter().all(|number| number.is_finite()).then_some(numbers)
}

/// The number, length and orientation of the scanlines.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Size {
    lines: u32,
    length: u32,
    /// `true`: scanlines are columns.
    is_by_columns: bool,
    /// `true`: the first scanline is the lowest, or the rightmost.
    is_line_order_turned: bool,
    /// `true`: scanlines begin at the bottom, or on the right.
    is_turned_within: bool,
}

impl Size {
    /// Parses a line such as `-Y 512 +X 768`: y counts upwards, and `-` is against the axis.
    fn parse(line: &str) -> Option<Self> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let &[first, lines, second, length] = words.as_slice() else { return None };
        let is_by_columns = match (first, second) {
            ("-Y" | "+Y", "-X" | "+X") => false,
            ("-X" | "+X", "-Y" | "+Y") => true,
            _ => return None,
        };
        let is_turned = |axis: &str| matches!(axis, "+Y" | "-X");
        Some(Self {
            lines: lines.parse().ok()?,
            length: length.parse().ok()?,
            is_by_columns,
            is_line_order_turned: is_turned(first),
            is_turned_within: is_turned(second),
        })
    }

    /// Returns the index of a pixel of a scanline in the picture, row by row from the top.
    fn index(&self, line: u32, place: u32) -> usize {
        let line = if self.is_line_order_turned { self.lines - 1 - line } else { line } as usize;
        let place = if self.is_turned_within { self.length - 1 - place } else { place } as usize;
        if self.is_by_columns { place * self.lines as usize + line } else { line * self.length as usize + place }
    }
}

/// Reads the picture, and notes about omissions.
pub(crate) fn read<R: BufRead>(
    source: &PictureSource<'_>,
    mut input: R,
    file_bytes: u64,
) -> Result<(ImageFile, Vec<String>), ImageError> {
    let header = RadianceHeader::read(source, &mut input, file_bytes)?;
    let (width, height) = header.size();
    let scales = scales();
    let mut picture = Picture::new(width, height);
    let mut line = vec![[0; 4]; header.size.length as usize];
    for number in 0..header.size.lines {
        read_pixels(&mut input, &mut line).map_err(|fault| match fault {
            RadianceFault::Read(error) => failed(source, error),
            RadianceFault::Runs(problem) => malformed(source, &format!("{problem} in line {number}")),
        })?;
        for (place, &[r, g, b, exponent]) in line.iter().enumerate() {
            let color = Vec3::new(f32::from(r), f32::from(g), f32::from(b)) * scales[usize::from(exponent)];
            picture.data[header.size.index(number, place as u32)] = (color * header.factor).to_array();
        }
    }
    header.conversion.apply(&mut picture.data);
    let file = ImageFile { picture, offset: (0, 0), full_size: (width, height), metadata: Metadata::default() };
    Ok((file, header.notes))
}

/// Returns the factor of the mantissas for each exponent: 2^(exponent − 136); 0 is black.
fn scales() -> [f32; 256] {
    let mut scales = [0.0; 256];
    for (exponent, scale) in scales.iter_mut().enumerate().skip(1) {
        *scale = 2.0_f64.powi(exponent as i32 - 136) as f32;
    }
    scales
}

enum RadianceFault {
    Read(std::io::Error),
    /// A run does not fit into its scanline.
    Runs(&'static str),
}

impl From<std::io::Error> for RadianceFault {
    fn from(error: std::io::Error) -> Self {
        Self::Read(error)
    }
}

/// Reads one scanline in any of the three encodings.
fn read_pixels<R: Read>(input: &mut R, line: &mut [[u8; 4]]) -> Result<(), RadianceFault> {
    let mut first = [0; 4];
    input.read_exact(&mut first)?;
    let length = usize::from(first[2]) << 8 | usize::from(first[3]);
    if first[..2] == [2, 2] && first[2] < 128 && (8..0x8000).contains(&line.len()) {
        if length != line.len() {
            return Err(RadianceFault::Runs("a line has another length than its picture"));
        }
        return (0..4).try_for_each(|component| read_component(input, line, component));
    }
    read_whole_pixels(input, first, line)
}

/// Reads one component of a scanline: runs and literal bytes.
fn read_component<R: Read>(input: &mut R, line: &mut [[u8; 4]], component: usize) -> Result<(), RadianceFault> {
    let mut at = 0;
    while at < line.len() {
        let [count] = read_bytes(input)?;
        let is_run = count > 128;
        let count = usize::from(if is_run { count - 128 } else { count });
        let Some(to) = line.get_mut(at..at + count).filter(|to| !to.is_empty()) else {
            return Err(RadianceFault::Runs("a run does not fit"));
        };
        if is_run {
            let [value] = read_bytes(input)?;
            to.iter_mut().for_each(|pixel| pixel[component] = value);
        } else {
            for pixel in to {
                [pixel[component]] = read_bytes(input)?;
            }
        }
        at += count;
    }
    Ok(())
}

/// Reads whole pixels; `1 1 1 n` repeats the previous one, and several of these are digits of 8 bits, the lowest first.
fn read_whole_pixels<R: Read>(input: &mut R, first: [u8; 4], line: &mut [[u8; 4]]) -> Result<(), RadianceFault> {
    let (mut at, mut shift, mut pixel) = (0, 0, first);
    loop {
        if let [1, 1, 1, digit] = pixel {
            let count = usize::from(digit).checked_shl(shift).unwrap_or(usize::MAX);
            let is_possible = at > 0 && count <= line.len() - at;
            if !is_possible {
                return Err(RadianceFault::Runs("a run does not fit"));
            }
            let before = line[at - 1];
            line[at..at + count].fill(before);
            at += count;
            shift += 8;
            if shift > 24 {
                return Err(RadianceFault::Runs("a run does not end"));
            }
        } else {
            line[at] = pixel;
            at += 1;
            shift = 0;
        }
        if at >= line.len() {
            return Ok(());
        }
        pixel = read_bytes(input)?;
    }
}

fn read_bytes<R: Read, const N: usize>(input: &mut R) -> std::io::Result<[u8; N]> {
    let mut bytes = [0; N];
    input.read_exact(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::ReadLimits;

    fn read_file(header: &str, pixels: &[u8]) -> Result<(ImageFile, Vec<String>), ImageError> {
        let bytes = [header.as_bytes(), pixels].concat();
        let source = PictureSource::new(Path::new("a.hdr"), ReadLimits::default());
        assert!(recognizes(&bytes), "{header}");
        read(&source, bytes.as_slice(), bytes.len() as u64)
    }

    fn colors(header: &str, pixels: &[u8]) -> Vec<[f32; 3]> {
        read_file(header, pixels).unwrap_or_else(|error| panic!("{header:?}: {error}")).0.picture.data
    }

    /// Gray pixels of these values.
    fn gray(values: &[u8]) -> Vec<u8> {
        values.iter().flat_map(|&value| [value, value, value, 136]).collect()
    }

    #[test]
    fn all_eight_orientations_show_the_same_picture() {
        // Three columns and two rows, 10 20 30 above 40 50 60, as each orientation stores them.
        let stored: [(&str, [u8; 6]); 8] = [
            ("-Y 2 +X 3", [10, 20, 30, 40, 50, 60]),
            ("-Y 2 -X 3", [30, 20, 10, 60, 50, 40]),
            ("+Y 2 +X 3", [40, 50, 60, 10, 20, 30]),
            ("+Y 2 -X 3", [60, 50, 40, 30, 20, 10]),
            ("+X 3 -Y 2", [10, 40, 20, 50, 30, 60]),
            ("+X 3 +Y 2", [40, 10, 50, 20, 60, 30]),
            ("-X 3 -Y 2", [30, 60, 20, 50, 10, 40]),
            ("-X 3 +Y 2", [60, 30, 50, 20, 40, 10]),
        ];
        for (size, values) in stored {
            let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n");
            let (file, _) = read_file(&header, &gray(&values)).unwrap();
            assert_eq!(file.picture.size(), (3, 2), "{size}");
            let values: Vec<f32> = file.picture.data.iter().map(|color| color[0]).collect();
            assert_eq!(values, [10.0, 20.0, 30.0, 40.0, 50.0, 60.0], "{size}");
        }
    }

    #[test]
    fn headers_differ_in_marks_and_line_ends() {
        for start in [
            "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n",
            "#?RGBE\r\n# made by hand\r\nFORMAT = 32-bit_rle_rgbe\r\n\r\n",
            "#?AUTOPANO\nrpict -vp 0 0 0\n\tVIEW= -vh 30\n\n",
            "FORMAT=32-bit_rle_rgbe\nPIXASPECT=2\n\n",
            "SOFTWARE=by hand\nFORMAT=32-bit_rle_rgbe\n\n",
            "",
        ] {
            let end = if start.contains('\r') { "\r\n" } else { "\n" };
            assert_eq!(colors(&format!("{start}-Y 1 +X 2{end}"), &gray(&[7, 9])), [[7.0; 3], [9.0; 3]], "{start:?}");
        }
    }

    #[test]
    fn exposure_and_color_correction_are_divided_out() {
        let header = |lines: &str| format!("#?RADIANCE\n{lines}FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n");
        let one = |lines: &str| colors(&header(lines), &gray(&[64]))[0];
        assert_eq!(one("EXPOSURE=2.0\n"), [32.0; 3]);
        assert_eq!(one("EXPOSURE= 2\nEXPOSURE=4\n"), [8.0; 3]);
        assert_eq!(one("COLORCORR= 1 2 4\nEXPOSURE=2\nCOLORCORR=2 1 1\n"), [16.0, 16.0, 8.0]);
        for lines in ["EXPOSURE=0\n", "EXPOSURE=-1\n", "EXPOSURE=nan\n", "COLORCORR=1 2\n", "PRIMARIES=1 2 3\n"] {
            let (file, notes) = read_file(&header(lines), &gray(&[64])).unwrap();
            assert!(notes.len() == 1 && notes[0].contains(lines.trim_end()), "{notes:?}");
            assert_eq!(file.picture.data, [[64.0; 3]]);
        }
        let vanishing = "EXPOSURE=1e30\n".repeat(3);
        assert_eq!(read_file(&header(&vanishing), &gray(&[64])).unwrap().1.len(), 1);
    }

    #[test]
    fn colors_are_those_of_the_primaries_or_of_the_observer() {
        // Red of Rec. 709 in CIE XYZ: 0.4124 0.2126 0.0193.
        let header = "#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n";
        let [r, g, b] = colors(header, &[211, 109, 10, 127])[0];
        assert!((r - 1.0).abs() < 0.01 && g.abs() < 0.01 && b.abs() < 0.01, "{r} {g} {b}");
        let rec2020 = "PRIMARIES=0.708 0.292 0.17 0.797 0.131 0.046 0.3127 0.329\n";
        let header = format!("#?RADIANCE\n{rec2020}FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n");
        let [r, g, b] = colors(&header, &[100, 10, 10, 136])[0];
        assert!((r - 159.44).abs() < 0.1 && (g + 1.21).abs() < 0.1 && (b - 8.366).abs() < 0.1, "{r} {g} {b}");
    }

    #[test]
    fn old_runs_repeat_the_pixel_before() {
        let header = "#?RADIANCE\n\n-Y 1 +X 517\n";
        let pixels = [gray(&[3]), vec![1, 1, 1, 2, 1, 1, 1, 2], gray(&[5, 6])].concat();
        let values: Vec<f32> = colors(header, &pixels).iter().map(|color| color[0]).collect();
        assert!(values[..515].iter().all(|&value| value == 3.0));
        assert_eq!(values[515..], [5.0, 6.0]);
    }

    #[test]
    fn damaged_files_are_refused() {
        let header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 9\n";
        for pixels in [
            // Wrong length, run beyond the end, empty run, old run before any pixel, old run too long, data cut off.
            &[2, 2, 0, 8, 137, 1, 137, 1, 137, 1, 137, 1][..],
            &[2, 2, 0, 9, 138, 1, 137, 1, 137, 1, 137, 1],
            &[2, 2, 0, 9, 0, 1, 137, 1, 137, 1, 137, 1],
            &[1, 1, 1, 9, 0, 0, 0, 0],
            &[9, 9, 9, 9, 1, 1, 1, 9],
            &[2, 2, 0, 9],
        ] {
            let error = read_file(header, pixels).unwrap_err();
            assert!(matches!(error, ImageError::Malformed { format: "HDR", .. }), "{error}");
        }
        for header in [
            "#?RADIANCE\nFORMAT=32-bit_rle_abcd\n\n-Y 1 +X 1\n".to_owned(),
            "#?RADIANCE\n\n\n-Y 1 +X 1\n".to_owned(),
            "#?RADIANCE\n\n-Y 1 +Y 1\n".to_owned(),
            format!("#?RADIANCE\n{}", "A=1\n".repeat(30_000)),
            "#?RADIANCE\n\n-Y 10000 +X 10000\n".to_owned(),
        ] {
            assert!(matches!(read_file(&header, &gray(&[1])), Err(ImageError::Malformed { .. })), "{header:.60}");
        }
    }
}
