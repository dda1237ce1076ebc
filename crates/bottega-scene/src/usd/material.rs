//! Materials: UsdPreviewSurface with its textures, and display colours where no material is bound.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::{Affine2, DVec3, Mat2, Vec2, Vec3};
use openusd::sdf::{Path, Value};
use openusd::usd::Prim;

use super::source::StageSource;
use super::texture::{SourceSpace, StandIn, TexelChange, Textures, WantedTexture};
use super::values;
use crate::displacement::{Displacement, DisplacementSpace};
use crate::error::SceneError;
use crate::image::Image;
use crate::material::{AlphaMode, Material, Relief};
use crate::param::{ColorParam, ScalarParam};
use crate::surface::Layered;
use crate::text::shortened;
use crate::texture::{Channel, TextureMap, Wrap};
use crate::values::FACTOR_MAX;

/// Most connections from an input to the value or shader that it takes.
const DEPTH_MAX: u32 = 32;

/// A material of the scene, and what it needs of a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Look {
    /// Index of the material.
    pub(super) material: u32,
    /// Names of the primvars that are its sets of texture coordinates.
    pub(super) uv_sets: Vec<String>,
    /// Name of the primvar that multiplies the base colour.
    pub(super) color: Option<String>,
    /// Name of the primvar that multiplies opacity.
    pub(super) opacity: Option<String>,
}

/// The materials of a stage, made when they are first needed.
pub(super) struct Materials<'s, 'a> {
    source: &'s StageSource<'a>,
    time: f64,
    list: Vec<Material>,
    pub(super) textures: Textures<'a>,
    bound: BTreeMap<String, Option<Rc<Look>>>,
    plain: BTreeMap<[u32; 4], Rc<Look>>,
}

/// The end of the connections of an input.
enum ConnectionEnd {
    /// An attribute with the value.
    Attribute(Prim, String),
    /// A shader and the name of its output.
    Output(Prim, String),
}

/// A texture, and the output of it that is taken.
struct TextureInput {
    map: TextureMap,
    channel: Option<Channel>,
    /// Factor of the texture, RGBA.
    scale: [f32; 4],
    /// Sum that follows the factor, RGBA.
    bias: [f32; 4],
}

/// The use of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TextureRole {
    /// A color or a share: not negative.
    Color,
    Normal,
    /// A number of any sign.
    Number,
}

impl<'s, 'a> Materials<'s, 'a> {
    /// Makes an empty list.
    pub(super) fn new(source: &'s StageSource<'a>, time: f64) -> Self {
        let textures = Textures::new(source);
        Self { source, time, list: Vec::new(), textures, bound: BTreeMap::new(), plain: BTreeMap::new() }
    }

    /// Returns the number of materials.
    pub(super) fn count(&self) -> usize {
        self.list.len()
    }

    /// Drops materials from a number on.
    pub(super) fn truncate(&mut self, count: usize) {
        self.list.truncate(count);
    }

    /// Adds a material. Returns its index.
    pub(super) fn push(&mut self, material: Material) -> u32 {
        self.list.push(material);
        self.list.len() as u32 - 1
    }

    /// Returns a material by its index.
    pub(super) fn get(&self, index: u32) -> &Material {
        &self.list[index as usize]
    }

    /// Decodes all pictures. Returns materials and images.
    pub(super) fn finish(self) -> Result<(Vec<Material>, Vec<Image>), SceneError> {
        let images = self.textures.load(self.source)?;
        Ok((self.list, images))
    }

