//! Observations of this machine: the time since the last input, and the load of other programs.

use bottega_platform::activity::{BusyClock, idle, idle_terminals};

use super::policy::OwnerObservation;

/// A source of observations.
pub(super) trait OwnerSenses: Send {
    /// Returns the current state of the machine.
    fn observe(&mut self) -> OwnerObservation;
}

/// Observations from the operating system.
#[derive(Default)]
pub(super) struct SystemSenses {
    clock: BusyClock,
}

impl OwnerSenses for SystemSenses {
    fn observe(&mut self) -> OwnerObservation {
        OwnerObservation {
            minute: minute_of_day(),
            idle: idle(),
            terminals: idle_terminals(),
            others: self.clock.others(),
        }
    }
}

/// Returns the minutes since midnight, local time.
fn minute_of_day() -> u16 {
    let now = jiff::ZonedDateTime::now();
    (i16::from(now.hour()) * 60 + i16::from(now.minute())) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_can_be_observed() {
        let mut senses = SystemSenses::default();
        senses.observe();
        let seen = senses.observe();
        assert!(seen.minute < 24 * 60 && seen.others >= 0.0, "{seen:?}");
    }
}
