//! Colours and numbers of objects: constants, picture files, and patterns converted to pictures.

use glam::{Affine2, DMat4, DVec2, DVec3, Vec2, Vec3};

use super::attribute::{self, AwaitedTexture, MeshData};
use super::color::{in_range, plugin_color, property_color};
use super::context::ImportContext;
use super::document::{Object, ObjectId};
use super::value::Value;
use crate::color::{Spectrum, luminance};
use crate::image::Image;
use crate::image::pictures::{PictureKind, PictureUse, Pictures};
use crate::image::pyramid::Encoding;
use crate::import::text_place::ImportResult;
use crate::param::{ColorParam, ScalarParam};
use crate::spectrum::role::ColorRole;
use crate::text::shortened;
use crate::texture::{Channel, ImageId, TextureMap, Wrap};

/// The use of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TextureUse {
    /// The main reflectance of a surface, which mesh colours multiply.
    Base,
    Color(ColorRole),
    /// A number: the texture's luminance.
    Number,
    /// A vector, unconverted: a normal map.
    Vector,
}

/// A factor, and a picture that it multiplies.
#[derive(Clone, Debug)]
pub(super) struct Texture {
    pub(super) factor: Spectrum,
    /// Map of the picture, and the channel if the file names one.
    pub(super) map: Option<(TextureMap, Option<Channel>)>,
}

impl From<Spectrum> for Texture {
    fn from(factor: Spectrum) -> Self {
        Self { factor, map: None }
    }
}

/// The textures of a scene.
pub(super) struct MitsubaTextures<'a> {
    pub(super) pictures: Pictures<'a>,
    /// `true`: the current bsdf is one of several of its material.
    pub(super) is_blended: bool,
    /// Data of its meshes that textures of the current material use.
    pub(super) mesh_data: MeshData,
}

impl<'a> MitsubaTextures<'a> {
    /// Makes an empty collection.
    pub(super) fn new(pictures: Pictures<'a>) -> Self {
        Self { pictures, is_blended: false, mesh_data: MeshData::default() }
    }

    /// Returns a colour or colour texture.
    pub(super) fn color(
        &mut self,
        context: &mut ImportContext<'_>,
        object: &Object,
        name: &str,
        role: ColorRole,
        default: Spectrum,
    ) -> ImportResult<ColorParam> {
        if let Some(property) = object.property(name) {
            return Ok(property_color(context, property, role)?.into());
        }
        let Some(child) = object.child(name) else { return Ok(default.into()) };
        // Mesh colours multiply only the main reflectance of a surface.
        let is_base = matches!(name, "reflectance" | "diffuse_reflectance" | "base_color");
        let wanted = if is_base { TextureUse::Base } else { TextureUse::Color(role) };
        let texture = self.texture(context, child.object, wanted)?;
        let factor = in_range(context, texture.factor, role, child.at);
        Ok(ColorParam { factor, texture: texture.map.map(|(map, _)| map) })
    }

    /// Returns a colour that cannot be a texture; the factor of a texture is used, with a warning.
    pub(super) fn plain_color(
        &mut self,
        context: &mut ImportContext<'_>,
        object: &Object,
        name: &str,
        role: ColorRole,
        default: Spectrum,
    ) -> ImportResult<Spectrum> {
        let color = self.color(context, object, name, role, default)?;
        if color.texture.is_some()
            && let Some(child) = object.child(name)
        {
            context.warn(child.at, format!("`{name}` cannot be a texture here; 0.5 replaces it"));
            return Ok(color.factor * 0.5);
        }
        Ok(color.factor)
    }

    /// Returns a number or number texture.
    pub(super) fn scalar(
        &mut self,
        context: &mut ImportContext<'_>,
        object: &Object,
        name: &str,
        default: f64,
    ) -> ImportResult<ScalarParam> {
        if let Some(property) = object.property(name) {
            let number = match property.value {
                Value::Float(number) => number,
                Value::Integer(number) => number as f64,
                _ => f64::from(luminance(property_color(context, property, ColorRole::Unbounded)?)),
            };
            if number < 0.0 {
                context.warn(property.at, format!("`{name}` is below 0; 0 replaces it"));
            }
            return Ok((number.max(0.0) as f32).into());
        }
        let Some(child) = object.child(name) else { return Ok((default as f32).into()) };
        let texture = self.texture(context, child.object, TextureUse::Number)?;
        let factor = in_range(context, texture.factor, ColorRole::Unbounded, child.at);
        Ok(ScalarParam {
            factor: luminance(factor),
            texture: texture.map.map(|(map, channel)| (map, channel.unwrap_or(Channel::R))),
        })
    }