    /// Returns the look of a matte surface.
    ///
    /// - `color`: linear RGB and opacity.
    pub(super) fn plain(&mut self, color: [f32; 4]) -> Rc<Look> {
        let key = color.map(f32::to_bits);
        if let Some(look) = self.plain.get(&key) {
            return look.clone();
        }
        let [r, g, b, alpha] = color;
        let sound = |value: f32| if value >= 0.0 { value.min(FACTOR_MAX) } else { 0.0 };
        let base_color = Vec3::new(sound(r), sound(g), sound(b));
        let layered = Layered { base_color: base_color.into(), specular: 0.0.into(), ..Layered::default() };
        let alpha_mode = if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
        let material = Material { opacity: alpha.clamp(0.0, 1.0).into(), alpha_mode, ..Material::from(layered) };
        let look = Rc::new(Look { material: self.push(material), ..Look::default() });
        self.plain.insert(key, look.clone());
        look
    }

    /// Returns the look of a bound material; `None`: it has no surface that can be read.
    pub(super) fn bound(&mut self, path: &Path) -> Option<Rc<Look>> {
        // Instances share the materials of their prototype
        let prim = self.source.stage.prim(path.clone());
        let shared = self.source.or_warn(path.as_str(), prim.prim_in_prototype());
        let prim = shared.unwrap_or(prim);
        let key = prim.path().as_str().to_owned();
        if let Some(look) = self.bound.get(&key) {
            return look.clone();
        }
        let look = self.convert(&prim).map(Rc::new);
        self.bound.insert(key, look.clone());
        look
    }

    fn convert(&mut self, prim: &Prim) -> Option<Look> {
        let source = self.source;
        let path = prim.path().as_str();
        if source.type_of(prim) != "Material" {
            source.unsupported(path, "is bound as a material but is not one; its surfaces have their display colour");
            return None;
        }
        let shader = ["outputs:surface", "outputs:mtlx:surface"].iter().find_map(|name| {
            match self.follow(prim, name, DEPTH_MAX)? {
                ConnectionEnd::Output(shader, _) => Some(shader),
                ConnectionEnd::Attribute(..) => None,
            }
        });
        let id = shader.as_ref().and_then(|shader| source.text(shader, "info:id", self.time));
        match (shader, id.as_deref()) {
            (Some(shader), Some("UsdPreviewSurface" | "ND_UsdPreviewSurface_surfaceshader")) => {
                let is_displaced = self.follow(prim, "outputs:displacement", DEPTH_MAX).is_some()
                    && self.is_used(&shader, "inputs:displacement");
                Some(PreviewSurface { materials: self, shader, look: Look::default() }.convert(path, is_displaced))
            }
            (_, id) => {
                let what = match id {
                    Some(id) => format!("the surface shader `{}` is not supported", shortened(id)),
                    None => "it has no surface shader that can be read".into(),
                };
                source.unsupported(path, format!("{what}; its surfaces have their display colour"));
                None
            }
        }
    }

    /// Returns true if an input has a connection or a value other than 0.
    fn is_used(&self, shader: &Prim, name: &str) -> bool {
        match self.follow(shader, name, DEPTH_MAX) {
            Some(ConnectionEnd::Output(..)) => true,
            Some(ConnectionEnd::Attribute(prim, name)) => self
                .source
                .value(&prim, &name, self.time)
                .and_then(|value| values::number(&value))
                .is_some_and(|x| x != 0.0),
            None => false,
        }
    }

    /// Follows the connections of an input or output; `None`: it has neither a connection nor a value.
    fn follow(&self, prim: &Prim, name: &str, depth: u32) -> Option<ConnectionEnd> {
        let place = format!("{}.{name}", prim.path());
        let attribute = prim.attribute(name.to_owned());
        let connections = self.source.or_warn(&place, attribute.connections());
        let Some(target) = connections.into_iter().find(Path::is_property_path) else {
            let has_value = !name.starts_with("outputs:") && self.source.value(prim, name, self.time).is_some();
            return has_value.then(|| ConnectionEnd::Attribute(prim.clone(), name.to_owned()));
        };
        if depth == 0 {
            self.source.unsupported(&place, "is connected in a circle; the connection is left out");
            return None;
        }
        let (path, property) = target.split_property()?;
        let next = self.source.stage.prim(path.clone());
        if property.starts_with("outputs:") && self.source.type_of(&next) == "Shader" {
            return Some(ConnectionEnd::Output(next, property.to_owned()));
        }
        self.follow(&next, property, depth - 1)
    }

