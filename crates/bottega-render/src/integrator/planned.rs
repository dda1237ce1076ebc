//! Samples of a picture whose zones are painted in different ways.

use super::path::{PathIntegrator, PlannedWays};

/// Who paints some samples.
pub(super) enum SampleIntegrators<'a, 'b> {
    /// The same for all.
    One(&'a PathIntegrator<'b>),
    /// Another one in each zone.
    ByPixel(&'a PlannedWays<'b>),
}

impl<'a, 'b> SampleIntegrators<'a, 'b> {
    /// - `ways`: of the picture, where its zones are painted in different ways.
    pub(super) fn new(
        integrator: &'a PathIntegrator<'b>,
        ways: Option<&'a PlannedWays<'b>>,
        samples: &[(u32, u32, u32)],
    ) -> Self {
        match ways {
            None => Self::One(integrator),
            Some(ways) => ways.of_all(samples).map_or(Self::ByPixel(ways), Self::One),
        }
    }

    /// Who paints a pixel.
    #[inline(always)]
    pub(super) fn of_pixel(&self, x: u32, y: u32) -> &'a PathIntegrator<'b> {
        match self {
            Self::One(integrator) => integrator,
            Self::ByPixel(ways) => ways.of_pixel(x, y),
        }
    }

    /// Whether agents are asked for more than directions. Whoever knows none has the same bits either way.
    pub(super) fn ask_agents(&self) -> bool {
        match self {
            Self::One(integrator) => integrator.asks_agents(),
            Self::ByPixel(_) => true,
        }
    }
}
