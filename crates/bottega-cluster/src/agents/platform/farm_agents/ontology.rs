//! The ontology `bottega-farm`: requests of other platforms' agents to a farm, between FIPA SL and types.
//!
//! Requests use `fipa-request`, in SL0. An agent that receives a request for a change first agrees, and then confirms that it is
//! done. Parameters are named; names of functions, objects and parameters are compared without case, and unknown parameters
//! are ignored. Below, `AID` is the agent that receives the request.
//!
//! `jobs@PLATFORM`, of the service type `bottega-jobs`:
//!
//! | function | is answered by |
//! |---|---|
//! | `(list-jobs)`, `(list-machines)` | the result, a sequence of jobs, of machines |
//! | `(describe-job :job 3)` | the result, a job |
//! | `(pause-job :job 3)`, `(resume-job :job 3)`, `(cancel-job :job 3)` | done |
//! | `(set-priority :job 3 :priority 30)`, from 1 to 1000 | done |
//!
//! It is also the Blackboard of all jobs, of the service type `bottega-blackboard`. Only the agent with the award of a zone
//! writes its row, by delivering the result:
//!
//! | function | is answered by |
//! |---|---|
//! | `(read-rows :job 3)`, `(read-rows :job 3 :zone 4)` | the result, a sequence of rows |
//!
//! Each machine, under its name in the farm, of the service type `bottega-render`:
//!
//! | function | is answered by |
//! |---|---|
//! | `(describe-machine)` | the result, a machine |
//! | `(suspend-machine)` | done, when it has handed back what it painted; the AMS resumes it |
//! | `(terminate-machine)` | done, when it has left the farm |
//!
//! The objects, with their parameters; absent values are left out:
//!
//! ```text
//! (job :number 3 :state active :done 0.42 :zones-done 10 :zones 24 :priority 10 :machines 2 :leader atelier-1f00aa
//!      :from atelier-1f00aa :submitted 1795227948 :scene goblets.glb :output night.exr :kept false)
//! (row :work 77 :zone 4 :size 768 :complexity 912.5 :time-estimated 1.25 :time-real 1.31 :agent render-1@atelier-1f00aa
//!      :power 0.8 :credit -0.25 :state done :neighbor-difference 0.4 :x0 0 :y0 0 :x1 32 :y1 24 :samples 64 :attempt 0
//!      :max-depth 8 :light-samples 1 :samples-chosen 64 :bands (sequence 0 2 0 2) :reasons "path_tracing: 12 0.83")
//! (machine :name atelier-1f00aa :state active :threads 8 :job 3 :version "0.1.0" :paints (job :number 3 …))
//! ```
//!
//! A row begins with the seven fields of the MAGarRO paper (section 3.1). `power` and `credit` are V_cp and credit of its
//! agent. `max-depth` and what follows are the settings that the rules chose; `bands` are the widths of the interpolation
//! bands left, above, right and below, in pixels.
//!
//! A job's `state` is `active`, `paused`, `done`, `failed` (with a `reason`) or `cancelled`; `done` is the share of its
//! cost that is painted, 0 to 1; `kept` is true if `bottega jobs fetch` can get its picture. A machine's `state` is
//! `active` or `suspended`; a suspended machine answers only `describe-machine` and keeps other requests. The answer
//! to a direct request includes the job that the machine `paints`, with its progress.
//!
//! A request and its answers, for example:
//!
//! ```text
//! (request … :receiver (set (agent-identifier :name jobs@bottega …)) :language fipa-sl0 :ontology bottega-farm
//!  :protocol fipa-request :content "((action (agent-identifier :name jobs@bottega) (pause-job :job 3)))")
//! (agree  … "((action (agent-identifier :name jobs@bottega) (pause-job :job 3)) true)")
//! (inform … "((done (action (agent-identifier :name jobs@bottega) (pause-job :job 3))))")
//! ```
//!
//! To follow the progress of a job, subscribe (`fipa-subscribe`, in `fipa-sl`) to `jobs@PLATFORM`. The subscriber is
//! informed at once, then of each change, at most twice a second; when the job is over, of its end, and that the
//! conversation is done:
//!
//! ```text
//! (subscribe … "((iota ?x (result (action (agent-identifier :name jobs@bottega) (describe-job :job 3)) ?x)))")
//! (agree     … "((iota …) true)")
//! (inform    … "((= (iota …) (job :number 3 :state active :done 0.42 …)))")
//! (inform    … "((= (iota …) (job :number 3 :state done :done 1 …)))")
//! (inform    … "((done (iota …)))")
//! ```
//!
//! To follow a Blackboard, subscribe to its rows. The subscriber is informed of all rows at once, then of those that
//! changed, at most twice a second; when the job is over, of the last changes, and that the conversation is done:
//!
//! ```text
//! (subscribe … "((iota ?x (result (action (agent-identifier :name jobs@bottega) (read-rows :job 3)) ?x)))")
//! (inform    … "((= (iota …) (sequence (row :work 77 :zone 0 :state open …) (row :work 77 :zone 1 …) …)))")
//! (inform    … "((= (iota …) (sequence (row :work 77 :zone 1 :state awarded …))))")
//! ```
//!
//! A `cancel` with the same conversation-id ends the subscription early; a subscriber that cannot be reached for a while is
//! dropped. If a job is removed from the farm before its end was reported, the answer is a failure.
//!
//! Not understood: another ontology, a language other than SL, another act, content that is not SL or not an action.
//! Refused, with the reason: `(unsupported-function F)`, `(missing-parameter F p)`, `(unrecognised-parameter-value F p)`
//! (also for a job that does not exist), `(unauthorised)` for a change by an agent that is not trusted,
//! `(job-is-over STATE)`, and `(takes-no-orders)` from a process that submitted a job and only works on that. If the farm
//! does not answer, the result is a failure: `(internal-error "why")`; so is every request while its server is away, with
//! the time since then.

