//! The API agrees with its document.

use std::{
    collections::BTreeSet,
    io::{BufRead, BufReader, Read},
    net::SocketAddr,
    time::Duration,
};

use bottega::{
    Event, StopSwitch,
    events::{Progress, ZoneEvent},
};
use bottega_cluster::deed_log::DeedLog;
use bottega_image::{ReadLimits, read_image_bytes};
use bottega_web::{Dashboard, openapi_document};
use serde_json::{Value, json};

use crate::door::fake::{HIDDEN, SEE, STEER, ask, bearer, get, head, made_token, open, open_with, post, send, zone};

/// An example of each parameter.
fn filled(path: &str) -> String {
    path.replace("{id}", "1")
        .replace("{name}", "machine")
        .replace("{digest}", &"a".repeat(64))
        .replace("{zone}", "1")
        .replace("{from}", "5")
        .replace("{viewport}", "1")
        .replace("{layer}", "albedo.png")
        .replace("{other}", "job-1")
        .replace("{picture}", "1")
}

#[test]
fn the_document_and_the_door_know_the_same_routes() {
    let (_, door) = open();
    let at = door.address();
    let answer = get(at, "/api/openapi.json");
    assert_eq!(answer.json(), openapi_document());
    let document = answer.json();
    let paths = document["paths"].as_object().unwrap();
    assert!(paths.len() > 15, "{paths:?}");
    let mut names = BTreeSet::new();
    for (path, methods) in paths {
        for method in ["get", "post", "put", "delete", "patch"] {
            let Some(route) = methods.get(method) else {
                let other = post(at, &method.to_uppercase(), &filled(path), "{}");
                assert_eq!(other.status, 405, "{method} {path}: {other:?}");
                continue;
            };
            assert!(names.insert(route["operationId"].as_str().unwrap().to_owned()), "{route}");
            let is_steered = route["x-role"] == "steer";
            // A viewport belongs to the client that opened it, tokens are for clients that may steer, and a request may name folders.
            let is_private = ["/api/viewports", "/api/tokens"].iter().any(|start| path.starts_with(start));
            let is_private = is_private || path.ends_with("/{id}/request");
            assert_eq!(is_steered, method != "get" || is_private, "{method} {path}");
            // A client without the right is refused before anything else is checked.
            let without = ask(at, &method.to_uppercase(), &filled(path), "", b"");
            let is_open = ["/api/openapi.json", "/api/schema/request"].contains(&path.as_str());
            assert_eq!(without.status, if is_open { 200 } else { 401 }, "{method} {path}");
            assert_eq!((route["x-role"] == "none", route["security"].is_array()), (is_open, is_open), "{route}");
            if path.ends_with("/events") {
                continue;
            }
            let seen = ask(at, &method.to_uppercase(), &filled(path), &bearer(SEE), b"");
            assert_eq!(seen.status == 403, is_steered || path.ends_with("/picture"), "{method} {path}: {seen:?}");
            if path.ends_with("/picture") {
                continue;
            }
            let body = match route["requestBody"]["content"]["application/json"]["schema"]["$ref"].as_str() {
                Some("#/components/schemas/Submission") => {
                    r#"{"request":{"scene":{"file":"a.glb"}},"files":{"a.glb":"x"}}"#
                }
                Some("#/components/schemas/PriorityChange") => r#"{"priority":30}"#,
                Some("#/components/schemas/NewToken") => r#"{"name":"anna","role":"see"}"#,
                Some("#/components/schemas/UploadOffer") => r#"{"name":"a","size":0,"digest":"x","chunks":[]}"#,
                Some("#/components/schemas/ViewOptions") => r#"{"pose":{"eye":[0,1,3],"target":[0,1,0]}}"#,
                Some(other) => panic!("a new kind of body: {other}"),
                None if path == "/api/pictures" => RADIANCE,
                None => "",
            };
            if path.contains("{picture}") {
                assert_eq!(post(at, "POST", "/api/pictures", RADIANCE).json()["width"], 2);
            }
            // A closed viewport gives no frames.
            let viewport = path.contains("{viewport}").then(|| open_viewport(at));
            let path = viewport.map_or_else(|| filled(path), |number| path.replace("{viewport}", &number.to_string()));
            let done = post(at, &method.to_uppercase(), &path, body);
            let (status, said) = (done.status.to_string(), &route["responses"]);
            assert!(said.get(&status).is_some(), "{method} {path}: {done:?} is not among {said}");
            let content = said[&status]["content"].as_object();
            let kind = content.and_then(|content| content.keys().next().cloned());
            if kind.as_deref() != Some("application/schema+json") {
                assert_eq!(done.header("content-type"), kind.as_deref(), "{method} {path}");
            }
        }
    }
    // Each schema that is referred to is there.
    let text = document.to_string();
    for part in text.split("#/components/schemas/").skip(1) {
        let name = part.split('"').next().unwrap();
        assert!(document["components"]["schemas"].get(name).is_some(), "{name}");
    }
}

