//! Textures: picture files, and patterns converted to pictures.

use glam::{Affine2, DMat4, DVec2, DVec3, Vec2, Vec3};

use super::color::{ColorRole, TextureUse, luminance};
use super::document::{Object, ObjectId};
use super::importer::Importer;
use crate::image::{Encoding, PictureKind, PictureUse};
use crate::text::shortened;
use crate::{Channel, Image, SceneError, Spectrum, TextureMap, Wrap};

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

impl Importer<'_> {
    /// Converts a texture or spectrum.
    pub(super) fn texture(&mut self, id: ObjectId, wanted: TextureUse) -> Result<Texture, SceneError> {
        let object = self.visit(id)?;
        let role = match wanted {
            TextureUse::Base => ColorRole::Reflectance,
            TextureUse::Color(role) => role,
            TextureUse::Number | TextureUse::Vector => ColorRole::Unbounded,
        };
        if let Some(color) = self.spectrum_plugin(id, role)? {
            return Ok(color.into());
        }
        match object.plugin.as_str() {
            "bitmap" => self.bitmap(object, wanted),
            "checkerboard" => self.checkerboard(object, wanted, role),
            "scale" => {
                let scale = self.bad(object.float("scale"))?.unwrap_or(1.0) as f32;
                let Some(inner) = object.children.first() else {
                    return Err(self.report.invalid(object.at, "there is nothing to scale"));
                };
                inner.used.set(true);
                let texture = self.texture(inner.object, wanted)?;
                Ok(Texture { factor: texture.factor * scale, ..texture })
            }
            "mesh_attribute" | "vertexcolors" => {
                let name = self.bad(object.string("name"))?.unwrap_or("vertex_color");
                let scale = self.bad(object.float("scale"))?.unwrap_or(1.0) as f32;
                if matches!(name, "vertex_color" | "face_color") && wanted == TextureUse::Base && !self.is_blended {
                    self.wants_vertex_colors |= name == "vertex_color";
                    self.wants_face_colors |= name == "face_color";
                    return Ok(Spectrum::splat(scale).into());
                }
                let texture = self.await_attribute(name, wanted == TextureUse::Number, scale);
                Ok(texture)
            }
            _ => {
                object.properties.iter().for_each(|property| property.used.set(true));
                object.children.iter().for_each(|child| child.used.set(true));
                let message = format!("the {} is not supported; 0.5 stands for it", object.describe());
                self.report.warn(object.at, message);
                Ok(Spectrum::splat(0.5).into())
            }
        }
    }

    fn bitmap(&mut self, object: &Object, wanted: TextureUse) -> Result<Texture, SceneError> {
        let location = self.filename(object)?;
        let raw = self.bad(object.boolean("raw", wanted == TextureUse::Vector))?;
        // In Mitsuba 0.x, 1 is linear and −1 follows the file.
        let gamma = self.bad(object.float("gamma"))?;
        let encoding = if raw || gamma == Some(1.0) { Encoding::Linear } else { Encoding::Srgb };
        let channel = match self.bad(object.string("channel"))? {
            None => None,
            Some("r" | "x") => Some(Channel::R),
            Some("g" | "y") => Some(Channel::G),
            Some("b" | "z") => Some(Channel::B),
            Some("a") => Some(Channel::A),
            Some(other) => {
                self.report.warn(object.at, format!("there is no channel `{}`", shortened(other)));
                None
            }
        };
        if channel.is_some() && wanted != TextureUse::Number {
            self.report.warn(object.at, "the colours of all channels are shown, and not that of `channel`");
        }
        if gamma.is_some_and(|gamma| gamma != 1.0 && gamma != -1.0) {
            self.report.warn(object.at, "the codes of a picture are linear or sRGB: sRGB stands for another `gamma`");
        }
        let gray = wanted == TextureUse::Number && channel.is_none();
        let place = self.report.show(object.at);
        let purpose = match wanted {
            TextureUse::Base | TextureUse::Color(_) => PictureUse::Color,
            TextureUse::Number => PictureUse::Number,
            TextureUse::Vector => PictureUse::Normals,
        };
        let image = self.pictures.want_at(location, PictureKind { encoding, purpose }, gray, &place);
        let map = self.map(object, image)?;
        Ok(Texture { factor: Spectrum::ONE, map: Some((map, channel)) })
    }

    /// Converts a checkerboard of two colours, as a 2 × 2 picture. Mitsuba 3 swaps the colours if it is used as a
    /// number (its `eval_1`); so do we.
    fn checkerboard(&mut self, object: &Object, wanted: TextureUse, role: ColorRole) -> Result<Texture, SceneError> {
        let mut first = self.plain_color(object, "color0", role, Vec3::splat(0.4))?;
        let mut second = self.plain_color(object, "color1", role, Vec3::splat(0.2))?;
        if wanted == TextureUse::Number {
            (first, second) = (Spectrum::splat(luminance(first)), Spectrum::splat(luminance(second)));
            if !self.document.is_old {
                std::mem::swap(&mut first, &mut second);
            }
        }
        let (a, b) = (first.to_array(), second.to_array());
        let image = self.pictures.add(Image::from_linear_rgb("checkerboard", 2, 2, vec![a, b, b, a]));
        let map = TextureMap { smooth: false, ..self.map(object, image)? };
        Ok(Texture { factor: Spectrum::ONE, map: Some((map, None)) })
    }

    /// Returns the mapping of a picture. Mitsuba's v is 0 in the upper row, as ours.
    fn map(&mut self, object: &Object, image: crate::ImageId) -> Result<TextureMap, SceneError> {
        let mut wraps = [Wrap::Repeat; 2];
        for (name, axes) in [("wrap_mode", 0..2), ("wrap_mode_u", 0..1), ("wrap_mode_v", 1..2)] {
            let Some(mode) = self.bad(object.string(name))? else { continue };
            let wrap = match mode {
                "repeat" => Wrap::Repeat,
                "mirror" => Wrap::Mirror,
                "clamp" => Wrap::Clamp,
                other => {
                    let message = format!("`{name}` cannot be `{}`; `clamp` stands for it", shortened(other));
                    self.report.warn(object.at, message);
                    Wrap::Clamp
                }
            };
            wraps[axes].fill(wrap);
        }
        let filter = self.bad(object.string("filter_type"))?;
        let matrix = self.bad(object.transform("to_uv"))?;
        let mut picture_from_uv = affine2(&matrix);
        let mut old = [1.0, 1.0, 0.0, 0.0];
        for (slot, name) in ["uscale", "vscale", "uoffset", "voffset"].iter().enumerate() {
            if let Some(number) = self.bad(object.float(name))? {
                old[slot] = number as f32;
            }
        }
        let [us, vs, uo, vo] = old;
        picture_from_uv =
            Affine2 { matrix2: glam::Mat2::from_diagonal(Vec2::new(us, vs)), translation: Vec2::new(uo, vo) }
                * picture_from_uv;
        if !picture_from_uv.is_finite() {
            return Err(self.report.invalid(object.at, "the transformation of the texture is not finite"));
        }
        Ok(TextureMap {
            picture_from_uv,
            wrap_u: wraps[0],
            wrap_v: wraps[1],
            smooth: filter != Some("nearest"),
            ..TextureMap::new(image)
        })
    }
}

/// Returns the effect of a 3D transformation on the plane z = 0.
fn affine2(matrix: &DMat4) -> Affine2 {
    let at = |x: f64, y: f64| matrix.project_point3(DVec3::new(x, y, 0.0)).truncate();
    let origin = at(0.0, 0.0);
    let column = |v: DVec2| (v - origin).as_vec2();
    Affine2::from_cols(column(at(1.0, 0.0)), column(at(0.0, 1.0)), origin.as_vec2())
}
