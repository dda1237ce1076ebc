//! The watch: a thread for events of time, such as expired units and overdue packets.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::shared::AllocatorState;
use crate::Work;
use crate::policy::time::Time;

/// Watches deadlines and hanging resources until the allocator ends.
pub(crate) fn watch<W: Work>(shared: &Arc<AllocatorState<W>>) {
    let alarm = &shared.alarm;
    alarm.post.man();
    while !alarm.ended.load(Ordering::SeqCst) {
        // Reset first, so that events during the following call set it again
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
