//! Tests of the farm's agents as state machines.

mod answers;

use std::{collections::VecDeque, sync::Arc, time::Duration};

use bottega_agents::{
    AclMessage, Action, ActionOf, AgentId, Event, EventOf, Performative as P, StateMachine, Time,
    gateway::PlainContent,
    platform::{Function, LifeCycleRequest, LifeCycleState, ManagementContent, Outcome},
    wire::WireMessage,
};

use bottega::events::{AgentEvent, ZoneChoice, ZoneEvent};

use super::{
    failure::FarmFailure,
    jobs_agent::{ChangeJob, JobsAgent, JobsEffect, JobsReport},
    ontology::{JobChange, ONTOLOGY, request_content},
    render_agent::{GiveOrder, MachineReport, RenderAgent, Surroundings},
    rows::JobRows,
    talk::Message,
};
use crate::job::{
    presence::{Presence, PresenceState},
    view::{FarmView, JobView, MachineView},
};

fn nobody_answers() -> FarmFailure {
    FarmFailure::Farm { chain: "nobody answers".to_owned() }
}

fn id(name: &str) -> AgentId {
    AgentId::new(name)
}

fn around() -> Surroundings {
    let trusted = Arc::new([id("boss@jade")]);
    Surroundings { ams: id("ams@b"), df: id("df@b"), jobs: id("jobs@b"), trusted }
}

fn millis(millis: u64) -> Time {
    Time::since_start(Duration::from_millis(millis))
}

/// Returns a message from an agent of another platform, in its first conversation.
fn says(from: &str, to: &str, act: P, content: &str) -> Message {
    let wire =
        WireMessage { content: Some(content.to_owned()), ontology: Some(ONTOLOGY.to_owned()), ..WireMessage::new(act) };
    let content = PlainContent::Foreign(Arc::new(wire));
    AclMessage { conversation_id: 1, reply_with: 1, ..AclMessage::new(act, id(from), id(to), content) }
}

fn of_management(from: &str, to: &str, act: P, content: ManagementContent) -> Message {
    AclMessage::new(act, id(from), id(to), PlainContent::Management(content))
}

/// The actions that an event has caused; the directories carry out requests at once.
#[derive(Debug)]
struct AgentOutput<E> {
    /// Messages to agents of other platforms: receiver, act, content.
    messages: Vec<(String, P, String)>,
    /// Requests to the directories: sender and function.
    requests: Vec<(String, Function)>,
    effects: Vec<E>,
}

fn after<M>(machine: &mut M, now: Time, event: EventOf<M>) -> AgentOutput<M::Effect>
where
    M: StateMachine<Content = PlainContent>,
{
    let mut actions: VecDeque<ActionOf<M>> = VecDeque::new();
    let handle = |machine: &mut M, event, actions: &mut VecDeque<ActionOf<M>>| {
        let mut more = Vec::new();
        machine.handle(now, event, &mut more);
        actions.extend(more);
    };
    handle(machine, event, &mut actions);
    let mut output = AgentOutput { messages: Vec::new(), requests: Vec::new(), effects: Vec::new() };
    while let Some(action) = actions.pop_front() {
        match action {
            Action::Effect(effect) => output.effects.push(effect),
            Action::Send(message) => match &message.content {
                PlainContent::Foreign(wire) => {
                    let content = wire.content.clone().unwrap_or_default();
                    output.messages.push((message.receivers[0].to_string(), message.performative, content));
                }
                PlainContent::Management(ManagementContent::Action(function)) => {
                    output.requests.push((message.sender.to_string(), function.clone()));
                    if is_answered(&message, function) {
                        let done = ManagementContent::Done(function.clone(), Outcome::Done);
                        let done = message.reply(P::Inform, id("x@b"), PlainContent::Management(done));
                        handle(machine, Event::Message(done), &mut actions);
                    }
                }
                PlainContent::Management(ManagementContent::Cancel) => {
                    output.messages.push((message.receivers[0].to_string(), message.performative, "over".to_owned()));
                }
                PlainContent::Management(_) => {}
            },
            _ => panic!("nothing else is done"),
        }
    }
    output
}

/// Changes that a machine requests in the name of the jobs agent are answered to that agent, not to the machine.
fn is_answered(message: &Message, function: &Function) -> bool {
    message.sender != id("jobs@b") || matches!(function, Function::Register(_) | Function::Modify(_))
}

