//! Notifications of the end of a picture: `--on`.
#![cfg(unix)]

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::TcpListener,
    path::Path,
    sync::{Arc, mpsc},
    thread,
    time::Duration,
};

use crate::support::{bottega, text};
use rcgen::{BasicConstraints, CertificateParams, DnType, IsCa, Issuer, KeyPair};
use ring::hmac;
use rustls::{ServerConfig, ServerConnection, StreamOwned, pki_types::PrivateKeyDer};
use serde_json::Value;

const WAIT: Duration = Duration::from_secs(60);
const SECRET: &str = "a secret of some length";

/// A request that the server got: first line, headers, body.
struct Delivery {
    line: String,
    headers: Vec<(String, String)>,
    body: Vec<u8>,
}

impl Delivery {
    fn header(&self, name: &str) -> &str {
        self.headers.iter().find(|(known, _)| known == name).map_or("", |(_, value)| value)
    }

    fn json(&self) -> Value {
        serde_json::from_slice(&self.body).expect("JSON")
    }
}

/// Starts a server that gives these answers in turn. Returns its address and the requests that it gets.
fn server(answers: Vec<String>) -> (String, mpsc::Receiver<Delivery>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let (sender, taken) = mpsc::channel();
    thread::spawn(move || {
        for answer in answers {
            let (stream, _) = listener.accept().expect("a connection");
            // The receiver may be gone.
            _ = sender.send(take(stream, &answer).expect("a request"));
        }
    });
    (address, taken)
}

/// The same behind a certificate for `name`, signed by an authority of its own, which is written to `authority`. A request
/// without a secure connection does not count as a delivery.
fn secure_server(name: &str, authority: &Path, answers: usize) -> (String, mpsc::Receiver<Delivery>) {
    let key = KeyPair::generate().expect("a key");
    let mut params = CertificateParams::new(Vec::new()).expect("names");
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    params.distinguished_name.push(DnType::CommonName, format!("who vouches for {name}"));
    fs::write(authority, params.self_signed(&key).expect("a certificate").pem()).expect("a file");
    let issuer = Issuer::new(params, key);
    let key = KeyPair::generate().expect("a key");
    let params = CertificateParams::new(vec![name.to_owned()]).expect("a name");
    let certificate = params.signed_by(&key, &issuer).expect("a certificate");
    let key = PrivateKeyDer::try_from(key.serialize_der()).expect("a key");
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().expect("versions");
    let config = config.with_no_client_auth().with_single_cert(vec![certificate.der().clone()], key).expect("a key");
    let config = Arc::new(config);
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("localhost:{}", listener.local_addr().expect("an address").port());
    let (sender, taken) = mpsc::channel();
    thread::spawn(move || {
        for _ in 0..answers {
            let (stream, _) = listener.accept().expect("a connection");
            let connection = ServerConnection::new(Arc::clone(&config)).expect("a connection");
            if let Some(delivery) = take(StreamOwned::new(connection, stream), "204 No Content") {
                _ = sender.send(delivery);
            }
        }
    });
    (address, taken)
}

/// Reads a request and answers it; `None`: the connection ended before.
fn take(mut stream: impl Read + Write, answer: &str) -> Option<Delivery> {
    let mut reader = BufReader::new(&mut stream);
    let mut lines = Vec::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok().filter(|&count| count > 0)?;
        match line.trim_end() {
            "" => break,
            line => lines.push(line.to_owned()),
        }
    }
    let header = |line: &String| line.split_once(": ").map(|(name, value)| (name.to_lowercase(), value.to_owned()));
    let headers: Vec<(String, String)> = lines.iter().skip(1).filter_map(header).collect();
    let length =
        headers.iter().find(|(name, _)| name == "content-length").expect("a length").1.parse().expect("a number");
    let mut body = vec![0; length];
    reader.read_exact(&mut body).expect("a body");
    write!(stream, "HTTP/1.1 {answer}\r\nContent-Length: 0\r\n\r\n").expect("an answer");
    stream.flush().expect("it is sent");
    Some(Delivery { line: lines[0].clone(), headers, body })
}

