//! Views of jobs and machines for observers.

use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    job::{AnimationFrame, Job, JobState},
    job_board::{JobBoard, Lead, Presence},
    machine::{PresenceState, Roster},
};

/// A job as others are told of it.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct JobView {
    /// Its number.
    #[serde(rename = "job")]
    pub number: u32,
    /// `active`, `paused`, `done`, `failed` or `cancelled`.
    pub state: &'static str,
    /// Why it failed.
    pub reason: Option<String>,
    /// Predicted share of all cost that is done, 0..=1.
    pub done: f64,
    /// Zones painted.
    pub zones_done: usize,
    /// All zones.
    pub zones: usize,
    /// Seconds that are left, as far as who leads it can tell.
    pub seconds_left: Option<f64>,
    /// Whether there is something to see of it while it is painted, coarse at first.
    pub seen: bool,
    /// How urgent it is.
    pub priority: u32,
    /// Tags that a machine must have to paint it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub require: Vec<String>,
    /// How many paint it.
    pub machines: usize,
    /// Who leads it.
    pub leader: Option<String>,
    /// Who asked for it.
    pub from: String,
    /// Seconds since 1970.
    pub submitted: u64,
    /// The scene, as its asker calls it.
    pub scene: String,
    /// The picture, as its asker calls it.
    pub output: String,
    /// Of which animation it is a frame.
    pub animation: Option<AnimationFrame>,
    /// How often all who paint it were told to begin again with it, because nothing went on for 30 s though somebody was free.
    pub stirs: u32,
    /// The farm has a picture of it: while it is painted again, that of the painting before.
    pub kept: bool,
    /// Whether it will not change by itself any more.
    #[serde(skip)]
    pub is_over: bool,
}

impl JobView {
    /// The jobs of a farm that people are shown here, by number.
    pub fn all(board: &JobBoard) -> Vec<Self> {
        let seats = board.presences();
        let view = |(number, job): (u32, Job)| {
            let machines = seats.iter().filter(|seat| seat.job == Some(number)).count();
            Self::of(number, &job, &board.lead(number).unwrap_or_default(), machines)
        };
        board.shown_jobs().into_iter().map(view).collect()
    }

    /// A job, as others look at it.
    pub fn of(number: u32, job: &Job, lead: &Lead, machines: usize) -> Self {
        let is_done = job.state == JobState::Done;
        let lead = &lead.clone().of(job.work);
        Self {
            number,
            state: job.state.word(),
            reason: match &job.state {
                JobState::Failed { reason } => Some(reason.clone()),
                _ => None,
            },
            done: if is_done { 1.0 } else { lead.done },
            // Who leads it says the last of them a little later.
            zones_done: if is_done { lead.zones } else { lead.zones_done },
            zones: lead.zones,
            seconds_left: lead.seconds_left.filter(|_| job.state == JobState::Active && lead.leader.is_some()),
            seen: lead.seen,
            priority: job.priority,
            require: job.require.clone(),
            // A machine that was killed does not say that it has left.
            machines: if job.state.is_over() { 0 } else { machines },
            leader: lead.leader.clone(),
            from: job.from.clone(),
            submitted: job.submitted,
            scene: job.scene.clone(),
            output: job.output.clone(),
            animation: job.animation.clone(),
            stirs: job.stirs,
            kept: job.kept,
            is_over: job.state.is_over(),
        }
    }
}

/// A machine as others are told of it.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineView {
    /// What it says of itself.
    pub seat: Presence,
    /// What it is told.
    pub ordered: PresenceState,
}

impl MachineView {
    /// The machines that are there and that people are shown here, for one who has linked up a moment ago.
    pub fn all(board: &JobBoard) -> Vec<Self> {
        let view = |seat: Presence| Self { ordered: board.order_to(&seat.name).standing, seat };
        board.shown_machines(board.present()).into_iter().map(view).collect()
    }

    /// The machine as JSON.
    pub fn to_value(&self) -> serde_json::Value {
        let Presence { name, threads, devices, version, job, standing, activity, takes_orders, tags, .. } = &self.seat;
        serde_json::json!({ "machine": name, "state": standing.word(), "ordered": self.ordered.word(),
            "activity": activity.word(), "threads": threads, "devices": devices, "job": job, "version": version, "takes_orders": takes_orders, "tags": tags })
    }
}

/// All of a farm at a moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FarmView {
    /// By number.
    pub jobs: Vec<JobView>,
    /// The machines that are there.
    pub machines: Vec<MachineView>,
}

impl FarmView {
    /// The farm as it is now.
    pub fn of(board: &JobBoard, roster: &mut Roster) -> Self {
        let seats = roster.look(board.seated());
        let jobs = board.all().into_iter().map(|(number, job)| {
            let machines = seats.iter().filter(|seat| seat.job == Some(number)).count();
            JobView::of(number, &job, &board.lead(number).unwrap_or_default(), machines)
        });
        let jobs = jobs.collect();
        let machine = |seat: Presence| MachineView { ordered: board.order_to(&seat.name).standing, seat };
        Self { jobs, machines: seats.into_iter().map(machine).collect() }
    }

    /// A job by its number.
    pub fn job(&self, number: u32) -> Option<&JobView> {
        self.jobs.iter().find(|job| job.number == number)
    }
}
