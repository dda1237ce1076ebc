//! The spatial variation of media in a saved scene: grids, dense or in bricks.

use std::io::{self, Write};

use bytemuck::cast_slice;
use glam::{Affine3A, Vec3};

use super::blocks::{Blocks, put};
use super::description::{
    BlackbodyDescription, DensityKind, EmissionDescription, GridDescription, VariationDescription,
};
use crate::blackbody::{Blackbody, ENTRIES};
use crate::error::SceneError;
use crate::grid::{Grid, GridCells};
use crate::medium::{Density, EmissionVariation, Variation};

/// Describes a variation.
pub(super) fn describe(variation: &Variation) -> VariationDescription {
    let (density, grids) = match &variation.density {
        Density::Both(grid) => (DensityKind::Both, vec![grid]),
        Density::Each { absorption, scattering } => (DensityKind::Each, vec![absorption, scattering]),
        Density::WithAlbedo { extinction, albedo } => (DensityKind::WithAlbedo, vec![extinction, albedo]),
    };
    VariationDescription {
        density,
        grids: grids.into_iter().map(describe_grid).collect(),
        emission: variation.emission.as_ref().map(|emission| EmissionDescription {
            grid: describe_grid(emission.grid()),
            blackbody: match emission {
                EmissionVariation::Factor(_) => None,
                EmissionVariation::Blackbody(it) => {
                    let &Blackbody { scale, offset, times_density, .. } = it;
                    Some(BlackbodyDescription { scale, offset, times_density })
                }
            },
        }),
        grid_from_world: variation.grid_from_world.to_cols_array(),
    }
}

fn describe_grid(grid: &Grid) -> GridDescription {
    let (bricks, values) = match grid.cells() {
        GridCells::Dense { values, .. } => (None, values.len()),
        GridCells::Bricks(bricks) => (Some(bricks.table().len() as u64), bricks.values().len()),
    };
    let channels = grid.channels() as u32;
    GridDescription { size: grid.size(), channels, bricks, values: values as u64, blend: grid.blend() }
}

/// Writes the blocks of a variation.
pub(super) fn put_variation(out: &mut dyn Write, variation: &Variation) -> io::Result<()> {
    for grid in variation.grids() {
        match grid.cells() {
            GridCells::Dense { values, .. } => put(out, values)?,
            GridCells::Bricks(bricks) => {
                put(out, bricks.table())?;
                put(out, bricks.values())?;
            }
        }
    }
    match &variation.emission {
        Some(EmissionVariation::Blackbody(it)) => put::<f32>(out, cast_slice(&it.colors)),
        _ => Ok(()),
    }
}

/// Reads a variation. `place`: the medium, such as `media[3]`.
pub(super) fn read_variation(
    blocks: &mut Blocks<'_>,
    place: &str,
    variation: VariationDescription,
) -> Result<Variation, SceneError> {
    let VariationDescription { density, grids, emission, grid_from_world } = variation;
    let grids = grids.iter().map(|grid| read_grid(blocks, place, grid)).collect::<Result<Vec<_>, _>>()?;
    let count = grids.len();
    let mut grids = grids.into_iter();
    let density = match (density, grids.next(), grids.next(), grids.next()) {
        (DensityKind::Both, Some(grid), None, None) => Density::Both(grid),
        (DensityKind::Each, Some(absorption), Some(scattering), None) => Density::Each { absorption, scattering },
        (DensityKind::WithAlbedo, Some(extinction), Some(albedo), None) => Density::WithAlbedo { extinction, albedo },
        _ => return Err(blocks.damaged(format!("{place} has {count} grids of its density"))),
    };
    let emission = emission.map(|emission| read_emission(blocks, place, &emission)).transpose()?;
    Ok(Variation { density, emission, grid_from_world: Affine3A::from_cols_array(&grid_from_world) })
}

fn read_emission(
    blocks: &mut Blocks<'_>,
    place: &str,
    emission: &EmissionDescription,
) -> Result<EmissionVariation, SceneError> {
    let grid = read_grid(blocks, place, &emission.grid)?;
    let Some(BlackbodyDescription { scale, offset, times_density }) = emission.blackbody else {
        return Ok(EmissionVariation::Factor(grid));
    };
    let colors: Vec<[f32; 3]> = blocks.take(place, ENTRIES as u64)?;
    if !colors.as_flattened().iter().all(|value| value.is_finite() && *value >= 0.0) {
        return Err(blocks.damaged(format!("{place}: a color of its black bodies is negative or not finite")));
    }
    let colors = colors.into_iter().map(Vec3::from_array).collect();
    Ok(EmissionVariation::Blackbody(Blackbody { temperatures: grid, scale, offset, times_density, colors }))
}

fn read_grid(blocks: &mut Blocks<'_>, place: &str, grid: &GridDescription) -> Result<Grid, SceneError> {
    let &GridDescription { size, channels, bricks, values, blend } = grid;
    let made = match bricks {
        Some(bricks) => {
            let table = blocks.take(place, bricks)?;
            Grid::of_bricks(size, channels as usize, table, blocks.take(place, values)?, blend)
        }
        None => Grid::new(size, blocks.take(place, values)?, blend),
    };
    made.map_err(|error| blocks.damaged(format!("{place}: {error}")))
}
