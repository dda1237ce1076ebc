//! The journal of a work: an append-only file of rows and tiles, from which an interrupted work resumes.
//!
//! Format, version 5, little endian: eight bytes `BOTTEGA` 5, then [records](bottega_agents::framing), each of a kind
//! (1 byte) and its data. Kind 1: a name chosen by the owner (a digest of scene and settings); 2: the row of the work;
//! 3: the row of a zone, with or without its tile. Of several records of a zone the last one counts. A record that a
//! crash left incomplete is ignored with all that follows it: the work resumes from what comes before, with the same
//! pixels.

use std::{
    collections::BTreeMap,
    io::{self, Read, Write},
};

use bottega_agents::framing::{RECORD_HEAD_BYTES, read_record, record_head};
use bottega_image::Tile;

use crate::{
    WorkRow, ZoneId, ZoneRow, ZoneState,
    wire::{digest, put_tile, put_work, put_zone, read_tile, read_work, take_zone},
};

const MAGIC: [u8; 8] = *b"BOTTEGA\x05";
/// Maximum length of a record that is read, in bytes.
const PAYLOAD_BYTES_MAX: u64 = 1 << 36;

/// The storage for a running work. Called in order by one thread at a time.
pub trait ZoneStore: Send {
    /// Stores the row of the work.
    ///
    /// # Errors
    /// The row cannot be written. The work continues, but cannot be resumed from here.
    fn put_work(&mut self, work: &WorkRow) -> io::Result<()>;

    /// Stores the current row of a zone, with its tile if the row's result is new.
    ///
    /// # Errors
    /// The row cannot be written, as for [`Self::put_work`].
    fn put_zone(&mut self, row: &ZoneRow, tile: Option<&Tile>) -> io::Result<()>;
}

/// A writer of journals, which stores the progress of one work.
#[derive(Debug)]
pub struct JournalWriter<W: Write> {
    to: W,
    payload: Vec<u8>,
}

impl<W: Write + Send> JournalWriter<W> {
    /// Starts a new journal.
    ///
    /// - `name`: identifies the picture, for example by a digest of scene and settings. Compare it before resuming.
    ///
    /// # Errors
    /// The writer failed.
    pub fn create(mut to: W, name: &str) -> io::Result<Self> {
        to.write_all(&MAGIC)?;
        let mut journal = Self::append(to);
        journal.begin(1).extend(name.as_bytes());
        journal.write()?;
        Ok(journal)
    }

    /// Makes a writer that continues the journal that ends at the position of `to`: cut the file to
    /// [`Journal::sound_bytes`] first.
    pub fn append(to: W) -> Self {
        Self { to, payload: Vec::new() }
    }

    /// Starts a record of this kind in the buffer.
    fn begin(&mut self, kind: u8) -> &mut Vec<u8> {
        self.payload.clear();
        self.payload.push(kind);
        &mut self.payload
    }

    /// Writes the record in the buffer.
    fn write(&mut self) -> io::Result<()> {
        self.to.write_all(&record_head(&self.payload))?;
        self.to.write_all(&self.payload)?;
        self.to.flush()
    }
}

impl<W: Write + Send> ZoneStore for JournalWriter<W> {
    fn put_work(&mut self, work: &WorkRow) -> io::Result<()> {
        put_work(work, self.begin(2));
        self.write()
    }

    fn put_zone(&mut self, row: &ZoneRow, tile: Option<&Tile>) -> io::Result<()> {
        let payload = self.begin(3);
        put_zone(row, payload);
        if let Some(tile) = tile {
            put_tile(tile, payload);
        }
        self.write()
    }
}

/// The contents of a journal file.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    /// The name given to [`JournalWriter::create`].
    pub name: String,
    /// The state of the work; `None`: it was interrupted before all zones were known.
    pub kept: Option<JournalContents>,
    /// Length of the valid part, in bytes.
    pub sound_bytes: u64,
}

