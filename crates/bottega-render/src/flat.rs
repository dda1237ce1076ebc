//! A prepared scene and its camera as arrays of 32-bit words, for GPUs.
//!
//! The layout is portable: every number is an `f32` or `u32` in the machine's byte order, every record starts at a word
//! boundary, and references within the array are offsets in words from its start; [`NONE`] stands for no reference. A
//! [`FlatScene`] starts with the offsets of [`header`]. Each record is declared once, by [`record!`](crate::record), for
//! writers and readers. Materials and pictures are not included: the reader stores them in its own form, and writes its
//! handles of pictures to the offsets in [`FlatScene::pictures`].
//!
//! The records are written here alone: lights, cameras and filters do not know their flat form.

mod environment;
mod geometry;
mod layout;
mod lights;
mod picture;
mod record;
mod word_buffer;

use bottega_image::Aov;
use bottega_scene::{AlphaMode, EmissionProfile, EnvironmentMapping, Light, LightKind, TextureMap, Visibility};

use crate::{prepare::PreparedScene, surfaces::used_materials};

pub use layout::{
    CameraRecord, EnvironmentRecord, FilterRecord, InstanceRecord, LIGHT_WORDS, MeshRecord, NONE, ParallelRecord,
    PictureLightRecord, PictureRecord, PointLightRecord, ShiningRecord, SphereLightRecord, SphereRecord,
    SpotLightRecord, SurfaceLightRecord, TableRecord, TreeNodeRecord, code, header,
};
pub use picture::{FlatPicture, sobol_table};
pub use record::{FieldPlace, Portable, Record, place_of, places};
use word_buffer::WordBuffer;

/// Constants of light transport that GPU shaders share; each is documented where it is declared.
pub mod constants {
    pub use crate::filter::INTERVALS as FILTER_INTERVALS;
    pub use crate::integrator::{ROULETTE_SURVIVAL_MAX, SCATTERED_SPREAD, SHADOW_MARGIN};
    pub use crate::interaction::{ASKS_AS_SHADOW, CLEARANCE, COSINE_MIN, EXTENT_CLEARANCE};
    pub use crate::lights::{DISTANCE_SQUARED_MIN, SHARE_MIN, SOLID_ANGLE_MIN};
    pub use crate::shading::{BLEND, DEPTH_SHIFT};
}

/// The layers that a device makes of a flat scene; error and sample count come with every picture.
pub const LAYERS: [Aov; 5] = [Aov::Albedo, Aov::Normal, Aov::Depth, Aov::SampleCount, Aov::Error];

/// A prepared scene as an array of 32-bit words, for a GPU.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatScene {
    /// The words, in the layout of the [module](self).
    pub words: Vec<u32>,
    /// Pictures of lights, with the offsets of the words that receive their handles.
    pub pictures: Vec<(u32, TextureMap)>,
    /// `true`: some surface may let rays pass.
    pub has_opacity: bool,
}

/// A feature of a scene that its flat form does not support; its text is a noun phrase for display.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotFlat {
    /// Surfaces that are invisible to the camera from behind.
    #[error("surfaces that are invisible to the camera from behind")]
    CulledBacks,
    /// Media that scatter or emit, or are not bounded by refracting surfaces; light that is scattered below surfaces.
    #[error("media that scatter or have no refracting boundary, and subsurface scattering")]
    Media,
    /// Panes, which transmit light straight through without counting as a bounce.
    #[error("panes between surfaces and lights without extent")]
    Panes,
    /// A camera that does not see emitters.
    #[error("a camera that does not see lights")]
    HiddenEmitters,
    /// Curves that face each ray.
    #[error("curves that face each ray")]
    Curves,
    /// Lights that no ray can hit.
    #[error("lights that no ray can hit")]
    InvisibleLights,
    /// Surfaces or lights that are not there for some kinds of ray.
    #[error("visibility by kind of ray")]
    Visibility,
    /// Lights that do not emit in all directions.
    #[error("surfaces that shine into a cone or by a profile")]
    EmissionProfiles,
    /// Lights without extent that have a profile.
    #[error("lights with a profile by latitude and longitude")]
    Profiles,
    /// Sums of surfaces.
    #[error("sums of surfaces")]
    Sums,
    /// Suns with a disc.
    #[error("a sun with an angle")]
    Suns,
    /// An environment behind portals.
    #[error("an environment behind portals")]
    Portals,
    /// Motion while the shutter is open.
    #[error("motion blur")]
    Motion,
    /// More words than a `u32` offset can address.
    #[error("more than 2³² words of geometry")]
    TooMuch,
}

impl FlatScene {
    /// Writes a prepared scene as words.
    ///
    /// # Errors
    /// Each feature of the scene that the flat form does not support.
    pub fn new(prepared: &PreparedScene) -> Result<Self, Vec<NotFlat>> {
        let mut missing = Vec::new();
        if prepared.culls_backs() {
            missing.push(NotFlat::CulledBacks);
        }
        if prepared.needs_volume() {
            missing.push(NotFlat::Media);
        }
        if prepared.has_panes() {
            missing.push(NotFlat::Panes);
        }
        if prepared.moves() {
            missing.push(NotFlat::Motion);
        }
        if prepared.scene().cameras.iter().any(|camera| camera.hides_emitters) {
            missing.push(NotFlat::HiddenEmitters);
        }
        if prepared.has_curves() {
            missing.push(NotFlat::Curves);
        }
        let is_absent = |material: usize| prepared.scene().materials[material].alpha_mode == AlphaMode::Absent;
        if used_materials(prepared.scene()).any(is_absent) {
            missing.push(NotFlat::InvisibleLights);
        }
        let scene = prepared.scene();
        let mut lights = scene.lights.iter().map(|light| light.visibility);
        let mut environment = scene.environment.iter().map(|environment| environment.visibility);
        let is_partial = |visibility| visibility != Visibility::ALL;
        if prepared.has_visibility() || lights.any(is_partial) || environment.any(is_partial) {
            missing.push(NotFlat::Visibility);
        }
        let has_profile = |material: usize| scene.materials[material].emission_profile != EmissionProfile::Diffuse;
        if used_materials(scene).any(has_profile) {
            missing.push(NotFlat::EmissionProfiles);
        }
        let is_profile = |light: &Light| matches!(light.kind, LightKind::Goniometric { mapping, .. } if mapping != EnvironmentMapping::EqualArea);
        if scene.lights.iter().any(is_profile) {
            missing.push(NotFlat::Profiles);
        }
        if used_materials(scene).any(|material| scene.materials[material].has_sum()) {
            missing.push(NotFlat::Sums);
        }
        if prepared.lights().has_discs() {
            missing.push(NotFlat::Suns);
        }
        if prepared.scene().environment.as_ref().is_some_and(|environment| !environment.portals.is_empty()) {
            missing.push(NotFlat::Portals);
        }
        if geometry::count(prepared) >= u64::from(NONE) {
            missing.push(NotFlat::TooMuch);
        }
        if !missing.is_empty() {
            return Err(missing);
        }
        let mut words = WordBuffer::with_header(header::COUNT);
        geometry::write(prepared, &mut words);
        lights::write(prepared.lights(), prepared.scene(), &mut words);
        let (words, pictures) = words.into_inner();
        Ok(Self { words, pictures, has_opacity: prepared.has_opacity() })
    }
}