fn machine(standing: PresenceState, ordered: PresenceState) -> MachineView {
    let presence = Presence { standing, ..Presence::new("m-1", 8, Some(3)) };
    MachineView { presence, ordered }
}

fn render_agent(view: MachineView) -> RenderAgent {
    let mut agent = RenderAgent::new(id("m-1@b"), around(), view, None);
    let output = after(&mut agent, millis(0), Event::Start);
    assert!(matches!(&output.requests[..], [(_, Function::ModifyAgent(_)), (_, Function::Register(_))]), "{output:?}");
    agent
}

fn seen(view: MachineView) -> EventOf<RenderAgent> {
    Event::Completed(MachineReport::Seen(view, None))
}

fn life_cycle(request: LifeCycleRequest) -> EventOf<RenderAgent> {
    Event::Message(of_management("ams@b", "m-1@b", P::Request, ManagementContent::LifeCycle(request)))
}

fn to_machine(from: &str, function: &str) -> EventOf<RenderAgent> {
    Event::Message(says(from, "m-1@b", P::Request, &request_content(&id("m-1@b"), function)))
}

const AID: &str = "(agent-identifier :name m-1@b)";

#[test]
fn what_the_ams_wants_of_a_machine_becomes_an_order_and_what_strangers_want_waits_until_it_is_resumed() {
    let mut agent = render_agent(machine(PresenceState::Active, PresenceState::Active));
    let output = after(&mut agent, millis(1), life_cycle(LifeCycleRequest::Suspend));
    let [GiveOrder { ticket, order }] = &output.effects[..] else { panic!("{output:?}") };
    assert_eq!((order.standing, &*order.by), (PresenceState::Suspended, "ams@b of the platform"));
    // A state seen before the command was applied changes nothing in the white pages.
    let output = after(&mut agent, millis(2000), seen(machine(PresenceState::Active, PresenceState::Active)));
    assert!(output.requests.iter().all(|(_, function)| !resumes(function)), "{output:?}");
    after(&mut agent, millis(2001), seen(machine(PresenceState::Active, PresenceState::Suspended)));
    after(&mut agent, millis(2002), Event::Completed(MachineReport::Given { ticket: *ticket, result: Ok(()) }));
    let output = after(&mut agent, millis(2003), to_machine("boss@jade", "(suspend-machine)"));
    assert!(output.messages.is_empty() && output.effects.is_empty(), "{output:?}");
    after(&mut agent, millis(2500), seen(machine(PresenceState::Suspended, PresenceState::Suspended)));
    let output = after(&mut agent, millis(3000), to_machine("probe@jade", "(describe-machine)"));
    let result = format!(
        "((result (action {AID} (describe-machine)) (machine :name m-1 :state suspended :threads 8 :job 3 :version \
         \"{}\")))",
        crate::build::build().identity()
    );
    assert_eq!(output.messages, [("probe@jade".to_owned(), P::Inform, result)], "only painting is suspended");
    // It is resumed elsewhere in the farm: only the platform may change its entry.
    let output = after(&mut agent, millis(4000), seen(machine(PresenceState::Suspended, PresenceState::Active)));
    assert!(matches!(&output.requests[0], (by, function) if by == "jobs@b" && resumes(function)), "{output:?}");
    let output = after(&mut agent, millis(4001), life_cycle(LifeCycleRequest::Resume));
    // Requests that waited are carried out now.
    let messages: Vec<_> = output.messages.iter().map(|(to, act, _)| (to.as_str(), *act)).collect();
    assert_eq!(messages, [("boss@jade", P::Agree)], "{output:?}");
    assert!(matches!(&output.effects[..], [GiveOrder { order, .. }] if *order.by == *"boss@jade"), "{output:?}");
}

fn resumes(function: &Function) -> bool {
    matches!(function, Function::ModifyAgent(agent) if agent.state == Some(LifeCycleState::Active))
}