use bottega_agents::sl::Term;

use super::terms::{Call, Fields, Unread, unrecognised_content};
use crate::job::view::{JobView, MachineView};
use bottega::events::{AgentEvent, ZoneEvent};
use bottega::request::PRIORITY_MAX;

/// The name of the ontology.
pub(super) const ONTOLOGY: &str = "bottega-farm";

/// A change of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum JobChange {
    Pause,
    Resume,
    Cancel,
    Priority(u32),
}

/// A request to `jobs@PLATFORM`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum JobsFunction {
    ListJobs,
    ListMachines,
    Describe(u32),
    ReadRows(u32, Option<u32>),
    Change(u32, JobChange),
}

/// A request to a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MachineFunction {
    Describe,
    Suspend,
    Terminate,
}

/// Reads a request to `jobs@PLATFORM`.
pub(super) fn read_jobs_function(action: &Term) -> Result<JobsFunction, Unread> {
    let call = Call::of(action)?;
    let change = |change| Ok(JobsFunction::Change(call.number("job")?, change));
    if call.is("list-jobs") {
        Ok(JobsFunction::ListJobs)
    } else if call.is("list-machines") {
        Ok(JobsFunction::ListMachines)
    } else if call.is("describe-job") {
        Ok(JobsFunction::Describe(call.number("job")?))
    } else if call.is("read-rows") {
        let zone = call.value("zone")?.map(|_| call.number("zone")).transpose()?;
        Ok(JobsFunction::ReadRows(call.number("job")?, zone))
    } else if call.is("pause-job") {
        change(JobChange::Pause)
    } else if call.is("resume-job") {
        change(JobChange::Resume)
    } else if call.is("cancel-job") {
        change(JobChange::Cancel)
    } else if call.is("set-priority") {
        let priority = call.number("priority")?;
        if !(1..=PRIORITY_MAX).contains(&priority) {
            return Err(call.bad("priority"));
        }
        change(JobChange::Priority(priority))
    } else {
        Err(call.unsupported())
    }
}

/// Returns the refusal of a request about a job that does not exist.
pub(super) fn no_such_job(action: &Term) -> Unread {
    match Call::of(action) {
        Ok(call) => call.bad("job"),
        Err(unread) => unread,
    }
}

