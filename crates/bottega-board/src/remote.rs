//! The resource for a board at the other end of a connection.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    io::BufWriter,
    net::{Shutdown, TcpStream, ToSocketAddrs},
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{Receiver, Sender, channel},
    },
    thread,
    time::{Duration, Instant},
};

use bottega_hra::{
    DataId, Link, Packet, Primitive, PrimitiveSet, Reply, ResourceDescriptor, Transfer, WindowedResource, Work as _,
};
use bottega_render::{PreparedScene, RenderOutput, RenderWork, SceneGeometry};

use crate::{
    BoardError,
    codec::{flags_of, hits_of, put_rays, receipt_of, shapes_to_bytes},
    timed_reader::{Receipt, TimedReader, begin, receipt},
    wire::{BYTES_MAX, Frame, FrameKind},
};

/// The timeout for connecting, and for the board's greeting.
const CONNECT_MAX: Duration = Duration::from_secs(5);
/// The size of an echo that measures the cable, in bytes.
const ECHO_BYTES: usize = 64 << 10;
/// No further echo is sent after this time: on so slow a cable, other load does not affect the result.
const ECHOES_TIME: Duration = Duration::from_millis(200);
/// The maximum number of echoes.
const ECHOES_MAX: usize = 4;

/// The address of a board: `tcp://HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardAddress(String);

impl BoardAddress {
    /// Returns true if the name of a device has the form of a board's address.
    pub fn is_one(name: &str) -> bool {
        name.starts_with("tcp://")
    }

    /// Parses `tcp://HOST:PORT`. The host is looked up and the port checked by [`RemoteBoard::connect`] only.
    ///
    /// # Errors
    /// The text does not start with `tcp://`, or has no colon after it.
    pub fn of(name: &str) -> Result<Self, BoardError> {
        let place = name.strip_prefix("tcp://").filter(|place| place.contains(':'));
        place.map(|place| Self(place.to_owned())).ok_or_else(|| BoardError::Address(name.to_owned()))
    }
}

impl fmt::Display for BoardAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "tcp://{}", self.0)
    }
}

/// A remote board that traces rays for this process.
pub struct RemoteBoard {
    address: BoardAddress,
    build: String,
    greeting: BoardGreeting,
    link: Link,
    connection: Option<BoardLink>,
}

/// The greeting of a board.
#[derive(Clone, Copy)]
struct BoardGreeting {
    /// Memory for scenes, in bytes.
    memory: u64,
    /// Number of threads; 0: one per processor.
    threads: u64,
}

struct BoardLink {
    stream: TcpStream,
    frames: Sender<Frame>,
    waiting: Arc<Mutex<SentPackets>>,
    /// The scenes in the board's memory.
    scenes: BTreeSet<DataId>,
}

/// Packets that are not answered yet.
#[derive(Default)]
struct SentPackets {
    packets: BTreeMap<u64, SentPacket>,
    /// True if the connection has ended.
    is_over: bool,
}

struct SentPacket {
    /// The number of rays of each work.
    counts: Vec<usize>,
    /// The size of the packet, in bytes.
    bytes: u64,
    primitive: Primitive,
    reply: Reply<RenderWork>,
}

impl RemoteBoard {
    /// Connects to a board, measures latency and bandwidth of the connection, and returns the board. Blocks meanwhile.
    ///
    /// - `build`: the build of this program; the board's must be the same.
    ///
    /// # Errors
    /// The board cannot be reached, the connection breaks, the peer is not a board of this build, or a thread cannot be
    /// started.
    pub fn connect(address: BoardAddress, build: &str) -> Result<Self, BoardError> {
        let (connection, greeting, link) = BoardLink::open(&address, build)?;
        Ok(Self { address, build: build.to_owned(), greeting, link, connection: Some(connection) })
    }

    /// Records in `scene` the number of bytes that its shapes take in the memory of a board, for the allocator.
    pub fn tell_bytes(scene: &PreparedScene) {
        scene.note_device_bytes(shapes_to_bytes(&SceneGeometry::of(scene.scene())).len() as u64);
    }

    /// Returns the latency and the bandwidth of the connection, as measured by [`Self::connect`].
    pub fn link(&self) -> Link {
        self.link
    }

