//! A door: an HTTP server on a thread of its own, which never holds up the work.

use std::{
    net::{SocketAddr, TcpListener},
    sync::Arc,
    thread,
    time::Duration,
};

use axum::{Extension, Router, body::Body, http::Request};
use bottega_cluster::web_secrets::WebSecrets;
use hyper::{body::Incoming, server::conn::http1, service::service_fn};
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    service::TowerToHyperService,
};
use rustls::{
    ServerConfig,
    pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject},
};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    sync::Semaphore,
};
use tokio_rustls::TlsAcceptor;

use crate::{
    error::ServeError,
    hosts::{HostNames, host_of},
    limits::{CONNECTIONS_MAX, HEADER_BYTES_MAX, HEADERS_TIME, WRITE_TIME},
    routes,
    source::ShownFarm,
    state::{Client, DoorState},
    timed_io::TimedIo,
    tokens::{Tokens, VisitorRole},
};

/// Ports that are tried after the one that was named, where that is taken.
const PORTS_TRIED: u16 = 20;
/// After a connection could not be taken.
const PAUSE: Duration = Duration::from_millis(50);
/// Threads that ask the farm.
const THREADS_MAX: usize = 32;

/// The options of a door.
pub struct DoorOptions {
    /// Where to listen. Beyond this machine it speaks TLS alone.
    pub address: SocketAddr,
    /// Whether no other port may take the place of one that is taken.
    pub is_firm: bool,
    /// Whom it lets in, and how it is known.
    pub secrets: WebSecrets,
    /// Names that it is called by beside its addresses: `farm.example:8443`.
    pub names: Vec<String>,
}

/// A door that is open until the process ends.
pub struct Door {
    address: SocketAddr,
    is_secure: bool,
    state: Arc<DoorState>,
}

impl Door {
    /// Listens, and serves from now on.
    ///
    /// # Errors
    /// The address cannot be listened on, or the certificate is none.
    pub fn open(farm: Arc<dyn ShownFarm>, options: DoorOptions) -> Result<Self, ServeError> {
        let DoorOptions { address, is_firm, secrets, names } = options;
        let listener = listen(address, is_firm)?;
        let failed = |source| ServeError::Listen { address, source };
        listener.set_nonblocking(true).map_err(failed)?;
        let bound = listener.local_addr().map_err(failed)?;
        let is_secure = !bound.ip().is_loopback();
        let tls = is_secure.then(|| acceptor(&secrets)).transpose()?;
        let tokens = Tokens::new(secrets.see, secrets.steer, bound.port(), is_secure);
        let state = Arc::new(DoorState::new(farm, tokens, HostNames::new(bound, &names, is_secure)));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(THREADS_MAX)
            .thread_name("web")
            .build()
            .map_err(failed)?;
        let router = routes::router(&state);
        let serve = move || runtime.block_on(serve(listener, tls, &router));
        thread::Builder::new().name("web".to_owned()).spawn(serve).map_err(failed)?;
        Ok(Self { address: bound, is_secure, state })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where one steers from.
    pub fn steering_url(&self) -> String {
        self.url(VisitorRole::Steer)
    }

    /// Where one looks on.
    pub fn seeing_url(&self) -> String {
        self.url(VisitorRole::See)
    }

    fn url(&self, role: VisitorRole) -> String {
        let scheme = if self.is_secure { "https" } else { "http" };
        let host = if self.address.ip().is_unspecified() { "127.0.0.1".to_owned() } else { host_of(self.address) };
        format!("{scheme}://{host}:{}/?token={}", self.address.port(), self.state.tokens.of(role))
    }
}

fn listen(address: SocketAddr, is_firm: bool) -> Result<TcpListener, ServeError> {
    let failed = |source| ServeError::Listen { address, source };
    match TcpListener::bind(address) {
        Err(_) if !is_firm && address.port() != 0 => {
            let others = (address.port()..).skip(1).take(PORTS_TRIED.into()).chain([0]);
            let mut found = others.map(|port| TcpListener::bind(SocketAddr::new(address.ip(), port)));
            found.find_map(Result::ok).map_or_else(|| TcpListener::bind(address).map_err(failed), Ok)
        }
        bound => bound.map_err(failed),
    }
}

fn acceptor(secrets: &WebSecrets) -> Result<TlsAcceptor, ServeError> {
    let (certificate, key) = &secrets.certificate;
    let wrong = |what: &dyn std::fmt::Display| ServeError::Secrets(format!("its certificate: {what}"));
    let certificate =
        CertificateDer::from_pem_slice(certificate.as_bytes()).map_err(|error| wrong(&format!("{error:?}")))?;
    let key = PrivateKeyDer::from_pem_slice(key.as_bytes()).map_err(|error| wrong(&format!("{error:?}")))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(vec![certificate], key))
        .map_err(|error| wrong(&error))?;
    Ok(TlsAcceptor::from(Arc::new(config)))
}

/// Takes connections until the process ends; one that fails is its client's affair.
async fn serve(listener: TcpListener, tls: Option<TlsAcceptor>, router: &Router) {
    let listener = match tokio::net::TcpListener::from_std(listener) {
        Ok(listener) => listener,
        Err(error) => return tracing::warn!(%error, "nothing is served"),
    };
    let connections = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    loop {
        let (stream, client) = match listener.accept().await {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::debug!(%error, "a connection was not taken");
                tokio::time::sleep(PAUSE).await;
                continue;
            }
        };
        let Ok(permit) = Arc::clone(&connections).try_acquire_owned() else { continue };
        let (tls, router) = (tls.clone(), router.clone());
        tokio::spawn(async move {
            let _permit = permit;
            match tls {
                None => speak(stream, client, router).await,
                Some(tls) => {
                    if let Ok(Ok(stream)) = tokio::time::timeout(HEADERS_TIME, tls.accept(stream)).await {
                        speak(stream, client, router).await;
                    }
                }
            }
        });
    }
}

/// Answers the requests of one connection.
async fn speak<S: AsyncRead + AsyncWrite + Unpin + Send + 'static>(stream: S, client: SocketAddr, router: Router) {
    let service = TowerToHyperService::new(router.layer(Extension(Client(client.ip()))));
    let answer =
        service_fn(move |request: Request<Incoming>| hyper::service::Service::call(&service, request.map(Body::new)));
    let io = TokioIo::new(TimedIo::new(stream, WRITE_TIME));
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEADERS_TIME)
        .max_buf_size(4 * HEADER_BYTES_MAX)
        .max_header_size(HEADER_BYTES_MAX)
        .serve_connection(io, answer)
        .await;
    if let Err(error) = served {
        tracing::debug!(%error, "a connection ended");
    }
}
