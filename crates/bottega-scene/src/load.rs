//! From a path to a scene.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DVec3, Mat3, Quat};
use serde::Deserialize;

use crate::error::Warnings;
use crate::file::{hash, read_file};
use crate::image::{Decoded, Encoding, Header, PictureFault, too_large};
use crate::integrator::IntegratorHint;
use crate::origin::far_origin;
use crate::resource::{Resources, SceneFile};
use crate::{
    Camera, Environment, Image, ImageId, Scene, SceneError, Spectrum, Warning, excess, gltf, mesh_file, mitsuba, pbrt,
    values,
};

/// What is wanted of a scene beyond its file, and how much it may take.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadOptions {
    /// A latitude-longitude picture (HDR, EXR, PFM, PNG, JPEG and others) that becomes the environment, whatever the file says.
    pub environment: Option<PathBuf>,
    /// Turns that picture about the y axis, counter-clockwise seen from above, in radians.
    pub environment_rotation: f32,
    /// Multiplies that picture.
    pub environment_intensity: f32,
    /// The time, in seconds, at which animations are shown. `None`: the scene stands as its file describes it, unless
    /// an animation is named, which then stands at its beginning.
    pub at: Option<f32>,
    /// The one animation that is shown, by its name or else by its number. `None`: all; where several move the same
    /// thing, the first one.
    pub animation: Option<String>,
    /// Which of the variants of materials that a file offers is shown, by its name or else by its number.
    pub variant: Option<String>,
    /// Whether a scene without any light gets a neutral sky.
    pub add_sky: bool,
    /// Whether the scene may refer to files outside of the folder of its own file.
    pub allow_outside: bool,
    /// Further folders whose files the scene may refer to, whether by `..`, by an absolute path, or by a symbolic link.
    pub asset_roots: Vec<PathBuf>,
    /// Whether the camera sees through the backs of glTF's materials that are not `doubleSided`, as its specification has it
    /// (2.0, section 3.9.6). Else it sees all surfaces from both sides, as light does in either case.
    pub cull_backfaces: bool,
    /// Refuse scenes that ask for something which is not supported, instead of replacing it and warning.
    pub strict: bool,
    /// Name and value of parameters of the scene, instead of the values that its file gives them (Mitsuba's `$name`).
    pub defines: Vec<(String, String)>,
    /// Refuse pictures with more pixels than this. They are refused by their header, before they are decoded.
    pub max_image_pixels: u64,
    /// Refuse scenes whose meshes, instances and pictures together would take more bytes than this.
    pub max_memory_bytes: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            environment: None,
            environment_rotation: 0.0,
            environment_intensity: 1.0,
            at: None,
            animation: None,
            variant: None,
            add_sky: true,
            allow_outside: false,
            asset_roots: Vec::new(),
            cull_backfaces: false,
            strict: false,
            defines: Vec::new(),
            max_image_pixels: 1 << 28,
            max_memory_bytes: 16 << 30,
        }
    }
}

impl LoadOptions {
    /// One file makes several scenes, and their digests differ.
    fn add_choices(&self, digest: &mut blake3::Hasher) {
        if let Some(at) = self.at {
            digest.update(b"at").update(&at.to_le_bytes());
        }
        for (what, choice) in [("animation", &self.animation), ("variant", &self.variant)] {
            if let Some(choice) = choice {
                digest.update(what.as_bytes()).update(&(choice.len() as u64).to_le_bytes()).update(choice.as_bytes());
            }
        }
        if self.cull_backfaces {
            digest.update(b"cull backfaces");
        }
        for text in self.defines.iter().flat_map(|(name, value)| [name, value]) {
            digest.update(b"define").update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
        }
    }
}

/// A scene, and what to tell about it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// Checked: [`Scene::validate`] finds nothing.
    pub scene: Scene,
    /// In the order in which they were found.
    pub warnings: Vec<Warning>,
    /// What the file says of itself.
    pub metadata: Metadata,
    /// How the file wants to be painted.
    pub hints: RenderHints,
    /// The files that the scene refers to and that were read, without the scene file itself.
    pub files: Vec<SceneFile>,
}

