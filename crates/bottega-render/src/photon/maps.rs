//! The photon maps of a picture: built once, in parallel, identical on every machine.

use bottega_kernels::compiled;
use glam::Vec3;
use rayon::prelude::*;

use super::{
    arrivals::{Arrivals, LightDirections},
    bounces::{IrradianceMap, IrradiancePlaces},
    bytes::{Reader, Writer},
    estimator::{Estimator, PhotonContribution, is_on_surface},
    irradiance::{IrradianceAt, irradiance_count},
    map::{Nearest, PhotonMap},
    plan::PhotonPlan,
    projection::SHARE,
    record::Photon,
    trace::{TraceRange, TracedPhotons, Tracer, is_alike, visibility_tag},
};
use crate::{extent::Extent, prepare::PreparedScene, settings::PhotonSettings};

/// Photons that one thread traces in a row.
const BATCH: u32 = 4096;
/// Points at which one thread computes irradiance in a row.
const POINTS: usize = 1024;
/// Search radius of caustic photons, as a share of that of other photons.
const CAUSTIC_REACH: f32 = 0.5;
/// Search radius of shadow photons, as a share of that of other photons, and the number of them that must agree.
const VISIBILITY_REACH: f32 = 0.5;
const VISIBILITY_COUNT: u32 = 12;
/// Radius of the first pass of a progressive picture, as a share of the search radius of photons.
const FIRST_RADIUS: f32 = 0.2;
/// α of the radius reduction per pass (Hachisuka et al. 2008, eq. 9): 1 keeps the radius, 0 shrinks it fastest.
const SHRINKING: f32 = 2.0 / 3.0;

/// The photon maps of one pass.
#[derive(Debug)]
pub(crate) struct PhotonMaps {
    /// Caustic photons; without final gathering, also the indirect photons.
    pub(crate) seen: PhotonMap,
    /// Irradiance by all light.
    pub(crate) irradiance: IrradianceMap,
    /// Direct photons. This map and the next one replace the irradiance map if [`PhotonSettings::separate_maps`] is
    /// set.
    pub(crate) direct: PhotonMap,
    /// Indirect photons: scattered at least once by a BSDF that is not specular.
    pub(crate) indirect: PhotonMap,
    /// Directions that indirect light comes from.
    pub(crate) arrivals: Arrivals,
    /// Shadow photons: points where light arrives directly, and points in shadow.
    pub(crate) visibility: PhotonMap,
    /// Density estimator of the picture.
    pub(crate) estimator: Estimator,
    reach: SearchRadius,
}

/// Search radius of photons in [`PhotonMaps::seen`].
#[derive(Clone, Copy, Debug)]
enum SearchRadius {
    /// Share of the radius of the irradiance photons.
    Share(f32),
    /// Length in scene units.
    Length(f32),
}

impl SearchRadius {
    /// Creates a search radius.
    ///
    /// - `value`: the length if `settings` give the radius in scene units, else the share.
    fn new(settings: &PhotonSettings, value: f32) -> Self {
        let is_length = settings.progressive && settings.first_radius.is_some();
        if is_length { Self::Length(value) } else { Self::Share(value) }
    }

    fn value(self) -> f32 {
        let (Self::Share(value) | Self::Length(value)) = self;
        value
    }
}

/// Joins parts in order.
pub(super) fn joined(parts: Vec<IrradiancePlaces>) -> IrradiancePlaces {
    parts.into_iter().fold(IrradiancePlaces::default(), |mut all, part| {
        all.append(part);
        all
    })
}

/// Returns the tracer of all photons of a pass.
pub(crate) fn tracer<'a>(
    prepared: &'a PreparedScene,
    plan: &'a PhotonPlan,
    settings: &PhotonSettings,
    seed: u64,
    pass: u32,
) -> Tracer<'a> {
    let (bounces, with_shadows) = (settings.bounces, settings.shadow_photons);
    Tracer {
        prepared,
        emission: &plan.sources,
        plan: &plan.emission,
        seed,
        pass,
        bounces,
        with_shadows,
        only_caustics: false,
        strength: 1.0,
        projection: None,
    }
}

/// Returns the tracer of caustic photons, which are sent only to mirrors and glass.
pub(crate) fn caustic_tracer<'a>(
    prepared: &'a PreparedScene,
    plan: &'a PhotonPlan,
    settings: &PhotonSettings,
    seed: u64,
) -> Tracer<'a> {
    let projection = Some(plan.projection(prepared, settings.lookouts));
    // The estimator divides by the number of all photons: scale up to it
    let strength = settings.count as f32 / settings.count.div_ceil(SHARE).max(1) as f32;
    let all = tracer(prepared, plan, settings, seed, 0);
    Tracer { with_shadows: false, only_caustics: true, strength, projection, ..all }
}

