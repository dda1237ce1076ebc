//! Servers that others run.

use std::{
    fs,
    net::TcpListener,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use base64::{Engine, engine::general_purpose::URL_SAFE_NO_PAD};
use nkeys::KeyPair;
use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer};
use serde_json::{Value, json};
use tempfile::TempDir;

use super::{
    fixture::{Place, Process, WAIT, bits},
    support::{self, bottega, servers, text},
};

const PICTURE: [&str; 8] = ["render", "goblets.glb", "--size", "96x72", "--spp", "16", "--quiet", "-o"];

/// The folder of such a server.
pub(super) struct Other {
    folder: TempDir,
    pub(super) port: u16,
    server: PathBuf,
    _place: Place,
}

impl Other {
    pub(super) fn new(server: &Path) -> Self {
        let place = Place::beside_another();
        let port = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address").port();
        Self { folder: tempfile::tempdir().expect("a folder"), port, server: server.to_owned(), _place: place }
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, contents: &str) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, contents).expect("a file");
        path
    }

    pub(super) fn start(&self, more: &str) -> Process {
        let (port, store) = (self.port, self.path("store"));
        let words = format!("listen: \"127.0.0.1:{port}\"\n{}", more.replace("STORE", text(&store)));
        let config = self.write("nats.conf", &words);
        let mut command = Command::new(&self.server);
        let log = fs::File::create(self.path("server.log")).expect("a log");
        command.arg("--config").arg(&config).stdin(Stdio::null()).stdout(Stdio::null()).stderr(log);
        let process = Process(command.spawn().expect("a server"));
        let begun = Instant::now();
        while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
            let log = || fs::read_to_string(self.path("server.log")).unwrap_or_default();
            assert!(begun.elapsed() < WAIT, "the server does not begin: {}", log());
            thread::sleep(Duration::from_millis(50));
        }
        process
    }

    pub(super) fn command(&self, arguments: &[&str]) -> Command {
        let mut command = bottega(arguments);
        command.env("XDG_STATE_HOME", self.folder.path()).env_remove("BOTTEGA_FARM");
        command
    }

    /// Returns true if a client with this login gets the picture of a single machine, with another machine that helps.
    fn paints(&self, scheme: &str, login: &[&str]) {
        let address = format!("{scheme}://127.0.0.1:{}", self.port);
        let [plain, farm] = ["plain.exr", "farm.exr"].map(|name| self.path(name));
        support::succeed(&[&PICTURE[..], &[text(&plain)]].concat());
        let cache = self.path("cache");
        let mut join = self.command(&[&["join", &address, "--once", "--cache", text(&cache)], login].concat());
        let log = fs::File::create(self.path("join.log")).expect("a log");
        join.stdout(log.try_clone().expect("a log")).stderr(log);
        let mut machine = Process(join.spawn().expect("the program starts"));
        let farm_word = format!("--farm={address}");
        let render = self.command(&[&PICTURE[..], &[text(&farm), &farm_word], login].concat()).output();
        let render = render.expect("the program starts");
        assert!(render.status.success(), "{login:?}: {}", String::from_utf8_lossy(&render.stderr));
        assert!(bits(&farm) == bits(&plain), "{login:?}");
        assert!(machine.end(), "{login:?}: {}", fs::read_to_string(self.path("join.log")).unwrap_or_default());
        let said = fs::read_to_string(self.path("join.log")).expect("a log");
        assert!(said.contains("joined") && said.contains("left the farm"), "{login:?}: {said}");
    }

    /// Checks that a client with this login is refused.
    fn turns_away(&self, scheme: &str, login: &[&str]) {
        let address = format!("{scheme}://127.0.0.1:{}", self.port);
        let output = self.command(&[&["jobs", "list", "--farm", &address], login].concat()).output();
        let output = output.expect("the program starts");
        assert_eq!(output.status.code(), Some(1), "{login:?}");
    }
}

const STORE: &str = "jetstream { store_dir: \"STORE\" }\n";

#[test]
fn one_is_known_by_a_certificate_and_a_key_and_the_server_by_its_authority() {
    for server in servers() {
        let other = Other::new(&server);
        let mut params = CertificateParams::new(Vec::new()).expect("parameters");
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = rcgen::KeyPair::generate().expect("a key");
        let authority = other.write("ca.pem", &params.self_signed(&key).expect("a certificate").pem());
        let issuer = Issuer::new(params, key);
        let certified = |name: &str| {
            let key = rcgen::KeyPair::generate().expect("a key");
            let params = CertificateParams::new(vec![name.to_owned()]).expect("parameters");
            let certificate = params.signed_by(&key, &issuer).expect("a certificate").pem();
            [("cert", certificate), ("key", key.serialize_pem())]
                .map(|(what, pem)| other.write(&format!("{what}-{name}.pem"), &pem))
        };
        let [[cert, cert_key], [own, own_key]] = ["127.0.0.1", "workshop"].map(certified);
        let user = KeyPair::new_user();
        let seed = other.write("user.nk", &user.seed().expect("a seed"));
        let _server = other.start(&format!(
            "{STORE}tls {{ cert_file: {cert:?}, key_file: {cert_key:?}, ca_file: {authority:?}, verify: true }}\n\
             authorization {{ users: [ {{ nkey: {} }} ] }}\n",
            user.public_key()
        ));
        let seed = ["--nkey", text(&seed)];
        let knows = ["--tls-ca", text(&authority)];
        let own = ["--tls-cert", text(&own), "--tls-key", text(&own_key)];
        other.paints("tls", &[&seed[..], &knows, &own].concat());
        other.turns_away("tls", &[&seed[..], &knows].concat());
        other.turns_away("tls", &[&seed[..], &own].concat());
        other.turns_away("tls", &[&knows[..], &own].concat());
    }
}