#[test]
fn an_order_that_the_farm_does_not_take_is_undone_in_the_white_pages() {
    let mut agent = render_agent(machine(PresenceState::Active, PresenceState::Active));
    let output = after(&mut agent, millis(1), life_cycle(LifeCycleRequest::Suspend));
    let ticket = output.effects[0].ticket;
    let result = Err(nobody_answers());
    let output = after(&mut agent, millis(3000), Event::Completed(MachineReport::Given { ticket, result }));
    assert!(matches!(&output.requests[..], [(by, function)] if by == "jobs@b" && resumes(function)), "{output:?}");
    // The AMS destroys it, but the command fails: it registers again.
    let output = after(&mut agent, millis(3001), life_cycle(LifeCycleRequest::Destroy));
    let ticket = output.effects[0].ticket;
    assert!(output.requests.iter().any(|(_, function)| matches!(function, Function::Deregister(_))), "{output:?}");
    let result = Err(nobody_answers());
    let output = after(&mut agent, millis(9000), Event::Completed(MachineReport::Given { ticket, result }));
    assert!(output.requests.iter().any(|(_, function)| matches!(function, Function::RegisterAgent(_))), "{output:?}");
}

#[test]
fn a_trusted_stranger_can_suspend_a_machine_and_is_informed_when_it_is_suspended() {
    let mut agent = render_agent(machine(PresenceState::Active, PresenceState::Active));
    let action = format!("(action {AID} (suspend-machine))");
    let output = after(&mut agent, millis(1), to_machine("probe@jade", "(suspend-machine)"));
    assert_eq!(output.messages, [("probe@jade".to_owned(), P::Refuse, format!("({action} (unauthorised))"))]);
    let output = after(&mut agent, millis(2), to_machine("Boss@jade", "(suspend-machine)"));
    assert_eq!(output.messages, [("Boss@jade".to_owned(), P::Agree, format!("({action} true)"))]);
    let [GiveOrder { ticket, order }] = &output.effects[..] else { panic!("{output:?}") };
    assert_eq!(&*order.by, "Boss@jade");
    let output =
        after(&mut agent, millis(3), Event::Completed(MachineReport::Given { ticket: *ticket, result: Ok(()) }));
    assert!(output.messages.is_empty(), "it paints yet: {output:?}");
    let output = after(&mut agent, millis(4), seen(machine(PresenceState::Suspended, PresenceState::Suspended)));
    assert_eq!(output.messages, [("Boss@jade".to_owned(), P::Inform, format!("((done {action}))"))]);

    // A machine that does not obey, and one that disappears meanwhile.
    for (event, at) in [(Event::Deadline, 61_001), (Event::Completed(MachineReport::Gone), 5)] {
        let mut agent = render_agent(machine(PresenceState::Active, PresenceState::Active));
        let output = after(&mut agent, millis(1), to_machine("boss@jade", "(suspend-machine)"));
        let ticket = output.effects[0].ticket;
        after(&mut agent, millis(2), Event::Completed(MachineReport::Given { ticket, result: Ok(()) }));
        let output = after(&mut agent, millis(at), event);
        assert!(matches!(&output.messages[..], [(_, P::Failure, _)]), "{output:?}");
    }
}

#[test]
fn what_a_machine_does_not_do_is_refused() {
    let mut fixed = machine(PresenceState::Active, PresenceState::Active);
    fixed.presence.takes_orders = false;
    let mut agent = render_agent(fixed);
    let output = after(&mut agent, millis(1), to_machine("boss@jade", "(suspend-machine)"));
    assert!(matches!(&output.messages[..], [(_, P::Refuse, why)] if why.ends_with("(takes-no-orders))")), "{output:?}");
    // The AMS cannot suspend it either; its entry is set back.
    let output = after(&mut agent, millis(3000), life_cycle(LifeCycleRequest::Suspend));
    assert!(
        output.effects.is_empty()
            && matches!(&output.requests[0], (by, function) if by == "jobs@b" && resumes(function))
    );
    after(&mut agent, millis(3001), life_cycle(LifeCycleRequest::Resume));
    let output = after(&mut agent, millis(3002), to_machine("boss@jade", "(dance :well true)"));
    assert!(matches!(&output.messages[..], [(_, P::Refuse, why)] if why.ends_with("(unsupported-function dance))")));
    for (act, content, why) in [
        (P::Request, "((action", "((unrecognised-value content))"),
        (P::Request, "(a b)", "((a b) (unrecognised-value content))"),
        (P::CallForProposal, "()", "((unsupported-act cfp))"),
    ] {
        let output = after(&mut agent, millis(4000), Event::Message(says("boss@jade", "m-1@b", act, content)));
        assert_eq!(output.messages, [("boss@jade".to_owned(), P::NotUnderstood, why.to_owned())], "{content}");
    }
    let output = after(&mut agent, millis(5000), Event::Message(says("boss@jade", "m-1@b", P::Inform, "((what))")));
    assert!(output.messages.is_empty(), "nobody answers an answer");
}

