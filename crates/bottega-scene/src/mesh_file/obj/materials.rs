//! Conversion of MTL materials.
//!
//! MTL describes highlights, not surfaces, and programs agree on little. A highlight of exponent `Ns` becomes
//! microfacets with α² = 2 / (Ns + 2) (Walter et al. 2007, section 5.2); `illum` 4, 6, 7 and 9 become glass; 3, 5 and 8
//! a mirror if `Ks` exceeds `Kd`. `Pr`, `Pm` and their maps take precedence.

use std::collections::BTreeMap;

use bottega_image::printable_path;
use glam::{Affine2, Mat2, Vec2, Vec3};

use super::super::mtl::{self, MtlMap, MtlMaterial};
use crate::color::Spectrum;
use crate::error::{SceneError, Warnings};
use crate::image::Image;
use crate::image::pictures::{PictureKind, Pictures};
use crate::material::{AlphaMode, Material, Relief, Sides};
use crate::options::LoadOptions;
use crate::param::{ColorParam, ScalarParam};
use crate::resource::{Location, Resources};
use crate::surface::Layered;
use crate::text::shortened;
use crate::texture::{Channel, TextureMap, Wrap};

/// The materials of all libraries that a file names.
pub(crate) struct Library<'a> {
    /// Materials by name; of equal names, the first one.
    materials: BTreeMap<String, (Location, MtlMaterial)>,
    pictures: Pictures<'a>,
}

impl<'a> Library<'a> {
    /// Reads libraries, given as names in the file and their lines. A missing one gets a warning.
    pub(crate) fn open(
        names: &[(String, usize)],
        options: &LoadOptions,
        resources: &'a Resources<'a>,
        warnings: &mut Warnings,
    ) -> Result<Self, SceneError> {
        let mut materials = BTreeMap::new();
        for (name, line) in names {
            let place = format!("line {line}");
            // The text may be one name with spaces, or several names.
            let whole = resources.locate(name, &place)?;
            let locations = if whole.is_file() {
                vec![whole]
            } else {
                let names = name.split_whitespace();
                names.map(|name| resources.locate(name, &place)).collect::<Result<_, SceneError>>()?
            };
            for location in locations {
                let bytes = match resources.read(&location) {
                    Ok(bytes) => bytes,
                    Err(SceneError::Read { path, source, .. }) => {
                        let message = format!("cannot read the materials in `{}` ({source})", printable_path(&path));
                        warnings.unsupported(place.as_str(), message);
                        continue;
                    }
                    Err(error) => return Err(error),
                };
                let file = mtl::read(location.path(), &bytes, resources.budget());
                let file = resources.attribute(&location, file)?;
                for (line, message) in file.notes {
                    warnings.unsupported(format!("{}, line {line}", shortened(&location.name)), message);
                }
                for material in file.materials {
                    materials.entry(material.name.clone()).or_insert((location.clone(), material));
                }
            }
        }
        Ok(Self { materials, pictures: Pictures::new(resources, options) })
    }

    /// Returns the material of a name. `None`: no library has it, which gets a warning.
    pub(crate) fn material(&mut self, name: &str, warnings: &mut Warnings) -> Result<Option<Material>, SceneError> {
        let Some((location, description)) = self.materials.get(name) else {
            warnings
                .unsupported("", format!("no library has the material `{}`; plain gray replaces it", shortened(name)));
            return Ok(None);
        };
        MtlConverter { location, pictures: &mut self.pictures, warnings }.convert(description).map(Some)
    }

    /// Decodes the pictures of all requested materials.
    pub(crate) fn into_images(self, warnings: &mut Warnings) -> Result<Vec<Image>, SceneError> {
        self.pictures.load(warnings)
    }
}

struct MtlConverter<'a, 'p> {
    location: &'a Location,
    pictures: &'a mut Pictures<'p>,
    warnings: &'a mut Warnings,
}

