//! The part of a farm that a user may see at a machine: all of it, or only the own jobs at a guest.
//!
//! Lists, web pages and the Python module use this. A guest's program can read more: it needs the request and the files of
//! every job to render it.

use std::collections::BTreeSet;

use bottega_agents::machine_of;

use crate::{
    error::Error,
    job::{
        board::{JobBoard, no_such},
        presence::Presence,
        record::Job,
    },
    server::link::own_members,
};

impl JobBoard {
    /// Returns the jobs that users of this machine may see, with their numbers and in the order of these: all jobs, or at a guest
    /// those that this machine works on or has worked on.
    pub fn shown_jobs(&self) -> Vec<(u32, Job)> {
        let jobs = self.all();
        if !self.uplink.is_guest() {
            return jobs;
        }
        let (own, present) = (self.own_members(), self.presences());
        jobs.into_iter().filter(|(number, job)| self.is_work_of(*number, job, &own, &present)).collect()
    }

    /// Returns a job, if users of this machine may see it.
    ///
    /// # Errors
    /// No job has that number, or this machine is a guest that has not worked on it.
    pub fn shown_job(&self, number: u32) -> Result<Job, Error> {
        let job = self.get(number).ok_or_else(|| no_such(number))?;
        if !self.uplink.is_guest() || self.is_work_of(number, &job, &self.own_members(), &self.presences()) {
            return Ok(job);
        }
        Err(Error::failed(
            format!("this machine is a guest and sees its own work alone: it has not painted job {number}"),
            "use a machine that joined by the other line that `bottega up` printed",
        ))
    }

    /// Returns those of `machines` that users of this machine may see: all, or at a guest only the processes of this machine.
    pub fn shown_machines(&self, mut machines: Vec<Presence>) -> Vec<Presence> {
        if self.uplink.is_guest() {
            let own = self.own_members();
            machines.retain(|machine| own.contains(machine_of(&machine.name)));
        }
        machines
    }

    /// Returns true if users of this machine may see the data of a machine.
    ///
    /// - `machine`: its name, or that of one of its processes.
    pub fn shows_machine(&self, machine: &str) -> bool {
        !self.uplink.is_guest() || self.own_members().contains(machine_of(machine))
    }

    /// Returns all names of this machine at farms.
    fn own_members(&self) -> BTreeSet<String> {
        let mut own = own_members();
        own.insert(self.uplink.member().to_owned());
        own
    }

    /// Returns true if one of these machines works on a job, or has rendered a part of it.
    fn is_work_of(&self, number: u32, job: &Job, machines: &BTreeSet<String>, present: &[Presence]) -> bool {
        let is_of_them = |process: &str| machines.contains(machine_of(process));
        let has_painted = |machine: &Presence| machine.usages.iter().any(|usage| usage.work == job.origin);
        present.iter().any(|machine| is_of_them(&machine.name) && (machine.job == Some(number) || has_painted(machine)))
            || self.society(number).is_some_and(|society| society.usages.keys().any(|process| is_of_them(process)))
    }
}
