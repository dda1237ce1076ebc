//! The pixels of a job: tiles in progress, the film, and the store of both.

use std::{collections::BTreeMap, io, time::Duration};

use bottega_agents::{BlobId, Revision, Time};
use bottega_engines::{Survey, SurveyPixel};
use bottega_image::{Film, Layout, Rect, SampleValues, Tile};

use super::settings::JobSettings;
use crate::{
    AgentRow, Mask, Progress, ResultRef, Times, WorkRow, ZoneId, ZoneRow, ZoneState, ZoneStore, digest, progress::Tally,
};

/// The tiles, the film and the store of a job.
pub(super) struct Composer {
    film: Film,
    layout: Layout,
    samples_wanted: u32,
    tiles: BTreeMap<ZoneId, (BlobId, Tile)>,
    rows: BTreeMap<ZoneId, ZoneRow>,
    store: Option<Box<dyn ZoneStore>>,
    /// The digest of each zone's tile in the store.
    stored: BTreeMap<ZoneId, BlobId>,
    tally: Tally,
    times: Times,
}

impl Composer {
    /// Returns the pixels of a job at its start, with the tiles of an earlier run.
    pub(super) fn new(settings: &JobSettings, kept: BTreeMap<ZoneId, Tile>, store: Option<Box<dyn ZoneStore>>) -> Self {
        let tiles: BTreeMap<_, _> = kept.into_iter().map(|(zone, tile)| (zone, (digest(&tile), tile))).collect();
        // The journal that is continued contains these tiles.
        let stored = tiles.iter().map(|(&zone, (id, _))| (zone, *id)).collect();
        Self {
            film: Film::new(settings.crop, settings.layout.clone()).with_picture_size(settings.width, settings.height),
            layout: settings.layout.clone(),
            samples_wanted: settings.samples,
            tiles,
            rows: BTreeMap::new(),
            store,
            stored,
            tally: Tally::new(
                !settings.experience.is_empty() || !settings.experience_of_farm.is_empty(),
                settings.auction.at_once(settings.prefetch),
            ),
            times: Times::default(),
        }
    }

    /// Starts a new film; an earlier one is discarded.
    pub(super) fn begin(&mut self, work: &WorkRow) -> io::Result<()> {
        let (width, height) = self.film.picture_size();
        self.film = Film::new(self.film.rect(), self.layout.clone()).with_picture_size(width, height);
        self.store.as_mut().map_or(Ok(()), |store| store.put_work(work))
    }

    /// Records the row of a zone, and stores it if a resumed run needs it.
    pub(super) fn zone_changed(&mut self, row: &ZoneRow, now: Time) -> (io::Result<()>, Progress) {
        self.rows.insert(row.zone, row.clone());
        self.tally.see(now, row, self.samples_wanted, 0);
        let kept = if row.is_in_hand() { Ok(()) } else { self.keep(row) };
        (kept, self.tally.progress())
    }

    fn keep(&mut self, row: &ZoneRow) -> io::Result<()> {
        let Some(store) = &mut self.store else { return Ok(()) };
        let fresh = row.result.filter(|result| self.stored.get(&row.zone) != Some(&result.digest));
        let tile = fresh.and_then(|result| {
            let (id, tile) = self.tiles.get(&row.zone)?;
            (*id == result.digest).then_some(tile)
        });
        store.put_zone(row, tile)?;
        if let (Some(result), Some(_)) = (fresh, tile) {
            self.stored.insert(row.zone, result.digest);
        }
        Ok(())
    }

    /// Returns true if the tile of a result is here.
    pub(super) fn has(&self, zone: ZoneId, result: &ResultRef) -> bool {
        self.tiles.get(&zone).is_some_and(|(id, _)| *id == result.digest)
    }

    /// Returns a copy of the tile of a result, if it is here.
    pub(super) fn tile(&self, zone: ZoneId, result: &ResultRef) -> Option<Tile> {
        self.tiles.get(&zone).filter(|(id, _)| *id == result.digest).map(|(_, tile)| tile.clone())
    }

    /// Adds a tile from another machine, and stores it.
    pub(super) fn take_in(&mut self, zone: ZoneId, result: &ResultRef, tile: Tile) -> io::Result<()> {
        self.tiles.insert(zone, (result.digest, tile));
        let row = self.rows.get(&zone).filter(|row| row.result == Some(*result)).cloned();
        row.map_or(Ok(()), |row| self.keep(&row))
    }

    /// Removes the tile of a zone, with its digest, to add samples to it.
    pub(super) fn take(&mut self, zone: ZoneId) -> Option<(BlobId, Tile)> {
        self.tiles.remove(&zone)
    }

    /// Adds a tile that was painted here.
    pub(super) fn put(&mut self, zone: ZoneId, digest: BlobId, tile: Tile) {
        self.tiles.insert(zone, (digest, tile));
    }

