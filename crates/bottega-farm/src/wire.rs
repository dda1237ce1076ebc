//! Rows and tiles as bytes: what the journal holds. Version 4, little endian, no padding.

mod message;

use std::time::Duration;

use bottega_agents::{AgentId, Revision, bus::BlobId};
use bottega_engines::Tunables;
use bottega_image::{
    AovSet, CHANNEL_NAME_BYTES_MAX, CHANNELS_MAX, Combine, LAYERS_MAX, Layer, Layout, Rect, Sides, Tile,
};

use crate::{
    Choice, Cut, Goal, InputRanges, Interval, NeighborDifference, Optimization, Painting, ResultRef, Rival, Vote,
    WorkId, WorkRow, WorkSettings, ZoneId, ZoneRow, ZoneState,
};

pub use self::message::FarmCodec;

/// The longest name that is written or read.
const NAME_BYTES_MAX: usize = 1 << 10;
/// Offers, bids, orders or votes in one list at most.
const LIST_MAX: usize = 1 << 16;

/// What was read is not what was written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} cannot be read from {length} bytes")]
pub struct WireError {
    /// What should have been there.
    pub what: &'static str,
    /// In how many bytes.
    pub length: usize,
}

/// Digest of a tile: of its place, its layout and the bits of its sums.
pub fn digest(tile: &Tile) -> BlobId {
    let mut hasher = blake3::Hasher::new();
    let mut head = Vec::new();
    put_tile_head(tile, &mut head);
    hasher.update(&head);
    let mut bytes = [0; 4 << 10];
    for sums in tile.sums().chunks(bytes.len() / 4) {
        for (to, sum) in bytes.chunks_exact_mut(4).zip(sums) {
            to.copy_from_slice(&sum.to_le_bytes());
        }
        hasher.update(&bytes[..4 * sums.len()]);
    }
    BlobId(*hasher.finalize().as_bytes())
}

/// Appends bytes that [`get_tile`] reads.
pub(crate) fn put_tile(tile: &Tile, bytes: &mut Vec<u8>) {
    put_tile_head(tile, bytes);
    bytes.extend(tile.sums().iter().flat_map(|sum| sum.to_le_bytes()));
}

fn put_tile_head(tile: &Tile, bytes: &mut Vec<u8>) {
    put_rect(&tile.rect(), bytes);
    put_layout(tile.layout(), bytes);
}

fn put_layout(layout: &Layout, bytes: &mut Vec<u8>) {
    bytes.push(layout.aovs().bits());
    put_u32(layout.layers().len() as u32, bytes);
    for Layer { name, channels, combine } in layout.layers() {
        put_text(name, bytes);
        put_u32(channels.len() as u32, bytes);
        channels.iter().for_each(|channel| put_text(channel, bytes));
        bytes.push(u8::from(*combine == Combine::Pick));
    }
}

fn get_layout(reader: &mut Reader<'_>) -> Result<Layout, WireError> {
    let length = reader.0.len();
    let wrong = || WireError { what: "a layout", length };
    let aovs = AovSet::from_bits(reader.u8()?).ok_or_else(wrong)?;
    let count = reader.u32()? as usize;
    if count > LAYERS_MAX {
        return Err(wrong());
    }
    let mut channels_left = CHANNELS_MAX;
    let mut layers = Vec::new();
    for _ in 0..count {
        let name = reader.text("a layer", CHANNEL_NAME_BYTES_MAX)?;
        let channel_count = reader.u32()? as usize;
        channels_left = channels_left.checked_sub(channel_count).ok_or_else(wrong)?;
        let channels =
            (0..channel_count).map(|_| reader.text("a channel", CHANNEL_NAME_BYTES_MAX)).collect::<Result<_, _>>()?;
        let combine = match reader.u8()? {
            0 => Combine::Mean,
            1 => Combine::Pick,
            _ => return Err(wrong()),
        };
        layers.push(Layer { name, channels, combine });
    }
    Layout::with_layers(aovs, layers).map_err(|_| wrong())
}

pub(crate) fn get_tile(reader: &mut Reader<'_>) -> Result<Tile, WireError> {
    let rect = reader.rect()?;
    let layout = get_layout(reader)?;
    // Nothing is allocated for more than is there.
    let wanted = rect.area().saturating_mul(4 * layout.stride() as u64);
    let sums = reader.bytes(usize::try_from(wanted).unwrap_or(usize::MAX))?;
    let mut tile = Tile::new(rect, layout);
    for (sum, bytes) in tile.sums_mut().iter_mut().zip(sums.chunks_exact(4)) {
        *sum = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    }
    Ok(tile)
}