    /// Returns the value of an input; `None`: it has none, or is connected to a shader.
    fn value(&self, shader: &Prim, name: &str) -> Option<Value> {
        match self.follow(shader, name, DEPTH_MAX)? {
            ConnectionEnd::Attribute(prim, name) => self.source.value(&prim, &name, self.time),
            ConnectionEnd::Output(..) => None,
        }
    }

    fn text(&self, shader: &Prim, name: &str) -> Option<String> {
        self.value(shader, name).and_then(|value| values::text(&value))
    }

    fn id(&self, shader: &Prim) -> String {
        self.source.text(shader, "info:id", self.time).unwrap_or_default()
    }

    fn four(&self, shader: &Prim, name: &str, usual: [f32; 4]) -> [f32; 4] {
        self.value(shader, name).and_then(|value| values::four(&value)).map_or(usual, |four| four.map(|x| x as f32))
    }

    /// Reads a UsdUVTexture; `None`: it names no file.
    fn texture(&mut self, shader: &Prim, output: &str, look: &mut Look, role: TextureRole) -> Option<TextureInput> {
        let source = self.source;
        let place = shader.path().as_str().to_owned();
        let file = match self.follow(shader, "inputs:file", DEPTH_MAX) {
            Some(ConnectionEnd::Attribute(prim, name)) => source.file(&prim, &name, self.time),
            _ => None,
        };
        let Some(mut file) = file else {
            source.unsupported(&place, "the texture has no file; its fallback is used");
            return None;
        };
        if file.reference.contains("<UDIM>") {
            source.unsupported(&place, "of pictures in tiles (UDIM), only tile 1001 is shown");
            file.reference = file.reference.replace("<UDIM>", "1001");
            file.name = source.files.named("", &file.reference).ok().filter(|name| source.files.exists(name));
        }
        let space = match self.text(shader, "inputs:sourceColorSpace").as_deref() {
            Some("raw") => SourceSpace::Raw,
            Some("sRGB") => SourceSpace::Srgb,
            _ => SourceSpace::Auto,
        };
        let fallback = self.four(shader, "inputs:fallback", [0.0, 0.0, 0.0, 1.0]);
        let [r, g, b, _] = fallback.map(|value| if value >= 0.0 { value.to_bits() } else { 0 });
        let is_normal = role == TextureRole::Normal;
        let stand_in = if is_normal { StandIn::Flat } else { StandIn::Color([r, g, b]) };
        let mut wanted = WantedTexture::new(&file, space, stand_in);
        let mut scale = self.four(shader, "inputs:scale", [1.0; 4]);
        let mut bias = self.four(shader, "inputs:bias", [0.0; 4]);
        if is_normal {
            // Normal maps hold half the normal plus a half, as glTF's do; files that lack scale and bias mean the same
            let is_usual = scale[..3] == [2.0; 3] && bias[..3] == [-1.0; 3] || scale == [1.0; 4] && bias == [0.0; 4];
            if !is_usual {
                wanted.change = Some(TexelChange::new(scale, bias, true));
            }
            scale = [1.0; 4];
            bias = [0.0; 4];
        } else if role == TextureRole::Color && (bias != [0.0; 4] || scale.iter().any(|factor| *factor < 0.0)) {
            wanted.change = Some(TexelChange::new(scale, bias, false));
            (scale, bias) = ([1.0; 4], [0.0; 4]);
        }
        let image = self.textures.want(wanted, &place);
        let (uv_set, picture_from_uv) = self.coordinates(shader, look);
        let channel = match output {
            "outputs:r" => Some(Channel::R),
            "outputs:g" => Some(Channel::G),
            "outputs:b" => Some(Channel::B),
            "outputs:a" => Some(Channel::A),
            _ => None,
        };
        let wrap = |name: &str| match self.text(shader, name).as_deref() {
            Some("clamp") => Wrap::Clamp,
            Some("mirror") => Wrap::Mirror,
            Some("black") => {
                source
                    .unsupported(&place, format!("`{name}` is `black`, which is not supported; it counts as `clamp`"));
                Wrap::Clamp
            }
            _ => Wrap::Repeat,
        };
        let (wrap_u, wrap_v) = (wrap("inputs:wrapS"), wrap("inputs:wrapT"));
        let map = TextureMap { image, uv_set, picture_from_uv, wrap_u, wrap_v, smooth: true };
        Some(TextureInput { map, channel, scale, bias })
    }

