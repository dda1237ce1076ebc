//! Parsing of directives.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::DAffine3;

use super::context::Context;
use super::needless::Directive;
use super::params::Params;
use super::token::{Token, Tokens};
use super::world::{
    Alpha, Entity, GraphicsState, MaterialRef, MediumInterface, ObjectInstance, PbrtWorld, ShapeDisplacement, Target,
};
use super::{dialect, shape};
use crate::import::text_place::{ImportResult, TextFault, TextPlace};
use crate::mesh_file::unfolded;
use crate::spectrum::color_space::ColorSpace;
use crate::text::{Text, decode, shortened};

/// Maximal depth of included files.
const INCLUDE_DEPTH_MAX: usize = 64;

/// Maximal number of included files; the same file may be included repeatedly.
const INCLUDE_COUNT_MAX: usize = 100_000;

/// Maximal depth of `AttributeBegin`.
const ATTRIBUTE_DEPTH_MAX: usize = 1024;

/// Parses a file and all files that it includes.
pub(super) struct Parser<'c, 'a> {
    context: &'c mut Context<'a>,
    /// The entities so far.
    pub(super) world: PbrtWorld,
    /// Current graphics state.
    pub(super) state: GraphicsState,
    /// Saved states, with the block and location that saved them.
    saved: Vec<(GraphicsState, Block, TextPlace)>,
    /// Named transformations, at the start and end of the shutter time.
    pub(super) coordinate_systems: BTreeMap<String, [DAffine3; 2]>,
    in_world: bool,
    /// Name of the current object, between `ObjectBegin` and `ObjectEnd`.
    object: Option<String>,
    /// Names of the open files, outermost first.
    open_files: Vec<String>,
    include_count: usize,
    /// Remaining limit of text, in bytes.
    bytes_left: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Block {
    Attribute,
    Transform,
    Object,
}

impl Block {
    fn name(self) -> &'static str {
        match self {
            Self::Attribute => "Attribute",
            Self::Transform => "Transform",
            Self::Object => "Object",
        }
    }
}

impl<'c, 'a> Parser<'c, 'a> {
    /// Makes a parser with the initial graphics state.
    pub(super) fn new(context: &'c mut Context<'a>) -> Self {
        let bytes_left = context.resources.budget().limit();
        let world = PbrtWorld { materials: vec![Entity::plain("diffuse")], ..PbrtWorld::default() };
        Self {
            context,
            world,
            state: GraphicsState::default(),
            saved: Vec::new(),
            coordinate_systems: BTreeMap::new(),
            in_world: false,
            object: None,
            open_files: Vec::new(),
            include_count: 0,
            bytes_left,
        }
    }

    /// Parses the scene file, and checks that all blocks are closed.
    pub(super) fn read_scene(&mut self, bytes: &[u8]) -> ImportResult<()> {
        let end = self.read_file(0, bytes)?;
        if let Some((_, block, at)) = self.saved.last() {
            return Err(at.fault(format!("{0}Begin has no {0}End", block.name())).into());
        }
        if !self.in_world {
            return Err(end.fault("the file ends before WorldBegin: it has no scene, or was cut off").into());
        }
        Ok(())
    }

    /// Parses a file. Returns the location of its end.
    fn read_file(&mut self, file: u32, bytes: &[u8]) -> ImportResult<TextPlace> {
        let Text { text, guess } = decode(self.context.path(file), bytes, self.context.resources.budget())?;
        if let Some((line, message)) = guess {
            let line = u32::try_from(line).unwrap_or(u32::MAX);
            self.context.warn(TextPlace { file, line, column: 1 }, message);
        }
        let mut tokens = Tokens::new(file, &text);
        if text.len() > self.bytes_left {
            return Err(tokens.here().fault("the scene includes more text than the limit of memory allows").into());
        }
        self.bytes_left -= text.len();
        while let Some((token, at)) = tokens.next()? {
            let Token::Word(word) = token else {
                return Err(at.fault("a directive is expected here, such as Shape or Translate").into());
            };
            self.directive(&word, at, &mut tokens)?;
        }
        Ok(tokens.here())
    }