/// Renders a small picture. Returns the exit status and the output.
fn paint(folder: &Path, more: &[&str]) -> (Option<i32>, String) {
    paint_with(folder, more, &[])
}

/// The same with variables of the environment.
fn paint_with(folder: &Path, more: &[&str], variables: &[(&str, &str)]) -> (Option<i32>, String) {
    let output = folder.join("p.png");
    let words = ["render", "diffuse-box.glb", "-o", text(&output), "--size", "24x18", "--spp", "2", "--threads", "1"];
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes");
    let mut command = bottega(&[&words, more].concat());
    command.current_dir(scenes).env("BOTTEGA_ON_SECRET", "").envs(variables.iter().copied());
    let ran = command.output().expect("the program starts");
    (ran.status.code(), String::from_utf8_lossy(&ran.stderr).into_owned())
}

#[test]
fn a_server_is_notified_of_the_end_and_can_verify_the_sender() {
    let folder = tempfile::tempdir().expect("a folder");
    let secret = folder.path().join("secret");
    fs::write(&secret, format!("{SECRET}\n")).expect("a file");
    let (address, taken) = server(vec!["204 No Content".to_owned()]);
    let on = format!("done,failed=http://{address}/hook?key=1");
    let (code, said) = paint(folder.path(), &["--on", &on, "--on-secret-file", text(&secret)]);
    assert_eq!(code, Some(0), "{said}");
    let delivery = taken.recv_timeout(WAIT).expect("it is notified");
    assert_eq!(delivery.line, "POST /hook?key=1 HTTP/1.1");
    assert_eq!(delivery.header("content-type"), "application/json");
    assert_eq!(delivery.header("bottega-event"), "done");
    let signature = delivery.header("bottega-signature").strip_prefix("sha256=").expect("a signature");
    let key = hmac::Key::new(hmac::HMAC_SHA256, SECRET.as_bytes());
    let right: String = hmac::sign(&key, &delivery.body).as_ref().iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(signature, right);
    let notification = delivery.json();
    assert_eq!(
        (&notification["version"], &notification["event"], &notification["scene"]),
        (&1.into(), &"done".into(), &"diffuse-box.glb".into())
    );
    assert!(notification["output"].as_str().is_some_and(|output| output.ends_with("p.png")), "{notification}");
    assert!(
        notification["zones"].as_u64().is_some_and(|zones| zones > 0)
            && notification["zones_done"] == notification["zones"],
        "{notification}"
    );
    assert!(
        notification["seconds"].as_f64().is_some_and(|seconds| seconds > 0.0) && notification.get("job").is_none(),
        "{notification}"
    );
}

#[test]
fn what_fails_twice_is_tried_a_third_time_with_the_same_id_and_no_more() {
    let folder = tempfile::tempdir().expect("a folder");
    let (address, taken) = server(vec!["503 Busy".to_owned(), "429 Slow Down".to_owned(), "200 OK".to_owned()]);
    let (code, said) = paint(folder.path(), &["--on", &format!("done=http://{address}/")]);
    assert!(code == Some(0) && !said.contains("cannot notify"), "{said}");
    let all: Vec<Delivery> = taken.try_iter().collect();
    assert_eq!(all.len(), 3);
    assert!(all.iter().all(|it| it.body == all[0].body && !it.header("bottega-id").is_empty()));
    assert_eq!(all[0].header("bottega-signature"), "", "there is no secret");

    let (address, taken) = server(vec!["500 No".to_owned(); 4]);
    let (code, said) = paint(folder.path(), &["--on", &format!("done=http://{address}/secret-path")]);
    assert_eq!(code, Some(0), "the picture is painted nevertheless: {said}");
    assert!(said.contains(&format!("cannot notify http://{address} of `done`: it answered 500")), "{said}");
    assert!(said.contains("(3 tries)") && !said.contains("secret-path"), "{said}");
    assert_eq!(taken.try_iter().count(), 3);
    // A permanent error is not tried again.
    let (address, taken) = server(vec!["404 Not Found".to_owned(); 2]);
    let (_, said) = paint(folder.path(), &["--on", &format!("done=http://{address}/")]);
    assert!(said.contains("it answered 404") && taken.try_iter().count() == 1, "{said}");
}

