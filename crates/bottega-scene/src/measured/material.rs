//! The tables of a measured material.

use std::fmt;

use super::error::MeasuredError;
use super::node::{NodeGrid, NodeWeights};
use super::warp::{Cell, SquareTable, Warp};
use crate::color::Spectrum;

/// The perceptual roughness of materials whose distribution of normals is extremely sharp or broad.
const ROUGHNESS: [f32; 2] = [0.02, 0.9];

/// A material whose reflectance was measured. Points of a table over facets are (√(2 θ ∕ π), (φ + π) ∕ 2π) by the angles
/// of a facet's normal: θ against the normal of the surface, φ around it.
#[derive(Clone, PartialEq)]
pub struct Measured {
    /// The name of its file; may be empty.
    pub name: String,
    /// Directions of view that have a table.
    pub(super) nodes: NodeGrid,
    /// Distribution of the facets' normals.
    pub(super) normals: SquareTable,
    /// Area of the facets as seen from a direction.
    pub(super) area: SquareTable,
    /// Densities of visible normals.
    pub(super) visible: Warp,
    /// Densities of the points that `visible` turns into normals, by how much the material reflects.
    pub(super) luminance: Warp,
    /// Reflection by node, row and column, on the grid of `luminance`; not negative.
    pub(super) reflection: Vec<Spectrum>,
    /// `true`: `reflection` is relative to that of mirroring facets. `false`: it is f cos θ, in sr⁻¹.
    pub(super) is_relative: bool,
    /// Part of the directions of view that the nodes cover.
    symmetry: Symmetry,
    /// Share of the light that is reflected, by node.
    albedos: Vec<Spectrum>,
}

/// The part of the directions of view that the nodes of a material cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// The material is the same when turned around its normal.
    Isotropic,
    /// All directions.
    None,
    /// Directions with y ≤ 0: a half turn changes nothing.
    HalfTurn,
    /// Directions with x ≤ 0 and y ≤ 0: mirroring in the planes x = 0 and y = 0 changes nothing.
    TwoPlanes,
}

impl Symmetry {
    /// Returns the symmetry of a material by its nodes' angles around the normal.
    fn of_nodes(phi: &[f32]) -> Result<Self, MeasuredError> {
        let &[first, .., last] = phi else { return Ok(Self::Isotropic) };
        if phi.len() == 2 {
            return Ok(Self::Isotropic);
        }
        let span = last - first;
        match (std::f32::consts::TAU / span).round() {
            1.0 => Ok(Self::None),
            2.0 => Ok(Self::HalfTurn),
            4.0 => Ok(Self::TwoPlanes),
            _ => Err(MeasuredError::Span { degrees: span.to_degrees() }),
        }
    }
}

/// The tables of a measured material, before they are checked.
#[derive(Clone, Debug)]
pub(super) struct MeasuredTables {
    pub(super) name: String,
    pub(super) phi: Vec<f32>,
    pub(super) theta: Vec<f32>,
    pub(super) normals: SquareTable,
    pub(super) area: SquareTable,
    /// Columns and rows of the densities of visible normals.
    pub(super) visible_size: [usize; 2],
    /// Densities of visible normals, those of each node normalized.
    pub(super) visible: Vec<f32>,
    /// Columns and rows of luminance and reflection.
    pub(super) size: [usize; 2],
    /// Densities of luminance, those of each node normalized.
    pub(super) luminance: Vec<f32>,
    pub(super) reflection: Vec<Spectrum>,
    pub(super) is_relative: bool,
}

impl Measured {
    /// Makes a material. The error names a table of a wrong size, or with a value that is negative or not finite.
    pub(super) fn new(tables: MeasuredTables) -> Result<Self, MeasuredError> {
        let MeasuredTables { visible_size, size, is_relative, .. } = tables;
        let nodes = NodeGrid::new(tables.phi, tables.theta)?;
        check_values("ndf", tables.normals.size, 1, &tables.normals.values)?;
        check_values("sigma", tables.area.size, 1, &tables.area.values)?;
        check_values("vndf", visible_size, nodes.len(), &tables.visible)?;
        check_values("luminance", size, nodes.len(), &tables.luminance)?;
        check_count("spectra", size, nodes.len(), tables.reflection.len())?;
        let is_color = |color: &Spectrum| color.is_finite() && color.min_element() >= 0.0;
        if let Some(index) = tables.reflection.iter().position(|color| !is_color(color)) {
            return Err(MeasuredError::Value { name: "spectra", index, value: tables.reflection[index].min_element() });
        }
        let albedos = tables.reflection.chunks_exact(size[0] * size[1]).map(|table| albedo(size, table, is_relative));
        Ok(Self {
            name: tables.name,
            symmetry: Symmetry::of_nodes(&nodes.phi)?,
            nodes,
            normals: tables.normals,
            area: tables.area,
            visible: Warp::new(visible_size, tables.visible),
            luminance: Warp::new(size, tables.luminance),
            albedos: albedos.collect(),
            reflection: tables.reflection,
            is_relative,
        })
    }

