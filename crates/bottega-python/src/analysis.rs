//! The Analyst's view of a scene.

use bottega::{
    Error, Request,
    analysis::{AnalyzedScene, ZoneAnalysis, zones},
    scene::Loaded,
    settings::{importance_function, level},
};
use numpy::{IntoPyArray, PyArray2, PyUntypedArrayMethods, ndarray::Array2};
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::{errors, process::refuse_forked, request::request_of, scene::PyScene, values::to_python, waiting::Caller};

/// The Analyst's view of a scene: importance map and zones.
#[pyclass(name = "Analysis", module = "bottega", frozen, get_all)]
pub(crate) struct PyAnalysis {
    /// Predicted cost per pixel, by cell: float32, (rows, columns); 1 is the mean of the picture.
    cost: Py<PyArray2<f32>>,
    /// Visual importance, by cell: float32, (rows, columns), 0 to 1: how visible an error is.
    importance: Py<PyArray2<f32>>,
    /// The zones: uint32, (count, 4): x0, y0, x1, y1; x1 and y1 are one past the zone.
    rects: Py<PyArray2<u32>>,
    /// The zones as dictionaries: `id`, `rect`, `size`, `complexity`, `share_of_cost`, `neighbor_difference`, `edge_differences`,
    /// `visual_importance`.
    zones: Py<PyAny>,
    /// Width and height of the picture in pixels.
    size: (u32, u32),
    /// Number of Render Agents for which the picture is divided.
    agents: usize,
}

#[pymethods]
impl PyAnalysis {
    fn __repr__(&self, py: Python<'_>) -> String {
        let ((width, height), zones) = (self.size, self.rects.bind(py).shape()[0]);
        format!("<bottega.Analysis {width}x{height}, {zones} zones for {} agents>", self.agents)
    }
}

/// The result of the analyzing thread.
struct AnalysisArrays {
    cost: Vec<f32>,
    importance: Vec<f32>,
    cells: (u32, u32),
    zones: Vec<ZoneAnalysis>,
    size: (u32, u32),
    agents: usize,
}

fn find(request: Request, scene: Option<Loaded>) -> Result<AnalysisArrays, Error> {
    let subject = match scene {
        None => AnalyzedScene::open(request)?,
        Some(scene) => AnalyzedScene::of_scene(request, scene)?,
    };
    let work = &subject.request.work;
    let analysis = subject.analyze(importance_function(work), level(work.level))?;
    Ok(AnalysisArrays {
        cost: analysis.map.cost().to_vec(),
        importance: analysis.map.importance().to_vec(),
        cells: analysis.map.size(),
        zones: zones(&analysis),
        size: (subject.frame().width(), subject.frame().height()),
        agents: subject.agents,
    })
}

/// Returns the importance map of a scene, and its zones by the settings in `work` of the request.
#[pyfunction]
#[pyo3(signature = (request, scene=None))]
pub(crate) fn analyze(py: Python<'_>, request: &str, scene: Option<&Bound<'_, PyScene>>) -> PyResult<PyAnalysis> {
    refuse_forked()?;
    let request = request_of(request)?;
    let scene = scene.map(|scene| scene.get().finished()).transpose()?;
    let found = Caller::new(py).wait_for(move |_, _| find(request, scene))?.whole()?;
    let found = found.map_err(|error| errors::raised(&error))?;
    let (columns, rows) = found.cells;
    let cells = |values| table(py, (rows as usize, columns as usize), values);
    let rects: Vec<u32> = found.zones.iter().flat_map(|zone| zone.rect).collect();
    Ok(PyAnalysis {
        cost: cells(found.cost)?,
        importance: cells(found.importance)?,
        rects: table(py, (found.zones.len(), 4), rects)?,
        zones: to_python(py, &found.zones)?.unbind(),
        size: found.size,
        agents: found.agents,
    })
}

fn table<T: numpy::Element>(py: Python<'_>, shape: (usize, usize), values: Vec<T>) -> PyResult<Py<PyArray2<T>>> {
    let array = Array2::from_shape_vec(shape, values).map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(array.into_pyarray(py).unbind())
}