    /// Returns the number of threads on which the board traces rays; 0: one per processor.
    pub fn threads(&self) -> u64 {
        self.greeting.threads
    }
}

impl BoardLink {
    fn open(address: &BoardAddress, build: &str) -> Result<(Self, BoardGreeting, Link), BoardError> {
        let unreachable = |source| BoardError::Unreachable { address: address.to_string(), source };
        let places = address.0.to_socket_addrs().map_err(unreachable)?;
        let mut stream = Err(std::io::Error::from(std::io::ErrorKind::AddrNotAvailable));
        for place in places {
            stream = TcpStream::connect_timeout(&place, CONNECT_MAX);
            if stream.is_ok() {
                break;
            }
        }
        let mut stream = stream.map_err(unreachable)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(CONNECT_MAX))?;
        Frame::new(FrameKind::Hello, 0, 0, build.as_bytes().to_vec()).write(&mut stream)?;
        let hello = Frame::read(&mut stream, 4096)?;
        if hello.kind != FrameKind::Hello {
            let theirs = String::from_utf8_lossy(&hello.bytes).into_owned();
            return Err(BoardError::OtherBuild { theirs, ours: build.to_owned() });
        }
        let link = measure(&mut stream)?;
        stream.set_read_timeout(None)?;
        let waiting = Arc::new(Mutex::new(SentPackets::default()));
        let (frames, outbox) = channel();
        let (out, inbox, listened) = (stream.try_clone()?, stream.try_clone()?, Arc::clone(&waiting));
        let builder = || thread::Builder::new().name("board".to_owned());
        builder().spawn(move || write_all(out, &outbox))?;
        builder().spawn(move || listen(inbox, &listened))?;
        let greeting = BoardGreeting { memory: hello.number, threads: hello.scene };
        Ok((Self { stream, frames, waiting, scenes: BTreeSet::new() }, greeting, link))
    }

    /// Sends a packet. After the connection has ended, the reply is dropped, which reports the packet as lost.
    fn send(&mut self, packet: Packet<RenderWork>) {
        let Packet { sequence, works, reply } = packet;
        let mut bytes = Vec::new();
        let (mut counts, mut scene, mut primitive) = (Vec::new(), None, Primitive::Intersect);
        for work in &works {
            primitive = work.primitive();
            let (RenderWork::Rays { scene: of, rays } | RenderWork::Occlusion { scene: of, rays }) = work else {
                // The allocator sends nothing else, because a board supports nothing else.
                return;
            };
            scene = Some(of);
            counts.push(rays.len());
            put_rays(&mut bytes, rays);
        }
        let Some(scene) = scene else { return };
        let id = scene.data_id();
        if self.scenes.insert(id) {
            let shapes = shapes_to_bytes(&SceneGeometry::of(scene.scene()));
            _ = self.frames.send(Frame::new(FrameKind::Scene, id.0, 0, shapes));
        }
        let kind = if primitive == Primitive::Occluded { FrameKind::Occluded } else { FrameKind::Intersect };
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        if waiting.is_over {
            return;
        }
        let frame = Frame::new(kind, sequence, id.0, bytes);
        waiting.packets.insert(sequence, SentPacket { counts, bytes: frame.size(), primitive, reply });
        drop(waiting);
        _ = self.frames.send(frame);
    }
}

/// Measures latency and bandwidth. Takes the best of several echoes, because other load can only make an echo slower.
fn measure(stream: &mut TcpStream) -> Result<Link, BoardError> {
    let mut echo = |bytes: usize| {
        let (start, frame) = (Instant::now(), Frame::new(FrameKind::Echo, 0, 0, vec![0; bytes]));
        frame.write(stream)?;
        Frame::read(stream, bytes as u64)?;
        Ok::<_, BoardError>((start.elapsed(), frame.size()))
    };
    let mut shortest = Duration::MAX;
    for _ in 0..3 {
        shortest = shortest.min(echo(0)?.0);
    }
    let (begun, (mut time, size)) = (Instant::now(), echo(ECHO_BYTES)?);
    for _ in 1..ECHOES_MAX {
        if begun.elapsed() > ECHOES_TIME {
            break;
        }
        time = time.min(echo(ECHO_BYTES)?.0);
    }
    let passing = time.saturating_sub(shortest).as_secs_f64().max(1e-6);
    Ok(Link { latency: shortest / 2, bandwidth: 2.0 * size as f64 / passing })
}

