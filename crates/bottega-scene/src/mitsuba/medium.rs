//! Participating media.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine3A, DAffine3};

use super::context::ImportContext;
use super::document::{Class, Object, ObjectId};
use super::texture::MitsubaTextures;
use super::volume::{self, Volume};
use crate::color::Spectrum;
use crate::grid::{Blend, Grid};
use crate::import::text_place::ImportResult;
use crate::medium::{Density, Medium, MediumId, Variation};
use crate::spectrum::role::ColorRole;
use crate::text::shortened;

/// A coefficient of a medium.
enum MediumField {
    Constant(Spectrum),
    Grid(Grid, Affine3A),
}

impl MediumField {
    /// Returns the value, or the mean of a grid.
    fn mean(&self) -> Spectrum {
        match self {
            Self::Constant(value) => *value,
            Self::Grid(grid, _) => grid.mean(),
        }
    }

    /// Returns the factor of a coefficient and its grid.
    fn into_factor_and_grid(self) -> (Spectrum, Grid) {
        match self {
            Self::Constant(value) => (value, Grid::one()),
            Self::Grid(grid, _) => (Spectrum::ONE, grid),
        }
    }
}

/// Coefficients per scene unit, and their spatial variation.
struct MediumContents {
    absorption: Spectrum,
    scattering: Spectrum,
    variation: Option<Variation>,
}

/// The media of a scene.
#[derive(Default)]
pub(super) struct MitsubaMedia {
    /// The converted media, by their [`MediumId`].
    pub(super) list: Vec<Medium>,
    /// Ids of the media that were converted.
    ids: BTreeMap<ObjectId, MediumId>,
}

impl MitsubaMedia {
    /// Returns a medium, converted once.
    pub(super) fn medium(
        &mut self,
        context: &mut ImportContext<'_>,
        textures: &mut MitsubaTextures<'_>,
        id: ObjectId,
    ) -> ImportResult<MediumId> {
        if let Some(&known) = self.ids.get(&id) {
            return Ok(known);
        }
        let object = context.visit(id)?;
        if object.plugin != "homogeneous" && object.plugin != "heterogeneous" {
            let message = format!("the {} is not supported; its mean replaces it", object.describe());
            context.warn(object.at, message);
        }
        // Mitsuba 0.x may give scattering and absorption separately. A heterogeneous medium ends at the box of its
        // extinction, even if that is constant.
        let is_boxed = object.plugin == "heterogeneous" && !context.document.is_old;
        let contents = if object.has("sigma_s") || object.has("sigma_a") {
            coefficients(context, textures, object)?
        } else {
            extinction_and_albedo(
                context,
                textures,
                object,
                if object.has("density") { "density" } else { "sigma_t" },
                is_boxed,
            )?
        };
        let scale = object.float_at_least("scale", 0.0, 1.0)? as f32;
        let scaled = |coefficient: Spectrum| (coefficient * scale).min(Spectrum::splat(1e30));
        if contents.variation.is_some() && object.plugin == "homogeneous" {
            context.warn(
                object.at,
                "the medium is called homogeneous, but varies in space: it is rendered as one that varies",
            );
        }
        let g = asymmetry(context, object)?;
        let medium = Medium {
            name: object.label(),
            absorption: scaled(contents.absorption),
            scattering: scaled(contents.scattering),
            emission: Spectrum::ZERO,
            g: g as f32,
            variation: contents.variation.map(Arc::new),
        };
        let made = MediumId(self.list.len() as u32);
        self.list.push(medium);
        self.ids.insert(id, made);
        Ok(made)
    }
}

