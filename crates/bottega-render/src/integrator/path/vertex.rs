//! A vertex where a path scatters.

use super::guidance::Guidance;
use crate::{bsdf::BsdfAt, interaction::Interaction, lights::Receiver};

/// A vertex where a path scatters, with all that is known there.
pub(super) struct PathVertex<'a> {
    /// The interaction at the vertex.
    pub(super) point: &'a Interaction,
    /// The point as light sampling sees it.
    pub(super) receiver: Receiver,
    /// Its BSDF, for `wo` and the path's throughput.
    pub(super) bsdf: &'a BsdfAt<'a>,
    /// `true`: light sampling cannot find anything here, as all lobes are specular.
    pub(super) is_delta_only: bool,
    /// Learned data at the vertex.
    pub(super) guidance: Guidance<'a>,
}
