//! The door: an HTTP server on its own thread, which never blocks rendering.

use std::{
    net::{SocketAddr, TcpListener},
    sync::Arc,
    thread,
    time::Duration,
};

use axum::{Extension, Router, body::Body, http::Request};
use bottega_cluster::{deed_log::DeedLog, web_secrets::TokenRole};
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
    tokens::TokenCookie,
};

/// Pause after a failed accept.
const PAUSE: Duration = Duration::from_millis(50);
/// Largest number of threads that call the farm.
const THREADS_MAX: usize = 32;

/// The options of a [`Door`].
pub struct DoorOptions {
    /// The listening socket. The door speaks plain HTTP if its address is a loopback address, and TLS otherwise.
    pub listener: TcpListener,
    /// Certificate and private key for TLS, in PEM; unused on a loopback address.
    pub certificate: (String, String),
    /// Host names that requests may use in addition to the addresses of the machine, such as `farm.example:8443`.
    pub names: Vec<String>,
    /// The log of changes and their authors; `None`: no log.
    pub log: Option<DeedLog>,
}

/// An HTTP server that runs until the process ends.
pub struct Door {
    address: SocketAddr,
    is_secure: bool,
    state: Arc<DoorState>,
}

impl Door {
    /// Starts the server on a thread of its own. Returns it; it serves the page, the manual and the HTTP API of `farm` until the
    /// process ends, by TLS unless the socket's address is a loopback address.
    ///
    /// # Errors
    /// The certificate is needed and invalid, or the operating system refuses the socket or a thread.
    pub fn open(farm: Arc<dyn ShownFarm>, options: DoorOptions) -> Result<Self, ServeError> {
        let DoorOptions { listener, certificate, names, log } = options;
        listener.set_nonblocking(true)?;
        let bound = listener.local_addr()?;
        let is_secure = !bound.ip().is_loopback();
        let tls = is_secure.then(|| acceptor(&certificate)).transpose()?;
        let cookie = TokenCookie::new(bound.port(), is_secure);
        let hosts = HostNames::new(bound, &names, is_secure);
        let state = Arc::new(DoorState::new(farm, cookie, hosts, log));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(THREADS_MAX)
            .thread_name("web")
            .build()?;
        let router = routes::router(&state);
        let serve = move || runtime.block_on(serve(listener, tls, &router));
        thread::Builder::new().name("web".to_owned()).spawn(serve)?;
        Ok(Self { address: bound, is_secure, state })
    }

    /// Returns the address of the listening socket.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns the URL without a token, such as `http://127.0.0.1:8080`; its host is 127.0.0.1 if the door listens on all
    /// addresses.
    pub fn url(&self) -> String {
        let scheme = if self.is_secure { "https" } else { "http" };
        let host = if self.address.ip().is_unspecified() { "127.0.0.1".to_owned() } else { host_of(self.address) };
        format!("{scheme}://{host}:{}", self.address.port())
    }

    /// Returns the URL of the page with the current token that allows steering: it ends with `/?token=TOKEN`.
    pub fn steering_url(&self) -> String {
        self.url_of(TokenRole::Steer)
    }

    /// Returns the URL of the page with the current token that only allows seeing: it ends with `/?token=TOKEN`.
    pub fn seeing_url(&self) -> String {
        self.url_of(TokenRole::See)
    }

    fn url_of(&self, role: TokenRole) -> String {
        format!("{}/?token={}", self.url(), self.state.farm.own_token(role))
    }
}

fn acceptor((certificate, key): &(String, String)) -> Result<TlsAcceptor, ServeError> {
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

/// Accepts connections until the process ends. Errors of a connection only end that connection.
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
                tracing::debug!(%error, "cannot accept a connection");
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

/// Serves the requests of one connection.
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
