//! Grids of a file of voxels, for media.

use std::path::PathBuf;

use bottega::{
    Error,
    glam::{DAffine3, DMat4, Vec3},
    scene::{Blackbody, Density, EmissionVariation, Grid, LoadOptions, SceneError, Variation, Voxels},
};
use pyo3::prelude::*;

use crate::{
    errors::{raised, wrong},
    numpy_input::transforms,
};

/// The density, and perhaps the temperatures, of an OpenVDB or NanoVDB file. Media share it.
#[pyclass(name = "Voxels", module = "bottega", frozen)]
pub(crate) struct PyVoxels {
    voxels: Voxels,
}

#[pymethods]
impl PyVoxels {
    /// Reads a file. `density`, `temperature`: names of grids.
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "Python's paths come as values")]
    #[pyo3(signature = (path, density = "density", temperature = None))]
    fn new(py: Python<'_>, path: PathBuf, density: &str, temperature: Option<&str>) -> PyResult<Self> {
        let limit = LoadOptions::default().max_memory_bytes;
        let read = py.detach(|| Voxels::read(&path, density, temperature, limit));
        match read.map_err(scene_error)? {
            Some(voxels) => Ok(Self { voxels }),
            None => Err(wrong("density", &format!("`{}` has no voxels in a grid `{density}`", path.display()))),
        }
    }

    /// Returns the grids of a file: names, and kinds of values such as `float`.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "Python's paths come as values")]
    fn grids(path: PathBuf) -> PyResult<Vec<(String, String)>> {
        Voxels::list(&path, LoadOptions::default().max_memory_bytes).map_err(scene_error)
    }

    /// The box of the grids: rows of the (4, 4) matrix from the unit cube to the space of the file.
    #[getter]
    fn transform(&self) -> [[f64; 4]; 4] {
        DMat4::from(self.voxels.file_from_cube).transpose().to_cols_array_2d()
    }

    /// Greatest density.
    #[getter]
    fn density_max(&self) -> f32 {
        greatest(&self.voxels.density)
    }

    /// Greatest temperature; `None`: there are none.
    #[getter]
    fn temperature_max(&self) -> Option<f32> {
        self.voxels.temperatures.as_ref().map(greatest)
    }

    fn __repr__(&self) -> String {
        let [x, y, z] = self.voxels.density.size();
        format!("<bottega.Voxels {x}x{y}x{z}>")
    }
}

fn scene_error(error: SceneError) -> PyErr {
    raised(&Error::from(error))
}

fn greatest(grid: &Grid) -> f32 {
    grid.max_within([Vec3::ZERO, Vec3::ONE]).max_element()
}

/// The voxels of a medium as Python gives them: voxels, `temperature_scale`, `temperature_offset`, and `peaks` or `power`.
/// Temperatures are (values − offset) · scale, in kelvin.
#[derive(FromPyObject)]
pub(crate) struct PlacedVoxels<'py>(PyRef<'py, PyVoxels>, f32, f32, String);

impl PlacedVoxels<'_> {
    /// Returns the variation of a medium. `transform`: from the space of the file to the world; `None`: the same.
    pub(crate) fn variation(&self, transform: Option<&Bound<'_, PyAny>>) -> PyResult<Variation> {
        let Self(shared, scale, offset, blackbody) = self;
        let Voxels { density, temperatures, .. } = &shared.voxels;
        let placed = transform.map(transforms).transpose()?.unwrap_or_default();
        let world_from_file = placed.first().map_or(DAffine3::IDENTITY, |matrix| {
            let columns = matrix.to_cols_array().map(f64::from);
            DAffine3::from_cols_array(&columns)
        });
        let Some(grid_from_world) = shared.voxels.grid_from_world(&world_from_file) else {
            return Err(wrong("transform", "the matrix is singular; its determinant must not be 0"));
        };
        let emission = temperatures.clone().map(|grid| match blackbody.as_str() {
            "power" => Ok(Blackbody::of_power(grid, *scale, *offset)),
            "peaks" => Ok(Blackbody::of_equal_peaks(grid, *scale, *offset, |color| color)),
            other => Err(wrong("blackbody", &format!("it is {other:?}; 'peaks' or 'power' is needed"))),
        });
        let emission = emission.transpose()?.map(EmissionVariation::Blackbody);
        Ok(Variation { density: Density::Both(density.clone()), emission, grid_from_world })
    }
}
