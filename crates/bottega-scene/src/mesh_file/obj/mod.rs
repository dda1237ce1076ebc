//! Wavefront OBJ: polygons by material, and the names of material libraries.
//!
//! Several threads parse blocks of the file. Points, lines and free-form surfaces are left out with a warning, and so
//! are faces that refer to missing or invalid vertices.

pub(crate) mod file;
pub(super) mod materials;
mod parse;
mod weld;

use std::collections::BTreeMap;
use std::path::Path;

use glam::Vec3;
use rayon::prelude::*;

use file::{ObjFile, Run};
use parse::{ParsedLines, Statement};

use super::source::MeshSource;
use super::{finish, lines};
use crate::budget::{HeldBytes, MemoryBudget};
use crate::error::SceneError;
use crate::model::Mesh;
use crate::text::{Text, decode};

/// The triangles of one material.
pub(crate) struct ObjPart {
    /// Name after `usemtl`.
    pub(crate) material: Option<String>,
    pub(crate) mesh: Mesh,
}

/// Reads a file. Polygons become triangle fans.
///
/// - `path`: for errors.
/// - `bytes`: the file.
pub(crate) fn read<'a>(path: &'a Path, bytes: &[u8], budget: &'a MemoryBudget) -> Result<ObjFile<'a>, SceneError> {
    let source = MeshSource { path, budget };
    let Text { text, guess } = decode(path, bytes, budget)?;
    let blocks = lines::blocks(text.as_bytes(), 1, true);
    let parsed = (blocks.par_iter())
        .map(|block| {
            let parsed = parse::parse(*block).map_err(|fault| source.located(fault))?;
            // Book memory per block, so that too large a file fails early.
            let held = budget.hold(path, parsed.memory_bytes())?;
            Ok((parsed, held))
        })
        .collect::<Vec<Result<(ParsedLines, HeldBytes<'a>), SceneError>>>();
    let parsed = parsed.into_iter().collect::<Result<Vec<_>, SceneError>>()?;
    let (mut parsed, held): (Vec<ParsedLines>, Vec<HeldBytes<'a>>) = parsed.into_iter().unzip();
    resolve(source, &blocks, &mut parsed)?;
    let mut file = ObjFile::join(source, parsed, held);
    file.notes.splice(..0, guess);
    Ok(file)
}

/// Recognizes an OBJ file by its extension: the format has no magic number.
pub(crate) fn recognizes(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj"))
}

/// Makes all indices absolute, and checks that they are in range.
fn resolve(
    source: MeshSource<'_>,
    blocks: &[lines::LineBlock<'_>],
    parsed: &mut [ParsedLines],
) -> Result<(), SceneError> {
    let mut next = [0usize; 3];
    let bases: Vec<[usize; 3]> = parsed
        .iter()
        .map(|parsed| {
            let base = next;
            let counts = parsed.counts();
            next = std::array::from_fn(|kind| next[kind] + counts[kind]);
            base
        })
        .collect();
    let totals = next;
    if totals.iter().any(|&total| total >= parse::COUNT_MAX) {
        return Err(source.damaged("it has more vertices than can be indexed"));
    }
    let unsound = parsed.iter().zip(&bases).flat_map(|(parsed, base)| {
        // Counts are checked above, so all fit.
        parsed.unsound.iter().map(|vertex| vertex + base[0] as u32)
    });
    let unsound: Vec<u32> = unsound.collect();
    let pieces = parsed.par_iter_mut().zip(bases).zip(blocks);
    pieces.for_each(|((parsed, base), block)| parsed.resolve(*block, base, totals, &unsound));
    Ok(())
}

impl<'a> ObjFile<'a> {
    fn join(source: MeshSource<'a>, parsed: Vec<ParsedLines>, held: Vec<HeldBytes<'a>>) -> Self {
        let mut file = Self {
            source,
            positions: Vec::new(),
            colors: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            triangles: Vec::new(),
            runs: Vec::new(),
            materials: Vec::new(),
            libraries: Vec::new(),
            skipped: Vec::new(),
            notes: Vec::new(),
            _held: held,
        };
        let has_colors = parsed.iter().any(|parsed| !parsed.colors.is_empty());
        let total = |count: fn(&ParsedLines) -> usize| parsed.iter().map(count).sum::<usize>();
        file.positions.reserve_exact(total(|parsed| parsed.positions.len()));
        file.uvs.reserve_exact(total(|parsed| parsed.uvs.len()));
        file.normals.reserve_exact(total(|parsed| parsed.normals.len()));
        file.triangles.reserve_exact(total(|parsed| parsed.triangles.len()));
        let mut known: BTreeMap<String, usize> = BTreeMap::new();
        let mut run = Run { first: 0, material: None, smoothing: 0 };
        let mut damaged = parse::SkippedStatements::default();
        for part in parsed {
            damaged.append(part.skipped);
            let first = file.triangles.len();
            for (triangle, statement) in part.statements {
                match statement {
                    Statement::Material(name) => {
                        let next = known.len();
                        run.material = Some(*known.entry(name).or_insert_with_key(|name| {
                            file.materials.push(name.clone());
                            next
                        }));
                    }
                    Statement::Smoothing(group) => run.smoothing = group,
                    Statement::Library(name, line) => {
                        if !file.libraries.iter().any(|(known, _)| *known == name) {
                            file.libraries.push((name, line));
                        }
                        continue;
                    }
                    Statement::Unknown(keyword, line) => {
                        if !file.skipped.iter().any(|(known, _)| *known == keyword) {
                            file.skipped.push((keyword, line));
                        }
                        continue;
                    }
                }
                file.runs.push(Run { first: first + triangle, ..run });
            }
            if has_colors {
                file.colors.extend(&part.colors);
                file.colors.resize(file.positions.len() + part.positions.len(), Vec3::ONE);
            }
            file.positions.extend(part.positions);
            file.uvs.extend(part.uvs);
            file.normals.extend(part.normals);
            file.triangles.extend(part.triangles);
        }
        file.notes = damaged.notes();
        file
    }

    /// Takes the warnings about omissions and guesses, with their lines.
    pub(crate) fn take_notes(&mut self) -> Vec<(usize, String)> {
        let unknown = std::mem::take(&mut self.skipped).into_iter();
        let unknown = unknown.map(|(keyword, line)| (line, format!("`{keyword}` is not supported and left out")));
        unknown.chain(std::mem::take(&mut self.notes)).collect()
    }

    /// Makes one mesh per material, in the order of their first triangles. Smoothing groups make smooth normals where
    /// the file has none.
    pub(crate) fn into_parts(self) -> Result<Vec<ObjPart>, SceneError> {
        let mut parts: Vec<(Option<usize>, Vec<weld::Range>)> = Vec::new();
        let mut part_of: BTreeMap<Option<usize>, usize> = BTreeMap::new();
        let start = Run { first: 0, material: None, smoothing: 0 };
        let runs: Vec<Run> = std::iter::once(start).chain(self.runs.iter().copied()).collect();
        let ends = runs.iter().skip(1).map(|run| run.first).chain([self.triangles.len()]);
        for (run, end) in runs.iter().zip(ends).filter(|(run, end)| run.first < *end) {
            let part = *part_of.entry(run.material).or_insert_with(|| {
                parts.push((run.material, Vec::new()));
                parts.len() - 1
            });
            parts[part].1.push((run.first, end, run.smoothing));
        }
        let mut welder = weld::Welder::new(&self);
        let weld = |(material, runs): (Option<usize>, Vec<weld::Range>)| {
            let material = material.map(|material| self.materials[material].clone());
            let mut mesh = finish(welder.weld(&runs, true)?);
            mesh.name = material.clone().unwrap_or_default();
            Ok(ObjPart { material, mesh })
        };
        parts.into_iter().map(weld).collect()
    }

    /// Makes one mesh of all triangles, with the file's normals or none, as Mitsuba's `obj` shape does.
    pub(crate) fn into_single(self) -> Result<Mesh, SceneError> {
        weld::Welder::new(&self).weld(&[(0, self.triangles.len(), 0)], false).map(finish)
    }
}

#[cfg(test)]
mod tests;
