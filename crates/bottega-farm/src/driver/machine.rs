//! The preparation of this machine: its benchmark, the survey of the scene, what all zones need.

use std::{sync::Arc, thread, time::Duration};

use bottega_agents::Time;

use super::shared::{End, FarmMailbox, Preparation, Shared};
use crate::{FarmCompletion, RelativePower, WorkId};

/// The benchmark's time on the reference machine.
const REFERENCE_BENCHMARK: Duration = Duration::from_millis(2);

impl Shared {
    /// In one process the engine has the scene. What it makes of it is made once; who asks meanwhile waits.
    pub(super) fn fetch(self: &Arc<Self>, work: WorkId, mailbox: &FarmMailbox) {
        let mut state = self.state();
        match &mut state.preparation {
            Preparation::Done => mailbox.complete(FarmCompletion::Fetched(work)),
            Preparation::UnderWay(waiting) => waiting.push((work, mailbox.clone())),
            before @ Preparation::NotBegun => {
                *before = Preparation::UnderWay(vec![(work, mailbox.clone())]);
                state.outstanding += 1;
                drop(state);
                self.prepare(mailbox.clone());
            }
        }
    }

    /// Preparing blocks, so it has a thread of its own.
    fn prepare(self: &Arc<Self>, clock: FarmMailbox) {
        let shared = Arc::clone(self);
        let make = move || {
            let before = clock.now();
            if let Err(error) = shared.engine.prepare() {
                shared.end(End::Abandoned(error.to_string()));
            }
            let after = std::mem::replace(&mut shared.state().preparation, Preparation::Done);
            shared.state().preparing = clock.now() - before;
            if let Preparation::UnderWay(waiting) = after {
                waiting.iter().for_each(|(work, mailbox)| mailbox.complete(FarmCompletion::Fetched(*work)));
            }
            shared.end_outstanding();
        };
        if let Err(error) = thread::Builder::new().name("prepare".to_owned()).spawn(make) {
            self.end_outstanding();
            self.end(End::Abandoned(format!("cannot start a thread: {error}")));
        }
    }

    /// A survey blocks, so it has a thread of its own.
    pub(super) fn survey(self: &Arc<Self>, width: u32, height: u32, mailbox: &FarmMailbox) {
        self.begin_outstanding();
        let (shared, to) = (Arc::clone(self), mailbox.clone());
        let look = move || {
            let before = to.now();
            let survey = shared.engine.survey(width, height).map(Arc::new).map_err(|error| error.to_string());
            shared.state().survey = to.now() - before;
            if let Ok(survey) = &survey {
                shared.observer.surveyed(survey);
            }
            to.complete(FarmCompletion::Surveyed(survey));
            shared.end_outstanding();
        };
        if let Err(error) = thread::Builder::new().name("survey".to_owned()).spawn(look) {
            self.end_outstanding();
            self.end(End::Abandoned(format!("cannot start a thread: {error}")));
        }
    }
}

/// V_cp from a fixed piece of work: a chain of dependent operations, so that nothing but the processor decides.
pub(super) fn benchmark(now: impl Fn() -> Time) -> RelativePower {
    let measure = || {
        let before = now();
        let mut value = 1.000_000_1_f64;
        for _ in 0..400_000 {
            value = value * 1.000_000_3 + 1e-9;
            value = if value > 2.0 { value - 1.0 } else { value };
        }
        std::hint::black_box(value);
        now() - before
    };
    // The best of three: a processor that was asleep, or another program, disturbs the first.
    let best = (0..3).map(|_| measure()).min().unwrap_or(REFERENCE_BENCHMARK);
    RelativePower::new(best.as_secs_f64() / REFERENCE_BENCHMARK.as_secs_f64())
}