    fn directive(&mut self, word: &str, at: TextPlace, tokens: &mut Tokens<'_>) -> ImportResult<()> {
        match word {
            "Identity" | "Translate" | "Scale" | "Rotate" | "LookAt" | "Transform" | "ConcatTransform"
            | "CoordinateSystem" | "CoordSysTransform" | "ActiveTransform" | "TransformTimes" => {
                self.transformation(word, at, tokens)
            }
            "AttributeBegin" => self.begin(Block::Attribute, at),
            "AttributeEnd" => self.end(Block::Attribute, at),
            "TransformBegin" => self.begin(Block::Transform, at),
            "TransformEnd" => self.end(Block::Transform, at),
            "ObjectBegin" | "ObjectEnd" | "ObjectInstance" => self.object_directive(word, at, tokens),
            "Camera" | "Film" | "Sampler" | "Integrator" | "PixelFilter" | "Accelerator" => {
                self.option_directive(word, at, tokens)
            }
            "Option" => {
                let (name, _) = text(tokens, at, word)?;
                let (value, _) = tokens.next()?.ok_or_else(|| ended(at, word))?;
                if dialect::option_matters(&name, &value) {
                    self.context.unsupported(at, format!("the option \"{}\" is left out", shortened(&name)));
                }
                Ok(())
            }
            "WorldBegin" => {
                self.only_before_world(at, word)?;
                self.in_world = true;
                self.state.ctm = [DAffine3::IDENTITY; 2];
                self.state.active = [true; 2];
                self.coordinate_systems.insert("world".into(), self.state.ctm);
                Ok(())
            }
            "WorldEnd" => {
                self.context.warn(at, "WorldEnd is of pbrt-v3, and has no meaning in pbrt-v4");
                Ok(())
            }
            "Include" | "Import" => self.include(word, at, tokens),
            "Attribute" => {
                let (name, name_at) = text(tokens, at, word)?;
                let Some(target) = Target::named(&name) else {
                    return Err(name_at.fault("an attribute is of a shape, light, material, medium or texture").into());
                };
                let params = Params::read(tokens, at, self.state.color_space)?;
                Rc::make_mut(&mut self.state.attributes[target as usize]).extend(params.into_attributes());
                Ok(())
            }
            "ColorSpace" => {
                let (name, name_at) = text(tokens, at, word)?;
                match ColorSpace::named(&name) {
                    Some(color_space) => self.state.color_space = color_space,
                    None => {
                        let message = format!("the colour space \"{}\" is unknown", shortened(&name));
                        self.context.unsupported(name_at, message);
                    }
                }
                Ok(())
            }
            "ReverseOrientation" => {
                self.state.reverse_orientation = !self.state.reverse_orientation;
                Ok(())
            }
            _ => self.world_directive(word, at, tokens),
        }
    }

