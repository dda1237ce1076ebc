//! The first surface of each sample, for the layers that show it.
//!
//! The camera ray of a sample is traced once more, so pictures without such layers do not pay for them, and all
//! integrators share the result: the random decisions of a path depend only on the sample.

use bottega_image::{Aov, Layout, SurfaceValues};
use bottega_kernels::{
    Ray,
    compiled::{self, Task},
};

use super::{Integrator, path::PathIntegrator};
use crate::{interaction::Interaction, prepare::PreparedScene, sampler::PixelSampler, segment::SegmentRays};

/// The wanted values of first surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WantedSurface {
    /// `true`: identities for Cryptomattes, too.
    identities: bool,
    /// `true`: motion vectors, too.
    pub(super) motion: bool,
}

impl WantedSurface {
    /// Returns what the layers of a picture need; `None`: nothing.
    pub(crate) fn by(layout: &Layout) -> Option<Self> {
        let wanted = || Self { identities: layout.has_mattes(), motion: layout.aovs().contains(Aov::Motion) };
        layout.has_surfaces().then(wanted)
    }

    /// Returns the values of a surface, without the weight of the sample and its motion.
    pub(super) fn values(self, prepared: &PreparedScene, point: &Interaction, time: f32) -> SurfaceValues {
        let identities = if self.identities { prepared.identities().of(&point.hit, point.material) } else { [0.0; 3] };
        SurfaceValues {
            position: point.p.to_array(),
            geometric_normal: point.facing_ng().to_array(),
            uv: point.first_uv(prepared, time).to_array(),
            motion: [0.0; 4],
            identities,
            weight: 0.0,
        }
    }
}

impl Integrator<'_> {
    /// Returns the first surfaces of samples, given as (x, y, sample index), in their order.
    pub(crate) fn surfaces(&self, samples: &[(u32, u32, u32)], wanted: WantedSurface) -> Vec<SurfaceValues> {
        let (integrator, in_volume) = match self {
            Self::Paths(paths) => (paths, paths.goes_alone()),
            Self::Photons(photons) => (photons.base(), false),
            Self::ByZone(both) => (both.paths(), both.paths().goes_alone()),
        };
        compiled::run(FirstSurfaces { integrator, in_volume, samples, wanted })
    }
}

impl PathIntegrator<'_> {
    /// Returns the first surfaces of samples, given as (x, y, sample index), in their order.
    pub(crate) fn surfaces(&self, samples: &[(u32, u32, u32)], wanted: WantedSurface) -> Vec<SurfaceValues> {
        compiled::run(FirstSurfaces { integrator: self, in_volume: self.goes_alone(), samples, wanted })
    }

    /// Returns the first surface of a sample whose path has neither media nor a time.
    #[inline(always)]
    fn surface(&self, x: u32, y: u32, index: u32, wanted: WantedSurface) -> SurfaceValues {
        let prepared = self.prepared();
        let sampler = PixelSampler::new(self.settings().seed, x, y, index);
        let (camera, weight) = self.camera_ray(&sampler, x, y);
        let ray = Ray { t_max: camera.reach, ..Ray::new(camera.origin, camera.direction) };
        let rays = SegmentRays::of_path(prepared, &sampler, 0);
        let hit = if self.hides_emitters() { rays.intersect_unlit(&ray) } else { rays.intersect(&ray) };
        if hit.is_none() {
            return SurfaceValues { weight, ..SurfaceValues::default() };
        }
        let cone = camera.cone.at(hit.t);
        let point = Interaction::new(prepared, &hit, camera.origin, camera.direction, cone);
        SurfaceValues { weight, ..wanted.values(prepared, &point, 0.0) }
    }
}

/// Samples whose first surfaces are to be found, compiled for the vector unit.
struct FirstSurfaces<'a> {
    integrator: &'a PathIntegrator<'a>,
    /// `true`: the paths have media or a time.
    in_volume: bool,
    samples: &'a [(u32, u32, u32)],
    wanted: WantedSurface,
}

impl Task for FirstSurfaces<'_> {
    type Output = Vec<SurfaceValues>;

    #[inline(always)]
    fn run(self) -> Vec<SurfaceValues> {
        let Self { integrator, in_volume, samples, wanted } = self;
        let surface = |&(x, y, index): &(u32, u32, u32)| {
            if in_volume {
                integrator.surface_in_volume(x, y, index, wanted)
            } else {
                integrator.surface(x, y, index, wanted)
            }
        };
        samples.iter().map(surface).collect()
    }
}
