//! Importer of glTF 2.0, `.gltf` and `.glb`.
//!
//! Uses its own types for the document and its own checked reader for buffers: the libraries for the format panic on
//! indices out of range, truncate 64-bit indices to 32 bits, and lack some of the extensions below.
//!
//! Supported extensions: `KHR_materials_anisotropy`, `_clearcoat`, `_diffuse_transmission`, `_dispersion`,
//! `_emissive_strength`, `_ior`, `_iridescence`, `_pbrSpecularGlossiness`, `_sheen`, `_specular`, `_transmission`,
//! `_unlit`, `_variants`, `_volume`; `KHR_lights_punctual`, `KHR_mesh_quantization`, `EXT_mesh_gpu_instancing`,
//! `EXT_meshopt_compression`, `KHR_meshopt_compression`, `KHR_draco_mesh_compression`; `KHR_texture_basisu`,
//! `KHR_texture_transform`, `EXT_texture_webp`; `KHR_node_visibility`, `KHR_animation_pointer`. Another extension that
//! the file requires is an error that names it; one that it only uses is ignored with a warning.
//!
//! Animations are evaluated at one time, or at several while a shutter is open: meshes are posed by skins and morph
//! targets on import, and the scene has neither. Values of `KHR_animation_pointer` are those when the shutter opens.
//!
//! Light units: candela and lux are taken as W·sr⁻¹ and W·m⁻², one to one, and `emissiveFactor` as radiance, so the
//! ratio of emissive surfaces and punctual lights is as in other glTF viewers.

mod accessor;
mod animation;
mod container;
mod document;
mod draco;
mod error;
mod flat;
mod hierarchy;
mod material;
mod mesh;
mod meshopt;
mod node;
mod place;
mod pointer;
mod punctual;
mod shape;
mod skin;
mod source;
mod texture;
mod uri;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use document::Document;
use error::GltfError;
use hierarchy::Hierarchy;
use source::GltfSource;

use crate::budget::MemoryBudget;
use crate::error::{SceneError, Warnings};
use crate::hints::{Metadata, RenderHints};
use crate::import::merge::{StillParts, merge};
use crate::import::request::{ImportOutput, ImportRequest};
use crate::material::Material;
use crate::model::Scene;
use crate::objects_only;
use crate::text::{decode_utf8, shortened};

/// The supported extensions.
const EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Recognizes a file by its first bytes, or as JSON by its extension and first character.
pub(crate) fn recognizes(path: &Path, file: &[u8]) -> bool {
    let has_name = |name| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(name));
    // JSON in any encoding, with or without a byte order mark.
    let first = || file.iter().find(|byte| byte.is_ascii_graphic());
    file.starts_with(container::MAGIC) || has_name("gltf") || (has_name("glb") && first() == Some(&b'{'))
}

/// Imports a file with the contents `file`, read from `path`. The scene may lack lights and cameras.
pub(crate) fn import(request: &ImportRequest<'_>, warnings: &mut Warnings) -> Result<ImportOutput, SceneError> {
    let &ImportRequest { path, file, options, origin, resources } = request;
    let budget = resources.budget();
    let damaged = |error: GltfError| SceneError::Damaged { path: path.into(), problem: error.to_string() };
    let parts = container::split(file).map_err(damaged)?;
    let json = decode_utf8(path, parts.json, budget)?;
    let document = parse(path, json.as_bytes(), budget)?;
    check_version(path, &document)?;
    check_extensions(path, &document, warnings)?;
    let buffers = uri::load_buffers(&document, path, parts.bin, resources)?;
    let buffers: Vec<&[u8]> = buffers.iter().map(AsRef::as_ref).collect();
    let decompressed = meshopt::decompress(&document, &buffers, path, budget)?;
    let bytes = accessor::Bytes { buffers: &buffers, decompressed: &decompressed };
    let mut source = GltfSource { path, document: &document, bytes, options, variant: None, budget, resources, origin };
    if let Some(name) = &options.variant {
        let variants = document.extensions.variants.as_ref().map_or(&[][..], |extension| &extension.variants);
        source.variant = Some(source.by_name("variant", name, variants.iter().map(|variant| variant.name.as_str()))?);
    }

    let animation_time = animation::animation_time(&source, warnings)?;
    let pointed = animation_time
        .as_ref()
        .map(|animation_time| animation_time.pointed(&source, warnings))
        .transpose()?
        .unwrap_or_default();
    let animated;
    if !pointed.is_empty() {
        animated = pointer::replaced(path, json.as_bytes(), pointed, budget, warnings)?;
        source.document = &animated;
    }
    let pose = animation_time
        .as_ref()
        .map(|animation_time| animation_time.pose(&source, warnings))
        .transpose()?
        .unwrap_or_default();
    let hierarchy = Hierarchy::new(&source, pose, warnings)?;
    let placements = node::placements(&source, &hierarchy, warnings)?;
    let used: BTreeSet<Option<usize>> = placements.shapes.iter().map(|shape| shape.material).collect();
    let mut textures = texture::Textures::new(&source);
    let mut materials = Vec::with_capacity(used.len());
    let mut media = Vec::new();
    let mut material_of = BTreeMap::new();
    for index in used {
        material_of.insert(index, materials.len() as u32);
        materials.push(material::convert(&source, index, &mut textures, &mut media, warnings)?);
    }
    let loaded = textures.load(warnings)?;
    loaded.remove_missing_directions(&mut materials);
    let images = loaded.images;
    let draco = draco::decompress(&source, &placements.shapes)?;
    let (meshes, instances) =
        node::build(&source, &hierarchy, &placements, &draco, &materials, &material_of, warnings)?;
    drop(draco);
    let mut stills = Vec::new();
    for later in animation_time.iter().flat_map(|animation_time| animation_time.later(&source)) {
        stills.push(still_parts(&source, &later, &materials, &material_of)?);
    }
    let (meshes, images) = (meshes.into(), images.into());
    let mut scene = Scene { meshes, instances, materials, media, images, ..Scene::default() };
    punctual::add_cameras(&source, &hierarchy, &mut scene, warnings)?;
    punctual::add_lights(&source, &hierarchy, &mut scene, warnings)?;
    if let Some(animation_time) = &animation_time
        && !stills.is_empty()
    {
        for problem in merge(&mut scene, animation_time.time().into(), &stills) {
            warnings.unsupported("animations", problem);
        }
    }
    let metadata = Metadata {
        format: if parts.bin.is_some() { "glTF 2.0 (binary)" } else { "glTF 2.0" },
        generator: document.asset.generator.clone(),
        extensions: document.extensions_used.clone(),
    };
    Ok((scene, metadata, RenderHints::default()))
}

