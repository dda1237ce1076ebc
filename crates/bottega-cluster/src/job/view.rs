//! Views of jobs and machines for observers.

use schemars::JsonSchema;
use serde::Serialize;

use crate::job::{
    board::{JobBoard, Lead},
    machines::Roster,
    presence::{Presence, PresenceState},
    record::{AnimationFrame, Job, JobState},
};

/// A job as shown to observers.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct JobView {
    /// The number of the job.
    #[serde(rename = "job")]
    pub number: u32,
    /// `active`, `paused`, `done`, `failed` or `cancelled`.
    pub state: &'static str,
    /// The reason of a failure; none: it has not failed.
    pub reason: Option<String>,
    /// Share of the predicted cost of the picture that is done, in 0..=1.
    pub done: f64,
    /// Number of zones painted.
    pub zones_done: usize,
    /// Number of all zones; 0 while they are not known yet.
    pub zones: usize,
    /// Predicted remaining time in seconds, if the job's leader knows it.
    pub seconds_left: Option<f64>,
    /// `true`: a preview of the picture exists while it is rendered, coarse at first.
    pub seen: bool,
    /// The job's weight when jobs share the machines.
    pub priority: u32,
    /// Tags that a machine must have to render it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub require: Vec<String>,
    /// The number of machines that work on the job, each process counted; 0 if the job is over.
    pub machines: usize,
    /// The name of the process that leads the job; none: no process leads it now.
    pub leader: Option<String>,
    /// The name of the process that submitted the job.
    pub from: String,
    /// The time of submission, in seconds since 1970.
    pub submitted: u64,
    /// The name of the scene, as its submitter wrote it.
    pub scene: String,
    /// The name of the picture, as its submitter wrote it.
    pub output: String,
    /// The job's place in an animation; none: it is not a frame of one.
    pub animation: Option<AnimationFrame>,
    /// The number of restarts of all the job's processes, because nothing progressed for 30 s although machines were free.
    pub stirs: u32,
    /// `true`: the farm stores a picture of the job; while it is rendered again, that of the previous painting.
    pub kept: bool,
    /// True if the job's state does not change again without a user.
    #[serde(skip)]
    pub is_over: bool,
}

impl JobView {
    /// Returns the jobs that users of this machine may see, in the order of their numbers.
    pub fn all(board: &JobBoard) -> Vec<Self> {
        let machines = board.presences();
        let view = |(number, job): (u32, Job)| {
            let machines = machines.iter().filter(|machine| machine.job == Some(number)).count();
            Self::of(number, &job, &board.lead(number).unwrap_or_default(), machines)
        };
        board.shown_jobs().into_iter().map(view).collect()
    }

    /// Makes the view of a job.
    ///
    /// - `lead`: the leader and progress of the job.
    /// - `machines`: number of machines that work on it.
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
            // The leader reports the last zones a little later.
            zones_done: if is_done { lead.zones } else { lead.zones_done },
            zones: lead.zones,
            seconds_left: lead.seconds_left.filter(|_| job.state == JobState::Active && lead.leader.is_some()),
            seen: lead.seen,
            priority: job.priority,
            require: job.require.clone(),
            // A killed machine does not announce that it leaves.
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

/// A machine as shown to observers.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineView {
    /// The presence of the machine, as it announces itself.
    pub presence: Presence,
    /// The state that the machine is commanded to take.
    pub ordered: PresenceState,
}

impl MachineView {
    /// Returns the live machines that users of this machine may see. Waits up to 1.5 s for machines to renew their presences, as
    /// a process that just connected must.
    pub fn all(board: &JobBoard) -> Vec<Self> {
        let view = |presence: Presence| Self { ordered: board.order_to(&presence.name).standing, presence };
        board.shown_machines(board.present()).into_iter().map(view).collect()
    }

    /// Returns the machine as a JSON object, as `bottega machines list --json` prints it.
    pub fn to_value(&self) -> serde_json::Value {
        let Presence { name, threads, devices, version, job, standing, activity, takes_orders, tags, .. } =
            &self.presence;
        serde_json::json!({ "machine": name, "state": standing.word(), "ordered": self.ordered.word(),
            "activity": activity.word(), "threads": threads, "devices": devices, "job": job, "version": version, "takes_orders": takes_orders, "tags": tags })
    }
}

/// A snapshot of a farm.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FarmView {
    /// The jobs, in the order of their numbers.
    pub jobs: Vec<JobView>,
    /// The machines that are present.
    pub machines: Vec<MachineView>,
}

impl FarmView {
    /// Returns the current state of the farm: all jobs, and the machines that `roster` knows to be live.
    ///
    /// - `roster`: the same one for all calls; it recognizes machines that are gone. With a new one, no machine counts as live.
    pub fn of(board: &JobBoard, roster: &mut Roster) -> Self {
        let machines = roster.look(board.presences_with_revision());
        let jobs = board.all().into_iter().map(|(number, job)| {
            let machines = machines.iter().filter(|machine| machine.job == Some(number)).count();
            JobView::of(number, &job, &board.lead(number).unwrap_or_default(), machines)
        });
        let jobs = jobs.collect();
        let machine = |presence: Presence| MachineView { ordered: board.order_to(&presence.name).standing, presence };
        Self { jobs, machines: machines.into_iter().map(machine).collect() }
    }

    /// Returns a job by its number; `None`: there is none.
    pub fn job(&self, number: u32) -> Option<&JobView> {
        self.jobs.iter().find(|job| job.number == number)
    }
}
