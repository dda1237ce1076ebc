//! The world of a file: everything that its directives name, before it becomes a scene.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::{DAffine3, DVec3};

use super::color_space::ColorSpace;
use super::params::{Param, Params};
use super::shape::geometry::Geometry;
use super::token::PbrtPlace;

/// A thing with a type and parameters: `Material "diffuse" …`.
#[derive(Clone, Debug)]
pub(super) struct Entity {
    /// `diffuse`, `perspective` …
    pub(super) kind: String,
    pub(super) params: Params,
    pub(super) at: PbrtPlace,
    /// Object space to world space; of the camera the other way round.
    pub(super) ctm: DAffine3,
}

/// Which material a shape is made of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum MaterialRef {
    /// Index into [`PbrtWorld::materials`].
    Index(usize),
    /// By a name that may be given later.
    Named(Rc<str>, PbrtPlace),
}

/// A shape where it was described.
#[derive(Debug)]
pub(super) struct PlacedShape {
    pub(super) geometry: Geometry,
    pub(super) at: PbrtPlace,
    pub(super) world_from_object: DAffine3,
    pub(super) reverse_orientation: bool,
    pub(super) material: MaterialRef,
    /// Index into [`PbrtWorld::area_lights`].
    pub(super) area_light: Option<usize>,
    pub(super) media: MediumInterface,
    /// Opacity: constant, or the name of a texture.
    pub(super) alpha: Option<Alpha>,
}

/// Opacity of a shape.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Alpha {
    Constant(f64),
    Texture(Rc<str>, PbrtPlace),
}

/// Names of the media behind and before a surface; `None`: vacuum.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct MediumInterface {
    pub(super) inside: Option<Rc<str>>,
    pub(super) outside: Option<Rc<str>>,
    pub(super) at: PbrtPlace,
}

/// A use of an object.
#[derive(Debug)]
pub(super) struct ObjectInstance {
    pub(super) name: String,
    pub(super) world_from_instance: DAffine3,
    pub(super) at: PbrtPlace,
}

/// All that was described.
#[derive(Debug, Default)]
pub(super) struct PbrtWorld {
    pub(super) camera: Option<Entity>,
    /// What the camera stands in.
    pub(super) camera_media: MediumInterface,
    pub(super) film: Option<Entity>,
    pub(super) filter: Option<Entity>,
    pub(super) sampler: Option<Entity>,
    pub(super) integrator: Option<Entity>,
    pub(super) materials: Vec<Entity>,
    /// Indices into `materials`.
    pub(super) named_materials: BTreeMap<String, usize>,
    pub(super) float_textures: BTreeMap<String, Entity>,
    pub(super) spectrum_textures: BTreeMap<String, Entity>,
    pub(super) area_lights: Vec<Entity>,
    pub(super) lights: Vec<Entity>,
    pub(super) media: BTreeMap<String, Entity>,
    pub(super) shapes: Vec<PlacedShape>,
    /// What stands between `ObjectBegin` and `ObjectEnd`, by name.
    pub(super) objects: BTreeMap<String, Vec<PlacedShape>>,
    pub(super) instances: Vec<ObjectInstance>,
    /// Where something moves while the shutter is open, for the first such thing, and how many there are.
    pub(super) moving: Option<(PbrtPlace, usize)>,
    /// What has been taken from all places.
    pub(super) origin: DVec3,
}

impl PbrtWorld {
    /// Takes a place from all others. What stands in objects follows by their instances.
    pub(super) fn move_to(&mut self, origin: DVec3) {
        if origin == DVec3::ZERO {
            return;
        }
        self.origin = origin;
        let moved = DAffine3::from_translation(-origin);
        let textures = self.float_textures.values_mut().chain(self.spectrum_textures.values_mut());
        for entity in textures.chain(&mut self.lights).chain(self.media.values_mut()) {
            entity.ctm = moved * entity.ctm;
        }
        if let Some(camera) = &mut self.camera {
            camera.ctm *= DAffine3::from_translation(origin);
        }
        for shape in &mut self.shapes {
            shape.world_from_object = moved * shape.world_from_object;
        }
        for instance in &mut self.instances {
            instance.world_from_instance = moved * instance.world_from_instance;
        }
    }
}

/// What `Attribute` sets defaults for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    Shape,
    Light,
    Material,
    Medium,
    Texture,
}

/// What `AttributeBegin` saves and `AttributeEnd` brings back.
#[derive(Clone, Debug)]
pub(super) struct GraphicsState {
    /// At the start and at the end of the time that the file speaks of.
    pub(super) ctm: [DAffine3; 2],
    /// Which of the two are changed.
    pub(super) active: [bool; 2],
    pub(super) reverse_orientation: bool,
    pub(super) material: MaterialRef,
    pub(super) area_light: Option<usize>,
    pub(super) media: MediumInterface,
    pub(super) color_space: ColorSpace,
    /// For each [`Target`].
    pub(super) attributes: [Rc<Vec<Rc<Param>>>; 5],
}

impl Default for GraphicsState {
    fn default() -> Self {
        Self {
            ctm: [DAffine3::IDENTITY; 2],
            active: [true; 2],
            reverse_orientation: false,
            material: MaterialRef::Index(0),
            area_light: None,
            media: MediumInterface::default(),
            color_space: ColorSpace::default(),
            attributes: Default::default(),
        }
    }
}

impl Target {
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "shape" => Self::Shape,
            "light" => Self::Light,
            "material" => Self::Material,
            "medium" => Self::Medium,
            "texture" => Self::Texture,
            _ => return None,
        })
    }
}

impl GraphicsState {
    /// Changes the transformations that are active.
    pub(super) fn transform(&mut self, change: impl Fn(&DAffine3) -> DAffine3) {
        for (ctm, _) in self.ctm.iter_mut().zip(self.active).filter(|(_, active)| *active) {
            *ctm = change(ctm);
        }
    }

    /// A list that falls back to the attributes of that kind.
    pub(super) fn complete(&self, params: Params, target: Target) -> Params {
        params.with_attributes(&self.attributes[target as usize])
    }
}
