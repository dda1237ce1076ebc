//! The attribute codec of meshopt: EXT_meshopt_compression, appendix A, mode 0, and version 1 of
//! KHR_meshopt_compression.
//!
//! Elements are in blocks. Within a block each byte position of the element is a lane: differences to the previous
//! element, in groups of sixteen with as many bits as the group needs. Four lanes form a channel, which gives the kind
//! of difference.

/// Elements per group.
const GROUP: usize = 16;
/// Maximal number of elements per block.
const BLOCK_MAX: usize = 256;

/// Decodes `count` elements of `stride` bytes each. The caller has booked the memory, and checked that the stride is a
/// multiple of 4 in 4..=256. The error says what is wrong with the data.
pub(super) fn decode(data: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, &'static str> {
    let (&header, rest) = data.split_first().ok_or(CUT_OFF)?;
    let version = match header {
        0xa0 => Version::V0,
        0xa1 => Version::V1,
        _ => return Err("it does not begin as attributes of a supported version"),
    };
    let modes_bytes = if version == Version::V1 { stride / 4 } else { 0 };
    let tail_bytes = (stride + modes_bytes).max(if version == Version::V1 { 24 } else { 32 });
    let (blocks, tail) = rest.len().checked_sub(tail_bytes).map(|at| rest.split_at(at)).ok_or(CUT_OFF)?;
    let (baseline, modes) = tail[tail_bytes - stride - modes_bytes..].split_at(stride);
    let channels = match version {
        Version::V0 => vec![LaneMeaning::Bytes; stride / 4],
        Version::V1 => modes.iter().map(|&mode| LaneMeaning::new(mode)).collect::<Result<_, _>>()?,
    };

    let block_elements = ((8192 / stride) & !(GROUP - 1)).min(BLOCK_MAX);
    // Every block has at least this many bytes: reject a wrong count before allocating.
    let least = count.div_ceil(block_elements).saturating_mul(stride / 4);
    if blocks.len() < least {
        return Err(CUT_OFF);
    }
    let mut decoder = Decoder { rest: blocks, version, channels, previous: baseline.to_vec() };
    let mut elements = vec![0; count * stride];
    for block in elements.chunks_mut(block_elements * stride) {
        decoder.block(block).ok_or(CUT_OFF)?;
    }
    if decoder.rest.is_empty() { Ok(elements) } else { Err("it continues after its last element") }
}

/// The error for data that ends too early.
pub(super) const CUT_OFF: &str = "it is cut off";

#[derive(Clone, Copy, PartialEq, Eq)]
enum Version {
    V0,
    V1,
}

/// The meaning of the differences in four lanes.
#[derive(Clone, Copy)]
enum LaneMeaning {
    /// Zigzag differences of single bytes.
    Bytes,
    /// Zigzag differences of two 16-bit numbers.
    Words,
    /// Exclusive or of 32-bit numbers, rotated left by `rotation` bits.
    Xor { rotation: u32 },
}

impl LaneMeaning {
    fn new(mode: u8) -> Result<Self, &'static str> {
        match (mode & 15, mode >> 4) {
            (0, 0) => Ok(Self::Bytes),
            (1, 0) => Ok(Self::Words),
            (2, rotation) => Ok(Self::Xor { rotation: u32::from(rotation) }),
            _ => Err("it has a channel of an unknown mode"),
        }
    }
}

/// The differences of four lanes in one block.
type BlockLanes = [[u8; BLOCK_MAX]; 4];

struct Decoder<'a> {
    rest: &'a [u8],
    version: Version,
    /// Meaning of each four bytes of an element.
    channels: Vec<LaneMeaning>,
    /// The last element of the previous block.
    previous: Vec<u8>,
}