fn write_all(stream: TcpStream, frames: &Receiver<Frame>) {
    let mut writer = BufWriter::with_capacity(64 << 10, stream);
    for frame in frames {
        if frame.write(&mut writer).is_err() {
            break; // The shutdown below also ends the listening thread.
        }
    }
    _ = writer.get_ref().shutdown(Shutdown::Both);
}

fn listen(stream: TcpStream, waiting: &Mutex<SentPackets>) {
    let mut reader = TimedReader::buffered(stream, 64 << 10);
    let ended = loop {
        let frame = begin(&mut reader).map_err(BoardError::from).and_then(|()| Frame::read(&mut reader, BYTES_MAX));
        let frame = match frame {
            Ok(frame) => frame,
            Err(error) => break error,
        };
        if frame.kind != FrameKind::Answer {
            break BoardError::Refused(String::from_utf8_lossy(&frame.bytes).into_owned());
        }
        let sent = waiting.lock().unwrap_or_else(PoisonError::into_inner).packets.remove(&frame.number);
        let Some(sent) = sent else { continue };
        if let Err(error) = sent.answer(&frame, &receipt(&reader)) {
            break error;
        }
    };
    tracing::debug!(error = %ended, "the board is gone");
    let mut waiting = waiting.lock().unwrap_or_else(PoisonError::into_inner);
    waiting.is_over = true;
    // Dropping the replies reports the packets as lost.
    waiting.packets.clear();
}

impl SentPacket {
    /// - `back`: the rate at which the answer arrived.
    fn answer(self, frame: &Frame, back: &Receipt) -> Result<(), BoardError> {
        let Self { counts, bytes: sent, primitive, reply } = self;
        let (there, bytes) = receipt_of(&frame.bytes)?;
        let total = counts.iter().sum();
        let outcomes: Vec<RenderOutput> = if primitive == Primitive::Occluded {
            let mut flags = flags_of(bytes, total)?.into_iter();
            counts.iter().map(|&count| RenderOutput::Occlusion(flags.by_ref().take(count).collect())).collect()
        } else {
            let mut hits = hits_of(bytes, total)?.into_iter();
            counts.iter().map(|&count| RenderOutput::Hits(hits.by_ref().take(count).collect())).collect()
        };
        let transfer =
            |bytes, receipt: &Receipt| Transfer { bytes, timed_bytes: receipt.timed_bytes, time: receipt.time };
        let transfers = [transfer(sent, &there), transfer(frame.size(), back)];
        reply.send_transferred(outcomes.into_iter().map(Ok).collect(), transfers);
        Ok(())
    }
}

impl WindowedResource<RenderWork> for RemoteBoard {
    fn descriptor(&self) -> ResourceDescriptor {
        ResourceDescriptor {
            name: self.address.to_string(),
            primitives: PrimitiveSet::from([Primitive::Intersect, Primitive::Occluded]),
            memory_bytes: Some(self.greeting.memory),
            link: self.link,
        }
    }

    fn send(&mut self, packet: Packet<RenderWork>) {
        if let Some(connection) = &mut self.connection {
            connection.send(packet);
        }
    }

    fn recover(&mut self) -> Result<(), String> {
        self.connection = None;
        let (connection, greeting, link) =
            BoardLink::open(&self.address, &self.build).map_err(|error| error.to_string())?;
        (self.connection, self.greeting, self.link) = (Some(connection), greeting, link);
        Ok(())
    }

    fn evict(&mut self, data: DataId) {
        if let Some(connection) = &mut self.connection
            && connection.scenes.remove(&data)
        {
            _ = connection.frames.send(Frame::new(FrameKind::Evict, data.0, 0, Vec::new()));
        }
    }
}

impl Drop for BoardLink {
    fn drop(&mut self) {
        _ = self.stream.shutdown(Shutdown::Both);
    }
}
