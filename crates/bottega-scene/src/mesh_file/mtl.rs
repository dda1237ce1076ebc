//! MTL, material libraries of OBJ files, with the common extension for physically based rendering.

use std::path::Path;

use glam::{Vec2, Vec3};

use super::lines::{self, LineFault, LocatedFault, float, next_word};
use super::source::MeshSource;
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::text::{Text, decode, shortened};

/// A material of the file. `None`: not given.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MtlMaterial {
    /// Name after `newmtl`.
    pub(crate) name: String,
    /// Line of `newmtl`.
    pub(crate) line: usize,
    /// `Kd`: diffuse reflectance.
    pub(crate) diffuse: Option<Vec3>,
    /// `Ks`: specular reflectance.
    pub(crate) specular: Option<Vec3>,
    /// `Ke`: emitted colour.
    pub(crate) emission: Option<Vec3>,
    /// `Ns`: exponent of a Phong highlight.
    pub(crate) exponent: Option<f32>,
    /// `Ni`: index of refraction.
    pub(crate) ior: Option<f32>,
    /// `d`, or 1 − `Tr`: opacity.
    pub(crate) opacity: Option<f32>,
    /// `Tf`: colour of the transmitted light.
    pub(crate) transmission: Option<Vec3>,
    /// `Pr`: perceptual roughness.
    pub(crate) roughness: Option<f32>,
    /// `Pm`: metalness, 0 to 1.
    pub(crate) metallic: Option<f32>,
    /// `illum`: illumination model.
    pub(crate) illum: Option<u32>,
    /// `map_Kd`: map of [`diffuse`](Self::diffuse).
    pub(crate) diffuse_map: Option<MtlMap>,
    /// `map_Ks`: map of [`specular`](Self::specular).
    pub(crate) specular_map: Option<MtlMap>,
    /// `map_Ke`: map of [`emission`](Self::emission).
    pub(crate) emission_map: Option<MtlMap>,
    /// `map_d`: map of [`opacity`](Self::opacity).
    pub(crate) opacity_map: Option<MtlMap>,
    /// `map_Pr`: map of [`roughness`](Self::roughness).
    pub(crate) roughness_map: Option<MtlMap>,
    /// `map_Pm`: map of [`metallic`](Self::metallic).
    pub(crate) metallic_map: Option<MtlMap>,
    /// `map_bump` or `bump`: heights.
    pub(crate) bump_map: Option<MtlMap>,
    /// `norm`: a normal map.
    pub(crate) normal_map: Option<MtlMap>,
}

/// A picture with its options.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MtlMap {
    /// Reference in the file, relative to the folder of the library.
    pub(crate) reference: String,
    /// Line of the statement.
    pub(crate) line: usize,
    /// `-s`: factor of the texture coordinates.
    pub(crate) scale: Vec2,
    /// `-o`: offset of the texture coordinates.
    pub(crate) offset: Vec2,
    /// `-clamp on`: `true` if the picture is not repeated.
    pub(crate) clamp: bool,
    /// `-bm`: strength of a bump map.
    pub(crate) strength: Option<f32>,
}

/// A material library.
#[derive(Debug, Default)]
pub(crate) struct MtlFile {
    pub(crate) materials: Vec<MtlMaterial>,
    /// Numbers of lines, with warnings about them.
    pub(crate) notes: Vec<(usize, String)>,
}

/// Maximal number of warnings about statements.
const NOTES_MAX: usize = 20;

/// Statements without effect here: ambient light, which rasterizers use instead of indirect light, and texture
/// filtering.
const NEEDLESS: [&[u8]; 5] = [b"ka", b"map_ka", b"map_aat", b"sharpness", b"km"];

/// Reads a library. Unsupported and damaged statements are left out and reported.
///
/// - `path`: for errors.
/// - `bytes`: the file.
pub(crate) fn read(path: &Path, bytes: &[u8], budget: &MemoryBudget) -> Result<MtlFile, SceneError> {
    let source = MeshSource { path, budget };
    let Text { text, guess } = decode(path, bytes, budget)?;
    let mut file = MtlFile { materials: Vec::new(), notes: guess.into_iter().collect() };
    for block in lines::blocks(text.as_bytes(), 1, true) {
        let read = block.for_each_statement(|line, statement| {
            let mut words = statement;
            let keyword = next_word(&mut words).unwrap_or_default();
            if keyword == b"newmtl" {
                let name = String::from_utf8_lossy(words.trim_ascii()).into_owned();
                file.materials.push(MtlMaterial { name, line, ..MtlMaterial::default() });
                return Ok(());
            }
            let mut notes = Vec::new();
            let set =
                file.materials.last_mut().map_or(Ok(()), |material| material.set(keyword, words, line, &mut notes));
            let mut notes: Vec<(usize, String)> = notes.into_iter().map(|note| (line, note)).collect();
            if let Err(fault) = set {
                let keyword = String::from_utf8_lossy(keyword);
                let LocatedFault { line, column, problem } = block.locate(line, fault);
                notes.push((line, format!("column {column}: {problem}; `{}` is left out", shortened(&keyword))));
            }
            notes.truncate(NOTES_MAX.saturating_sub(file.notes.len()));
            file.notes.append(&mut notes);
            Ok(())
        });
        read.map_err(|fault| source.located(fault))?;
    }
    Ok(file)
}

