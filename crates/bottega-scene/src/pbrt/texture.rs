//! Textures: a small tree for each, reduced to factor × picture where that is exact, otherwise baked to a picture.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::{Affine2, DVec3, Vec2};

use super::bake::{BakedTexture, scalar_image};
use super::color::Color;
use super::context::Context;
use super::mapping::{Mappings, within_frame};
use super::needless::Directive;
use super::params::Params;
use super::ramp::{RampKind, RampNode};
use super::texture_tree::{PictureNode, TextureNode, constant, only_ramp, parts, without_ramps};
use super::world::{Entity, PbrtWorld};
use crate::color::Spectrum;
use crate::error::SceneError;
use crate::image::Image;
use crate::image::pictures::{FramedTexture, PictureKind, PictureUse, Pictures};
use crate::image::pyramid::Encoding;
use crate::import::projector::projection_image;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::noise::{Noise, OCTAVES_MAX, Octaves};
use crate::param::{ColorParam, ScalarParam};
use crate::spectrum::color_space::ColorSpace;
use crate::spectrum::role::ColorRole;
use crate::text::shortened;
use crate::texture::{Channel, ImageId, Mapping, MappingKind, TextureMap, Wrap};

/// Trees with more nodes are replaced.
const PARTS_MAX: usize = 64;

/// Share of the plane within dots: of radius 0.35, in half of the cells.
const DOTS_MEAN: f64 = 0.19;

/// Returns the octaves of noise.
fn octaves(params: &Params) -> ImportResult<Octaves> {
    let count = params.integer("octaves")?.unwrap_or(8).clamp(0, i64::from(OCTAVES_MAX)) as u32;
    let roughness = params.float("roughness")?.unwrap_or(0.5) as f32;
    Ok(Octaves { count, roughness })
}

/// The source of an image of the scene.
enum Slot {
    Picture(ImageId),
    /// A picture with one number per texel.
    Scalar(ImageId),
    Baked(BakedTexture),
    /// A projected picture, with the angle of its shorter side in degrees.
    Projection(ImageId, f64),
}

/// The textures that materials use.
pub(super) struct PbrtTextures<'a, 'w> {
    world: &'w PbrtWorld,
    pictures: Pictures<'a>,
    mappings: Mappings,
    /// One slot for each image of the scene.
    slots: Vec<Slot>,
    slot_of: BTreeMap<(ImageId, bool), ImageId>,
    /// Trees by name and type; `true`: of type float.
    nodes: BTreeMap<(String, bool), Rc<TextureNode>>,
    /// Names being resolved, to detect a texture that refers to itself.
    open: Vec<(String, bool)>,
}

impl<'a, 'w> PbrtTextures<'a, 'w> {
    /// Makes an empty collection.
    pub(super) fn new(world: &'w PbrtWorld, context: &Context<'a>) -> Self {
        let pictures = Pictures::new(context.resources, context.options);
        Self {
            world,
            pictures,
            mappings: Mappings::default(),
            slots: Vec::new(),
            slot_of: BTreeMap::new(),
            nodes: BTreeMap::new(),
            open: Vec::new(),
        }
    }

    /// Returns a colour parameter; `None` if it is not given.
    pub(super) fn color(
        &mut self,
        context: &mut Context<'_>,
        params: &Params,
        name: &str,
        role: ColorRole,
    ) -> ImportResult<Option<ColorParam>> {
        if let Some((texture, at)) = params.texture(name)? {
            let node = self.named(context, texture, false, at)?;
            return self.color_param(context, &node, at).map(Some);
        }
        let Some(color) = context.color(params, name)? else { return Ok(None) };
        let mut color = color.to_rec709(role);
        if role == ColorRole::Reflectance && color.max_element() > 1.0 {
            context
                .warn(params.place_of(name), format!("`{name}` reflects more light than arrives, and is clamped to 1"));
            color = color.min(Spectrum::ONE);
        }
        Ok(Some(color.into()))
    }

    /// Returns a number or float texture; `None` if it is not given.
    pub(super) fn scalar(
        &mut self,
        context: &mut Context<'_>,
        params: &Params,
        name: &str,
    ) -> ImportResult<Option<ScalarParam>> {
        if let Some((texture, at)) = params.texture(name)? {
            return self.named_scalar(context, texture, at).map(Some);
        }
        Ok(params.float(name)?.map(|number| (number as f32).into()))
    }

