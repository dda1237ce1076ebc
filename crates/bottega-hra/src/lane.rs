//! The thread of a resource that is called directly: take a unit, do it, answer.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::shared::{Attempt, Shared};
use crate::sync::lock;
use crate::work_bin::Pending;
use crate::{Activity, HraConfig, Resource, ResourceId, Work};

/// Serves `resource` until the allocator is shut down or the resource given up.
pub(crate) fn drive<W: Work>(shared: &Arc<Shared<W>>, id: ResourceId, mut resource: Box<dyn Resource<W>>) {
    let mut backoff = Backoff::default();
    let mut now = Instant::now();
    while let Some(pending) = shared.next(id, now) {
        let (done, finished) = attempt(shared, id, &mut *resource, pending);
        now = finished;
        if done {
            backoff.succeeded();
        } else if !rest(shared, id, &mut backoff, || resource.recover()) {
            return;
        }
    }
}

/// Does one unit. Returns whether it was done, and when that was known.
fn attempt<W: Work>(
    shared: &Shared<W>,
    id: ResourceId,
    resource: &mut dyn Resource<W>,
    pending: Pending<W>,
) -> (bool, Instant) {
    let Pending { work, envelope } = pending;
    let account = &shared.lanes[id.index()].account;
    let backup = backup_of(&work);
    let started = Instant::now();
    lock(account).enter(Activity::Working, started);
    let outcome = catch_unwind(AssertUnwindSafe(|| resource.perform(work)));
    let finished = Instant::now();
    lock(account).enter(Activity::Idle, finished);
    let attempt = match outcome {
        Ok(Ok(output)) => Attempt::Done(output),
        Ok(Err(failed)) => Attempt::GivenBack(failed),
        Err(panic) => Attempt::Lost { reason: panic_message(&*panic), backup },
    };
    (shared.settle(id, envelope, attempt, started, finished - started), finished)
}

/// Leaves a resource that failed alone until it has recovered. False: the allocator was shut down, or the resource
/// was given up.
pub(crate) fn rest<W: Work>(
    shared: &Shared<W>,
    id: ResourceId,
    backoff: &mut Backoff,
    mut recover: impl FnMut() -> Result<(), String>,
) -> bool {
    loop {
        let Some(pause) = backoff.failed(&shared.config) else {
            shared.retire(id);
            return false;
        };
        if !shared.pause(id, pause) {
            return false;
        }
        if matches!(catch_unwind(AssertUnwindSafe(&mut recover)), Ok(Ok(()))) {
            return true;
        }
        lock(&shared.lanes[id.index()].account).book_failure();
    }
}

/// A copy of the work, or none if it has none to give.
pub(crate) fn backup_of<W: Work>(work: &W) -> Option<W> {
    catch_unwind(AssertUnwindSafe(|| work.backup())).unwrap_or(None)
}

/// Failures in a row, and the pauses that follow from them.
#[derive(Debug, Default)]
pub(crate) struct Backoff {
    failures: u32,
}

impl Backoff {
    pub(crate) fn succeeded(&mut self) {
        self.failures = 0;
    }

    /// The pause after one more failure: twice the one before. `None`: enough.
    pub(crate) fn failed(&mut self, config: &HraConfig) -> Option<Duration> {
        self.failures += 1;
        let doublings = (self.failures - 1).min(31);
        (self.failures < config.max_failures)
            .then(|| config.pause_min.saturating_mul(1 << doublings).min(config.pause_max))
    }
}

pub(crate) fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("panicked: {}", text.unwrap_or("(no message)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_up_to_the_longest_and_end_in_giving_up() {
        let config = HraConfig {
            pause_min: Duration::from_millis(1),
            pause_max: Duration::from_millis(6),
            max_failures: 6,
            ..HraConfig::default()
        };
        let mut backoff = Backoff::default();
        let pauses: Vec<_> = (0..6).map(|_| backoff.failed(&config).map(|pause| pause.as_millis())).collect();
        assert_eq!(pauses, [Some(1), Some(2), Some(4), Some(6), Some(6), None]);
        backoff.succeeded();
        assert_eq!(backoff.failed(&config), Some(Duration::from_millis(1)));
    }
}