    fn world_directive(&mut self, word: &str, at: TextPlace, tokens: &mut Tokens<'_>) -> ImportResult<()> {
        match word {
            "Material" => {
                self.only_in_world(at, word)?;
                let entity = self.entity(word, at, tokens, Some(Target::Material))?;
                self.state.material = MaterialRef::Index(self.world.materials.len());
                self.world.materials.push(entity);
            }
            "MakeNamedMaterial" => {
                self.only_in_world(at, word)?;
                let (name, _) = text(tokens, at, word)?;
                let entity = self.typed_entity(word, at, tokens, Target::Material)?;
                if self.world.named_materials.contains_key(&*name) {
                    return Err(at.fault(format!("the material \"{}\" is made twice", shortened(&name))).into());
                }
                self.world.named_materials.insert(name, self.world.materials.len());
                self.world.materials.push(entity);
            }
            "NamedMaterial" => {
                self.only_in_world(at, word)?;
                let (name, name_at) = text(tokens, at, word)?;
                self.state.material = MaterialRef::Named(name.into(), name_at);
            }
            "MakeNamedMedium" => {
                let (name, _) = text(tokens, at, word)?;
                let entity = self.typed_entity(word, at, tokens, Target::Medium)?;
                if self.world.media.insert(name.clone(), entity).is_some() {
                    return Err(at.fault(format!("the medium \"{}\" is made twice", shortened(&name))).into());
                }
            }
            "MediumInterface" => {
                let (inside, _) = text(tokens, at, word)?;
                let outside = match tokens.peek()? {
                    Some((Token::Text(_), _)) => text(tokens, at, word)?.0,
                    _ => inside.clone(),
                };
                let name = |name: String| (!name.is_empty()).then(|| name.into());
                self.state.media = MediumInterface { inside: name(inside), outside: name(outside), at };
            }
            "Texture" => {
                self.only_in_world(at, word)?;
                let (name, _) = text(tokens, at, word)?;
                let (kind, kind_at) = text(tokens, at, word)?;
                if kind != "float" && kind != "spectrum" {
                    dialect::check("Texture type", &kind, kind_at)?;
                    return Err(kind_at.fault("a texture is of type \"float\" or \"spectrum\"").into());
                }
                let entity = self.entity(word, at, tokens, Some(Target::Texture))?;
                let textures =
                    if kind == "float" { &mut self.world.float_textures } else { &mut self.world.spectrum_textures };
                if textures.insert(name.clone(), entity).is_some() {
                    return Err(at.fault(format!("the texture \"{}\" is made twice", shortened(&name))).into());
                }
            }
            "LightSource" => {
                self.only_in_world(at, word)?;
                let entity = self.entity(word, at, tokens, Some(Target::Light))?;
                self.world.lights.push(entity);
            }
            "AreaLightSource" => {
                self.only_in_world(at, word)?;
                let entity = self.entity(word, at, tokens, Some(Target::Light))?;
                self.state.area_light = Some(self.world.area_lights.len());
                self.world.area_lights.push(entity);
            }
            "Shape" => self.shape(at, tokens)?,
            _ => {
                dialect::check("directive", word, at)?;
                return Err(at.fault(format!("there is no directive `{}`", shortened(word))).into());
            }
        }
        Ok(())
    }

    fn option_directive(&mut self, word: &str, at: TextPlace, tokens: &mut Tokens<'_>) -> ImportResult<()> {
        self.only_before_world(at, word)?;
        let entity = Some(self.entity(word, at, tokens, None)?);
        match word {
            "Camera" => {
                self.coordinate_systems.insert("camera".into(), self.state.ctm.map(|ctm| ctm.inverse()));
                self.world.camera = entity;
                self.world.camera_media = self.state.media.clone();
            }
            "Film" => self.world.film = entity,
            "Sampler" => self.world.sampler = entity,
            "Integrator" => self.world.integrator = entity,
            "PixelFilter" => self.world.filter = entity,
            // Accelerators have no effect here.
            _ => {}
        }
        Ok(())
    }

    fn object_directive(&mut self, word: &str, at: TextPlace, tokens: &mut Tokens<'_>) -> ImportResult<()> {
        self.only_in_world(at, word)?;
        if word == "ObjectEnd" {
            self.end(Block::Object, at)?;
            self.object = None;
            return Ok(());
        }
        let (name, _) = text(tokens, at, word)?;
        if self.object.is_some() {
            return Err(at.fault(format!("{word} within an object")).into());
        }
        if word == "ObjectInstance" {
            self.book(at, size_of::<ObjectInstance>() + name.len())?;
            let world_from_instance = self.world.path(self.state.ctm);
            self.world.instances.push(ObjectInstance { name, world_from_instance, at });
            return Ok(());
        }
        self.begin(Block::Object, at)?;
        if self.world.objects.contains_key(&name) {
            return Err(at.fault(format!("the object \"{}\" is made twice", shortened(&name))).into());
        }
        self.world.objects.insert(name.clone(), Vec::new());
        self.object = Some(name);
        Ok(())
    }

