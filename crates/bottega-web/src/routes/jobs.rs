//! The routes of jobs: submitting, viewing, steering.

use std::sync::Arc;

use axum::{
    Extension,
    extract::{Request, State},
    http::{StatusCode, header},
    response::IntoResponse,
    routing::{delete, get, post, put},
};
use bottega::{Event, Request as PictureRequest, events::ZoneEvent, request::PRIORITY_MAX};
use bottega_cluster::{
    LogLine,
    energy::JobEnergy,
    messages::SeenMessages,
    rules_of_job::{JobRules, ZoneRules},
    uploads::Submission,
    view::JobView,
    web_secrets::TokenRole,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    limits::{ANSWER_TIME, SUBMISSION_TIME},
    problem::Problem,
    redact::redacted_json,
    route::{AtDoor, Param, Route, RouteAnswer, RouteBody, RouteResult, json, json_body, json_text, schema},
    source::{JobAgents, JobOrder, ShownFarm},
    state::DoorState,
    tokens::TokenBearer,
};

/// The holder of the request's token.
type By = Extension<TokenBearer>;

/// A new priority of a job.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PriorityChange {
    /// The priority, 1 to 1000; jobs get machines in proportion to it.
    #[schemars(with = "u32", range(min = 1, max = 1000))]
    priority: serde_json::Number,
}

/// A submitted job.
#[derive(Debug, Serialize, JsonSchema)]
struct AskedJob {
    /// Number of the job; for an animation, that of the first frame.
    job: u32,
    /// For an animation: the job numbers of all frames, in order.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    jobs: Vec<u32>,
}

pub(super) fn routes() -> Vec<Route> {
    let shown = RouteAnswer::Json(schema::<JobView>);
    vec![
        Route::query("/api/jobs", "All jobs, by number.", RouteAnswer::Json(schema::<Vec<JobView>>), get(list)),
        Route::query("/api/jobs/{id}", "A job.", shown, get(show)),
        // Scene parameters may name folders, which clients that only see must not learn.
        Route {
            role: TokenRole::Steer,
            ..Route::query(
                "/api/jobs/{id}/request",
                "The request of a job, to be submitted again with `files_of_job`: the fields that differ from their defaults.",
                RouteAnswer::Json(schema::<PictureRequest>),
                get(request),
            )
        },
        Route::query(
            "/api/jobs/{id}/zones",
            "The rows of the job's zones on the Blackboard.",
            RouteAnswer::Json(schema::<Vec<ZoneEvent>>),
            get(zones),
        ),
        Route::query(
            "/api/jobs/{id}/agents",
            "The agents of the job: V_cp, credit, how far their promises held; and the result of the auction.",
            RouteAnswer::Json(schema::<JobAgents>),
            get(agents),
        ),
        Route::query(
            "/api/jobs/{id}/energy",
            "Processor time and energy of the job, by machine and by zone, and what it costs, as far as it is known.",
            RouteAnswer::Json(schema::<JobEnergy>),
            get(energy),
        ),
        Route::query(
            "/api/jobs/{id}/messages/{from}",
            "Messages between the agents of the job from this number on, a limited number per answer. On a farm, recording starts with the first request.",
            RouteAnswer::Json(schema::<SeenMessages>),
            get(messages),
        ),
        Route::query(
            "/api/jobs/{id}/rules",
            "The rules by which agents choose the settings of the job's zones.",
            RouteAnswer::Json(schema::<JobRules>),
            get(rules),
        ),
        Route::query(
            "/api/jobs/{id}/zones/{zone}/rules",
            "The conclusions of these rules for a zone, and why.",
            RouteAnswer::Json(schema::<ZoneRules>),
            get(zone_rules),
        ),
        Route::query(
            "/api/jobs/{id}/log",
            "The log of the job, oldest line first.",
            RouteAnswer::Json(schema::<Vec<LogLine>>),
            get(log),
        ),
        Route::action(
            "post",
            "/api/jobs",
            "Submit a picture, or the frames of an animation, with uploaded files or those of another job.",
            RouteBody::Json(schema::<Submission>),
            RouteAnswer::Json(schema::<AskedJob>),
            post(submit),
        )
        .with_status(StatusCode::CREATED),
        Route::action(
            "post",
            "/api/jobs/{id}/pause",
            "Pause it until it is resumed.",
            RouteBody::Nothing,
            shown,
            post(pause),
        ),
        Route::action("post", "/api/jobs/{id}/resume", "Resume it.", RouteBody::Nothing, shown, post(resume)),
        Route::action("post", "/api/jobs/{id}/cancel", "Call it off.", RouteBody::Nothing, shown, post(cancel)),
        Route::action(
            "put",
            "/api/jobs/{id}/priority",
            "Set its priority.",
            RouteBody::Json(schema::<PriorityChange>),
            shown,
            put(priority),
        ),
        Route::action(
            "post",
            "/api/jobs/{id}/zones/{zone}/requeue",
            "Paint a finished or failed zone again.",
            RouteBody::Nothing,
            shown,
            post(requeue),
        ),
        Route::action(
            "delete",
            "/api/jobs/{id}",
            "Remove a job that is over, with its picture.",
            RouteBody::Nothing,
            RouteAnswer::Nothing,
            delete(remove),
        ),
    ]
}

