//! The server of a board: holds the shapes of scenes and answers rays, for any number of connections.

use std::{
    collections::BTreeMap,
    io::{BufReader, BufWriter},
    net::{Shutdown, SocketAddr, TcpListener, TcpStream},
    sync::mpsc::{Receiver, SyncSender, sync_channel},
    thread,
    time::{Duration, Instant},
};

use bottega_kernels::{Accel, BuildOptions, Hit, Ray};
use rayon::prelude::*;

use crate::{
    BoardError,
    codec::{put_flags, put_hits, rays_of, receipt_to_bytes, shapes_of},
    throttle::Throttled,
    timed_reader::{Receipt, TimedReader, begin, receipt},
    wire::{BYTES_MAX, Frame, FrameKind},
};

/// The number of rays per task of a thread.
const RAYS_AT_ONCE: usize = 1024;

/// The maximum number of packets waiting to be computed, and of answers waiting to be sent.
const FRAMES_AHEAD: usize = 4;
/// If the reader was busy for longer than this, the arrival time of the next bytes is unknown.
const PROMPT: Duration = Duration::from_millis(1);

/// The options of a board: its threads, limits and build.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardOptions {
    /// Number of threads that trace rays; 0: one per processor.
    pub threads: usize,
    /// Bandwidth limit per direction, in bytes per second; `None`: unlimited.
    pub bandwidth: Option<f64>,
    /// Maximum size of the shapes of scenes per connection, in bytes as sent.
    pub memory: u64,
    /// The build; a client must have the same, so that hits are bit-identical.
    pub build: String,
}

/// A board that listens for connections, and traces rays for the clients.
#[derive(Debug)]
pub struct BoardServer {
    listener: TcpListener,
    options: BoardOptions,
}

impl BoardServer {
    /// Starts to listen on an address; port 0 lets the system choose one. [`Self::serve`] accepts the connections.
    ///
    /// # Errors
    /// The address cannot be listened on.
    pub fn listen(address: SocketAddr, options: BoardOptions) -> Result<Self, BoardError> {
        let listener = TcpListener::bind(address);
        let listener = listener.map_err(|source| BoardError::Listen { address: address.to_string(), source })?;
        Ok(Self { listener, options })
    }

    /// Returns the address on which the board listens, with its actual port.
    ///
    /// # Errors
    /// The system does not report the address.
    pub fn address(&self) -> Result<SocketAddr, BoardError> {
        Ok(self.listener.local_addr()?)
    }

    /// Serves all clients. Returns only on an error.
    ///
    /// # Errors
    /// The threads that trace rays cannot be started.
    pub fn serve(self) -> Result<(), BoardError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.options.threads).build();
        let pool = std::sync::Arc::new(pool.map_err(|error| BoardError::Refused(error.to_string()))?);
        for stream in self.listener.incoming() {
            let Ok(stream) = stream else { continue };
            let (options, pool) = (self.options.clone(), std::sync::Arc::clone(&pool));
            let served = thread::Builder::new().name("board".to_owned()).spawn(move || {
                if let Err(error) = ServedClient::open(stream, &options, &pool).and_then(ServedClient::serve) {
                    tracing::debug!(%error, "a connection ended");
                }
            });
            if let Err(error) = served {
                tracing::warn!(%error, "a connection was refused");
            }
        }
        Ok(())
    }
}

/// A connection with three threads: one reads, one computes and one writes, so that while one packet is computed the next is
/// received and the previous answer is sent.
struct ServedClient<'a> {
    stream: TcpStream,
    reader: BufReader<TimedReader<Throttled<TcpStream>>>,
    writer: BufWriter<Throttled<TcpStream>>,
    scenes: ServedScenes<'a>,
}

/// The scenes of a connection, and the threads that trace rays in them.
struct ServedScenes<'a> {
    options: &'a BoardOptions,
    pool: &'a rayon::ThreadPool,
    /// The scenes by number, with their size in bytes as sent.
    scenes: BTreeMap<u64, (Accel, u64)>,
}

impl<'a> ServedClient<'a> {
    fn open(stream: TcpStream, options: &'a BoardOptions, pool: &'a rayon::ThreadPool) -> Result<Self, BoardError> {
        stream.set_nodelay(true)?;
        let reader = TimedReader::buffered(Throttled::new(stream.try_clone()?, options.bandwidth), 16 << 10);
        let writer = BufWriter::with_capacity(64 << 10, Throttled::new(stream.try_clone()?, options.bandwidth));
        Ok(Self { stream, reader, writer, scenes: ServedScenes { options, pool, scenes: BTreeMap::new() } })
    }

