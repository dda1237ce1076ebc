//! How jobs and machines stand, for those who look on.

use serde::Serialize;

use super::{
    job::{Job, JobState},
    job_board::{JobBoard, Lead, Seat},
    machine::{Roster, Standing},
};

/// A job as others are told of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct JobView {
    #[serde(rename = "job")]
    pub(crate) number: u32,
    /// `active`, `paused`, `done`, `failed` or `cancelled`.
    pub(crate) state: &'static str,
    /// Why it failed.
    pub(crate) reason: Option<String>,
    /// Predicted share of all cost that is done, 0..=1.
    pub(crate) done: f64,
    pub(crate) zones_done: usize,
    pub(crate) zones: usize,
    pub(crate) priority: u32,
    /// How many paint it.
    pub(crate) machines: usize,
    pub(crate) leader: Option<String>,
    /// Who asked for it.
    pub(crate) from: String,
    /// Seconds since 1970.
    pub(crate) submitted: u64,
    pub(crate) scene: String,
    pub(crate) output: String,
    /// The farm has the picture.
    pub(crate) kept: bool,
    #[serde(skip)]
    pub(crate) is_over: bool,
}

impl JobView {
    pub(crate) fn of(number: u32, job: &Job, lead: &Lead, machines: usize) -> Self {
        let is_done = matches!(job.state, JobState::Done { .. });
        Self {
            number,
            state: job.state.word(),
            reason: match &job.state {
                JobState::Failed { reason } => Some(reason.clone()),
                _ => None,
            },
            done: if is_done { 1.0 } else { lead.done },
            zones_done: lead.zones_done,
            zones: lead.zones,
            priority: job.priority,
            // A machine that was killed does not say that it has left.
            machines: if job.state.is_over() { 0 } else { machines },
            leader: lead.leader.clone(),
            from: job.from.clone(),
            submitted: job.submitted,
            scene: job.scene.clone(),
            output: job.output.clone(),
            kept: matches!(job.state, JobState::Done { kept: true }),
            is_over: job.state.is_over(),
        }
    }
}

/// A machine as others are told of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MachineView {
    pub(crate) seat: Seat,
    /// What it is told.
    pub(crate) ordered: Standing,
}

/// All of a farm at a moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct FarmView {
    /// By number.
    pub(crate) jobs: Vec<JobView>,
    pub(crate) machines: Vec<MachineView>,
}

impl FarmView {
    pub(crate) fn of(board: &JobBoard, roster: &mut Roster) -> Self {
        let seats = roster.look(board.seated());
        let jobs = board.all().into_iter().map(|(number, job)| {
            let machines = seats.iter().filter(|seat| seat.job == Some(number)).count();
            JobView::of(number, &job, &board.lead(number).unwrap_or_default(), machines)
        });
        let jobs = jobs.collect();
        let machine = |seat: Seat| MachineView { ordered: board.order_to(&seat.name).standing, seat };
        Self { jobs, machines: seats.into_iter().map(machine).collect() }
    }

    pub(crate) fn job(&self, number: u32) -> Option<&JobView> {
        self.jobs.iter().find(|job| job.number == number)
    }
}
