//! Tiles of other machines: fetched when they are needed here, and stored.

use std::sync::Arc;

use super::shared::{End, Shared};
use crate::{ResultRef, ZoneId};

impl Shared {
    /// Calls `then` once a zone's tile is here: at once, or after fetching it from the machine that painted it.
    pub(super) fn with_tile(
        self: &Arc<Self>,
        zone: ZoneId,
        result: ResultRef,
        then: impl FnOnce(Result<(), String>) + Send + 'static,
    ) {
        let Some(link) = self.link.clone().filter(|_| !self.composer().has(zone, &result)) else { return then(Ok(())) };
        self.begin_outstanding();
        let shared = Arc::clone(self);
        let fetch = move || {
            let found = link.get(&result, &shared.stop).map(|tile| {
                let kept = shared.composer().take_in(zone, &result, tile);
                shared.tell_kept(kept);
            });
            then(found);
            shared.end_outstanding();
        };
        if let Err(error) = self.fetchers.begin(fetch) {
            self.end_outstanding();
            self.end(End::Abandoned(format!("cannot start a thread: {error}")));
        }
    }

    /// Reports that progress could not be stored.
    pub(super) fn tell_kept(&self, kept: std::io::Result<()>) {
        if let Err(error) = kept {
            tracing::warn!(%error, "cannot store the work");
            self.observer.store_failed(&error);
        }
    }
}
