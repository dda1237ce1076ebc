//! A scene in the layout of the path tracing kernels.

use bottega_render::flat::FlatScene;
use bottega_render::{PreparedScene, SceneGeometry};

use super::kernels::Variant;
use crate::error::GpuError;
use crate::geometry::Geometry;
use crate::material::{EncodedMaterials, Features};
use crate::traversal;

/// The arrays that are uploaded. Kept to upload them again after the device was lost.
#[derive(Debug)]
pub(super) struct PathScene {
    pub(super) geometry: Geometry,
    pub(super) words: Vec<u32>,
    pub(super) materials: Vec<u32>,
    pub(super) textures: Vec<u32>,
    pub(super) has_opacity: bool,
    /// The shader features that the surfaces use.
    pub(super) features: Features,
}

impl PathScene {
    /// Encodes a scene.
    ///
    /// - `limit`: the maximum size of one array, in bytes.
    ///
    /// # Errors
    /// The scene has unsupported features, or does not fit.
    pub(super) fn new(prepared: &PreparedScene, limit: u64, adapter: &str) -> Result<Self, GpuError> {
        let mut missing = Vec::new();
        let flat =
            FlatScene::new(prepared).map_err(|errors| missing.extend(errors.iter().map(ToString::to_string))).ok();
        let extra: Vec<_> = flat.iter().flat_map(|flat| &flat.pictures).map(|&(_, map)| map).collect();
        let encoded = EncodedMaterials::new(prepared.scene(), &extra);
        let encoded = encoded.map_err(|unsupported| missing.extend(unsupported.0)).ok();
        let (Some(mut flat), Some(encoded)) = (flat, encoded) else { return Err(GpuError::Unsupported(missing)) };
        for (&(place, _), &handle) in flat.pictures.iter().zip(&encoded.extra) {
            flat.words[place as usize] = handle;
        }
        let geometry = geometry_of(prepared, limit, adapter)?;
        let made = Self {
            geometry,
            words: flat.words,
            materials: encoded.material_words,
            textures: encoded.texture_words,
            has_opacity: flat.has_opacity,
            features: encoded.features.with_if(!flat.pictures.is_empty(), Features::TEXTURES),
        };
        let arrays = [
            ("the scene's attributes and lights", made.words.len()),
            ("the scene's materials", made.materials.len()),
            ("the scene's textures", made.textures.len()),
        ];
        for (what, words) in arrays {
            let bytes = (words * size_of::<u32>()) as u64;
            if bytes > limit {
                return Err(GpuError::TooLarge { what, bytes, limit, adapter: adapter.to_owned() });
            }
        }
        Ok(made)
    }

    /// Returns the variant of the kernels that this scene needs.
    pub(super) fn variant(&self) -> Variant {
        Variant {
            has_opacity: self.has_opacity,
            features: self.features,
            stack_size: traversal::stack_size(self.geometry.depth),
        }
    }

    /// Returns the arrays to upload, with a name for each.
    pub(super) fn arrays(&self) -> [(&'static str, &[u8]); 5] {
        [
            ("nodes", bytemuck::cast_slice(&self.geometry.nodes)),
            ("shapes", bytemuck::cast_slice(&self.geometry.shapes)),
            ("scene", bytemuck::cast_slice(&self.words)),
            ("materials", bytemuck::cast_slice(&self.materials)),
            ("textures", bytemuck::cast_slice(&self.textures)),
        ]
    }

    /// Returns the size of the scene on the device, in bytes.
    pub(super) fn memory_bytes(&self) -> u64 {
        self.arrays().iter().map(|(_, bytes)| bytes.len() as u64).sum()
    }
}

fn geometry_of(prepared: &PreparedScene, limit: u64, adapter: &str) -> Result<Geometry, GpuError> {
    let SceneGeometry { meshes, instances, spheres } = SceneGeometry::of(prepared.scene());
    Geometry::build(&meshes, &instances, &spheres, limit, adapter)
}
