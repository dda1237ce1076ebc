//! The experience of machines, kept by the farm: how long zones take them.
//!
//! - `experience/MACHINE`: written by whoever led a job that the machine painted, whether that is still there or not. Each machine
//!   has its own, and is judged by that alone: what one of them says of itself counts for no other.

use std::{collections::BTreeMap, sync::Arc};

use bottega::error::error_chain;
use bottega_agents::machine_of;
use bottega_farm::{Experience, JobLesson};

use crate::{error::Error, job_board::JobBoard};

/// How the names of all these notices begin.
const EXPERIENCE: &str = "experience/";

impl JobBoard {
    /// What a machine has learnt in the jobs of this farm, by its name; empty where nothing is kept, or what is cannot be used.
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

    /// What the machine of this process has learnt: at this farm, or else by itself.
    pub(crate) fn own_experience(&self, process: &str) -> Arc<Experience> {
        let at_farm = self.experience(machine_of(process));
        Arc::new(if at_farm.is_empty() { bottega::experience::read().0 } else { at_farm })
    }

    /// Machines of which something is kept.
    pub fn experienced(&self) -> Vec<String> {
        let notices = self.uplink.notices().all(EXPERIENCE);
        notices.iter().filter_map(|notice| notice.name.strip_prefix(EXPERIENCE).map(str::to_owned)).collect()
    }

    /// Adds what was learnt in a job. Of two who add to one machine's at the same moment one may be lost.
    pub(crate) fn keep_lessons(&self, lessons: &BTreeMap<String, JobLesson>) {
        // Nobody reads those of agents of other platforms.
        for (machine, lesson) in lessons.iter().filter(|(machine, _)| !machine.starts_with("stranger-")) {
            let mut experience = self.experience(machine);
            experience.learn(lesson);
            if let Err(error) = self.uplink.notices().put(&name_of(machine), experience.to_json().as_bytes()) {
                tracing::debug!(%error, machine, "what it has learnt was not kept");
            }
        }
    }

    /// Forgets what a machine has learnt, and how far its promises held. Returns whether there was anything.
    ///
    /// # Errors
    /// The farm does not answer.
    pub fn forget_machine(&self, machine: &str) -> Result<bool, Error> {
        let mut found = false;
        for name in [name_of(machine), crate::society::credit_name(machine)] {
            found |= self.uplink.notices().get(&name).is_some();
            self.uplink.notices().remove(&name).map_err(Error::Blob)?;
        }
        Ok(found)
    }
}

fn name_of(machine: &str) -> String {
    format!("{EXPERIENCE}{machine}")
}
