//! A farm over HTTP, as a browser or a script uses it.

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
};

use serde_json::{Value, json};

use super::{
    fixture::{Farm, WAIT, bits},
    support::{scenes, servers, text},
};

/// A piece of a file.
const PIECE: usize = 4 << 20;

/// A door of a farm: `HOST:PORT`, and a token.
struct Web {
    at: String,
    token: String,
}

impl Web {
    /// The addresses that a process has printed: to steer, and to see.
    fn doors(farm: &Farm, log: &str) -> [Self; 2] {
        farm.until_says(log, "to look on only");
        farm.until("both addresses are printed", || farm.said(log).matches("?token=").count() == 2);
        let said = farm.said(log);
        let mut doors = said.lines().filter_map(|line| line.trim().strip_prefix("http://")?.split_once("/?token="));
        [(); 2].map(|()| {
            let (at, token) = doors.next().expect("an address");
            Self { at: at.to_owned(), token: token.to_owned() }
        })
    }

    fn send(&self, method: &str, path: &str, kind: &str, body: &[u8]) -> BufReader<TcpStream> {
        let Self { at, token } = self;
        let mut stream = TcpStream::connect(at).expect("the door is open");
        stream.set_read_timeout(Some(WAIT)).expect("a time limit");
        let head = format!(
            "{method} {path} HTTP/1.0\r\nHost: {at}\r\nAuthorization: Bearer {token}\r\nContent-Type: {kind}\r\n\
             Content-Length: {}\r\n\r\n",
            body.len()
        );
        stream.write_all(&[head.as_bytes(), body].concat()).expect("it is sent");
        BufReader::new(stream)
    }

    fn ask(&self, method: &str, path: &str, kind: &str, body: &[u8]) -> (u16, Vec<u8>) {
        let mut reader = self.send(method, path, kind, body);
        let status = skip_head(&mut reader);
        let mut body = Vec::new();
        reader.read_to_end(&mut body).expect("an answer");
        (status, body)
    }

    fn get(&self, path: &str) -> (u16, Vec<u8>) {
        self.ask("GET", path, "text/plain", b"")
    }

    fn post(&self, path: &str, body: &Value) -> (u16, Value) {
        let (status, body) = self.ask("POST", path, "application/json", body.to_string().as_bytes());
        (status, serde_json::from_slice(&body).unwrap_or_default())
    }

    fn job(&self, number: u64) -> Value {
        serde_json::from_slice(&self.get(&format!("/api/jobs/{number}")).1).expect("JSON")
    }

    /// Sends the missing pieces of a file. Returns its digest, and the number of pieces sent.
    fn upload(&self, name: &str, bytes: &[u8]) -> (String, usize) {
        let hash = |bytes: &[u8]| blake3::hash(bytes).to_hex().to_string();
        let chunks: Vec<String> = bytes.chunks(PIECE).map(hash).collect();
        let offer = json!({ "name": name, "size": bytes.len(), "digest": hash(bytes), "chunks": chunks });
        let (status, answer) = self.post("/api/uploads", &offer);
        assert_eq!(status, 200, "{answer}");
        let missing = answer["missing"].as_array().expect("a list").clone();
        for piece in bytes.chunks(PIECE).filter(|piece| missing.contains(&json!(hash(piece)))) {
            let path = format!("/api/uploads/chunks/{}", hash(piece));
            let other = format!("/api/uploads/chunks/{}", hash(b"another"));
            assert_eq!(self.ask("PUT", &other, "application/octet-stream", piece).0, 422);
            assert_eq!(self.ask("PUT", &path, "application/octet-stream", piece).0, 204);
        }
        (hash(bytes), missing.len())
    }
}

fn skip_head(reader: &mut impl BufRead) -> u16 {
    let mut status = None;
    let mut line = String::new();
    while reader.read_line(&mut line).expect("a head") > 2 {
        status = status.or_else(|| line.split(' ').nth(1)?.parse().ok());
        line.clear();
    }
    status.expect("a status")
}

/// The picture of `fixture::PICTURE` with some samples, as a request.
fn request(scene: &str, samples: u32) -> Value {
    json!({ "scene": { "file": scene }, "film": { "size": [96, 72] }, "seed": 5, "goal": { "samples": samples },
        "work": { "zones": 24 }, "output": { "file": "web.exr" } })
}