#[test]
fn a_redirect_is_followed_to_the_same_server_and_to_no_other() {
    let folder = tempfile::tempdir().expect("a folder");
    let (other, elsewhere) = server(vec!["200 OK".to_owned()]);
    let (address, taken) = server(vec![format!("307 There\r\nLocation: http://{other}/x")]);
    let (code, said) = paint(folder.path(), &["--on", &format!("done=http://{address}/")]);
    assert!(code == Some(0) && said.contains("redirects to another server, which is not followed"), "{said}");
    assert_eq!((taken.try_iter().count(), elsewhere.try_iter().count()), (1, 0));
    let (address, taken) = server(vec!["308 There\r\nLocation: /next".to_owned(), "200 OK".to_owned()]);
    let (_, said) = paint(folder.path(), &["--on", &format!("done=http://{address}/first")]);
    let lines: Vec<String> = taken.try_iter().map(|delivery| delivery.line).collect();
    assert_eq!(lines, ["POST /first HTTP/1.1", "POST /next HTTP/1.1"], "{said}");
}

#[test]
fn a_trusted_server_is_notified_over_tls_and_another_one_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let [authority, other] = ["authority.pem", "other.pem"].map(|name| folder.path().join(name));
    let (address, taken) = secure_server("localhost", &authority, 2);
    let on = format!("done=https://{address}/hook");
    let (code, said) = paint_with(folder.path(), &["--on", &on], &[("SSL_CERT_FILE", text(&authority))]);
    assert!(code == Some(0) && !said.contains("cannot notify"), "{said}");
    let delivery = taken.recv_timeout(WAIT).expect("it is notified");
    assert_eq!((delivery.line.as_str(), delivery.header("host")), ("POST /hook HTTP/1.1", address.as_str()));
    assert_eq!(delivery.json()["event"], "done");

    // An untrusted certificate, and one with another name: nothing is sent.
    let (elsewhere, strange) = secure_server("example.org", &other, 1);
    for (address, trusted, why) in [
        (&address, &other, "its certificate is not signed by an authority that this machine trusts"),
        (&elsewhere, &other, "its certificate is for another name"),
    ] {
        let on = format!("done=https://{address}/secret-path");
        let (code, said) = paint_with(folder.path(), &["--on", &on], &[("SSL_CERT_FILE", text(trusted))]);
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(code == Some(0) && said.contains("cannot notify") && said.contains(why), "{said}");
        assert!(said.contains("SSL_CERT_FILE") && !said.contains("tries)") && !said.contains("secret-path"), "{said}");
    }
    assert_eq!((taken.try_iter().count(), strange.try_iter().count()), (0, 0));
    // A server without TLS.
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a connection");
        stream.read_exact(&mut [0; 5]).expect("the head of a greeting");
        stream.write_all(b"HTTP/1.1 400 Bad Request\r\n\r\n").expect("an answer");
        // The client ends it.
        _ = stream.read_to_end(&mut Vec::new());
    });
    let (_, said) = paint(folder.path(), &["--on", &format!("done=https://{address}/")]);
    assert!(said.contains("it does not speak TLS"), "{said}");
}