#[test]
fn a_stream_with_another_configuration_is_reported() {
    for server in servers() {
        let other = Other::new(&server);
        let _server = other.start(STORE);
        let address = format!("nats://127.0.0.1:{}", other.port);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        runtime.block_on(async {
            let client = async_nats::connect(&address).await.expect("a link");
            let stream = async_nats::jetstream::stream::Config {
                name: "KV_bottega-bottega".to_owned(),
                subjects: vec!["$KV.bottega-bottega.>".to_owned()],
                max_messages_per_subject: 5,
                ..Default::default()
            };
            async_nats::jetstream::new(client).create_stream(stream).await.expect("a stream");
        });
        let output = other.command(&["jobs", "list", "--farm", &address]).output().expect("the program starts");
        let stderr = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert!(output.status.code() == Some(1) && stderr.contains("differs from the requested one"), "{stderr}");
    }
}

#[test]
fn one_is_known_by_credentials() {
    for server in servers() {
        let other = Other::new(&server);
        let (operator, account, system) = (KeyPair::new_operator(), KeyPair::new_account(), KeyPair::new_account());
        let user = KeyPair::new_user();
        let names_system = json!({"type": "operator", "version": 2, "system_account": system.public_key()});
        let operator_token = token(&operator, &operator, &names_system);
        let limits = |more: &[&str]| -> Value {
            let all = ["subs", "data", "payload", "imports", "exports", "conn", "leaf"].iter().chain(more);
            let all = all.map(|limit| ((*limit).to_owned(), json!(-1)));
            all.chain([("wildcards".to_owned(), json!(true))]).collect::<serde_json::Map<String, Value>>().into()
        };
        // The account of the system may have no streams.
        let [account_token, system_token] =
            [(&account, &["mem_storage", "disk_storage", "streams", "consumer"][..]), (&system, &[])].map(
                |(it, more)| token(it, &operator, &json!({"type": "account", "version": 2, "limits": limits(more)})),
            );
        let may = json!({"type": "user", "version": 2, "subs": -1, "data": -1, "payload": -1});
        let credentials = format!(
            "-----BEGIN NATS USER JWT-----\n{}\n------END NATS USER JWT------\n\n\
             -----BEGIN USER NKEY SEED-----\n{}\n------END USER NKEY SEED------\n",
            token(&user, &account, &may),
            user.seed().expect("a seed")
        );
        let credentials = other.write("user.creds", &credentials);
        let operator_token = other.write("operator.jwt", &operator_token);
        let _server = other.start(&format!(
            "{STORE}operator: {operator_token:?}\nsystem_account: {}\nresolver: MEMORY\nresolver_preload: {{\n  {}: {account_token}\n  \
             {}: {system_token}\n}}\n",
            system.public_key(),
            account.public_key(),
            system.public_key(),
        ));
        other.paints("nats", &["--creds", text(&credentials)]);
        other.turns_away("nats", &[]);
    }
}

/// A signed statement of `issuer` about another key.
fn token(of: &KeyPair, issuer: &KeyPair, says: &Value) -> String {
    let claims =
        json!({"jti": "1", "iat": 1, "iss": issuer.public_key(), "sub": of.public_key(), "name": "n", "nats": says});
    let encode = |value: &Value| URL_SAFE_NO_PAD.encode(value.to_string());
    let signed = format!("{}.{}", encode(&json!({"typ": "JWT", "alg": "ed25519-nkey"})), encode(&claims));
    let signature = issuer.sign(signed.as_bytes()).expect("a signature");
    format!("{signed}.{}", URL_SAFE_NO_PAD.encode(signature))
}

#[test]
fn when_the_server_has_no_room_the_job_waits_until_it_has() {
    let Some(server) = servers().pop() else { return };
    let other = Other::new(&server);
    let start = |room: &str| {
        other.start(&format!(
            "authorization {{ token: \"word\" }}\njetstream {{ store_dir: \"STORE\", max_file_store: {room} }}\n"
        ))
    };
    let picture =
        ["render", "goblets.glb", "--size", "640x480", "--spp", "4", "--set", "work.zones=64", "--quiet", "-o"];
    let [plain, farm] = ["plain.exr", "farm.exr"].map(|name| other.path(name));
    support::succeed(&[&picture[..], &[text(&plain)]].concat());
    let mut small = start("3M");
    let log = fs::File::create(other.path("log")).expect("a log");
    let address = format!("--farm=nats://word@127.0.0.1:{}", other.port);
    let mut command = other.command(&[&picture[..], &[text(&farm), &address]].concat());
    let mut render = Process(command.stderr(log).spawn().expect("the program starts"));
    let begun = Instant::now();
    let said = || fs::read_to_string(other.path("log")).unwrap_or_default();
    while !said().contains("its disk may be full") {
        assert!(begun.elapsed() < WAIT, "{}", said());
        thread::sleep(Duration::from_millis(100));
    }
    small.kill();
    let _large = start("1G");
    assert!(render.wait(), "{}", said());
    assert!(bits(&farm) == bits(&plain));
}
