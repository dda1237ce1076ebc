//! Meshes for the benchmark, from files that are trusted: Wavefront OBJ and binary PLY.

use bottega_kernels::bench::BenchScene;
use glam::Vec3;
use std::io::{Error, Result};
use std::path::Path;

/// A file, or all PLY files of a folder as one mesh.
pub(crate) fn read(path: &str) -> Result<BenchScene> {
    let path = Path::new(path);
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut files = vec![path.to_owned()];
    if path.is_dir() {
        files = std::fs::read_dir(path)?.map(|entry| entry.map(|e| e.path())).collect::<Result<_>>()?;
        files.retain(|file| file.extension().is_some_and(|e| e == "ply"));
        files.sort();
    }
    for file in files {
        let (p, t) = if file.extension().is_some_and(|e| e == "ply") { ply(&file)? } else { obj(&file)? };
        let first = positions.len() as u32;
        positions.extend(p);
        triangles.extend(t.into_iter().map(|t| t.map(|i| first + i)));
    }
    let name = path.to_string_lossy();
    let stem = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    // Two interiors that are known: the kitchen that comes with `obvhs`, and the staircase with the camera of its scene.
    let inside = if stem == "kitchen" {
        Some(("kitchen", Vec3::new(3.0, 1.5, 1.4), Vec3::new(-3.9, 1.5, -1.7)))
    } else if name.contains("staircase2") {
        Some(("staircase2", Vec3::new(6.91, 1.65, 2.55), Vec3::new(6.01, 1.65, 2.12)))
    } else {
        None
    };
    Ok(match inside {
        Some((name, eye, target)) => BenchScene::from_mesh(name, positions, triangles, eye, target),
        None => BenchScene::in_room(&stem, positions, triangles),
    })
}

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

fn fan(polygon: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    (2..polygon.len()).map(|i| [polygon[0], polygon[i - 1], polygon[i]])
}

fn obj(path: &Path) -> Result<Mesh> {
    let text = std::fs::read_to_string(path)?;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let mut next = || words.next().and_then(|w| w.parse().ok()).unwrap_or(0.0);
                positions.push(Vec3::new(next(), next(), next()));
            }
            Some("f") => {
                let index = |w: &str| {
                    let i: i64 = w.split('/').next().and_then(|w| w.parse().ok()).unwrap_or(1);
                    (if i < 0 { positions.len() as i64 + i } else { i - 1 }) as u32
                };
                let polygon: Vec<u32> = words.map(index).collect();
                triangles.extend(fan(&polygon));
            }
            _ => {}
        }
    }
    Ok((positions, triangles))
}

/// `binary_little_endian`, vertices of floats that begin with the position, faces of one list of `int` after a `uchar`.
fn ply(path: &Path) -> Result<Mesh> {
    let file = std::fs::read(path)?;
    let bad = |what: &str| Error::other(format!("{}: {what}", path.display()));
    let end = file.windows(11).position(|w| w == b"end_header\n").ok_or_else(|| bad("no end of header"))? + 11;
    let header = String::from_utf8_lossy(&file[..end]).into_owned();
    if !header.contains("binary_little_endian") {
        return Err(bad("only binary_little_endian is read"));
    }
    let count = |element: &str| {
        let line = header.lines().find_map(|line| line.strip_prefix(&format!("element {element} ")));
        line.and_then(|n| n.trim().parse::<usize>().ok()).ok_or_else(|| bad("an element is missing"))
    };
    let floats = header.lines().filter(|line| line.starts_with("property float ")).count();
    let word = |at: usize| file.get(at..at + 4).map(|b| [b[0], b[1], b[2], b[3]]).ok_or_else(|| bad("too short"));
    let mut positions = Vec::new();
    for vertex in 0..count("vertex")? {
        let at = end + vertex * floats * 4;
        let float = |k: usize| word(at + 4 * k).map(f32::from_le_bytes);
        positions.push(Vec3::new(float(0)?, float(1)?, float(2)?));
    }
    let (mut at, mut triangles) = (end + positions.len() * floats * 4, Vec::new());
    for _ in 0..count("face")? {
        let corners = *file.get(at).ok_or_else(|| bad("too short"))? as usize;
        let polygon = (0..corners).map(|k| word(at + 1 + 4 * k).map(u32::from_le_bytes)).collect::<Result<Vec<_>>>()?;
        triangles.extend(fan(&polygon));
        at += 1 + 4 * corners;
    }
    Ok((positions, triangles))
}
