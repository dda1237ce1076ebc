//! Participating media.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use super::context::Context;
use super::film::Exposure;
use super::grid;
use super::needless::Directive;
use super::world::{Entity, MediumInterface, PbrtWorld};
use crate::color::Spectrum;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::medium::{EmissionVariation, Medium, MediumId};
use crate::spectrum::color_space::ColorSpace;
use crate::spectrum::role::ColorRole;
use crate::text::shortened;

/// The media in use, by name.
pub(super) struct Media<'w> {
    world: &'w PbrtWorld,
    exposure: Exposure,
    /// The converted media, by their id.
    pub(super) list: Vec<Medium>,
    /// Ids of the media; `None`: unsupported, left out.
    id_of: BTreeMap<String, Option<MediumId>>,
}

impl<'w> Media<'w> {
    /// Makes an empty collection.
    pub(super) fn new(world: &'w PbrtWorld, exposure: Exposure) -> Self {
        Self { world, exposure, list: Vec::new(), id_of: BTreeMap::new() }
    }

    /// Returns the media behind and before a surface. Both are `None` if they are equal, so that light stays in its
    /// current medium.
    pub(super) fn interface(
        &mut self,
        context: &mut Context<'_>,
        interface: &MediumInterface,
    ) -> ImportResult<[Option<MediumId>; 2]> {
        if interface.inside == interface.outside {
            return Ok([None, None]);
        }
        let inside = self.find(context, interface.inside.as_deref(), interface.at)?;
        Ok([inside, self.find(context, interface.outside.as_deref(), interface.at)?])
    }

    /// Returns the medium of a name; `None`: vacuum.
    pub(super) fn find(
        &mut self,
        context: &mut Context<'_>,
        name: Option<&str>,
        at: TextPlace,
    ) -> ImportResult<Option<MediumId>> {
        let Some(name) = name else { return Ok(None) };
        if let Some(id) = self.id_of.get(name) {
            return Ok(*id);
        }
        let Some(entity) = self.world.media.get(name) else {
            return Err(at.fault(format!("there is no medium \"{}\"", shortened(name))).into());
        };
        let id = match convert(context, entity, self.exposure)? {
            Some(medium) => {
                self.list.push(Medium { name: name.into(), ..medium });
                Some(MediumId(self.list.len() as u32 - 1))
            }
            None => None,
        };
        self.id_of.insert(name.into(), id);
        Ok(id)
    }
}

fn convert(context: &mut Context<'_>, entity: &Entity, exposure: Exposure) -> ImportResult<Option<Medium>> {
    let (params, at) = (&entity.params, entity.at);
    let is_colored = match entity.kind.as_str() {
        "homogeneous" | "uniformgrid" | "nanovdb" => false,
        "rgbgrid" => true,
        kind => {
            context.unsupported(at, format!("a medium of type \"{}\" is left out", shortened(kind)));
            return Ok(None);
        }
    };
    let scale = params.float("scale")?.unwrap_or(1.0);
    let g = params.float("g")?.unwrap_or(0.0);
    if !(scale >= 0.0 && g > -1.0 && g < 1.0) {
        return Err(at.fault("a medium's scale must not be negative, and its g be between -1 and 1").into());
    }
    let mut sigma = [DVec3::ONE; 2];
    if !is_colored {
        for (sigma, name) in sigma.iter_mut().zip(["sigma_a", "sigma_s"]) {
            if let Some(color) = context.color(params, name)? {
                *sigma = color.to_rec709(ColorRole::Unbounded).as_dvec3();
            }
        }
    }
    if let Some(preset) = params.text("preset")? {
        match preset_coefficients(preset) {
            Some(coefficients) => sigma = coefficients,
            None => {
                let problem = format!("there is no medium preset \"{}\"", shortened(preset));
                return Err(params.place_of("preset").fault(problem).into());
            }
        }
    }
    let [absorption, scattering] = sigma.map(|sigma| (sigma * scale).as_vec3());
    let variation = match entity.kind.as_str() {
        "uniformgrid" => Some(grid::uniform(context, entity, exposure)?),
        "rgbgrid" => Some(grid::colored(entity, exposure)?),
        "nanovdb" => match grid::voxels(context, entity, exposure)? {
            Some(variation) => Some(variation),
            None => return Ok(None),
        },
        _ => None,
    };
    let shines_by_temperature =
        variation.as_ref().is_some_and(|it| matches!(it.emission, Some(EmissionVariation::Blackbody(_))));
    // Emission is proportional to absorption, as in pbrt. A list of strengths belongs to a grid.
    let strength = match params.floats("Lescale").or_else(|| params.floats("LeScale")) {
        Some(&[strength]) => strength,
        _ => 1.0,
    };
    let mut emission = Spectrum::ZERO;
    if shines_by_temperature {
        emission = absorption * strength as f32;
    } else if is_colored {
        if params.find("Le", &["rgb"]).is_some() {
            emission = absorption * strength as f32;
        }
    } else if let Some(color) = context.color(params, "Le")? {
        emission = absorption * exposure.apply(color.to_rec709(ColorRole::Emission) * strength as f32);
    }
    context.report_unused(Directive::Medium, &entity.kind, params);
    if !(absorption + scattering + emission).is_finite() {
        return Err(at.fault("the coefficients of the medium exceed all bounds").into());
    }
    let variation = variation.map(Arc::new);
    Ok(Some(Medium { name: String::new(), absorption, scattering, emission, g: g as f32, variation }))
}

/// Returns absorption and reduced scattering of a substance, per millimetre; `None`: the name is unknown.
pub(super) fn preset_coefficients(name: &str) -> Option<[DVec3; 2]> {
    let lines = include_str!("presets.txt").lines().filter(|line| !line.starts_with('#'));
    for line in lines {
        let (known, numbers) = line.split_once(':')?;
        if known == name {
            let numbers: Vec<f64> = numbers.split_whitespace().filter_map(|word| word.parse().ok()).collect();
            let &[s0, s1, s2, a0, a1, a2] = numbers.as_slice() else { return None };
            let rgb = |r, g, b| ColorSpace::Srgb.to_rec709(DVec3::new(r, g, b), ColorRole::Unbounded).as_dvec3();
            return Some([rgb(a0, a1, a2), rgb(s0, s1, s2)]);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_complete() {
        let names = include_str!("presets.txt").lines().filter(|line| !line.starts_with('#'));
        let names: Vec<&str> = names.filter_map(|line| line.split_once(':')).map(|(name, _)| name).collect();
        assert!(names.len() > 40);
        for name in names {
            let [absorption, scattering] = preset_coefficients(name).unwrap();
            assert!(absorption.min_element() >= 0.0 && scattering.min_element() >= 0.0, "{name}");
        }
        assert_eq!(
            preset_coefficients("Wholemilk").unwrap()[0],
            DVec3::new(0.0011, 0.0024, 0.014).as_vec3().as_dvec3()
        );
        assert_eq!(preset_coefficients("Ink"), None);
    }
}