#[test]
fn a_picture_is_submitted_watched_and_fetched_over_http_and_has_the_same_bits() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start_with(&server, &["--web", "127.0.0.1:0"]);
    let plain = farm.plain();
    let [steer, see] = Web::doors(&farm, "up.log");
    let scene = fs::read(scenes().join("goblets.glb")).expect("a scene");
    let (digest, sent) = steer.upload("goblets.glb", &scene);
    assert!(sent > 0);
    assert_eq!(steer.upload("goblets.glb", &scene).1, 0, "it is there");
    let submission =
        json!({ "request": request("scenes/goblets.glb", 384), "files": { "scenes/goblets.glb": digest } });
    // A request that cannot be rendered is refused before it becomes a job.
    for (change, word) in [
        (json!({ "goal": { "samples": 0 } }), "goal.samples"),
        (json!({ "scene": { "file": "/etc/passwd" } }), "scene.file"),
        (json!({ "scene": { "file": "scenes/../../x.glb" } }), "scene.file"),
        (json!({ "output": { "file": "/root/.bashrc.png" } }), "output.file"),
        (json!({ "output": { "file": "../x.png" } }), "output.file"),
        // The farm keeps the picture: the output names no folder, wherever `bottega up` runs.
        (json!({ "output": { "file": "out/x.png" } }), "output.file"),
        (json!({ "goal": { "samples": -1 } }), "`goal.samples` is -1: from 1 to"),
        (json!({ "environment": { "light": { "file": "/etc/passwd" } } }), "environment.light"),
        (json!({ "nonsense": 1 }), "nonsense"),
        (json!({ "film": { "size": [4_000_000, 4_000_000] } }), "film.size"),
        (json!({ "work": { "rules": [{ "file": "/etc/passwd" }] } }), "work.rules"),
    ] {
        let mut wrong = submission.clone();
        for (key, value) in change.as_object().expect("fields") {
            wrong["request"][key] = value.clone();
        }
        let (status, body) = steer.post("/api/jobs", &wrong);
        assert!(
            [409, 422].contains(&status) && body["detail"].as_str().expect("why").contains(word),
            "{change}: {body}"
        );
    }
    let mut wrong = submission.clone();
    wrong["files"] = json!({ "../../x.glb": digest });
    assert_eq!(steer.post("/api/jobs", &wrong).0, 422);
    assert_eq!(see.get("/api/jobs").1, b"[]");
    assert_eq!(see.post("/api/jobs", &submission).0, 403);
    let (status, answer) = steer.post("/api/jobs", &submission);
    assert_eq!((status, &answer["job"]), (201, &json!(1)), "{answer}");

    let mut events = see.send("GET", "/api/jobs/1/events", "text/plain", b"");
    assert_eq!(skip_head(&mut events), 200);
    let _one = farm.join("one");
    let machine = || serde_json::from_slice::<Value>(&see.get("/api/machines").1).expect("JSON");
    farm.until("its machine is seen", || machine()[0]["name"].is_string());
    let name = machine()[0]["name"].as_str().expect("a name").to_owned();
    assert_eq!(see.post(&format!("/api/machines/{name}/suspend"), &json!({})).0, 403);
    // There is something to see before a zone is done.
    farm.until("a first look", || steer.job(1)["seen"] == true);
    assert!(see.get("/api/jobs/1/preview.png").1.starts_with(b"\x89PNG"), "{}", farm.logs());
    // The stream reports each zone and the end.
    let (mut line, mut done) = (String::new(), std::collections::BTreeSet::new());
    let mut has_ended = false;
    let mut preview = None;
    while !has_ended {
        line.clear();
        assert!(events.read_line(&mut line).expect("an event") > 0, "{}", farm.logs());
        let Some(data) = line.strip_prefix("data: ") else { continue };
        for event in serde_json::from_str::<Vec<Value>>(data).expect("JSON") {
            if event["event"] == "zone" && event["state"] == "done" {
                done.insert(event["id"].as_u64());
            }
            has_ended |= event["event"] == "job" && event["state"] == "done";
        }
        if preview.is_none() && !done.is_empty() {
            preview = Some(see.get("/api/jobs/1/preview.png")).filter(|(status, _)| *status == 200);
        }
    }
    assert!(done.len() > 4, "{done:?}");
    let (_, preview) = preview.expect("what is painted is seen while it is");
    assert!(preview.starts_with(b"\x89PNG"), "{} bytes", preview.len());
    let (status, picture) = see.get("/api/jobs/1/picture");
    assert_eq!(status, 200);
    let path = farm.path("web.exr");
    fs::write(&path, &picture).expect("a file");
    assert!(bits(&path) == plain, "{}", farm.logs());
    assert!(see.get("/api/jobs/1/preview.png").1.starts_with(b"\x89PNG"));
    assert!(see.get("/api/jobs/1/importance.png").1.starts_with(b"\x89PNG"));
    let zones: Value = serde_json::from_slice(&see.get("/api/jobs/1/zones").1).expect("JSON");
    assert!(zones.as_array().is_some_and(|zones| zones.iter().all(|zone| zone["state"] == "done")), "{zones}");
    for path in ["/api/jobs", "/api/jobs/1/log", "/api/jobs/1/agents", "/api/machines", "/api/jobs/1/zones"] {
        let answer = String::from_utf8(see.get(path).1).expect("text");
        assert!(
            !answer.contains(text(&farm.path(""))) && !answer.contains("/root") && !answer.contains("/home"),
            "{answer}"
        );
    }

    // Tokens have names, are accepted at all doors, and can be revoked.
    let made: Value =
        serde_json::from_str(&farm.succeed(&["tokens", "make", "anna", "--role", "steer", "--json"])).expect("JSON");
    let token = made["token"].as_str().expect("a token").to_owned();
    assert_eq!(made["url"], format!("http://{}/?token={token}", steer.at));
    let anna = Web { at: steer.at.clone(), token };
    farm.until("the door knows it", || anna.get("/api/jobs").0 == 200);
    let names = |body: Vec<u8>| {
        let tokens: Vec<Value> = serde_json::from_slice(&body).expect("JSON");
        tokens.iter().map(|token| format!("{} {}", token["name"], token["role"]).replace('"', "")).collect::<Vec<_>>()
    };
    assert_eq!(names(anna.get("/api/tokens").1), ["see see", "steer steer", "anna steer"]);
    assert_eq!(see.get("/api/tokens").0, 403);
    assert_eq!(anna.ask("DELETE", "/api/tokens/nobody", "text/plain", b"").0, 404);

    // The files of a job that is known are enough for another; another process serves the same farm, with the same tokens.
    let other = farm.spawn(&["web", "--web", "127.0.0.1:0"], "web.log");
    let [steer_there, _] = Web::doors(&farm, "web.log");
    assert_eq!((&steer_there.token, steer_there.at == steer.at), (&steer.token, false));
    assert_eq!(steer_there.post("/api/jobs/1/pause", &json!({})).0, 409, "it is over");
    assert_eq!(steer_there.post(&format!("/api/machines/{name}/suspend"), &json!({})).0, 200);
    farm.until("it rests", || machine()[0]["state"] == "suspended");
    let (status, answer) =
        steer_there.post("/api/jobs", &json!({ "request": request("goblets.glb", 2000), "files_of_job": 1 }));
    assert_eq!((status, &answer["job"]), (201, &json!(2)), "{answer}");
    // A change at one door arrives at the other over the farm.
    farm.until("the first door knows it", || steer.job(2)["state"].is_string());
    assert_eq!(anna.post("/api/jobs/2/pause", &json!({})).1["state"], "paused");
    let log = farm.log_of(2);
    assert!(log.contains("paused by the token `anna` at 127.0.0.1") && log.contains("the token `steer` at "), "{log}");
    let noted = farm.said("state/bottega/web.log");
    assert!(noted.contains(" anna 127.0.0.1 POST /api/jobs/2/pause 200\n"), "{noted}");
    let again = farm.run(&["tokens", "make", "anna"]);
    assert!(!again.status.success(), "the name is taken");
    farm.succeed(&["tokens", "revoke", "anna"]);
    farm.until("it is revoked at both doors", || {
        let there = Web { at: steer_there.at.clone(), token: anna.token.clone() };
        anna.get("/api/jobs").0 == 401 && there.get("/api/jobs").0 == 401
    });
    let renewed: Value = serde_json::from_str(&farm.succeed(&["tokens", "revoke", "see", "--json"])).expect("JSON");
    let renewed = Web { at: see.at.clone(), token: renewed["token"].as_str().expect("a token").to_owned() };
    farm.until("another one takes its place", || see.get("/api/jobs").0 == 401 && renewed.get("/api/jobs").0 == 200);
    farm.until("the other door knows", || steer_there.job(2)["state"] == "paused");
    let urgent = json!({ "priority": 30 }).to_string();
    assert_eq!(steer.ask("PUT", "/api/jobs/2/priority", "application/json", urgent.as_bytes()).0, 200);
    assert_eq!(steer.post("/api/jobs/2/resume", &json!({})).1["priority"], 30);
    assert_eq!(steer.post(&format!("/api/machines/{name}/resume"), &json!({})).0, 200);
    farm.until_painted(2, 0.05);
    assert_eq!(steer.ask("DELETE", "/api/jobs/2", "text/plain", b"").0, 409, "it is not over");
    assert_eq!(steer.post("/api/jobs/2/cancel", &json!({})).1["state"], "cancelled");
    assert_eq!(steer.ask("DELETE", "/api/jobs/2", "text/plain", b"").0, 204);
    farm.until("the other door forgets it", || steer_there.get("/api/jobs/2").0 == 404);
    drop(other);
    farm.until("the other door is closed", || TcpStream::connect(&steer_there.at).is_err());
    assert_eq!(steer.get("/api/jobs/1").0, 200, "one door closes, the other stays");
}

