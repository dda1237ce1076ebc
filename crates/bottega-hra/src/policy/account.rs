//! The account of a resource's time.

use std::time::Duration;

use super::time::Time;
use super::timeline::{Span, Spans};
use crate::{Activity, PacketUse};

/// Time by activity, with the last spans.
pub(crate) struct Account {
    activity: Activity,
    since: Time,
    pub(crate) units: u64,
    pub(crate) failures: u64,
    pub(crate) packets: PacketUse,
    spent: [Duration; 4],
    spans: Spans,
}

impl Account {
    /// Makes the account of a resource that is idle from `now` on; keeps at most this number of spans.
    pub(crate) fn new(now: Time, spans_kept: usize) -> Self {
        let spans = Spans::new(spans_kept);
        Self {
            activity: Activity::Idle,
            since: now,
            units: 0,
            failures: 0,
            packets: PacketUse::default(),
            spent: [Duration::ZERO; 4],
            spans,
        }
    }

    pub(crate) fn activity(&self) -> Activity {
        self.activity
    }

    /// Changes the activity from `now` on.
    pub(crate) fn enter(&mut self, activity: Activity, now: Time) {
        if activity == self.activity {
            return;
        }
        self.spent[self.activity as usize] += now.since(self.since);
        self.spans.push(Span { activity: self.activity, from: self.since, to: now });
        (self.activity, self.since) = (activity, now);
    }

    /// Returns the time spent so far, including the current activity.
    pub(crate) fn spent(&self, activity: Activity, now: Time) -> Duration {
        let current = if self.activity == activity { now.since(self.since) } else { Duration::ZERO };
        self.spent[activity as usize] + current
    }

    /// Returns the spans kept, including the current one.
    pub(crate) fn spans(&self, now: Time) -> Vec<Span> {
        self.spans.with(Span { activity: self.activity, from: self.since, to: now.max(self.since) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_time_is_accounted_for() {
        let at = |ms| Time::at(Duration::from_millis(ms));
        let mut account = Account::new(Time::ZERO, 100);
        account.enter(Activity::Working, at(10));
        account.enter(Activity::Suspended, at(30));
        account.enter(Activity::Idle, at(70));
        account.enter(Activity::Working, at(80));
        let spent = |activity| account.spent(activity, at(85)).as_millis();
        assert_eq!((spent(Activity::Working), spent(Activity::Suspended), spent(Activity::Idle)), (25, 40, 20));
        let spans = account.spans(at(85));
        assert_eq!(spans.len(), 5);
        assert!(spans.windows(2).all(|pair| pair[0].to == pair[1].from));
    }
}
