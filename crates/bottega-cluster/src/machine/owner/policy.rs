//! The policy by which a machine's owner has precedence: when the machine works for a farm, and when it is suspended.
//!
//! A state machine without a clock: it takes observations, and returns the reason to suspend work, if there is one.

use std::{fmt, time::Duration};

/// An observation of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OwnerObservation {
    /// Minutes since midnight, local time.
    pub(super) minute: u16,
    /// Time since the last input; `None`: unknown.
    pub(super) idle: Option<Duration>,
    /// Time since the last input at a terminal; there may also be users at a screen. `None`: unknown.
    pub(super) terminals: Option<Duration>,
    /// The number of processors that other programs keep busy.
    pub(super) others: f32,
}

/// A part of each day, in local time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DailyHours {
    /// The minute of the day at which it begins.
    pub from: u16,
    /// The minute of the day at which it ends; before `from`: on the next day.
    pub to: u16,
}

/// The owner's conditions for working, all of which must hold. Without any, the machine always works.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnerConditions {
    /// The time without input after which the machine works; `None`: not checked.
    pub when_idle: Option<Duration>,
    /// The hours in which the machine works; empty: all day.
    pub hours: Vec<DailyHours>,
    /// The most processors that other programs may keep busy while the machine works; `None`: not checked. After a higher load,
    /// it works again when the load was low for 30 s.
    pub max_load: Option<f32>,
}

/// The reason why a machine is suspended by its owner's conditions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OwnerReason {
    /// A user is at the machine.
    Present,
    /// The time is outside the hours for work.
    Hours,
    /// Other programs need the processors.
    Load,
}

/// The state of the policy: if the machine may work, and the time since which it is quiet.
#[derive(Clone, Debug)]
pub(super) struct OwnerPolicy {
    conditions: OwnerConditions,
    /// The reason for suspension; `None`: it may work.
    rests: Option<OwnerReason>,
    /// The time for which the load has been low.
    quiet: Duration,
}

/// The time for which the load must be low before work resumes: a compiler's pauses do not mean that it is done.
const QUIET: Duration = Duration::from_secs(30);
/// The number of busy processors that counts as a user at the machine, where the idle time is unknown.
const TOUCHED_LOAD: f32 = 0.15;

impl DailyHours {
    fn contains(self, minute: u16) -> bool {
        match self.from <= self.to {
            true => (self.from..self.to).contains(&minute),
            // The period includes midnight.
            false => minute >= self.from || minute < self.to,
        }
    }
}

impl fmt::Display for OwnerReason {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(match self {
            Self::Present => "somebody is at it",
            Self::Hours => "it is not its time",
            Self::Load => "others need its processors",
        })
    }
}

impl OwnerConditions {
    /// Returns true if there are no conditions.
    pub fn are_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl OwnerPolicy {
    /// Returns the initial state, as after 30 s of low load.
    pub(super) fn new(conditions: OwnerConditions) -> Self {
        Self { conditions, rests: None, quiet: QUIET }
    }

    /// Takes an observation. Returns the reason for suspension; `None`: it may work.
    ///
    /// - `passed`: the time since the last observation.
    pub(super) fn observe(&mut self, observation: OwnerObservation, passed: Duration) -> Option<OwnerReason> {
        let OwnerObservation { minute, idle, terminals, others } = observation;
        let OwnerConditions { when_idle, hours, max_load } = &self.conditions;
        // Where the idle time is unknown, use the load: it must be low for as long as the machine must be idle.
        let load = max_load.or(when_idle.filter(|_| idle.is_none()).map(|_| TOUCHED_LOAD));
        self.quiet = match load {
            Some(most) if others > most => Duration::ZERO,
            _ => self.quiet.saturating_add(passed),
        };
        let needed = if idle.is_none() { when_idle.unwrap_or(QUIET) } else { QUIET };
        self.rests = if !hours.is_empty() && !hours.iter().any(|hours| hours.contains(minute)) {
            Some(OwnerReason::Hours)
        } else if when_idle.is_some_and(|needed| idle.into_iter().chain(terminals).any(|idle| idle < needed)) {
            Some(OwnerReason::Present)
        } else if load.is_some() && self.quiet < needed {
            Some(if max_load.is_some() { OwnerReason::Load } else { OwnerReason::Present })
        } else {
            None
        };
        self.rests
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn at(minute: u16, idle: Option<u64>, others: f32) -> OwnerObservation {
        OwnerObservation { minute, idle: idle.map(Duration::from_secs), terminals: None, others }
    }

    #[test]
    fn the_owner_has_the_machine_back_at_the_next_observation() {
        let conditions = OwnerConditions { when_idle: Some(Duration::from_secs(600)), ..Default::default() };
        let mut policy = OwnerPolicy::new(conditions);
        assert_eq!(policy.observe(at(0, Some(599), 0.0), SECOND), Some(OwnerReason::Present));
        assert_eq!(policy.observe(at(0, Some(600), 0.0), SECOND), None);
        assert_eq!(policy.observe(at(0, Some(0), 0.0), SECOND), Some(OwnerReason::Present));
        // A user types at a terminal, although the screen is idle.
        let typing = OwnerObservation { terminals: Some(SECOND), ..at(0, Some(900), 0.0) };
        assert_eq!(policy.observe(typing, SECOND), Some(OwnerReason::Present));
    }

    #[test]
    fn hours_may_go_over_midnight() {
        let hours = vec![DailyHours { from: 20 * 60, to: 8 * 60 }, DailyHours { from: 12 * 60, to: 13 * 60 }];
        let mut policy = OwnerPolicy::new(OwnerConditions { hours, ..Default::default() });
        let mut paints = |minute| policy.observe(at(minute, None, 9.0), SECOND).is_none();
        let seen: Vec<bool> = [0, 479, 480, 719, 720, 779, 780, 1199, 1200, 1439].map(&mut paints).into();
        assert_eq!(seen, [true, true, false, false, true, true, false, false, true, true]);
    }

    #[test]
    fn load_stops_at_once_and_must_be_low_for_a_while() {
        let mut policy = OwnerPolicy::new(OwnerConditions { max_load: Some(0.5), ..Default::default() });
        assert_eq!(policy.observe(at(0, None, 0.4), SECOND), None);
        assert_eq!(policy.observe(at(0, None, 0.6), SECOND), Some(OwnerReason::Load));
        let rests = (0..60).take_while(|_| policy.observe(at(0, None, 0.1), SECOND).is_some()).count();
        assert_eq!(rests as u64, QUIET.as_secs() - 1);
    }

    #[test]
    fn where_idleness_is_unknown_load_stands_for_it() {
        let conditions = OwnerConditions { when_idle: Some(Duration::from_secs(120)), ..Default::default() };
        let mut policy = OwnerPolicy::new(conditions);
        let begins = (0..200).take_while(|_| policy.observe(at(0, None, 0.0), SECOND).is_some()).count();
        assert_eq!(begins as u64, 120 - QUIET.as_secs() - 1);
        // An idle terminal does not prove that there is no user at a screen.
        let elsewhere = OwnerObservation { terminals: Some(Duration::from_secs(9999)), ..at(0, None, 1.0) };
        assert_eq!(policy.observe(elsewhere, SECOND), Some(OwnerReason::Present));
    }

    #[test]
    fn without_conditions_it_always_paints() {
        let conditions = OwnerConditions::default();
        assert!(conditions.are_empty());
        assert_eq!(OwnerPolicy::new(conditions).observe(at(0, Some(0), 99.0), SECOND), None);
    }
}