    /// Returns a float texture by name.
    pub(super) fn named_scalar(
        &mut self,
        context: &mut Context<'_>,
        name: &str,
        at: TextPlace,
    ) -> ImportResult<ScalarParam> {
        let node = self.named(context, name, true, at)?;
        let (factor, map) = self.reduce(context, &node, true, at)?;
        Ok(ScalarParam { factor: factor.x as f32, texture: map.map(|map| (map, Channel::R)) })
    }

    /// Returns a map of a picture file, upright.
    pub(super) fn picture(
        &mut self,
        context: &Context<'_>,
        file: &str,
        kind: PictureKind,
        at: TextPlace,
    ) -> ImportResult<TextureMap> {
        let picture = self.pictures.want(file, kind, &context.place(at))?;
        Ok(TextureMap::new(self.slot(picture, false)))
    }

    /// Requests a projected picture. Its intensity equals pbrt's, whose screens are not lit evenly as ours are.
    ///
    /// - `fov`: angle of the shorter side, in degrees.
    pub(super) fn projection(
        &mut self,
        context: &Context<'_>,
        file: &str,
        fov: f64,
        at: TextPlace,
    ) -> ImportResult<ImageId> {
        let picture = self.pictures.want(file, PictureKind::COLORS, &context.place(at))?;
        self.slots.push(Slot::Projection(picture, fov));
        Ok(ImageId(self.slots.len() as u32 - 1))
    }

    /// Returns the colour or texture of a parameter, transformed by `change`, such as from reflectance to k; `None`:
    /// the parameter is not given.
    pub(super) fn changed(
        &mut self,
        context: &mut Context<'_>,
        params: &Params,
        name: &str,
        change: fn(DVec3) -> DVec3,
    ) -> ImportResult<Option<ColorParam>> {
        let node = match params.texture(name)? {
            Some((texture, at)) => self.named(context, texture, false, at)?,
            None => match context.color(params, name)? {
                Some(color) => Rc::new(TextureNode::Constant(color.to_rec709(ColorRole::Reflectance).as_dvec3())),
                None => return Ok(None),
            },
        };
        let at = params.place_of(name);
        if let (factor, None) = self.reduce(context, &node, false, at)? {
            return Ok(Some(change(factor).as_vec3().into()));
        }
        let (_, map) = self.bake(context, &node, false, Some(change), at)?;
        Ok(Some(ColorParam { factor: Spectrum::ONE, texture: map }))
    }

    /// Decodes and bakes the pictures of the scene. Returns them and the mappings.
    pub(super) fn load(self, context: &mut Context<'_>) -> ImportResult<(Vec<Image>, Vec<Mapping>)> {
        let pictures = self.pictures.load(context.warnings())?;
        let mut uses = vec![0usize; pictures.len()];
        for slot in &self.slots {
            if let Slot::Picture(id) | Slot::Scalar(id) | Slot::Projection(id, _) = slot {
                uses[id.0 as usize] += 1;
            }
        }
        let baked: Vec<Option<Image>> = (self.slots.iter())
            .map(|slot| match slot {
                Slot::Baked(bake) => bake.image(context, &pictures).map(Some),
                _ => Ok(None),
            })
            .collect::<Result<_, SceneError>>()?;
        let mut pictures: Vec<Option<Image>> = pictures.into_iter().map(Some).collect();
        let mut take = |id: ImageId| {
            let index = id.0 as usize;
            uses[index] -= 1;
            if uses[index] == 0 { pictures[index].take() } else { pictures[index].clone() }
        };
        let image = |(slot, baked): (&Slot, Option<Image>)| match slot {
            Slot::Picture(id) => take(*id),
            Slot::Scalar(id) => take(*id).map(scalar_image),
            Slot::Projection(id, fov) => take(*id).map(|image| projection_image(&image, *fov)),
            Slot::Baked(_) => baked,
        };
        // Every slot has a picture: they were counted above.
        let images = self.slots.iter().zip(baked).map(image);
        let images = images.map(|image| image.unwrap_or_else(|| Image::missing(""))).collect();
        Ok((images, self.mappings.into_inner()))
    }

    fn slot(&mut self, picture: ImageId, is_scalar: bool) -> ImageId {
        let Self { slots, slot_of, .. } = self;
        *slot_of.entry((picture, is_scalar)).or_insert_with(|| {
            slots.push(if is_scalar { Slot::Scalar(picture) } else { Slot::Picture(picture) });
            ImageId(slots.len() as u32 - 1)
        })
    }

    fn color_param(
        &mut self,
        context: &mut Context<'_>,
        node: &Rc<TextureNode>,
        at: TextPlace,
    ) -> ImportResult<ColorParam> {
        let (factor, texture) = self.reduce(context, node, false, at)?;
        Ok(ColorParam { factor: factor.as_vec3(), texture })
    }

