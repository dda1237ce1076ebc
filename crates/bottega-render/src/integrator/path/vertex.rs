//! A vertex where a path scatters.

use super::guidance::Guidance;
use crate::{bsdf::BsdfAt, interaction::Interaction, lights::Receiver};

/// A vertex where a path scatters, with all that is known there.
pub(super) struct PathVertex<'a> {
    pub(super) point: &'a Interaction,
    /// The point as light sampling sees it.
    pub(super) receiver: Receiver,
    pub(super) bsdf: &'a BsdfAt<'a>,
    /// `true`: light sampling cannot find anything here, as all lobes are specular.
    pub(super) is_delta_only: bool,
    pub(super) guidance: Guidance<'a>,
}
