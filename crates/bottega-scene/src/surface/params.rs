//! Parameters and textures of surfaces.

use super::{CoatedBase, Conductor, Diffuse, Surface};
use crate::param::{ColorParam, ScalarParam};
use crate::subsurface::Substance;
use crate::texture::TextureMap;

impl Surface {
    /// Returns all colour parameters of the surface, and all its number parameters, each with or without a texture.
    pub fn params(&self) -> (Vec<&ColorParam>, Vec<&ScalarParam>) {
        let (mut colors, mut scalars) = (Vec::new(), Vec::new());
        self.add_params(&mut colors, &mut scalars);
        (colors, scalars)
    }

    fn add_params<'a>(&'a self, colors: &mut Vec<&'a ColorParam>, scalars: &mut Vec<&'a ScalarParam>) {
        match self {
            Self::Null | Self::Measured(_) => {}
            Self::Unlit(color) => colors.push(color),
            Self::Diffuse(diffuse) => diffuse.add_params(colors, scalars),
            Self::DiffuseTransmission { reflectance, transmittance } => colors.extend([reflectance, transmittance]),
            Self::Conductor(conductor) => conductor.add_params(colors, scalars),
            Self::Dielectric(dielectric) => {
                colors.extend([&dielectric.reflectance, &dielectric.transmittance]);
                scalars.extend(&dielectric.facets.roughness);
            }
            Self::Plastic(plastic) => {
                colors.extend([&plastic.diffuse, &plastic.specular]);
                scalars.extend(&plastic.facets.roughness);
            }
            Self::Coated(coated) => {
                colors.push(&coated.albedo);
                scalars.extend([&coated.thickness, &coated.g]);
                scalars.extend(&coated.facets.roughness);
                match &coated.base {
                    CoatedBase::Diffuse(diffuse) => diffuse.add_params(colors, scalars),
                    CoatedBase::Conductor(conductor) => conductor.add_params(colors, scalars),
                }
            }
            Self::Varnished(varnished) => {
                colors.extend([&varnished.specular, &varnished.absorption]);
                scalars.extend(&varnished.facets.roughness);
                varnished.base.add_params(colors, scalars);
            }
            Self::Phong(phong) => {
                colors.extend([&phong.diffuse, &phong.specular]);
                scalars.push(&phong.exponent);
            }
            Self::Ward(ward) => {
                colors.extend([&ward.diffuse, &ward.specular]);
                scalars.extend(&ward.roughness);
            }
            Self::Principled(p) => {
                colors.push(&p.base_color);
                scalars.extend([&p.roughness, &p.anisotropic, &p.metallic, &p.spec_trans, &p.spec_tint, &p.sheen]);
                scalars.extend([&p.sheen_tint, &p.flatness, &p.clearcoat, &p.clearcoat_gloss, &p.diff_trans]);
            }
            Self::Layered(l) => {
                colors.extend([&l.base_color, &l.specular_color, &l.sheen_color, &l.diffuse_transmission_color]);
                scalars.extend([&l.metallic, &l.roughness, &l.specular, &l.transmission, &l.diffuse_transmission]);
                scalars.extend([&l.coat, &l.coat_roughness, &l.sheen_roughness]);
                scalars.extend(l.iridescence.as_ref().map(|film| &film.factor));
                if let Some(subsurface) = &l.subsurface {
                    scalars.push(&subsurface.weight);
                    match &subsurface.substance {
                        Substance::Colored { radius, .. } => colors.push(radius),
                        Substance::Coefficients { absorption, scattering } => colors.extend([absorption, scattering]),
                    }
                }
            }
            Self::Hair(hair) => hair.add_params(colors, scalars),
            Self::Blend { weight, surfaces } => {
                scalars.push(weight);
                surfaces.iter().for_each(|surface| surface.add_params(colors, scalars));
            }
            Self::Sum(surfaces) => surfaces.iter().for_each(|surface| surface.add_params(colors, scalars)),
        }
    }

    /// Returns every index of refraction that is a number rather than a colour, and the other plain numbers of
    /// [`Layered`](super::Layered): dispersion, the film's thicknesses.
    pub(crate) fn indices_of_refraction(&self) -> Vec<f32> {
        match self {
            Self::Dielectric(dielectric) => vec![dielectric.eta],
            Self::Plastic(plastic) => vec![plastic.eta],
            Self::Coated(coated) => vec![coated.eta],
            Self::Varnished(varnished) => {
                let mut indices = varnished.base.indices_of_refraction();
                indices.push(varnished.eta);
                indices
            }
            Self::Principled(principled) => vec![principled.eta],
            Self::Hair(hair) => vec![hair.eta],
            Self::Layered(layered) => {
                let film = layered.iridescence.as_ref();
                let film = film.into_iter().flat_map(|film| [film.ior, film.thickness[0], film.thickness[1]]);
                let below = layered.subsurface.iter().map(|below| below.inner_eta);
                film.chain(below).chain([layered.ior, layered.dispersion]).collect()
            }
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => {
                surfaces.iter().flat_map(Self::indices_of_refraction).collect()
            }
            _ => Vec::new(),
        }
    }

    /// Returns true unless the scales of hair have an angle beyond [−90, 90] degrees.
    pub(crate) fn has_sound_scales(&self) -> bool {
        match self {
            Self::Hair(hair) => hair.alpha.abs() <= 90.0,
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().all(Self::has_sound_scales),
            _ => true,
        }
    }

    /// Returns true unless scattering below the surface has an asymmetry beyond (−1, 1).
    pub(crate) fn has_sound_subsurface(&self) -> bool {
        match self {
            Self::Layered(layered) => layered.subsurface.as_ref().is_none_or(|below| below.g.abs() < 1.0),
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => surfaces.iter().all(Self::has_sound_subsurface),
            _ => true,
        }
    }

    /// Appends every texture that the surface refers to.
    pub(crate) fn add_textures<'a>(&'a self, maps: &mut Vec<&'a TextureMap>) {
        let (colors, scalars) = self.params();
        maps.extend(colors.into_iter().filter_map(|color| color.texture.as_ref()));
        maps.extend(scalars.into_iter().filter_map(|scalar| scalar.texture.as_ref().map(|(map, _)| map)));
        self.add_maps(maps);
    }

    /// Appends the textures that are not of a colour or number parameter: normal maps, directions and thicknesses.
    fn add_maps<'a>(&'a self, maps: &mut Vec<&'a TextureMap>) {
        match self {
            Self::Layered(layered) => {
                maps.extend(layered.coat_normal.as_ref().map(|(map, _)| map));
                maps.extend(layered.anisotropy.as_ref().and_then(|anisotropy| anisotropy.texture.as_ref()));
                let film = layered.iridescence.as_ref();
                maps.extend(film.and_then(|film| film.thickness_texture.as_ref()).map(|(map, _)| map));
            }
            Self::Blend { surfaces, .. } | Self::Sum(surfaces) => {
                surfaces.iter().for_each(|surface| surface.add_maps(maps));
            }
            _ => {}
        }
    }
}

impl Diffuse {
    fn add_params<'a>(&'a self, colors: &mut Vec<&'a ColorParam>, scalars: &mut Vec<&'a ScalarParam>) {
        colors.push(&self.reflectance);
        scalars.push(&self.roughness);
    }
}

impl Conductor {
    fn add_params<'a>(&'a self, colors: &mut Vec<&'a ColorParam>, scalars: &mut Vec<&'a ScalarParam>) {
        colors.extend([&self.eta, &self.k, &self.reflectance]);
        scalars.extend(&self.facets.roughness);
    }
}
