//! Meshes read from files, for tracing rays.

use std::{
    fs,
    path::{Path, PathBuf},
};

use bottega_scene::Scene;
use glam::Vec3;

use crate::{error::Error, files::shared_meshes, scenes::BenchScene};

/// Known interiors, by a part of their path, with the camera's position and target: the kitchen of `obvhs`, and the staircase
/// with its scene's camera.
const INTERIORS: [(&str, Vec3, Vec3); 2] = [
    ("kitchen", Vec3::new(3.0, 1.5, 1.4), Vec3::new(-3.9, 1.5, -1.7)),
    ("staircase2", Vec3::new(6.91, 1.65, 2.55), Vec3::new(6.01, 1.65, 2.12)),
];

/// Reads a file, or all PLY files of a folder, as one mesh. Unless it is a known interior, it is put into a closed room.
pub(super) fn read(path: &Path) -> Result<BenchScene, Error> {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for file in files(path)? {
        let Scene { meshes, instances, .. } = bottega_scene::load(&file, &shared_meshes())?.scene;
        for instance in &instances {
            let (mesh, first) = (&meshes[instance.mesh as usize], positions.len() as u32);
            positions.extend(mesh.positions.iter().map(|p| instance.world_from_object.transform_point3(*p)));
            triangles.extend(mesh.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
        }
    }
    let name = path.to_string_lossy();
    if let Some(&(name, eye, target)) = INTERIORS.iter().find(|(known, ..)| name.contains(known)) {
        return Ok(BenchScene::from_mesh(name, positions, triangles, eye, target));
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(BenchScene::in_room(&name, positions, triangles))
}

fn files(path: &Path) -> Result<Vec<PathBuf>, Error> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = fs::read_dir(path).map_err(|source| bottega::Error::Read { path: path.to_owned(), source })?;
    let files = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let mut files: Vec<PathBuf> = files.filter(|file| file.extension().is_some_and(|end| end == "ply")).collect();
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_ply_files_of_a_folder_are_one_mesh_in_a_room() {
        let folder = tempfile::tempdir().unwrap();
        let header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
            element face 1\nproperty list uchar int vertex_indices\nend_header\n";
        for (name, height) in [("a.ply", 0), ("b.ply", 2), ("c.txt", 9)] {
            let corners = format!("0 {height} 0\n1 {height} 0\n0 {height} 1\n3 0 1 2\n");
            fs::write(folder.path().join(name), format!("{header}{corners}")).unwrap();
        }
        let scene = read(folder.path()).unwrap();
        // Six walls of two triangles.
        assert_eq!((scene.triangles.len(), scene.triangles[1]), (2 + 12, [3, 4, 5]));
        assert_eq!(scene.positions[3], Vec3::new(0.0, 2.0, 0.0));
        assert!(read(&folder.path().join("d.ply")).is_err());
    }
}
