//! The layers of a job while it is rendered, from what the farm stores, so they do not depend on the leader.

use std::sync::{Mutex, PoisonError};

use bottega_image::{Film, Rect};

use crate::{
    error::Error,
    job::{
        board::JobBoard,
        record::Job,
        zone_pixels::{ZonePixels, around},
    },
};

/// The pixels of a job's finished zones, all layers. Neighbours are not blended, as they are in the finished picture where
/// rules let zones differ.
#[derive(Debug, Default)]
pub struct JobFilm {
    /// The painting whose pixels these are.
    work: u64,
    frame: Option<Rect>,
    film: Option<Film>,
    fetched: ZonePixels,
}

impl JobFilm {
    /// Fetches the pixels of the zones finished since the last call, at most 256; the others follow at the next calls. Returns
    /// the film of all zones fetched so far; `None`: there are none.
    ///
    /// # Errors
    /// The farm does not deliver the rows of the zones within 10 s.
    pub fn renew(&mut self, board: &JobBoard, job: &Job) -> Result<Option<&Film>, Error> {
        let rows = board.zone_rows(job)?;
        let frame = rows.iter().map(|row| row.rect).reduce(around);
        if self.work != job.work || self.frame != frame {
            *self = Self { work: job.work, frame, ..Self::default() };
        }
        if let Some(frame) = frame {
            let film = Mutex::new(self.film.take());
            let fetched = self.fetched.fetch_new(board, job, &rows, &|tile| {
                let mut film = film.lock().unwrap_or_else(PoisonError::into_inner);
                film.get_or_insert_with(|| Film::new(frame, tile.layout().clone())).replace_tile(tile);
            });
            self.film = film.into_inner().unwrap_or_else(PoisonError::into_inner);
            fetched?;
        }
        Ok(self.film.as_ref())
    }
}
