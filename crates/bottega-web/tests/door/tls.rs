//! A door beyond this machine.

use std::{
    io::{Read, Write},
    net::{SocketAddr, TcpListener, TcpStream},
    sync::Arc,
    time::Duration,
};

use bottega_cluster::web_secrets::WebSecrets;
use bottega_web::{Door, DoorOptions};
use rustls::{
    ClientConfig, ClientConnection, RootCertStore, StreamOwned,
    pki_types::{CertificateDer, pem::PemObject},
};

use crate::door::fake::{FakeFarm, STEER, bearer, send};

#[test]
fn beyond_this_machine_it_speaks_tls_alone_with_the_certificate_that_it_was_given() {
    let secrets = WebSecrets::fresh().expect("random numbers");
    let certificate = CertificateDer::from_pem_slice(secrets.certificate.0.as_bytes()).expect("a certificate");
    let token = STEER;
    let listener = TcpListener::bind("0.0.0.0:0").expect("a free port");
    let options = DoorOptions { listener, certificate: secrets.certificate, names: Vec::new(), log: None };
    let door = Door::open(Arc::new(FakeFarm::default()), options).expect("a door");
    let at = SocketAddr::from(([127, 0, 0, 1], door.address().port()));
    assert!(door.steering_url().starts_with("https://127.0.0.1:"), "{}", door.steering_url());

    let request = format!("GET /?token={token} HTTP/1.1\r\nHost: {at}\r\nConnection: close\r\n{}\r\n", bearer(token));
    let mut received = Vec::new();
    // The connection is closed or cut off, at most with an alert, and without HTTP.
    _ = send(at, request.as_bytes()).read_to_end(&mut received);
    assert!(!String::from_utf8_lossy(&received).contains("HTTP"), "{received:?}");

    let mut roots = RootCertStore::empty();
    roots.add(certificate).expect("a root");
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions().expect("versions");
    let config = Arc::new(config.with_root_certificates(roots).with_no_client_auth());
    let client = ClientConnection::new(config, "bottega".try_into().expect("a name")).expect("a client");
    let socket = TcpStream::connect(at).expect("the door is open");
    socket.set_read_timeout(Some(Duration::from_secs(10))).expect("a time limit");
    let mut stream = StreamOwned::new(client, socket);
    stream.write_all(request.as_bytes()).expect("it is sent");
    let mut received = Vec::new();
    _ = stream.read_to_end(&mut received);
    let received = String::from_utf8_lossy(&received);
    assert!(received.starts_with("HTTP/1.1 303") && received.contains("SameSite=Strict; Secure"), "{received}");
}