/// Reads a request to a machine.
pub(super) fn read_machine_function(action: &Term) -> Result<MachineFunction, Unread> {
    let call = Call::of(action)?;
    if call.is("describe-machine") {
        Ok(MachineFunction::Describe)
    } else if call.is("suspend-machine") {
        Ok(MachineFunction::Suspend)
    } else if call.is("terminate-machine") {
        Ok(MachineFunction::Terminate)
    } else {
        Err(call.unsupported())
    }
}

/// The subject of a subscription.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Followed {
    /// The progress of a job.
    Job,
    /// The rows of all zones of the job, or of one.
    Rows(Option<u32>),
}

/// Reads `(iota ?x (result (action AID (describe-job :job N)) ?x))`, or the same with `read-rows`; the variable may have any
/// name. Returns the job number, what is followed of it, and the inner action.
pub(super) fn read_wish(iota: &Term) -> Result<(u32, Followed, &Term), Unread> {
    let Some([_, result]) = iota.arguments_of("iota") else { return Err(unrecognised_content()) };
    let Some([action, _]) = result.arguments_of("result") else { return Err(unrecognised_content()) };
    match read_jobs_function(action)? {
        JobsFunction::Describe(number) => Ok((number, Followed::Job, action)),
        JobsFunction::ReadRows(number, zone) => Ok((number, Followed::Rows(zone), action)),
        _ => Err(Call::of(action)?.unsupported()),
    }
}

/// Returns a job as an object.
pub(super) fn job_term(job: &JobView) -> Term {
    // The value comes from another process: sanitize it.
    let done = if job.done.is_finite() { job.done.clamp(0.0, 1.0) } else { 0.0 };
    let fields = Fields::of("job")
        .number("number", &job.number)
        .text("state", job.state)
        .text_if("reason", job.reason.as_deref())
        .number("done", &((done * 1e4).round() / 1e4))
        .number("zones-done", &job.zones_done)
        .number("zones", &job.zones)
        .number("priority", &job.priority)
        .number("machines", &job.machines)
        .text_if("leader", job.leader.as_deref())
        .text("from", &job.from)
        .number("submitted", &job.submitted)
        .text("scene", &job.scene)
        .text("output", &job.output)
        .number("kept", &job.kept);
    fields.term()
}

/// Returns a zone's row as an object: the paper's seven fields first, times in seconds of the reference machine.
///
/// - `agent`: the row of its agent, if it has one.
pub(super) fn row_term(row: &ZoneEvent, agent: Option<&AgentEvent>) -> Term {
    let number_if = |fields: Fields, key: &str, value: Option<f64>| match value {
        // The values come from another process: leave out what is not a number.
        Some(value) if value.is_finite() => fields.number(key, &((value * 1e6).round() / 1e6)),
        _ => fields,
    };
    let fields = Fields::of("row")
        .number("work", &row.work)
        .number("zone", &row.id)
        .number("size", &row.size)
        .number("complexity", &((row.complexity * 1e4).round() / 1e4));
    let fields = number_if(fields, "time-estimated", row.seconds_estimated);
    let fields = number_if(fields, "time-real", row.seconds_measured);
    let [x0, y0, x1, y1] = row.rect;
    let fields = fields.text_if("agent", row.agent.as_deref());
    let fields = number_if(fields, "power", agent.map(|agent| agent.power));
    let fields = number_if(fields, "credit", agent.map(|agent| agent.credit));
    let fields = number_if(fields.text("state", &row.state), "neighbor-difference", row.neighbor_difference);
    let fields = fields.number("x0", &x0).number("y0", &y0).number("x1", &x1).number("y1", &y1);
    let fields = fields.number("samples", &row.samples).number("attempt", &row.attempt);
    let fields = match row.choice {
        Some(choice) => fields
            .number("max-depth", &choice.max_depth)
            .number("light-samples", &choice.light_samples)
            .number("samples-chosen", &choice.samples)
            .put("bands", Term::call("sequence", choice.bands.map(|band| Term::integer(band.into())))),
        None => fields,
    };
    number_if(fields, "error", row.error).text_if("reasons", row.reasons.as_deref()).term()
}