/// How a file wants to be painted. What it does not say is left open; what the user says goes first. (Exposure is none of
/// these: importers fold it into the lights.)
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderHints {
    /// Columns and rows of the whole picture.
    pub resolution: Option<[u32; 2]>,
    /// Part of the picture: first column and row, columns and rows.
    pub crop: Option<[u32; 4]>,
    /// Samples of each pixel.
    pub samples: Option<u32>,
    /// Bounces: 0 shows only emission seen directly, 1 direct light; `u32::MAX`: no limit.
    pub max_depth: Option<u32>,
    /// The integrator that the file names.
    pub integrator: Option<IntegratorHint>,
    /// The pixel filter.
    pub filter: Option<FilmFilter>,
    /// Whether the film keeps alpha: what shows no surface is transparent in formats that can tell.
    pub alpha: bool,
    /// Whether the file has no light, and a neutral sky was added.
    pub is_sky_added: bool,
}

/// A separable pixel filter. Radii are in pixels, from the centre to the edge. Workers of other engines tell theirs in these words.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum FilmFilter {
    /// Constant.
    Box {
        /// Half its width; 0.5 is one pixel.
        radius: f32,
    },
    /// Falls off linearly.
    Tent {
        /// Where it is 0.
        radius: f32,
    },
    /// The bell, shifted down so that it ends at 0.
    Gaussian {
        /// Where it ends.
        radius: f32,
        /// Standard deviation, in pixels.
        sigma: f32,
    },
    /// Mitchell and Netravali 1988.
    Mitchell {
        /// Where it ends.
        radius: f32,
        /// Their B.
        b: f32,
        /// Their C.
        c: f32,
    },
    /// The four-term window of Blackman and Harris: close to a Gaussian.
    BlackmanHarris {
        /// Where it ends.
        radius: f32,
    },
}

impl FilmFilter {
    /// Whether it is a filter at all, and reaches no further than any real one does.
    pub fn is_sound(&self) -> bool {
        let is_length = |value: f32| value > 0.0 && value <= 64.0;
        match *self {
            Self::Box { radius } | Self::Tent { radius } | Self::BlackmanHarris { radius } => is_length(radius),
            Self::Gaussian { radius, sigma } => is_length(radius) && is_length(sigma),
            Self::Mitchell { radius, b, c } => is_length(radius) && [b, c].iter().all(|value| value.abs() <= 64.0),
        }
    }

    /// The pixel itself.
    pub const PIXEL: Self = Self::Box { radius: 0.5 };
}

impl Default for FilmFilter {
    /// Blackman-Harris of radius 1.5.
    fn default() -> Self {
        Self::BlackmanHarris { radius: 1.5 }
    }
}

/// What a scene file says of itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Metadata {
    /// Name of the format.
    pub format: &'static str,
    /// The program that wrote it.
    pub generator: Option<String>,
    /// Extensions of the format that it uses.
    pub extensions: Vec<String>,
}

/// What an importer is given.
pub(crate) struct Request<'a> {
    /// The scene file.
    pub(crate) path: &'a Path,
    /// Its bytes.
    pub(crate) file: &'a [u8],
    pub(crate) options: &'a LoadOptions,
    /// What is taken from all places of the world before they are rounded to single precision; 0 but for scenes far away.
    pub(crate) origin: DVec3,
    /// What it refers to.
    pub(crate) resources: &'a Resources<'a>,
}

/// What an importer makes. Lights and cameras may be missing from the scene.
pub(crate) type Imported = (Scene, Metadata, RenderHints);

