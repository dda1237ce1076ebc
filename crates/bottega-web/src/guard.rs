//! The guard before all routes: checks host name, origin, token and request rate.

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

/// Security headers of all answers: scripts, styles and images of this door alone, and no framing by other pages.
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

/// Header of API answers with the role of the token: `see` or `steer`.
const ROLE: HeaderName = HeaderName::from_static("bottega-role");

/// Refuses requests that come from pages of other sites, and adds the security headers to answers.
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
    let only_value = |name: HeaderName| {
        let mut values = headers.get_all(name).into_iter();
        (values.next().map(|value| value.to_str().unwrap_or("?")), values.next().is_some())
    };
    match only_value(header::HOST) {
        (Some(host), false) if door.hosts.has(host) => {}
        (host, _) => {
            let detail = format!("`Host: {}` is not a name of this server", shortened(host.unwrap_or_default()));
            let remedy = "use the printed address; give names of proxies by --web-name";
            return Err(Problem::new(StatusCode::MISDIRECTED_REQUEST, detail, remedy));
        }
    }
    let foreign = |detail: String| {
        Err(Problem::new(StatusCode::FORBIDDEN, detail, "only programs and the pages of this server may send requests"))
    };
    match only_value(header::ORIGIN) {
        (None, _) => {}
        (Some(origin), false) if door.hosts.is_origin(origin) => {}
        (Some(origin), _) => return foreign(format!("the request comes from a page of `{}`", shortened(origin))),
    }
    let site = only_value(HeaderName::from_static("sec-fetch-site")).0;
    let mode = only_value(HeaderName::from_static("sec-fetch-mode")).0;
    // Links from other sites to this door are allowed.
    if matches!(site, Some("cross-site" | "same-site")) && mode != Some("navigate") {
        return foreign("the request comes from a page of another site".to_owned());
    }
    Ok(())
}

/// Admits requests with a valid token, and passes its holder on to the handlers.
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
        let detail = if token.is_some() { "the token is unknown, or was revoked" } else { "a token is needed" };
        let remedy = "open the printed address with its ?token=…, or send `Authorization: Bearer TOKEN`";
        return Err(Problem::new(StatusCode::UNAUTHORIZED, detail, remedy));
    };
    // Event streams have a limit of their own.
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

/// Admits requests of all clients within the rate limit.
///
/// # Errors
/// The client has exceeded the limit (429).
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
    Problem::new(StatusCode::TOO_MANY_REQUESTS, detail, "try again in a moment, and less often")
}

/// Admits requests whose token allows steering, and logs them.
pub(crate) async fn steering(
    State(door): State<Arc<DoorState>>,
    Extension(bearer): Extension<TokenBearer>,
    request: Request,
    next: Next,
) -> Response {
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let role = bearer.role();
    let response = if role < TokenRole::Steer {
        let detail = format!("this token only allows to {}", role.word());
        let remedy = "use the token of the other printed address";
        Problem::new(StatusCode::FORBIDDEN, detail, remedy).into_response()
    } else {
        next.run(request).await
    };
    // Pieces of files and frames of viewports are too many to log; their job is logged.
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
