//! The part of a farm that people are shown at a machine: all of it, or to a guest its own work alone.
//!
//! Lists, pages and Python ask here. What a guest's program can read is more: it needs every job's request and files to paint it.

use std::collections::BTreeSet;

use bottega_agents::machine_of;

use crate::{
    error::Error,
    job::Job,
    job_board::{JobBoard, Presence, no_such},
    link::own_members,
};

impl JobBoard {
    /// The jobs that people are shown here, by number.
    pub fn shown_jobs(&self) -> Vec<(u32, Job)> {
        let jobs = self.all();
        if !self.uplink.is_guest() {
            return jobs;
        }
        let (own, seats) = (self.own_members(), self.presences());
        jobs.into_iter().filter(|(number, job)| self.is_work_of(*number, job, &own, &seats)).collect()
    }

    /// A job, if people are shown it here.
    ///
    /// # Errors
    /// There is none of that number, or this machine is a guest and has not painted it.
    pub fn shown_job(&self, number: u32) -> Result<Job, Error> {
        let job = self.get(number).ok_or_else(|| no_such(number))?;
        if !self.uplink.is_guest() || self.is_work_of(number, &job, &self.own_members(), &self.presences()) {
            return Ok(job);
        }
        Err(Error::failed(
            format!("this machine is a guest and sees its own work alone: it has not painted job {number}"),
            "ask at a machine that joined by the other line that `bottega up` printed",
        ))
    }

    /// Those of some machines that people are shown here.
    pub fn shown_machines(&self, mut seats: Vec<Presence>) -> Vec<Presence> {
        if self.uplink.is_guest() {
            let own = self.own_members();
            seats.retain(|seat| own.contains(machine_of(&seat.name)));
        }
        seats
    }

    /// Whether people are shown here what is known of a machine.
    pub fn shows_machine(&self, machine: &str) -> bool {
        !self.uplink.is_guest() || self.own_members().contains(machine_of(machine))
    }

    /// What this machine is called, whatever names its processes joined by.
    fn own_members(&self) -> BTreeSet<String> {
        let mut own = own_members();
        own.insert(self.uplink.member().to_owned());
        own
    }

    /// Whether one of some machines paints a job, or has painted a part of it.
    fn is_work_of(&self, number: u32, job: &Job, machines: &BTreeSet<String>, seats: &[Presence]) -> bool {
        let is_of_them = |process: &str| machines.contains(machine_of(process));
        let has_painted = |seat: &Presence| seat.usages.iter().any(|usage| usage.work == job.origin);
        seats.iter().any(|seat| is_of_them(&seat.name) && (seat.job == Some(number) || has_painted(seat)))
            || self.society(number).is_some_and(|society| society.usages.keys().any(|process| is_of_them(process)))
    }
}
