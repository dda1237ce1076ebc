//! The board: it keeps the shapes of scenes and answers rays, for any number of connections.

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

/// Rays that a thread follows at once.
const RAYS_AT_ONCE: usize = 1024;

/// Packets that wait to be computed, and answers that wait to be sent: more would only wait longer.
const FRAMES_AHEAD: usize = 4;
/// Whoever was away from the cable for longer than this does not know when the next bytes came.
const PROMPT: Duration = Duration::from_millis(1);

/// The options of a board.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardOptions {
    /// Threads that follow rays.
    pub threads: usize,
    /// Bytes a second that pass each way; `None`: as many as the cable lets.
    pub bandwidth: Option<f64>,
    /// Bytes that the shapes of scenes may take, as they were sent, for each connection.
    pub memory: u64,
    /// The build, which must be that of whoever connects: only then have hits the same bits.
    pub build: String,
}

/// A board that listens.
#[derive(Debug)]
pub struct BoardServer {
    listener: TcpListener,
    options: BoardOptions,
}

impl BoardServer {
    /// # Errors
    /// The address cannot be listened on.
    pub fn listen(address: SocketAddr, options: BoardOptions) -> Result<Self, BoardError> {
        let listener = TcpListener::bind(address);
        let listener = listener.map_err(|source| BoardError::Listen { address: address.to_string(), source })?;
        Ok(Self { listener, options })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn address(&self) -> Result<SocketAddr, BoardError> {
        Ok(self.listener.local_addr()?)
    }

    /// Serves whoever connects, for ever.
    ///
    /// # Errors
    /// The threads that follow rays cannot be had.
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

/// A connection: one thread reads, one computes and one writes, so that while the rays of one packet are followed those of the next
/// come and the answers to the one before go.
struct ServedClient<'a> {
    stream: TcpStream,
    reader: BufReader<TimedReader<Throttled<TcpStream>>>,
    writer: BufWriter<Throttled<TcpStream>>,
    scenes: ServedScenes<'a>,
}

/// The scenes of a connection, and who follows rays in them.
struct ServedScenes<'a> {
    options: &'a BoardOptions,
    pool: &'a rayon::ThreadPool,
    /// By number, with the bytes that they came as.
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
        // Whoever comes says first who it is; more than that is not read of strangers.
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
            // Whoever reads waits no longer; what is to be written still is.
            drop((inbox, answers));
            _ = stream.shutdown(Shutdown::Read);
            served
        })
    }
}

/// Reads until nothing comes or nobody takes it.
fn read_all(
    reader: &mut BufReader<TimedReader<Throttled<TcpStream>>>,
    arrivals: &SyncSender<(Frame, Receipt)>,
) -> Result<(), BoardError> {
    let mut is_prompt = true;
    loop {
        begin(reader)?;
        let frame = Frame::read(reader, BYTES_MAX)?;
        // What came while nobody read says nothing of the cable.
        let receipt = if is_prompt { receipt(reader) } else { Receipt::default() };
        let read = Instant::now();
        if arrivals.send((frame, receipt)).is_err() {
            return Ok(());
        }
        is_prompt = read.elapsed() < PROMPT;
    }
}

impl ServedScenes<'_> {
    /// Answers what comes, until nothing does.
    ///
    /// # Errors
    /// What came cannot be; that is answered, too.
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

    /// - `receipt`: how fast the frame came.
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
                let (accel, _) = self.scenes.get(&scene).ok_or(BoardError::Malformed("its scene is not here"))?;
                let mut answer = receipt_to_bytes(receipt);
                match kind {
                    FrameKind::Intersect => put_hits(&mut answer, &self.pool.install(|| intersect(accel, &rays))),
                    _ => put_flags(&mut answer, &self.pool.install(|| occluded(accel, &rays))),
                }
                Ok(Some(Frame::new(FrameKind::Answer, number, scene, answer)))
            }
            FrameKind::Hello | FrameKind::Answer | FrameKind::Refusal => {
                Err(BoardError::Malformed("it is nothing that a board is told"))
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