    fn shape(&mut self, at: TextPlace, tokens: &mut Tokens<'_>) -> ImportResult<()> {
        self.only_in_world(at, "Shape")?;
        let entity = self.entity("Shape", at, tokens, Some(Target::Shape))?;
        let params = &entity.params;
        let alpha = match params.texture("alpha")? {
            Some((name, at)) => Some(Alpha::Texture(name.into(), at)),
            None => params.float("alpha")?.map(Alpha::Constant),
        };
        let displacement = if entity.kind == "plymesh" { displacement(params)? } else { None };
        let shines = self.state.area_light.is_some() && self.object.is_none();
        let geometry = shape::read(self.context, &entity, shines)?;
        self.context.report_unused(Directive::Shape, &entity.kind, params);
        let Some(geometry) = geometry else { return Ok(()) };
        self.book(at, size_of::<super::world::PlacedShape>())?;
        let mut area_light = self.state.area_light;
        if area_light.is_some() && self.object.is_some() {
            self.context.warn(at, "a light within an object does not shine, as in pbrt");
            area_light = None;
        }
        let shape = super::world::PlacedShape {
            geometry,
            at,
            world_from_object: self.world.path([entity.ctm, entity.end_ctm]),
            reverse_orientation: self.state.reverse_orientation,
            material: self.state.material.clone(),
            area_light,
            media: self.state.media.clone(),
            alpha,
            displacement,
        };
        let object = self.object.as_ref().and_then(|name| self.world.objects.get_mut(name));
        match object {
            Some(shapes) => shapes.push(shape),
            None => self.world.shapes.push(shape),
        }
        Ok(())
    }

    fn include(&mut self, word: &str, at: TextPlace, tokens: &mut Tokens<'_>) -> ImportResult<()> {
        let (reference, reference_at) = text(tokens, at, word)?;
        let place = self.context.place(reference_at);
        let location = self.context.resources.locate(&reference, &place)?;
        if self.context.resources.is_scene(&location) || self.open_files.contains(&location.name) {
            let problem = format!("`{}` includes itself, directly or through others", shortened(&reference));
            return Err(reference_at.fault(problem).into());
        }
        self.include_count += 1;
        if self.open_files.len() >= INCLUDE_DEPTH_MAX || self.include_count > INCLUDE_COUNT_MAX {
            let problem = format!(
                "more than {INCLUDE_DEPTH_MAX} files within each other, or {INCLUDE_COUNT_MAX} in all, are included"
            );
            return Err(reference_at.fault(problem).into());
        }
        let bytes = self.context.resources.read(&location)?;
        let unfolded = unfolded(location.path(), bytes, self.context.resources.budget());
        let (bytes, _held) = self.context.resources.attribute(&location, unfolded)?;
        let file = self.context.add_file(location.name.as_str(), location.path());
        self.open_files.push(location.name.clone());
        let (state, depth) = (self.state.clone(), self.saved.len());
        self.read_file(file, &bytes)?;
        self.open_files.pop();
        // An imported file does not change the graphics state.
        if word == "Import" {
            if self.saved.len() != depth {
                return Err(at.fault("the file that is imported does not end what it begins").into());
            }
            self.state = state;
        }
        Ok(())
    }

    fn begin(&mut self, block: Block, at: TextPlace) -> ImportResult<()> {
        if block == Block::Attribute {
            self.only_in_world(at, "AttributeBegin")?;
        }
        if self.saved.len() >= ATTRIBUTE_DEPTH_MAX {
            return Err(at.fault(format!("more than {ATTRIBUTE_DEPTH_MAX} blocks within each other")).into());
        }
        self.saved.push((self.state.clone(), block, at));
        Ok(())
    }

    fn end(&mut self, block: Block, at: TextPlace) -> ImportResult<()> {
        let name = block.name();
        match self.saved.pop() {
            None => Err(at.fault(format!("{name}End without {name}Begin")).into()),
            Some((state, begun, _)) if begun == block => {
                match block {
                    Block::Transform => (self.state.ctm, self.state.active) = (state.ctm, state.active),
                    Block::Attribute | Block::Object => self.state = state,
                }
                Ok(())
            }
            Some((_, begun, begun_at)) => {
                let (begun, line) = (begun.name(), begun_at.line);
                Err(at.fault(format!("{name}End, but {begun}Begin of line {line} is still open")).into())
            }
        }
    }