impl MtlConverter<'_, '_> {
    fn convert(mut self, mtl: &MtlMaterial) -> Result<Material, SceneError> {
        let illum = mtl.illum.unwrap_or(2);
        let diffuse = mtl.diffuse.unwrap_or(if mtl.diffuse_map.is_some() { Vec3::ONE } else { Vec3::splat(0.8) });
        let specular = mtl.specular.unwrap_or(Vec3::ZERO);
        let opacity = mtl.opacity.unwrap_or(1.0).clamp(0.0, 1.0);
        let is_glass = matches!(illum, 4 | 6 | 7 | 9) && (opacity < 1.0 || mtl.transmission.is_some());
        let is_mirror =
            matches!(illum, 3 | 5 | 8) && mtl.metallic.is_none() && specular.max_element() > diffuse.max_element();

        let mut layered = Layered {
            base_color: self.color(diffuse, mtl.diffuse_map.as_ref())?,
            metallic: self.scalar(mtl.metallic, 0.0, mtl.metallic_map.as_ref())?,
            roughness: self.scalar(mtl.roughness, roughness_of_exponent(mtl.exponent), mtl.roughness_map.as_ref())?,
            ior: mtl.ior.filter(|&ior| (1.0..=10.0).contains(&ior)).unwrap_or(1.5),
            ..Layered::default()
        };
        // Without a highlight, disable the specular reflection, unless physical parameters are given.
        let is_physical = mtl.roughness.is_some() || mtl.metallic.is_some();
        if !is_physical {
            let strength = if illum < 2 { 0.0 } else { (2.0 * specular.max_element()).min(1.0) };
            layered.specular = strength.into();
            if strength > 0.0 {
                layered.specular_color = self.color(specular / specular.max_element(), mtl.specular_map.as_ref())?;
            }
        }
        if is_mirror {
            layered.base_color = self.color(specular, mtl.specular_map.as_ref())?;
            layered.metallic = 1.0.into();
            layered.specular = 1.0.into();
            layered.specular_color = Spectrum::ONE.into();
        }
        if is_glass {
            let tint = mtl.transmission.filter(|tint| tint.max_element() > 0.0).unwrap_or(Vec3::ONE);
            layered.base_color = tint.min(Vec3::ONE).into();
            layered.transmission = 1.0.into();
            layered.specular = 1.0.into();
            layered.specular_color = Spectrum::ONE.into();
            layered.roughness = mtl.roughness.unwrap_or(0.0).clamp(0.0, 1.0).into();
        }
        let mut material = Material::from(layered);
        material.name = shortened(&mtl.name).into_owned();
        if !is_glass && (opacity < 1.0 || mtl.opacity_map.is_some()) {
            material.opacity = self.opacity(opacity, mtl)?;
            material.alpha_mode = AlphaMode::Blend;
        }
        let emission = mtl.emission.unwrap_or(if mtl.emission_map.is_some() { Vec3::ONE } else { Vec3::ZERO });
        material.emission = self.color(emission, mtl.emission_map.as_ref())?;
        material.emission_sides = Sides::Both;
        material.relief = self.relief(mtl)?;
        Ok(material)
    }

    fn color(&mut self, factor: Vec3, map: Option<&MtlMap>) -> Result<ColorParam, SceneError> {
        let texture = map.map(|map| self.texture(map, PictureKind::COLORS)).transpose()?;
        Ok(ColorParam { factor, texture })
    }

    /// Combines a number in [0, 1] with its map. With a map but no number, the factor is 1.
    fn scalar(&mut self, value: Option<f32>, default: f32, map: Option<&MtlMap>) -> Result<ScalarParam, SceneError> {
        let factor = value.unwrap_or(if map.is_some() { 1.0 } else { default }).clamp(0.0, 1.0);
        let texture = map.map(|map| self.texture(map, PictureKind::NUMBERS)).transpose()?;
        Ok(ScalarParam { factor, texture: texture.map(|texture| (texture, Channel::R)) })
    }

    fn opacity(&mut self, factor: f32, mtl: &MtlMaterial) -> Result<ScalarParam, SceneError> {
        let Some(map) = &mtl.opacity_map else { return Ok(factor.into()) };
        // If it is also the colour map, its alpha is the opacity; otherwise its red channel.
        let is_alpha = mtl.diffuse_map.as_ref().is_some_and(|diffuse| diffuse.reference == map.reference);
        let (channel, kind) =
            if is_alpha { (Channel::A, PictureKind::COLORS) } else { (Channel::R, PictureKind::NUMBERS) };
        Ok(ScalarParam { factor, texture: Some((self.texture(map, kind)?, channel)) })
    }

    fn relief(&mut self, mtl: &MtlMaterial) -> Result<Option<Relief>, SceneError> {
        if let Some(map) = &mtl.normal_map {
            return Ok(Some(Relief::normals(self.texture(map, PictureKind::NORMALS)?, 1.0)));
        }
        let Some(map) = &mtl.bump_map else { return Ok(None) };
        let Some(height) = map.strength else {
            let message = "a bump map without `-bm` has no height, and is left out; give it one in scene units";
            self.warnings.unsupported(self.place(map.line), message);
            return Ok(None);
        };
        let texture = (self.texture(map, PictureKind::NUMBERS)?, Channel::R);
        Ok(Some(Relief::heights(ScalarParam { factor: height, texture: Some(texture) })))
    }

    fn texture(&mut self, map: &MtlMap, kind: PictureKind) -> Result<TextureMap, SceneError> {
        let place = self.place(map.line);
        // Look beside the library first, then beside the scene.
        let folders = [self.location.folder(), ""];
        let image = self.pictures.want_in(&folders, &map.reference, kind, &place)?;
        let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
        // v points up in the file: v' = 1 − v.
        let picture_from_uv = Affine2 {
            matrix2: Mat2::from_diagonal(map.scale),
            translation: Vec2::new(map.offset.x, 1.0 - map.scale.y - map.offset.y),
        };
        Ok(TextureMap { picture_from_uv, wrap_u: wrap, wrap_v: wrap, ..TextureMap::new(image) })
    }

    fn place(&self, line: usize) -> String {
        format!("{}, line {line}", shortened(&self.location.name))
    }
}

/// Returns the perceptual roughness √α of a highlight exponent.
fn roughness_of_exponent(exponent: Option<f32>) -> f32 {
    let Some(exponent) = exponent else { return 1.0 };
    let alpha_squared = 2.0 / (f64::from(exponent.max(0.0)) + 2.0);
    alpha_squared.sqrt().sqrt() as f32
}