#[test]
fn a_silent_machine_leaves_the_directories_and_comes_back() {
    let mut agent = render_agent(machine(PresenceState::Active, PresenceState::Active));
    let output = after(&mut agent, millis(2000), Event::Completed(MachineReport::Gone));
    let out = |function: &Function| matches!(function, Function::DeregisterAgent(_) | Function::Deregister(_));
    assert!(output.requests.len() == 2 && output.requests.iter().all(|(_, function)| out(function)), "{output:?}");
    let output = after(&mut agent, millis(2500), to_machine("probe@jade", "(describe-machine)"));
    assert!(matches!(&output.messages[..], [(_, P::Failure, _)]), "{output:?}");
    let output = after(&mut agent, millis(9000), seen(machine(PresenceState::Active, PresenceState::Active)));
    assert!(
        matches!(&output.requests[..2], [(_, Function::RegisterAgent(_)), (_, Function::Register(_))]),
        "{output:?}"
    );
}

fn job(number: u32, state: &'static str, done: f64) -> JobView {
    JobView {
        number,
        state,
        reason: None,
        done,
        zones_done: 0,
        zones: 24,
        seconds_left: None,
        seen: false,
        priority: 10,
        require: Vec::new(),
        machines: 1,
        leader: None,
        from: "m-1".to_owned(),
        submitted: 5,
        scene: "a scene.glb".to_owned(),
        output: "o.exr".to_owned(),
        animation: None,
        stirs: 0,
        kept: false,
        is_over: state == "done",
    }
}

fn farm(jobs: Vec<JobView>) -> Arc<FarmView> {
    Arc::new(FarmView { jobs, machines: vec![machine(PresenceState::Active, PresenceState::Active)] })
}

fn jobs_agent(jobs: Vec<JobView>) -> JobsAgent {
    let mut agent = JobsAgent::new(around(), "b".to_owned(), farm(jobs));
    after(&mut agent, millis(0), Event::Start);
    agent
}

fn to_jobs(from: &str, function: &str) -> EventOf<JobsAgent> {
    Event::Message(says(from, "jobs@b", P::Request, &request_content(&id("jobs@b"), function)))
}

fn farm_report(jobs: Vec<JobView>) -> EventOf<JobsAgent> {
    Event::Completed(JobsReport::Farm(farm(jobs)))
}

#[test]
fn anybody_may_list_jobs_and_trusted_agents_may_change_them() {
    let mut agent = jobs_agent(vec![job(1, "done", 1.0), job(2, "active", 0.25)]);
    let one = "(job :number 2 :state active :done 0.25 :zones-done 0 :zones 24 :priority 10 :machines 1 :from m-1 \
               :submitted 5 :scene \"a scene.glb\" :output o.exr :kept false)";
    let action = |function: &str| format!("(action (agent-identifier :name jobs@b) {function})");
    let output = after(&mut agent, millis(1), to_jobs("probe@jade", "(describe-job :job 2)"));
    let result = format!("((result {} {one}))", action("(describe-job :job 2)"));
    assert_eq!(output.messages, [("probe@jade".to_owned(), P::Inform, result)]);
    let output = after(&mut agent, millis(1), to_jobs("probe@jade", "(list-jobs)"));
    assert!(output.messages[0].2.ends_with(&format!(" {one})))")), "{output:?}");
    let output = after(&mut agent, millis(1), to_jobs("probe@jade", "(list-machines)"));
    assert!(output.messages[0].2.contains("(sequence (machine :name m-1 "), "{output:?}");
    for (from, function, why) in [
        ("probe@jade", "(pause-job :job 2)", "(unauthorised)"),
        ("boss@jade", "(pause-job :job 1)", "(job-is-over done)"),
        ("boss@jade", "(pause-job :job 7)", "(unrecognised-parameter-value pause-job job)"),
        ("boss@jade", "(describe-job :job 7)", "(unrecognised-parameter-value describe-job job)"),
        (
            "boss@jade",
            "(set-priority :job 2 :priority 4000000000)",
            "(unrecognised-parameter-value set-priority priority)",
        ),
    ] {
        let output = after(&mut agent, millis(2), to_jobs(from, function));
        let refusal = [(from.to_owned(), P::Refuse, format!("({} {why})", action(function)))];
        assert_eq!((&output.messages[..], output.effects.len()), (&refusal[..], 0), "{function}");
    }
    for (result, act) in [(Ok(()), P::Inform), (Err(nobody_answers()), P::Failure)] {
        let output = after(&mut agent, millis(3), to_jobs("boss@jade", "(set-priority :job 2 :priority 30)"));
        assert_eq!(output.messages[0].1, P::Agree);
        let [JobsEffect::Change(ChangeJob { ticket, number: 2, change: JobChange::Priority(30), by })] =
            &output.effects[..]
        else {
            panic!("{output:?}")
        };
        assert_eq!(by, "boss@jade");
        let ticket = *ticket;
        let output = after(&mut agent, millis(4), Event::Completed(JobsReport::Changed { ticket, result }));
        assert_eq!(output.messages[0].1, act, "{output:?}");
    }
}

