//! The Python class of scenes in memory: a scene editor behind a lock.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bottega::{
    glam::Affine3A,
    scene::{
        Camera, CornerMesh, CurveLook, CurveStrands, Density, EditedLight, EmissionVariation, EntryKind, Environment,
        ImageId, Loaded, Material, Medium, MediumId, PlacedObject, PutMode, RenderHints, Scene, SceneEditor, Shutter,
        Sphere, TransformKey, Variation, Visibility, load, save_scene,
    },
};
use numpy::{IntoPyArray, PyArray3, ndarray::Array3};
use pyo3::{exceptions::PyValueError, prelude::*};
use serde::{Serialize, de::DeserializeOwned};

use crate::{
    errors::{self, wrong},
    image_input::{grid_of, image_of},
    numpy_input::{InputArray, maybe_rows, transforms},
    request::request_of,
    values::path_of,
    voxels::PlacedVoxels,
    waiting::Caller,
};

/// A key of a moving mesh: time, positions and normals.
type MeshKeyInput<'py> = (f64, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>);

/// A scene in memory. The Python class `bottega.Scene` wraps it; values come and go as JSON, arrays as they are.
#[pyclass(name = "Scene", module = "bottega._native", frozen)]
#[derive(Default)]
pub(crate) struct PyScene {
    editor: Mutex<SceneEditor>,
    /// Render settings of the file that the scene was read from.
    hints: RenderHints,
}

impl PyScene {
    /// Returns the editor; other threads wait until it is released.
    pub(crate) fn editor(&self) -> MutexGuard<'_, SceneEditor> {
        self.editor.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the scene as it is now, after checking that it has a camera. Meshes and images are shared.
    pub(crate) fn finished(&self) -> PyResult<Loaded> {
        let scene = self.editor().snapshot();
        if scene.cameras.is_empty() {
            let remedy = "scene.cameras[\"main\"] = bottega.Camera.looking(eye=(0, 1, 5), target=(0, 0, 0))";
            return Err(errors::failed("the scene has no camera", remedy));
        }
        Ok(self.loaded(scene))
    }

    /// Returns a state of the scene with the render settings of its file.
    pub(crate) fn loaded(&self, scene: Scene) -> Loaded {
        Loaded { hints: self.hints.clone(), ..Loaded::from(scene) }
    }
}

/// Returns a kind by its name.
pub(crate) fn kind_of(name: &str) -> PyResult<EntryKind> {
    use EntryKind::{Camera, Image, Light, Material, Medium, Mesh, Object, Sphere};
    let kinds = [Image, Medium, Material, Mesh, Object, Sphere, Light, Camera];
    let kind = kinds.into_iter().find(|kind| kind.to_string() == name);
    kind.ok_or_else(|| PyValueError::new_err(format!("there is no kind `{name}` of things in a scene")))
}

/// Returns whether a key must be new.
pub(crate) fn put_mode(is_new: bool) -> PutMode {
    if is_new { PutMode::New } else { PutMode::AddOrReplace }
}

/// Returns kinds of ray by their bits.
fn visibility_of(bits: u8) -> PyResult<Visibility> {
    Visibility::try_from(bits).map_err(|problem| wrong("visibility", &problem))
}

/// Reads a value from its JSON text.
pub(crate) fn parsed<T: DeserializeOwned>(argument: &str, json: &str) -> PyResult<T> {
    serde_json::from_str(json).map_err(|error| errors::wrong(argument, &error.to_string()))
}

/// Returns a value as a JSON text.
pub(crate) fn text_of(value: &impl Serialize) -> String {
    // Values of a scene cannot fail to serialize: they have no maps.
    serde_json::to_string(value).unwrap_or_default()
}