    /// Converts a texture or spectrum.
    pub(super) fn texture(
        &mut self,
        context: &mut ImportContext<'_>,
        id: ObjectId,
        wanted: TextureUse,
    ) -> ImportResult<Texture> {
        let object = context.visit(id)?;
        let role = match wanted {
            TextureUse::Base => ColorRole::Reflectance,
            TextureUse::Color(role) => role,
            TextureUse::Number | TextureUse::Vector => ColorRole::Unbounded,
        };
        if let Some(color) = plugin_color(context, object, role)? {
            return Ok(color.into());
        }
        match object.plugin.as_str() {
            "bitmap" => self.bitmap(context, object, wanted),
            "checkerboard" => self.checkerboard(context, object, wanted, role),
            "d65" => Ok(match object.float("scale")? {
                Some(scale) => Spectrum::splat(scale as f32),
                None => self.color(context, object, "color", role, Vec3::ONE)?.factor,
            }
            .into()),
            "rgb" | "srgb" => Ok(self.color(context, object, "color", role, Vec3::splat(0.5))?.factor.into()),
            "scale" => {
                let scale = object.float("scale")?.unwrap_or(1.0) as f32;
                let Some(inner) = object.children.first() else {
                    return Err(object.at.fault("there is nothing to scale").into());
                };
                inner.used.set(true);
                let texture = self.texture(context, inner.object, wanted)?;
                Ok(Texture { factor: texture.factor * scale, ..texture })
            }
            "mesh_attribute" | "vertexcolors" => {
                let name = object.string("name")?.unwrap_or("vertex_color");
                let scale = object.float("scale")?.unwrap_or(1.0) as f32;
                if matches!(name, "vertex_color" | "face_color") && wanted == TextureUse::Base && !self.is_blended {
                    self.mesh_data.vertex_colors |= name == "vertex_color";
                    self.mesh_data.face_colors |= name == "face_color";
                    return Ok(Spectrum::splat(scale).into());
                }
                let image = self.pictures.add(attribute::placeholder(name));
                let is_number = wanted == TextureUse::Number;
                self.mesh_data.textures.push(AwaitedTexture { name: name.into(), image, is_number });
                let map = attribute::map(name, image);
                Ok(Texture { factor: Spectrum::splat(scale), map: Some((map, Some(Channel::R))) })
            }
            _ => {
                object.accept_all();
                let message = format!("the {} is not supported; 0.5 replaces it", object.describe());
                context.warn(object.at, message);
                Ok(Spectrum::splat(0.5).into())
            }
        }
    }

    fn bitmap(
        &mut self,
        context: &mut ImportContext<'_>,
        object: &Object,
        wanted: TextureUse,
    ) -> ImportResult<Texture> {
        let location = context.filename(object)?;
        let raw = object.boolean("raw", wanted == TextureUse::Vector)?;
        // In Mitsuba 0.x, 1 is linear and −1 follows the file.
        let gamma = object.float("gamma")?;
        let encoding = if raw || gamma == Some(1.0) { Encoding::Linear } else { Encoding::Srgb };
        let channel = match object.string("channel")? {
            None => None,
            Some("r" | "x") => Some(Channel::R),
            Some("g" | "y") => Some(Channel::G),
            Some("b" | "z") => Some(Channel::B),
            Some("a") => Some(Channel::A),
            Some(other) => {
                context.warn(object.at, format!("there is no channel `{}`", shortened(other)));
                None
            }
        };
        if channel.is_some() && wanted != TextureUse::Number {
            context.warn(object.at, "the colours of all channels are shown, and not that of `channel`");
        }
        if gamma.is_some_and(|gamma| gamma != 1.0 && gamma != -1.0) {
            context.warn(object.at, "the codes of a picture are linear or sRGB: sRGB replaces another `gamma`");
        }
        let gray = wanted == TextureUse::Number && channel.is_none();
        let place = context.place(object.at);
        let purpose = match wanted {
            TextureUse::Base | TextureUse::Color(_) => PictureUse::Color,
            TextureUse::Number => PictureUse::Number,
            TextureUse::Vector => PictureUse::Normals,
        };
        let image = self.pictures.want_at(location, PictureKind { encoding, purpose }, gray, &place);
        let map = map(context, object, image)?;
        Ok(Texture { factor: Spectrum::ONE, map: Some((map, channel)) })
    }