/// The state of an interrupted work.
#[derive(Clone, Debug)]
pub struct JournalContents {
    /// The row of the work.
    pub work: WorkRow,
    /// The rows of all zones of the work, in the order of their ids, as after [`ZoneRow::resumed`]: no agent holds a
    /// zone.
    pub rows: Vec<ZoneRow>,
    /// The samples to which the rows refer, by zone.
    pub tiles: BTreeMap<ZoneId, Tile>,
}

/// An error in reading a journal.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The journal cannot be read.
    #[error("cannot read the journal")]
    Read(#[from] io::Error),
    /// The file is not a journal, or of another version.
    #[error("this is not the journal of a work, or it has another version")]
    Magic,
    /// The first record is not the name.
    #[error("the journal does not name its work")]
    Name,
}

impl Journal {
    /// Reads a journal up to the first damaged record: see [`Journal::sound_bytes`].
    ///
    /// # Errors
    /// Reading failed, or the file is not a journal of this version that begins with a name.
    pub fn read(mut from: impl Read) -> Result<Self, JournalError> {
        let mut magic = [0; MAGIC.len()];
        if !fill(&mut from, &mut magic)? || magic != MAGIC {
            return Err(JournalError::Magic);
        }
        let mut journal = Self { sound_bytes: MAGIC.len() as u64, ..Self::default() };
        let mut work = None;
        let mut zones: BTreeMap<ZoneId, (ZoneRow, Option<Tile>)> = BTreeMap::new();
        let mut first = true;
        while let Some(record) = read_record(&mut from, PAYLOAD_BYTES_MAX)? {
            let Some((&kind, payload)) = record.split_first() else { break };
            let understood = match kind {
                1 if first => std::str::from_utf8(payload).map(|name| journal.name = name.to_owned()).is_ok(),
                _ if first => return Err(JournalError::Name),
                2 => read_work(payload).map(|row| work = Some(row)).is_ok(),
                3 => keep_zone(payload, &mut zones),
                _ => false,
            };
            if !understood {
                break;
            }
            first = false;
            journal.sound_bytes += (RECORD_HEAD_BYTES + record.len()) as u64;
        }
        if first {
            return Err(JournalError::Name);
        }
        journal.kept = work.and_then(|work| keep(work, zones));
        Ok(journal)
    }
}

/// Fills a buffer; false if the file ends first.
fn fill(from: &mut impl Read, buffer: &mut [u8]) -> io::Result<bool> {
    match from.read_exact(buffer) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        other => other.map(|()| true),
    }
}

/// Takes in the row of a zone and its tile, if it follows. False if damaged.
fn keep_zone(payload: &[u8], zones: &mut BTreeMap<ZoneId, (ZoneRow, Option<Tile>)>) -> bool {
    let Ok((row, rest)) = take_zone(payload) else { return false };
    let tile = if rest.is_empty() { Ok(None) } else { read_tile(rest).map(Some) };
    let Ok(tile) = tile else { return false };
    let before = zones.remove(&row.zone).and_then(|(_, tile)| tile);
    zones.insert(row.zone, (row, tile.or(before)));
    true
}

/// Returns the resumable state; `None` if zones are missing. A row whose tile is missing or does not match its digest
/// is painted again from the start.
fn keep(work: WorkRow, zones: BTreeMap<ZoneId, (ZoneRow, Option<Tile>)>) -> Option<JournalContents> {
    let roots = zones.values().filter(|(row, _)| row.root.is_none()).count();
    let in_order = zones.keys().take(roots).enumerate().all(|(i, zone)| zone.index() == i);
    if !in_order || roots != work.zone_count as usize {
        return None;
    }
    let mut kept = JournalContents { work, rows: Vec::new(), tiles: BTreeMap::new() };
    for (zone, (row, tile)) in zones {
        let tile = tile.filter(|tile| row.result.is_some_and(|result| result.digest == digest(tile)));
        match tile {
            Some(tile) => {
                kept.tiles.insert(zone, tile);
                kept.rows.push(row.resumed());
            }
            None => kept.rows.push(ZoneRow {
                state: ZoneState::Open,
                result: None,
                time_estimated: None,
                time_measured: None,
                ..row.resumed()
            }),
        }
    }
    Some(kept)
}