/// A zone's row, of 4 × 3 pixels.
fn row(id: u32, state: &str) -> ZoneEvent {
    ZoneEvent {
        id,
        work: 77,
        size: 12,
        rect: [0, 0, 4, 3],
        seconds_estimated: Some(1.25),
        seconds_measured: Some(1.5),
        agent: Some("a@m-1".to_owned()),
        choice: Some(ZoneChoice { max_depth: 8, light_samples: 4, samples: 64, bands: [0, 2, 0, 1] }),
        samples: 64,
        state: state.to_owned(),
        ..ZoneEvent::default()
    }
}

fn rows(zones: Vec<ZoneEvent>) -> JobRows {
    let agent = AgentEvent {
        agent: "a@m-1".to_owned(),
        power: 0.5,
        lanes: 1.0,
        credit: -0.25,
        reliability: 1.0,
        seconds: None,
        failures: 0,
        left_out: None,
    };
    JobRows { zones, agents: vec![agent] }
}

/// The subscriber of a Blackboard is informed of all rows, then of those that have changed, and of the end.
#[test]
fn a_subscriber_of_rows_is_informed_of_changes_and_of_the_end() {
    let mut agent = jobs_agent(vec![job(2, "active", 0.25)]);
    let wish = "((iota ?x (result (action (agent-identifier :name jobs@b) (read-rows :job 2)) ?x)))";
    // The rows that are read for the subscriber at a time, if any are.
    let read = |output: &AgentOutput<JobsEffect>| match output.effects[..] {
        [JobsEffect::ReadRows { ticket, number: 2 }] => Some(ticket),
        _ => None,
    };
    let report = |agent: &mut JobsAgent, at, ticket, zones| {
        after(agent, millis(at), Event::Completed(JobsReport::Rows { ticket, rows: Ok(rows(zones)) })).messages
    };
    let output = after(&mut agent, millis(100), Event::Message(says("probe@jade", "jobs@b", P::Subscribe, wish)));
    assert_eq!(output.messages[0].1, P::Agree);
    let ticket = read(&output).expect("rows are read at once");
    // All rows
    let messages = report(&mut agent, 110, ticket, vec![row(0, "open"), row(1, "open")]);
    assert!(messages.len() == 1 && messages[0].2.matches(":state open").count() == 2, "{messages:?}");
    // Nothing is read before half a second is over, and nothing is sent if nothing changed
    assert_eq!(read(&after(&mut agent, millis(300), Event::Deadline)), None);
    let ticket = read(&after(&mut agent, millis(610), Event::Deadline)).expect("rows are read again");
    assert_eq!(report(&mut agent, 620, ticket, vec![row(0, "open"), row(1, "open")]), []);
    // The row that changed
    let ticket = read(&after(&mut agent, millis(1120), Event::Deadline)).expect("rows are read again");
    let messages = report(&mut agent, 1130, ticket, vec![row(0, "open"), row(1, "awarded")]);
    assert!(
        messages.len() == 1 && messages[0].2.contains(":zone 1") && !messages[0].2.contains(":zone 0"),
        "{messages:?}"
    );
    // The farm does not answer once; the subscription lasts
    let ticket = read(&after(&mut agent, millis(1630), Event::Deadline)).expect("rows are read again");
    let lost = Event::Completed(JobsReport::Rows { ticket, rows: Err(nobody_answers()) });
    assert_eq!(after(&mut agent, millis(1640), lost).messages, []);
    // The end
    after(&mut agent, millis(1700), farm_report(vec![job(2, "done", 1.0)]));
    let ticket = read(&after(&mut agent, millis(2200), Event::Deadline)).expect("rows are read a last time");
    let messages = report(&mut agent, 2210, ticket, vec![row(0, "done"), row(1, "done")]);
    assert!(messages.len() == 2 && messages[1].2 == "over", "{messages:?}");
    assert_eq!(read(&after(&mut agent, millis(3000), Event::Deadline)), None);
}

