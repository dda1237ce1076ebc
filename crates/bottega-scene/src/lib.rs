//! The scene model, and the importers that fill it.
//!
//! A [`Scene`] is plain data: meshes, instances, materials, textures, lights and cameras. It is validated on import, so
//! a renderer meets no index out of range, no NaN and no singular matrix. It holds no acceleration structure and draws
//! no random numbers: those belong to `bottega-kernels` and `bottega-render`.
//!
//! The same bytes make the same scene, bit for bit, on every platform and with any number of threads: results are kept
//! in file order, and sines, logarithms and the like are computed in double precision and then rounded.
//!
//! Conventions: right-handed, y up, metres; linear Rec. 709 colour; a camera looks along its own −z with +y up.
//!
//! # Modules
//!
//! | contents | files |
//! |---|---|
//! | the scene, and the checks of its invariants; lists shared between scenes | `src/model.rs`, `src/validate.rs`; `src/shared_list.rs` |
//! | motion: shutter and keys; checks of keys; paths and stills that become keys | `src/motion.rs`; `src/keys.rs`; `src/import/path.rs`, `src/import/merge.rs` |
//! | a scene that is changed part by part | `src/edit/` |
//! | loading a scene from a path; the importers' input, options and limits | `src/load.rs`; `src/import/request.rs`,
//! `src/options.rs`, `src/budget.rs` |
//! | parts that the importers share: locations in text files, placed meshes, curves, skies, projected pictures | `src/import/` |
//! | Bottega's own scene file: a scene in memory, bit for bit | `src/saved/` |
//! | glTF; its compressed buffers | `src/gltf/`; `src/gltf/meshopt/`, `src/gltf/draco.rs` |
//! | Mitsuba 3 and 0.x | `src/mitsuba/` |
//! | pbrt-v4 | `src/pbrt/` |
//! | USD: layers and packages; its schemas | `src/usd/` |
//! | subdivision surfaces; those of USD, of pbrt | `src/subdivision/`; `src/usd/subdivision.rs`, `src/pbrt/shape/subdivision.rs` |
//! | PLY, OBJ, Mitsuba's serialized meshes | `src/mesh_file/` |
//! | OpenVDB, NanoVDB | `src/voxel_file/` |
//! | measured materials: their files, tables and warps | `src/measured/` |
//! | curves that face each ray | `src/facing_curves.rs`, `src/import/strand.rs`; pbrt: `src/pbrt/shape/curve.rs` |
//! | curves as tubes | `src/import/tube.rs`; Mitsuba: `src/mitsuba/curve.rs`, `src/mesh_file/curves.rs` |
//! | materials, textures, lights, media, cameras | `src/material.rs`, `src/surface.rs`, `src/subsurface.rs`, `src/hair.rs`, `src/texture.rs`, `src/light.rs`, `src/medium.rs`, `src/camera.rs` |
//! | textures and their mappings, including mappings by world position | `src/texture.rs` |
//! | photometric profiles of lamps | `src/ies/` |
//! | pictures with mip levels: decoding, storage, lookup | `src/image/` |
//! | colours; spectra and colour spaces as colours | `src/color.rs`; `src/spectrum/` |
//! | names of parts, by which masks find them | `src/part_names.rs` |
//! | scenes far from their origin | `src/origin.rs` |
//! | which files a scene may read; lists of scene files from another machine | `src/resource/` |
//! | encodings of text | `src/text.rs` |
//! | parameters that have no effect here | `src/needless.rs`, `src/mitsuba/needless.rs`, `src/pbrt/needless.rs` |
//! | NaN, infinite and huge values; reflectances above 1 | `src/values.rs`, `src/excess.rs` |
//! | serialized vectors and matrices | `src/numbers.rs` |
//! | JSON and TOML readers that reject a list in place of an object | `src/objects_only.rs` |