    /// Converts a checkerboard of two colours, as a 2 × 2 picture. Mitsuba 3 swaps the colours if it is used as a
    /// number (its `eval_1`); so do we.
    fn checkerboard(
        &mut self,
        context: &mut ImportContext<'_>,
        object: &Object,
        wanted: TextureUse,
        role: ColorRole,
    ) -> ImportResult<Texture> {
        let mut first = self.plain_color(context, object, "color0", role, Vec3::splat(0.4))?;
        let mut second = self.plain_color(context, object, "color1", role, Vec3::splat(0.2))?;
        if wanted == TextureUse::Number {
            (first, second) = (Spectrum::splat(luminance(first)), Spectrum::splat(luminance(second)));
            if !context.document.is_old {
                std::mem::swap(&mut first, &mut second);
            }
        }
        let (a, b) = (first.to_array(), second.to_array());
        let image = self.pictures.add(Image::from_linear_rgb("checkerboard", 2, 2, vec![a, b, b, a]));
        let map = TextureMap { smooth: false, ..map(context, object, image)? };
        Ok(Texture { factor: Spectrum::ONE, map: Some((map, None)) })
    }
}

/// Returns the mapping of a picture. Mitsuba's v is 0 in the upper row, as ours.
fn map(context: &mut ImportContext<'_>, object: &Object, image: ImageId) -> ImportResult<TextureMap> {
    let mut wraps = [Wrap::Repeat; 2];
    for (name, axes) in [("wrap_mode", 0..2), ("wrap_mode_u", 0..1), ("wrap_mode_v", 1..2)] {
        let Some(mode) = object.string(name)? else { continue };
        let wrap = match mode {
            "repeat" => Wrap::Repeat,
            "mirror" => Wrap::Mirror,
            "clamp" => Wrap::Clamp,
            other => {
                let message = format!("`{name}` cannot be `{}`; `clamp` replaces it", shortened(other));
                context.warn(object.at, message);
                Wrap::Clamp
            }
        };
        wraps[axes].fill(wrap);
    }
    let filter = object.string("filter_type")?;
    let matrix = object.transform("to_uv")?;
    let mut picture_from_uv = affine2(&matrix);
    let mut old = [1.0, 1.0, 0.0, 0.0];
    for (slot, name) in ["uscale", "vscale", "uoffset", "voffset"].iter().enumerate() {
        if let Some(number) = object.float(name)? {
            old[slot] = number as f32;
        }
    }
    let [us, vs, uo, vo] = old;
    picture_from_uv = Affine2 { matrix2: glam::Mat2::from_diagonal(Vec2::new(us, vs)), translation: Vec2::new(uo, vo) }
        * picture_from_uv;
    if !picture_from_uv.is_finite() {
        return Err(object.at.fault("the transformation of the texture is not finite").into());
    }
    Ok(TextureMap {
        picture_from_uv,
        wrap_u: wraps[0],
        wrap_v: wraps[1],
        smooth: filter != Some("nearest"),
        ..TextureMap::new(image)
    })
}

/// Returns the effect of a 3D transformation on the plane z = 0.
fn affine2(matrix: &DMat4) -> Affine2 {
    let at = |x: f64, y: f64| matrix.project_point3(DVec3::new(x, y, 0.0)).truncate();
    let origin = at(0.0, 0.0);
    let column = |v: DVec2| (v - origin).as_vec2();
    Affine2::from_cols(column(at(1.0, 0.0)), column(at(0.0, 1.0)), origin.as_vec2())
}