    /// Stores a pass over a zone, so that an interruption only loses the next one. `None`: the zone is unknown.
    ///
    /// - `fence`: the token of the order under which it is painted.
    /// - `tile`: its samples so far, which the painter keeps.
    pub(super) fn pass_done(
        &mut self,
        zone: ZoneId,
        fence: Revision,
        samples: u32,
        tile: &Tile,
        now: Time,
    ) -> Option<(io::Result<()>, Progress)> {
        let row = self.rows.get(&zone)?;
        self.tally.see(now, row, self.samples_wanted, samples);
        let mut kept = Ok(());
        if let Some(store) = &mut self.store {
            let digest = digest(tile);
            let result = Some(ResultRef { fence, samples, digest });
            kept = store.put_zone(&ZoneRow { state: ZoneState::Profiled, result, ..row.clone() }, Some(tile));
            self.stored.insert(zone, digest);
        }
        Some((kept, self.tally.progress()))
    }

    /// Adds a zone to the film and drops its tile.
    pub(super) fn compose(&mut self, zone: ZoneId, result: &ResultRef, mask: &Mask) -> Result<(), String> {
        let (id, tile) = self.tiles.remove(&zone).ok_or("its pixels are not here")?;
        if id != result.digest {
            return Err("its tile is another one".to_owned());
        }
        if *tile.layout() != self.layout {
            return Err("its tile holds other values than the film".to_owned());
        }
        if !tile.sums().iter().all(|sum| sum.is_finite()) {
            return Err("its tile holds values that are not numbers".to_owned());
        }
        self.film.add_tile(&tile, |x, y| mask.weight(x, y));
        Ok(())
    }

    /// Adds all unfinished tiles to the film, each within the pixels of its own zone.
    pub(super) fn compose_unfinished(&mut self) {
        for (zone, (_, tile)) in std::mem::take(&mut self.tiles) {
            let rect = self.rows.get(&zone).map_or(tile.rect(), |row| row.rect);
            if *tile.layout() == self.layout && tile.sums().iter().all(|sum| sum.is_finite()) {
                let film = &self.film;
                let bare: Vec<bool> = rect.pixels().map(|(x, y)| !film.is_painted(x, y)).collect();
                let weight = |x, y| f32::from(u8::from(rect.contains(x, y) && bare[rect.index(x, y)]));
                self.film.add_tile(&tile, weight);
            }
        }
    }

    /// Returns true if each zone has samples.
    pub(super) fn has_all(&self) -> bool {
        !self.rows.is_empty() && self.rows.values().all(|row| row.samples_done() > 0)
    }

    /// Fills pixels without samples from the survey. Returns `true` if each pixel has a value then.
    pub(super) fn fill(&mut self, look: Option<&Survey>) -> bool {
        let (Rect { x0, y0, x1, y1 }, (width, height)) = (self.film.rect(), self.film.picture_size());
        let cell = |place: u32, size: u32, cells: u32| u64::from(place) * u64::from(cells) / u64::from(size.max(1));
        for y in y0..y1 {
            let bare: Vec<u32> = (x0..x1).filter(|&x| !self.film.is_painted(x, y)).collect();
            if bare.is_empty() {
                continue;
            }
            let Some(look) = look.filter(|look| !look.pixels.is_empty()) else { return false };
            let mut row = Tile::new(Rect::new(x0, y, x1, y + 1), self.layout.clone());
            for &x in &bare {
                let at = cell(y, height, look.height) * u64::from(look.width) + cell(x, width, look.width);
                let seen = &look.pixels[at as usize];
                let alpha = if seen.depth > 0.0 { 1.0 } else { 0.0 };
                let SurveyPixel { color: radiance, albedo, depth, .. } = *seen;
                row.add(x, y, &SampleValues { radiance, alpha, albedo, depth, ..SampleValues::default() });
            }
            self.film.add_tile(&row, |x, _| f32::from(u8::from(bare.binary_search(&x).is_ok())));
        }
        true
    }

    /// Adds to the time spent on composition.
    pub(super) fn composition_took(&mut self, time: Duration) {
        self.times.composition += time;
    }

    /// Adds to the processor time spent on painting.
    pub(super) fn painting_took(&mut self, time: Duration) {
        self.times.painting += time;
    }

    /// Returns the times recorded here.
    pub(super) fn times(&self) -> Times {
        self.times
    }

    /// Returns the samples per pixel that the user requested.
    pub(super) fn samples_wanted(&self) -> u32 {
        self.samples_wanted
    }

    /// Records the speed of an agent.
    pub(super) fn agent_changed(&mut self, row: &AgentRow) {
        self.tally.see_agent(row);
    }

    /// Returns the last rows of all zones, by id.
    pub(super) fn rows(&self) -> Vec<ZoneRow> {
        self.rows.values().cloned().collect()
    }

    /// Removes and returns the film.
    pub(super) fn take_film(&mut self) -> Film {
        let nothing = Film::new(Default::default(), self.layout.clone());
        std::mem::replace(&mut self.film, nothing)
    }
}