#[pymethods]
impl PyScene {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Reads the scene file of a request. Returns the scene and the warnings about it.
    #[staticmethod]
    fn read(py: Python<'_>, request: &str) -> PyResult<(Self, Vec<String>)> {
        let request = request_of(request)?;
        let options = request.scene.load_options();
        let read = Caller::new(py).wait_for(move |_, _| load(&request.scene.file, &options))?.whole()?;
        let Loaded { scene, warnings, hints, .. } = read.map_err(|error| errors::raised(&error.into()))?;
        let editor = Mutex::new(SceneEditor::of(scene));
        Ok((Self { editor, hints }, warnings.iter().map(ToString::to_string).collect()))
    }

    /// Writes the scene as it is now to a file of Bottega's own format, with render settings that it asks for.
    #[pyo3(signature = (file, size=None, spp=None, max_depth=None))]
    fn save(
        &self,
        py: Python<'_>,
        file: &Bound<'_, PyAny>,
        size: Option<[u32; 2]>,
        spp: Option<u32>,
        max_depth: Option<u32>,
    ) -> PyResult<()> {
        let (file, scene) = (path_of(file)?, self.editor().snapshot());
        let hints = RenderHints {
            resolution: size.or(self.hints.resolution),
            samples: spp.or(self.hints.samples),
            max_depth: max_depth.or(self.hints.max_depth),
            ..self.hints.clone()
        };
        let saved = Caller::new(py).wait_for(move |_, _| save_scene(&file, &scene, &hints))?;
        saved.whole()?.map_err(|error| errors::raised(&error.into()))
    }

    /// Returns the keys of a kind, in the order in which they were added.
    fn keys(&self, kind: &str) -> PyResult<Vec<String>> {
        Ok(self.editor().keys(kind_of(kind)?).into_iter().map(str::to_owned).collect())
    }

    /// Returns the number of things of a kind.
    fn count(&self, kind: &str) -> PyResult<usize> {
        Ok(self.editor().count(kind_of(kind)?))
    }

    /// Returns true if there is something of a kind with this key.
    fn contains(&self, kind: &str, key: &str) -> PyResult<bool> {
        Ok(self.editor().contains(kind_of(kind)?, key))
    }

    /// Removes something.
    fn remove(&self, kind: &str, key: &str) -> PyResult<()> {
        self.editor().remove(kind_of(kind)?, key).map_err(|error| errors::edit(&error))
    }

    /// Hides or shows an object, a sphere or a light.
    fn hide(&self, kind: &str, key: &str, hidden: bool) -> PyResult<()> {
        self.editor().hide(kind_of(kind)?, key, hidden).map_err(|error| errors::edit(&error))
    }

    /// Returns true if something is hidden.
    fn is_hidden(&self, kind: &str, key: &str) -> PyResult<bool> {
        self.editor().is_hidden(kind_of(kind)?, key).map_err(|error| errors::edit(&error))
    }

    /// Brings the things of a kind into the order of some keys; the others follow.
    #[expect(clippy::needless_pass_by_value, reason = "a list of Python comes as a value")]
    fn arrange(&self, kind: &str, keys: Vec<String>) -> PyResult<()> {
        self.editor().arrange(kind_of(kind)?, &keys).map_err(|error| errors::edit(&error))
    }

    /// Adds or replaces a material, a light or a camera, from its JSON text.
    fn put(&self, kind: &str, key: &str, json: &str, is_new: bool) -> PyResult<()> {
        let (mut editor, mode) = (self.editor(), put_mode(is_new));
        let put = match kind_of(kind)? {
            EntryKind::Material => editor.put_material(key, parsed::<Material>(kind, json)?, mode),
            EntryKind::Light => editor.put_light(key, parsed::<EditedLight>(kind, json)?, mode),
            EntryKind::Camera => editor.put_camera(key, parsed::<Camera>(kind, json)?, mode),
            kind => return Err(PyValueError::new_err(format!("a {kind} is not put as JSON"))),
        };
        put.map_err(|error| errors::edit(&error))
    }