    /// Reads the quoted type and the parameters of a directive.
    fn entity(
        &self,
        word: &str,
        at: TextPlace,
        tokens: &mut Tokens<'_>,
        target: Option<Target>,
    ) -> ImportResult<Entity> {
        let (kind, kind_at) = text(tokens, at, word)?;
        dialect::check(word, &kind, kind_at)?;
        let params = Params::read(tokens, at, self.state.color_space)?;
        let params = match target {
            Some(target) => self.state.complete(params, target),
            None => params,
        };
        // Shapes book their geometry instead.
        if word != "Shape" {
            self.book(at, size_of::<Entity>() + params.memory_bytes())?;
        }
        let [ctm, end_ctm] = self.state.ctm;
        Ok(Entity { kind, params, at, ctm, end_ctm })
    }

    /// Reads the parameters after a name; the type is one of them.
    fn typed_entity(&self, word: &str, at: TextPlace, tokens: &mut Tokens<'_>, target: Target) -> ImportResult<Entity> {
        let params = self.state.complete(Params::read(tokens, at, self.state.color_space)?, target);
        let Some(kind) = params.text("type")? else {
            return Err(at.fault(format!("{word} needs the parameter \"string type\"")).into());
        };
        dialect::check(word, kind, params.place_of("type"))?;
        self.book(at, size_of::<Entity>() + params.memory_bytes())?;
        let [ctm, end_ctm] = self.state.ctm;
        Ok(Entity { kind: kind.into(), params, at, ctm, end_ctm })
    }

    /// Books memory for the data of a directive.
    fn book(&self, at: TextPlace, bytes: usize) -> ImportResult<()> {
        let (path, place) = (self.context.path(at.file), self.context.place(at));
        Ok(self.context.resources.budget().take(path, &place, bytes)?)
    }

    fn only_in_world(&self, at: TextPlace, word: &str) -> Result<(), TextFault> {
        if self.in_world { Ok(()) } else { Err(at.fault(format!("{word} belongs after WorldBegin"))) }
    }

    fn only_before_world(&self, at: TextPlace, word: &str) -> Result<(), TextFault> {
        if self.in_world { Err(at.fault(format!("{word} belongs before WorldBegin"))) } else { Ok(()) }
    }
}

impl Entity {
    /// Returns an entity without parameters, located at the start of the file.
    pub(super) fn plain(kind: &str) -> Self {
        Self {
            kind: kind.into(),
            params: Params::default(),
            at: TextPlace { file: 0, line: 1, column: 1 },
            ctm: DAffine3::IDENTITY,
            end_ctm: DAffine3::IDENTITY,
        }
    }
}

/// Makes the error for a file that ends within a directive.
pub(super) fn ended(at: TextPlace, word: &str) -> TextFault {
    at.fault(format!("the file ends within {word}"))
}

/// Reads the quoted text that follows a directive.
pub(super) fn text(tokens: &mut Tokens<'_>, at: TextPlace, word: &str) -> Result<(String, TextPlace), TextFault> {
    match tokens.next()? {
        Some((Token::Text(text), at)) => Ok((text.into_owned(), at)),
        Some((_, at)) => Err(at.fault(format!("{word} is followed by a name in quotes"))),
        None => Err(ended(at, word)),
    }
}

/// Returns the displacement of a mesh file; `None`: it has none.
fn displacement(params: &Params) -> ImportResult<Option<ShapeDisplacement>> {
    let Some((texture, at)) = params.texture("displacement")? else { return Ok(None) };
    let edge = params.float("edgelength")?.unwrap_or(1.0);
    if !(edge > 0.0 && edge.is_finite()) {
        return Err(params.place_of("edgelength").fault("the length of an edge is above 0").into());
    }
    Ok(Some(ShapeDisplacement { texture: texture.into(), at, edge }))
}