impl MtlMaterial {
    /// Parses a statement. Warnings about unsupported parts are added to `notes`.
    fn set<'t>(
        &mut self,
        keyword: &[u8],
        words: &'t [u8],
        line: usize,
        notes: &mut Vec<String>,
    ) -> Result<(), LineFault<'t>> {
        let mut map = || map(words, line, notes);
        match keyword.to_ascii_lowercase().as_slice() {
            b"kd" => self.diffuse = color(words)?,
            b"ks" => self.specular = color(words)?,
            b"ke" => self.emission = color(words)?,
            b"tf" => self.transmission = color(words)?,
            b"ns" => self.exponent = Some(number(words)?),
            b"ni" => self.ior = Some(number(words)?),
            b"d" => self.opacity = Some(number(words.trim_ascii().strip_prefix(b"-halo").unwrap_or(words))?),
            b"tr" => self.opacity = Some(1.0 - number(words)?),
            b"pr" => self.roughness = Some(number(words)?),
            b"pm" => self.metallic = Some(number(words)?),
            b"illum" => self.illum = Some(number(words)?.clamp(0.0, 100.0) as u32),
            b"map_kd" => self.diffuse_map = map(),
            b"map_ks" => self.specular_map = map(),
            b"map_ke" => self.emission_map = map(),
            b"map_d" => self.opacity_map = map(),
            b"map_pr" => self.roughness_map = map(),
            b"map_pm" => self.metallic_map = map(),
            b"map_bump" | b"bump" => self.bump_map = map(),
            b"norm" | b"map_kn" => self.normal_map = map(),
            // Exporters also write these with 0.
            b"ps" | b"pc" | b"pcr" | b"aniso" | b"anisor" if number(words)? == 0.0 => {}
            needless if NEEDLESS.contains(&needless) => {}
            _ => {
                notes
                    .push(format!("`{}` is not supported, and left out", shortened(&String::from_utf8_lossy(keyword))));
            }
        }
        Ok(())
    }
}

/// Parses a finite number.
fn number(mut words: &[u8]) -> Result<f32, LineFault<'_>> {
    let word = next_word(&mut words).ok_or_else(|| LineFault::new(words, "a number is missing"))?;
    let value = float(word).filter(|value| value.is_finite());
    value
        .ok_or_else(|| LineFault::new(word, format!("`{}` is not a number", shortened(&String::from_utf8_lossy(word)))))
}

/// Parses one number for all channels, or three. `None`: a spectrum or XYZ, which are unsupported.
fn color(words: &[u8]) -> Result<Option<Vec3>, LineFault<'_>> {
    let mut rest = words;
    if matches!(next_word(&mut rest), Some(b"spectral" | b"xyz")) {
        return Ok(None);
    }
    let mut rest = words;
    let mut values = [0.0; 3];
    for (index, value) in values.iter_mut().enumerate() {
        let mut word = rest;
        if index > 0 && next_word(&mut word).is_none() {
            return Ok(Some(Vec3::splat(number(words)?)));
        }
        *value = number(rest)?;
        next_word(&mut rest);
    }
    let color = Vec3::from_array(values);
    Ok(Some(color.max(Vec3::ZERO)))
}

