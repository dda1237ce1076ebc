//! Frames on the wire: a header of fixed size, followed by bytes.

use std::io::{Read, Write};

use bytemuck::{Pod, Zeroable};

use crate::BoardError;

/// The magic number of both sides, which contains the protocol version.
const MAGIC: u64 = u64::from_le_bytes(*b"BTGBRD02");
/// The maximum size of a frame, in bytes.
pub(crate) const BYTES_MAX: u64 = 4 << 30;
/// The number of bytes that must arrive before more memory is allocated, so that a false length costs the sender, too.
const BYTES_AT_ONCE: u64 = 1 << 20;

/// The kind of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum FrameKind {
    /// The greeting: the build; from a board also its memory for scenes as the number, and its threads as the scene.
    Hello = 1,
    /// Shapes to be stored under a number.
    Scene = 2,
    /// The number of a scene that is not needed any more.
    Evict = 3,
    /// Rays; requests closest hits.
    Intersect = 4,
    /// Rays; requests occlusion.
    Occluded = 5,
    /// The answer to either request, in the order of the rays.
    Answer = 6,
    /// Bytes to be sent back, or sent back.
    Echo = 7,
    /// The reason why the connection ends.
    Refusal = 8,
}

impl FrameKind {
    const ALL: [Self; 8] = [
        Self::Hello,
        Self::Scene,
        Self::Evict,
        Self::Intersect,
        Self::Occluded,
        Self::Answer,
        Self::Echo,
        Self::Refusal,
    ];
}

/// The header of a frame. Little-endian on the wire, as on every machine that this program runs on.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: u64,
    kind: u32,
    padding: u32,
    /// The number of a packet of rays, or of a scene.
    number: u64,
    /// The scene of a packet of rays.
    scene: u64,
    bytes: u64,
}

/// A frame of the protocol between this machine and a board.
#[derive(Debug)]
pub(crate) struct Frame {
    pub(crate) kind: FrameKind,
    pub(crate) number: u64,
    pub(crate) scene: u64,
    pub(crate) bytes: Vec<u8>,
}

impl Frame {
    pub(crate) fn new(kind: FrameKind, number: u64, scene: u64, bytes: Vec<u8>) -> Self {
        Self { kind, number, scene, bytes }
    }

    /// Returns the size on the wire, in bytes.
    pub(crate) fn size(&self) -> u64 {
        (size_of::<Header>() + self.bytes.len()) as u64
    }

    pub(crate) fn write(&self, to: &mut impl Write) -> Result<(), BoardError> {
        let Self { kind, number, scene, bytes } = self;
        let (kind, count) = (*kind as u32, bytes.len() as u64);
        let header = Header { magic: MAGIC, kind, padding: 0, number: *number, scene: *scene, bytes: count };
        to.write_all(bytemuck::bytes_of(&header))?;
        to.write_all(bytes)?;
        Ok(to.flush()?)
    }

    /// Reads a frame.
    ///
    /// # Errors
    /// The connection ended, or the bytes are not a frame of at most `bytes_max` bytes.
    pub(crate) fn read(from: &mut impl Read, bytes_max: u64) -> Result<Self, BoardError> {
        let mut header = Header::zeroed();
        from.read_exact(bytemuck::bytes_of_mut(&mut header))?;
        if header.magic != MAGIC {
            return Err(BoardError::Malformed("it does not come from a board of this version"));
        }
        let kind = FrameKind::ALL.into_iter().find(|kind| *kind as u32 == header.kind);
        let kind = kind.ok_or(BoardError::Malformed("its kind is unknown"))?;
        if header.bytes > bytes_max.min(BYTES_MAX) {
            return Err(BoardError::Malformed("it is too large"));
        }
        let mut bytes = Vec::with_capacity(header.bytes.min(BYTES_AT_ONCE) as usize);
        let read = from.take(header.bytes).read_to_end(&mut bytes)?;
        if read as u64 != header.bytes {
            return Err(BoardError::Malformed("it is cut off"));
        }
        Ok(Self { kind, number: header.number, scene: header.scene, bytes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_through_and_what_is_none_does_not() {
        let frame = Frame::new(FrameKind::Scene, 7, 9, vec![1, 2, 3]);
        let mut wire = Vec::new();
        frame.write(&mut wire).unwrap();
        let read = Frame::read(&mut &*wire, 3).unwrap();
        assert_eq!((read.kind, read.number, read.scene, &*read.bytes), (FrameKind::Scene, 7, 9, &[1_u8, 2, 3][..]));
        assert_eq!(frame.size(), wire.len() as u64);
        assert!(matches!(Frame::read(&mut &*wire, 2), Err(BoardError::Malformed(_))), "too large");
        for end in 0..wire.len() {
            assert!(Frame::read(&mut &wire[..end], 3).is_err(), "{end} bytes of it");
        }
        wire[8] = 77;
        assert!(matches!(Frame::read(&mut &*wire, 3), Err(BoardError::Malformed(_))), "no kind");
        wire[0] ^= 1;
        assert!(matches!(Frame::read(&mut &*wire, 3), Err(BoardError::Malformed(_))), "no magic");
    }
}
