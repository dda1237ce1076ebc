//! The experience of machines, stored by the farm: how long zones take them.
//!
//! - `experience/MACHINE`: written by the leader of each job that the machine worked on. Each machine has its own and is
//!   judged by it alone: reports of one machine do not affect another.

use std::{collections::BTreeMap, sync::Arc};

use bottega::error::error_chain;
use bottega_agents::machine_of;
use bottega_farm::{Experience, JobLesson};

use crate::{error::Error, job::board::JobBoard};

/// Prefix of these notices.
const EXPERIENCE: &str = "experience/";

impl JobBoard {
    /// Returns the experience of a machine, by its name; empty if there is none or it cannot be read.
    pub fn experience(&self, machine: &str) -> Experience {
        let notice = self.uplink.notices().get(&name_of(machine));
        let read = notice.map(|notice| Experience::from_json(&String::from_utf8_lossy(&notice.text)));
        read.transpose()
            .unwrap_or_else(|error| {
                let reason = error_chain(&error);
                tracing::warn!(
                    machine,
                    "what it has learnt is not used: {reason}; `bottega machines forget` removes it"
                );
                None
            })
            .unwrap_or_default()
    }

    /// Returns the experience of this machine: from this farm, or else from its own file.
    pub(crate) fn own_experience(&self, process: &str) -> Arc<Experience> {
        let at_farm = self.experience(machine_of(process));
        Arc::new(if at_farm.is_empty() { bottega::experience::read().0 } else { at_farm })
    }

    /// Returns the names of the machines with stored experience.
    pub fn experienced(&self) -> Vec<String> {
        let notices = self.uplink.notices().all(EXPERIENCE);
        notices.iter().filter_map(|notice| notice.name.strip_prefix(EXPERIENCE).map(str::to_owned)).collect()
    }

    /// Adds the lessons of a job. If two processes add to the same machine at once, one lesson may be lost.
    pub(crate) fn keep_lessons(&self, lessons: &BTreeMap<String, JobLesson>) {
        // Experience of agents of other platforms is never read.
        for (machine, lesson) in lessons.iter().filter(|(machine, _)| !machine.starts_with("stranger-")) {
            let mut experience = self.experience(machine);
            experience.learn(lesson);
            if let Err(error) = self.uplink.notices().put(&name_of(machine), experience.to_json().as_bytes()) {
                tracing::debug!(%error, machine, "what it has learnt was not kept");
            }
        }
    }

    /// Deletes the experience and the credit of a machine. Returns `true` if there were any.
    ///
    /// # Errors
    /// The farm does not answer.
    pub fn forget_machine(&self, machine: &str) -> Result<bool, Error> {
        let mut found = false;
        for name in [name_of(machine), crate::job::society::credit_name(machine)] {
            found |= self.uplink.notices().get(&name).is_some();
            self.uplink.notices().remove(&name).map_err(Error::Blob)?;
        }
        Ok(found)
    }
}

fn name_of(machine: &str) -> String {
    format!("{EXPERIENCE}{machine}")
}
