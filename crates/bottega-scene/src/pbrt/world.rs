//! The parsed contents of a file, before the scene is built.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::{DAffine3, DVec3};

use super::params::{Param, Params};
use super::shape::geometry::Geometry;
use crate::import::path::TransformPath;
use crate::import::text_place::TextPlace;
use crate::spectrum::color_space::ColorSpace;

/// A typed entity with parameters, such as `Material "diffuse" …`.
#[derive(Clone, Debug)]
pub(super) struct Entity {
    /// Type, such as `diffuse` or `perspective`.
    pub(super) kind: String,
    pub(super) params: Params,
    /// Location of the directive.
    pub(super) at: TextPlace,
    /// Object space to world space; for the camera, world space to camera space. At the start of the motion.
    pub(super) ctm: DAffine3,
    /// The same at its end.
    pub(super) end_ctm: DAffine3,
}

/// A reference to a material.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum MaterialRef {
    /// Index into [`PbrtWorld::materials`].
    Index(usize),
    /// A name that may be defined later.
    Named(Rc<str>, TextPlace),
}

/// A shape with its graphics state.
#[derive(Debug)]
pub(super) struct PlacedShape {
    pub(super) geometry: Geometry,
    /// Location of the `Shape` directive.
    pub(super) at: TextPlace,
    pub(super) world_from_object: TransformPath,
    /// `true`: `ReverseOrientation` is in effect.
    pub(super) reverse_orientation: bool,
    pub(super) material: MaterialRef,
    /// Index into [`PbrtWorld::area_lights`].
    pub(super) area_light: Option<usize>,
    /// Media behind and before its surface.
    pub(super) media: MediumInterface,
    /// Opacity; `None`: opaque.
    pub(super) alpha: Option<Alpha>,
    pub(super) displacement: Option<ShapeDisplacement>,
}

/// The displacement of a mesh by a texture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ShapeDisplacement {
    /// Name of the texture.
    pub(super) texture: Rc<str>,
    pub(super) at: TextPlace,
    /// Longest edge after refinement, in world space.
    pub(super) edge: f64,
}

/// The opacity of a shape: a constant or a texture.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Alpha {
    Constant(f64),
    Texture(Rc<str>, TextPlace),
}

/// Names of the media behind and before a surface; `None`: vacuum.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct MediumInterface {
    /// Medium behind the surface, where its normal does not point.
    pub(super) inside: Option<Rc<str>>,
    /// Medium before the surface, where its normal points.
    pub(super) outside: Option<Rc<str>>,
    /// Location of the `MediumInterface` directive.
    pub(super) at: TextPlace,
}

/// An instance of an object.
#[derive(Debug)]
pub(super) struct ObjectInstance {
    /// Name of the object, a key of [`PbrtWorld::objects`].
    pub(super) name: String,
    pub(super) world_from_instance: TransformPath,
    /// Location of the `ObjectInstance` directive.
    pub(super) at: TextPlace,
}

/// Everything that the file describes.
#[derive(Debug, Default)]
pub(super) struct PbrtWorld {
    pub(super) camera: Option<Entity>,
    /// Medium around the camera.
    pub(super) camera_media: MediumInterface,
    pub(super) film: Option<Entity>,
    pub(super) filter: Option<Entity>,
    pub(super) sampler: Option<Entity>,
    pub(super) integrator: Option<Entity>,
    /// Named and unnamed materials; index 0 is the default.
    pub(super) materials: Vec<Entity>,
    /// Indices into `materials`, by name.
    pub(super) named_materials: BTreeMap<String, usize>,
    /// Textures of type `float`, by name.
    pub(super) float_textures: BTreeMap<String, Entity>,
    /// Textures of type `spectrum`, by name.
    pub(super) spectrum_textures: BTreeMap<String, Entity>,
    /// `AreaLightSource` directives.
    pub(super) area_lights: Vec<Entity>,
    /// `LightSource` directives.
    pub(super) lights: Vec<Entity>,
    /// `MakeNamedMedium` directives, by name.
    pub(super) media: BTreeMap<String, Entity>,
    /// Shapes outside of object definitions.
    pub(super) shapes: Vec<PlacedShape>,
    /// Shapes of each object, by its name.
    pub(super) objects: BTreeMap<String, Vec<PlacedShape>>,
    pub(super) instances: Vec<ObjectInstance>,
    /// Times of the two transformations of what moves; `None`: 0 and 1.
    pub(super) transform_times: Option<[f64; 2]>,
    /// Offset that was subtracted from all positions.
    pub(super) origin: DVec3,
}