    /// Returns the set and transformation of a texture's coordinates, for v that points down.
    fn coordinates(&mut self, shader: &Prim, look: &mut Look) -> (u8, Affine2) {
        let source = self.source;
        let mut transform = Affine2::IDENTITY;
        let mut name = "st".to_owned();
        let mut from = self.follow(shader, "inputs:st", DEPTH_MAX);
        for _ in 0..DEPTH_MAX {
            let Some(ConnectionEnd::Output(reader, _)) = from.take() else { break };
            match self.id(&reader).as_str() {
                "UsdPrimvarReader_float2" => {
                    name = self.text(&reader, "inputs:varname").unwrap_or(name);
                    break;
                }
                "UsdTransform2d" => {
                    transform *= self.transform_2d(&reader);
                    from = self.follow(&reader, "inputs:in", DEPTH_MAX);
                }
                other => {
                    let message = format!("coordinates by `{}` are not supported; `st` is used", shortened(other));
                    source.unsupported(reader.path().as_str(), message);
                    break;
                }
            }
        }
        let set = look.uv_sets.iter().position(|known| *known == name).unwrap_or_else(|| {
            if look.uv_sets.len() < 2 {
                look.uv_sets.push(name.clone());
                return look.uv_sets.len() - 1;
            }
            let message =
                format!("a third set of coordinates, `{}`, is not kept; the first replaces it", shortened(&name));
            source.unsupported(shader.path().as_str(), message);
            0
        });
        let flip = Affine2 { matrix2: Mat2::from_diagonal(Vec2::new(1.0, -1.0)), translation: Vec2::Y };
        let flipped = flip * transform * flip;
        (set as u8, if flipped.is_finite() { flipped } else { Affine2::IDENTITY })
    }

    /// Reads a UsdTransform2d: scale, then rotation, then translation.
    fn transform_2d(&self, shader: &Prim) -> Affine2 {
        let pair = |name: &str, usual: f64| {
            let pair = self.value(shader, name).and_then(|value| values::pair(&value)).unwrap_or([usual; 2]);
            Vec2::new(pair[0] as f32, pair[1] as f32)
        };
        let rotation = self.value(shader, "inputs:rotation").and_then(|value| values::number(&value)).unwrap_or(0.0);
        let (sin, cos) = rotation.to_radians().sin_cos();
        let (sin, cos) = (sin as f32, cos as f32);
        let scale = pair("inputs:scale", 1.0);
        Affine2 {
            matrix2: Mat2::from_cols(Vec2::new(cos, sin) * scale.x, Vec2::new(-sin, cos) * scale.y),
            translation: pair("inputs:translation", 0.0),
        }
    }
}

/// The conversion of a UsdPreviewSurface.
struct PreviewSurface<'m, 's, 'a> {
    materials: &'m mut Materials<'s, 'a>,
    shader: Prim,
    look: Look,
}