    /// Returns a material, a light, a camera or a medium as a JSON text.
    fn get(&self, kind: &str, key: &str) -> PyResult<String> {
        let editor = self.editor();
        let text = match kind_of(kind)? {
            EntryKind::Material => editor.material(key).map(text_of),
            EntryKind::Light => editor.light(key).map(text_of),
            EntryKind::Camera => editor.camera(key).map(text_of),
            EntryKind::Medium => editor.medium(key).map(text_of),
            kind => return Err(PyValueError::new_err(format!("a {kind} is not returned as JSON"))),
        };
        text.map_err(|error| errors::edit(&error))
    }

    /// Adds or replaces a sphere, from its JSON text and the key of its material.
    fn put_sphere(&self, key: &str, json: &str, material: String, is_new: bool) -> PyResult<()> {
        let sphere: Sphere = parsed("sphere", json)?;
        let put = self.editor().put_sphere(key, sphere, material, put_mode(is_new));
        put.map_err(|error| errors::edit(&error))
    }

    /// Returns a sphere as a JSON text, and the key of its material.
    fn sphere(&self, key: &str) -> PyResult<(String, String)> {
        let editor = self.editor();
        let (sphere, material) = editor.sphere(key).map_err(|error| errors::edit(&error))?;
        Ok((text_of(sphere), material.to_owned()))
    }

    /// Sets the environment, from a JSON text; `null`: it is black.
    fn set_environment(&self, json: &str) -> PyResult<()> {
        let environment: Option<Environment> = parsed("environment", json)?;
        self.editor().set_environment(environment).map_err(|error| errors::edit(&error))
    }

    /// Returns the environment as a JSON text; `null`: it is black.
    fn environment(&self) -> String {
        text_of(&self.editor().environment())
    }

    /// Returns the number by which JSON texts refer to an image or a medium.
    fn number(&self, kind: &str, key: &str) -> PyResult<u32> {
        let editor = self.editor();
        let number = match kind_of(kind)? {
            EntryKind::Image => editor.image_id(key).map(|id| id.0),
            EntryKind::Medium => editor.medium_id(key).map(|id| id.0),
            kind => return Err(PyValueError::new_err(format!("a {kind} has no number"))),
        };
        number.map_err(|error| errors::edit(&error))
    }

    /// Returns the key of an image or a medium by its number.
    fn key_of(&self, kind: &str, number: u32) -> PyResult<Option<String>> {
        let editor = self.editor();
        Ok(match kind_of(kind)? {
            EntryKind::Image => editor.image_key(ImageId(number)).map(str::to_owned),
            EntryKind::Medium => editor.medium_key(MediumId(number)).map(str::to_owned),
            _ => None,
        })
    }

    /// Returns the number of triangles that are shown, once per instance.
    fn triangle_count(&self) -> u64 {
        self.editor().snapshot().triangle_count()
    }