/// The processes that have painted the picture first are gone, so that the work before the first zone is done once more, by two machines
/// together. Once this waited for ever.
#[test]
fn a_job_that_is_painted_again_keeps_its_picture_until_the_new_one_is_there() {
    const PHOTONS: [&str; 4] = ["--integrator", "photon", "--set", "photons.count=400000"];
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start_with(&server, &["--web", "127.0.0.1:0"]);
    let [steer, _] = Web::doors(&farm, "up.log");
    let mut first = [farm.join("one"), farm.join("two")];
    let more = [&PHOTONS[..], &["--detach"]].concat();
    assert!(farm.render_by("a.exr", "--spp=8", &more).wait(), "{}", farm.logs());
    farm.until_state(1, "done");
    let fetched = |name: &str| {
        let path = farm.path(name);
        farm.succeed(&["jobs", "fetch", "1", "-o", text(&path)]);
        bits(&path)
    };
    let picture = fetched("first.exr");
    first.iter_mut().for_each(|machine| assert!(machine.end(), "{}", farm.logs()));
    let again = || {
        let (status, view) = steer.post("/api/jobs/1/zones/3/requeue", &json!({}));
        assert!(status == 200 && view["state"] == "active" && view["kept"] == true, "{view}");
        // Progress of the previous painting does not count.
        assert_eq!((&view["done"], &view["zones_done"], &view["seconds_left"]), (&json!(0.0), &json!(0), &json!(null)));
    };
    again();
    let is_kept = |name: &str| {
        assert!(fetched(name) == picture);
        for path in ["picture", "preview.png"] {
            assert_eq!(steer.get(&format!("/api/jobs/1/{path}")).0, 200, "{path}");
        }
    };
    is_kept("active.exr");
    assert_eq!(steer.post("/api/jobs/1/cancel", &json!({})).1["state"], "cancelled");
    is_kept("cancelled.exr");
    again();
    let _machines = [farm.join("three"), farm.join("four")];
    farm.until_state(1, "done");
    is_kept("second.exr");
    let job = steer.job(1);
    assert_eq!((&job["stirs"], &job["done"]), (&json!(0), &json!(1.0)), "{}", farm.log_of(1));
    assert!(farm.log_of(1).contains(" parts of the work before the first zone"), "{}", farm.log_of(1));
}