/// Reads `sigma_s` and `sigma_a`.
fn coefficients(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<MediumContents> {
    let scattering = field(context, textures, object, "sigma_s", ColorRole::Unbounded, Spectrum::ZERO)?;
    let absorption = field(context, textures, object, "sigma_a", ColorRole::Unbounded, Spectrum::ZERO)?;
    let ((MediumField::Grid(_, place), _) | (_, MediumField::Grid(_, place))) = (&scattering, &absorption) else {
        return Ok(MediumContents { absorption: absorption.mean(), scattering: scattering.mean(), variation: None });
    };
    let grid_from_world = *place;
    if matches!(&absorption, MediumField::Grid(_, place) if *place != grid_from_world) {
        context.warn(object.at, "`sigma_a` is assumed to fill the same box as `sigma_s`");
    }
    let ((scattering, scattering_grid), (absorption, absorption_grid)) =
        (scattering.into_factor_and_grid(), absorption.into_factor_and_grid());
    let density = Density::Each { absorption: absorption_grid, scattering: scattering_grid };
    Ok(MediumContents {
        absorption,
        scattering,
        variation: Some(Variation { density, emission: None, grid_from_world }),
    })
}

/// Reads the extinction, named `density`, and `albedo`.
///
/// - `is_boxed`: the medium is empty outside of the extinction's box.
fn extinction_and_albedo(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
    density: &str,
    is_boxed: bool,
) -> ImportResult<MediumContents> {
    if let Some(name) = object.string("material")? {
        let message = format!("the substance `{}` is unknown; a gray fog replaces it", shortened(name));
        context.warn(object.at, message);
    }
    let extinction = field(context, textures, object, density, ColorRole::Unbounded, Spectrum::ONE)?;
    let albedo = field(context, textures, object, "albedo", ColorRole::Reflectance, Spectrum::splat(0.75))?;
    let mean_albedo = albedo.mean().min(Spectrum::ONE);
    let mut coefficient = Spectrum::ONE;
    let of = |extinction: Spectrum, variation| {
        let scattering = extinction * mean_albedo;
        MediumContents { absorption: (extinction - scattering).max(Spectrum::ZERO), scattering, variation }
    };
    let (grid, grid_from_world) = match extinction {
        MediumField::Grid(grid, place) => (grid, place),
        MediumField::Constant(extinction) if is_boxed => {
            coefficient = extinction;
            (Grid::one(), box_of(context, object, density)?)
        }
        MediumField::Constant(extinction) => {
            if matches!(albedo, MediumField::Grid(..)) {
                context.warn(object.at, "the albedo varies in space, but the extinction does not: its mean is used");
            }
            return Ok(of(extinction, None));
        }
    };
    let density = match albedo {
        MediumField::Constant(_) => Density::Both(grid),
        MediumField::Grid(albedo, place) => {
            if place != grid_from_world {
                context.warn(object.at, "the albedo is assumed to fill the same box as the extinction");
            }
            Density::WithAlbedo { extinction: grid, albedo }
        }
    };
    Ok(of(coefficient, Some(Variation { density, emission: None, grid_from_world })))
}

/// Reads a coefficient of a medium.
fn field(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
    name: &str,
    role: ColorRole,
    default: Spectrum,
) -> ImportResult<MediumField> {
    let child = object.child(name).filter(|child| context.document.get(child.object).class == Class::Volume);
    let Some(child) = child else {
        return textures.plain_color(context, object, name, role, default).map(MediumField::Constant);
    };
    let volume = context.visit(child.object)?;
    match volume.plugin.as_str() {
        "constvolume" => textures.plain_color(context, volume, "value", role, default).map(MediumField::Constant),
        "gridvolume" => grid_volume(context, volume),
        _ => {
            volume.accept_all();
            let message = format!("the {} is not supported; a default replaces it", volume.describe());
            context.warn(volume.at, message);
            Ok(MediumField::Constant(default))
        }
    }
}

/// Returns the box of a constant volume: world space to the unit cube.
fn box_of(context: &ImportContext<'_>, object: &Object, name: &str) -> ImportResult<Affine3A> {
    let Some(child) = object.child(name) else { return Ok(Affine3A::IDENTITY) };
    let volume = context.document.get(child.object);
    let world_from_box = DAffine3::from_mat4(volume.transform("to_world")?);
    let box_from_world = world_from_box.inverse().as_affine3a();
    if box_from_world.is_finite() {
        Ok(box_from_world)
    } else {
        Err(volume.at.fault("the box of the volume is flat, or out of reach").into())
    }
}

fn grid_volume(context: &mut ImportContext<'_>, volume: &Object) -> ImportResult<MediumField> {
    let blend = match volume.string("filter_type")? {
        Some("nearest") => Blend::Nearest,
        _ => Blend::Linear,
    };
    if volume.string("wrap_mode")?.is_some_and(|mode| mode != "clamp") {
        context.warn(volume.at, "what is beyond the edge of a grid does not reach into it: `wrap_mode` is clamp");
    }
    let location = context.filename(volume)?;
    let bytes = context.resources.read(&location)?;
    let Volume { grid, file_from_cube } =
        volume::read(&bytes, blend).map_err(|error| error.in_file(location.path()))?;
    let mut world_from_grid = DAffine3::from_mat4(context.to_world(volume)?);
    if volume.boolean("use_grid_bbox", false)? {
        world_from_grid *= file_from_cube;
    }
    let grid_from_world = world_from_grid.inverse().as_affine3a();
    if !grid_from_world.is_finite() {
        return Err(volume.at.fault("the box of the grid is flat, or out of reach").into());
    }
    Ok(MediumField::Grid(grid, grid_from_world))
}

/// Returns the mean cosine of the phase function.
fn asymmetry(context: &mut ImportContext<'_>, object: &Object) -> ImportResult<f64> {
    let phase = object.children.iter().find(|child| context.document.get(child.object).class == Class::Phase);
    let Some(child) = phase else { return Ok(0.0) };
    child.used.set(true);
    let phase = context.visit(child.object)?;
    let g = match phase.plugin.as_str() {
        "isotropic" => 0.0,
        "hg" => phase.float("g")?.unwrap_or(0.8),
        _ => {
            let message = format!("the {} is not supported; `isotropic` replaces it", phase.describe());
            context.warn(phase.at, message);
            phase.accept_all();
            0.0
        }
    };
    Ok(g.clamp(-0.999, 0.999))
}
