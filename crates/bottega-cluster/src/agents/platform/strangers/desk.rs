//! The HTTP server from which agents of other platforms fetch the files of a scene, and to which they deliver their
//! results, at secret URLs.

use std::{
    collections::BTreeMap,
    io,
    net::{SocketAddr, TcpListener},
    path::PathBuf,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

use axum::{
    Router,
    body::{Body, to_bytes},
    extract::{Path, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
    routing::{get, put},
};
use bottega::error::error_chain;
use bottega_farm::{Link, PaintOrder, ResultRef};
use bottega_image::{AovSet, ImageError, Layout, ReadLimits, Tile, luminance, read_image_bytes};
use thiserror::Error as ThisError;
use tokio::{sync::Semaphore, time::timeout};
use tokio_util::io::ReaderStream;

/// The largest result: this many bytes, and this many per pixel.
const HEAD_BYTES_MAX: u64 = 1 << 20;
const PIXEL_BYTES_MAX: u64 = 64;
/// The most results received at the same time.
const DELIVERIES_MAX: usize = 8;
/// The time within which a result must arrive.
const DELIVERS_WITHIN: Duration = Duration::from_secs(120);
/// The largest radiance value that is accepted.
const LARGEST: f32 = 1e30;

/// A result that is expected under a key.
#[derive(Clone)]
pub(super) struct ExpectedDelivery {
    pub(super) order: Box<PaintOrder>,
    /// The link that stores its samples.
    pub(super) link: Link,
    /// Reports the stored result.
    pub(super) on_stored: Arc<dyn Fn(ResultRef) + Send + Sync>,
}

/// The files offered, and the results expected.
#[derive(Default)]
struct Shelves {
    /// The files of scenes, by the secret name of the scene.
    models: Mutex<BTreeMap<String, Vec<PathBuf>>>,
    expected: Mutex<BTreeMap<String, ExpectedDelivery>>,
}

/// The HTTP server. It runs until the process ends.
#[derive(Clone)]
pub(super) struct Desk {
    shelves: Arc<Shelves>,
    /// The start of the URLs of all files on the server.
    address: String,
}

#[derive(Clone)]
struct DeskState {
    shelves: Arc<Shelves>,
    deliveries: Arc<Semaphore>,
}

impl Desk {
    /// Starts the server.
    ///
    /// - `listen`: an address of the machine; a free port is chosen.
    /// - `host`: the host name that clients connect to.
    pub(super) fn open(listen: SocketAddr, host: &str) -> io::Result<Self> {
        let listener = TcpListener::bind(SocketAddr::new(listen.ip(), 0))?;
        listener.set_nonblocking(true)?;
        let address = format!("http://{host}:{}", listener.local_addr()?.port());
        let shelves = Arc::new(Shelves::default());
        let shared = DeskState { shelves: Arc::clone(&shelves), deliveries: Arc::new(Semaphore::new(DELIVERIES_MAX)) };
        let routes = Router::new()
            .route("/models/{name}/{number}", get(model))
            .route("/results/{key}", put(deliver))
            .with_state(shared);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        thread::Builder::new().name("desk".to_owned()).spawn(move || {
            runtime.block_on(async move {
                if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                    // It ends with the process; a failed connection concerns only its client.
                    _ = axum::serve(listener, routes).await;
                }
            });
        })?;
        Ok(Self { shelves, address })
    }

    /// Returns the start of the URLs for results.
    pub(super) fn results(&self) -> String {
        format!("{}/results", self.address)
    }

    /// Offers the files of a scene. Returns their URLs.
    pub(super) fn put_out(&self, name: &str, files: Vec<PathBuf>) -> Vec<String> {
        let urls = (0..files.len()).map(|number| format!("{}/models/{name}/{number}", self.address)).collect();
        lock(&self.shelves.models).insert(name.to_owned(), files);
        urls
    }

    /// Withdraws the files of a scene.
    pub(super) fn take_away(&self, name: &str) {
        lock(&self.shelves.models).remove(name);
    }

    /// Expects a result under a key.
    pub(super) fn expect(&self, key: String, expected: ExpectedDelivery) {
        lock(&self.shelves.expected).insert(key, expected);
    }

    /// Stops expecting a result.
    pub(super) fn forget(&self, key: &str) {
        lock(&self.shelves.expected).remove(key);
    }
}

fn lock<T>(shelf: &Mutex<T>) -> MutexGuard<'_, T> {
    shelf.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Serves a file of a scene.
async fn model(State(shared): State<DeskState>, Path((name, number)): Path<(String, usize)>) -> Response {
    let path = lock(&shared.shelves.models).get(&name).and_then(|files| files.get(number).cloned());
    let Some(path) = path else { return StatusCode::NOT_FOUND.into_response() };
    match tokio::fs::File::open(&path).await {
        Ok(file) => {
            let kind = [(header::CONTENT_TYPE, "application/octet-stream")];
            (kind, Body::from_stream(ReaderStream::new(file))).into_response()
        }
        Err(error) => {
            tracing::warn!(path = %path.display(), %error, "a file of a scene cannot be read");
            StatusCode::NOT_FOUND.into_response()
        }
    }
}

/// Receives the picture of a zone.
async fn deliver(State(shared): State<DeskState>, Path(key): Path<String>, body: Body) -> Response {
    let expected = lock(&shared.shelves.expected).get(&key).cloned();
    let Some(expected) = expected else {
        return (StatusCode::NOT_FOUND, "no order waits for this delivery").into_response();
    };
    let Ok(_permit) = shared.deliveries.try_acquire() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many deliveries at once: try again").into_response();
    };
    let limit = HEAD_BYTES_MAX + expected.order.rect.area() * PIXEL_BYTES_MAX;
    let bytes = match timeout(DELIVERS_WITHIN, to_bytes(body, limit as usize)).await {
        Ok(Ok(bytes)) => bytes,
        Ok(Err(_)) => {
            let most = format!("a picture of this zone may have at most {limit} bytes");
            return (StatusCode::PAYLOAD_TOO_LARGE, most).into_response();
        }
        Err(_) => return (StatusCode::REQUEST_TIMEOUT, "the picture did not arrive in time").into_response(),
    };
    let taken = tokio::task::spawn_blocking(move || take(&bytes, &expected)).await;
    match taken {
        Ok(Ok(())) => StatusCode::CREATED.into_response(),
        Ok(Err(DeliveryRefusal(status, why))) => (status, why).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

/// The reason why a picture is not accepted.
#[derive(Debug)]
struct DeliveryRefusal(StatusCode, String);

/// The reason why a picture is not that of a zone.
#[derive(Debug, ThisError)]
enum UnfitPicture {
    /// The file cannot be read.
    #[error("{}", error_chain(.0))]
    Unreadable(#[from] ImageError),
    /// The size is not that of the zone.
    #[error("the picture has {width}x{height} pixels, but {wanted_width}x{wanted_height} are required")]
    Size { width: u32, height: u32, wanted_width: u32, wanted_height: u32 },
    /// A pixel is not finite, or too bright.
    #[error("the pixel ({x}, {y}) of the picture is not a number")]
    Pixel { x: u32, y: u32 },
}

/// Reads a picture and stores its samples for the Master.
fn take(bytes: &[u8], expected: &ExpectedDelivery) -> Result<(), DeliveryRefusal> {
    let unfit = |why: UnfitPicture| DeliveryRefusal(StatusCode::UNPROCESSABLE_ENTITY, why.to_string());
    let order = &expected.order;
    let away = |why| DeliveryRefusal(StatusCode::SERVICE_UNAVAILABLE, why);
    let stop = bottega_farm::StopSwitch::new();
    let tile = tile_of(bytes, order).map_err(unfit)?;
    let digest = bottega_farm::digest(&tile);
    expected.link.put(digest, &tile, &stop).map_err(away)?;
    (expected.on_stored)(ResultRef { fence: order.fence, samples: order.samples.end, digest });
    Ok(())
}

/// Returns the sample sums of a zone from a picture, which is the mean of the ordered samples.
fn tile_of(bytes: &[u8], order: &PaintOrder) -> Result<Tile, UnfitPicture> {
    let (rect, layout) = (order.rect, Layout::new(AovSet::NONE));
    let limits = ReadLimits { max_pixels: rect.area() };
    let file = read_image_bytes("the picture.exr", bytes, limits)?;
    let picture = file.picture;
    if picture.size() != (rect.width(), rect.height()) {
        let ((width, height), (wanted_width, wanted_height)) = (picture.size(), (rect.width(), rect.height()));
        return Err(UnfitPicture::Size { width, height, wanted_width, wanted_height });
    }
    let is_sound = |value: &f32| value.is_finite() && value.abs() <= LARGEST;
    if let Some(place) = picture.data.iter().position(|pixel| !pixel.iter().all(is_sound)) {
        let (x, y) = (place as u32 % rect.width(), place as u32 / rect.width());
        return Err(UnfitPicture::Pixel { x, y });
    }
    let count = (order.samples.end - order.samples.start) as f32;
    let mut tile = Tile::new(rect, layout);
    let stride = tile.layout().stride();
    for (sums, color) in tile.sums_mut().chunks_exact_mut(stride).zip(&picture.data) {
        for (sum, value) in sums[Layout::COLOR..].iter_mut().zip(color) {
            *sum += value * count;
        }
        // The squares of single samples are unknown: use the square of their mean.
        let luminance = luminance(*color);
        sums[Layout::LUMINANCE_SQUARED] += luminance * luminance * count;
        sums[Layout::SAMPLE_COUNT] += count;
        sums[Layout::ALPHA] += count;
    }
    Ok(tile)
}
