//! The web page, from files built into the program.

use std::sync::Arc;

use axum::{
    Router,
    extract::{Query, State, rejection::QueryRejection},
    http::{StatusCode, header},
    response::{IntoResponse, Redirect, Response},
    routing::get,
};
use serde::Deserialize;

use crate::state::DoorState;

/// The files below `/`: path, media type, text.
const FILES: &[(&str, &str, &str)] = &[
    ("/icon.svg", "image/svg+xml", include_str!("../assets/icon.svg")),
    ("/style.css", "text/css; charset=utf-8", include_str!("../assets/style.css")),
    ("/agents.js", JS, include_str!("../assets/agents.js")),
    ("/api.js", JS, include_str!("../assets/api.js")),
    ("/app.js", JS, include_str!("../assets/app.js")),
    ("/bell.js", JS, include_str!("../assets/bell.js")),
    ("/blackboard.js", JS, include_str!("../assets/blackboard.js")),
    ("/blake3.js", JS, include_str!("../assets/blake3.js")),
    ("/compare.js", JS, include_str!("../assets/compare.js")),
    ("/energy.js", JS, include_str!("../assets/energy.js")),
    ("/format.js", JS, include_str!("../assets/format.js")),
    ("/frames.js", JS, include_str!("../assets/frames.js")),
    ("/hash_worker.js", JS, include_str!("../assets/hash_worker.js")),
    ("/job.js", JS, include_str!("../assets/job.js")),
    ("/job_controls.js", JS, include_str!("../assets/job_controls.js")),
    ("/jobs.js", JS, include_str!("../assets/jobs.js")),
    ("/layers.js", JS, include_str!("../assets/layers.js")),
    ("/legend.js", JS, include_str!("../assets/legend.js")),
    ("/lookaround.js", JS, include_str!("../assets/lookaround.js")),
    ("/machines.js", JS, include_str!("../assets/machines.js")),
    ("/messages.js", JS, include_str!("../assets/messages.js")),
    ("/orbit.js", JS, include_str!("../assets/orbit.js")),
    ("/rules.js", JS, include_str!("../assets/rules.js")),
    ("/scene_files.js", JS, include_str!("../assets/scene_files.js")),
    ("/schema_form.js", JS, include_str!("../assets/schema_form.js")),
    ("/schema_widgets.js", JS, include_str!("../assets/schema_widgets.js")),
    ("/sequence.js", JS, include_str!("../assets/sequence.js")),
    ("/sequence_view.js", JS, include_str!("../assets/sequence_view.js")),
    ("/sparkline.js", JS, include_str!("../assets/sparkline.js")),
    ("/submit.js", JS, include_str!("../assets/submit.js")),
    ("/unzip.js", JS, include_str!("../assets/unzip.js")),
    ("/upload.js", JS, include_str!("../assets/upload.js")),
    ("/view_box.js", JS, include_str!("../assets/view_box.js")),
    ("/viewer.js", JS, include_str!("../assets/viewer.js")),
    ("/virtual_table.js", JS, include_str!("../assets/virtual_table.js")),
    ("/zones.js", JS, include_str!("../assets/zones.js")),
];
const JS: &str = "text/javascript; charset=utf-8";

#[derive(Deserialize)]
struct Arrival {
    token: Option<String>,
}

/// Returns the routes of the page. They need no token: the page gets all data from the API.
pub(crate) fn routes() -> Router<Arc<DoorState>> {
    let mut router = Router::new().route("/", get(arrive));
    for (path, kind, text) in FILES {
        router = router.route(path, get(async || file(kind, text)));
    }
    router
}

/// Returns the page. A token in the URL becomes a cookie and is removed from the URL by a redirect.
async fn arrive(State(door): State<Arc<DoorState>>, arrival: Result<Query<Arrival>, QueryRejection>) -> Response {
    let token = arrival.ok().and_then(|Query(arrival)| arrival.token);
    match token {
        Some(token) if door.farm.holder(&token).is_some() => {
            ([(header::SET_COOKIE, door.cookie.of(&token))], Redirect::to("/")).into_response()
        }
        Some(_) => (StatusCode::SEE_OTHER, [(header::LOCATION, "/")]).into_response(),
        None => file("text/html; charset=utf-8", include_str!("../assets/index.html")),
    }
}

fn file(kind: &'static str, text: &'static str) -> Response {
    ([(header::CONTENT_TYPE, kind), (header::CACHE_CONTROL, "no-cache")], text).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_page_is_served() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/assets");
        let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut unserved: Vec<String> =
            names.filter(|name| !FILES.iter().any(|(path, ..)| path[1..] == **name)).collect();
        unserved.retain(|name| name != "index.html");
        assert!(unserved.is_empty(), "{unserved:?} are in assets and not in FILES");
    }
}
