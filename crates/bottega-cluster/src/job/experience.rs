//! The experience of machines, stored by the farm: how long zones take them.
//!
//! - `experience/MACHINE`: written by the leader of each job that the machine worked on. Each machine has its own and is
//!   judged by it alone.
//! - `experience-of-farm`: what all machines together have taught, in time of the reference machine. It predicts the times of
//!   pictures and techniques that a machine does not know itself.

use std::{collections::BTreeMap, sync::Arc};

use bottega::error::error_chain;
use bottega_agents::machine_of;
use bottega_farm::{Experience, JobLesson, JobReport};

use crate::{error::Error, job::board::JobBoard};

/// Prefix of these notices.
const EXPERIENCE: &str = "experience/";
/// The notice with the experience of all machines together.
const OF_FARM: &str = "experience-of-farm";
/// The name that stands for all machines together where [`JobBoard::experience`] takes the name of a machine.
pub const ALL_MACHINES: &str = "all-machines";

impl JobBoard {
    /// Returns the experience of a machine, by its name, or of all together ([`ALL_MACHINES`]); empty if there is none or it
    /// cannot be read.
    pub fn experience(&self, machine: &str) -> Experience {
        let notice = self.uplink.notices().get(&name_of(machine));
        let read = notice.map(|notice| Experience::from_json(&String::from_utf8_lossy(&notice.text)));
        read.transpose()
            .unwrap_or_else(|error| {
                let reason = error_chain(&error);
                tracing::warn!(machine, "cannot use its experience: {reason}; `bottega machines forget` removes it");
                None
            })
            .unwrap_or_default()
    }

    /// Returns what all machines have learned together, with times of the reference machine; empty if there is none or it
    /// cannot be read. It predicts the times of pictures and techniques that a machine does not know itself.
    pub fn experience_of_farm(&self) -> Experience {
        self.experience(ALL_MACHINES)
    }

    /// Returns the experience of this machine: from this farm, or else from its own file.
    pub(crate) fn own_experience(&self, process: &str) -> Arc<Experience> {
        let at_farm = self.experience(machine_of(process));
        Arc::new(if at_farm.is_empty() { bottega::experience::read().0 } else { at_farm })
    }

    /// Returns the names of the machines with stored experience, in alphabetical order.
    pub fn experienced(&self) -> Vec<String> {
        let notices = self.uplink.notices().all(EXPERIENCE);
        notices.iter().filter_map(|notice| notice.name.strip_prefix(EXPERIENCE).map(str::to_owned)).collect()
    }

    /// Adds the lessons of a job. If two processes add to the same machine at once, one lesson may be lost.
    pub(crate) fn keep_lessons(&self, lessons: &BTreeMap<String, JobLesson>) {
        let mut of_farm = self.experience_of_farm();
        // Experience of agents of other platforms is never read.
        let own = || lessons.iter().filter(|(machine, _)| !machine.starts_with("stranger-"));
        for (machine, lesson) in own() {
            let mut experience = self.experience(machine);
            experience.learn(lesson, Some(&of_farm));
            self.keep_experience(&name_of(machine), &experience);
        }
        // All machines together teach the farm, each in time of the reference machine
        let all = own().map(|(_, lesson)| lesson.in_reference_time()).reduce(|mut all, lesson| {
            all.zones.extend(lesson.zones);
            all
        });
        if let Some(all) = all {
            of_farm.learn(&all, None);
            self.keep_experience(OF_FARM, &of_farm);
        }
    }

    fn keep_experience(&self, notice: &str, experience: &Experience) {
        if let Err(error) = self.uplink.notices().put(notice, experience.to_json().as_bytes()) {
            tracing::debug!(%error, notice, "cannot store the experience");
        }
    }

    /// Deletes the experience and the credit of a machine, by its name, or the experience of all together ([`ALL_MACHINES`]).
    /// Returns `true` if there were any.
    ///
    /// # Errors
    /// The farm does not confirm the deletion.
    pub fn forget_machine(&self, machine: &str) -> Result<bool, Error> {
        let mut found = false;
        for name in [name_of(machine), crate::job::society::credit_name(machine)] {
            found |= self.uplink.notices().get(&name).is_some();
            self.uplink.notices().remove(&name).map_err(Error::Blob)?;
        }
        Ok(found)
    }
}

/// Returns the name of the notice with the experience of a machine, or of all together ([`ALL_MACHINES`]).
fn name_of(machine: &str) -> String {
    if machine == ALL_MACHINES { OF_FARM.to_owned() } else { format!("{EXPERIENCE}{machine}") }
}

/// Returns the lessons of a job as a line of its log; `None`: there are none, or no forecast to compare them with.
pub(crate) fn taught(report: &JobReport) -> Option<String> {
    let zones = |(machine, lesson): (&String, &JobLesson)| format!("{machine} {}", lesson.zones.len());
    let machines: Vec<String> = report.lessons.iter().map(zones).collect();
    let forecast = report.forecast.filter(|_| !machines.is_empty())?;
    let source = match report.jobs_learnt {
        0 => "the survey alone".to_owned(),
        1 => "one earlier job".to_owned(),
        jobs => format!("{jobs} earlier jobs"),
    };
    Some(format!(
        "learnt: the times of zones, {}; T_est by {source} was off by {:.0} % in the median",
        machines.join(", "),
        100.0 * forecast.median_error
    ))
}