/// A picture of two pixels, as a text: a Radiance file.
const RADIANCE: &str = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n@@@@@@@@";

#[test]
fn layers_of_a_picture_are_listed_and_each_is_a_picture() {
    let (_, door) = open();
    let at = door.address();
    assert_eq!(get(at, "/api/jobs/1/layers").json(), json!([{"name": "albedo", "kind": "color"}]));
    let png = get(at, "/api/jobs/1/layers/albedo.png");
    assert!(png.status == 200 && png.body.starts_with(b"\x89PNG") && png.header("etag").is_some(), "{png:?}");
    let exr = get(at, "/api/jobs/1/layers/albedo.exr");
    let read = read_image_bytes("albedo.exr", &exr.body, ReadLimits::default()).unwrap();
    assert_eq!((exr.header("content-type"), read.picture.data[1]), (Some("image/x-exr"), [0.2, 0.4, 0.6]));
    for (path, words) in [("nothing.png", "it has albedo"), ("albedo.gif", ".png or .exr")] {
        let answer = get(at, &format!("/api/jobs/1/layers/{path}"));
        assert!(answer.status == 404 && answer.text().contains(words), "{answer:?}");
    }
    // A file of another kind has none.
    assert_eq!(get(at, "/api/jobs/2/layers").json(), json!([]));
}

#[test]
fn pictures_are_compared_with_those_of_jobs_and_those_that_are_sent() {
    let (_, door) = open();
    let at = door.address();
    let same = get(at, "/api/jobs/1/difference/job-1").json();
    assert_eq!((&same["flip"], &same["rmse"]), (&json!(0.0), &json!(0.0)));
    let sent = post(at, "POST", "/api/pictures", RADIANCE);
    assert_eq!((sent.status, sent.json()), (201, json!({"picture": 1, "width": 2, "height": 1})));
    let other = get(at, "/api/jobs/1/difference/picture-1").json();
    assert!(other["flip"].as_f64().unwrap() > 0.0 && other["flip_map"].is_null(), "{other}");
    for path in ["/api/jobs/1/difference/picture-1/flip.png", "/api/pictures/1/shown.png"] {
        let png = get(at, path);
        let read = read_image_bytes("shown.png", &png.body, ReadLimits::default()).unwrap();
        assert_eq!((png.status, read.picture.size()), (200, (2, 1)), "{path}");
    }
    let wide = RADIANCE.replace("+X 2\n", "+X 3\n@@@@");
    assert_eq!(post(at, "POST", "/api/pictures", &wide).json()["width"], 3);
    let unlike = get(at, "/api/jobs/1/difference/picture-2");
    assert!(unlike.status == 422 && unlike.text().contains("2x1 and 3x1"), "{unlike:?}");
    assert_eq!(post(at, "POST", "/api/pictures", "no picture").status, 422);
    assert_eq!(get(at, "/api/jobs/1/difference/picture-9").status, 404);
    // The oldest one has gone.
    assert_eq!(post(at, "POST", "/api/pictures", RADIANCE).status, 201);
    assert_eq!(get(at, "/api/pictures/1/shown.png").status, 404);
}

