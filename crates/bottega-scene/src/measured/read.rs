//! Reading of measured materials.

use std::path::Path;

use glam::DVec3;

use super::error::MeasuredError;
use super::material::{Measured, MeasuredTables, tables_bytes};
use super::tensor::{F32, TensorField, TensorFile, U8};
use super::warp::{SquareTable, normalize};
use crate::budget::MemoryBudget;
use crate::color::Spectrum;
use crate::error::SceneError;
use crate::spectrum::sampled::reflectance_weights;

/// Reads a measured material.
///
/// - `path`: for errors, and for the name.
/// - `bytes`: the file.
pub(super) fn read(path: &Path, bytes: &[u8], budget: &MemoryBudget) -> Result<Measured, SceneError> {
    let in_file = |error: MeasuredError| error.in_file(path);
    let file = TensorFile::read(bytes).map_err(in_file)?;
    let fields = MaterialFields::of(&file).map_err(in_file)?;
    budget.take(path, "its tables", fields.memory_bytes())?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    fields.tables(name).and_then(Measured::new).map_err(in_file)
}

/// The fields of a measured material.
struct MaterialFields<'a> {
    phi: &'a TensorField<'a>,
    theta: &'a TensorField<'a>,
    normals: &'a TensorField<'a>,
    area: &'a TensorField<'a>,
    visible: &'a TensorField<'a>,
    luminance: &'a TensorField<'a>,
    colors: &'a TensorField<'a>,
    /// Name of `colors`: `rgb` or `spectra`.
    colors_name: &'static str,
    /// Wavelengths in nanometres; `None`: the channels are red, green and blue.
    wavelengths: Option<&'a TensorField<'a>>,
    is_relative: bool,
}

impl<'a> MaterialFields<'a> {
    /// Finds the fields, and checks that their shapes fit together.
    fn of(file: &'a TensorFile<'a>) -> Result<Self, MeasuredError> {
        let wavelengths = file.find("wavelengths").map(|_| file.field("wavelengths", F32, 1)).transpose()?;
        let colors_name = if wavelengths.is_some() { "spectra" } else { "rgb" };
        let fields = Self {
            phi: file.field("phi_i", F32, 1)?,
            theta: file.field("theta_i", F32, 1)?,
            normals: file.field("ndf", F32, 2)?,
            area: file.field("sigma", F32, 2)?,
            visible: file.field("vndf", F32, 4)?,
            luminance: file.field("luminance", F32, 4)?,
            colors: file.field(colors_name, F32, 5)?,
            colors_name,
            wavelengths,
            is_relative: file.field("jacobian", U8, 1)?.bytes.first().is_some_and(|&byte| byte != 0),
        };
        let [phi, theta] = [fields.phi, fields.theta].map(|field| field.shape[0]);
        let channels = fields.wavelengths.map_or(3, |field| field.shape[0]);
        let side = fields.luminance.shape[3];
        let checks = [
            ("vndf", fields.visible, vec![phi, theta]),
            ("luminance", fields.luminance, vec![phi, theta, side]),
            (colors_name, fields.colors, vec![phi, theta, channels, side, side]),
        ];
        for (name, field, begin) in checks {
            if !field.shape.starts_with(&begin) {
                let begin: Vec<String> = begin.iter().map(usize::to_string).collect();
                let wanted = format!("one that begins with {}", begin.join(" × "));
                return Err(MeasuredError::Shape { name, found: field.shape_text(), wanted });
            }
        }
        Ok(fields)
    }

    /// Returns the memory of the material, in bytes.
    fn memory_bytes(&self) -> usize {
        let count = |field: &TensorField<'_>| field.bytes.len() / size_of::<f32>();
        let (tables, warps) = (count(self.normals) + count(self.area), count(self.visible) + count(self.luminance));
        tables_bytes(tables, warps, count(self.luminance))
    }

    /// Reads the tables. `name`: that of the material.
    fn tables(&self, name: String) -> Result<MeasuredTables, MeasuredError> {
        let (visible_size, size) = (size_of_table(self.visible), size_of_table(self.luminance));
        Ok(MeasuredTables {
            name,
            phi: self.phi.numbers("phi_i")?,
            theta: self.theta.numbers("theta_i")?,
            normals: SquareTable { size: size_of_table(self.normals), values: amounts("ndf", self.normals)? },
            area: SquareTable { size: size_of_table(self.area), values: amounts("sigma", self.area)? },
            visible_size,
            visible: densities("vndf", self.visible, visible_size)?,
            size,
            luminance: densities("luminance", self.luminance, size)?,
            reflection: self.reflection(size[0] * size[1])?,
            is_relative: self.is_relative,
        })
    }

    /// Returns the reflection as colors, by node and point. `points`: of a node.
    fn reflection(&self, points: usize) -> Result<Vec<Spectrum>, MeasuredError> {
        let values = self.colors.numbers(self.colors_name)?;
        let weights = match self.wavelengths {
            None => vec![DVec3::X, DVec3::Y, DVec3::Z],
            Some(field) => {
                let wavelengths: Vec<f64> = field.numbers("wavelengths")?.into_iter().map(f64::from).collect();
                reflectance_weights(&wavelengths).map_err(|error| MeasuredError::Wavelengths(error.to_string()))?
            }
        };
        let nodes = values.chunks_exact((points * weights.len()).max(1));
        let color = |node: &[f32], point: usize| {
            let parts = weights.iter().zip(node.chunks_exact(points));
            let sum: DVec3 = parts.map(|(weight, channel)| *weight * f64::from(channel[point])).sum();
            // Colors out of gamut, and noise below 0
            sum.max(DVec3::ZERO).as_vec3()
        };
        Ok(nodes.flat_map(|node| (0..points).map(move |point| color(node, point))).collect())
    }
}

/// Returns columns and rows of a field's tables: its last two axes.
fn size_of_table(field: &TensorField<'_>) -> [usize; 2] {
    match field.shape[..] {
        [.., rows, columns] => [columns, rows],
        _ => [0, 0],
    }
}

/// Returns numbers of which the negative ones are noise.
fn amounts(name: &'static str, field: &TensorField<'_>) -> Result<Vec<f32>, MeasuredError> {
    let mut numbers = field.numbers(name)?;
    numbers.iter_mut().for_each(|number| *number = number.max(0.0));
    Ok(numbers)
}

fn densities(name: &'static str, field: &TensorField<'_>, size: [usize; 2]) -> Result<Vec<f32>, MeasuredError> {
    let mut values = amounts(name, field)?;
    if size[0] >= 2 && size[1] >= 2 {
        normalize(size, &mut values);
    }
    Ok(values)
}