#[test]
fn the_rows_of_a_job_are_read_by_anybody() {
    let mut agent = jobs_agent(vec![job(2, "active", 0.25)]);
    for (function, rows, act, expected) in [
        (
            "(read-rows :job 2 :zone 4)",
            Ok(rows(vec![row(3, "done"), row(4, "done")])),
            P::Inform,
            "(sequence (row :work 77 :zone 4 :size 12 :complexity 0 :time-estimated 1.25 :time-real 1.5 :agent a@m-1 :power \
             0.5 :credit -0.25 :state done :x0 0 :y0 0 :x1 4 :y1 3 :samples 64 :attempt 0 :max-depth 8 :light-samples 4 \
             :samples-chosen 64 :bands (sequence 0 2 0 1)))",
        ),
        ("(read-rows :job 2)", Err(nobody_answers()), P::Failure, "(internal-error \"nobody answers\")"),
    ] {
        let output = after(&mut agent, millis(1), to_jobs("probe@jade", function));
        let [JobsEffect::ReadRows { ticket, number: 2 }] = output.effects[..] else { panic!("{output:?}") };
        assert!(output.messages.is_empty());
        let output = after(&mut agent, millis(2), Event::Completed(JobsReport::Rows { ticket, rows }));
        assert!(output.messages[0].1 == act && output.messages[0].2.contains(expected), "{output:?}");
    }
    let output = after(&mut agent, millis(3), to_jobs("probe@jade", "(read-rows :job 9)"));
    assert!(output.messages[0].1 == P::Refuse && output.effects.is_empty(), "{output:?}");
}

#[test]
fn while_the_farm_does_not_answer_every_question_is_a_failure() {
    let mut agent = jobs_agent(vec![job(2, "active", 0.25)]);
    after(&mut agent, millis(1000), Event::Completed(JobsReport::Silent));
    after(&mut agent, millis(2000), Event::Completed(JobsReport::Silent));
    for function in ["(list-jobs)", "(list-machines)", "(describe-job :job 2)", "(pause-job :job 2)"] {
        let output = after(&mut agent, millis(8500), to_jobs("boss@jade", function));
        assert_eq!(
            (output.messages.len(), output.messages[0].1, output.effects.len()),
            (1, P::Failure, 0),
            "{output:?}"
        );
        assert!(
            output.messages[0].2.ends_with("(internal-error \"the farm has not answered for 7 s\"))"),
            "{output:?}"
        );
    }
    let messages = subscribe(&mut agent, millis(8600)).messages;
    assert!(matches!(&messages[..], [(_, P::Failure, _)]), "{messages:?}");
    let output = after(&mut agent, millis(8700), to_jobs("boss@jade", "(dance)"));
    assert_eq!(output.messages[0].1, P::Refuse, "what is never done is refused: {output:?}");
    after(&mut agent, millis(9000), farm_report(vec![job(2, "active", 0.5)]));
    let output = after(&mut agent, millis(9001), to_jobs("boss@jade", "(list-machines)"));
    assert_eq!(output.messages[0].1, P::Inform);

    let mut agent = render_agent(machine(PresenceState::Active, PresenceState::Active));
    after(&mut agent, millis(1000), Event::Completed(MachineReport::Silent));
    for function in ["(describe-machine)", "(suspend-machine)"] {
        let output = after(&mut agent, millis(3000), to_machine("boss@jade", function));
        assert!(matches!(&output.messages[..], [(_, P::Failure, why)] if why.contains("for 2 s")), "{output:?}");
    }
    after(&mut agent, millis(4000), seen(machine(PresenceState::Active, PresenceState::Active)));
    assert_eq!(after(&mut agent, millis(4001), to_machine("boss@jade", "(describe-machine)")).messages[0].1, P::Inform);
}

