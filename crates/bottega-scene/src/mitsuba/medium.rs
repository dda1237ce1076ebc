//! Participating media.

use std::sync::Arc;

use glam::{Affine3A, DAffine3};

use super::color::ColorRole;
use super::document::{Class, Object, ObjectId};
use super::importer::Importer;
use super::volume::{self, Volume};
use crate::{Blend, Density, Grid, Medium, MediumId, SceneError, Spectrum, Variation};

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

impl Importer<'_> {
    /// Converts a medium. `None`: it has no effect.
    pub(super) fn medium(&mut self, id: ObjectId) -> Result<Option<MediumId>, SceneError> {
        if let Some(&known) = self.media.get(&id) {
            return Ok(Some(known));
        }
        let object = self.visit(id)?;
        if object.plugin != "homogeneous" && object.plugin != "heterogeneous" {
            let message = format!("the {} is not supported; its mean stands for it", object.describe());
            self.report.warn(object.at, message);
        }
        let is_given = |name: &str| object.property(name).is_some() || object.child(name).is_some();
        // Mitsuba 0.x may give scattering and absorption separately. A heterogeneous medium ends at the box of its
        // extinction, even if that is constant.
        let is_boxed = object.plugin == "heterogeneous" && !self.document.is_old;
        let stuff = if is_given("sigma_s") || is_given("sigma_a") {
            self.coefficients(object)?
        } else {
            self.extinction_and_albedo(object, if is_given("density") { "density" } else { "sigma_t" }, is_boxed)?
        };
        let scale = self.number_at_least(object, "scale", 0.0, 1.0)? as f32;
        let scaled = |coefficient: Spectrum| (coefficient * scale).min(Spectrum::splat(1e30));
        if stuff.variation.is_some() && object.plugin == "homogeneous" {
            self.report
                .warn(object.at, "the medium is called homogeneous, but varies in space: it is painted as it is");
        }
        let g = self.asymmetry(object)?;
        let medium = Medium {
            name: object.label(),
            absorption: scaled(stuff.absorption),
            scattering: scaled(stuff.scattering),
            emission: Spectrum::ZERO,
            g: g as f32,
            variation: stuff.variation.map(Arc::new),
        };
        let made = self.scene.push_medium(medium);
        self.media.insert(id, made);
        Ok(Some(made))
    }

    /// Reads `sigma_s` and `sigma_a`.
    fn coefficients(&mut self, object: &Object) -> Result<MediumContents, SceneError> {
        let scattering = self.field(object, "sigma_s", ColorRole::Unbounded, Spectrum::ZERO)?;
        let absorption = self.field(object, "sigma_a", ColorRole::Unbounded, Spectrum::ZERO)?;
        let ((MediumField::Grid(_, place), _) | (_, MediumField::Grid(_, place))) = (&scattering, &absorption) else {
            return Ok(MediumContents {
                absorption: absorption.mean(),
                scattering: scattering.mean(),
                variation: None,
            });
        };
        let grid_from_world = *place;
        if matches!(&absorption, MediumField::Grid(_, place) if *place != grid_from_world) {
            self.report.warn(object.at, "`sigma_a` is taken to fill the same box as `sigma_s`");
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
        &mut self,
        object: &Object,
        density: &str,
        is_boxed: bool,
    ) -> Result<MediumContents, SceneError> {
        if let Some(name) = self.bad(object.string("material"))? {
            let message =
                format!("the substance `{}` is not known; a gray fog stands for it", crate::text::shortened(name));
            self.report.warn(object.at, message);
        }
        let extinction = self.field(object, density, ColorRole::Unbounded, Spectrum::ONE)?;
        let albedo = self.field(object, "albedo", ColorRole::Reflectance, Spectrum::splat(0.75))?;
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
                (Grid::one(), self.box_of(object, density)?)
            }
            MediumField::Constant(extinction) => {
                if matches!(albedo, MediumField::Grid(..)) {
                    self.report
                        .warn(object.at, "the albedo varies in space, but the extinction does not: its mean is taken");
                }
                return Ok(of(extinction, None));
            }
        };
        let density = match albedo {
            MediumField::Constant(_) => Density::Both(grid),
            MediumField::Grid(albedo, place) => {
                if place != grid_from_world {
                    self.report.warn(object.at, "the albedo is taken to fill the same box as the extinction");
                }
                Density::WithAlbedo { extinction: grid, albedo }
            }
        };
        Ok(of(coefficient, Some(Variation { density, emission: None, grid_from_world })))
    }

    /// Reads a coefficient of a medium.
    fn field(
        &mut self,
        object: &Object,
        name: &str,
        role: ColorRole,
        default: Spectrum,
    ) -> Result<MediumField, SceneError> {
        let child = object.child(name).filter(|child| self.document.get(child.object).class == Class::Volume);
        let Some(child) = child else {
            return self.plain_color(object, name, role, default).map(MediumField::Constant);
        };
        let volume = self.visit(child.object)?;
        match volume.plugin.as_str() {
            "constvolume" => self.plain_color(volume, "value", role, default).map(MediumField::Constant),
            "gridvolume" => self.grid_volume(volume),
            _ => {
                self.accept_all(volume);
                let message = format!("the {} is not supported; a default stands for it", volume.describe());
                self.report.warn(volume.at, message);
                Ok(MediumField::Constant(default))
            }
        }
    }

    /// Returns the box of a constant volume: world space to the unit cube.
    fn box_of(&self, object: &Object, name: &str) -> Result<Affine3A, SceneError> {
        let Some(child) = object.child(name) else { return Ok(Affine3A::IDENTITY) };
        let volume = self.document.get(child.object);
        let world_from_box = DAffine3::from_mat4(self.bad(volume.transform("to_world"))?);
        let box_from_world = world_from_box.inverse().as_affine3a();
        if box_from_world.is_finite() {
            Ok(box_from_world)
        } else {
            Err(self.report.invalid(volume.at, "the box of the volume is flat, or out of reach"))
        }
    }

    fn grid_volume(&mut self, volume: &Object) -> Result<MediumField, SceneError> {
        let blend = match self.bad(volume.string("filter_type"))? {
            Some("nearest") => Blend::Nearest,
            _ => Blend::Linear,
        };
        if self.bad(volume.string("wrap_mode"))?.is_some_and(|mode| mode != "clamp") {
            self.report
                .warn(volume.at, "what is beyond the edge of a grid does not reach into it: `wrap_mode` is clamp");
        }
        let location = self.filename(volume)?;
        let bytes = self.resources.read(&location)?;
        let Volume { grid, file_from_cube } = volume::read(&bytes, blend)
            .map_err(|problem| SceneError::Damaged { path: location.path().into(), problem })?;
        let mut world_from_grid = DAffine3::from_mat4(self.to_world(volume)?);
        if self.bad(volume.boolean("use_grid_bbox", false))? {
            world_from_grid *= file_from_cube;
        }
        let grid_from_world = world_from_grid.inverse().as_affine3a();
        if !grid_from_world.is_finite() {
            return Err(self.report.invalid(volume.at, "the box of the grid is flat, or out of reach"));
        }
        Ok(MediumField::Grid(grid, grid_from_world))
    }

    /// Returns the mean cosine of the phase function.
    fn asymmetry(&mut self, object: &Object) -> Result<f64, SceneError> {
        let phase = object.children.iter().find(|child| self.document.get(child.object).class == Class::Phase);
        let Some(child) = phase else { return Ok(0.0) };
        child.used.set(true);
        let phase = self.visit(child.object)?;
        let g = match phase.plugin.as_str() {
            "isotropic" => 0.0,
            "hg" => self.bad(phase.float("g"))?.unwrap_or(0.8),
            _ => {
                let message = format!("the {} is not supported; `isotropic` stands for it", phase.describe());
                self.report.warn(phase.at, message);
                self.accept_all(phase);
                0.0
            }
        };
        Ok(g.clamp(-0.999, 0.999))
    }
}