/// Reads the parts that may move at another time. What is wrong with them was reported for the first time.
fn still_parts(
    source: &GltfSource<'_>,
    animation_time: &animation::AnimationTime,
    materials: &[Material],
    material_of: &BTreeMap<Option<usize>, u32>,
) -> Result<StillParts, SceneError> {
    let mut warnings = Warnings::default();
    let pose = animation_time.pose(source, &mut warnings)?;
    let hierarchy = Hierarchy::new(source, pose, &mut warnings)?;
    let placements = node::placements(source, &hierarchy, &mut warnings)?;
    let draco = draco::decompress(source, &placements.shapes)?;
    let (meshes, instances) =
        node::build(source, &hierarchy, &placements, &draco, materials, material_of, &mut warnings)?;
    let mut others = Scene::default();
    punctual::add_cameras(source, &hierarchy, &mut others, &mut warnings)?;
    punctual::add_lights(source, &hierarchy, &mut others, &mut warnings)?;
    let Scene { cameras, lights, .. } = others;
    Ok(StillParts { time: animation_time.time().into(), meshes, instances, cameras, lights })
}

fn parse(path: &Path, json: &[u8], budget: &MemoryBudget) -> Result<Document, SceneError> {
    let objects = json.iter().filter(|&&byte| byte == b'{').count();
    budget.take(path, "", objects.saturating_mul(document::OBJECT_BYTES_MAX))?;
    objects_only::from_json(json).map_err(|error| {
        let problem = error.to_string();
        // The message repeats the location.
        let problem = problem.rsplit_once(" at line ").map_or(problem.as_str(), |(problem, _)| problem);
        let (line, column) = (error.line(), error.column());
        SceneError::Json {
            path: path.into(),
            line,
            column,
            place: place::place(json, place::offset(json, line, column)),
            problem: shortened(problem).into_owned(),
        }
    })
}

fn check_version(path: &Path, document: &Document) -> Result<(), SceneError> {
    let needed = document.asset.min_version.as_ref().unwrap_or(&document.asset.version);
    // Later minor versions are compatible unless `minVersion` is set.
    let readable = match &document.asset.min_version {
        Some(min_version) => min_version == "2.0",
        None => document.asset.version.starts_with("2."),
    };
    if readable {
        return Ok(());
    }
    let problem = match needed.as_str() {
        "" => "does not name its version of glTF".into(),
        version => format!("is glTF {}, only version 2.0 can be read", shortened(version)),
    };
    Err(SceneError::Invalid { path: path.into(), place: "asset.version".into(), problem })
}

fn check_extensions(path: &Path, document: &Document, warnings: &mut Warnings) -> Result<(), SceneError> {
    let unknown = |name: &&String| !EXTENSIONS.contains(&name.as_str());
    if let Some(name) = document.extensions_required.iter().find(unknown) {
        let name = shortened(name).into_owned();
        return Err(unsupported(path, "extensionsRequired", name));
    }
    let names: BTreeSet<&String> = document.extensions_used.iter().filter(unknown).collect();
    for name in names {
        warnings.unsupported("extensionsUsed", format!("{} is not supported and left out", shortened(name)));
    }
    Ok(())
}

fn unsupported(path: &Path, place: impl Into<String>, name: String) -> SceneError {
    let remedy = match name.as_str() {
        "EXT_texture_avif" | "MSFT_texture_dds" => "export with PNG or JPEG textures",
        _ => "export without it",
    };
    SceneError::UnsupportedExtension { path: path.into(), place: place.into(), name, remedy }
}
