//! Participating media.

use super::Importer;
use super::color::Role;
use super::document::{Class, Object, ObjectId};
use crate::{Medium, MediumId, SceneError, Spectrum};

impl Importer<'_> {
    /// A medium. `None`: it has no effect.
    pub(super) fn medium(&mut self, id: ObjectId) -> Result<Option<MediumId>, SceneError> {
        if let Some(&known) = self.media.get(&id) {
            return Ok(Some(known));
        }
        let object = self.visit(id)?;
        object.ignore(&["sample_emitters", "has_spectral_extinction", "step_size", "method", "name"]);
        if object.plugin != "homogeneous" && object.plugin != "heterogeneous" {
            let message = format!("the {} is not supported; its mean stands for it", object.describe());
            self.report.warn(object.at, message);
        }
        let (albedo, extinction) = self.coefficients(object)?;
        let scale = self.number_at_least(object, "scale", 0.0, 1.0)? as f32;
        let extinction = (extinction * scale).min(Spectrum::splat(1e30));
        let scattering = extinction * albedo;
        let g = self.asymmetry(object)?;
        let medium = Medium {
            name: object.label(),
            absorption: (extinction - scattering).max(Spectrum::ZERO),
            scattering,
            emission: Spectrum::ZERO,
            g: g as f32,
        };
        let made = self.scene.push_medium(medium);
        self.media.insert(id, made);
        Ok(Some(made))
    }

    /// Albedo, and extinction per unit of length.
    fn coefficients(&mut self, object: &Object) -> Result<(Spectrum, Spectrum), SceneError> {
        let is_given = |name: &str| object.property(name).is_some() || object.child(name).is_some();
        // The old line may give scattering and absorption apart.
        if is_given("sigma_s") || is_given("sigma_a") {
            let scattering = self.volume(object, "sigma_s", Role::Unbounded, Spectrum::ZERO)?;
            let absorption = self.volume(object, "sigma_a", Role::Unbounded, Spectrum::ZERO)?;
            let extinction = scattering + absorption;
            let albedo = Spectrum::select(extinction.cmpgt(Spectrum::ZERO), scattering / extinction, Spectrum::ZERO);
            return Ok((albedo, extinction));
        }
        if let Some(name) = self.bad(object.string("material"))? {
            let message =
                format!("the substance `{}` is not known; a gray fog stands for it", crate::text::shortened(name));
            self.report.warn(object.at, message);
        }
        let density = if is_given("density") { "density" } else { "sigma_t" };
        let extinction = self.volume(object, density, Role::Unbounded, Spectrum::ONE)?;
        Ok((self.volume(object, "albedo", Role::Reflectance, Spectrum::splat(0.75))?, extinction))
    }

    /// A property of a medium; of one that varies in space, its mean.
    fn volume(&mut self, object: &Object, name: &str, role: Role, default: Spectrum) -> Result<Spectrum, SceneError> {
        let child = object.child(name).filter(|child| self.document.get(child.object).class == Class::Volume);
        let Some(child) = child else { return self.plain_color(object, name, role, default) };
        let volume = self.visit(child.object)?;
        match volume.plugin.as_str() {
            "constvolume" => self.plain_color(volume, "value", role, default),
            "gridvolume" => {
                object.ignore(&["filter_type", "wrap_mode"]);
                let location = self.filename(volume)?;
                let bytes = self.resources.read(&location)?;
                let mean = super::volume::mean(&bytes)
                    .map_err(|problem| SceneError::Damaged { path: location.path().into(), problem: problem.into() })?;
                self.accept_all(volume);
                self.report.warn(volume.at, "the medium varies in space; its mean stands for it everywhere");
                let mean = mean.max(Spectrum::ZERO);
                Ok(if role == Role::Reflectance { mean.min(Spectrum::ONE) } else { mean })
            }
            _ => {
                self.accept_all(volume);
                let message = format!("the {} is not supported; a default stands for it", volume.describe());
                self.report.warn(volume.at, message);
                Ok(default)
            }
        }
    }

    /// Mean cosine of the phase function.
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
