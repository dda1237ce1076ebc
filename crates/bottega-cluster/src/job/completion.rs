//! The end of a job: its state, the data that is kept of its painting, and the data that is deleted.

use crate::{
    error::Error,
    job::{board::JobBoard, record::JobState, shared_parts},
};

impl JobBoard {
    /// Marks a job as over once its picture is written, and deletes the data of its painting.
    ///
    /// - `work`: the number of the painting.
    /// - `is_kept`: `true` if the farm stores the picture.
    ///
    /// # Errors
    /// There is no such job, this machine is a guest, or the farm does not store the change.
    pub(crate) fn complete(&self, number: u32, work: u64, state: &JobState, is_kept: bool) -> Result<(), Error> {
        // Read the job before it is over: until then its rows are those of the store.
        let painted = self.get(number).filter(|job| !job.state.is_over() && job.work == work);
        self.change(number, |job| {
            // Another process may have finished it while this one was suspended, or restarted it.
            if job.work != work || job.state == JobState::Done {
                return false;
            }
            job.say(match state {
                JobState::Failed { reason } => format!("failed: {reason}"),
                state => state.word().to_owned(),
            });
            job.state = state.clone();
            job.kept |= is_kept;
            true
        })?;
        if let Some(job) = &painted {
            self.keep_rows(job);
            self.keep_rule_inputs(job.work);
        }
        self.forget_zones(work);
        self.forget_learnt(work);
        self.forget_requeues(number);
        self.forget_first_look(work);
        shared_parts::forget(self, work);
        Ok(())
    }
}