/// Returns a machine as an object.
///
/// - `job`: the job that it works on, if it is included.
pub(super) fn machine_term(machine: &MachineView, job: Option<&JobView>) -> Term {
    let presence = &machine.presence;
    let fields = Fields::of("machine")
        .text("name", &presence.name)
        .text("state", presence.standing.word())
        .number("threads", &presence.threads);
    let fields = match presence.job {
        Some(job) => fields.number("job", &job),
        None => fields,
    };
    let fields = fields.text("version", &presence.version);
    let fields = match job {
        Some(job) => fields.put("paints", job_term(job)),
        None => fields,
    };
    fields.term()
}

/// Returns the content of a request to an agent, in SL.
#[cfg(test)]
pub(super) fn request_content(agent: &bottega_agents::AgentId, function: &str) -> String {
    use bottega_agents::sl;
    let aid = Term::call("agent-identifier", [Term::Bare(":name".to_owned()), Term::text(&*agent.name)]);
    let function = sl::parse_term(function).unwrap();
    sl::print(&[Term::call("action", [aid, function])])
}

#[cfg(test)]
mod tests {
    use bottega_agents::{AgentId, sl};

    use super::*;

    fn read(function: &str) -> Result<JobsFunction, String> {
        let content = request_content(&AgentId::new("jobs@b"), function);
        read_jobs_function(&sl::parse(&content).unwrap()[0]).map_err(|unread| match unread {
            Unread::Refused(reason) => sl::print_term(&reason),
            Unread::NotUnderstood(reason) => format!("not understood: {}", sl::print_term(&reason)),
        })
    }

    #[test]
    fn requests_are_read_and_absurd_ones_refused_with_the_reasons_of_fipa() {
        assert_eq!(read("(list-jobs)"), Ok(JobsFunction::ListJobs));
        assert_eq!(read("(List-Machines)"), Ok(JobsFunction::ListMachines));
        assert_eq!(read("(describe-job :job 3)"), Ok(JobsFunction::Describe(3)));
        assert_eq!(read("(read-rows :job 3)"), Ok(JobsFunction::ReadRows(3, None)));
        assert_eq!(read("(read-rows :job 3 :zone 4)"), Ok(JobsFunction::ReadRows(3, Some(4))));
        assert_eq!(read("(pause-job :why weather :job 3)"), Ok(JobsFunction::Change(3, JobChange::Pause)));
        assert_eq!(
            read("(set-priority :job \"3\" :PRIORITY 1000)"),
            Ok(JobsFunction::Change(3, JobChange::Priority(1000)))
        );
        for (function, reason) in [
            ("(read-rows :job 3 :zone x)", "(unrecognised-parameter-value read-rows zone)"),
            ("(read-rows :zone 4)", "(missing-parameter read-rows job)"),
            ("(dance)", "(unsupported-function dance)"),
            ("(pause-job)", "(missing-parameter pause-job job)"),
            ("(pause-job 3)", "(unexpected-argument-count)"),
            ("(pause-job :job)", "(unexpected-argument-count)"),
            ("(pause-job :job -1)", "(unrecognised-parameter-value pause-job job)"),
            ("(pause-job :job 99999999999)", "(unrecognised-parameter-value pause-job job)"),
            ("(pause-job :job (set 1 2))", "(unrecognised-parameter-value pause-job job)"),
            ("(set-priority :job 3 :priority 0)", "(unrecognised-parameter-value set-priority priority)"),
            ("(set-priority :job 3 :priority 1001)", "(unrecognised-parameter-value set-priority priority)"),
            ("(set-priority :job 3 :priority 1e9)", "(unrecognised-parameter-value set-priority priority)"),
            ("((set))", "not understood: (unrecognised-value content)"),
        ] {
            assert_eq!(read(function), Err(reason.to_owned()), "{function}");
        }
    }
}
