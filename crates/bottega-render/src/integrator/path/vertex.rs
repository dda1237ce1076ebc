//! A point where a path is scattered.

use super::guidance::Guidance;
use crate::{bsdf::BsdfAt, interaction::Interaction, lights::Receiver};

/// A point where a path is scattered, with all that is known of it.
pub(super) struct PathVertex<'a> {
    pub(super) point: &'a Interaction,
    /// What lights are looked for.
    pub(super) receiver: Receiver,
    pub(super) bsdf: &'a BsdfAt<'a>,
    /// Whether light sampling cannot find anything here.
    pub(super) is_delta_only: bool,
    pub(super) guidance: Guidance<'a>,
}