/// Reads a scene. The format is known by the first bytes, or by the extension of the name.
///
/// Lights keep the numbers of the file: of glTF, candela counts as W·sr⁻¹, lux as W·m⁻², and the emissive factor as
/// radiance, so that all of them keep their balance.
///
/// A scene without camera gets one that frames it; a scene without any light gets a neutral sky. What else had to be
/// guessed or left out is in the warnings.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, SceneError> {
    let mut budget = MemoryBudget::new(options.max_memory_bytes);
    let file = read_file(path, &budget)?;
    let mut digest = blake3::Hasher::new();
    digest.update(hash(&file).as_bytes());
    options.add_choices(&mut digest);
    let import: fn(&Request<'_>, &mut Warnings) -> Result<Imported, SceneError> = if gltf::recognizes(path, &file) {
        gltf::import
    } else if mitsuba::recognizes(path, &file) {
        mitsuba::import
    } else if pbrt::recognizes(path) {
        pbrt::import
    } else if mesh_file::recognizes(path, &file) {
        mesh_file::import
    } else {
        return Err(SceneError::UnknownFormat { path: path.into(), found: describe(&file).into() });
    };
    if let Some(path) = options.asset_roots.iter().find(|path| !path.is_dir()) {
        return Err(SceneError::NotAFolder { path: path.clone() });
    }
    let plain_digest = digest.clone();
    let read = |origin: DVec3, budget: &MemoryBudget, digest: &mut blake3::Hasher| {
        let resources = Resources::new(path, options, budget);
        let mut warnings = Warnings::default();
        let imported = import(&Request { path, file: &file, options, origin, resources: &resources }, &mut warnings)?;
        let files = resources.finish(digest, &mut warnings);
        Ok::<_, SceneError>((imported, files, warnings))
    };
    let ((mut scene, mut metadata, mut hints), mut files, mut warnings) = read(DVec3::ZERO, &budget, &mut digest)?;
    if let Some(origin) = far_origin(&scene) {
        // The first one goes before the second one is made: both together would take twice the memory.
        drop(scene);
        budget = MemoryBudget::new(options.max_memory_bytes);
        budget.take(path, "", file.len())?;
        digest = plain_digest;
        ((scene, metadata, hints), files, warnings) = read(origin, &budget, &mut digest)?;
        scene.origin = origin;
        let far = origin.length();
        warnings.add("", format!("the scene is some {far:.0} units from the origin; it is computed around its camera"));
    }
    let unsupported = warnings.take_unsupported();
    if options.strict && !unsupported.is_empty() {
        return Err(SceneError::Unsupported { path: path.into(), places: unsupported });
    }
    drop(file);
    if scene.instances.is_empty() && scene.spheres.is_empty() {
        warnings.add("", "the scene has no surface");
    }
    if let Some(environment) = &options.environment {
        add_environment(&mut scene, environment, options, &budget, &mut digest, &mut warnings)?;
    }
    if options.add_sky && !scene.has_light() {
        warnings.add("", "the scene has no light; a neutral sky shines on it");
        scene.add_sky();
        hints.is_sky_added = true;
    }
    if scene.cameras.is_empty() {
        warnings.add("", "the scene has no camera; one that frames it is used");
        scene.cameras.push(Camera::framing_scene(&scene, 1.0));
    }
    scene.digest = digest.finalize().to_hex().to_string();
    mend_colors(&mut scene, &mut warnings);
    scene.validate().map_err(|error| error.in_file(path))?;
    excess::tell(&scene, &mut warnings);
    let (triangles, memory_bytes) = (scene.triangle_count(), scene.memory_bytes());
    tracing::info!(path = %path.display(), triangles, memory_bytes, "scene read");
    Ok(Loaded { scene, warnings: warnings.finish(), metadata, hints, files })
}

/// Makes sound numbers of the colours of vertices, and tells where there were others.
fn mend_colors(scene: &mut Scene, warnings: &mut Warnings) {
    for (index, mesh) in scene.meshes.iter_mut().enumerate() {
        if let Some(note) = values::mend(bytemuck::cast_slice_mut(&mut mesh.colors)) {
            warnings.add(format!("meshes[{index}]"), format!("the colours of a mesh's vertices: {note}"));
        }
    }
}

fn describe(file: &[u8]) -> &'static str {
    match file {
        [] => "empty",
        [0xab, b'K', b'T', b'X', ..] => "a KTX picture",
        [b'B', b'L', b'E', b'N', b'D', b'E', b'R', ..] => "a Blender file",
        [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, 0xff, ..] | [0x76, 0x2f, 0x31, 0x01, ..] => "a picture",
        _ => "of an unknown format",
    }
}

fn add_environment(
    scene: &mut Scene,
    path: &Path,
    options: &LoadOptions,
    budget: &MemoryBudget,
    digest: &mut blake3::Hasher,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let bytes = read_file(path, budget)?;
    digest.update(hash(&bytes).as_bytes());
    let unreadable = |problem| SceneError::Picture { path: path.into(), problem };
    let header = Header::read(&bytes, options.max_image_pixels).map_err(|fault| match fault {
        PictureFault::TooLarge { problem } => too_large(path, problem),
        PictureFault::Unreadable { problem } => unreadable(problem),
    })?;
    budget.take(path, "", header.memory_bytes())?;
    let mut decoded = Decoded::read(&bytes, header).map_err(unreadable)?;
    for note in decoded.take_notes() {
        warnings.add("", format!("the picture `{}`: {note}", path.display()));
    }
    let image = decoded.into_image(&path.display().to_string(), Encoding::Srgb);
    scene.set_environment(image, options.environment_intensity, options.environment_rotation);
    Ok(())
}

