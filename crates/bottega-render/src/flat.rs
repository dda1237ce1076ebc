//! A prepared scene and a picture of it as arrays of 32-bit words, for devices that know nothing of Rust.
//!
//! One portable layout: every number is an `f32` or a `u32` in the byte order of the machine, every record begins at a multiple
//! of one word, and what refers to something else in the array does so by its place, counted in words from the beginning;
//! [`NONE`] stands for nothing. [`FlatScene`] begins with the [`header`] places; each record is declared once, by [`record!`](crate::record),
//! for those who write it and for those who read it.
//! Materials and pictures are not in it: who reads it has them in the form that it likes best, and writes the numbers by which it
//! knows pictures to the places that [`FlatScene::pictures`] tells.

mod geometry;
mod layout;
mod picture;
mod record;
mod words;

use bottega_scene::{AlphaMode, TextureMap};

use crate::{PreparedScene, surfaces::used_materials};

pub use layout::{
    CameraRecord, EnvironmentRecord, FilterRecord, InstanceRecord, LIGHT_WORDS, MeshRecord, NONE, ParallelRecord,
    PictureLightRecord, PictureRecord, PointLightRecord, ShiningRecord, SphereLightRecord, SphereRecord,
    SpotLightRecord, SurfaceLightRecord, TableRecord, TreeNodeRecord, code, header,
};
pub use picture::{FlatPicture, sobol_table};
pub use record::{FieldPlace, Portable, Record, place_of, places};
pub(crate) use words::Words;

/// Constants of light transport that shaders share: where they are declared, they say what they are.
pub mod constants {
    pub use crate::filter::INTERVALS as FILTER_INTERVALS;
    pub use crate::integrator::{ROULETTE_SURVIVAL_MAX, SCATTERED_SPREAD, SHADOW_MARGIN};
    pub use crate::interaction::{ASKS_AS_SHADOW, CLEARANCE, COSINE_MIN, EXTENT_CLEARANCE};
    pub use crate::lights::{DISTANCE_SQUARED_MIN, SHARE_MIN, SOLID_ANGLE_MIN};
    pub use crate::shading::{BLEND, DEPTH_SHIFT};
}

/// A prepared scene as words.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatScene {
    /// See the [module](self).
    pub words: Vec<u32>,
    /// Pictures that lights refer to, and the places of the words that are to be their numbers.
    pub pictures: Vec<(u32, TextureMap)>,
    /// Whether some surface may let rays pass.
    pub has_opacity: bool,
}

/// The part of a scene that its flat form cannot say.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotFlat {
    /// A surface that the camera sees through from behind.
    #[error("surfaces that the camera sees through from behind")]
    CulledBacks,
    /// A medium that scatters, emits, or does not begin and end where light is refracted.
    #[error("media that scatter or have no refracting boundary")]
    Media,
    /// Panes that are no bounce for what goes straight through.
    #[error("panes that let the light of lamps without extent through")]
    Panes,
    /// A camera that does not see what shines.
    #[error("a camera from which what shines is hidden")]
    HiddenEmitters,
    /// Curves that face each ray.
    #[error("curves that face each ray")]
    Curves,
    /// Lamps that no ray meets.
    #[error("lamps that are not there")]
    AbsentLamps,
    /// Windows that let an environment in.
    #[error("an environment behind portals")]
    Portals,
    /// More words than places have numbers.
    #[error("more than 2³² words of geometry")]
    TooMuch,
}

impl FlatScene {
    /// Writes down a scene.
    ///
    /// # Errors
    /// Everything that stands in the way.
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
        if prepared.scene().cameras.iter().any(|camera| camera.hides_emitters) {
            missing.push(NotFlat::HiddenEmitters);
        }
        if prepared.has_curves() {
            missing.push(NotFlat::Curves);
        }
        let is_absent = |material: usize| prepared.scene().materials[material].alpha_mode == AlphaMode::Absent;
        if used_materials(prepared.scene()).any(is_absent) {
            missing.push(NotFlat::AbsentLamps);
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
        let mut words = Words::with_header(header::COUNT);
        geometry::write(prepared, &mut words);
        prepared.lights().write(prepared.scene(), &mut words);
        let (words, pictures) = words.into_inner();
        Ok(Self { words, pictures, has_opacity: prepared.has_opacity() })
    }
}
