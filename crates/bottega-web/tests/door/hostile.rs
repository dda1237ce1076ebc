//! Hostile clients of a door.

use std::{
    io::{BufReader, Read, Write},
    net::{SocketAddr, TcpStream},
    time::{Duration, Instant},
};

use bottega_web::{EVENT_STREAMS_MAX, JSON_BYTES_MAX};

use crate::door::fake::{DoorAnswer, FakeFarm, SEE, STEER, ask, bearer, get, head, open, post, raw, send, zone};

/// The farm got no call, and honest clients are answered.
fn is_unharmed(farm: &FakeFarm, at: SocketAddr) {
    assert_eq!(farm.noted(), Vec::<String>::new());
    let answer = get(at, "/api/jobs");
    assert_eq!(answer.status, 200, "{answer:?}");
}

fn is_problem(answer: &DoorAnswer, status: u16) {
    assert_eq!(
        (answer.status, answer.header("content-type")),
        (status, Some("application/problem+json")),
        "{answer:?}"
    );
    let problem = answer.json();
    assert!(problem["status"] == status && problem["detail"].as_str().is_some_and(|it| !it.is_empty()), "{problem}");
}

#[test]
fn foreign_names_and_pages_are_refused_whatever_their_token() {
    let (farm, door) = open();
    let at = door.address();
    let token = bearer(STEER);
    let port = at.port();
    for hosts in [
        "Host: evil.example\r\n".to_owned(),
        format!("Host: evil.example:{port}\r\n"),
        format!("Host: 127.0.0.1:{port}.evil.example\r\n"),
        "Host: 127.0.0.1\r\n".to_owned(),
        format!("Host: 127.0.0.1:{port}\r\nHost: evil.example\r\n"),
        "Host:\r\n".to_owned(),
        String::new(),
    ] {
        for path in ["/", "/api/jobs", "/style.css"] {
            let answer = raw(at, format!("GET {path} HTTP/1.1\r\n{hosts}Connection: close\r\n{token}\r\n").as_bytes());
            // The parser may refuse two of them before the door looks.
            assert!([400, 421].contains(&answer.status), "{hosts:?} {path}: {answer:?}");
        }
    }
    for origin in ["http://evil.example", "null", "http://127.0.0.1:1", "https://evil.example:443", "x"] {
        let headers = format!("{token}Origin: {origin}\r\n");
        is_problem(&ask(at, "POST", "/api/jobs/1/cancel", &headers, b""), 403);
        is_problem(&ask(at, "GET", "/api/jobs", &headers, b""), 403);
    }
    for site in ["cross-site", "same-site"] {
        let headers = format!("{token}Sec-Fetch-Site: {site}\r\nSec-Fetch-Mode: no-cors\r\n");
        is_problem(&ask(at, "POST", "/api/jobs/1/cancel", &headers, b""), 403);
    }
    is_unharmed(&farm, at);
    let own = format!("{token}Origin: http://127.0.0.1:{port}\r\nSec-Fetch-Site: same-origin\r\n");
    assert_eq!(ask(at, "POST", "/api/jobs/1/cancel", &own, b"").status, 200);
}

#[test]
fn without_the_right_token_nothing_is_shown_or_done() {
    let (farm, door) = open();
    let at = door.address();
    for path in ["/api/jobs", "/api/tokens", "/api/jobs/1/events", "/api/nothing"] {
        is_problem(&ask(at, "GET", path, "", b""), 401);
    }
    for headers in [
        "Authorization: Basic YTpi\r\n".to_owned(),
        bearer(""),
        bearer(&STEER[1..]),
        bearer(&format!("{STEER}0")),
        format!("Cookie: bottega_1={STEER}\r\n"),
        format!("Authorization: Bearer x\r\nCookie: bottega_{}={STEER}\r\n", at.port()),
    ] {
        is_problem(&ask(at, "POST", "/api/jobs/1/cancel", &headers, b""), 401);
    }
    assert_eq!(
        ask(at, "GET", &format!("/api/jobs?token={STEER}"), "", b"").status,
        401,
        "a token in a path does not count"
    );
    for (method, path) in [
        ("POST", "/api/jobs"),
        ("POST", "/api/jobs/1/pause"),
        ("PUT", "/api/jobs/1/priority"),
        ("DELETE", "/api/jobs/2"),
        ("POST", "/api/machines/machine/terminate"),
        ("GET", "/api/tokens"),
        ("POST", "/api/tokens"),
        ("DELETE", "/api/tokens/steer"),
        ("POST", "/api/uploads"),
        ("PUT", "/api/uploads/chunks/a"),
    ] {
        is_problem(&ask(at, method, path, &bearer(SEE), b""), 403);
    }
    is_unharmed(&farm, at);
    // A client that guesses tokens is slowed down.
    let guessed: Vec<u16> =
        (0..60).map(|guess| ask(at, "GET", "/api/jobs", &bearer(&guess.to_string()), b"").status).collect();
    assert!(guessed.contains(&429), "{guessed:?}");
    is_unharmed(&farm, at);
}

