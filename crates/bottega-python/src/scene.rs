//! The Python class of scenes made of arrays.

use std::sync::{Mutex, MutexGuard, PoisonError};

use bottega::{
    glam::{Affine3A, Mat4, Quat, Vec2, Vec3},
    scene::{Camera, Environment, Instance, Light, LightKind, Mesh, Projection, Scene, Sphere},
};
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::{exceptions::PyTypeError, prelude::*};

use crate::{
    errors::{self, wrong},
    material::{PyMaterial, color},
};

/// A scene in memory: meshes of arrays, materials, lights, a camera.
///
/// Coordinates are right-handed, +y up; the front of a face is the side from which its vertices run counter-clockwise. Every
/// method checks its arguments, and raises `SceneError`, which names the argument.
#[pyclass(name = "Scene", module = "bottega", frozen)]
#[derive(Default)]
pub(crate) struct PyScene {
    scene: Mutex<Scene>,
}

/// The kind of numbers in an array.
#[derive(Clone, Copy, PartialEq)]
enum NumberKind {
    Real,
    Whole,
}

/// Converts a value to a contiguous float64 array with `COLUMNS` columns; checks the dtype and the shape.
fn table<'py, const COLUMNS: usize>(
    argument: &str,
    value: &Bound<'py, PyAny>,
    numbers: NumberKind,
) -> PyResult<PyReadonlyArray2<'py, f64>> {
    let numpy = value.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (value,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    let (is_right, needed) = match numbers {
        NumberKind::Real => (["f", "i", "u"].contains(&kind.as_str()), "real numbers, such as float32"),
        NumberKind::Whole => (["i", "u"].contains(&kind.as_str()), "whole numbers, such as uint32"),
    };
    if !is_right {
        let dtype = array.getattr("dtype")?.str()?;
        return Err(wrong(argument, &format!("its dtype is {dtype}: {needed}, are needed")));
    }
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    if shape.len() != 2 || shape[1] != COLUMNS {
        return Err(wrong(argument, &format!("its shape is {shape:?}: (N, {COLUMNS}) is needed")));
    }
    // Whole numbers up to 2⁵³ are exact; vertices have fewer.
    let array = numpy.call_method1("ascontiguousarray", (array, "float64"))?;
    Ok(array.cast_into::<PyArray2<f64>>().map_err(|error| PyTypeError::new_err(error.to_string()))?.readonly())
}

/// Converts a value to rows of finite numbers.
fn rows<const COLUMNS: usize>(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<[f32; COLUMNS]>> {
    let array = table::<COLUMNS>(argument, value, NumberKind::Real)?;
    let rows = array.as_array();
    let row = |(index, row): (usize, numpy::ndarray::ArrayView1<'_, f64>)| {
        let row: [f32; COLUMNS] = std::array::from_fn(|column| row[column] as f32);
        if row.iter().all(|value| value.is_finite()) {
            return Ok(row);
        }
        Err(wrong(argument, &format!("row {index} is {row:?}: finite numbers are needed")))
    };
    rows.rows().into_iter().enumerate().map(row).collect()
}

/// Converts a value to triangles whose vertices exist.
fn triangles_of(value: &Bound<'_, PyAny>, vertex_count: usize) -> PyResult<Vec<[u32; 3]>> {
    let array = table::<3>("triangles", value, NumberKind::Whole)?;
    let rows = array.as_array();
    let row = |(index, row): (usize, numpy::ndarray::ArrayView1<'_, f64>)| {
        if row.iter().all(|&vertex| (0.0..vertex_count as f64).contains(&vertex)) {
            return Ok([row[0] as u32, row[1] as u32, row[2] as u32]);
        }
        let row = row.to_vec();
        Err(wrong("triangles", &format!("row {index} is {row:?}: there are vertices 0 to {}", vertex_count - 1)))
    };
    rows.rows().into_iter().enumerate().map(row).collect()
}

/// Converts an optional value to one row per vertex; empty if there is none.
fn per_vertex<const COLUMNS: usize>(
    argument: &str,
    value: Option<&Bound<'_, PyAny>>,
    vertex_count: usize,
) -> PyResult<Vec<[f32; COLUMNS]>> {
    let rows = value.map_or_else(|| Ok(Vec::new()), |value| rows(argument, value))?;
    if rows.is_empty() || rows.len() == vertex_count {
        return Ok(rows);
    }
    Err(wrong(argument, &format!("it has {} rows, and there are {vertex_count} vertices", rows.len())))
}

/// Converts a (4, 4) matrix to the transform from object to world space.
fn placed(value: Option<&Bound<'_, PyAny>>) -> PyResult<Affine3A> {
    let Some(value) = value else { return Ok(Affine3A::IDENTITY) };
    let rows: Vec<[f32; 4]> = rows("transform", value)?;
    let rows: [[f32; 4]; 4] = rows.try_into().map_err(|rows: Vec<_>| {
        wrong("transform", &format!("its shape is ({}, 4): (4, 4) is needed, which multiplies columns", rows.len()))
    })?;
    if rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(wrong("transform", &format!("its last row is {:?}: 0, 0, 0, 1 is needed", rows[3])));
    }
    let placed = Affine3A::from_mat4(Mat4::from_cols_array_2d(&rows).transpose());
    if placed.matrix3.determinant() > 0.0 {
        return Ok(placed);
    }
    Err(wrong("transform", "it is singular, or mirrors: its determinant must be above 0"))
}