/// Looks around in a scene. Returns the number of the viewport.
fn open_viewport(at: SocketAddr) -> u64 {
    let opened = post(at, "POST", "/api/viewports", r#"{"request":{"scene":{"file":"a.glb"}},"files":{"a.glb":"x"}}"#);
    assert_eq!(opened.status, 201, "{opened:?}");
    opened.json()["viewport"].as_u64().unwrap()
}

#[test]
fn a_viewport_shows_each_look_and_is_closed() {
    let (_, door) = open();
    let at = door.address();
    let opened = post(at, "POST", "/api/viewports", r#"{"request":{},"files":{"a.glb":"x"}}"#).json();
    assert_eq!((&opened["width"], &opened["height"], &opened["samples"]), (&json!(16), &json!(12), &json!(2)));
    assert_eq!(opened["cameras"][0]["pose"]["up"].as_array().unwrap().len(), 3);
    let place = format!("/api/viewports/{}", opened["viewport"]);
    let steer = bearer(STEER);
    let frame = |headers: &str| ask(at, "GET", &format!("{place}/frame.png"), &format!("{steer}{headers}"), b"");
    let mut shown = frame("");
    assert!(shown.status == 200 && shown.body.starts_with(b"\x89PNG") && shown.header("bottega-look") == Some("0"));
    while shown.header("bottega-samples") != Some("2") {
        shown = frame(&format!("If-None-Match: {}\r\n", shown.header("etag").unwrap()));
        assert_eq!(shown.status, 200, "{shown:?}");
    }
    let look = |view: &str| post(at, "PUT", &format!("{place}/view"), view);
    assert_eq!(look(r#"{"pose":{"eye":[0,1,3],"target":[0,1,0]}}"#).json()["look"], 1);
    let other = frame(&format!("If-None-Match: {}\r\n", shown.header("etag").unwrap()));
    assert_eq!((other.status, other.header("bottega-look")), (200, Some("1")));
    let wrong = look(r#"{"pose":{"eye":[0,1,3],"target":[0,1,3]}}"#);
    assert!(wrong.status == 422 && wrong.text().contains("view.pose.target"), "{wrong:?}");
    // Few at once: further ones are refused until one is closed.
    let others: Vec<u64> = (0..3).map(|_| open_viewport(at)).collect();
    assert_eq!(post(at, "POST", "/api/viewports", r#"{"request":{},"files":{"a.glb":"x"}}"#).status, 503);
    assert_eq!(ask(at, "DELETE", &place, &steer, b"").status, 204);
    let closed = (0..100).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        frame("").status == 404
    });
    assert!(closed && others.len() == 3, "it is closed");
    open_viewport(at);
}

#[test]
fn read_only_clients_see_everything_but_absolute_paths() {
    let (farm, door) = open();
    let at = door.address();
    farm.live.tell(&Event::Warning { message: format!("cannot read {HIDDEN}/b.png") });
    for path in openapi_document()["paths"].as_object().unwrap().keys() {
        if path.ends_with("/events") {
            continue;
        }
        // Only for clients that may steer, and without a file: a viewport.
        let answer = get(at, &filled(path));
        assert!(!answer.text().contains("/home/") && !answer.text().contains("anna"), "{path}: {}", answer.text());
    }
    let job = get(at, "/api/jobs/1").json();
    assert_eq!((&job["scene"], &job["done"]), (&json!("scene.glb"), &json!(0.25)));
    assert_eq!(job["reason"], "cannot read `…/x.png`: it is not there");
    let zones = get(at, "/api/jobs/1/zones").json();
    assert_eq!((&zones[0]["id"], &zones[1]["state"], zones.as_array().unwrap().len()), (&json!(1), &json!("open"), 2));
    assert_eq!(get(at, "/api/jobs/1/agents").json()["agents"][0]["power"], 1.5);
    assert_eq!(get(at, "/api/machines").json()[0]["name"], "machine");
    let about = get(at, "/api/about").json();
    assert_eq!((&about["version"], &about["shows"]), (&json!(env!("CARGO_PKG_VERSION")), &json!("farm")));
    assert_eq!(get(at, "/api/schema/request").json()["title"], "Request");
    // The file of a picture whose request names such paths is only for clients that may steer.
    assert_eq!(get(at, "/api/jobs/1/picture").status, 403);
    let picture = get(at, "/api/jobs/2/picture");
    assert_eq!((picture.status, picture.body.len()), (200, 64 << 20));
    assert_eq!(picture.header("content-disposition"), Some("attachment; filename=\"picture.exr\""));
    assert_eq!(ask(at, "GET", "/api/jobs/1/picture", &bearer(STEER), b"").status, 200);
}

#[test]
fn jobs_and_machines_are_steered() {
    let (farm, door) = open();
    let at = door.address();
    for (method, path, body, noted) in [
        ("POST", "/api/jobs/1/pause", "", "1 Pause"),
        ("POST", "/api/jobs/1/resume", "", "1 Resume"),
        ("POST", "/api/jobs/1/cancel", "", "1 Cancel"),
        ("POST", "/api/jobs/1/zones/2/requeue", "", "1 requeue 2"),
        ("PUT", "/api/jobs/1/priority", r#"{"priority":30}"#, "1 Priority(30)"),
        ("DELETE", "/api/jobs/2", "", "2 Remove"),
        ("POST", "/api/machines/machine/suspend", "", "machine Suspended"),
        ("POST", "/api/machines/machine/resume", "", "machine Active"),
        ("POST", "/api/machines/machine/terminate", "", "machine Terminated"),
        ("POST", "/api/jobs", r#"{"request":{},"files":{"a":"b"}}"#, "submit 1"),
    ] {
        let answer = post(at, method, path, body);
        assert!((200..300).contains(&answer.status), "{method} {path}: {answer:?}");
        let by = " by the token `steer` at 127.0.0.1";
        assert_eq!(farm.noted(), [format!("{noted}{by}")]);
    }
    let created = post(at, "POST", "/api/jobs", r#"{"request":{},"files":{"a":"b"}}"#);
    assert_eq!(
        (created.status, created.header("location"), created.json()),
        (201, Some("/api/jobs/3"), json!({"job": 3}))
    );
    let frames = r#"{"request":{"frames":{"list":"1..3"}},"files":{"a":"b"}}"#;
    assert_eq!(post(at, "POST", "/api/jobs", frames).json(), json!({"job": 3, "jobs": [3, 4, 5]}));
}

#[test]
fn tokens_are_made_named_and_revoked_and_what_was_done_by_them_is_noted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("web.log");
    let (farm, door) = open_with(Some(DeedLog::at(path.clone())));
    let at = door.address();
    let made = post(at, "POST", "/api/tokens", r#"{"name":"anna","role":"steer"}"#);
    let token = made_token("anna");
    assert_eq!((made.status, made.json()), (201, json!({"name": "anna", "role": "steer", "token": token})));
    let list = || ask(at, "GET", "/api/tokens", &bearer(STEER), b"").json();
    assert_eq!(list(), json!([{"name": "anna", "role": "steer", "made": 1, "by": "somebody"}]));
    let pause = || ask(at, "POST", "/api/jobs/1/pause", &bearer(&token), b"").status;
    assert_eq!(pause(), 200);
    assert_eq!(farm.noted()[1], "1 Pause by the token `anna` at 127.0.0.1");
    assert_eq!(ask(at, "POST", "/api/jobs/1/pause", &bearer(SEE), b"").status, 403);
    assert_eq!(ask(at, "DELETE", "/api/tokens/anna", &bearer(STEER), b"").status, 204);
    assert_eq!((pause(), list()), (401, json!([])));
    let noted = std::fs::read_to_string(&path).unwrap();
    let noted: Vec<&str> = noted.lines().map(|line| line.split_once(' ').unwrap().1).collect();
    assert_eq!(
        noted,
        [
            "steer 127.0.0.1 POST /api/tokens 201",
            "anna 127.0.0.1 POST /api/jobs/1/pause 200",
            "see 127.0.0.1 POST /api/jobs/1/pause 403",
            "steer 127.0.0.1 DELETE /api/tokens/anna 204",
        ]
    );
}

#[test]
fn what_is_wrong_is_said_without_words_of_rust_and_with_the_routes_that_help() {
    let (_, door) = open();
    let at = door.address();
    for (method, path, body, detail) in [
        ("PUT", "/api/jobs/1/priority", r#"{"priority":-1}"#, "`priority` is -1"),
        ("PUT", "/api/jobs/1/priority", r#"{"priority":0.5}"#, "`priority` is 0.5"),
        ("PUT", "/api/jobs/1/priority", "{}", "the body: the field `priority` is missing"),
        (
            "POST",
            "/api/uploads",
            r#"{"name":"a","size":-1,"digest":"x","chunks":[]}"#,
            "`size` is -1: a whole number from 0 to ",
        ),
        ("POST", "/api/jobs", r#"{"request":{},"files":{"a":1}}"#, "`files.a` is 1: text is needed"),
        (
            "POST",
            "/api/jobs",
            r#"{"request":{},"evil":1}"#,
            "`evil`: there is no field `evil` here; there are `request`",
        ),
        (
            "POST",
            "/api/jobs",
            "{",
            "the body: it is not JSON: line 1, column 1: the text ends in the middle of an object",
        ),
        ("POST", "/api/tokens", r#"{"name":"a","role":"all"}"#, "`role` is `all`: `see` or `steer` is needed"),
        ("POST", "/api/jobs/abc/pause", "", "the path is invalid: a number is needed in place of `abc`"),
    ] {
        let answer = post(at, method, path, body);
        let problem = answer.json();
        assert!((400..500).contains(&answer.status), "{answer:?}");
        assert!(problem["detail"].as_str().unwrap().starts_with(detail), "{path} {body}: {problem}");
        for word in ["u32", "u64", "usize", "expected", "invalid type", "at line", "column 4"] {
            assert!(!answer.text().contains(word), "{word}: {problem}");
        }
    }
    let unknown = get(at, "/api/machines/nobody").json();
    assert_eq!(unknown["remedy"], "GET /api/machines lists the machines");
    let body = post(at, "POST", "/api/uploads", "{}").json();
    assert_eq!(body["remedy"], "GET /api/openapi.json says what is allowed");
}

#[test]
fn an_upload_goes_on_where_it_was_interrupted() {
    let (_, door) = open();
    let at = door.address();
    let offer = r#"{"name":"a.glb","size":4194305,"digest":"d","chunks":["one","two"]}"#;
    assert_eq!(post(at, "POST", "/api/uploads", offer).json()["missing"], json!(["one", "two"]));
    let put = |name: &str, bytes: &[u8]| ask(at, "PUT", &format!("/api/uploads/chunks/{name}"), &bearer(STEER), bytes);
    assert_eq!(put("one", &vec![1; 4 << 20]).status, 204);
    assert_eq!(post(at, "POST", "/api/uploads", offer).json()["missing"], json!(["two"]));
    assert_eq!(put("two", &[1]).status, 204);
    assert_eq!(post(at, "POST", "/api/uploads", offer).json()["missing"], json!([]));
}

#[test]
fn a_preview_is_sent_once_to_one_who_has_it() {
    let (_, door) = open();
    let at = door.address();
    let first = get(at, "/api/jobs/1/preview.png");
    assert_eq!((first.status, first.header("content-type")), (200, Some("image/png")));
    let headers = format!("{}If-None-Match: {}\r\n", bearer(SEE), first.header("etag").unwrap());
    let again = ask(at, "GET", "/api/jobs/1/preview.png", &headers, b"");
    assert_eq!((again.status, again.body.len()), (304, 0));
    assert_eq!([2, 3].map(|job| get(at, &format!("/api/jobs/{job}/preview.png")).status), [204, 404]);
}

#[test]
fn a_token_in_the_address_becomes_a_cookie_that_scripts_cannot_read() {
    let (_, door) = open();
    let at = door.address();
    let arrived = ask(at, "GET", &format!("/?token={STEER}"), "", b"");
    assert_eq!((arrived.status, arrived.header("location")), (303, Some("/")));
    let cookie = arrived.header("set-cookie").unwrap();
    assert!(cookie.contains("; HttpOnly; SameSite=Strict"), "{cookie}");
    let pair = cookie.split(';').next().unwrap();
    assert_eq!(ask(at, "POST", "/api/jobs/1/pause", &format!("Cookie: a=b; {pair}\r\n"), b"").status, 200);
    let wrong = ask(at, "GET", "/?token=nonsense", "", b"");
    assert!(wrong.status == 303 && wrong.header("set-cookie").is_none());
    let page = ask(at, "GET", "/", "", b"");
    assert!(page.status == 200 && page.text().contains("<title>Bottega</title>"));
    let policy = page.header("content-security-policy").unwrap();
    assert!(policy.contains("default-src 'none'") && policy.contains("script-src 'self'"), "{policy}");
    // Each file that the page names is there, and nothing in it is inline or from elsewhere.
    for part in page.text().split("=\"/").skip(1) {
        let path = format!("/{}", part.split('"').next().unwrap());
        assert_eq!(ask(at, "GET", &path, "", b"").status, 200, "{path}");
    }
    assert!(!page.text().contains("<style") && !page.text().contains("http"));
}

/// The next event of a stream: its name and its data.
fn event(reader: &mut impl BufRead) -> (String, Value) {
    let (mut name, mut line) = (String::new(), String::new());
    loop {
        line.clear();
        assert!(reader.read_line(&mut line).expect("an event comes") > 0, "the stream has ended");
        if let Some(it) = line.strip_prefix("event: ") {
            name = it.trim().to_owned();
        }
        if let Some(data) = line.strip_prefix("data: ") {
            return (name, serde_json::from_str(data).expect("JSON"));
        }
    }
}

#[test]
fn a_stream_begins_with_what_is_known_and_tells_what_changes() {
    let (farm, door) = open();
    let at = door.address();
    farm.live.tell(&zone(1, "open"));
    farm.live.tell(&zone(1, "done"));
    let request = format!("GET /api/jobs/1/events HTTP/1.1\r\nHost: {at}\r\n{}\r\n", bearer(SEE));
    let mut reader = BufReader::new(send(at, request.as_bytes()));
    let (status, head_text) = head(&mut reader);
    assert!(status == 200 && head_text.contains("text/event-stream"), "{head_text}");
    let (name, state) = event(&mut reader);
    assert_eq!((&*name, state.as_array().unwrap().len(), &state[0]["state"]), ("state", 1, &json!("done")));
    farm.live.tell(&zone(2, "open"));
    farm.live.tell(&Event::Progress(Progress { zones: 2, ..Progress::default() }));
    let mut changes = Vec::new();
    while changes.len() < 2 {
        let (name, more) = event(&mut reader);
        assert_eq!(name, "news");
        changes.extend(more.as_array().unwrap().clone());
    }
    assert_eq!((&changes[0]["id"], &changes[1]["zones"]), (&json!(2), &json!(2)));
}

#[test]
fn the_picture_of_one_process_has_the_same_routes() {
    let stop = StopSwitch::new();
    let dashboard = Dashboard::serve(([127, 0, 0, 1], 0).into(), &stop).expect("a free port");
    let url = dashboard.url();
    let (place, token) = url.strip_prefix("http://").unwrap().split_once("/?token=").unwrap();
    let (at, headers) = (place.parse().unwrap(), bearer(token));
    let get = |path: &str| ask(at, "GET", path, &headers, b"");
    assert_eq!(get("/api/jobs/1/preview.png").status, 204);
    assert_eq!(get("/api/jobs/2/preview.png").status, 404);
    dashboard.set_preview(b"two".to_vec());
    for state in ["open", "done"] {
        let zone = ZoneEvent { id: 3, state: state.to_owned(), ..ZoneEvent::default() };
        dashboard.publish(&Event::Zone(Box::new(zone)));
    }
    dashboard.publish(&Event::Progress(Progress { zones: 4, zones_done: 1, share: 0.25, ..Progress::default() }));
    assert_eq!(get("/api/jobs/1/preview.png").body, b"two");
    assert_eq!(get("/api/jobs/1/zones").json()[0]["state"], "done");
    assert_eq!(get("/api/jobs").json()[0]["done"], 0.25);
    assert_eq!(get("/api/jobs/2").status, 404);
    assert_eq!(get("/api/about").json()["shows"], "picture");
    assert_eq!(get("/api/jobs/1/request").status, 409);
    assert_eq!(get("/api/jobs/1/picture").status, 409);
    // The scene of the picture can be looked around in, once it is known.
    let submission = br#"{"request":{"view":{"pose":{"eye":[0.4,1.6,2],"target":[0,0.8,0]}}},"files_of_job":1}"#;
    let headers_of_json = format!("{headers}Content-Type: application/json\r\n");
    let open = || ask(at, "POST", "/api/viewports", &headers_of_json, submission);
    assert_eq!(open().status, 409);
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell-box.glb");
    let request = bottega::Request::new(scene).with("film.size", "[32, 32]").unwrap();
    dashboard.show_request(&request);
    let opened = open();
    assert_eq!((opened.status, &opened.json()["width"]), (201, &json!(32)));
    let place = format!("/api/viewports/{}", opened.json()["viewport"]);
    assert_eq!(get(&format!("{place}/frame.png")).status, 200);
    let small = br#"{"request":{"film":{"size":[16,8]}},"files_of_job":1}"#;
    let other = ask(at, "POST", "/api/viewports", &headers_of_json, small).json();
    assert_eq!((&other["width"], &other["height"]), (&json!(16), &json!(8)));
    assert_eq!(ask(at, "DELETE", &format!("/api/viewports/{}", other["viewport"]), &headers, b"").status, 204);
    assert_eq!(ask(at, "DELETE", &place, &headers, b"").status, 204);
    assert_eq!(get("/api/openapi.json").json(), openapi_document());
    assert_eq!(ask(at, "POST", "/api/jobs/1/pause", &headers, b"").status, 409);
    assert!(!stop.is_requested());
    assert_eq!(ask(at, "POST", "/api/jobs/1/cancel", &headers, b"").status, 200);
    assert!(stop.is_requested());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("o.png");
    std::fs::write(&path, b"picture").unwrap();
    let output = path.to_string_lossy().into_owned();
    let (utilization, overhead, bands, composition) = (1.0, 0.0, 0.0, 0.0);
    dashboard.publish(&Event::Finished { output, seconds: 1.0, samples: 1, utilization, overhead, bands, composition });
    assert_eq!(get("/api/jobs/1").json()["state"], "done");
    assert_eq!(get("/api/jobs/1/picture").body, b"picture");
    let mut stream = send(at, format!("GET /api/jobs/1/events HTTP/1.1\r\nHost: {at}\r\n{headers}\r\n").as_bytes());
    stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    let mut bytes = vec![0; 4096];
    let mut text = String::new();
    while !text.contains("\"finished\"") {
        let count = stream.read(&mut bytes).expect("the end is reported");
        text += &String::from_utf8_lossy(&bytes[..count]);
    }
    assert!(!text.contains(&*folder.path().to_string_lossy()), "{text}");
    assert!(Dashboard::serve(at, &stop).is_err(), "the address is taken");
}
