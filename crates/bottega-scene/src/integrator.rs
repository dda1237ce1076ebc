//! The integrator that a scene file names.

use serde::{Deserialize, Serialize};

/// The integrator that a file names, and the light paths that it follows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IntegratorHint {
    /// Name in the file.
    pub name: String,
    /// Location in the file, such as `scene.pbrt:3:1`; may be empty.
    pub place: String,
    /// Transport paths that the integrator finds.
    pub follows: TransportPaths,
}

/// The kinds of light path that an integrator follows; the kind selects one of Bottega's integrators.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransportPaths {
    /// Paths from the camera.
    Paths {
        /// `true`: the integrator equals our path tracer, so nothing is replaced.
        is_ours: bool,
    },
    /// Paths from the lights, alone or connected to camera paths. They find point lights seen in mirrors and through
    /// glass.
    BothEnds,
    /// Photon mapping, progressive over passes.
    Photons(PhotonHints),
}

/// Parameters of photon mapping in a file; `None`: not given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhotonHints {
    /// Number of photons emitted in each pass.
    pub count: Option<u32>,
    /// Gather radius of the first pass, in scene units.
    pub radius: Option<f32>,
    /// Maximal gather radius, as a share of the scene's radius.
    pub radius_share: Option<f32>,
    /// Number of nearest photons in an estimate.
    pub gather: Option<u32>,
}