    fn serve(self) -> Result<(), BoardError> {
        let Self { stream, mut reader, mut writer, mut scenes } = self;
        let options = scenes.options;
        // A client first sends its build; from strangers no more than that is read.
        let hello = Frame::read(&mut reader, 256)?;
        if hello.kind != FrameKind::Hello || hello.bytes != options.build.as_bytes() {
            let refusal = format!("this board is of the build {}", options.build);
            return Frame::new(FrameKind::Refusal, 0, 0, refusal.into_bytes()).write(&mut writer);
        }
        Frame::new(FrameKind::Hello, options.memory, options.threads as u64, hello.bytes).write(&mut writer)?;
        let (arrivals, inbox) = sync_channel(FRAMES_AHEAD);
        let (answers, outbox) = sync_channel::<Frame>(FRAMES_AHEAD);
        thread::scope(|scope| {
            let builder = || thread::Builder::new().name("board".to_owned());
            let reading = builder().spawn_scoped(scope, move || read_all(&mut reader, &arrivals));
            let writing =
                builder().spawn_scoped(scope, move || outbox.iter().try_for_each(|frame| frame.write(&mut writer)));
            let served = match (reading, writing) {
                (Ok(_), Ok(_)) => scenes.serve(&inbox, &answers),
                (Err(error), _) | (_, Err(error)) => Err(error.into()),
            };
            // End the reader; the writer finishes its answers.
            drop((inbox, answers));
            _ = stream.shutdown(Shutdown::Read);
            served
        })
    }
}

/// Reads frames until the connection or the computing thread ends.
fn read_all(
    reader: &mut BufReader<TimedReader<Throttled<TcpStream>>>,
    arrivals: &SyncSender<(Frame, Receipt)>,
) -> Result<(), BoardError> {
    let mut is_prompt = true;
    loop {
        begin(reader)?;
        let frame = Frame::read(reader, BYTES_MAX)?;
        // Bytes that arrived while nothing was read do not measure the cable.
        let receipt = if is_prompt { receipt(reader) } else { Receipt::default() };
        let read = Instant::now();
        if arrivals.send((frame, receipt)).is_err() {
            return Ok(());
        }
        is_prompt = read.elapsed() < PROMPT;
    }
}

impl ServedScenes<'_> {
    /// Answers frames until the reader ends.
    ///
    /// # Errors
    /// A frame is invalid; the client gets the error, too.
    fn serve(&mut self, inbox: &Receiver<(Frame, Receipt)>, answers: &SyncSender<Frame>) -> Result<(), BoardError> {
        for (frame, receipt) in inbox {
            let answer = match self.take(frame, &receipt) {
                Ok(answer) => answer,
                Err(error) => {
                    _ = answers.send(Frame::new(FrameKind::Refusal, 0, 0, error.to_string().into_bytes()));
                    return Err(error);
                }
            };
            if answer.is_some_and(|answer| answers.send(answer).is_err()) {
                break;
            }
        }
        Ok(())
    }

    /// - `receipt`: the rate at which the frame arrived.
    fn take(&mut self, frame: Frame, receipt: &Receipt) -> Result<Option<Frame>, BoardError> {
        let Frame { kind, number, scene, bytes } = frame;
        match kind {
            FrameKind::Echo => Ok(Some(Frame::new(FrameKind::Echo, number, 0, bytes))),
            FrameKind::Evict => {
                self.scenes.remove(&number);
                Ok(None)
            }
            FrameKind::Scene => self.keep(number, &bytes).map(|()| None),
            FrameKind::Intersect | FrameKind::Occluded => {
                let rays = rays_of(&bytes)?;
                let (accel, _) = self.scenes.get(&scene).ok_or(BoardError::Malformed("its scene is missing"))?;
                let mut answer = receipt_to_bytes(receipt);
                match kind {
                    FrameKind::Intersect => put_hits(&mut answer, &self.pool.install(|| intersect(accel, &rays))),
                    _ => put_flags(&mut answer, &self.pool.install(|| occluded(accel, &rays))),
                }
                Ok(Some(Frame::new(FrameKind::Answer, number, scene, answer)))
            }
            FrameKind::Hello | FrameKind::Answer | FrameKind::Refusal => {
                Err(BoardError::Malformed("a board does not accept this kind of message"))
            }
        }
    }

    fn keep(&mut self, number: u64, bytes: &[u8]) -> Result<(), BoardError> {
        let there: u64 = self.scenes.values().map(|(_, bytes)| bytes).sum();
        if there.saturating_add(bytes.len() as u64) > self.options.memory {
            return Err(BoardError::Refused("there is no memory for the scene".to_owned()));
        }
        let shapes = shapes_of(bytes)?;
        let options = BuildOptions { threads: self.options.threads, ..BuildOptions::default() };
        let accel = Accel::build(&shapes.meshes(), shapes.instances(), shapes.spheres(), &options);
        let accel = accel.map_err(|error| BoardError::Refused(error.to_string()))?;
        self.scenes.insert(number, (accel, bytes.len() as u64));
        Ok(())
    }
}

fn intersect(accel: &Accel, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::NONE; rays.len()];
    let parts = rays.par_chunks(RAYS_AT_ONCE).zip(hits.par_chunks_mut(RAYS_AT_ONCE));
    parts.for_each(|(rays, hits)| accel.intersect_batch(rays, hits));
    hits
}

fn occluded(accel: &Accel, rays: &[Ray]) -> Vec<bool> {
    let mut flags = vec![false; rays.len()];
    let parts = rays.par_chunks(RAYS_AT_ONCE).zip(flags.par_chunks_mut(RAYS_AT_ONCE));
    parts.for_each(|(rays, flags)| accel.occluded_batch(rays, flags));
    flags
}