impl PreviewSurface<'_, '_, '_> {
    fn convert(mut self, name: &str, is_displaced: bool) -> Look {
        let is_specular = self.number("inputs:useSpecularWorkflow", 0.0, 0.0, 1.0) != 0.0;
        let mut layered = Layered {
            base_color: self.color("inputs:diffuseColor", DVec3::splat(0.18), 1.0),
            roughness: self.scalar("inputs:roughness", 0.5),
            coat: self.scalar("inputs:clearcoat", 0.0),
            coat_roughness: self.scalar("inputs:clearcoatRoughness", 0.01),
            ..Layered::default()
        };
        if is_specular {
            // An index of 0 reflects all at normal incidence, which the colour scales
            layered.ior = 0.0;
            layered.specular_color = self.color("inputs:specularColor", DVec3::ZERO, 1.0);
        } else {
            layered.metallic = self.scalar("inputs:metallic", 0.0);
            let ior = self.number("inputs:ior", 1.5, 0.0, 100.0);
            layered.ior = if ior > 0.0 && ior < 1.0 { 1.0 / ior } else { ior };
        }
        let opacity = self.scalar("inputs:opacity", 1.0);
        let threshold = self.number("inputs:opacityThreshold", 0.0, 0.0, 1.0);
        let is_opaque = opacity.factor >= 1.0 && opacity.texture.is_none() && self.look.opacity.is_none();
        let alpha_mode = match threshold {
            _ if is_opaque => AlphaMode::Opaque,
            cutoff if cutoff > 0.0 => AlphaMode::Mask { cutoff },
            _ => AlphaMode::Blend,
        };
        let emission = self.color("inputs:emissiveColor", DVec3::ZERO, FACTOR_MAX.into());
        let relief = self.normal();
        let displacement = if is_displaced { self.displacement() } else { None };
        let material = Material {
            name: name.rsplit('/').next().unwrap_or_default().to_owned(),
            opacity,
            alpha_mode,
            emission,
            relief,
            displacement,
            ..Material::from(layered)
        };
        self.look.material = self.materials.push(material);
        self.look
    }

    fn place(&self, name: &str) -> String {
        format!("{}.{name}", self.shader.path())
    }

    /// Returns a number, clamped to its range with a warning. A texture is left out.
    fn number(&self, name: &str, usual: f64, least: f64, greatest: f64) -> f32 {
        let (source, place) = (self.materials.source, self.place(name));
        if matches!(self.materials.follow(&self.shader, name, DEPTH_MAX), Some(ConnectionEnd::Output(..))) {
            source.unsupported(&place, "a texture of it is left out");
        }
        let value = self.materials.value(&self.shader, name).and_then(|value| values::number(&value)).unwrap_or(usual);
        let inside = if value.is_nan() { usual } else { value.clamp(least, greatest) };
        if inside != value {
            source.warn(&place, format!("{value} is out of range and counts as {inside}"));
        }
        inside as f32
    }

    /// Returns the shader that an input is connected to.
    fn connected(&self, name: &str) -> Option<(Prim, String)> {
        match self.materials.follow(&self.shader, name, DEPTH_MAX)? {
            ConnectionEnd::Output(shader, output) => Some((shader, output)),
            ConnectionEnd::Attribute(..) => None,
        }
    }

    fn color(&mut self, name: &str, usual: DVec3, greatest: f64) -> ColorParam {
        let (source, place) = (self.materials.source, self.place(name));
        let sound = |color: DVec3| {
            let inside = color.max(DVec3::ZERO).min(DVec3::splat(greatest));
            if inside != color {
                source.warn(&place, format!("{color} is out of range and counts as {inside}"));
            }
            inside.as_vec3()
        };
        let Some((shader, output)) = self.connected(name) else {
            let value = self.materials.value(&self.shader, name).and_then(|value| values::vector(&value));
            return sound(value.filter(|color| color.is_finite()).unwrap_or(usual)).into();
        };
        match self.materials.id(&shader).as_str() {
            "UsdUVTexture" => {
                let Some(texture) = self.materials.texture(&shader, &output, &mut self.look, TextureRole::Color) else {
                    let [r, g, b, _] = self.materials.four(&shader, "inputs:fallback", [0.0, 0.0, 0.0, 1.0]);
                    return sound(Vec3::new(r, g, b).as_dvec3()).into();
                };
                if texture.channel.is_some() {
                    source.unsupported(&place, "one channel of a texture is not a colour; all three are used");
                }
                let [r, g, b, _] = texture.scale;
                let factor = Vec3::new(r, g, b).min(Vec3::splat(FACTOR_MAX));
                ColorParam { factor, texture: Some(texture.map) }
            }
            "UsdPrimvarReader_float3" if name == "inputs:diffuseColor" => {
                self.look.color = self.materials.text(&shader, "inputs:varname");
                Vec3::ONE.into()
            }
            other => {
                let message = format!("the shader `{}` is not supported here; its fallback is used", shortened(other));
                source.unsupported(&place, message);
                let fallback = self.materials.value(&shader, "inputs:fallback").and_then(|it| values::vector(&it));
                sound(fallback.filter(|color| color.is_finite()).unwrap_or(usual)).into()
            }
        }
    }

    /// Returns a number from 0 to 1.
    fn scalar(&mut self, name: &str, usual: f64) -> ScalarParam {
        let (source, place) = (self.materials.source, self.place(name));
        let Some((shader, output)) = self.connected(name) else { return self.number(name, usual, 0.0, 1.0).into() };
        match self.materials.id(&shader).as_str() {
            "UsdUVTexture" => {
                let Some(texture) = self.materials.texture(&shader, &output, &mut self.look, TextureRole::Color) else {
                    let [value, ..] = self.materials.four(&shader, "inputs:fallback", [0.0, 0.0, 0.0, 1.0]);
                    return value.clamp(0.0, 1.0).into();
                };
                let channel = texture.channel.unwrap_or(Channel::R);
                let factor = texture.scale[channel as usize].clamp(0.0, FACTOR_MAX);
                ScalarParam { factor, texture: Some((texture.map, channel)) }
            }
            "UsdPrimvarReader_float" if name == "inputs:opacity" => {
                self.look.opacity = self.materials.text(&shader, "inputs:varname");
                1.0.into()
            }
            other => {
                let message = format!("the shader `{}` is not supported here; its fallback is used", shortened(other));
                source.unsupported(&place, message);
                let fallback = self.materials.value(&shader, "inputs:fallback").and_then(|it| values::number(&it));
                (fallback.unwrap_or(usual).clamp(0.0, 1.0) as f32).into()
            }
        }
    }

    /// Returns the displacement along the normal, in scene units.
    fn displacement(&mut self) -> Option<Displacement> {
        let name = "inputs:displacement";
        let Some((shader, output)) = self.connected(name) else {
            let height = self.materials.value(&self.shader, name).and_then(|value| values::number(&value))?;
            let flat = Displacement::heights(1.0.into());
            return Some(Displacement { scale: 0.0, bias: height as f32, space: DisplacementSpace::World, ..flat });
        };
        let texture = match self.materials.id(&shader).as_str() {
            "UsdUVTexture" => self.materials.texture(&shader, &output, &mut self.look, TextureRole::Number)?,
            other => {
                let message = format!("displacement by `{}` is left out", shortened(other));
                self.materials.source.unsupported(&self.place(name), message);
                return None;
            }
        };
        let channel = texture.channel.unwrap_or(Channel::R);
        let (scale, bias) = (texture.scale[channel as usize], texture.bias[channel as usize]);
        let height = ScalarParam { factor: 1.0, texture: Some((texture.map, channel)) };
        Some(Displacement { scale, bias, space: DisplacementSpace::World, ..Displacement::heights(height) })
    }

    fn normal(&mut self) -> Option<Relief> {
        let (shader, output) = self.connected("inputs:normal")?;
        if self.materials.id(&shader) != "UsdUVTexture" {
            self.materials.source.unsupported(&self.place("inputs:normal"), "is not a texture; it is left out");
            return None;
        }
        let texture = self.materials.texture(&shader, &output, &mut self.look, TextureRole::Normal)?;
        Some(Relief::normals(texture.map, 1.0))
    }
}
