//! Heterogeneous media: `uniformgrid`, `rgbgrid` and `nanovdb`.

use glam::{DAffine3, DVec3};

use super::context::Context;
use super::film::Exposure;
use super::params::{Params, Values};
use super::transform::rounded;
use super::world::Entity;
use crate::blackbody::Blackbody;
use crate::color::Spectrum;
use crate::grid::{Blend, Grid};
use crate::import::text_place::{ImportResult, TextFault, TextPlace};
use crate::medium::{Density, EmissionVariation, Variation};
use crate::spectrum::role::ColorRole;
use crate::text::shortened;
use crate::values::VALUE_MAX;
use crate::voxel_file;

/// Reads a `uniformgrid`: densities that multiply both coefficients.
pub(super) fn uniform(context: &mut Context<'_>, entity: &Entity, exposure: Exposure) -> ImportResult<Variation> {
    let (params, at) = (&entity.params, entity.at);
    let size = size(params, at)?;
    let Some(density) = params.floats("density") else {
        return Err(at.fault("`uniformgrid` needs its values in \"float density\"").into());
    };
    let numbers = |name: &str, values: &[f64]| {
        grid(size, values.iter().map(|&value| value as f32).collect(), Blend::LinearFading, params.place_of(name))
    };
    let density = Density::Both(numbers("density", density)?);
    let factor = match params.floats("Lescale") {
        Some(values) if values.len() > 1 => Some(numbers("Lescale", values)?),
        _ => None,
    };
    let emission = match params.floats("temperature") {
        Some(values) => {
            if factor.is_some() {
                let problem = "a grid `Lescale` beside `temperature` is left out: it counts as 1";
                context.unsupported(params.place_of("Lescale"), problem);
            }
            Some(blackbody(params, numbers("temperature", values)?, exposure)?)
        }
        None => factor.map(EmissionVariation::Factor),
    };
    Ok(Variation { density, emission, grid_from_world: place(params, entity)? })
}

/// Reads an `rgbgrid`: the coefficients themselves.
pub(super) fn colored(entity: &Entity, exposure: Exposure) -> ImportResult<Variation> {
    let (params, at) = (&entity.params, entity.at);
    let size = size(params, at)?;
    let colors = |name: &str, role: ColorRole, apply: &dyn Fn(Spectrum) -> Spectrum| {
        let Some(param) = params.find(name, &["rgb"]) else { return Ok(None) };
        let Values::Numbers(numbers) = &param.values else { return Ok(None) };
        let space = params.color_space_of(param);
        let (colors, rest) = numbers.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(param
                .at
                .fault(format!("`{name}` has {} numbers, which is not a multiple of 3", numbers.len())));
        }
        let rgb = |&[r, g, b]: &[f64; 3]| apply(space.to_rec709(DVec3::new(r, g, b), role)).to_array();
        grid(size, colors.iter().flat_map(rgb).collect(), Blend::LinearFading, param.at).map(Some)
    };
    let coefficient = |name: &str| colors(name, ColorRole::Unbounded, &|color| color);
    let (absorption, scattering) = (coefficient("sigma_a")?, coefficient("sigma_s")?);
    if absorption.is_none() && scattering.is_none() {
        return Err(at.fault("`rgbgrid` needs \"rgb sigma_a\" or \"rgb sigma_s\"").into());
    }
    let emission = colors("Le", ColorRole::Emission, &|color| exposure.apply(color))?.map(EmissionVariation::Factor);
    // A missing grid is 1 everywhere.
    let [absorption, scattering] = [absorption, scattering].map(|grid| grid.unwrap_or_else(Grid::one));
    let density = Density::Each { absorption, scattering };
    Ok(Variation { density, emission, grid_from_world: place(params, entity)? })
}

/// Reads a `nanovdb`: a file with the grid `density` and perhaps `temperature`. OpenVDB files are read, too. `Ok(None)`:
/// the medium is empty.
pub(super) fn voxels(
    context: &mut Context<'_>,
    entity: &Entity,
    exposure: Exposure,
) -> ImportResult<Option<Variation>> {
    let (params, at) = (&entity.params, entity.at);
    let reference = params.text("filename")?.ok_or_else(|| at.fault("`nanovdb` needs a `filename`"))?;
    let at = params.place_of("filename");
    let location = context.resources.locate(reference, &context.place(at))?;
    let bytes = context.resources.read(&location)?;
    if !voxel_file::recognizes(&bytes) {
        return Err(at.fault(format!("`{}` is neither a NanoVDB nor an OpenVDB file", shortened(reference))).into());
    }
    let budget = context.resources.budget();
    let medium = voxel_file::medium::read(location.path(), &bytes, "density", Some("temperature"), budget)?;
    let Some(medium) = medium else {
        let problem = format!("`{}` has no grid `density` with voxels: the medium is empty", shortened(reference));
        context.warn(at, problem);
        params.mark_reported(&["temperatureoffset", "temperaturescale", "temperaturecutoff"]);
        return Ok(None);
    };
    medium.notes.iter().for_each(|note| context.warn(at, note));
    let world_from_cube = entity.ctm * medium.file_from_cube;
    let emission = medium.temperatures.map(|grid| blackbody(params, grid, exposure)).transpose()?;
    let grid_from_world = rounded(&world_from_cube.inverse(), at)?;
    Ok(Some(Variation { density: Density::Both(medium.density), emission, grid_from_world }))
}

/// Returns the emission by a grid of temperatures.
fn blackbody(params: &Params, grid: Grid, exposure: Exposure) -> ImportResult<EmissionVariation> {
    let cutoff = params.float("temperaturecutoff")?.unwrap_or(0.0);
    let offset = params.float("temperatureoffset")?.unwrap_or(cutoff);
    let scale = params.float("temperaturescale")?.unwrap_or(1.0);
    let emission = Blackbody::of_equal_peaks(grid, scale as f32, offset as f32, |color| exposure.apply(color));
    Ok(EmissionVariation::Blackbody(emission))
}

/// Returns the number of cells along x, y and z.
fn size(params: &Params, at: TextPlace) -> Result<[u32; 3], TextFault> {
    let mut size = [1; 3];
    for (side, name) in size.iter_mut().zip(["nx", "ny", "nz"]) {
        let given = params.integer(name)?.unwrap_or(1);
        *side =
            u32::try_from(given).map_err(|_| at.fault(format!("a grid cannot have {given} cells along an axis")))?;
    }
    Ok(size)
}

fn grid(size: [u32; 3], values: Vec<f32>, blend: Blend, at: TextPlace) -> Result<Grid, TextFault> {
    if let Some(index) = values.iter().position(|value| value.is_nan() || value.abs() > VALUE_MAX) {
        return Err(at.fault(format!("value {index} of the grid is not a finite number up to {VALUE_MAX:e}")));
    }
    Grid::new(size, values, blend).map_err(|problem| at.fault(problem.to_string()))
}

/// Returns the transformation from world space to the unit cube.
fn place(params: &Params, entity: &Entity) -> ImportResult<glam::Affine3A> {
    let low = params.point3("p0", "point3")?.unwrap_or(DVec3::ZERO);
    let high = params.point3("p1", "point3")?.unwrap_or(DVec3::ONE);
    let world_from_grid = entity.ctm * DAffine3::from_translation(low) * DAffine3::from_scale(high - low);
    Ok(rounded(&world_from_grid.inverse(), entity.at)?)
}
