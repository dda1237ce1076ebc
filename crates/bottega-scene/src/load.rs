//! Loading of a scene from a path.

use std::path::Path;

use glam::{DVec3, Mat3, Quat};

use crate::budget::MemoryBudget;
use crate::camera::Camera;
use crate::color::Spectrum;
use crate::error::{SceneError, Warning, Warnings};
use crate::file::{hash, read_file};
use crate::hints::{Metadata, RenderHints};
use crate::image::Image;
use crate::image::decode::{DecodedImage, PictureHeader};
use crate::image::error::PictureError;
use crate::image::pictures::too_large;
use crate::image::pyramid::Encoding;
use crate::import::request::{ImportOutput, ImportRequest};
use crate::light::Environment;
use crate::model::Scene;
use crate::options::LoadOptions;
use crate::origin::far_origin;
use crate::resource::{Resources, SceneFile};
use crate::texture::ImageId;
use crate::{excess, gltf, mesh_file, mitsuba, pbrt, saved, usd, values, voxel_file};

/// A loaded scene, with warnings, metadata and render hints.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene; [`Scene::validate`] holds.
    pub scene: Scene,
    /// Warnings, in the order in which they were found.
    pub warnings: Vec<Warning>,
    /// Metadata of the scene file.
    pub metadata: Metadata,
    /// Render settings that the file asks for.
    pub hints: RenderHints,
    /// Files that the scene refers to and that were read, without the scene file itself.
    pub files: Vec<SceneFile>,
}

impl From<Scene> for Loaded {
    /// Returns a scene made in memory, without warnings, hints and files.
    fn from(scene: Scene) -> Self {
        let (warnings, metadata, hints) = (Vec::new(), Metadata::default(), RenderHints::default());
        Self { scene, warnings, metadata, hints, files: Vec::new() }
    }
}

/// Reads a scene. The format is recognized by the first bytes or the file extension.
///
/// Lights keep the numbers of the file: in glTF, candela counts as W·sr⁻¹, lux as W·m⁻² and the emissive factor as
/// radiance, so their ratios stay the same.
///
/// A scene without a camera gets one that frames it; a scene without any light gets a neutral sky, unless
/// [`LoadOptions::add_sky`] is off. Other guesses and omissions are reported as warnings.
///
/// # Errors
/// A file cannot or must not be read, is of an unknown format or version, is damaged or invalid, or needs too much
/// memory or an extension that is not supported; the scene has no such animation or variant as `options` ask for; the
/// picture [`LoadOptions::environment`] cannot be decoded; one of [`LoadOptions::asset_roots`] is not a folder; with
/// [`LoadOptions::strict`], also unsupported features.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, SceneError> {
    let mut budget = MemoryBudget::new(options.max_memory_bytes);
    let file = read_file(path, &budget)?;
    let mut digest = blake3::Hasher::new();
    digest.update(hash(&file).as_bytes());
    options.add_choices(&mut digest);
    // A saved scene is read as it is: nothing is moved or added.
    let is_saved = saved::recognizes(&file);
    let import: fn(&ImportRequest<'_>, &mut Warnings) -> Result<ImportOutput, SceneError> = if is_saved {
        saved::import
    } else if gltf::recognizes(path, &file) {
        gltf::import
    } else if mitsuba::recognizes(path, &file) {
        mitsuba::import
    } else if pbrt::recognizes(path) {
        pbrt::import
    } else if usd::recognizes(path) {
        usd::import
    } else if mesh_file::scene::recognizes(path, &file) {
        mesh_file::scene::import
    } else if voxel_file::scene::recognizes(&file) {
        voxel_file::scene::import
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
        let imported =
            import(&ImportRequest { path, file: &file, options, origin, resources: &resources }, &mut warnings)?;
        let files = resources.finish(digest, &mut warnings);
        Ok::<_, SceneError>((imported, files, warnings))
    };
    let ((mut scene, mut metadata, mut hints), mut files, mut warnings) = read(DVec3::ZERO, &budget, &mut digest)?;
    if !is_saved && let Some(origin) = far_origin(&scene) {
        // Drop the first scene before reading again: both together take twice the memory.
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
    if let Some(shutter) = options.open_shutter() {
        scene.shutter = shutter;
        if !shutter.is_instant() && !scene.has_motion() {
            warnings.add("", "nothing moves while the shutter is open");
        }
    }
    if scene.instances.is_empty() && scene.spheres.is_empty() {
        warnings.add("", "the scene has no surface");
    }
    if let Some(environment) = &options.environment {
        add_environment(&mut scene, environment, options, &budget, &mut digest, &mut warnings)?;
    }
    if options.add_sky && !is_saved && !scene.has_light() {
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
    excess::warn(&scene, &mut warnings);
    let (triangles, memory_bytes) = (scene.triangle_count(), scene.memory_bytes());
    tracing::info!(path = %path.display(), triangles, memory_bytes, "scene read");
    Ok(Loaded { scene, warnings: warnings.finish(), metadata, hints, files })
}

/// Replaces NaN, infinite and huge vertex colours, and warns about them.
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
    let unreadable = |error: PictureError| SceneError::Picture { path: path.into(), problem: error.to_string() };
    let header = PictureHeader::read(&bytes, options.max_image_pixels).map_err(|error| match error {
        PictureError::TooManyPixels { .. } => too_large(path, String::new(), &error),
        error => unreadable(error),
    })?;
    budget.take(path, "", header.memory_bytes())?;
    let mut decoded = DecodedImage::read(&bytes, header).map_err(unreadable)?;
    for note in decoded.take_notes() {
        warnings.add("", format!("the picture `{}`: {note}", path.display()));
    }
    let image = decoded.into_image(&path.display().to_string(), Encoding::Srgb);
    scene.set_environment(image, options.environment_intensity, options.environment_rotation);
    Ok(())
}

impl Scene {
    /// Replaces the environment with a latitude-longitude picture.
    ///
    /// - `intensity`: factor of the picture's radiance.
    /// - `rotation`: about the y axis, counter-clockwise seen from above, in radians.
    pub fn set_environment(&mut self, image: Image, intensity: f32, rotation: f32) {
        self.images.push(image);
        // Compute in double precision, then round: platforms differ in the last bit of a sine.
        let (sin, cos) = (0.5 * f64::from(rotation)).sin_cos();
        self.environment = Some(Environment::picture(
            ImageId(self.images.len() as u32 - 1),
            Spectrum::splat(intensity),
            Mat3::from_quat(Quat::from_xyzw(0.0, sin as f32, 0.0, cos as f32)),
        ));
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec4;

    use super::*;
    use crate::model::Mesh;

    #[test]
    fn vertex_colours_that_are_not_finite_are_reported() {
        let colors = vec![Vec4::new(0.5, f32::INFINITY, 1e30, 1.0), Vec4::new(f32::NAN, 0.25, 0.0, 1.0)];
        let mut scene = Scene { meshes: vec![Mesh { colors, ..Mesh::default() }].into(), ..Scene::default() };
        let mut warnings = Warnings::default();
        mend_colors(&mut scene, &mut warnings);
        assert_eq!(scene.meshes[0].colors, [Vec4::ONE.with_x(0.5), Vec4::new(0.0, 0.25, 0.0, 1.0)]);
        let reported = warnings.finish();
        assert!(reported.len() == 1 && reported[0].place == "meshes[0]", "{reported:?}");
    }
}