#[cfg(test)]
mod tests {
    use bottega_engines::Tunables;
    use bottega_image::{AovSet, Layout, Rect};
    use proptest::prelude::*;

    use super::*;
    use crate::{Goal, InputRanges, NeighborDifference, Optimization, ResultRef, WorkId, WorkSettings};

    fn written() -> (Vec<u8>, Vec<usize>) {
        let frame = Rect::of_size(8, 4);
        let tunables = Tunables { max_depth: 3, light_samples: 1 };
        let (goal, optimization) = (Goal::Samples, Optimization::Off);
        let settings = WorkSettings { picture: frame, frame, samples: 4, goal, tunables, optimization };
        let rects = [Rect::new(0, 0, 4, 4), Rect::new(4, 0, 8, 4)];
        let rows: Vec<ZoneRow> = (0..2)
            .map(|i| ZoneRow::open(WorkId(1), ZoneId(i), rects[i as usize], 16.0, NeighborDifference::default()))
            .collect();
        let work = WorkRow {
            work: WorkId(1),
            settings,
            zone_count: 2,
            ranges: InputRanges::of(&rows),
            features: crate::TaskFeatures::default(),
        };
        let mut tile = Tile::new(rects[1], Layout::new(AovSet::NONE));
        tile.sums_mut().fill(2.5);
        let result = ResultRef { fence: Default::default(), samples: 4, digest: digest(&tile) };
        let done = ZoneRow { state: ZoneState::Done, result: Some(result), ..rows[1].clone() };
        let mut bytes = Vec::new();
        let mut ends = Vec::new();
        let mut journal = JournalWriter::create(&mut bytes, "scene 12").unwrap();
        journal.put_work(&work).unwrap();
        rows.iter().for_each(|row| journal.put_zone(row, None).unwrap());
        ends.push(journal.to.len());
        journal.put_zone(&done, Some(&tile)).unwrap();
        ends.push(journal.to.len());
        (bytes, ends)
    }

    #[test]
    fn the_last_row_of_a_zone_counts_and_its_tile_comes_back() {
        let (bytes, _) = written();
        let journal = Journal::read(&bytes[..]).unwrap();
        let kept = journal.kept.unwrap();
        assert_eq!((journal.name.as_str(), journal.sound_bytes), ("scene 12", bytes.len() as u64));
        assert_eq!(kept.rows[0].state, ZoneState::Open);
        assert_eq!(kept.rows[1].state, ZoneState::Done);
        assert_eq!(kept.tiles[&ZoneId(1)].sums()[0], 2.5);
    }

    #[test]
    fn what_is_no_journal_is_refused() {
        assert!(matches!(Journal::read(&b""[..]), Err(JournalError::Magic)));
        assert!(matches!(Journal::read(&b"BOTTEGA\x01 and more"[..]), Err(JournalError::Magic)));
        assert!(matches!(Journal::read(&MAGIC[..]), Err(JournalError::Name)));
    }

    proptest! {
        #[test]
        fn a_torn_or_damaged_tail_costs_only_what_was_in_it(at in 0.0f64..1.0, flip in 0u8..8, torn in any::<bool>()) {
            let (mut bytes, ends) = written();
            let at = (at * bytes.len() as f64) as usize;
            if torn {
                bytes.truncate(at);
            } else {
                bytes[at] ^= 1 << flip;
            }
            match Journal::read(&bytes[..]) {
                Err(_) => prop_assert!(at < ends[0]),
                Ok(journal) => {
                    prop_assert!(journal.sound_bytes <= at as u64);
                    let done = journal.kept.iter().flat_map(|kept| &kept.rows).filter(|row| row.state == ZoneState::Done);
                    prop_assert_eq!(done.count(), usize::from(at >= ends[1]));
                    prop_assert_eq!(journal.kept.is_some(), at >= ends[0]);
                }
            }
        }
    }
}
