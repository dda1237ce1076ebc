//! A vertex where a path scatters.

use super::guidance::Guidance;
use crate::vertex::SurfaceVertex;

/// A vertex where a path scatters, with all that is known there.
pub(super) struct PathVertex<'a> {
    /// The point with its BSDF.
    pub(super) surface: SurfaceVertex<'a>,
    /// `true`: light sampling cannot find anything here, as all lobes are specular.
    pub(super) is_delta_only: bool,
    /// Learned data at the vertex.
    pub(super) guidance: Guidance<'a>,
}