const WISH: &str = "((iota ?x (result (action (agent-identifier :name jobs@b) (describe-job :job 2)) ?x)))";

fn subscribe(agent: &mut JobsAgent, now: Time) -> AgentOutput<JobsEffect> {
    after(agent, now, Event::Message(says("probe@jade", "jobs@b", P::Subscribe, WISH)))
}

#[test]
fn a_subscriber_is_informed_twice_a_second_at_most_and_always_of_the_end() {
    let mut agent = jobs_agent(vec![job(2, "active", 0.0)]);
    let output = subscribe(&mut agent, millis(100));
    let acts: Vec<P> = output.messages.iter().map(|(_, act, _)| *act).collect();
    assert_eq!(acts, [P::Agree, P::Inform], "{output:?}");
    assert_eq!(output.messages[0].2, format!("({} true)", &WISH[1..WISH.len() - 1]));
    let mut report_times = vec![100];
    let mut last = String::new();
    // A change every 70 ms for 7 s; the last one is the end.
    for step in 1..=100_u32 {
        let state = if step == 100 { "done" } else { "active" };
        let (from, to) = (u64::from(step) * 70 + 100, u64::from(step) * 70 + 170);
        let mut output =
            after(&mut agent, millis(from), farm_report(vec![job(2, state, f64::from(step) / 100.0)])).messages;
        let deadline = agent.next_deadline().filter(|at| *at < millis(to));
        let mut times: Vec<u64> = output.iter().map(|_| from).collect();
        if let Some(at) = deadline {
            let later = after(&mut agent, at, Event::Deadline).messages;
            times.extend(later.iter().map(|_| at.elapsed().as_millis() as u64));
            output.extend(later);
        }
        for ((_, act, content), time) in output.into_iter().zip(times) {
            assert_eq!(act, P::Inform);
            if content != "over" {
                report_times.push(time);
            }
            last = content;
        }
    }
    while let Some(at) = agent.next_deadline().filter(|at| *at < millis(9000)) {
        for (_, _, content) in after(&mut agent, at, Event::Deadline).messages {
            last = content;
        }
    }
    assert_eq!(last, "over");
    assert!(report_times.windows(2).all(|pair| pair[1] - pair[0] >= 500), "{report_times:?}");
    assert!(report_times.len() >= 13, "{report_times:?}");
    let output = after(&mut agent, millis(9999), farm_report(vec![job(2, "done", 0.5)]));
    assert!(output.messages.is_empty(), "it is over: {output:?}");
}

#[test]
fn the_last_that_a_subscriber_hears_of_a_job_is_how_it_stands() {
    let mut agent = jobs_agent(vec![job(2, "active", 0.0)]);
    subscribe(&mut agent, millis(0));
    assert!(after(&mut agent, millis(100), farm_report(vec![job(2, "active", 0.1)])).messages.is_empty());
    assert!(after(&mut agent, millis(200), farm_report(vec![job(2, "done", 1.0)])).messages.is_empty());
    assert_eq!(agent.next_deadline(), Some(millis(500)));
    let messages = after(&mut agent, millis(500), Event::Deadline).messages;
    assert!(
        messages.len() == 2 && messages[0].2.contains(":state done :done 1 ") && messages[1].2 == "over",
        "{messages:?}"
    );
    // For a job that is over already, there is a single report, at once.
    let messages = subscribe(&mut agent, millis(600)).messages;
    assert_eq!(messages.iter().map(|(_, act, _)| *act).collect::<Vec<_>>(), [P::Agree, P::Inform, P::Inform]);
}

