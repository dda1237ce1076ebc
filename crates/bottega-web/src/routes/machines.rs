//! The routes of machines: listing, and orders to them.

use axum::{
    Extension,
    extract::State,
    routing::{get, post},
};
use bottega_cluster::presence::PresenceState;

use crate::{
    limits::ANSWER_TIME,
    problem::Problem,
    route::{AtDoor, Param, Route, RouteAnswer, RouteBody, RouteResult, json, schema},
    source::{MachineStatus, ShownFarm},
    state::DoorState,
    tokens::TokenBearer,
};

pub(super) fn routes() -> Vec<Route> {
    let shown = RouteAnswer::Json(schema::<MachineStatus>);
    let steered = |path, summary, standing| {
        let handler = post(
            async move |State(door): AtDoor, Extension(by): Extension<TokenBearer>, Param(name): Param<String>| {
                tell(&door, name, standing, &by).await
            },
        );
        Route::action("post", path, summary, RouteBody::Nothing, shown, handler)
    };
    vec![
        Route::query(
            "/api/machines",
            "The machines that are present, and what they paint.",
            RouteAnswer::Json(schema::<Vec<MachineStatus>>),
            get(list),
        ),
        Route::query("/api/machines/{name}", "A machine.", shown, get(show)),
        steered(
            "/api/machines/{name}/suspend",
            "Suspend it: it returns its work and pauses.",
            PresenceState::Suspended,
        ),
        steered("/api/machines/{name}/resume", "Resume it: it paints again.", PresenceState::Active),
        steered("/api/machines/{name}/terminate", "Terminate it: it leaves the farm.", PresenceState::Terminated),
    ]
}

async fn list(State(door): AtDoor) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, ShownFarm::machines).await?))
}

async fn show(State(door): AtDoor, Param(name): Param<String>) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, move |farm| named(farm, &name)).await?))
}

async fn tell(door: &DoorState, name: String, standing: PresenceState, by: &TokenBearer) -> RouteResult {
    let by = by.said();
    let machine = door.ask(ANSWER_TIME, move |farm| {
        farm.tell(&name, standing, &by)?;
        named(farm, &name)
    });
    Ok(json(&machine.await?))
}

fn named(farm: &dyn ShownFarm, name: &str) -> Result<MachineStatus, Problem> {
    let found = farm.machines()?.into_iter().find(|machine| machine.name == name);
    found.ok_or_else(|| {
        Problem::unknown(format!("there is no machine `{name}`"), "GET /api/machines lists the machines")
    })
}