    /// Reduces a tree to a factor and a map.
    fn reduce(
        &mut self,
        context: &mut Context<'_>,
        node: &Rc<TextureNode>,
        is_scalar: bool,
        at: TextPlace,
    ) -> ImportResult<(DVec3, Option<TextureMap>)> {
        match &**node {
            TextureNode::Constant(value) => Ok((*value, None)),
            TextureNode::Picture(node) if !node.invert && node.gamma.is_none() => {
                let map = TextureMap {
                    image: self.slot(node.picture, is_scalar),
                    uv_set: node.mapping.uv_set,
                    picture_from_uv: node.mapping.picture_from_uv,
                    wrap_u: node.wrap,
                    wrap_v: node.wrap,
                    smooth: node.smooth,
                };
                Ok((DVec3::splat(node.scale), Some(map)))
            }
            TextureNode::Scale(a, b) => match (constant(a), constant(b)) {
                (Some(factor), _) => self.reduce(context, b, is_scalar, at).map(|(inner, map)| (inner * factor, map)),
                (_, Some(factor)) => self.reduce(context, a, is_scalar, at).map(|(inner, map)| (inner * factor, map)),
                _ => self.bake(context, node, is_scalar, None, at),
            },
            _ => match constant(node) {
                Some(value) => Ok((value, None)),
                None => self.bake(context, node, is_scalar, None, at),
            },
        }
    }

    fn bake(
        &mut self,
        context: &mut Context<'_>,
        node: &Rc<TextureNode>,
        is_scalar: bool,
        change: Option<fn(DVec3) -> DVec3>,
        at: TextPlace,
    ) -> ImportResult<(DVec3, Option<TextureMap>)> {
        // A picture and a function of the position have no common coordinates
        let flat = if only_ramp(node).is_some() { None } else { without_ramps(node) };
        if let Some(flat) = flat {
            let message =
                "noise, dots or slopes within this texture are joined with other textures; their mean replaces them";
            context.unsupported(at, message);
            return match constant(&flat) {
                Some(value) => Ok((change.map_or(value, |change| change(value)), None)),
                None => self.bake(context, &flat, is_scalar, change, at),
            };
        }
        let bake = BakedTexture::new(node.clone(), is_scalar, change, at);
        let sets = bake.uv_sets();
        if sets.len() > 1 {
            context.unsupported(at, "parts of this texture are laid by different mappings; all are laid by the first");
        }
        let uv_set = sets.first().copied().unwrap_or(0);
        // Spherical coordinates stay within [0, 1].
        let is_cut = !bake.repeats() && self.mappings.kind(uv_set) != Some(MappingKind::Spherical);
        if is_cut {
            context
                .unsupported(at, "parts of this texture repeat at rates without a common period; it is cut at [0, 1]");
        }
        let image = ImageId(self.slots.len() as u32);
        let map = TextureMap {
            image,
            uv_set,
            picture_from_uv: bake.picture_from_uv(),
            wrap_u: bake.wrap(),
            wrap_v: bake.wrap(),
            smooth: bake.is_smooth(),
        };
        self.slots.push(Slot::Baked(bake));
        Ok((DVec3::ONE, Some(map)))
    }

    /// Returns the tree of a named texture.
    fn named(
        &mut self,
        context: &mut Context<'_>,
        name: &str,
        is_float: bool,
        at: TextPlace,
    ) -> ImportResult<Rc<TextureNode>> {
        let key = (name.to_owned(), is_float);
        if let Some(node) = self.nodes.get(&key) {
            return Ok(node.clone());
        }
        let world = self.world;
        let textures = if is_float { &world.float_textures } else { &world.spectrum_textures };
        let kind = if is_float { "float" } else { "spectrum" };
        let Some(entity) = textures.get(name) else {
            return Err(at.fault(format!("there is no {kind} texture \"{}\"", shortened(name))).into());
        };
        if self.open.contains(&key) || self.open.len() >= PARTS_MAX {
            return Err(at.fault(format!("the texture \"{}\" refers to itself", shortened(name))).into());
        }
        self.open.push(key.clone());
        let mut node = self.node(context, entity, is_float)?;
        self.open.pop();
        if parts(&node) > PARTS_MAX {
            context.unsupported(entity.at, format!("the texture has more than {PARTS_MAX} parts; gray replaces it"));
            node = TextureNode::Constant(DVec3::splat(0.5));
        }
        context.report_unused(Directive::Texture, &entity.kind, &entity.params);
        let node = Rc::new(node);
        self.nodes.insert(key, node.clone());
        Ok(node)
    }

