//! The guard that every request passes before it is answered: whom it names, where it comes from, what its token lets it do, how
//! often it asks.

use std::{sync::Arc, time::Instant};

use axum::{
    Extension,
    extract::{Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header},
    middleware::Next,
    response::{IntoResponse, Response},
};

use bottega_cluster::web_secrets::TokenRole;

use crate::{
    limits::TempoKind,
    problem::Problem,
    state::{Client, DoorState},
    tokens::TokenBearer,
};

/// What browsers are told of every answer: scripts, styles and pictures of this door alone, in no frame of others.
const HEADERS: &[(&str, &str)] = &[
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
         manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cross-origin-opener-policy", "same-origin"),
];

/// In answers of the API: what the token lets its client do, `see` or `steer`.
const ROLE: HeaderName = HeaderName::from_static("bottega-role");

/// Turns away what is not from this door's own pages or from a program, and marks what browsers may do with the answer.
pub(crate) async fn guard(State(door): State<Arc<DoorState>>, request: Request, next: Next) -> Response {
    let mut response = match check_place(&door, request.headers()) {
        Ok(()) => next.run(request).await,
        Err(problem) => problem.into_response(),
    };
    for &(name, value) in HEADERS {
        response.headers_mut().insert(HeaderName::from_static(name), HeaderValue::from_static(value));
    }
    response
}

fn check_place(door: &DoorState, headers: &HeaderMap) -> Result<(), Problem> {
    let one = |name: HeaderName| {
        let mut all = headers.get_all(name).into_iter();
        (all.next().map(|value| value.to_str().unwrap_or("?")), all.next().is_some())
    };
    match one(header::HOST) {
        (Some(host), false) if door.hosts.has(host) => {}
        (host, _) => {
            let detail = format!("`Host: {}` is no name of this door", shortened(host.unwrap_or_default()));
            let remedy = "use the address that was printed; names of proxies are told by --web-name";
            return Err(Problem::new(StatusCode::MISDIRECTED_REQUEST, detail, remedy));
        }
    }
    let foreign = |detail: String| {
        Err(Problem::new(StatusCode::FORBIDDEN, detail, "only this door's own pages, and programs, may ask"))
    };
    match one(header::ORIGIN) {
        (None, _) => {}
        (Some(origin), false) if door.hosts.is_origin(origin) => {}
        (Some(origin), _) => return foreign(format!("a page of `{}` asks", shortened(origin))),
    }
    let site = one(HeaderName::from_static("sec-fetch-site")).0;
    let mode = one(HeaderName::from_static("sec-fetch-mode")).0;
    // One may come here by a link.
    if matches!(site, Some("cross-site" | "same-site")) && mode != Some("navigate") {
        return foreign("a page of another site asks".to_owned());
    }
    Ok(())
}

/// Lets those pass who show a token, and tells what follows what it lets them do.
pub(crate) async fn admit(
    State(door): State<Arc<DoorState>>,
    Extension(Client(address)): Extension<Client>,
    mut request: Request,
    next: Next,
) -> Result<Response, Problem> {
    let token = door.cookie.shown(request.headers());
    let Some(holder) = token.and_then(|token| door.farm.holder(token)) else {
        if token.is_some() && !door.tempo.take(address, TempoKind::WrongToken, Instant::now()) {
            return Err(too_many());
        }
        let detail =
            if token.is_some() { "the token is none of this door, or was revoked" } else { "a token is needed" };
        let remedy = "open the address that was printed with its ?token=…, or send `Authorization: Bearer TOKEN`";
        return Err(Problem::new(StatusCode::UNAUTHORIZED, detail, remedy));
    };
    // Streams of events are counted while they last.
    let is_stream = request.uri().path().ends_with("/events");
    if !is_stream && !door.tempo.take(address, TempoKind::Question, Instant::now()) {
        return Err(too_many());
    }
    let role = holder.role;
    request.extensions_mut().insert(TokenBearer { holder, address });
    let mut response = next.run(request).await;
    response.headers_mut().insert(ROLE, HeaderValue::from_static(role.word()));
    Ok(response)
}

/// Lets all pass who do not ask too often.
pub(crate) async fn pace(
    State(door): State<Arc<DoorState>>,
    Extension(Client(address)): Extension<Client>,
    request: Request,
    next: Next,
) -> Result<Response, Problem> {
    if !door.tempo.take(address, TempoKind::Question, Instant::now()) {
        return Err(too_many());
    }
    Ok(next.run(request).await)
}

fn too_many() -> Problem {
    let detail = "too many requests from one address";
    Problem::new(StatusCode::TOO_MANY_REQUESTS, detail, "ask again in a moment, and less often")
}

/// Lets those pass who may steer, and notes what they do.
pub(crate) async fn steering(
    State(door): State<Arc<DoorState>>,
    Extension(bearer): Extension<TokenBearer>,
    request: Request,
    next: Next,
) -> Response {
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let role = bearer.role();
    let response = if role < TokenRole::Steer {
        let detail = format!("this token lets one {} alone", role.word());
        let remedy = "use the token of the other address that was printed";
        Problem::new(StatusCode::FORBIDDEN, detail, remedy).into_response()
    } else {
        next.run(request).await
    };
    // Pieces of files and frames of viewports are many, and the job that they are for is noted.
    let is_deed = method != Method::GET && !path.starts_with("/api/uploads") && !path.starts_with("/api/viewports");
    if let Some(deeds) = door.deeds.as_ref().filter(|_| is_deed) {
        let TokenBearer { holder, address } = &bearer;
        deeds.note(&holder.name, *address, method.as_str(), &path, response.status().as_u16());
    }
    response
}

fn shortened(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(100).collect()
}
