//! Large scenes. Run with `--ignored --nocapture --test-threads 1`.

use std::time::Instant;

use serde_json::json;

use crate::gltf::support::{File, U32, write};

/// Greatest resident memory of this process so far, in bytes; Linux only.
fn peak_bytes() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<usize>().ok().map(|kibibytes| kibibytes << 10)
}

/// A grid of 10 M triangles and 5 M vertices with normals.
fn grid() -> File {
    let (columns, rows) = (2501u32, 2001u32);
    let mut file = File::new();
    let vertices = (0..rows).flat_map(|y| (0..columns).map(move |x| (x as f32, y as f32)));
    let positions: Vec<f32> = vertices.clone().flat_map(|(x, y)| [x, (x * 0.01).sin(), y]).collect();
    let normals: Vec<f32> = vertices.flat_map(|_| [0.0, 1.0, 0.0]).collect();
    let indices: Vec<u8> = (0..rows - 1)
        .flat_map(|y| (0..columns - 1).map(move |x| y * columns + x))
        .flat_map(|a| [a, a + columns, a + 1, a + 1, a + columns, a + columns + 1])
        .flat_map(u32::to_le_bytes)
        .collect();
    let positions = file.floats("VEC3", &positions);
    let normals = file.floats("VEC3", &normals);
    let indices = file.accessor("SCALAR", U32, indices.len() / 4, &indices);
    file.primitive(json!({"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices}));
    file
}

#[test]
#[ignore = "takes 1 GB of memory"]
fn ten_million_triangles_take_little_more_than_scene_and_file() {
    const FILE: &str = "BOTTEGA_SIZE_FILE";
    let Some(path) = std::env::var_os(FILE) else {
        // Loaded in a separate process, so that the peak excludes the generation of the file.
        let folder = tempfile::tempdir().unwrap();
        let path = write(folder.path(), "large.glb", &grid().glb());
        let test = "gltf::size::ten_million_triangles_take_little_more_than_scene_and_file";
        let mut child = std::process::Command::new(std::env::current_exe().unwrap());
        let status = child.args(["--ignored", "--exact", "--nocapture", test]).env(FILE, path).status().unwrap();
        assert!(status.success());
        return;
    };
    let start = Instant::now();
    let loaded = bottega_scene::load(path.as_ref(), &bottega_scene::LoadOptions::default()).unwrap();
    let elapsed = start.elapsed();
    assert_eq!(loaded.scene.triangle_count(), 10_000_000);
    let (scene, file) = (loaded.scene.memory_bytes(), std::fs::metadata(path).unwrap().len() as usize);
    eprintln!(
        "scene {} MB, file {} MB, peak {:?} MB, {elapsed:?}",
        scene >> 20,
        file >> 20,
        peak_bytes().map(|b| b >> 20)
    );
    if let Some(peak) = peak_bytes() {
        assert!(peak < (scene + file) / 10 * 11 + (16 << 20), "{peak} for {scene} and {file}");
    }
}
