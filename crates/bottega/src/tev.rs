//! A mirror of the picture in tev (Müller, <https://github.com/Tom94/tev>), a viewer for linear light: sends all layers, block
//! by block during rendering, and the whole picture at the end.

use std::{
    io,
    net::{TcpStream, ToSocketAddrs},
    sync::{
        Mutex, PoisonError,
        mpsc::{self, SyncSender, TrySendError},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use bottega_image::{Film, Layout, Rect, Tile};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};
use thiserror::Error as ThisError;

use crate::error::Error;

/// The default port of tev.
const PORT: u16 = 14158;
/// Timeout for connecting to tev and for sending a packet.
const PATIENCE: Duration = Duration::from_secs(5);
/// Largest number of blocks queued for sending. Further ones are dropped; the whole picture follows at the end.
const WAITING_MAX: usize = 256;
/// Largest number of values in a packet.
const VALUES_MAX: usize = 1 << 20;

/// A connection to tev that shows a picture.
pub(crate) struct TevMirror {
    sender: Mutex<Option<SyncSender<Film>>>,
    thread: Mutex<Option<JoinHandle<io::Result<TevImage>>>>,
}

/// An image in tev.
struct TevImage {
    client: TevClient,
    name: String,
    /// The channels: name, and offset in the values of a pixel.
    channels: Vec<(String, usize)>,
}

impl TevMirror {
    /// Connects to tev and creates an image there.
    ///
    /// - `host`: `HOST` or `HOST:PORT`.
    /// - `name`: name of the image in tev.
    /// - `frame`: width and height of the whole picture.
    ///
    /// # Errors
    /// tev does not answer, or the operating system refuses a thread.
    pub(crate) fn open(host: &str, name: &str, frame: (u32, u32), layout: &Layout) -> Result<Self, Error> {
        let begin = || -> io::Result<Self> {
            let channels = Film::new(Rect::of_size(1, 1), layout.clone()).channels();
            let mut image = TevImage { client: TevClient::wrap(connect(host)?), name: name.to_owned(), channels };
            image.create(frame)?;
            let (sender, blocks) = mpsc::sync_channel::<Film>(WAITING_MAX);
            let thread = thread::Builder::new().name("tev".to_owned()).spawn(move || {
                for block in blocks {
                    image.send(&block)?;
                }
                Ok(image)
            })?;
            Ok(Self { sender: Mutex::new(Some(sender)), thread: Mutex::new(Some(thread)) })
        };
        begin().map_err(|source| {
            let remedy =
                format!("start tev there first; it listens at port {PORT} unless `--host` of tev says otherwise");
            Error::failed(format!("tev does not answer at `{host}`: {source}"), remedy)
        })
    }

    /// Queues a rendered block for sending. Drops it if tev is too slow.
    pub(crate) fn painted(&self, tile: &Tile) {
        let mut block = Film::new(tile.rect(), tile.layout().clone());
        block.add_tile(tile, |_, _| 1.0);
        let mut sender = self.sender.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(open) = &*sender
            && let Err(TrySendError::Disconnected(_)) = open.try_send(block)
        {
            *sender = None;
        }
    }

    /// Sends the finished picture.
    ///
    /// # Errors
    /// The connection is lost, or the thread that sends has failed.
    pub(crate) fn finish(&self, film: &Film) -> Result<(), TevError> {
        self.sender.lock().unwrap_or_else(PoisonError::into_inner).take();
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(thread) = thread else { return Ok(()) };
        let image = thread.join().map_err(|_| TevError::Thread)?;
        Ok(image?.send(film)?)
    }
}

/// The reason why tev does not show the finished picture.
#[derive(Debug, ThisError)]
pub(crate) enum TevError {
    /// The connection to tev failed.
    #[error(transparent)]
    Connection(#[from] io::Error),
    /// The thread that sends has failed.
    #[error("its thread has failed")]
    Thread,
}

impl TevImage {
    fn create(&mut self, (width, height): (u32, u32)) -> io::Result<()> {
        let names: Vec<&str> = self.channels.iter().map(|(name, _)| name.as_str()).collect();
        let image_name = self.name.as_str();
        self.client.send(PacketCreateImage { image_name, grab_focus: true, width, height, channel_names: &names })
    }

    /// Sends a film, some rows at a time.
    fn send(&mut self, film: &Film) -> io::Result<()> {
        let rect = film.rect();
        if rect.is_empty() {
            return Ok(());
        }
        let stride = film.layout().stride() + 1;
        let names: Vec<&str> = self.channels.iter().map(|(name, _)| name.as_str()).collect();
        let count = self.channels.len();
        let offsets: Vec<u64> = (0..count as u64).collect();
        let strides = vec![count as u64; count];
        let rows = (VALUES_MAX / (rect.width() as usize * count)).max(1);
        let width = rect.width() as usize;
        for (index, values) in film.values().chunks(rows * width * stride).enumerate() {
            let picked = values.chunks_exact(stride);
            let data: Vec<f32> =
                picked.flat_map(|pixel| self.channels.iter().map(|(_, offset)| pixel[*offset])).collect();
            self.client.send(PacketUpdateImage {
                image_name: &self.name,
                grab_focus: false,
                channel_names: &names,
                channel_offsets: &offsets,
                channel_strides: &strides,
                x: rect.x0,
                y: rect.y0 + (index * rows) as u32,
                width: rect.width(),
                height: (values.len() / stride / width) as u32,
                data: &data,
            })?;
        }
        Ok(())
    }
}

fn connect(host: &str) -> io::Result<TcpStream> {
    let has_port = host.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    let places = if has_port { host.to_socket_addrs()? } else { (host, PORT).to_socket_addrs()? };
    let mut last = io::Error::new(io::ErrorKind::NotFound, "no such host");
    for place in places {
        match TcpStream::connect_timeout(&place, PATIENCE) {
            Ok(stream) => {
                stream.set_write_timeout(Some(PATIENCE))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}