fn point(argument: &str, value: [f32; 3]) -> PyResult<Vec3> {
    let point = Vec3::from_array(value);
    if point.is_finite() {
        Ok(point)
    } else {
        Err(wrong(argument, &format!("it is {value:?}: finite numbers are needed")))
    }
}

fn direction(argument: &str, value: [f32; 3]) -> PyResult<Vec3> {
    let direction = point(argument, value)?.try_normalize();
    direction.ok_or_else(|| wrong(argument, "it has no length, so it is no direction"))
}

fn above_zero(argument: &str, value: f32) -> PyResult<f32> {
    if value > 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(wrong(argument, &format!("it is {value}: above 0 is needed")))
}

impl PyScene {
    fn scene(&self) -> MutexGuard<'_, Scene> {
        self.scene.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns a copy of the scene, after checking that it has a camera.
    pub(crate) fn finished(&self) -> PyResult<Scene> {
        let scene = self.scene().clone();
        if scene.cameras.is_empty() {
            return Err(errors::failed("the scene has no camera", "scene.camera(eye=(0, 1, 5), target=(0, 0, 0))"));
        }
        Ok(scene)
    }
}

#[pymethods]
impl PyScene {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Adds a mesh and places it once. Returns its number, for `instance`.
    ///
    /// - `vertices`: (N, 3), real numbers; float64 is rounded to float32.
    /// - `triangles`: (M, 3), whole numbers below N, counter-clockwise seen from the front.
    /// - `normals`: (N, 3), one per vertex; normalized. Without them faces are flat.
    /// - `uvs`: (N, 2), texture coordinates.
    /// - `colors`: (N, 4), linear R G B A that multiply the color of a layered material.
    /// - `transform`: (4, 4), from mesh to world space, for column vectors; its determinant must be above 0.
    #[pyo3(signature = (vertices, triangles, material, *, normals=None, uvs=None, colors=None, transform=None, name=String::new()))]
    fn mesh(
        &self,
        vertices: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        material: &Bound<'_, PyMaterial>,
        normals: Option<&Bound<'_, PyAny>>,
        uvs: Option<&Bound<'_, PyAny>>,
        colors: Option<&Bound<'_, PyAny>>,
        transform: Option<&Bound<'_, PyAny>>,
        name: String,
    ) -> PyResult<u32> {
        let positions: Vec<Vec3> = rows("vertices", vertices)?.into_iter().map(Vec3::from_array).collect();
        let count = positions.len();
        if count == 0 {
            return Err(wrong("vertices", "there are none"));
        }
        let normals = per_vertex("normals", normals, count)?.into_iter().map(|normal| direction("normals", normal));
        let mesh = Mesh {
            name,
            triangles: triangles_of(triangles, count)?,
            normals: normals.collect::<PyResult<_>>()?,
            uvs: [per_vertex("uvs", uvs, count)?.into_iter().map(Vec2::from_array).collect(), Vec::new()],
            colors: per_vertex("colors", colors, count)?.into_iter().map(Into::into).collect(),
            positions,
            ..Mesh::default()
        };
        let world_from_object = placed(transform)?;
        let mut scene = self.scene();
        let (number, material_number) = (scene.meshes.len() as u32, scene.materials.len() as u32);
        scene.materials.push(material.get().material.clone());
        scene.meshes.push(Mesh { material: material_number, ..mesh });
        scene.instances.push(Instance { mesh: number, world_from_object });
        Ok(number)
    }

