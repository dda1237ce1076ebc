//! The light on shadow catchers: with all objects, and without those that are no catchers.
//!
//! Both are traced with the same random numbers, so they are equal, bit for bit, where the other objects change nothing.

use bottega_image::CaughtLight;
use bottega_kernels::compiled::{self, Task};

use super::{Integrator, path::PathIntegrator};
use crate::catchers::{CatcherRole, ShadowCatchers};

impl<'a> Integrator<'a> {
    /// Returns this integrator with shadow catchers. Photons know none.
    #[must_use]
    pub(crate) fn with_catchers(self, catchers: Option<&'a ShadowCatchers>) -> Self {
        match self {
            Self::Paths(paths) => Self::Paths(paths.with_catchers(catchers)),
            Self::Photons(_) | Self::ByZone(_) => self,
        }
    }

    /// Returns the light on the catchers that samples see, given as (x, y, sample index), in their order.
    pub(crate) fn caught(&self, samples: &[(u32, u32, u32)]) -> Vec<CaughtLight> {
        let Self::Paths(integrator) = self else { return Vec::new() };
        compiled::run(LightOnCatchers { integrator, samples })
    }
}

/// Samples that see catchers, compiled for the vector unit.
struct LightOnCatchers<'a> {
    integrator: &'a PathIntegrator<'a>,
    samples: &'a [(u32, u32, u32)],
}

impl Task for LightOnCatchers<'_> {
    type Output = Vec<CaughtLight>;

    #[inline(always)]
    fn run(self) -> Vec<CaughtLight> {
        let Self { integrator, samples } = self;
        let Some(catchers) = integrator.catchers() else { return Vec::new() };
        let light = |&(x, y, index): &(u32, u32, u32)| {
            let [with, without] = [CatcherRole::Objects, CatcherRole::Alone(catchers)]
                .map(|role| integrator.trace_volume(x, y, index, role, None));
            if with.is_dropped || without.is_dropped {
                return CaughtLight::default();
            }
            CaughtLight { with: with.values.radiance, without: without.values.radiance }
        };
        samples.iter().map(light).collect()
    }
}