#[test]
fn a_subscription_is_refused_cancelled_or_forgotten() {
    let mut agent = jobs_agent(vec![job(2, "active", 0.0)]);
    let says = |act, content: &str| Event::Message(says("probe@jade", "jobs@b", act, content));
    let output = after(&mut agent, millis(0), says(P::Subscribe, &WISH.replace(":job 2", ":job 9")));
    assert!(
        matches!(&output.messages[..], [(_, P::Refuse, why)] if why.ends_with("(unrecognised-parameter-value describe-job job))"))
    );
    let output = after(&mut agent, millis(0), says(P::Subscribe, &WISH.replace("describe", "pause")));
    assert!(
        matches!(&output.messages[..], [(_, P::Refuse, why)] if why.ends_with("(unsupported-function pause-job))"))
    );
    let output = after(&mut agent, millis(0), says(P::Subscribe, "((all ?x ?x))"));
    assert!(matches!(&output.messages[..], [(_, P::NotUnderstood, _)]), "{output:?}");
    let output = after(&mut agent, millis(0), says(P::Cancel, WISH));
    assert!(
        matches!(&output.messages[..], [(_, P::NotUnderstood, why)] if why == "((unexpected-act cancel))"),
        "{output:?}"
    );
    subscribe(&mut agent, millis(1));
    let output = after(&mut agent, millis(2), says(P::Cancel, "no SL ("));
    assert_eq!(output.messages, [("probe@jade".to_owned(), P::Inform, "over".to_owned())]);
    assert!(after(&mut agent, millis(2000), farm_report(vec![job(2, "active", 0.5)])).messages.is_empty());

    // An unreachable subscriber is tried again, for a while.
    subscribe(&mut agent, millis(10_000));
    let lost = || {
        let content = ManagementContent::Undelivered { receiver: id("Probe@jade"), reason: "no connection".to_owned() };
        Event::Message(of_management("ams@b", "jobs@b", P::Failure, content))
    };
    let mut tries = 0;
    let mut now = millis(10_000);
    let messages = loop {
        let messages = after(&mut agent, now + Duration::from_secs(3), lost()).messages;
        if !messages.is_empty() {
            break messages;
        }
        now = agent.next_deadline().expect("another try");
        assert_eq!(after(&mut agent, now, Event::Deadline).messages.len(), 1);
        tries += 1;
        assert!(tries < 10);
    };
    assert!(tries >= 2 && matches!(&messages[..], [(_, P::Failure, _)]), "{tries}: {messages:?}");
    let output = after(&mut agent, now + Duration::from_secs(60), farm_report(vec![job(2, "active", 0.9)]));
    assert!(output.messages.is_empty(), "it is forgotten: {output:?}");
    // A job that was removed from the farm is a failure.
    subscribe(&mut agent, now + Duration::from_secs(61));
    let output = after(&mut agent, now + Duration::from_secs(62), farm_report(Vec::new()));
    assert!(matches!(&output.messages[..], [(_, P::Failure, _)]), "{output:?}");
}

#[test]
fn entries_of_machines_that_left_unnoticed_are_removed() {
    let mut agent = jobs_agent(Vec::new());
    let mut actions = Vec::new();
    agent.handle(millis(5000), Event::Deadline, &mut actions);
    let search = actions.iter().find_map(|action| match action {
        Action::Send(message) => match &message.content {
            PlainContent::Management(ManagementContent::Action(Function::SearchAgents(..))) => Some(message.clone()),
            _ => None,
        },
        _ => None,
    });
    let search = search.expect("a search");
    let agents = ["m-1@b", "m-2@b", "stranger@jade"]
        .map(|name| bottega_agents::platform::AmsAgentDescription { name: Some(id(name)), ..Default::default() });
    let PlainContent::Management(ManagementContent::Action(function)) = &search.content else { unreachable!() };
    let found = ManagementContent::Done(function.clone(), Outcome::Agents(agents.to_vec()));
    let answer = search.reply(P::Inform, id("ams@b"), PlainContent::Management(found));
    let output = after(&mut agent, millis(5001), Event::Message(answer));
    let gone: Vec<String> = output
        .requests
        .iter()
        .map(|(_, function)| match function {
            Function::DeregisterAgent(agent) => agent.name.as_ref().unwrap().to_string(),
            Function::Deregister(offer) => offer.name.as_ref().unwrap().to_string(),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(gone, ["m-2@b", "m-2@b"]);
}
