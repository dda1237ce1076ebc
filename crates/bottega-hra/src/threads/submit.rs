//! The submitter's side: a place in the bin, an inlet, and somebody woken if somebody waits.

use std::sync::Arc;
use std::time::Duration;

use super::results_bin::ResultsBin;
use super::shared::{Job, Shared, Tag};
use crate::policy::time::Time;
use crate::policy::unit::{Data, Meta, Unit};
use crate::{Closed, Primitive, SubmitError, TrySubmit, Work, WorkUnit};

/// Items by primitive.
type Items = [u64; Primitive::COUNT];

impl<W: Work> Shared<W> {
    pub(crate) fn submit(
        &self,
        client: &Arc<ResultsBin<W::Output>>,
        inlet: usize,
        unit: WorkUnit<W>,
    ) -> Result<(), SubmitError> {
        let unit = self.admit(client, unit).map_err(|(_, error)| error)?;
        // Announced before it can be answered, so that a clone of the client that takes meanwhile waits for it.
        client.expect(1);
        while self.room.reserve(1) == 0 {
            if self.room.is_closed() {
                client.forget(1);
                return Err(Closed.into());
            }
            self.room.wait();
        }
        self.put(inlet, std::iter::once(unit), false);
        self.room.let_in(1); // Room that this caller did not need is the next one's.
        Ok(())
    }

    pub(crate) fn submit_group(
        &self,
        client: &Arc<ResultsBin<W::Output>>,
        inlet: usize,
        units: Vec<WorkUnit<W>>,
    ) -> Result<(), SubmitError> {
        let admitted: Result<Vec<_>, _> = units.into_iter().map(|unit| self.admit(client, unit)).collect();
        let units = admitted.map_err(|(_, error)| error)?;
        client.expect(units.len());
        let mut units = units.into_iter();
        let mut is_first = true;
        loop {
            let granted = self.room.reserve(units.len());
            let rest = &units.as_slice()[granted..];
            if is_first && !rest.is_empty() {
                let items = items_of(rest);
                self.with_core(|core, _, _| each(&items, |primitive, items| core.announce(primitive, items)));
            }
            if granted > 0 {
                self.put(inlet, units.by_ref().take(granted), !is_first);
            }
            is_first = false;
            if units.as_slice().is_empty() {
                self.room.let_in(1); // Room that this caller did not need is the next one's.
                return Ok(());
            }
            if self.room.is_closed() {
                let items = items_of(units.as_slice());
                self.with_core(|core, _, _| each(&items, |primitive, items| core.retract(primitive, items)));
                client.forget(units.len());
                return Err(Closed.into());
            }
            self.room.wait();
        }
    }

    pub(crate) fn try_submit(
        &self,
        client: &Arc<ResultsBin<W::Output>>,
        inlet: usize,
        unit: WorkUnit<W>,
    ) -> Result<(), TrySubmit<W>> {
        let unit = self.admit(client, unit).map_err(|(unit, reason)| TrySubmit::Refused { unit, reason })?;
        client.expect(1);
        if self.room.reserve(1) == 0 {
            client.forget(1);
            return Err(TrySubmit::Full(into_unit(unit)));
        }
        self.put(inlet, std::iter::once(unit), false);
        Ok(())
    }

    /// Writes down what the policy must know of a unit; refuses what nobody can do.
    fn admit(
        &self,
        client: &Arc<ResultsBin<W::Output>>,
        unit: WorkUnit<W>,
    ) -> Result<Unit<Job<W>>, (WorkUnit<W>, SubmitError)> {
        let work = &unit.work;
        let (primitive, size) = (work.primitive(), work.size());
        let data = work.data().map(|id| Data { id, bytes: work.data_bytes() });
        let bytes = data.map_or(0, |data| data.bytes);
        if self.room.is_closed() {
            return Err((unit, Closed.into()));
        }
        match self.can(primitive, bytes) {
            (true, true) => {}
            (true, false) => return Err((unit, SubmitError::TooLarge { primitive, bytes })),
            (false, _) => return Err((unit, SubmitError::Unsupported(primitive))),
        }
        let WorkUnit { work, ticket, max_delay, priority, validity } = unit;
        let meta = Meta {
            primitive,
            size,
            data,
            priority,
            submitted: Time::ZERO,
            late: Time::ZERO,
            expires: Time::NEVER,
            attempts: 0,
            failed_on: Vec::new(),
        };
        let tag = Tag { client: Arc::clone(client), ticket, max_delay, validity };
        Ok(Unit { meta, load: Job { work, tag } })
    }

    /// Puts units for which there is a place into the bin.
    fn put(&self, inlet: usize, units: impl Iterator<Item = Unit<Job<W>>>, announced: bool) {
        let now = self.now();
        let mut first_expiry = Time::NEVER;
        let stamped = units.map(|mut unit| {
            let (max_delay, validity) = (unit.load.tag.max_delay, unit.load.tag.validity);
            unit.meta.submitted = now;
            unit.meta.late = now.after(max_delay.min(self.max_delay_bound));
            if validity < Duration::MAX {
                unit.meta.expires = now.after(validity);
                first_expiry = first_expiry.min(unit.meta.expires);
            }
            unit
        });
        self.inlets.push(inlet, stamped, announced);
        self.announce_arrival();
        if first_expiry < Time::NEVER {
            self.alarm.set(first_expiry);
        }
    }
}

/// What the client submitted.
pub(crate) fn into_unit<W: Work>(unit: Unit<Job<W>>) -> WorkUnit<W> {
    let Unit { meta, load: Job { work, tag: Tag { ticket, max_delay, validity, .. } } } = unit;
    WorkUnit { work, ticket, max_delay, priority: meta.priority, validity }
}

fn items_of<T>(units: &[Unit<T>]) -> Items {
    units.iter().fold([0; Primitive::COUNT], |mut items, unit| {
        let sum = &mut items[unit.meta.primitive.index()];
        *sum = sum.saturating_add(unit.meta.size);
        items
    })
}

fn each(items: &Items, mut act: impl FnMut(Primitive, u64)) {
    Primitive::ALL.into_iter().filter(|primitive| items[primitive.index()] > 0).for_each(|primitive| {
        act(primitive, items[primitive.index()]);
    });
}
