//! The two index codecs of meshopt: EXT_meshopt_compression, appendix A, modes 1 and 2.

use super::attributes::CUT_OFF;

/// Decodes the indices of a triangle list. `count` is a multiple of 3. The error says what is wrong with the data.
pub(super) fn triangles(data: &[u8], count: usize) -> Result<Vec<u32>, &'static str> {
    let [0xe1, rest @ ..] = data else { return Err("it does not begin like triangles") };
    let (codes, rest) = rest.split_at_checked(count / 3).ok_or(CUT_OFF)?;
    let (extra, pairs) = rest.split_last_chunk::<16>().ok_or(CUT_OFF)?;
    let mut decoder = Triangles { extra, pairs, next: 0, last: 0, edges: Fifo::default(), vertices: Fifo::default() };
    let mut indices = Vec::with_capacity(count);
    for &code in codes {
        indices.extend(decoder.triangle(code).ok_or(CUT_OFF)?);
    }
    if decoder.extra.is_empty() { Ok(indices) } else { Err("it continues after its last triangle") }
}

/// Decodes a sequence of indices. The error says what is wrong with the data.
pub(super) fn sequence(data: &[u8], count: usize) -> Result<Vec<u32>, &'static str> {
    let [0xd1, rest @ ..] = data else { return Err("it does not begin like a sequence of indices") };
    let (mut rest, _) = rest.split_last_chunk::<4>().ok_or(CUT_OFF)?;
    if count > rest.len() {
        return Err(CUT_OFF);
    }
    let mut last = [0u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let code = take_varint(&mut rest).ok_or(CUT_OFF)?;
        let baseline = &mut last[(code & 1) as usize];
        *baseline = baseline.wrapping_add(unzigzag(code >> 1));
        indices.push(*baseline);
    }
    if rest.is_empty() { Ok(indices) } else { Err("it continues after its last index") }
}

/// A queue of the last sixteen entries.
#[derive(Default)]
struct Fifo<T> {
    entries: [T; 16],
    pushed: usize,
}

impl<T: Copy> Fifo<T> {
    fn push(&mut self, entry: T) {
        self.entries[self.pushed % 16] = entry;
        self.pushed += 1;
    }

    /// Returns an entry by age; 0 is the last one pushed.
    fn get(&self, age: u8) -> T {
        self.entries[self.pushed.wrapping_sub(1 + usize::from(age)) % 16]
    }
}

struct Triangles<'a> {
    /// Data that does not fit into the codes.
    extra: &'a [u8],
    /// The common pairs of codes for the second and third vertex.
    pairs: &'a [u8; 16],
    /// The next new vertex.
    next: u32,
    /// The last vertex that was coded explicitly.
    last: u32,
    edges: Fifo<[u32; 2]>,
    vertices: Fifo<u32>,
}

impl Triangles<'_> {
    fn triangle(&mut self, code: u8) -> Option<[u32; 3]> {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            let [a, b] = self.edges.get(high);
            let c = match low {
                0 => self.fresh(),
                1..=12 => self.vertices.get(low),
                13 => self.spelled(self.last.wrapping_sub(1)),
                14 => self.spelled(self.last.wrapping_add(1)),
                _ => self.explicit()?,
            };
            self.edges.push([c, b]);
            self.edges.push([a, c]);
            if !(1..=12).contains(&low) {
                self.vertices.push(c);
            }
            return Some([a, b, c]);
        }
        let (a, pair) = if low < 14 {
            (self.fresh(), self.pairs[usize::from(low)])
        } else {
            let (&pair, extra) = self.extra.split_first()?;
            self.extra = extra;
            if pair == 0 {
                self.next = 0;
            }
            (if low == 14 { self.fresh() } else { self.explicit()? }, pair)
        };
        // A valid table has no explicit vertices; those of a damaged one are read as well.
        let b = self.at(pair >> 4)?;
        let c = self.at(pair & 15)?;
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        self.vertices.push(a);
        for (vertex, place) in [(b, pair >> 4), (c, pair & 15)] {
            if place == 0 || place == 15 {
                self.vertices.push(vertex);
            }
        }
        Some([a, b, c])
    }

    fn fresh(&mut self) -> u32 {
        let vertex = self.next;
        self.next = vertex.wrapping_add(1);
        vertex
    }

    fn spelled(&mut self, vertex: u32) -> u32 {
        self.last = vertex;
        vertex
    }

    fn explicit(&mut self) -> Option<u32> {
        let code = take_varint(&mut self.extra)?;
        Some(self.spelled(self.last.wrapping_add(unzigzag(code))))
    }

    fn at(&mut self, place: u8) -> Option<u32> {
        match place {
            0 => Some(self.fresh()),
            15 => self.explicit(),
            place => Some(self.vertices.get(place - 1)),
        }
    }
}

/// Takes an unsigned LEB128 of at most five bytes.
fn take_varint(bytes: &mut &[u8]) -> Option<u32> {
    let mut value = 0;
    for shift in (0..35).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u32::from(byte & 127).wrapping_shl(shift);
        if byte < 128 {
            return Some(value);
        }
    }
    None
}

fn unzigzag(v: u32) -> u32 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn varints_are_those_of_the_specification() {
        for (mut bytes, value) in [(&[0x7f][..], 0x7f), (&[0x81, 0x04], 0x201), (&[0xff, 0xa0, 0x05], 0x1507f)] {
            // The third example of the text, 0x1fd005, has its groups the wrong way round.
            assert_eq!(take_varint(&mut bytes), Some(value));
        }
        assert_eq!(take_varint(&mut &[0xff; 6][..]), None);
        assert_eq!(take_varint(&mut &[0xff; 2][..]), None);
    }

    #[test]
    fn sequences_follow_two_baselines() {
        let data = [0xd1, 4, 5, 4, 3, 0, 0, 0, 0];
        // 4: +1 on the first; 5: +1 on the second; 4: +1 on the first; 3: −1 on the second.
        assert_eq!(sequence(&data, 4), Ok(vec![1, 1, 2, 0]));
        assert_eq!(sequence(&data, 3), Err("it continues after its last index"));
        assert_eq!(sequence(&data, 5), Err(CUT_OFF));
    }
}
