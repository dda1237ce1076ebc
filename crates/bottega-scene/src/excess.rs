//! A warning about reflectance textures above 1, which are clamped at lookup.

use std::collections::BTreeSet;

use crate::error::Warnings;
use crate::hair::Pigment;
use crate::image::Image;
use crate::image::raw::LevelTexels;
use crate::material::Back;
use crate::model::Scene;
use crate::param::ColorParam;
use crate::surface::{CoatedBase, Surface};
use crate::texture::MappingKind;

/// Greatest excess above 1 that counts as rounding.
const ROUNDING: f32 = 1.001;

/// Warns once for each HDR picture that is used as a reflectance and exceeds 1.
pub(crate) fn warn(scene: &Scene, warnings: &mut Warnings) {
    let mut known = BTreeSet::new();
    for (index, material) in scene.materials.iter().enumerate() {
        let mut shares = Vec::new();
        add_shares(&material.surface, &mut shares);
        if let Back::Other(surface) = &material.back {
            add_shares(surface, &mut shares);
        }
        for param in shares {
            let Some(map) = &param.texture else { continue };
            // A ramp ends at bounds that noise hardly reaches
            if map.mapping(scene).is_some_and(|mapping| matches!(mapping.kind, MappingKind::Noise(_))) {
                continue;
            }
            let image = &scene.images[map.image.0 as usize];
            if !image.is_high_dynamic_range() || !known.insert(map.image) {
                continue;
            }
            let most = largest(image) * param.factor.max_element();
            if most > ROUNDING {
                let name = &image.name;
                let message = format!(
                    "the picture `{name}` reflects up to {most} times the light that arrives, and is clamped to 1"
                );
                warnings.add(format!("materials[{index}]"), message);
            }
        }
    }
}

/// Appends the colours of a surface that are reflectances or transmittances, which must not exceed 1.
fn add_shares<'a>(surface: &'a Surface, shares: &mut Vec<&'a ColorParam>) {
    match surface {
        Surface::Diffuse(diffuse) => shares.push(&diffuse.reflectance),
        Surface::DiffuseTransmission { reflectance, transmittance } => shares.extend([reflectance, transmittance]),
        Surface::Plastic(plastic) => shares.extend([&plastic.diffuse, &plastic.specular]),
        Surface::Coated(coated) => {
            if let CoatedBase::Diffuse(diffuse) = &coated.base {
                shares.push(&diffuse.reflectance);
            }
        }
        Surface::Varnished(varnished) => {
            shares.push(&varnished.specular);
            add_shares(&varnished.base, shares);
        }
        Surface::Phong(phong) => shares.extend([&phong.diffuse, &phong.specular]),
        Surface::Ward(ward) => shares.extend([&ward.diffuse, &ward.specular]),
        Surface::Principled(principled) => shares.push(&principled.base_color),
        Surface::Layered(layered) => shares.push(&layered.base_color),
        Surface::Hair(hair) => {
            if let Pigment::Reflectance(reflectance) = &hair.pigment {
                shares.push(reflectance);
            }
        }
        Surface::Blend { surfaces, .. } | Surface::Sum(surfaces) => {
            surfaces.iter().for_each(|surface| add_shares(surface, shares));
        }
        Surface::Null | Surface::Unlit(_) | Surface::Conductor(_) | Surface::Dielectric(_) | Surface::Measured(_) => {}
    }
}

/// Returns the greatest value of an HDR picture; 1 for other formats.
fn largest(image: &Image) -> f32 {
    match image.level_texels(0) {
        LevelTexels::Rgb32(texels) => texels.iter().flatten().fold(0.0, |most, value| most.max(*value)),
        LevelTexels::Rgba32(texels) => {
            texels.iter().flat_map(|texel| &texel[..3]).fold(0.0, |most, value| most.max(*value))
        }
        _ => 1.0,
    }
}