#[test]
fn what_is_not_understood_is_refused_with_its_reason() {
    let (farm, door) = open();
    let at = door.address();
    for (body, status) in [
        ("", 400),
        ("{", 400),
        ("nonsense", 400),
        ("[]", 422),
        ("{}", 422),
        (r#"{"request":{},"evil":1}"#, 422),
        (r#"{"request":{},"files":{"a":1}}"#, 422),
        (r#"{"request":{},"files_of_job":-1}"#, 422),
    ] {
        is_problem(&post(at, "POST", "/api/jobs", body), status);
    }
    // Deep nesting ends in an error, not in the end of the stack.
    let deep = format!("{{\"request\":{}{}}}", "[".repeat(200_000), "]".repeat(200_000));
    is_problem(&post(at, "POST", "/api/jobs", &deep), 400);
    for body in [r#"{"priority":0}"#, r#"{"priority":99999999}"#, r#"{"priority":-1}"#, r#"{"priority":1e99}"#] {
        is_problem(&post(at, "PUT", "/api/jobs/1/priority", body), 422);
    }
    is_problem(&ask(at, "POST", "/api/jobs", &bearer(STEER), b"{}"), 415);
    let form = format!("{}Content-Type: text/plain\r\n", bearer(STEER));
    is_problem(&ask(at, "POST", "/api/jobs", &form, br#"{"request":{}}"#), 415);
    for path in
        ["/api/jobs/-1", "/api/jobs/99999999999", "/api/jobs/abc", "/api/jobs/7", "/api/machines/%00", "/api/jobs/%ff"]
    {
        is_problem(&get(at, path), 404);
    }
    for path in
        ["/../etc/passwd", "/..%2f..%2fetc%2fpasswd", "/style.css/../../etc/passwd", "/etc/passwd", "//etc/passwd"]
    {
        is_problem(&get(at, path), 404);
    }
    for path in ["/api/../etc/passwd", "/api/jobs/../../etc/passwd", "/api/machines/..%2f..%2fetc%2fpasswd"] {
        is_problem(&get(at, path), 404);
    }
    is_problem(&ask(at, "BREW", "/api/jobs", &bearer(STEER), b""), 405);
    is_unharmed(&farm, at);
}

#[test]
fn what_is_too_large_is_not_read() {
    let (farm, door) = open();
    let at = door.address();
    let json = format!("{}Content-Type: application/json\r\n", bearer(STEER));
    let head =
        |headers: &str, path: &str| format!("POST {path} HTTP/1.1\r\nHost: {at}\r\nConnection: close\r\n{headers}\r\n");
    // A body that is announced as large and never sent.
    let claimed = head(&format!("{json}Content-Length: 99999999999\r\n"), "/api/jobs");
    is_problem(&raw(at, claimed.as_bytes()), 413);
    // A body without a length.
    let endless = head(&format!("{json}Transfer-Encoding: chunked\r\n"), "/api/jobs");
    let mut bytes = endless.into_bytes();
    for _ in 0..=JSON_BYTES_MAX / 65536 {
        bytes.extend(b"10000\r\n");
        bytes.extend([b' '; 65536]);
        bytes.extend(b"\r\n");
    }
    let answer = raw(at, &bytes);
    // The door may close the connection while the client still sends.
    assert!([413, 0].contains(&answer.status), "{:?}", answer.head);
    let piece = ask(at, "PUT", "/api/uploads/chunks/a", &bearer(STEER), &vec![0; (4 << 20) + 1]);
    assert!([413, 0].contains(&piece.status), "{:?}", piece.head);
    let long = format!("X: {}\r\n", "x".repeat(100_000));
    assert!([431, 400, 0].contains(&ask(at, "GET", "/api/jobs", &long, b"").status));
    let many: String = (0..500).map(|i| format!("X-{i}: y\r\n")).collect();
    assert!([431, 400, 0].contains(&ask(at, "GET", "/api/jobs", &many, b"").status));
    assert!(farm.pieces.lock().unwrap().is_empty());
    is_unharmed(&farm, at);
}

#[test]
fn ten_thousand_streams_of_events_are_bounded() {
    let (farm, door) = open();
    let at = door.address();
    let request = format!("GET /api/jobs/1/events HTTP/1.1\r\nHost: {at}\r\n{}\r\n", bearer(SEE));
    let (mut open, mut refused) = (Vec::new(), 0);
    for _ in 0..10_000 {
        let mut reader = BufReader::new(send(at, request.as_bytes()));
        match head(&mut reader) {
            (200, _) => open.push(reader),
            (503, head_text) => {
                assert!(head_text.to_lowercase().contains("retry-after"), "{head_text}");
                refused += 1;
            }
            (status, head_text) => panic!("{status}: {head_text}"),
        }
    }
    assert_eq!((open.len(), refused), (EVENT_STREAMS_MAX, 10_000 - EVENT_STREAMS_MAX));
    is_unharmed(&farm, at);
    // A client that leaves makes room.
    drop(open);
    farm.live.tell(&zone(1, "open"));
    let begun = Instant::now();
    loop {
        let (status, _) = head(&mut BufReader::new(send(at, request.as_bytes())));
        if status == 200 {
            return;
        }
        assert!(begun.elapsed() < Duration::from_secs(20), "no room comes");
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn a_client_that_reads_nothing_is_dropped_and_a_slow_one_gets_the_end() {
    let (farm, door) = open();
    let at = door.address();
    let request = format!("GET /api/jobs/1/events HTTP/1.1\r\nHost: {at}\r\n{}\r\n", bearer(SEE));
    let mut slow = send(at, request.as_bytes());
    let mut stuck =
        send(at, format!("GET /api/jobs/2/picture HTTP/1.1\r\nHost: {at}\r\n{}\r\n", bearer(SEE)).as_bytes());
    // Much more than sockets hold, while the client does not read.
    for round in 0..40u32 {
        for id in 0..2000 {
            farm.live.tell(&zone(id, &format!("{round} {}", "x".repeat(200))));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    farm.live.tell(&zone(5000, "the end"));
    is_unharmed(&farm, at);
    // The slow client reads now: it has missed steps, and gets the whole state.
    let (mut received, mut bytes) = (Vec::new(), vec![0; 1 << 16]);
    while !String::from_utf8_lossy(&received[received.len().saturating_sub(1 << 18)..]).contains("the end") {
        let count = slow.read(&mut bytes).expect("the end arrives");
        assert!(count > 0, "it is dropped too soon");
        received.extend(&bytes[..count]);
    }
    let rounds = (0..40).filter(|round| String::from_utf8_lossy(&received).contains(&format!("\"{round} x"))).count();
    assert!(rounds < 40, "it was held up for a reader that takes nothing");
    // A client that read nothing of the picture for long has lost it.
    std::thread::sleep(Duration::from_secs(22));
    let mut got = 0;
    while let Ok(count) = stuck.read(&mut bytes) {
        if count == 0 {
            break;
        }
        got += count;
    }
    assert!(got < 64 << 20, "all {got} bytes were kept for it");
    is_unharmed(&farm, at);
}

#[test]
fn half_requests_end() {
    let (farm, door) = open();
    let at = door.address();
    let json = format!("{}Content-Type: application/json\r\n", bearer(STEER));
    let half = [
        String::new(),
        "GET /api/jo".to_owned(),
        format!("GET /api/jobs HTTP/1.1\r\nHost: {at}\r\n"),
        format!("POST /api/jobs HTTP/1.1\r\nHost: {at}\r\n{json}Content-Length: 100\r\n\r\n{{\"req"),
    ];
    let mut open: Vec<TcpStream> = half.iter().map(|half| send(at, half.as_bytes())).collect();
    // A client that sends single letters does not extend its time.
    let mut dripping = send(at, format!("GET /api/jobs HTTP/1.1\r\nHost: {at}\r\nX: ").as_bytes());
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(14) && dripping.write_all(b"x").is_ok() {
        std::thread::sleep(Duration::from_millis(250));
    }
    is_unharmed(&farm, at);
    open.push(dripping);
    for (number, stream) in open.iter_mut().enumerate() {
        let mut received = Vec::new();
        // The connection ends or is cut off: it does not wait for ever.
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        match stream.read_to_end(&mut received) {
            Ok(_) => {}
            Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::ConnectionReset, "{number}: {error}"),
        }
        let text = String::from_utf8_lossy(&received);
        assert!(text.is_empty() || text.contains(" 408 ") || text.contains(" 400 "), "{number}: {text}");
    }
    is_unharmed(&farm, at);
}