mod blackbody;
mod budget;
mod camera;
mod color;
mod displacement;
mod edit;
mod emission;
mod error;
mod eval;
mod excess;
mod facing_curves;
mod file;
mod framing;
mod gltf;
mod grid;
mod hair;
mod hints;
mod ies;
mod image;
mod import;
mod integrator;
mod keys;
mod lenses;
mod light;
mod load;
mod material;
mod measured;
mod medium;
mod mend;
mod mesh_file;
mod mitsuba;
mod model;
mod motion;
mod needless;
mod noise;
mod numbers;
pub mod objects_only;
mod options;
mod origin;
mod param;
mod part_names;
mod pbrt;
mod resource;
mod saved;
mod shaped_light;
mod shapes;
mod shared_list;
mod sky;
mod spectrum;
mod subdivision;
mod subsurface;
mod summary;
mod surface;
mod text;
mod texture;
mod usd;
mod validate;
mod values;
mod visibility;
mod voxel_file;

pub use blackbody::Blackbody;
pub use camera::{
    Aperture, BLADES_MAX, Camera, Clip, FisheyeMapping, FovAxis, Panorama, Projection, Stereo, StereoLayout,
};
pub use color::Spectrum;
pub use displacement::{Displacement, DisplacementSource, DisplacementSpace};
pub use edit::{
    CornerMesh, CurveStrands, EditError, EditedLight, EditedLightKind, EntryKind, MatrixRows, PlacedObject, PutMode,
    SceneEditor,
};
pub use emission::{DirectionPicture, EmissionProfile};
pub use error::{SceneError, Warning};
pub use eval::Uvs;
pub use facing_curves::{CurveLook, CurveMeeting, CurvePoint, FacingCurves, ray_in_object};
pub use grid::{Blend, Grid, GridError};
pub use hair::{Hair, Pigment, Strand};
pub use hints::{FilmFilter, Metadata, RenderHints};
pub use ies::{IesInterpolation, IesPicture, IesProfile};
pub use image::pyramid::Encoding;
pub use image::raw::{LevelTexels, linear_of_srgb_codes};
pub use image::{Image, linear_of_srgb};
pub use integrator::{IntegratorHint, PhotonHints, TransportPaths};
pub use lenses::{LENS_SURFACES_MAX, LensDescription, LensError, LensRay, LensSurface, LensSystem};
pub use light::{Environment, EnvironmentMapping, Light, LightKind, Portal, SpotFalloff};
pub use load::{Loaded, load};
pub use material::{AlphaMode, Back, Material, Relief, ReliefRule, ReliefSource, Sides};
pub use measured::{Measured, NodeWeights, SquareTable, Symmetry, Warp};
pub use medium::{Coefficients, Density, EmissionVariation, Medium, MediumId, Variation};
pub use model::{COORDINATE_MAX, Instance, Mesh, Scene, Sphere};
pub use motion::{MeshKey, Shutter, SphereKey, TransformKey};
pub use noise::{Noise, OCTAVES_MAX, Octaves, is_within_dot};
pub use options::{DISPLACEMENT_MAX, LoadOptions, SUBDIVISION_MAX};
pub use param::{ColorParam, ScalarParam};
pub use part_names::PartNames;
pub use resource::SceneFile;
pub use saved::save_scene;
pub use shaped_light::{AreaLight, SphereLight, SpotCone};
pub use shared_list::SharedList;
pub use subsurface::{RadiusMeaning, Substance, Subsurface};
pub use summary::SceneSummary;
pub use surface::{
    Anisotropy, Coated, CoatedBase, Conductor, Dielectric, Diffuse, Distribution, Facets, InnerReflection, Iridescence,
    Layered, Phong, Plastic, Principled, RoughnessScale, Shadowing, Surface, Varnished, Ward, WardVariant,
};
pub use texture::{Channel, ImageId, Mapping, MappingKind, SURFACE_UV_SETS, TextureMap, Wrap};
pub use values::{FACTOR_MAX, VALUE_MAX};
pub use visibility::Visibility;
pub use voxel_file::Voxels;