/// Returns the number of photons of a pass, and the number of additional caustic photons.
pub(crate) fn photon_counts(prepared: &PreparedScene, plan: &PhotonPlan, settings: &PhotonSettings) -> [u32; 2] {
    let is_gathered = settings.final_rays > 0 && !settings.progressive;
    let is_wanted = (settings.agents.is_some() || is_gathered) && settings.count > 0;
    let sent = if is_wanted && !plan.projection(prepared, settings.lookouts).is_empty() {
        settings.count.div_ceil(SHARE)
    } else {
        0
    };
    let are_kept = settings.indirect || settings.shadow_photons || !is_gathered;
    [if settings.agents.is_some() || !are_kept { 0 } else { settings.count }, sent]
}

/// Traces all photons of a pass, on the current thread pool.
pub(crate) fn traced(tracer: Tracer<'_>, count: u32) -> TracedPhotons {
    let batch = |number: u32| {
        let first = number * BATCH;
        compiled::run(TraceRange { tracer, indices: first..count.min(first.saturating_add(BATCH)) })
    };
    let parts: Vec<TracedPhotons> = (0..count.div_ceil(BATCH)).into_par_iter().map(batch).collect();
    parts.into_iter().fold(TracedPhotons::default(), |mut all, part| {
        all.append(part);
        all
    })
}

impl PhotonMaps {
    /// Builds the maps of one pass, on the current thread pool.
    pub(crate) fn new(
        prepared: &PreparedScene,
        plan: &PhotonPlan,
        settings: &PhotonSettings,
        seed: u64,
        pass: u32,
    ) -> Self {
        // Trace photons
        let [count, sent] = photon_counts(prepared, plan, settings);
        let all_light = traced(tracer(prepared, plan, settings, seed, pass), count);
        let caustics = match sent {
            0 => Vec::new(),
            sent => traced(caustic_tracer(prepared, plan, settings, seed), sent).caustic,
        };
        // Build the trees
        let (mut maps, all) = Self::begun(*plan.extent(), settings, pass, all_light, caustics);
        // Precompute irradiance
        if let Some(all) = all {
            let points: Vec<u32> = (0..irradiance_count(&all)).collect();
            let known = points.par_chunks(POINTS).map(|points| {
                let points = points[0]..points[points.len() - 1] + 1;
                compiled::run(IrradianceAt { prepared, estimator: maps.estimator, all: &all, points })
            });
            maps.irradiance = IrradianceMap::new(joined(known.collect()));
        }
        maps
    }

    /// Builds all maps but the irradiance map. Also returns the photons to compute the irradiance from, if it is
    /// wanted.
    pub(crate) fn begun(
        extent: Extent,
        settings: &PhotonSettings,
        pass: u32,
        traced: TracedPhotons,
        caustics: Vec<Photon>,
    ) -> (Self, Option<PhotonMap>) {
        let estimator = Estimator::new(settings, extent);
        let mut maps = Self {
            seen: PhotonMap::default(),
            irradiance: IrradianceMap::default(),
            direct: PhotonMap::default(),
            indirect: PhotonMap::default(),
            arrivals: Arrivals::default(),
            visibility: PhotonMap::new(traced.visibility),
            estimator,
            reach: SearchRadius::Share(1.0),
        };
        let mut all = None;
        let mut reach = 1.0;
        if settings.agents.is_some() {
            maps.seen = PhotonMap::new(caustics);
            reach = CAUSTIC_REACH;
        } else if settings.final_rays > 0 && !settings.progressive {
            let TracedPhotons { direct, indirect, caustic, .. } = traced;
            maps.seen = PhotonMap::new(caustics);
            reach = CAUSTIC_REACH;
            if settings.indirect && !settings.separate_maps {
                all = Some(PhotonMap::new([&*direct, &*indirect, &*caustic].concat()));
            }
            if settings.indirect && (settings.separate_maps || settings.gather_directions) {
                maps.indirect = PhotonMap::new(indirect);
            }
            if settings.indirect && settings.gather_directions {
                maps.arrivals = Arrivals::new(&maps.indirect, &estimator);
            }
            if settings.indirect && settings.separate_maps {
                maps.direct = PhotonMap::new(direct);
            } else {
                maps.indirect = PhotonMap::default();
            }
        } else {
            let indirect = if settings.indirect { traced.indirect } else { Vec::new() };
            maps.seen = PhotonMap::new([indirect, traced.caustic].concat());
        }
        if settings.progressive {
            reach = settings.first_radius.unwrap_or(FIRST_RADIUS) * shrunk(pass);
        }
        maps.reach = SearchRadius::new(settings, reach);
        (maps, all)
    }

    /// Writes all maps.
    pub(crate) fn write(&self, to: &mut Writer) {
        to.value(self.reach.value());
        to.map(&self.seen);
        self.irradiance.write(to);
        [&self.direct, &self.indirect, &self.visibility].into_iter().for_each(|map| to.map(map));
        self.arrivals.write(to);
    }