    /// Adds another instance of a mesh, by its number.
    fn instance(&self, mesh: u32, transform: &Bound<'_, PyAny>) -> PyResult<()> {
        let world_from_object = placed(Some(transform))?;
        let mut scene = self.scene();
        if mesh as usize >= scene.meshes.len() {
            return Err(wrong("mesh", &format!("there is no mesh {mesh}: the scene has {}", scene.meshes.len())));
        }
        scene.instances.push(Instance { mesh, world_from_object });
        Ok(())
    }

    /// Adds a sphere; `center` and `radius` are in scene units.
    fn sphere(&self, center: [f32; 3], radius: f32, material: &Bound<'_, PyMaterial>) -> PyResult<()> {
        let (center, radius) = (point("center", center)?, above_zero("radius", radius)?);
        let mut scene = self.scene();
        let number = scene.materials.len() as u32;
        scene.materials.push(material.get().material.clone());
        scene.spheres.push(Sphere { center, radius, world_from_object: Quat::IDENTITY, material: number });
        Ok(())
    }

    /// Adds a camera at `eye` that looks at `target`. The first camera is the default.
    ///
    /// - `fov`: full vertical field of view, in degrees.
    /// - `lens_radius`: in scene units; 0: everything is sharp. `focus_distance`: distance of the sharp plane; `None`: that of
    ///   `target`.
    #[pyo3(signature = (eye, target, *, up=[0.0, 1.0, 0.0], fov=40.0, lens_radius=0.0, focus_distance=None, name=String::new()))]
    fn camera(
        &self,
        eye: [f32; 3],
        target: [f32; 3],
        up: [f32; 3],
        fov: f32,
        lens_radius: f32,
        focus_distance: Option<f32>,
        name: String,
    ) -> PyResult<()> {
        let (eye, target, up) = (point("eye", eye)?, point("target", target)?, direction("up", up)?);
        let world_from_camera = Camera::looking(eye, target, up)
            .ok_or_else(|| wrong("target", "it lies at `eye`, or straight in the direction of `up`"))?;
        if !(fov > 0.0 && fov < 180.0) {
            return Err(wrong("fov", &format!("it is {fov}: above 0 and below 180 degrees is needed")));
        }
        if !(lens_radius >= 0.0 && lens_radius.is_finite()) {
            return Err(wrong("lens_radius", &format!("it is {lens_radius}: from 0 is allowed")));
        }
        self.scene().cameras.push(Camera {
            name,
            world_from_camera,
            projection: Projection::Perspective { vertical_fov: fov.to_radians() },
            lens_radius,
            focus_distance: above_zero("focus_distance", focus_distance.unwrap_or(eye.distance(target)))?,
            ..Camera::default()
        });
        Ok(())
    }

    /// Adds a point light. `intensity`: R G B in W·sr⁻¹.
    fn point_light(&self, position: [f32; 3], intensity: [f32; 3]) -> PyResult<()> {
        let kind =
            LightKind::Point { position: point("position", position)?, intensity: color("intensity", intensity)? };
        self.scene().lights.push(Light { name: String::new(), kind });
        Ok(())
    }

    /// Adds a directional light. `direction`: direction of travel. `irradiance`: R G B on a perpendicular surface, in W·m⁻².
    fn sun(&self, direction: [f32; 3], irradiance: [f32; 3]) -> PyResult<()> {
        let direction = self::direction("direction", direction)?;
        let kind = LightKind::Directional { direction, irradiance: color("irradiance", irradiance)? };
        self.scene().lights.push(Light { name: String::new(), kind });
        Ok(())
    }

    /// Adds a uniform environment light. `radiance`: R G B in W·sr⁻¹·m⁻².
    fn environment(&self, radiance: [f32; 3]) -> PyResult<()> {
        let radiance = color("radiance", radiance)?;
        self.scene().environment = Some(Environment::uniform(radiance));
        Ok(())
    }

    fn __repr__(&self) -> String {
        let scene = self.scene();
        let (meshes, cameras) = (scene.meshes.len(), scene.cameras.len());
        format!("<bottega.Scene of {meshes} meshes, {} triangles, {cameras} cameras>", scene.triangle_count())
    }
}
