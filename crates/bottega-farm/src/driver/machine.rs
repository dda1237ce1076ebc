//! The preparation of this machine: the survey of the scene, the data that all zones need.

use std::{sync::Arc, thread};

use super::shared::{End, FarmMailbox, Preparation, Shared};
use crate::{FarmCompletion, WorkId};

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