    fn node(&mut self, context: &mut Context<'_>, entity: &Entity, is_float: bool) -> ImportResult<TextureNode> {
        let (params, at) = (&entity.params, entity.at);
        Ok(match entity.kind.as_str() {
            "constant" => TextureNode::Constant(match is_float {
                true => DVec3::splat(params.float("value")?.unwrap_or(1.0)),
                false => self.constant_color(context, params, "value", 1.0)?,
            }),
            "imagemap" => self.picture_node(context, entity, is_float)?,
            "scale" => {
                let tex = self.part(context, params, "tex", 1.0, is_float)?;
                let scale = self.part(context, params, "scale", 1.0, true)?;
                TextureNode::Scale(tex, scale)
            }
            "mix" => {
                let first = self.part(context, params, "tex1", 0.0, is_float)?;
                let second = self.part(context, params, "tex2", 1.0, is_float)?;
                TextureNode::Mix(first, second, self.part(context, params, "amount", 0.5, true)?)
            }
            "directionmix" => {
                let first = self.part(context, params, "tex1", 0.0, is_float)?;
                let second = self.part(context, params, "tex2", 1.0, is_float)?;
                let direction = params.point3("dir", "vector3")?.unwrap_or(DVec3::Y);
                let mapping = self.mappings.of_direction(context, entity, direction)?;
                let amount = RampNode { mapping, kind: RampKind::Line, range: [0.0, 1.0], mean: 0.5 };
                TextureNode::Mix(second, first, Rc::new(TextureNode::Ramp(amount)))
            }
            "checkerboard" => {
                let first = self.part(context, params, "tex1", 1.0, is_float)?;
                let second = self.part(context, params, "tex2", 0.0, is_float)?;
                let mapping = match params.integer("dimension")?.unwrap_or(2) {
                    2 => self.mappings.of_texture(context, entity)?,
                    3 => self.mappings.cells(context, entity)?,
                    _ => return Err(params.place_of("dimension").fault("a checkerboard has 2 or 3 dimensions").into()),
                };
                TextureNode::Checkerboard(mapping, first, second)
            }
            "bilerp" => {
                let mut values = [DVec3::ZERO; 4];
                for (value, (name, default)) in
                    values.iter_mut().zip([("v00", 0.0), ("v01", 1.0), ("v10", 0.0), ("v11", 1.0)])
                {
                    *value = match is_float {
                        true => DVec3::splat(params.float(name)?.unwrap_or(default)),
                        false => self.constant_color(context, params, name, default)?,
                    };
                }
                TextureNode::Bilinear(self.mappings.of_texture(context, entity)?, values)
            }
            "dots" => {
                let inside = self.part(context, params, "inside", 1.0, is_float)?;
                let outside = self.part(context, params, "outside", 0.0, is_float)?;
                let amount = match self.mappings.of_dots(context, entity)? {
                    Some(mapping) => {
                        let (kind, range) = (RampKind::Step, [0.0, 1.0]);
                        TextureNode::Ramp(RampNode { mapping, kind, range, mean: DOTS_MEAN })
                    }
                    None => {
                        let message = "dots on a sphere or a cylinder are replaced by the mean of inside and outside";
                        context.unsupported(at, message);
                        TextureNode::Constant(DVec3::splat(DOTS_MEAN))
                    }
                };
                TextureNode::Mix(outside, inside, Rc::new(amount))
            }
            // pbrt-v4 has these as numbers alone, pbrt-v3 also as colors
            "fbm" | "wrinkled" | "windy" => TextureNode::Ramp(self.noise_node(context, entity)?),
            "marble" if !is_float => TextureNode::Ramp(self.marble_node(context, entity)?),
            kind => {
                params.mark_reported(&["octaves", "roughness", "scale", "variation", "filename", "encoding"]);
                context.unsupported(at, format!("the texture \"{}\" is replaced by gray", shortened(kind)));
                TextureNode::Constant(DVec3::splat(0.5))
            }
        })
    }

    /// Returns an input of a texture: another texture, a colour or a number.
    fn part(
        &mut self,
        context: &mut Context<'_>,
        params: &Params,
        name: &str,
        default: f64,
        is_float: bool,
    ) -> ImportResult<Rc<TextureNode>> {
        if let Some((texture, at)) = params.texture(name)? {
            return self.named(context, texture, is_float, at);
        }
        Ok(Rc::new(TextureNode::Constant(match is_float {
            true => DVec3::splat(params.float(name)?.unwrap_or(default)),
            false => self.constant_color(context, params, name, default)?,
        })))
    }

