//! The owner of a machine, who has precedence over the farm.

mod memory;
mod policy;
mod senses;

use std::{
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::{Duration, Instant},
};

pub(crate) use self::memory::MemoryLimit;
pub use self::policy::{DailyHours, OwnerConditions, OwnerReason};
use self::{
    policy::OwnerPolicy,
    senses::{OwnerSenses, SystemSenses},
};

/// Interval between checks for the owner.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// A watch over a machine's owner, on a thread that ends with it.
#[derive(Clone, Debug)]
pub(crate) struct OwnerWatch {
    /// The reason to suspend work; none: it may work.
    reason: Arc<Mutex<Option<OwnerReason>>>,
}

impl OwnerWatch {
    /// Starts watching; `None`: there are no conditions.
    pub(crate) fn start(conditions: &OwnerConditions) -> Option<Self> {
        let policy = OwnerPolicy::new(conditions.clone());
        (!conditions.are_empty()).then(|| Self::start_with(policy, Box::new(SystemSenses::default()), LOOK_EVERY))
    }

    fn start_with(mut policy: OwnerPolicy, mut senses: Box<dyn OwnerSenses>, every: Duration) -> Self {
        let reason = Arc::new(Mutex::new(policy.observe(senses.observe(), Duration::ZERO)));
        let published = Arc::downgrade(&reason);
        thread::spawn(move || {
            let mut before = Instant::now();
            loop {
                thread::sleep(every);
                let passed = before.elapsed();
                before = Instant::now();
                let reason = policy.observe(senses.observe(), passed);
                let Some(published) = published.upgrade() else { return };
                *published.lock().unwrap_or_else(PoisonError::into_inner) = reason;
            }
        });
        Self { reason }
    }

    /// Returns the reason why the machine is suspended; `None`: it may work.
    pub(crate) fn reason(&self) -> Option<OwnerReason> {
        *self.reason.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU64, Ordering};

    use super::{policy::OwnerObservation, *};

    /// A machine with its last input this many seconds ago.
    struct Desk(Arc<AtomicU64>);

    impl OwnerSenses for Desk {
        fn observe(&mut self) -> OwnerObservation {
            let idle = Duration::from_secs(self.0.load(Ordering::Relaxed));
            OwnerObservation { minute: 0, idle: Some(idle), terminals: None, others: 0.0 }
        }
    }

    #[test]
    fn the_watch_says_that_the_owner_has_come_and_gone() {
        let touched = Arc::new(AtomicU64::new(900));
        let conditions = OwnerConditions { when_idle: Some(Duration::from_secs(600)), ..Default::default() };
        let policy = OwnerPolicy::new(conditions);
        let watch = OwnerWatch::start_with(policy, Box::new(Desk(touched.clone())), Duration::from_millis(5));
        assert_eq!(watch.reason(), None);
        for (seconds, reason) in [(0, Some(OwnerReason::Present)), (700, None)] {
            touched.store(seconds, Ordering::Relaxed);
            let begun = Instant::now();
            while watch.reason() != reason {
                assert!(begun.elapsed() < Duration::from_secs(20), "{seconds}");
                thread::sleep(Duration::from_millis(2));
            }
        }
    }
}