pub(crate) fn put_zone(row: &ZoneRow, bytes: &mut Vec<u8>) {
    put_u64(row.work.0, bytes);
    put_u32(row.zone.0, bytes);
    put_rect(&row.rect, bytes);
    put_f64(row.complexity, bytes);
    put_f64(row.neighbor_difference.mean, bytes);
    row.neighbor_difference.sides.into_array().into_iter().for_each(|value| put_f64(value, bytes));
    put_option(row.time_estimated, bytes, put_duration);
    put_option(row.time_measured, bytes, put_duration);
    put_option(row.agent.as_ref(), bytes, put_agent);
    bytes.push(row.state as u8);
    put_u32(row.attempt, bytes);
    put_option(row.choice.as_ref(), bytes, put_choice);
    put_option(row.result.as_ref(), bytes, put_result);
    put_option(row.goal, bytes, put_u32);
    put_option(row.error, bytes, put_f64);
    put_option(row.piece, bytes, |piece, bytes| put_rect(&piece, bytes));
    put_option(row.root, bytes, |root, bytes| put_u32(root.0, bytes));
    put_option(row.cut, bytes, |cut, bytes| {
        put_u32(cut.zone.0, bytes);
        put_rect(&cut.piece, bytes);
    });
    put_option(row.rival.as_ref(), bytes, |rival, bytes| {
        put_agent(&rival.agent, bytes);
        put_u64(rival.fence.0, bytes);
    });
    put_u32(row.votes.len() as u32, bytes);
    for vote in &row.votes {
        put_agent(&vote.agent, bytes);
        put_painting(&vote.painting, bytes);
    }
    put_option(row.word_of.as_ref(), bytes, put_agent);
}

fn put_painting(painting: &Painting, bytes: &mut Vec<u8>) {
    let Painting { choice, result, time_measured, goal, time_left, error } = painting;
    put_choice(choice, bytes);
    put_result(result, bytes);
    put_duration(*time_measured, bytes);
    put_u32(*goal, bytes);
    put_duration(*time_left, bytes);
    put_option(*error, bytes, put_f64);
}

fn put_choice(choice: &Choice, bytes: &mut Vec<u8>) {
    let Choice { tunables: Tunables { max_depth, light_samples }, samples, bands } = *choice;
    [max_depth, light_samples, samples].into_iter().for_each(|value| put_u32(value, bytes));
    bands.into_array().into_iter().for_each(|value| put_u32(value, bytes));
}

fn put_result(result: &ResultRef, bytes: &mut Vec<u8>) {
    put_u64(result.fence.0, bytes);
    put_u32(result.samples, bytes);
    bytes.extend(result.digest.0);
}

fn put_agent(agent: &AgentId, bytes: &mut Vec<u8>) {
    put_text(&agent.name[..agent.name.floor_char_boundary(NAME_BYTES_MAX)], bytes);
}

fn put_text(text: &str, bytes: &mut Vec<u8>) {
    put_u32(text.len() as u32, bytes);
    bytes.extend(text.as_bytes());
}

pub(crate) fn get_zone(reader: &mut Reader<'_>) -> Result<ZoneRow, WireError> {
    Ok(ZoneRow {
        work: WorkId(reader.u64()?),
        zone: ZoneId(reader.u32()?),
        rect: reader.rect()?,
        complexity: reader.finite()?,
        neighbor_difference: reader.neighbor_difference()?,
        time_estimated: reader.option(Reader::duration)?,
        time_measured: reader.option(Reader::duration)?,
        agent: reader.option(Reader::agent)?,
        state: reader.state()?,
        attempt: reader.u32()?,
        choice: reader.option(Reader::choice)?,
        result: reader.option(Reader::result)?,
        goal: reader.option(Reader::u32)?,
        error: reader.option(Reader::finite)?,
        piece: reader.option(Reader::rect)?,
        root: reader.option(|reader| reader.u32().map(ZoneId))?,
        cut: reader.option(|reader| Ok(Cut { zone: ZoneId(reader.u32()?), piece: reader.rect()? }))?,
        rival: reader.option(|reader| Ok(Rival { agent: reader.agent()?, fence: Revision(reader.u64()?) }))?,
        votes: reader.list(|reader| Ok(Vote { agent: reader.agent()?, painting: reader.painting()? }))?,
        word_of: reader.option(Reader::agent)?,
    })
}