    /// Reads maps of a picture with these settings and this extent; `None`: not valid.
    pub(crate) fn read(settings: &PhotonSettings, extent: Extent, from: &mut Reader<'_>) -> Option<Self> {
        let reach = SearchRadius::new(settings, from.value()?);
        let (seen, irradiance) = (from.map()?, IrradianceMap::read(from)?);
        let (direct, indirect, visibility) = (from.map()?, from.map()?, from.map()?);
        let (arrivals, estimator) = (Arrivals::read(from)?, Estimator::new(settings, extent));
        Some(Self { seen, irradiance, direct, indirect, arrivals, visibility, estimator, reach })
    }

    /// Returns the memory of the maps, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let maps = [&self.seen, &self.direct, &self.indirect, &self.visibility];
        maps.map(PhotonMap::memory_bytes).into_iter().sum::<usize>()
            + self.irradiance.memory_bytes()
            + self.arrivals.memory_bytes()
    }

    /// Returns the search radius of photons in `seen`, in scene units.
    #[inline(always)]
    pub(crate) fn reach_at(&self, p: Vec3) -> f32 {
        match self.reach {
            SearchRadius::Share(share) => share * self.estimator.reach_at(p),
            SearchRadius::Length(length) => length,
        }
    }

    /// Returns the search radius of irradiance places, in scene units.
    #[inline(always)]
    pub(crate) fn irradiance_reach_at(&self, p: Vec3) -> f32 {
        self.estimator.reach_at(p)
    }

    /// Returns the number in [`Self::irradiance`] of the nearest place on the surface of a point; `None`: none near
    /// enough. Places off the plane of the surface belong to another one, such as the floor below a shelf.
    #[inline(always)]
    pub(crate) fn irradiance_near(&self, p: Vec3, normal: Vec3) -> Option<u32> {
        let reach = self.irradiance_reach_at(p);
        let places = self.irradiance.places();
        let accept = |index: u32| is_on_surface(&places.photon(index), p, normal, reach);
        places.nearest_where(p, reach * reach, accept)
    }

    /// Returns the directions that indirect light comes from at a point; `None`: unknown there.
    ///
    /// - `normals`: geometric and shading normal, on the side that the light arrives at.
    #[inline(always)]
    pub(crate) fn arrival_at(&self, p: Vec3, normals: [Vec3; 2]) -> Option<LightDirections<'_>> {
        self.arrivals.at(p, normals, self.irradiance_reach_at(p))
    }

    /// Calls `take` with each photon near a point that arrives on one side, for separate maps. Returns `false` if there
    /// are none.
    ///
    /// - `normal`: of that side.
    #[inline(always)]
    pub(crate) fn all_light_at(
        &self,
        p: Vec3,
        normal: Vec3,
        found: &mut Nearest,
        mut take: impl FnMut(&PhotonContribution),
    ) -> bool {
        let reach = self.irradiance_reach_at(p);
        let mut is_known = false;
        for (map, reach) in [(&self.direct, reach), (&self.indirect, reach), (&self.seen, self.reach_at(p))] {
            self.estimator.gather(map, p, normal, reach, found, |photon| {
                if photon.is_before {
                    take(photon);
                }
                is_known = true;
            });
        }
        is_known
    }

    /// Returns `true` or `false` if enough shadow photons near a point agree that a light is visible or not; `None`:
    /// trace a shadow ray (Jensen and Christensen 1995, *Efficiently Rendering Shadows Using the Photon Map*).
    pub(crate) fn visibility_at(&self, p: Vec3, normal: Vec3, light: u32, found: &mut Nearest) -> Option<bool> {
        let reach = VISIBILITY_REACH * self.irradiance_reach_at(p);
        self.visibility.nearest(p, reach * reach, found);
        let (lit, shaded) = (visibility_tag(light, true), visibility_tag(light, false));
        let (mut lit_count, mut shaded_count) = (0, 0);
        for (index, _) in found.iter() {
            let mark = self.visibility.mark(index);
            if is_alike(mark.normal(), normal) {
                lit_count += u32::from(mark.tag() == lit);
                shaded_count += u32::from(mark.tag() == shaded);
            }
        }
        match (lit_count, shaded_count) {
            (VISIBILITY_COUNT.., 0) => Some(true),
            (0, VISIBILITY_COUNT..) => Some(false),
            _ => None,
        }
    }
}

/// Returns the radius of a pass relative to that of the first one: r²ᵢ₊₁ ∕ r²ᵢ = (i + α) ∕ (i + 1) with i from 1 (Knaus
/// and Zwicker 2011, *Progressive Photon Mapping: A Probabilistic Approach*, eq. 15).
fn shrunk(pass: u32) -> f32 {
    let squared: f64 = (1..=pass).map(|i| (f64::from(i) + f64::from(SHRINKING)) / (f64::from(i) + 1.0)).product();
    squared.sqrt() as f32
}
