//! The page: files that are part of the program.

use std::sync::Arc;

use axum::{
    Router,
    extract::{Query, State},
    http::{StatusCode, header},
    response::{IntoResponse, Redirect, Response},
    routing::get,
};
use serde::Deserialize;

use crate::state::DoorState;

/// The files below `/`, with what they are.
const FILES: &[(&str, &str, &str)] = &[
    ("/style.css", "text/css; charset=utf-8", include_str!("../assets/style.css")),
    ("/app.js", JS, include_str!("../assets/app.js")),
    ("/api.js", JS, include_str!("../assets/api.js")),
    ("/format.js", JS, include_str!("../assets/format.js")),
    ("/jobs.js", JS, include_str!("../assets/jobs.js")),
    ("/job.js", JS, include_str!("../assets/job.js")),
    ("/machines.js", JS, include_str!("../assets/machines.js")),
];
const JS: &str = "text/javascript; charset=utf-8";

#[derive(Deserialize)]
struct Arrival {
    token: Option<String>,
}

/// The routes of the page. Nothing in it is a secret: what it shows it asks the API for.
pub(crate) fn routes() -> Router<Arc<DoorState>> {
    let mut router = Router::new().route("/", get(arrive));
    for (path, kind, text) in FILES {
        router = router.route(path, get(async || file(kind, text)));
    }
    router
}

/// The page; a token in its address becomes a cookie, and is seen no more.
async fn arrive(State(door): State<Arc<DoorState>>, Query(Arrival { token }): Query<Arrival>) -> Response {
    match token {
        Some(token) if door.tokens.role(&token).is_some() => {
            ([(header::SET_COOKIE, door.tokens.set_cookie(&token))], Redirect::to("/")).into_response()
        }
        Some(_) => (StatusCode::SEE_OTHER, [(header::LOCATION, "/")]).into_response(),
        None => file("text/html; charset=utf-8", include_str!("../assets/index.html")),
    }
}

fn file(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")], text).into_response()
}
