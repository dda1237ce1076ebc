//! Grids of a voxel file as the density and the emission of a medium.

use std::path::Path;

use glam::{Affine3A, DAffine3};

use super::error::VoxelError;
use super::format;
use super::lattice::Lattice;
use super::voxels::{Store, VoxelGrid};
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::file::read_file;
use crate::grid::Grid;

/// The grids of a medium from a file of voxels, OpenVDB or NanoVDB. They fill the same box.
#[derive(Clone, Debug, PartialEq)]
pub struct Voxels {
    /// Factor of absorption and scattering.
    pub density: Grid,
    /// Temperatures, in the unit of the file; `None`: none were asked for, the file has no such grid, or they are 0
    /// everywhere.
    pub temperatures: Option<Grid>,
    /// Unit cube of the grids to the space of the file.
    pub file_from_cube: DAffine3,
    /// Changes to values of the file, for warnings.
    pub notes: Vec<String>,
}

impl Voxels {
    /// Reads the grids of a medium from an OpenVDB or NanoVDB file. `Ok(None)`: the file has no such density of a kind
    /// that can be read, or it is 0 everywhere.
    ///
    /// - `density`, `temperature`: names of grids in the file; `temperature` `None`: no temperatures are read.
    /// - `max_memory_bytes`: most memory of the file and the grids together, in bytes.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, is not a voxel file or needs more memory.
    pub fn read(
        path: &Path,
        density: &str,
        temperature: Option<&str>,
        max_memory_bytes: usize,
    ) -> Result<Option<Self>, SceneError> {
        let budget = MemoryBudget::new(max_memory_bytes);
        let bytes = read_file(path, &budget)?;
        if !format::recognizes(&bytes) {
            let problem = "it is neither an OpenVDB nor a NanoVDB file".into();
            return Err(SceneError::Invalid { path: path.into(), place: String::new(), problem });
        }
        read(path, &bytes, density, temperature, &budget)
    }

    /// Lists the grids of a file of voxels. Returns the name of each grid, and the kind of its values as the format
    /// calls it.
    ///
    /// - `max_memory_bytes`: most memory of the file, in bytes.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, is not a voxel file or needs more memory.
    pub fn list(path: &Path, max_memory_bytes: usize) -> Result<Vec<(String, String)>, SceneError> {
        let bytes = read_file(path, &MemoryBudget::new(max_memory_bytes))?;
        let (_, grids) = format::list(&bytes).map_err(|error| error.in_file(path))?;
        Ok(grids.into_iter().map(|grid| (grid.name, grid.kind)).collect())
    }

    /// Returns the transformation from world space to the grids' unit cube; `None`: the box is flat or out of reach.
    ///
    /// - `world_from_file`: transformation from the space of the file to world space.
    pub fn grid_from_world(&self, world_from_file: &DAffine3) -> Option<Affine3A> {
        let grid_from_world = (*world_from_file * self.file_from_cube).inverse().as_affine3a();
        grid_from_world.is_finite().then_some(grid_from_world)
    }
}

/// Reads the density and the temperatures of a medium. `Ok(None)`: the file has no such density of a kind that can be read, or
/// it is 0 everywhere.
///
/// - `density`, `temperature`: names of grids.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    density: &str,
    temperature: Option<&str>,
    budget: &MemoryBudget,
) -> Result<Option<Voxels>, SceneError> {
    let Some(voxels) = format::read(path, bytes, density, budget)? else { return Ok(None) };
    let glow = match temperature {
        Some(name) => format::read(path, bytes, name, budget)?,
        None => None,
    };
    let store = Store { path, name: density, budget };
    assemble(&voxels, glow.as_ref(), &store).map_err(|error| error.in_file(path))
}

fn assemble(voxels: &VoxelGrid, glow: Option<&VoxelGrid>, store: &Store<'_>) -> Result<Option<Voxels>, VoxelError> {
    let shares_place = glow.filter(|glow| glow.file_from_index.abs_diff_eq(voxels.file_from_index, 1e-9));
    let grids: Vec<&VoxelGrid> = std::iter::once(voxels).chain(shares_place).collect();
    let Some(lattice) = Lattice::around(&grids)? else { return Ok(None) };
    let mut notes = Vec::new();
    let mut finite = |name: &str, (grid, not_finite): (Grid, usize)| {
        if not_finite > 0 {
            notes.push(format!("{not_finite} values of the {name} are not finite; they count as 0"));
        }
        grid
    };
    let density = finite("density", lattice.grid(voxels, store)?);
    let temperatures = match (shares_place, glow) {
        (Some(glow), _) => Some(finite("temperature", lattice.grid(glow, store)?)),
        // Another place: sample its values at the voxels of the density
        (None, Some(glow)) => match Lattice::around(&[glow])? {
            Some(own) => {
                let other = finite("temperature", own.grid(glow, store)?);
                let file_from_other = glow.file_from_index * own.index_from_cube();
                let cube_from_index = file_from_other.inverse() * voxels.file_from_index;
                Some(lattice.resampled(&other, &cube_from_index, store)?.0)
            }
            None => None,
        },
        (None, None) => None,
    };
    let file_from_cube = voxels.file_from_index * lattice.index_from_cube();
    Ok(Some(Voxels { density, temperatures, file_from_cube, notes }))
}