impl Entity {
    /// Returns the path of a transformation, which is computed from the current one at the start and at the end of the
    /// motion.
    pub(super) fn path(&self, world: &PbrtWorld, made: impl Fn(&DAffine3) -> DAffine3) -> TransformPath {
        world.path([made(&self.ctm), made(&self.end_ctm)])
    }

    /// Returns true if the entity moves.
    pub(super) fn moves(&self) -> bool {
        self.ctm != self.end_ctm
    }
}

impl PbrtWorld {
    /// Returns the path between two transformations, at the start and at the end of the motion.
    pub(super) fn path(&self, [start, end]: [DAffine3; 2]) -> TransformPath {
        let [first, last] = self.transform_times.unwrap_or([0.0, 1.0]);
        let keys = TransformPath::new(vec![(first, start), (last, end)]);
        keys.filter(|_| start != end).unwrap_or_else(|| TransformPath::still(start))
    }

    /// Subtracts an offset from all positions. Objects move with their instances.
    pub(super) fn move_to(&mut self, origin: DVec3) {
        if origin == DVec3::ZERO {
            return;
        }
        self.origin = origin;
        let moved = DAffine3::from_translation(-origin);
        let textures = self.float_textures.values_mut().chain(self.spectrum_textures.values_mut());
        for entity in textures.chain(&mut self.lights).chain(self.media.values_mut()) {
            entity.ctm = moved * entity.ctm;
            entity.end_ctm = moved * entity.end_ctm;
        }
        if let Some(camera) = &mut self.camera {
            camera.ctm *= DAffine3::from_translation(origin);
            camera.end_ctm *= DAffine3::from_translation(origin);
        }
        for shape in &mut self.shapes {
            shape.world_from_object = shape.world_from_object.then(&moved);
        }
        for instance in &mut self.instances {
            instance.world_from_instance = instance.world_from_instance.then(&moved);
        }
    }
}

/// The entities for which `Attribute` sets defaults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Target {
    Shape,
    Light,
    Material,
    Medium,
    Texture,
}

/// The graphics state, saved by `AttributeBegin` and restored by `AttributeEnd`.
#[derive(Clone, Debug)]
pub(super) struct GraphicsState {
    /// Current transformation at the start and end of the shutter time.
    pub(super) ctm: [DAffine3; 2],
    /// Flags of the transformations that directives change.
    pub(super) active: [bool; 2],
    /// `true`: `ReverseOrientation` is in effect.
    pub(super) reverse_orientation: bool,
    pub(super) material: MaterialRef,
    /// Index into [`PbrtWorld::area_lights`].
    pub(super) area_light: Option<usize>,
    /// Media of the following shapes, lights or camera.
    pub(super) media: MediumInterface,
    /// Colour space of the following `rgb` parameters.
    pub(super) color_space: ColorSpace,
    /// Defaults for each [`Target`].
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
    /// Returns the target with a name in the file; `None`: the name is unknown.
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
    /// Changes the active transformations.
    pub(super) fn transform(&mut self, change: impl Fn(&DAffine3) -> DAffine3) {
        for (ctm, _) in self.ctm.iter_mut().zip(self.active).filter(|(_, active)| *active) {
            *ctm = change(ctm);
        }
    }

    /// Adds the defaults of a target to a parameter list.
    pub(super) fn complete(&self, params: Params, target: Target) -> Params {
        params.with_attributes(&self.attributes[target as usize])
    }
}
