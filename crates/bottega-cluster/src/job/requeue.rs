//! Zones that a user wants painted again.
//!
//! - `requeue/N/ZONE`: the request to paint a zone of job N again, with the token of the samples to discard. The leader of
//!   the job passes it to its Master until the zone's row shows that it is done.

use std::collections::BTreeMap;

use bottega::events::Event;
use bottega_agents::Revision;
use bottega_farm::{MasterHandle, ZoneId, ZoneRow, ZoneState};
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    job::{
        board::{JobBoard, no_such},
        record::JobState,
    },
};

/// The notice that requests a zone again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct WantedZone {
    /// The token of the samples to discard; none: the zone has failed.
    fence: Option<u64>,
}

/// The zones of a job that are done or have failed, as its leader sees them.
#[derive(Debug, Default)]
pub(crate) struct SettledZones(BTreeMap<ZoneId, Option<Revision>>);

impl SettledZones {
    /// Records the row of a zone.
    pub(crate) fn see(&mut self, row: &ZoneRow) {
        match row.state {
            ZoneState::Done => _ = self.0.insert(row.zone, row.result.map(|result| result.fence)),
            ZoneState::Failed => _ = self.0.insert(row.zone, None),
            _ => _ = self.0.remove(&row.zone),
        }
    }

    /// Returns true if a zone is still as it was when it was requested again.
    fn is_as(&self, zone: ZoneId, wanted: WantedZone) -> bool {
        self.0.get(&zone).is_some_and(|fence| fence.map(|fence| fence.0) == wanted.fence)
    }
}

impl JobBoard {
    /// Requests that a finished or failed zone is painted again. If the job is over, its zones are no longer stored: the whole
    /// picture is rendered again, and the stored picture stays until that is done.
    ///
    /// - `by`: the name of the user, for the log.
    ///
    /// # Errors
    /// There is no such job or zone, the zone is not finished, the farm does not store the picture or does not answer, or this
    /// machine is a guest.
    pub fn requeue(&self, number: u32, zone: u32, by: &str) -> Result<(), Error> {
        let job = self.get(number).ok_or_else(|| no_such(number))?;
        if !job.state.is_over() {
            let rows = self.zone_rows(&job)?;
            let row = rows.iter().find(|row| row.zone == ZoneId(zone)).ok_or_else(|| no_zone(number, zone))?;
            let fence = match (row.state, row.result) {
                (ZoneState::Done, Some(result)) => Some(result.fence.0),
                (ZoneState::Failed, _) => None,
                _ => return Err(Error::failed(format!("zone {zone} is not done yet"), "it will be painted")),
            };
            self.refuse_guests()?;
            self.put_notice(&name_of(number, ZoneId(zone)), &WantedZone { fence })?;
            self.log(number, &format!("{by} wants zone {zone} painted again"));
            return Ok(());
        }
        let is_there = |event: &Event| matches!(event, Event::Zone(row) if row.id == zone);
        // A cancelled painting has stored no rows: these are those of the one before.
        let rows = self.rows(&job)?;
        if !rows.is_empty() && !rows.iter().any(is_there) {
            return Err(no_zone(number, zone));
        }
        if !job.kept && !matches!(job.state, JobState::Failed { .. }) {
            let problem = format!("job {number} is {}, and the farm does not have its picture", job.state.word());
            return Err(Error::failed(problem, "submit the picture again"));
        }
        self.change(number, |now| {
            // Another user may have requested it at the same moment.
            let is_as_before = now.turn() == job.turn() && now.state.is_over();
            if is_as_before {
                now.say(format!(
                    "{by} wants zone {zone} painted again: all zones are painted again, because the farm keeps no zones of a finished job"
                ));
                now.paint_again();
            }
            is_as_before
        })?;
        self.forget_painting(&job);
        Ok(())
    }

    /// Passes the requested zones to the Master of a job. Requests that are done or outdated are deleted.
    pub(crate) fn hand_on_requeues(&self, number: u32, zones: &SettledZones, master: &MasterHandle) {
        for notice in self.uplink.notices().all(&prefix(number)) {
            let zone = notice.name.rsplit('/').next().and_then(|zone| zone.parse().ok()).map(ZoneId);
            let wanted = serde_json::from_slice::<WantedZone>(&notice.text).ok();
            match (zone, wanted) {
                (Some(zone), Some(wanted)) if zones.is_as(zone, wanted) => {
                    master.requeue(zone, wanted.fence.map(Revision));
                }
                _ => self.forget_notice(&notice.name),
            }
        }
    }

    /// Deletes all requests for zones of a job.
    pub(crate) fn forget_requeues(&self, number: u32) {
        self.uplink.notices().all(&prefix(number)).iter().for_each(|notice| self.forget_notice(&notice.name));
    }

    fn forget_notice(&self, name: &str) {
        if let Err(error) = self.uplink.notices().remove(name) {
            tracing::debug!(%error, name, "the farm does not answer");
        }
    }
}

fn no_zone(number: u32, zone: u32) -> Error {
    Error::failed(format!("job {number} has no zone {zone}"), "its Blackboard lists its zones")
}

fn prefix(number: u32) -> String {
    format!("requeue/{number}/")
}

fn name_of(number: u32, zone: ZoneId) -> String {
    format!("{}{}", prefix(number), zone.0)
}
