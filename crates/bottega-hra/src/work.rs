//! Work units and their answers.

use std::time::Duration;

use crate::{DataId, Primitive, ResourceId};

/// A computation for a resource: a primitive, its data, and its size.
///
/// A value refers to its data (for example an `Arc` of a scene) and contains neither scene nor code. It is used by one
/// resource at a time: the value is moved in, and its output is moved out.
pub trait Work: Send + Sized + 'static {
    /// The result of a unit.
    type Output: Send + 'static;

    /// Returns the primitive that a resource must support to do the unit.
    fn primitive(&self) -> Primitive;

    /// Returns the amount of work, in the primitive's items: rays, samples or photons. The cost model is per item.
    fn size(&self) -> u64;

    /// Returns the id of the read-only data that the work needs, if it is worth keeping in a resource's memory; `None`:
    /// there is no such data.
    fn data(&self) -> Option<DataId> {
        None
    }

    /// Returns the size of [`Work::data`] in the memory of a resource, in bytes. A resource with less memory never
    /// gets the unit.
    fn data_bytes(&self) -> u64 {
        0
    }

    /// Returns the number of bytes to send to a resource that already holds [`Work::data`].
    fn payload_bytes(&self) -> u64 {
        0
    }

    /// Returns the number of bytes of the work's answer.
    fn answer_bytes(&self) -> u64 {
        0
    }

    /// Returns a copy for another attempt if a resource dies during the work (a panic, a lost link). Made before each
    /// attempt, so it must be cheap compared with the work. `None`: the unit is not attempted again, but answered by
    /// [`UnitError::Lost`].
    fn backup(&self) -> Option<Self> {
        None
    }

    /// Checks whether `output` can be the result of work of `size` items, much faster than the work itself. Rejected
    /// work is done again elsewhere, if there is a [`Work::backup`]. Must not reject valid output: the resource is
    /// given up in the end.
    ///
    /// # Errors
    /// The output is invalid (wrong length, NaN), with the reason for the user.
    fn check(output: &Self::Output, size: u64) -> Result<(), String> {
        let (_, _) = (output, size);
        Ok(())
    }
}

/// A work unit: work with all that the allocator needs to schedule it.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkUnit<W> {
    /// The work to do.
    pub work: W,
    /// The caller's own number, returned with the answer. Need not be unique.
    pub ticket: u64,
    /// Maximum time in the bin. Once it can no longer be met, the unit goes before all units that are not late, the
    /// latest first. Bounded by [`HraConfig::max_delay_bound`](crate::HraConfig::max_delay_bound), so that no unit
    /// starves.
    pub max_delay: Duration,
    /// Priority among units that are not late; higher goes first.
    pub priority: i32,
    /// Life time. A unit not done by then, counted from its submission, is answered by [`UnitError::Expired`]:
    /// immediately if it still waits, else when its resource answers or is given up.
    pub validity: Duration,
}

impl<W> WorkUnit<W> {
    /// Makes a unit of priority 0 with the longest possible maximum delay, which does not expire.
    ///
    /// - `ticket`: the caller's own number, returned with the answer. Need not be unique.
    pub fn new(work: W, ticket: u64) -> Self {
        Self { work, ticket, max_delay: Duration::MAX, priority: 0, validity: Duration::MAX }
    }
}

/// The answer to a unit. Every submitted unit that is not cancelled gets exactly one.
#[derive(Clone, Debug)]
pub struct Completed<O> {
    /// The unit's ticket.
    pub ticket: u64,
    /// The output, or the error.
    pub output: Result<O, UnitError>,
    /// Time of the last attempt on its resource: the mean of several units if each takes less than about a microsecond.
    /// For a far resource the unit's share, by size, of the packet's time, or of the time until its answer if the
    /// resource measured none.
    pub busy: Duration,
    /// Time between submission and the start of the last attempt.
    pub waited: Duration,
    /// The resource of the last attempt; `None` if there was none.
    pub resource: Option<ResourceId>,
}

/// The reason why a unit has no output.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// The unit failed as often as the configuration allows.
    #[error("failed {attempts} times; the last reason: {reason}")]
    Failed {
        /// Number of attempts.
        attempts: u32,
        /// The error of the last attempt.
        reason: String,
    },
    /// The resource was lost together with the unit, which has no [`Work::backup`].
    #[error("lost with its resource: {reason}")]
    Lost {
        /// The message of the panic, or the fault of the link.
        reason: String,
    },
    /// Every resource that could do it was given up.
    #[error("no resource is left that can do `{0}`")]
    NoResource(Primitive),
    /// The unit was not done within its [`WorkUnit::validity`].
    #[error("not done within its life time")]
    Expired,
    /// The allocator was shut down before.
    #[error("the allocator was shut down")]
    Closed,
}

/// The failure of a resource, which gives the work back unchanged.
#[derive(Clone, Debug)]
pub struct Failed<W> {
    /// The work, as received.
    pub work: W,
    /// The reason, for the user.
    pub reason: String,
}

/// The error of submitting units to an allocator that was shut down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the allocator was shut down")]
pub struct Closed;

/// The reason why units were not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SubmitError {
    /// The allocator was shut down.
    #[error(transparent)]
    Closed(#[from] Closed),
    /// No resource supports this primitive: it cannot be done.
    #[error("no resource can do `{0}`")]
    Unsupported(Primitive),
    /// No resource that supports the primitive has enough memory for the data.
    #[error("no resource that can do `{primitive}` has memory for {bytes} bytes of data")]
    TooLarge {
        /// The primitive requested.
        primitive: Primitive,
        /// Size of the data, in bytes.
        bytes: u64,
    },
}

/// The reason why a unit was not accepted without waiting; gives the unit back.
#[derive(Clone, Debug, thiserror::Error)]
pub enum TrySubmit<W> {
    /// The bin is full at the moment.
    #[error("the work bin is full")]
    Full(WorkUnit<W>),
    /// The unit will never be accepted.
    #[error("{reason}")]
    Refused {
        /// The refused unit, given back.
        unit: WorkUnit<W>,
        /// The reason of the refusal.
        reason: SubmitError,
    },
}