async fn list(State(door): AtDoor) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, ShownFarm::jobs).await?))
}

async fn show(State(door): AtDoor, Param(id): Param<u32>) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, move |farm| farm.job(id)).await?))
}

async fn request(State(door): AtDoor, Param(id): Param<u32>) -> RouteResult {
    let request = door.ask(ANSWER_TIME, move |farm| farm.request(id)).await?;
    // Not redacted: the request's files have no folders, and texts such as rules must stay as they are.
    Ok(json_text(StatusCode::OK, request.to_string()))
}

async fn zones(State(door): AtDoor, Param(id): Param<u32>) -> RouteResult {
    let rows = door.ask(ANSWER_TIME, move |farm| farm.rows(id)).await?;
    let zone = |row| match row {
        Event::Zone(zone) => Some(zone),
        _ => None,
    };
    let mut zones: Vec<Box<ZoneEvent>> = rows.into_iter().filter_map(zone).collect();
    zones.sort_by_key(|zone| zone.id);
    Ok(json(&zones))
}

async fn agents(State(door): AtDoor, Param(id): Param<u32>) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, move |farm| farm.agents(id)).await?))
}

async fn energy(State(door): AtDoor, Param(id): Param<u32>) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, move |farm| farm.energy(id)).await?))
}

async fn messages(State(door): AtDoor, Param((id, from)): Param<(u32, u64)>) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, move |farm| farm.messages(id, from)).await?))
}

async fn rules(State(door): AtDoor, Param(id): Param<u32>) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, move |farm| farm.rules(id)).await?))
}

async fn zone_rules(State(door): AtDoor, Param((id, zone)): Param<(u32, u32)>) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, move |farm| farm.zone_rules(id, zone)).await?))
}

async fn log(State(door): AtDoor, Param(id): Param<u32>) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, move |farm| farm.log(id)).await?))
}

async fn submit(State(door): AtDoor, Extension(by): By, request: Request) -> RouteResult {
    let submission: Submission = json_body(request).await?;
    let busy = || {
        let detail = "another scene is being examined";
        Problem::new(StatusCode::SERVICE_UNAVAILABLE, detail, "try again in a moment")
    };
    let permit = Arc::clone(&door.submissions).try_acquire_owned().map_err(|_| busy())?;
    let job = door.ask(SUBMISSION_TIME, move |farm| {
        let _permit = permit;
        farm.submit(submission, &by.said())
    });
    let mut jobs = job.await?;
    let job = jobs.first().copied().ok_or_else(|| {
        Problem::new(StatusCode::UNPROCESSABLE_ENTITY, "`frames.list` has no frames", "name one at least")
    })?;
    if jobs.len() == 1 {
        jobs.clear();
    }
    let mut response = json_text(StatusCode::CREATED, redacted_json(&AskedJob { job, jobs }));
    if let Ok(place) = format!("/api/jobs/{job}").parse() {
        response.headers_mut().insert(header::LOCATION, place);
    }
    Ok(response)
}

async fn pause(State(door): AtDoor, Extension(by): By, Param(id): Param<u32>) -> RouteResult {
    steer(&door, id, JobOrder::Pause, &by).await
}

async fn resume(State(door): AtDoor, Extension(by): By, Param(id): Param<u32>) -> RouteResult {
    steer(&door, id, JobOrder::Resume, &by).await
}

async fn cancel(State(door): AtDoor, Extension(by): By, Param(id): Param<u32>) -> RouteResult {
    steer(&door, id, JobOrder::Cancel, &by).await
}

async fn requeue(State(door): AtDoor, Extension(by): By, Param((id, zone)): Param<(u32, u32)>) -> RouteResult {
    let job = door.ask(ANSWER_TIME, move |farm| {
        farm.requeue(id, zone, &by.said())?;
        farm.job(id)
    });
    Ok(json(&job.await?))
}

async fn priority(State(door): AtDoor, Extension(by): By, Param(id): Param<u32>, request: Request) -> RouteResult {
    let PriorityChange { priority } = json_body(request).await?;
    let allowed = priority.as_u64().and_then(|priority| u32::try_from(priority).ok());
    let allowed = allowed.filter(|priority| (1..=PRIORITY_MAX).contains(priority));
    let Some(priority) = allowed else {
        let detail = format!("`priority` is {priority}");
        let remedy = format!("a whole number from 1 to {PRIORITY_MAX} is allowed");
        return Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, detail, remedy));
    };
    steer(&door, id, JobOrder::Priority(priority), &by).await
}

async fn remove(State(door): AtDoor, Extension(by): By, Param(id): Param<u32>) -> RouteResult {
    door.ask(ANSWER_TIME, move |farm| farm.steer(id, JobOrder::Remove, &by.said())).await?;
    Ok(StatusCode::NO_CONTENT.into_response())
}

/// Executes an order to a job, and returns the job.
async fn steer(door: &DoorState, id: u32, order: JobOrder, by: &TokenBearer) -> RouteResult {
    let by = by.said();
    let job = door.ask(ANSWER_TIME, move |farm| {
        farm.steer(id, order, &by)?;
        farm.job(id)
    });
    Ok(json(&job.await?))
}
