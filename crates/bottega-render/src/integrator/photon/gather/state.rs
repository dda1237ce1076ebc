//! The state of a camera path in photon mapping, and its scattering.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::super::super::transport::{self, widen};
use crate::{
    bsdf::BsdfSample,
    camera::{CameraRay, RayCone},
    density::SolidAnglePdf,
    lights::Receiver,
    prepare::PreparedScene,
    vertex::{LeavingDirection, SurfaceVertex, absorption_behind, leaving_direction},
};

/// The origin of a path segment, which decides how emission at its end counts.
#[derive(Clone, Copy)]
pub(super) enum ArrivalKind {
    /// From the camera, over mirrors and glass at most: emission counts fully.
    Camera,
    /// From a BSDF that is not specular: lights were sampled there, too, so emission counts by MIS.
    Spread {
        receiver: Receiver,
        /// Density that the direction was drawn with.
        pdf: SolidAnglePdf,
        /// `true`: drawn from a sharp lobe; see [`is_sharp`].
        is_sharp: bool,
    },
    /// From such a BSDF over mirrors and glass: photons account for emission, unless the lobe was sharp.
    Mirrored { sharply: bool },
}

/// The state of a path.
#[derive(Clone, Copy)]
pub(super) struct GatherState {
    /// Start of the next ray.
    pub(super) origin: Vec3,
    /// Direction of the next ray; unit length.
    pub(super) direction: Vec3,
    /// Ray cone, for texture filtering.
    pub(super) cone: RayCone,
    /// Distance of the ray's start from the camera, and the length of the next ray.
    pub(super) start: f32,
    pub(super) reach: f32,
    /// Throughput of the path, β.
    pub(super) throughput: Spectrum,
    /// Absorption coefficient of the solid that the path is in, per length.
    pub(super) absorption: Spectrum,
    /// Factor by which radiance was compressed on entering denser solids.
    pub(super) squeezed: f32,
    /// Number of surfaces left.
    pub(super) depth: u32,
    /// Index of the random numbers of the current vertex; distinct for every path of a sample.
    pub(super) vertex: u32,
    /// Origin of the current segment.
    pub(super) comes: ArrivalKind,
    /// `true`: look only for emission at the next surface, and end there.
    pub(super) is_short: bool,
    /// Weight of reflected light at the next surface, in [0, 1]: the rest is already interpolated.
    pub(super) unknown: f32,
}

impl GatherState {
    /// Starts a path at a camera ray.
    pub(super) fn of_camera(ray: &CameraRay) -> Self {
        Self {
            origin: ray.origin,
            direction: ray.direction,
            cone: ray.cone,
            start: ray.start,
            reach: ray.reach,
            throughput: Spectrum::ONE,
            absorption: Spectrum::ZERO,
            squeezed: 1.0,
            depth: 0,
            vertex: 0,
            comes: ArrivalKind::Camera,
            is_short: false,
            unknown: 1.0,
        }
    }
}

/// The light that a path still has to find at its next surface.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Remainder {
    /// None: the path ends.
    Nothing,
    /// Only the emission of the surface.
    Emission,
    /// All light that arrives there.
    Light,
}

/// The share of direct light that light sampling adds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LightShare {
    /// All of it: no path continues to hit emitters.
    All,
    /// The share by MIS; paths that continue and hit emitters add the rest.
    Mis,
}

/// Moves the path on along a sampled direction. Returns `false` where shading normal and surface disagree on its side.
///
/// - `part`: factor of the throughput.
pub(super) fn scatter(
    prepared: &PreparedScene,
    state: &mut GatherState,
    vertex: &SurfaceVertex<'_>,
    sample: &BsdfSample,
    part: f32,
) -> bool {
    let point = vertex.point;
    let Some(LeavingDirection { wi, is_reflection }) = leaving_direction(point, sample) else { return false };
    // Update throughput and medium
    state.throughput *= sample.weight() * part;
    if !is_reflection {
        state.absorption = absorption_behind(point, prepared.material(point.material).1, state.absorption);
        state.squeezed *= sample.eta * sample.eta;
    }
    // Remember the lobe, for the weight of emission at the next surface
    if sample.is_delta() {
        if let ArrivalKind::Spread { is_sharp, .. } = state.comes {
            state.comes = ArrivalKind::Mirrored { sharply: is_sharp };
        }
    } else {
        widen(&mut state.cone, sample.pdf);
        let (receiver, pdf) = (vertex.receiver, SolidAnglePdf::new(sample.pdf));
        state.comes = ArrivalKind::Spread { receiver, pdf, is_sharp: is_sharp(prepared, sample.pdf) };
    }
    // Spawn the next ray
    (state.origin, state.direction) = (point.ray_origin(wi), wi);
    state.depth += 1;
    state.vertex += 1;
    true
}

/// Applies Russian roulette, as in path tracing. Returns `true` if the path survives.
pub(super) fn survives(state: &mut GatherState, u: f32) -> bool {
    /// Number of bounces before Russian roulette starts.
    const SURE: u32 = 3;
    transport::survives(&mut state.throughput, state.squeezed, state.depth <= SURE, u)
}

/// Returns `true` if light in a lobe over mirrors and glass is found by tracing the path on and not by photons: too few
/// photons fall into so narrow a lobe. Each direction uses one of the two.
///
/// - `pdf`: density of the direction by the BSDF, in sr⁻¹.
#[inline(always)]
pub(super) fn is_sharp(prepared: &PreparedScene, pdf: f32) -> bool {
    /// Density of a lobe that covers a sixtieth of the hemisphere: less than one of fifty photons.
    const SHARP: f32 = 10.0;
    // Paths never hit point lights
    pdf >= SHARP && prepared.scene().lights.is_empty()
}
