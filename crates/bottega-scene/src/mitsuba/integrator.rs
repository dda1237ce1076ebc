//! Integrators of a Mitsuba scene: the technique and its depth.

use super::document::{Class, Object, ObjectId};
use super::importer::{Importer, Manner};
use crate::{Follows, IntegratorHint, PhotonHints, SceneError, Spectrum, Surface};

impl Importer<'_> {
    /// Reads the integrator: which of ours replaces it, and the number of bounces.
    pub(super) fn read_integrator(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let object = self.visit(id)?;
        if matches!(object.plugin.as_str(), "aov" | "moment" | "adaptive" | "irrcache" | "multichannel" | "stokes") {
            return self.read_inner_integrator(object);
        }
        let depth = self.bad(object.integer("max_depth"))?.unwrap_or(-1);
        // Mitsuba counts the edges of a path: 1 is emission, 2 direct light.
        let mut bounces = u32::try_from(depth).map_or(u32::MAX, |depth| depth.saturating_sub(1));
        let hides_emitters = self.bad(object.boolean("hide_emitters", false))?;
        let mut follows = Follows::Paths { is_ours: true };
        let mut is_known = true;
        match object.plugin.as_str() {
            "path" | "volpath" | "volpathmis" | "volpath_simple" => {}
            "direct" => {
                bounces = 1;
                for name in ["emitter_samples", "bsdf_samples", "luminaire_samples"] {
                    if self.bad(object.integer(name))? == Some(0) {
                        self.report.warn(object.at, format!("light is found in every way, though `{name}` is 0"));
                    }
                }
            }
            "prb" | "prb_basic" | "prb_projective" | "prbvolpath" => {
                follows = Follows::Paths { is_ours: false };
                self.accept_all(object);
            }
            "direct_projective" => {
                (follows, bounces) = (Follows::Paths { is_ours: false }, 1);
                self.accept_all(object);
            }
            "bdpt" | "mlt" | "pssmlt" | "erpt" | "ptracer" | "vpl" => {
                follows = Follows::BothEnds;
                self.accept_all(object);
            }
            "photonmapper" | "ppm" | "sppm" => follows = Follows::Photons(self.photon_hints(object)?),
            _ => {
                let message = format!("the {} is not supported; paths are traced instead", object.describe());
                self.report.warn(object.at, message);
                self.accept_all(object);
                is_known = false;
            }
        }
        if self.hints.max_depth.is_some() {
            return Ok(());
        }
        self.hints.max_depth = Some(bounces);
        let place = self.report.show(object.at);
        self.hints.integrator = is_known.then(|| IntegratorHint { name: object.plugin.clone(), place, follows });
        let follows_media =
            matches!(object.plugin.as_str(), "volpath" | "volpathmis" | "volpath_simple" | "prbvolpath");
        self.manner = Manner {
            sees_through_panes: follows_media,
            ignores_media: is_known && !follows_media && !matches!(object.plugin.as_str(), "bdpt" | "photonmapper"),
            at: object.at,
            hides_emitters,
        };
        Ok(())
    }

    /// Reads the nested integrator of one that only processes its result.
    fn read_inner_integrator(&mut self, object: &Object) -> Result<(), SceneError> {
        self.accept_all(object);
        let inner = object.children.iter().find(|child| self.document.get(child.object).class == Class::Integrator);
        // `adaptive` only controls the sample count.
        if object.plugin != "adaptive" {
            let message = format!("the {} is not supported; only what it colours is painted", object.describe());
            self.report.warn(object.at, message);
        }
        inner.map_or(Ok(()), |child| self.read_integrator(child.object))
    }

    /// Reads the parameters of Mitsuba 0.x's photon mappers.
    fn photon_hints(&mut self, object: &Object) -> Result<PhotonHints, SceneError> {
        let count = |importer: &Self, name: &str| -> Result<Option<u32>, SceneError> {
            let number = importer.bad(object.integer(name))?;
            Ok(number.and_then(|number| u32::try_from(number).ok()).filter(|&number| number > 0))
        };
        let positive = |importer: &Self, name: &str| -> Result<Option<f32>, SceneError> {
            let number = importer.bad(object.float(name))?.map(|number| number as f32);
            Ok(number.filter(|number| *number > 0.0 && number.is_finite()))
        };
        // Its passes are our samples.
        if let Some(passes) = count(&*self, "max_passes")? {
            self.hints.samples = Some(passes.min(1 << 24));
        }
        Ok(PhotonHints {
            count: count(&*self, "photon_count")?,
            radius: positive(&*self, "initial_radius")?,
            radius_share: positive(&*self, "global_lookup_radius")?,
            gather: count(&*self, "lookup_size")?,
        })
    }

    /// Applies the integrator's effects to the finished scene.
    pub(super) fn apply_manner(&mut self) {
        let Manner { sees_through_panes, ignores_media, hides_emitters, at } = self.manner;
        for camera in &mut self.scene.cameras {
            camera.hides_emitters = hides_emitters;
        }
        for material in &mut self.scene.materials {
            material.see_through = sees_through_panes && material.has_clear_sheet();
        }
        if !ignores_media {
            return;
        }
        if self.scene.leave_out_media() {
            self.report.note(at, "the integrator of the file knows no media: they are left out");
        }
        // Without media, their boundaries are bounces and hide lights.
        for material in self.scene.materials.iter_mut().filter(|material| material.surface == Surface::Null) {
            material.surface = Surface::clear_sheet(Spectrum::ONE.into());
        }
    }
}