impl<'a> Decoder<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(head)
    }

    /// Decodes whole elements until `out` is full.
    fn block(&mut self, out: &mut [u8]) -> Option<()> {
        let stride = self.previous.len();
        let count = out.len() / stride;
        let controls = match self.version {
            Version::V0 => &[][..],
            Version::V1 => self.take(stride / 4)?,
        };
        let mut lanes: BlockLanes = [[0; BLOCK_MAX]; 4];
        for channel in 0..stride / 4 {
            for (lane, differences) in lanes.iter_mut().enumerate() {
                match controls.get(channel).map(|control| control >> (2 * lane) & 3) {
                    None => self.groups(count, [0, 2, 4, 8], differences)?,
                    Some(0) => self.groups(count, [0, 1, 2, 4], differences)?,
                    Some(1) => self.groups(count, [1, 2, 4, 8], differences)?,
                    Some(2) => differences.fill(0),
                    Some(_) => differences[..count].copy_from_slice(self.take(count)?),
                }
            }
            self.add_up(channel, &lanes, out);
        }
        Some(())
    }

    /// Reads one lane: two bits per group that select one of four widths, then the groups.
    fn groups(&mut self, count: usize, widths: [usize; 4], lane: &mut [u8; BLOCK_MAX]) -> Option<()> {
        let count = count.div_ceil(GROUP);
        let choices = self.take(count.div_ceil(4))?;
        let (groups, _) = lane.as_chunks_mut::<GROUP>();
        for (index, group) in groups[..count].iter_mut().enumerate() {
            let width = widths[usize::from(choices[index / 4] >> (2 * (index % 4)) & 3)];
            self.group(width, group)?;
        }
        Some(())
    }

    /// Reads sixteen differences of `width` bits each; if all bits are set, a whole byte follows instead.
    fn group(&mut self, width: usize, group: &mut [u8; GROUP]) -> Option<()> {
        match width {
            0 => group.fill(0),
            8 => group.copy_from_slice(self.take(GROUP)?),
            _ => {
                let packed = self.take(2 * width)?;
                let escape = (1u8 << width) - 1;
                let in_byte = 8 / width;
                for (index, value) in group.iter_mut().enumerate() {
                    let place = index % in_byte;
                    // Single bits are packed from the lowest, pairs and nibbles from the highest.
                    let shift = if width == 1 { place } else { 8 - width * (place + 1) };
                    *value = packed[index / in_byte] >> shift & escape;
                    if *value == escape {
                        *value = self.take(1)?[0];
                    }
                }
            }
        }
        Some(())
    }

    /// Accumulates the differences of the four bytes of one channel.
    fn add_up(&mut self, channel: usize, lanes: &BlockLanes, out: &mut [u8]) {
        let stride = self.previous.len();
        let at = 4 * channel;
        let previous = &mut self.previous[at..at + 4];
        let mut last = [previous[0], previous[1], previous[2], previous[3]];
        for (index, element) in out.chunks_exact_mut(stride).enumerate() {
            let coded = [lanes[0][index], lanes[1][index], lanes[2][index], lanes[3][index]];
            last = match self.channels[channel] {
                LaneMeaning::Bytes => std::array::from_fn(|k| last[k].wrapping_add(unzigzag8(coded[k]))),
                LaneMeaning::Words => {
                    let word = |bytes: [u8; 4], k: usize| u16::from_le_bytes([bytes[k], bytes[k + 1]]);
                    let sum = |k: usize| word(last, k).wrapping_add(unzigzag16(word(coded, k))).to_le_bytes();
                    let (low, high) = (sum(0), sum(2));
                    [low[0], low[1], high[0], high[1]]
                }
                LaneMeaning::Xor { rotation } => {
                    (u32::from_le_bytes(last) ^ u32::from_le_bytes(coded).rotate_left(rotation)).to_le_bytes()
                }
            };
            element[at..at + 4].copy_from_slice(&last);
        }
        previous.copy_from_slice(&last);
    }
}

fn unzigzag8(v: u8) -> u8 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

fn unzigzag16(v: u16) -> u16 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the specification: sixteen differences in nibbles, two of them escaped.
    #[test]
    fn a_group_of_nibbles_is_read_as_the_specification_says() {
        let data = [0x17, 0x5f, 0xf0, 0xbc, 0x77, 0xa9, 0x21, 0x00, 0x34, 0xb5];
        let mut decoder = Decoder { rest: &data, version: Version::V0, channels: vec![], previous: vec![] };
        let mut group = [0; GROUP];
        decoder.group(4, &mut group).unwrap();
        let signed = group.map(|v| unzigzag8(v) as i8);
        assert_eq!(signed, [-1, -4, -3, 26, -91, 0, -6, 6, -4, -4, 5, -5, 1, -1, 0, 0]);
        assert!(decoder.rest.is_empty());
    }

    #[test]
    fn absurd_counts_are_found_before_memory_is_taken() {
        let data = [&[0xa0][..], &[0; 100]].concat();
        assert_eq!(decode(&data, usize::MAX / 256, 256), Err(CUT_OFF));
    }
}
