//! Lights at infinity as paths find them that leave the scene.

use bottega_scene::{Scene, Spectrum, Visibility};
use glam::Vec3;

use super::{Choice, Lights, Receiver, environment::EnvironmentLight};
use crate::density::SolidAnglePdf;

/// A light at infinity that paths find when they leave the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) enum FarLight {
    Environment,
    /// Index in [`Lights::suns`].
    Sun(usize),
}

impl Lights {
    /// Calls `add` with the radiance of each light at infinity that a ray of this kind sees along a direction of unit length.
    #[inline(always)]
    pub(crate) fn each_far(
        &self,
        scene: &Scene,
        from: Vec3,
        direction: Vec3,
        ray: Visibility,
        mut add: impl FnMut(FarLight, Spectrum),
    ) {
        let environment = self.environment.as_ref().filter(|light| light.visibility.has(ray));
        let radiance = environment.map_or(Spectrum::ZERO, |light| light.radiance_at(scene, from, direction));
        if radiance != Spectrum::ZERO {
            add(FarLight::Environment, radiance);
        }
        for (index, sun) in self.suns.iter().enumerate() {
            if sun.covers(direction) && sun.visibility.has(ray) {
                add(FarLight::Sun(index), sun.radiance());
            }
        }
    }

    /// Returns the density with which light sampling draws a direction towards a light at infinity: by the mixture of
    /// [`Self::sample_by`], or by [`Self::sample`] without a choice.
    pub(crate) fn far_pdf(
        &self,
        receiver: &Receiver,
        choice: Option<&Choice>,
        light: FarLight,
        direction: Vec3,
    ) -> SolidAnglePdf {
        let importance = match light {
            FarLight::Environment => self.environment.as_ref().map_or(0.0, |light| light.illuminance(receiver.p)),
            FarLight::Sun(index) => self.suns[index].importance(receiver),
        };
        let total = self.far_total(receiver);
        if importance <= 0.0 || total <= 0.0 {
            return SolidAnglePdf::ZERO;
        }
        let share = match choice.filter(|choice| choice.has_share()) {
            None => self.far_share(receiver),
            Some(choice) => self.far_share_by(receiver, choice),
        };
        let pmf = share * importance / total;
        let of_environment = |light: &EnvironmentLight| light.pdf_at(receiver.p, direction);
        pmf * match light {
            FarLight::Environment => self.environment.as_ref().map_or(SolidAnglePdf::ZERO, of_environment),
            FarLight::Sun(index) => self.suns[index].pdf(),
        }
    }
}