/// Parses options, then the name, which may contain spaces. `None`: there is no name. Unsupported options are added to
/// `notes`, except those of texture filtering.
fn map(words: &[u8], line: usize, notes: &mut Vec<String>) -> Option<MtlMap> {
    let mut map =
        MtlMap { reference: String::new(), line, scale: Vec2::ONE, offset: Vec2::ZERO, clamp: false, strength: None };
    let mut rest = words;
    let mut leave_out = |option: &str| notes.push(format!("the option `{option}` of a picture is left out"));
    loop {
        let before = rest;
        match next_word(&mut rest) {
            Some(b"-s") => map.scale = vector(&mut rest, 1.0),
            Some(b"-o") => map.offset = vector(&mut rest, 0.0),
            Some(b"-t") => {
                if vector(&mut rest, 0.0) != Vec2::ZERO {
                    leave_out("-t");
                }
            }
            Some(b"-bm") => map.strength = Some(vector(&mut rest, 1.0).x),
            Some(b"-clamp") => map.clamp = next_word(&mut rest) == Some(b"on"),
            Some(b"-mm") => {
                if vector(&mut rest, 1.0) != Vec2::Y {
                    leave_out("-mm");
                }
            }
            Some(b"-blendu" | b"-blendv" | b"-texres" | b"-boost") => {
                next_word(&mut rest);
            }
            Some(b"-cc") => {
                if next_word(&mut rest) == Some(b"on") {
                    leave_out("-cc");
                }
            }
            Some(option @ (b"-imfchan" | b"-type" | b"-colorspace")) => {
                next_word(&mut rest);
                leave_out(&String::from_utf8_lossy(option));
            }
            _ => {
                map.reference = String::from_utf8_lossy(before.trim_ascii()).into_owned();
                return (!map.reference.is_empty()).then_some(map);
            }
        }
    }
}

/// Takes one to three numbers, of which the first two are returned. Absent ones are `default`.
fn vector(words: &mut &[u8], default: f32) -> Vec2 {
    let mut values = [default; 3];
    for value in &mut values {
        let mut rest = *words;
        let Some(number) = next_word(&mut rest).and_then(float).filter(|number| number.is_finite()) else { break };
        *value = number;
        *words = rest;
    }
    Vec2::new(values[0], values[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> MtlFile {
        read(Path::new("a.mtl"), text.as_bytes(), &MemoryBudget::new(1 << 20)).unwrap()
    }

    #[test]
    fn every_statement_is_read() {
        let text = "# comment\nKd 1 1 1\nnewmtl a b\nKd 0.5 .25 0\nKs 0.1\nKe 1 2 3\nNs 100\nNi 1.3\nd 0.5\nillum 7\n\
            Pr 0.3\nPm 1\nmap_Kd -s 2 3 1 -o 0.5 -clamp on my wood.png\nmap_Bump -bm 0.2 bump.png\nnorm n.png\n\
            newmtl second\nTr 0.25\nKd spectral a.rfl 1\n";
        let materials = read_text(text).materials;
        let first = &materials[0];
        assert_eq!((first.name.as_str(), first.line), ("a b", 3));
        assert_eq!(first.diffuse, Some(Vec3::new(0.5, 0.25, 0.0)));
        assert_eq!((first.specular, first.emission), (Some(Vec3::splat(0.1)), Some(Vec3::new(1.0, 2.0, 3.0))));
        assert_eq!(
            (first.exponent, first.ior, first.opacity, first.illum),
            (Some(100.0), Some(1.3), Some(0.5), Some(7))
        );
        assert_eq!((first.roughness, first.metallic), (Some(0.3), Some(1.0)));
        let map = first.diffuse_map.as_ref().unwrap();
        assert_eq!((map.reference.as_str(), map.line, map.clamp), ("my wood.png", 13, true));
        assert_eq!((map.scale, map.offset), (Vec2::new(2.0, 3.0), Vec2::new(0.5, 0.0)));
        assert_eq!(first.bump_map.as_ref().unwrap().strength, Some(0.2));
        assert_eq!(first.normal_map.as_ref().unwrap().reference, "n.png");
        assert_eq!((materials[1].opacity, materials[1].diffuse), (Some(0.75), None));
    }

    #[test]
    fn wrong_numbers_are_left_out_and_named_with_line_and_column() {
        for (text, line, column) in [
            ("newmtl a\nNs nan\nPr 0.5", 2, "column 4: "),
            ("newmtl a\n\tKd 1 2 x\nPr 0.5", 2, "column 9: "),
            ("newmtl a\nPr 0.5\nNi", 3, "column 3: "),
            ("newmtl a\nKd\nPr 0.5", 2, "column 3: "),
        ] {
            let file = read_text(text);
            assert_eq!(file.materials[0].roughness, Some(0.5));
            let [(found, message)] = &file.notes[..] else { panic!("{text}: {:?}", file.notes) };
            assert!(*found == line && message.starts_with(column) && message.contains("is left out"), "{message}");
        }
    }

    #[test]
    fn a_comment_ends_with_its_line() {
        let file = read_text("# materials \\\nnewmtl a\n#\\\nPr \\\n0.25\n");
        assert_eq!((file.materials[0].name.as_str(), file.materials[0].roughness), ("a", Some(0.25)));
    }
}