pub(crate) fn put_work(row: &WorkRow, bytes: &mut Vec<u8>) {
    let WorkSettings { picture, frame, samples, goal, tunables, optimization } = row.settings;
    put_u64(row.work.0, bytes);
    put_rect(&picture, bytes);
    put_rect(&frame, bytes);
    [samples, tunables.max_depth, tunables.light_samples].into_iter().for_each(|value| put_u32(value, bytes));
    bytes.push(optimization as u8);
    match goal {
        Goal::Samples => bytes.push(0),
        Goal::Error(error) => {
            bytes.push(1);
            put_f64(error, bytes);
        }
        Goal::Time(time) => {
            bytes.push(2);
            put_duration(time, bytes);
        }
    }
    put_u32(row.zone_count, bytes);
    let InputRanges { complexity_density, neighbor_difference, size } = row.ranges;
    for Interval { min, max } in [complexity_density, neighbor_difference, size] {
        put_f64(min, bytes);
        put_f64(max, bytes);
    }
}

pub(crate) fn get_work(reader: &mut Reader<'_>) -> Result<WorkRow, WireError> {
    let work = WorkId(reader.u64()?);
    let (picture, frame) = (reader.rect()?, reader.rect()?);
    let samples = reader.u32()?;
    let tunables = Tunables { max_depth: reader.u32()?, light_samples: reader.u32()? };
    let level = usize::from(reader.u8()?);
    let optimization = *Optimization::ALL.get(level).ok_or_else(|| reader.error("optimization level"))?;
    let goal = reader.goal()?;
    let zone_count = reader.u32()?;
    let mut interval = || Ok(Interval { min: reader.finite()?, max: reader.finite()? });
    let ranges = InputRanges { complexity_density: interval()?, neighbor_difference: interval()?, size: interval()? };
    let settings = WorkSettings { picture, frame, samples, goal, tunables, optimization };
    Ok(WorkRow { work, settings, zone_count, ranges })
}

fn put_u32(value: u32, bytes: &mut Vec<u8>) {
    bytes.extend(value.to_le_bytes());
}

fn put_u64(value: u64, bytes: &mut Vec<u8>) {
    bytes.extend(value.to_le_bytes());
}

fn put_f64(value: f64, bytes: &mut Vec<u8>) {
    bytes.extend(value.to_le_bytes());
}

fn put_rect(rect: &Rect, bytes: &mut Vec<u8>) {
    [rect.x0, rect.y0, rect.x1, rect.y1].into_iter().for_each(|value| put_u32(value, bytes));
}

fn put_duration(value: Duration, bytes: &mut Vec<u8>) {
    put_u64(u64::try_from(value.as_nanos()).unwrap_or(u64::MAX), bytes);
}

fn put_option<T>(value: Option<T>, bytes: &mut Vec<u8>, put: impl FnOnce(T, &mut Vec<u8>)) {
    bytes.push(u8::from(value.is_some()));
    if let Some(value) = value {
        put(value, bytes);
    }
}

