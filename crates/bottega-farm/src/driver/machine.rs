//! The preparation of this machine: its benchmark, the survey of the scene, the data that all zones need.

use std::{
    sync::{Arc, OnceLock},
    thread,
    time::Duration,
};

use bottega_engines::SpeedProbe;

use super::shared::{End, FarmMailbox, Preparation, Shared};
use crate::{FarmCompletion, RelativePower, WorkId};

/// The time of the benchmark on the reference machine, for which the weights of the predicted time were fitted.
const REFERENCE_TIME: Duration = Duration::from_millis(14);
/// The least number of runs,
const TURNS_MIN: u32 = 3;
/// the least total time,
const TIME_MIN: Duration = Duration::from_millis(250);
/// and the total time after which no further run starts.
const TIME_MAX: Duration = Duration::from_millis(1500);

impl Shared {
    /// Prepares the engine once; further requests wait. The scene itself is already loaded in this process.
    pub(super) fn fetch(self: &Arc<Self>, work: WorkId, mailbox: &FarmMailbox) {
        let mut state = self.state();
        match &mut state.preparation {
            Preparation::Done => mailbox.complete(FarmCompletion::Fetched(work)),
            Preparation::UnderWay(waiting) => waiting.push((work, mailbox.clone())),
            before @ Preparation::NotBegun => {
                *before = Preparation::UnderWay(vec![(work, mailbox.clone())]);
                drop(state);
                self.begin_preparation();
                self.prepare(mailbox.clone());
            }
        }
    }

    /// Prepares the engine, on a thread of its own because it blocks.
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
            shared.end_preparation();
        };
        if let Err(error) = thread::Builder::new().name("prepare".to_owned()).spawn(make) {
            self.end_preparation();
            self.end(End::Abandoned(format!("cannot start a thread: {error}")));
        }
    }

    /// Surveys the scene, on a thread of its own because it blocks.
    pub(super) fn survey(self: &Arc<Self>, width: u32, height: u32, mailbox: &FarmMailbox) {
        self.begin_preparation();
        let (shared, to) = (Arc::clone(self), mailbox.clone());
        let look = move || {
            let before = to.now();
            let survey = shared.engine.survey(width, height).map(Arc::new).map_err(|error| error.to_string());
            shared.state().survey = to.now() - before;
            if let Ok(survey) = &survey {
                shared.state().look = Some(Arc::clone(survey));
                shared.observer.surveyed(survey);
            }
            to.complete(FarmCompletion::Surveyed(survey));
            shared.end_preparation();
        };
        if let Err(error) = thread::Builder::new().name("survey".to_owned()).spawn(look) {
            self.end_preparation();
            self.end(End::Abandoned(format!("cannot start a thread: {error}")));
        }
    }
}

/// Returns V_cp, measured by rendering a fixed small picture on the calling thread, in 0.25 s to 2 s. The first result of a
/// process is reused.
///
/// - `now`: a clock.
pub fn benchmark(now: impl Fn() -> Duration) -> RelativePower {
    static MEASURED: OnceLock<RelativePower> = OnceLock::new();
    *MEASURED.get_or_init(|| measure(now).unwrap_or(RelativePower::REFERENCE))
}

fn measure(now: impl Fn() -> Duration) -> Option<RelativePower> {
    let probe = SpeedProbe::new().ok()?;
    let begun = now();
    let mut best = Duration::MAX;
    // Use the best of several runs: sleeping processors and other programs disturb some.
    for turn in 1.. {
        let before = now();
        std::hint::black_box(probe.paint().ok()?);
        let after = now();
        best = best.min(after.saturating_sub(before));
        let spent = after.saturating_sub(begun);
        if turn >= TURNS_MIN && spent >= TIME_MIN || spent >= TIME_MAX {
            break;
        }
    }
    Some(RelativePower::new(best.as_secs_f64() / REFERENCE_TIME.as_secs_f64()))
}