#[test]
fn a_command_has_json_on_its_input_and_facts_in_its_environment() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("notifications");
    let line = format!(
        "done=cat > {0}.json; echo \"$BOTTEGA_ON_EVENT:$BOTTEGA_ON_OUTPUT:$BOTTEGA_ON_SECRET\" > {0}.env",
        text(&out)
    );
    let output = folder.path().join("p $(touch owned).png");
    let words = ["render", "diffuse-box.glb", "-o", text(&output), "--size", "24x18", "--spp", "2", "--on", &line];
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes");
    let mut command = bottega(&words);
    let ran = command.current_dir(scenes).env("BOTTEGA_ON_SECRET", SECRET).output().expect("the program starts");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let notification: Value =
        serde_json::from_str(&fs::read_to_string(out.with_extension("json")).expect("JSON")).expect("JSON");
    assert_eq!(notification["event"], "done");
    let facts = fs::read_to_string(out.with_extension("env")).expect("facts");
    assert_eq!(facts.trim_end(), format!("done:{}:", text(&output)), "the secret is not passed on");
    // A notification that fails is reported, and nothing else changes.
    let (code, said) = paint(folder.path(), &["--on", "done=exit 3"]);
    assert!(
        code == Some(0) && said.contains("cannot notify `exit 3` of `done`: it ended with exit status: 3"),
        "{said}"
    );
}

#[test]
fn a_failure_and_a_stall_are_reported_and_an_event_without_subscription_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("notifications");
    let on = format!("failed,stalled=cat >> {}", text(&out));
    let words = ["--size", "96x72", "--set", "work.zones=2", "--spp", "300", "--stalled-after", "0.3", "--on", &on];
    let (code, said) = paint(folder.path(), &words[..]);
    assert_eq!(code, Some(2), "options were given twice: {said}");
    let output = folder.path().join("q.png");
    let words = [&["render", "diffuse-box.glb", "-o", text(&output), "--threads", "1"], &words[..]].concat();
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes");
    let ran = bottega(&words).current_dir(&scenes).output().expect("the program starts");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let notification = fs::read_to_string(&out).expect("it was reported");
    let first: Value =
        serde_json::Deserializer::from_str(&notification).into_iter().next().expect("one").expect("JSON");
    assert_eq!(first["event"], "stalled", "{notification}");
    assert!(first["reason"].as_str().is_some_and(|why| why.starts_with("no zone was finished for")), "{notification}");
    // A picture that cannot be written.
    fs::remove_file(&out).expect("it is there");
    let gone = folder.path().join("gone");
    fs::create_dir_all(gone.join("p.png")).expect("a folder");
    let (code, said) = paint(&gone, &["--on", &on]);
    assert_eq!(code, Some(1), "{said}");
    let notification: Value = serde_json::from_str(&fs::read_to_string(&out).expect("it was reported")).expect("JSON");
    assert!(
        notification["event"] == "failed" && notification["reason"].as_str().is_some_and(|why| why.contains("p.png")),
        "{notification}"
    );
    assert!(!said.contains("cannot notify"), "{said}");
}

#[test]
fn errors_of_on_are_reported_before_anything_is_painted() {
    let folder = tempfile::tempdir().expect("a folder");
    let short = folder.path().join("short");
    fs::write(&short, "abc").expect("a file");
    for (words, expected) in [
        (&["--on", "finished=http://x/"][..], "use done, failed or stalled"),
        (&["--on", "done=ftp://x/"], "use http:// or https://"),
        (&["--on", "done"], "write events"),
        (&["--on-secret-file", "x"], "--on <EVENTS=URL|COMMAND|desktop>"),
        (&["--on", "done=true", "--on-secret-file", text(&short)], "from 8 to 4096 are allowed"),
        (&["--on", "done=true", "--stalled-after", "soon"], "10m"),
        (&["--on", "done=true", "--farm", "--detach"], "cannot be used with"),
    ] {
        let (code, said) = paint(folder.path(), words);
        assert!(code == Some(2) && said.contains(expected), "{words:?}: {said}");
        assert!(!folder.path().join("p.png").exists());
    }
    let (code, said) = paint(folder.path(), &["--on", "done=true", "--on-secret-file", "nowhere"]);
    assert!(code != Some(0) && said.contains("nowhere"), "{said}");
}
