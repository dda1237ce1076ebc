//! Import of a voxel file as a scene: a box of smoke, or of fire.

use std::sync::Arc;

use glam::{DAffine3, Vec3};

use super::format::list;
use super::medium::{self, Voxels};
use super::voxels::GridEntry;
use crate::blackbody::Blackbody;
use crate::color::Spectrum;
use crate::error::{SceneError, Warnings};
use crate::grid::Grid;
use crate::hints::{Metadata, RenderHints};
use crate::import::request::{ImportOutput, ImportRequest};
use crate::material::Material;
use crate::medium::{Density, EmissionVariation, Medium, Variation};
use crate::model::{Mesh, Scene};
use crate::surface::Surface;
use crate::text::shortened;

pub(crate) use super::format::recognizes;

/// Names of densities, the best first.
const DENSITIES: &[&str] = &["density", "smoke", "fog", "surface"];
/// Names of temperatures, the best first.
const TEMPERATURES: &[&str] = &["temperature", "heat", "flame", "flames"];
/// Optical depth across the widest side of the box, where the density is greatest.
const OPTICAL_DEPTH: f32 = 12.0;
/// Single-scattering albedo of the smoke.
const ALBEDO: f32 = 0.6;
/// Greatest temperature in kelvin of a file whose values are not temperatures, because none is above 100.
const HOTTEST: f32 = 2000.0;
/// Greatest component of the radiance of the hottest part, where nothing is seen through it.
const RADIANCE: f32 = 10.0;

/// Imports a file that [`recognizes`] accepts. The scene has no cameras and no lights.
pub(crate) fn import(request: &ImportRequest<'_>, warnings: &mut Warnings) -> Result<ImportOutput, SceneError> {
    let &ImportRequest { path, file, origin, resources, .. } = request;
    let (format, grids) = list(file).map_err(|error| error.in_file(path))?;
    let invalid = |problem: String| SceneError::Invalid { path: path.into(), place: String::new(), problem };
    let Some(density) = best(&grids, DENSITIES).or_else(|| grids.iter().find(|grid| grid.channels == Some(1))) else {
        return Err(invalid(format!("it has no grid of numbers that can be read{}", listed(&grids))));
    };
    let temperature = best(&grids, TEMPERATURES).filter(|grid| grid.name != density.name);
    let name = temperature.map(|grid| grid.name.as_str());
    let read = medium::read(path, file, &density.name, name, resources.budget())?;
    let mut scene = Scene::default();
    if let Some(medium) = read {
        medium.notes.iter().for_each(|note| warnings.add("", note.clone()));
        let world_from_file = DAffine3::from_translation(-origin);
        add(&mut scene, medium, &world_from_file, &density.name)
            .ok_or_else(|| invalid("its voxels are flat, or out of reach".into()))?;
    } else {
        warnings.add("", format!("the grid `{}` has no voxels", shortened(&density.name)));
    }
    let is_used = |grid: &&GridEntry| grid.name == density.name || Some(grid.name.as_str()) == name;
    let others: Vec<GridEntry> = grids.iter().filter(|grid| !is_used(grid)).cloned().collect();
    if !others.is_empty() {
        warnings.add("", format!("grids are left out{}", listed(&others)));
    }
    Ok((scene, Metadata { format, ..Metadata::default() }, RenderHints::default()))
}

/// Returns the grid of numbers with the best name.
fn best<'a>(grids: &'a [GridEntry], names: &[&str]) -> Option<&'a GridEntry> {
    names.iter().find_map(|name| grids.iter().find(|grid| grid.name == *name && grid.channels == Some(1)))
}

/// Lists grids for a message.
fn listed(grids: &[GridEntry]) -> String {
    let each = grids.iter().map(|grid| format!(" `{}` ({})", shortened(&grid.name), shortened(&grid.kind)));
    if grids.is_empty() { String::new() } else { format!(":{}", each.collect::<Vec<_>>().join(",")) }
}

/// Adds the box; `None`: it is flat or out of reach.
fn add(scene: &mut Scene, medium: Voxels, world_from_file: &DAffine3, name: &str) -> Option<()> {
    let grid_from_world = medium.grid_from_world(world_from_file)?;
    let world_from_grid = (*world_from_file * medium.file_from_cube).as_affine3a();
    let widest = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| world_from_grid.transform_vector3(axis).length());
    let widest = widest.into_iter().fold(0.0, f32::max);
    let extinction = OPTICAL_DEPTH / (widest * greatest(&medium.density));
    let [scattering, absorption] = [ALBEDO, 1.0 - ALBEDO].map(|share| Spectrum::splat(share * extinction));
    let mut strength = 0.0;
    let emission = medium.temperatures.map(|grid| {
        let hottest = greatest(&grid);
        let scale = if hottest > 100.0 { 1.0 } else { HOTTEST / hottest };
        let blackbody = Blackbody::of_equal_peaks(grid, scale, 0.0, |color| color);
        strength = RADIANCE / blackbody.color(hottest * scale).max_element().max(f32::MIN_POSITIVE);
        EmissionVariation::Blackbody(blackbody)
    });
    let variation = Variation { density: Density::Both(medium.density), emission, grid_from_world };
    let medium = scene.push_medium(Medium {
        name: name.into(),
        scattering,
        emission: absorption * strength,
        variation: Some(Arc::new(variation)),
        ..Medium::absorbing(absorption)
    });
    let material = Material { interior: Some(medium), ..Material::from(Surface::Null) };
    let material = scene.push_material(material);
    let mesh = scene.push_mesh(Mesh { material, ..Mesh::cuboid(Vec3::ZERO, Vec3::ONE) });
    scene.push_instance(mesh, world_from_grid);
    Some(())
}

/// Returns the greatest value of a grid, above 0.
fn greatest(grid: &Grid) -> f32 {
    grid.max_within([Vec3::ZERO, Vec3::ONE]).max_element().max(f32::MIN_POSITIVE)
}
