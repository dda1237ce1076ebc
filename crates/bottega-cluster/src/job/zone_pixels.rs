//! The pixels of a job's zones, fetched from the farm as they are painted.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

use bottega_agents::BlobId;
use bottega_farm::{ResultRef, StopSwitch, WorkId, ZoneId, ZoneRow};
use bottega_image::{Rect, Tile};

use crate::{
    error::Error,
    files::chunks::several,
    job::{board::JobBoard, record::Job, transport::job_link},
};

/// The most zones whose pixels are fetched at once; the others follow at the next call.
const ZONES_AT_A_TIME: usize = 256;

/// The zones whose pixels were fetched.
#[derive(Debug, Default)]
pub(crate) struct ZonePixels(BTreeMap<ZoneId, BlobId>);

impl ZonePixels {
    /// Fetches the pixels that are new since the last call. Returns `true` if there are any.
    ///
    /// - `rows`: the zones of the job.
    /// - `take`: gets the pixels of a zone; called by several threads.
    ///
    /// # Errors
    /// The farm does not answer.
    pub(crate) fn fetch_new(
        &mut self,
        board: &JobBoard,
        job: &Job,
        rows: &[Arc<ZoneRow>],
        take: &(dyn Fn(&Tile) + Sync),
    ) -> Result<bool, Error> {
        let is_new = |zone: &ZoneId, result: &ResultRef| self.0.get(zone) != Some(&result.digest);
        let results = rows.iter().filter_map(|row| Some((row.zone, row.result?)));
        let new_results: Vec<(ZoneId, ResultRef)> =
            results.filter(|(zone, result)| is_new(zone, result)).take(ZONES_AT_A_TIME).collect();
        let link = job_link(board.uplink.clone(), WorkId(job.work), None, String::new());
        // Do not wait for a server that does not answer.
        let impatient = StopSwitch::new();
        impatient.request();
        let fetched = Mutex::new(Vec::new());
        several(new_results.len(), &|i| {
            let (zone, result) = &new_results[i];
            // Its zone may be rendered again right now; then it comes at the next call.
            if let Ok(tile) = link.get(result, &impatient) {
                take(&tile);
                fetched.lock().unwrap_or_else(PoisonError::into_inner).push((*zone, result.digest));
            }
            Ok(())
        })?;
        let fetched = fetched.into_inner().unwrap_or_else(PoisonError::into_inner);
        let is_new = !fetched.is_empty();
        self.0.extend(fetched);
        Ok(is_new)
    }
}

/// Returns the smallest rectangle around two.
pub(crate) fn around(a: Rect, b: Rect) -> Rect {
    Rect::new(a.x0.min(b.x0), a.y0.min(b.y0), a.x1.max(b.x1), a.y1.max(b.y1))
}