    /// Returns the part of the directions of view that has nodes.
    pub fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    /// Returns the nodes around a direction of view, by its angles around and against the normal, in radians.
    pub fn nodes(&self, phi: f32, theta: f32) -> NodeWeights {
        self.nodes.around(phi, theta)
    }

    /// Returns the warp of even points to points of the other tables, more of them where more is reflected.
    pub fn luminance(&self) -> &Warp {
        &self.luminance
    }

    /// Returns the warp of points to facets, by the area of the facets that is visible.
    pub fn visible_normals(&self) -> &Warp {
        &self.visible
    }

    /// Returns the factor of the reflection at a point: D ∕ (4 σ), or 1 if the reflection is absolute. 0 from directions
    /// in which no facet is visible.
    ///
    /// - `facet`: point of the facet.
    /// - `view`: that of a facet whose normal is the direction of view.
    pub fn mirroring(&self, facet: [f32; 2], view: [f32; 2]) -> f32 {
        if !self.is_relative {
            return 1.0;
        }
        let area = self.area.at(view);
        if area > 0.0 { self.normals.at(facet) / (4.0 * area) } else { 0.0 }
    }

    /// Returns the reflection at a point of the square.
    pub fn reflection(&self, nodes: &NodeWeights, p: [f32; 2]) -> Spectrum {
        let stride = self.luminance.size[0] * self.luminance.size[1];
        Cell::at(self.luminance.size, p).bilinear(|index| nodes.mean(|node| self.reflection[node * stride + index]))
    }

    /// Estimates the share of the light from a direction that is reflected, without what is lost at the horizon.
    pub fn albedo(&self, nodes: &NodeWeights) -> Spectrum {
        nodes.mean(|node| self.albedos[node])
    }

    /// Returns the perceptual roughness of microfacets (GGX) with as many facets along the normal, in [0.02, 0.9].
    pub fn roughness(&self) -> f32 {
        let straight = self.normals.at([0.0, 0.5]);
        let alpha = 1.0 / (std::f32::consts::PI * straight).sqrt();
        alpha.sqrt().clamp(ROUGHNESS[0], ROUGHNESS[1])
    }

    /// Returns the memory of the tables, in bytes.
    pub fn memory_bytes(&self) -> usize {
        let tables = self.normals.values.len() + self.area.values.len();
        tables_bytes(tables, self.visible.densities.len() + self.luminance.densities.len(), self.reflection.len())
    }
}

/// Returns the memory of tables, of warps and of colors by the numbers of their values, in bytes.
pub(super) fn tables_bytes(tables: usize, warps: usize, colors: usize) -> usize {
    // A warp has densities and integrals
    let numbers = warps.saturating_mul(2).saturating_add(tables).saturating_mul(size_of::<f32>());
    colors.saturating_mul(size_of::<Spectrum>()).saturating_add(numbers)
}

impl fmt::Debug for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (nodes, [columns, rows]) = (self.nodes.len(), self.luminance.size);
        write!(f, "Measured({:?}, {nodes} tables of {columns} × {rows})", self.name)
    }
}

/// Returns the mean of a node's table. Of relative reflection it is the albedo; absolute reflection counts as even.
fn albedo([columns, rows]: [usize; 2], table: &[Spectrum], is_relative: bool) -> Spectrum {
    // Points at the edge belong to half as many cells
    let weight = |index: usize, count: usize| if index == 0 || index == count - 1 { 0.5 } else { 1.0 };
    let weights = (0..columns * rows).map(|at| weight(at % columns, columns) * weight(at / columns, rows));
    let sum: Spectrum = table.iter().zip(weights).map(|(value, weight)| *value * weight).sum();
    let mean = sum / ((columns - 1) * (rows - 1)) as f32;
    let share = if is_relative { mean } else { mean * std::f32::consts::TAU };
    share.min(Spectrum::ONE)
}

fn check_values(name: &'static str, size: [usize; 2], nodes: usize, values: &[f32]) -> Result<(), MeasuredError> {
    check_count(name, size, nodes, values.len())?;
    match values.iter().position(|value| !(value.is_finite() && *value >= 0.0)) {
        Some(index) => Err(MeasuredError::Value { name, index, value: values[index] }),
        None => Ok(()),
    }
}

fn check_count(
    name: &'static str,
    [columns, rows]: [usize; 2],
    nodes: usize,
    count: usize,
) -> Result<(), MeasuredError> {
    let wanted = columns.checked_mul(rows).and_then(|points| points.checked_mul(nodes));
    if columns >= 2 && rows >= 2 && wanted == Some(count) {
        return Ok(());
    }
    let found = format!("{rows} × {columns} with {count} values");
    Err(MeasuredError::Shape { name, found, wanted: format!("2 × 2 or more for each of {nodes} directions") })
}
