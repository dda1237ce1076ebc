//! Submission: reserves room, fills an inlet, and wakes a resource if one waits.

use std::time::Duration;

use super::clients::ClientId;
use super::results_bin::ResultsBin;
use super::shared::{AllocatorState, UnitPayload};
use crate::policy::cable::CableBytes;
use crate::policy::time::Time;
use crate::policy::unit::{Chunk, Data, Meta, Unit};
use crate::{Closed, Primitive, SubmitError, TrySubmit, Work, WorkUnit};

/// Items by primitive.
type Items = [u64; Primitive::COUNT];

/// A client's side of the work bin: takes places in the bin and puts units into the client's inlet.
pub(crate) struct Submitter<'a, O> {
    pub(crate) client: ClientId,
    pub(crate) results: &'a ResultsBin<O>,
    /// The index of the client's inlet.
    pub(crate) inlet: usize,
    /// Added to the priority of each unit.
    pub(crate) priority: i32,
}

impl<W: Work> AllocatorState<W> {
    pub(crate) fn submit(&self, from: &Submitter<'_, W::Output>, unit: WorkUnit<W>) -> Result<(), SubmitError> {
        self.look_at(&unit.work)?;
        // Announce the unit before it can be answered, so that a clone of the client waits for it
        from.results.expect(1);
        while self.room.reserve(1) == 0 {
            if self.room.is_closed() {
                from.results.forget(1);
                return Err(Closed.into());
            }
            self.room.wait();
        }
        self.put(from, unit);
        self.room.let_in(1); // Pass unused room on to the next submitter.
        Ok(())
    }

    pub(crate) fn submit_group(
        &self,
        from: &Submitter<'_, W::Output>,
        units: Vec<WorkUnit<W>>,
    ) -> Result<(), SubmitError> {
        units.iter().try_for_each(|unit| self.look_at(&unit.work))?;
        from.results.expect(units.len());
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
                self.put_all(from, units.by_ref().take(granted), !is_first);
            }
            is_first = false;
            if units.as_slice().is_empty() {
                self.room.let_in(1); // Pass unused room on to the next submitter.
                return Ok(());
            }
            if self.room.is_closed() {
                let items = items_of(units.as_slice());
                self.with_core(|core, _, _| each(&items, |primitive, items| core.retract(primitive, items)));
                from.results.forget(units.len());
                return Err(Closed.into());
            }
            self.room.wait();
        }
    }

    pub(crate) fn try_submit(&self, from: &Submitter<'_, W::Output>, unit: WorkUnit<W>) -> Result<(), TrySubmit<W>> {
        if let Err(reason) = self.look_at(&unit.work) {
            return Err(TrySubmit::Refused { unit, reason });
        }
        from.results.expect(1);
        if self.room.reserve(1) == 0 {
            from.results.forget(1);
            return Err(TrySubmit::Full(unit));
        }
        self.put(from, unit);
        Ok(())
    }

    /// Refuses unsupported work.
    fn look_at(&self, work: &W) -> Result<(), SubmitError> {
        if self.room.is_closed() {
            return Err(Closed.into());
        }
        let primitive = work.primitive();
        let bytes = data_of(work).map_or(0, |data| data.bytes);
        match self.can(primitive, bytes) {
            (true, true) => Ok(()),
            (true, false) => Err(SubmitError::TooLarge { primitive, bytes }),
            (false, _) => Err(SubmitError::Unsupported(primitive)),
        }
    }

    /// Puts a unit with reserved room into its inlet.
    fn put(&self, from: &Submitter<'_, W::Output>, unit: WorkUnit<W>) {
        let unit = self.write_down(from, self.now(), unit);
        let expires = unit.meta.expires;
        self.inlets.push(from.inlet, unit);
        self.tell_of_arrival(from, expires);
    }

    /// Puts units with reserved room into their inlet.
    fn put_all(
        &self,
        from: &Submitter<'_, W::Output>,
        units: impl ExactSizeIterator<Item = WorkUnit<W>>,
        announced: bool,
    ) {
        let now = self.now();
        let mut left = units.len();
        let mut first_expiry = Time::NEVER;
        let mut chunks: Vec<Chunk<UnitPayload<W>>> =
            Vec::with_capacity(left.div_ceil(Chunk::<UnitPayload<W>>::UNITS_MAX));
        for unit in units {
            let unit = self.write_down(from, now, unit);
            first_expiry = first_expiry.min(unit.meta.expires);
            match chunks.last_mut() {
                Some(last) if last.accepts(&unit.meta, announced) => last.push(unit),
                _ => chunks.push(Chunk::with_room(unit, announced, left)),
            }
            left -= 1;
        }
        self.inlets.push_all(from.inlet, chunks);
        self.tell_of_arrival(from, first_expiry);
    }

    /// Converts a unit to the policy's form.
    fn write_down(&self, from: &Submitter<'_, W::Output>, now: Time, unit: WorkUnit<W>) -> Unit<UnitPayload<W>> {
        let WorkUnit { work, ticket, max_delay, priority, validity } = unit;
        let meta = Meta {
            primitive: work.primitive(),
            size: work.size(),
            bytes: CableBytes { there: work.payload_bytes(), back: work.answer_bytes() },
            data: data_of(&work),
            priority: priority.saturating_add(from.priority),
            submitted: now,
            late: now.after(max_delay.min(self.max_delay_bound)),
            expires: now.after(validity),
            attempts: 0,
            failed_on: Vec::new(),
        };
        Unit { meta, load: UnitPayload { work: Some(work), client: from.client, ticket } }
    }

    fn tell_of_arrival(&self, from: &Submitter<'_, W::Output>, first_expiry: Time) {
        if from.results.is_over() {
            self.expire(from.client); // The life time may have ended before these units arrived.
        }
        self.announce_arrival();
        if first_expiry < Time::NEVER {
            self.alarm.set(first_expiry);
        }
    }
}

fn data_of<W: Work>(work: &W) -> Option<Data> {
    work.data().map(|id| Data { id, bytes: work.data_bytes() })
}

/// Returns the unit as submitted, unless a resource has it; its maximum delay bounded by the configuration.
pub(crate) fn into_unit<W: Work>(unit: Unit<UnitPayload<W>>) -> Option<WorkUnit<W>> {
    let Unit { meta, load: UnitPayload { work, ticket, .. } } = unit;
    let validity = if meta.expires < Time::NEVER { meta.expires.since(meta.submitted) } else { Duration::MAX };
    let max_delay = meta.late.since(meta.submitted);
    Some(WorkUnit { work: work?, ticket, max_delay, priority: meta.priority, validity })
}

fn items_of<W: Work>(units: &[WorkUnit<W>]) -> Items {
    units.iter().fold([0; Primitive::COUNT], |mut items, unit| {
        let sum = &mut items[unit.work.primitive().index()];
        *sum = sum.saturating_add(unit.work.size());
        items
    })
}

fn each(items: &Items, mut act: impl FnMut(Primitive, u64)) {
    Primitive::ALL.into_iter().filter(|primitive| items[primitive.index()] > 0).for_each(|primitive| {
        act(primitive, items[primitive.index()]);
    });
}