    fn constant_color(
        &mut self,
        context: &mut Context<'_>,
        params: &Params,
        name: &str,
        default: f64,
    ) -> ImportResult<DVec3> {
        let color = context.color(params, name)?.unwrap_or(Color::Rgb(DVec3::splat(default), ColorSpace::Srgb));
        Ok(color.to_rec709(ColorRole::Reflectance).as_dvec3())
    }

    fn noise_node(&mut self, context: &mut Context<'_>, entity: &Entity) -> ImportResult<RampNode> {
        let noise = match entity.kind.as_str() {
            "fbm" => Noise::Fbm(octaves(&entity.params)?),
            "wrinkled" => Noise::Turbulence(octaves(&entity.params)?),
            _ => Noise::Waves,
        };
        let mapping = self.mappings.of_position(context, entity, MappingKind::Noise(noise), 1.0)?;
        let mean = if let Noise::Turbulence(_) = noise { 0.5 } else { 0.0 };
        Ok(RampNode { mapping, kind: RampKind::Line, range: noise.range(), mean })
    }

    fn marble_node(&mut self, context: &mut Context<'_>, entity: &Entity) -> ImportResult<RampNode> {
        let params = &entity.params;
        let variation = params.float("variation")?.unwrap_or(0.2) as f32;
        let veins = MappingKind::Veins { octaves: octaves(params)?, variation };
        let scale = params.float("scale")?.unwrap_or(1.0);
        let mapping = self.mappings.of_position(context, entity, veins, scale)?;
        Ok(RampNode { mapping, kind: RampKind::Marble, range: [0.0, 1.0], mean: 0.8 })
    }

    fn picture_node(
        &mut self,
        context: &mut Context<'_>,
        entity: &Entity,
        is_scalar: bool,
    ) -> ImportResult<TextureNode> {
        let params = &entity.params;
        let file = params.text("filename")?.ok_or_else(|| entity.at.fault("`imagemap` needs a `filename`"))?;
        let at = params.place_of("filename");
        let encoding = params.text("encoding")?.unwrap_or("sRGB");
        let exponent = encoding.strip_prefix("gamma").map(|rest| rest.trim().parse::<f64>());
        let (encoding, gamma) = match (encoding, exponent) {
            ("sRGB" | "srgb", _) => (Encoding::Srgb, None),
            ("linear", _) => (Encoding::Linear, None),
            (_, Some(Ok(exponent))) if exponent > 0.0 && exponent < 100.0 => (Encoding::Linear, Some(exponent)),
            _ => {
                let problem = format!("the encoding \"{}\" is not sRGB, linear or gamma N", shortened(encoding));
                return Err(params.place_of("encoding").fault(problem).into());
            }
        };
        let purpose = if is_scalar { PictureUse::Number } else { PictureUse::Color };
        let kind = PictureKind { encoding, purpose };
        let place = context.place(at);
        let wrap = params.text("wrap")?.unwrap_or("repeat");
        let framed = if wrap == "black" { self.pictures.want_framed(file, kind, &place)? } else { None };
        let mut mapping = self.mappings.of_texture(context, entity)?;
        let picture = match framed {
            Some(FramedTexture { id: picture, size }) => {
                mapping.picture_from_uv = within_frame(size) * mapping.picture_from_uv;
                picture
            }
            None if wrap == "octahedralsphere" => {
                // Scale to a quarter of the period. At the left and upper edge pbrt continues with the second texel, at
                // the others with the last; here all edges are as the latter.
                mapping.picture_from_uv = Affine2::from_scale(Vec2::splat(0.5)) * mapping.picture_from_uv;
                self.pictures.want_octahedral(file, kind, &place)?
            }
            None => self.pictures.want(file, kind, &place)?,
        };
        let wrap = match wrap {
            "repeat" | "octahedralsphere" => Wrap::Repeat,
            // A picture with a black border continues black when clamped.
            "clamp" | "black" => Wrap::Clamp,
            other => {
                let message = format!("the wrap mode \"{}\" is replaced by \"clamp\"", shortened(other));
                context.unsupported(params.place_of("wrap"), message);
                Wrap::Clamp
            }
        };
        let smooth = params.text("filter")?.is_none_or(|filter| filter != "point");
        Ok(TextureNode::Picture(PictureNode {
            picture,
            is_scalar,
            mapping,
            wrap,
            smooth,
            scale: params.float("scale")?.unwrap_or(1.0),
            invert: params.bool("invert")?.unwrap_or(false),
            gamma,
        }))
    }
}
