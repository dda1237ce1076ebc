//! The board: it keeps the shapes of scenes and answers rays, for any number of connections.

use std::{
    collections::BTreeMap,
    io::{BufReader, BufWriter},
    net::{SocketAddr, TcpListener, TcpStream},
    thread,
};

use bottega_kernels::{Accel, BuildOptions, Hit, Ray};
use rayon::prelude::*;

use crate::{
    BoardError,
    codec::{flags_to_bytes, hits_to_bytes, rays_of, shapes_of},
    throttle::Throttled,
    wire::{BYTES_MAX, Frame, FrameKind},
};

/// Rays that a thread follows at once.
const RAYS_AT_ONCE: usize = 1024;

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

struct ServedClient<'a> {
    reader: BufReader<Throttled<TcpStream>>,
    writer: BufWriter<Throttled<TcpStream>>,
    options: &'a BoardOptions,
    pool: &'a rayon::ThreadPool,
    /// By number, with the bytes that they came as.
    scenes: BTreeMap<u64, (Accel, u64)>,
}

impl<'a> ServedClient<'a> {
    fn open(stream: TcpStream, options: &'a BoardOptions, pool: &'a rayon::ThreadPool) -> Result<Self, BoardError> {
        stream.set_nodelay(true)?;
        let reader = BufReader::new(Throttled::new(stream.try_clone()?, options.bandwidth));
        let writer = BufWriter::with_capacity(64 << 10, Throttled::new(stream, options.bandwidth));
        Ok(Self { reader, writer, options, pool, scenes: BTreeMap::new() })
    }

    fn serve(mut self) -> Result<(), BoardError> {
        // Whoever comes says first who it is; more than that is not read of strangers.
        let hello = Frame::read(&mut self.reader, 256)?;
        if hello.kind != FrameKind::Hello || hello.bytes != self.options.build.as_bytes() {
            let refusal = format!("this board is of the build {}", self.options.build);
            return self.answer(&Frame::new(FrameKind::Refusal, 0, 0, refusal.into_bytes()));
        }
        self.answer(&Frame::new(FrameKind::Hello, self.options.memory, 0, hello.bytes))?;
        loop {
            let frame = Frame::read(&mut self.reader, BYTES_MAX)?;
            let answered = self.take(frame);
            if let Err(error) = answered {
                let _ = self.answer(&Frame::new(FrameKind::Refusal, 0, 0, error.to_string().into_bytes()));
                return Err(error);
            }
        }
    }

    fn answer(&mut self, frame: &Frame) -> Result<(), BoardError> {
        frame.write(&mut self.writer)
    }

    fn take(&mut self, frame: Frame) -> Result<(), BoardError> {
        let Frame { kind, number, scene, bytes } = frame;
        match kind {
            FrameKind::Echo => self.answer(&Frame::new(FrameKind::Echo, number, 0, bytes)),
            FrameKind::Evict => {
                self.scenes.remove(&number);
                Ok(())
            }
            FrameKind::Scene => self.keep(number, &bytes),
            FrameKind::Intersect | FrameKind::Occluded => {
                let rays = rays_of(&bytes)?;
                let (accel, _) = self.scenes.get(&scene).ok_or(BoardError::Malformed("its scene is not here"))?;
                let answer = match kind {
                    FrameKind::Intersect => hits_to_bytes(&self.pool.install(|| intersect(accel, &rays))),
                    _ => flags_to_bytes(&self.pool.install(|| occluded(accel, &rays))),
                };
                self.answer(&Frame::new(FrameKind::Answer, number, scene, answer))
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
