//! Work units on their way in, answers on their way out.

use std::time::Duration;

use crate::{DataId, Primitive, ResourceId};

/// Something that a resource can compute: which primitive, on what data, how much of it.
///
/// A value refers to its data (an `Arc` of a scene, say) and carries neither scene nor code. It is read by one
/// resource at a time, moved in, and its output is moved out.
pub trait Work: Send + Sized + 'static {
    /// What comes out.
    type Output: Send + 'static;

    /// The function asked for.
    fn primitive(&self) -> Primitive;

    /// Amount of work, in the primitive's items: rays, samples or photons. The cost model is per item.
    fn size(&self) -> u64;

    /// The read-only data that the work needs, if it is worth keeping resident.
    fn data(&self) -> Option<DataId> {
        None
    }

    /// Bytes of [`Work::data`] in the memory of a resource. A resource with less memory never gets the unit.
    fn data_bytes(&self) -> u64 {
        0
    }

    /// Bytes that must travel to a resource that already holds [`Work::data`].
    fn payload_bytes(&self) -> u64 {
        0
    }

    /// Bytes that its answer takes on the way back.
    fn answer_bytes(&self) -> u64 {
        0
    }

    /// A copy to go back to when a resource dies in the middle of the work (a panic, a lost link). It is taken
    /// before each attempt, so it must be cheap beside the work itself. `None`: such a unit is not tried again, and
    /// answered by [`UnitError::Lost`].
    fn backup(&self) -> Option<Self> {
        None
    }

    /// Whether `output` can be what came of work of `size` items: a look for garbage (a wrong length, numbers that are
    /// none), much cheaper than the work. What it refuses is done again, elsewhere, if there is a [`Work::backup`].
    /// Must not be chosen so strictly that a sound resource is refused: that would be given up in the end.
    fn check(output: &Self::Output, size: u64) -> Result<(), String> {
        let (_, _) = (output, size);
        Ok(())
    }
}

/// Work with what the allocator must know to place it in time.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkUnit<W> {
    /// What is to be done.
    pub work: W,
    /// The caller's own number; comes back with the answer. Need not be unique.
    pub ticket: u64,
    /// Longest wait in the bin. As soon as what waits could not be done before then, the unit goes before all that are
    /// not late themselves, the latest first. Cut to [`HraConfig::max_delay_bound`](crate::HraConfig::max_delay_bound),
    /// so that nothing starves.
    pub max_delay: Duration,
    /// Higher goes first among units that are not late.
    pub priority: i32,
    /// Life time. A unit that is not done so long after it was submitted is answered by [`UnitError::Expired`]: at
    /// that time if it still waits, else when its resource answers or is given up.
    pub validity: Duration,
}

impl<W> WorkUnit<W> {
    /// A unit of priority 0 that may wait as long as the allocator lets any unit wait, and does not expire.
    pub fn new(work: W, ticket: u64) -> Self {
        Self { work, ticket, max_delay: Duration::MAX, priority: 0, validity: Duration::MAX }
    }
}

/// The answer to one unit. Every submitted unit that is not cancelled gets exactly one.
#[derive(Clone, Debug)]
pub struct Completed<O> {
    /// The number that the caller gave.
    pub ticket: u64,
    /// What was computed, or why it was not.
    pub output: Result<O, UnitError>,
    /// Time that the last attempt took of its resource; the mean of several units where each takes less than some microsecond.
    pub busy: Duration,
    /// Time between submission and the start of the last attempt.
    pub waited: Duration,
    /// Who made the last attempt; `None` when there was none.
    pub resource: Option<ResourceId>,
}

/// Why a unit has no output.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// Tried as often as the configuration allows.
    #[error("failed {attempts} times, at last because: {reason}")]
    Failed {
        /// How many resources, or times, it was tried.
        attempts: u32,
        /// What the last of them said.
        reason: String,
    },
    /// The resource was lost together with the unit, which has no [`Work::backup`].
    #[error("lost with its resource: {reason}")]
    Lost {
        /// The message of the panic, or what happened to the link.
        reason: String,
    },
    /// Every resource that could have done it was given up.
    #[error("no resource is left that can do `{0}`")]
    NoResource(Primitive),
    /// It was not done within its [`WorkUnit::validity`].
    #[error("not done within its life time")]
    Expired,
    /// The allocator was shut down first.
    #[error("the allocator was shut down")]
    Closed,
}

/// A resource could not do the work and gives it back unchanged.
#[derive(Clone, Debug)]
pub struct Failed<W> {
    /// The unit's work, as it was received.
    pub work: W,
    /// What went wrong, for the user.
    pub reason: String,
}

/// The allocator was shut down.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the allocator was shut down")]
pub struct Closed;

/// Why units were not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SubmitError {
    /// The allocator was shut down.
    #[error(transparent)]
    Closed(#[from] Closed),
    /// No resource can do this, so the unit would wait for ever.
    #[error("no resource can do `{0}`")]
    Unsupported(Primitive),
    /// No resource that could do this has enough memory for the data.
    #[error("no resource that can do `{primitive}` has memory for {bytes} bytes of data")]
    TooLarge {
        /// What was asked for.
        primitive: Primitive,
        /// On so much data.
        bytes: u64,
    },
}

/// Why one unit was not taken without waiting; gives it back.
#[derive(Clone, Debug, thiserror::Error)]
pub enum TrySubmit<W> {
    /// The bin is full just now.
    #[error("the work bin is full")]
    Full(WorkUnit<W>),
    /// It will never be taken.
    #[error("{reason}")]
    Refused {
        /// The unit.
        unit: WorkUnit<W>,
        /// Why.
        reason: SubmitError,
    },
}