    /// Adds or replaces a mesh by corner.
    #[expect(clippy::needless_pass_by_value, reason = "a list of Python comes as a value")]
    #[pyo3(signature = (
        key, positions, triangles, corner_vertices, normals, uvs, uvs2, colors, triangle_materials, materials, drop_empty,
        is_new, motion
    ))]
    fn put_mesh(
        &self,
        key: &str,
        positions: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        corner_vertices: Option<&Bound<'_, PyAny>>,
        normals: Option<&Bound<'_, PyAny>>,
        uvs: Option<&Bound<'_, PyAny>>,
        uvs2: Option<&Bound<'_, PyAny>>,
        colors: Option<&Bound<'_, PyAny>>,
        triangle_materials: Option<&Bound<'_, PyAny>>,
        materials: Vec<String>,
        drop_empty: bool,
        is_new: bool,
        motion: Vec<MeshKeyInput<'_>>,
    ) -> PyResult<()> {
        let positions = InputArray::<f32>::table("positions", positions, 3)?;
        let triangles = InputArray::<i32>::table("triangles", triangles, 3)?;
        let corner_vertices = InputArray::<i32>::maybe("corner_vertices", corner_vertices, 1)?;
        let normals = InputArray::<f32>::maybe("normals", normals, 3)?;
        let uvs = [InputArray::<f32>::maybe("uvs", uvs, 2)?, InputArray::<f32>::maybe("uvs2", uvs2, 2)?];
        let colors = InputArray::<f32>::maybe("colors", colors, 4)?;
        let slots = InputArray::<i32>::maybe("triangle_materials", triangle_materials, 1)?;
        let mesh = CornerMesh {
            positions: positions.rows()?,
            corner_vertices: corner_vertices.as_ref().map(InputArray::values).transpose()?,
            triangles: triangles.rows()?,
            normals: maybe_rows(normals.as_ref())?,
            uvs: [maybe_rows(uvs[0].as_ref())?, maybe_rows(uvs[1].as_ref())?],
            colors: maybe_rows(colors.as_ref())?,
            triangle_materials: slots.as_ref().map(InputArray::values).transpose()?,
            drop_empty,
        };
        let mut keys = Vec::with_capacity(motion.len());
        for (time, positions, normals) in &motion {
            let positions = InputArray::<f32>::table("motion", positions, 3)?;
            keys.push((*time, positions, InputArray::<f32>::maybe("motion", normals.as_ref(), 3)?));
        }
        let mut moved = Vec::with_capacity(keys.len());
        for (time, positions, key_normals) in &keys {
            let normals = maybe_rows(key_normals.as_ref())?.or(mesh.normals);
            moved.push((*time, CornerMesh { positions: positions.rows()?, normals, ..mesh }));
        }
        let put = if moved.is_empty() {
            self.editor().put_mesh(key, &mesh, materials, put_mode(is_new))
        } else {
            self.editor().put_moving_mesh(key, &mesh, &moved, materials, put_mode(is_new))
        };
        put.map_err(|error| errors::edit(&error))
    }

    /// Adds or replaces a mesh of curves.
    #[pyo3(signature = (key, points, counts, radii, is_round, materials, drop_empty, is_new))]
    fn put_curves(
        &self,
        key: &str,
        points: &Bound<'_, PyAny>,
        counts: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        is_round: bool,
        materials: Vec<String>,
        drop_empty: bool,
        is_new: bool,
    ) -> PyResult<()> {
        let points = InputArray::<f32>::table("points", points, 3)?;
        let counts = InputArray::<i32>::table("counts", counts, 1)?;
        let radii = InputArray::<f32>::table("radii", radii, 1)?;
        let curves = CurveStrands {
            points: points.rows()?,
            counts: counts.values()?,
            radii: radii.values()?,
            look: if is_round { CurveLook::Round } else { CurveLook::Flat },
            drop_empty,
        };
        let put = self.editor().put_curves(key, &curves, materials, put_mode(is_new));
        put.map_err(|error| errors::edit(&error))
    }

    /// Returns vertices and triangles of a mesh, and the keys of its materials.
    fn mesh(&self, key: &str) -> PyResult<(usize, usize, Vec<String>)> {
        let editor = self.editor();
        let (parts, materials) = editor.mesh(key).map_err(|error| errors::edit(&error))?;
        let vertices = parts.iter().map(|mesh| mesh.positions.len()).sum();
        Ok((vertices, parts.iter().map(|mesh| mesh.triangles.len()).sum(), materials.to_vec()))
    }

    /// Changes the materials of a mesh.
    fn set_mesh_materials(&self, key: &str, materials: Vec<String>) -> PyResult<()> {
        self.editor().set_mesh_materials(key, materials).map_err(|error| errors::edit(&error))
    }

    /// Adds or replaces an object.
    #[pyo3(signature = (key, mesh, transforms, materials, instance_materials, hidden, visibility, is_new))]
    fn put_object(
        &self,
        key: &str,
        mesh: String,
        transforms: &Bound<'_, PyAny>,
        materials: Vec<String>,
        instance_materials: Option<&Bound<'_, PyAny>>,
        hidden: bool,
        visibility: u8,
        is_new: bool,
    ) -> PyResult<()> {
        let choice = InputArray::<i32>::maybe("instance_materials", instance_materials, 1)?;
        let choice = choice.as_ref().map(InputArray::values).transpose()?.unwrap_or_default();
        let object = PlacedObject {
            mesh,
            transforms: self::transforms(transforms)?,
            motion: Vec::new(),
            materials,
            instance_materials: choice.iter().map(|&choice| choice as u32).collect(),
            hidden,
            visibility: visibility_of(visibility)?,
        };
        self.editor().put_object(key, object, put_mode(is_new)).map_err(|error| errors::edit(&error))
    }

    /// Returns the mesh of an object, the keys of its own materials, and the number of its instances.
    fn object(&self, key: &str) -> PyResult<(String, Vec<String>, usize)> {
        let editor = self.editor();
        let object = editor.object(key).map_err(|error| errors::edit(&error))?;
        Ok((object.mesh.clone(), object.materials.clone(), object.transforms.len()))
    }

    /// Changes the own materials of an object.
    fn set_object_materials(&self, key: &str, materials: Vec<String>) -> PyResult<()> {
        let mut editor = self.editor();
        let object = editor.object(key).map_err(|error| errors::edit(&error))?.clone();
        let put = editor.put_object(key, PlacedObject { materials, ..object }, put_mode(false));
        put.map_err(|error| errors::edit(&error))
    }

    /// Returns the kinds of ray for which an object is there, as bits.
    fn object_visibility(&self, key: &str) -> PyResult<u8> {
        self.editor().object(key).map(|object| object.visibility.into()).map_err(|error| errors::edit(&error))
    }

    /// Sets the kinds of ray for which an object is there.
    fn set_object_visibility(&self, key: &str, visibility: u8) -> PyResult<()> {
        let visibility = visibility_of(visibility)?;
        self.editor().set_object_visibility(key, visibility).map_err(|error| errors::edit(&error))
    }

    /// Returns the matrices of an object: float32, (N, 4, 4), a copy.
    fn transforms<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let editor = self.editor();
        let object = editor.object(key).map_err(|error| errors::edit(&error))?;
        let row = |matrix: &Affine3A, row: usize| match row {
            3 => [0.0, 0.0, 0.0, 1.0],
            row => [
                matrix.matrix3.row(row).x,
                matrix.matrix3.row(row).y,
                matrix.matrix3.row(row).z,
                matrix.translation[row],
            ],
        };
        let number = |(index, y, x): (usize, usize, usize)| row(&object.transforms[index], y)[x];
        Ok(Array3::from_shape_fn((object.transforms.len(), 4, 4), number).into_pyarray(py))
    }

    /// Moves an object.
    fn move_object(&self, key: &str, transforms: &Bound<'_, PyAny>) -> PyResult<()> {
        let transforms = self::transforms(transforms)?;
        self.editor().move_object(key, transforms).map_err(|error| errors::edit(&error))
    }

    /// Sets the path of an object: times, and its matrices then.
    #[expect(clippy::needless_pass_by_value, reason = "a list of Python comes as a value")]
    fn set_object_motion(&self, key: &str, motion: Vec<(f64, Bound<'_, PyAny>)>) -> PyResult<()> {
        let key_of = |(time, matrices): &(f64, Bound<'_, PyAny>)| Ok((*time, self::transforms(matrices)?));
        let motion = motion.iter().map(key_of).collect::<PyResult<Vec<_>>>()?;
        self.editor().set_object_motion(key, motion).map_err(|error| errors::edit(&error))
    }

    /// Sets the path of a camera or a light: times, and the matrix then.
    #[expect(clippy::needless_pass_by_value, reason = "a list of Python comes as a value")]
    fn set_motion(&self, kind: &str, key: &str, motion: Vec<(f64, Bound<'_, PyAny>)>) -> PyResult<()> {
        let mut keys = Vec::with_capacity(motion.len());
        for (time, matrix) in &motion {
            let [transform] = self::transforms(matrix)?[..] else {
                return Err(PyValueError::new_err("a key has one matrix, (4, 4)"));
            };
            keys.push(TransformKey { time: *time, transform });
        }
        self.editor().set_motion(kind_of(kind)?, key, keys).map_err(|error| errors::edit(&error))
    }

    /// Sets the path of a sphere: times, centers and radii.
    fn set_sphere_motion(&self, key: &str, motion: Vec<(f64, [f32; 3], f32)>) -> PyResult<()> {
        let motion = motion.into_iter().map(|(time, center, radius)| (time, center.into(), radius)).collect();
        self.editor().set_sphere_motion(key, motion).map_err(|error| errors::edit(&error))
    }

    /// Returns when the shutter opens and is closed, and its ramp.
    fn shutter(&self) -> (f64, f64, f64) {
        let Shutter { open, close, ramp } = self.editor().shutter();
        (open, close, ramp)
    }

    /// Sets when the shutter opens and is closed, and its ramp.
    #[pyo3(signature = (open, close, ramp = 0.0))]
    fn set_shutter(&self, open: f64, close: f64, ramp: f64) -> PyResult<()> {
        self.editor().set_shutter(Shutter { open, close, ramp }).map_err(|error| errors::edit(&error))
    }

    /// Adds or replaces an image.
    fn put_image(&self, key: &str, pixels: &Bound<'_, PyAny>, color_space: &str, is_new: bool) -> PyResult<()> {
        let image = image_of(key, pixels, color_space)?;
        self.editor().put_image(key, image, put_mode(is_new)).map_err(|error| errors::edit(&error))
    }

    /// Returns columns and rows of an image.
    fn image_size(&self, key: &str) -> PyResult<(u32, u32)> {
        self.editor().image_size(key).map_err(|error| errors::edit(&error))
    }

    /// Adds or replaces a medium, from its JSON text and grids; with `keeps_grids` those of the medium that is replaced.
    #[pyo3(signature = (key, json, density, albedo, emission, transform, voxels, keeps_grids, is_new))]
    fn put_medium(
        &self,
        key: &str,
        json: &str,
        density: Option<&Bound<'_, PyAny>>,
        albedo: Option<&Bound<'_, PyAny>>,
        emission: Option<&Bound<'_, PyAny>>,
        transform: Option<&Bound<'_, PyAny>>,
        voxels: Option<PlacedVoxels<'_>>,
        keeps_grids: bool,
        is_new: bool,
    ) -> PyResult<()> {
        let mut medium: Medium = parsed("medium", json)?;
        if let Some(density) = density {
            let density = grid_of("density", density)?;
            let albedo = albedo.map(|albedo| grid_of("albedo", albedo)).transpose()?;
            let emission =
                emission.map(|emission| grid_of("emission_grid", emission)).transpose()?.map(EmissionVariation::Factor);
            let placed = transform.map(transforms).transpose()?.unwrap_or_default();
            let world_from_grid = placed.first().copied().unwrap_or(Affine3A::IDENTITY);
            if !world_from_grid.matrix3.determinant().is_normal() {
                return Err(wrong("transform", "the matrix is singular; its determinant must not be 0"));
            }
            let density = match albedo {
                Some(albedo) => Density::WithAlbedo { extinction: density, albedo },
                None => Density::Both(density),
            };
            let grid_from_world = world_from_grid.inverse();
            medium.variation = Some(Arc::new(Variation { density, emission, grid_from_world }));
        }
        if let Some(voxels) = voxels {
            medium.variation = Some(Arc::new(voxels.variation(transform)?));
        }
        let mut editor = self.editor();
        if keeps_grids && let Ok(before) = editor.medium(key) {
            medium.variation.clone_from(&before.variation);
        }
        editor.put_medium(key, medium, put_mode(is_new)).map_err(|error| errors::edit(&error))
    }
}
