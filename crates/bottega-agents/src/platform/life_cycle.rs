//! The life cycle of an agent (FIPA00023, section 5).

/// A state of the life cycle of an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[allow(missing_docs, reason = "the words of the standard")]
pub enum LifeCycleState {
    Initiated,
    Active,
    Suspended,
    Waiting,
    Transit,
}

/// A transition between two states of the life cycle of an agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the words of the standard")]
pub enum Transition {
    Invoke,
    Suspend,
    Resume,
    Wait,
    WakeUp,
    Move,
    Execute,
}

impl LifeCycleState {
    /// All states, in the order of the variants.
    pub const ALL: [Self; 5] = [Self::Initiated, Self::Active, Self::Suspended, Self::Waiting, Self::Transit];

    /// Returns the state's name in the standard, in lower case.
    pub fn word(self) -> &'static str {
        match self {
            Self::Initiated => "initiated",
            Self::Active => "active",
            Self::Suspended => "suspended",
            Self::Waiting => "waiting",
            Self::Transit => "transit",
        }
    }

    /// Returns the state with this name in the standard, compared without case. `None`: there is none.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.word().eq_ignore_ascii_case(word))
    }

    /// Returns the transition from this state to `next`; `None`: there is none.
    pub fn transition_to(self, next: Self) -> Option<Transition> {
        match (self, next) {
            (Self::Initiated, Self::Active) => Some(Transition::Invoke),
            (Self::Active, Self::Suspended) => Some(Transition::Suspend),
            (Self::Suspended, Self::Active) => Some(Transition::Resume),
            (Self::Active, Self::Waiting) => Some(Transition::Wait),
            (Self::Waiting, Self::Active) => Some(Transition::WakeUp),
            (Self::Active, Self::Transit) => Some(Transition::Move),
            (Self::Transit, Self::Active) => Some(Transition::Execute),
            _ => None,
        }
    }
}

impl Transition {
    /// Returns true if the agent itself may start the transition.
    pub fn by_agent(self) -> bool {
        matches!(self, Self::Suspend | Self::Wait | Self::Move)
    }

    /// Returns true if the platform may start the transition.
    pub fn by_platform(self) -> bool {
        !matches!(self, Self::Wait | Self::Move)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_change_passes_through_active() {
        for from in LifeCycleState::ALL {
            assert_eq!(LifeCycleState::from_word(&from.word().to_uppercase()), Some(from));
            for to in LifeCycleState::ALL {
                let allowed = from.transition_to(to).is_some();
                let one_is_active = (from == LifeCycleState::Active) != (to == LifeCycleState::Active);
                assert_eq!(allowed, one_is_active && to != LifeCycleState::Initiated, "{from:?} to {to:?}");
            }
        }
    }
}