/// Takes values from the front of some bytes.
pub(crate) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    fn length(&self) -> usize {
        self.0.len()
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn error(&self, what: &'static str) -> WireError {
        WireError { what, length: self.0.len() }
    }

    fn bytes(&mut self, count: usize) -> Result<&'a [u8], WireError> {
        let (taken, left) = self.0.split_at_checked(count).ok_or_else(|| self.error("a block of bytes"))?;
        self.0 = left;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], WireError> {
        let bytes = self.bytes(N)?;
        bytes.try_into().map_err(|_| self.error("a number"))
    }

    pub(crate) fn u8(&mut self) -> Result<u8, WireError> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    fn u32(&mut self) -> Result<u32, WireError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn u64(&mut self) -> Result<u64, WireError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn finite(&mut self) -> Result<f64, WireError> {
        let value = f64::from_le_bytes(self.array()?);
        if value.is_finite() { Ok(value) } else { Err(self.error("a finite number")) }
    }

    fn neighbor_difference(&mut self) -> Result<NeighborDifference, WireError> {
        let (mean, mut side) = (self.finite()?, || self.finite());
        Ok(NeighborDifference { mean, sides: Sides { left: side()?, top: side()?, right: side()?, bottom: side()? } })
    }

    fn rect(&mut self) -> Result<Rect, WireError> {
        let (x0, y0, x1, y1) = (self.u32()?, self.u32()?, self.u32()?, self.u32()?);
        if x0 <= x1 && y0 <= y1 { Ok(Rect { x0, y0, x1, y1 }) } else { Err(self.error("a rectangle")) }
    }

    fn duration(&mut self) -> Result<Duration, WireError> {
        Ok(Duration::from_nanos(self.u64()?))
    }

    fn agent(&mut self) -> Result<AgentId, WireError> {
        self.text("a name", NAME_BYTES_MAX).map(AgentId::new)
    }

    /// - `most`: the most bytes that are believed.
    fn text(&mut self, what: &'static str, most: usize) -> Result<String, WireError> {
        let length = self.u32()? as usize;
        if length > most {
            return Err(self.error(what));
        }
        let text = self.bytes(length)?;
        std::str::from_utf8(text).map(str::to_owned).map_err(|_| self.error(what))
    }

    fn state(&mut self) -> Result<ZoneState, WireError> {
        use ZoneState::{Awarded, Done, Failed, Open, Profiled, Profiling};
        let index = usize::from(self.u8()?);
        let states = [Open, Profiling, Profiled, Awarded, Done, Failed];
        states.get(index).copied().ok_or_else(|| self.error("the state of a zone"))
    }

    fn goal(&mut self) -> Result<Goal, WireError> {
        Ok(match self.u8()? {
            0 => Goal::Samples,
            1 => Goal::Error(self.finite()?),
            2 => Goal::Time(self.duration()?),
            _ => return Err(self.error("a goal")),
        })
    }

    fn choice(&mut self) -> Result<Choice, WireError> {
        let tunables = Tunables { max_depth: self.u32()?, light_samples: self.u32()? };
        let (samples, mut side) = (self.u32()?, || self.u32());
        let bands = Sides { left: side()?, top: side()?, right: side()?, bottom: side()? };
        Ok(Choice { tunables, samples, bands })
    }

    fn result(&mut self) -> Result<ResultRef, WireError> {
        Ok(ResultRef { fence: Revision(self.u64()?), samples: self.u32()?, digest: BlobId(self.array()?) })
    }

    fn painting(&mut self) -> Result<Painting, WireError> {
        Ok(Painting {
            choice: self.choice()?,
            result: self.result()?,
            time_measured: self.duration()?,
            goal: self.u32()?,
            time_left: self.duration()?,
            error: self.option(Reader::finite)?,
        })
    }

    /// Nothing is allocated for more than is there: each element has a byte at least.
    fn list<T>(&mut self, mut get: impl FnMut(&mut Self) -> Result<T, WireError>) -> Result<Vec<T>, WireError> {
        let count = self.u32()? as usize;
        if count > LIST_MAX.min(self.length()) {
            return Err(self.error("a list"));
        }
        (0..count).map(|_| get(self)).collect()
    }

    fn option<T>(&mut self, get: impl FnOnce(&mut Self) -> Result<T, WireError>) -> Result<Option<T>, WireError> {
        match self.u8()? {
            0 => Ok(None),
            1 => get(self).map(Some),
            _ => Err(self.error("an optional value")),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use proptest::prelude::*;

    use super::*;
    use bottega_image::Aov;

    pub(crate) fn rows() -> impl Strategy<Value = ZoneRow> {
        let times = (proptest::option::of(0u64..1 << 40), proptest::option::of(0u64..1 << 40));
        let choice = proptest::option::of((0u32..99, 0u32..9, 1u32..999, 0u32..64));
        let result = proptest::option::of((0u64..999, 1u32..999, any::<[u8; 32]>()));
        let place = (0u32..999, 0u32..99, 0u32..99, 1u32..99, 1u32..99);
        (place, -1e9f64..1e9, times, "[a-z@ä]{0,20}", 0usize..6, choice, result).prop_map(
            |((zone, x, y, width, height), complexity, times, name, state, choice, result)| {
                let states = [
                    ZoneState::Open,
                    ZoneState::Profiling,
                    ZoneState::Profiled,
                    ZoneState::Awarded,
                    ZoneState::Done,
                    ZoneState::Failed,
                ];
                let rect = Rect::new(x, y, x + width, y + height);
                let painting = |samples| Painting {
                    choice: Choice {
                        tunables: Tunables { max_depth: y, light_samples: 1 },
                        samples,
                        bands: Sides::all(0),
                    },
                    result: ResultRef { fence: Revision(5), samples, digest: BlobId([3; 32]) },
                    time_measured: Duration::from_millis(7),
                    goal: samples,
                    time_left: Duration::from_millis(9),
                    error: (y % 2 == 0).then_some(0.5),
                };
                ZoneRow {
                    votes: (0..y % 3).map(|i| Vote { agent: AgentId::new("v"), painting: painting(i) }).collect(),
                    word_of: (y % 4 == 0).then(|| AgentId::new("w")),
                    time_estimated: times.0.map(Duration::from_nanos),
                    time_measured: times.1.map(Duration::from_nanos),
                    agent: (!name.is_empty()).then(|| AgentId::new(name)),
                    state: states[state],
                    choice: choice.map(|(max_depth, light_samples, samples, band)| Choice {
                        tunables: Tunables { max_depth, light_samples },
                        samples,
                        bands: Sides { left: band, top: 0, right: samples, bottom: 3 },
                    }),
                    result: result.map(|(fence, samples, digest)| ResultRef {
                        fence: Revision(fence),
                        samples,
                        digest: BlobId(digest),
                    }),
                    goal: (x % 2 == 0).then_some(y),
                    error: (x % 3 == 0).then_some(f64::from(y)),
                    piece: (zone % 3 == 0).then_some(rect),
                    root: (zone % 3 == 0).then_some(ZoneId(x)),
                    cut: (zone % 2 == 0).then_some(Cut { zone: ZoneId(y), piece: rect }),
                    rival: (y % 2 == 0).then(|| Rival { agent: AgentId::new("b"), fence: Revision(u64::from(x)) }),
                    ..ZoneRow::open(WorkId(7), ZoneId(zone), rect, complexity, NeighborDifference::all(0.5))
                }
            },
        )
    }

    proptest! {
        #[test]
        fn a_row_is_read_as_it_was_written(row in rows()) {
            let mut bytes = Vec::new();
            put_zone(&row, &mut bytes);
            let mut reader = Reader::new(&bytes);
            prop_assert_eq!(get_zone(&mut reader), Ok(row));
            prop_assert!(reader.0.is_empty());
        }

        #[test]
        fn no_bytes_make_a_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            _ = get_zone(&mut Reader::new(&bytes));
            _ = get_work(&mut Reader::new(&bytes));
            _ = get_tile(&mut Reader::new(&bytes));
        }
    }

    #[test]
    fn a_tile_is_read_as_it_was_written_and_its_digest_sees_one_bit() {
        let layer = |name: &str, channels: &str, combine| Layer {
            name: name.to_owned(),
            channels: channels.chars().map(String::from).collect(),
            combine,
        };
        let layers = vec![layer("Farbe", "RGBA", Combine::Mean), layer("Kiste №7", "Y", Combine::Pick)];
        let layout = Layout::with_layers([Aov::Albedo, Aov::Cost].into_iter().collect(), layers).expect("sound");
        let mut tile = Tile::new(Rect::new(3, 4, 9, 7), layout);
        tile.sums_mut().iter_mut().enumerate().for_each(|(i, sum)| *sum = i as f32 * 0.3 - 2.0);
        let mut bytes = Vec::new();
        put_tile(&tile, &mut bytes);
        assert_eq!(get_tile(&mut Reader::new(&bytes)), Ok(tile.clone()));
        let before = digest(&tile);
        tile.sums_mut()[17] = f32::from_bits(tile.sums()[17].to_bits() ^ 1);
        assert_ne!(digest(&tile), before);
        for end in 0..bytes.len() {
            assert!(get_tile(&mut Reader::new(&bytes[..end])).is_err(), "{end} bytes");
        }
    }

    #[test]
    fn a_tile_of_more_layers_than_any_has_is_refused() {
        let head = |layers: u32, channels: u32| {
            let mut bytes = Vec::new();
            put_rect(&Rect::of_size(1, 1), &mut bytes);
            bytes.push(0);
            put_u32(layers, &mut bytes);
            for index in 0..layers.min(200) {
                put_text(&index.to_string(), &mut bytes);
                put_u32(channels, &mut bytes);
                (0..channels.min(600)).for_each(|channel| put_text(&channel.to_string(), &mut bytes));
                bytes.push(0);
            }
            bytes.extend([0; 1 << 13]);
            get_tile(&mut Reader::new(&bytes)).map(|tile| tile.layout().stride())
        };
        assert_eq!(head(LAYERS_MAX as u32, 4), Ok(6 + CHANNELS_MAX));
        for (layers, channels) in [(LAYERS_MAX as u32 + 1, 1), (u32::MAX, 1), (1, u32::MAX), (2, 400), (1, 0)] {
            assert!(head(layers, channels).is_err(), "{layers} layers of {channels} channels");
        }
    }
}