impl Scene {
    /// Surrounds the scene with a latitude-longitude picture.
    ///
    /// - `intensity`: multiplies the picture.
    /// - `rotation`: turns it about the y axis, counter-clockwise seen from above, in radians.
    pub fn set_environment(&mut self, image: Image, intensity: f32, rotation: f32) {
        self.images.push(image);
        // In double precision, and rounded: platforms differ in the last bit of their sines.
        let (sin, cos) = (0.5 * f64::from(rotation)).sin_cos();
        self.environment = Some(Environment::picture(
            ImageId(self.images.len() as u32 - 1),
            Spectrum::splat(intensity),
            Mat3::from_quat(Quat::from_xyzw(0.0, sin as f32, 0.0, cos as f32)),
        ));
    }
}

/// Counts the bytes that a scene will take, before they are taken. Several threads may draw on it.
#[derive(Debug)]
pub(crate) struct MemoryBudget {
    limit: usize,
    taken: AtomicUsize,
}

impl MemoryBudget {
    pub(crate) fn new(limit: usize) -> Self {
        Self { limit, taken: AtomicUsize::new(0) }
    }

    /// What all may take together, in bytes.
    pub(crate) fn limit(&self) -> usize {
        self.limit
    }

    /// Books bytes for something at `place`, or says that they are too many.
    pub(crate) fn take(&self, path: &Path, place: &str, bytes: usize) -> Result<(), SceneError> {
        let before = self.taken.fetch_add(bytes.min(self.limit.saturating_add(1)), Ordering::Relaxed);
        if before.saturating_add(bytes) <= self.limit { Ok(()) } else { Err(self.exceeded(path, place)) }
    }

    /// Bytes that may still be taken.
    pub(crate) fn left(&self) -> usize {
        self.limit.saturating_sub(self.taken.load(Ordering::Relaxed))
    }

    /// Books bytes for as long as the result is kept: for what is needed on the way to the scene.
    pub(crate) fn hold(&self, path: &Path, bytes: usize) -> Result<Held<'_>, SceneError> {
        self.take(path, "", bytes)?;
        Ok(Held { budget: self, bytes })
    }

    /// Whether so many bytes would pass if nothing else were there: for what is soon given back.
    pub(crate) fn check(&self, path: &Path, bytes: usize) -> Result<(), SceneError> {
        if bytes <= self.limit { Ok(()) } else { Err(self.exceeded(path, "")) }
    }

    fn exceeded(&self, path: &Path, place: &str) -> SceneError {
        SceneError::Limit {
            path: path.into(),
            place: place.into(),
            problem: format!("the scene takes more than the limit of {} MiB of memory", self.limit >> 20),
            remedy: "simplify it or scale its pictures down, or allow more memory",
        }
    }
}

/// Bytes that are given back when this is dropped.
#[derive(Debug)]
pub(crate) struct Held<'a> {
    budget: &'a MemoryBudget,
    bytes: usize,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.budget.taken.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec4;

    use super::*;
    use crate::Mesh;

    #[test]
    fn colours_of_vertices_that_cannot_be_computed_with_are_told() {
        let colors = vec![Vec4::new(0.5, f32::INFINITY, 1e30, 1.0), Vec4::new(f32::NAN, 0.25, 0.0, 1.0)];
        let mut scene = Scene { meshes: vec![Mesh { colors, ..Mesh::default() }], ..Scene::default() };
        let mut warnings = Warnings::default();
        mend_colors(&mut scene, &mut warnings);
        assert_eq!(scene.meshes[0].colors, [Vec4::ONE.with_x(0.5), Vec4::new(0.0, 0.25, 0.0, 1.0)]);
        let told = warnings.finish();
        assert!(told.len() == 1 && told[0].place == "meshes[0]", "{told:?}");
    }
}
