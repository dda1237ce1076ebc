//! The thread that sees to what time alone brings: units that expire, packets that are overdue.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::shared::AllocatorState;
use crate::Work;
use crate::policy::time::Time;

/// Watches until it is ended.
pub(crate) fn watch<W: Work>(shared: &Arc<AllocatorState<W>>) {
    let alarm = &shared.alarm;
    alarm.post.man();
    while !alarm.ended.load(Ordering::SeqCst) {
        // First nothing is set, so that what comes while the policy is asked sets it again.
        alarm.at.store(u64::MAX, Ordering::SeqCst);
        let next = shared.with_core(|core, now, out| {
            core.tick(now, out);
            core.next_event(now)
        });
        if let Some(next) = next {
            alarm.at.fetch_min(next.nanos(), Ordering::SeqCst);
        }
        let at = Time::from_nanos(alarm.at.load(Ordering::SeqCst));
        let now = shared.now();
        if at > now && !alarm.ended.load(Ordering::SeqCst) {
            alarm.post.wait((at < Time::NEVER).then(|| at.since(now)));
        }
    }
}
