//! The thread of a directly called resource: it takes a packet, does its units, and answers.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::settle::Attempt;
use super::shared::{AllocatorState, LaneEnd, UnitPayload};
use super::sync::lock;
use crate::policy::core::{DrawnPacket, Next};
use crate::policy::incident::Fault;
use crate::policy::unit::Unit;
use crate::{Failed, Resource, ResourceId, Work};

/// Time after which the rest of a packet goes back to the bin: it was planned for much less.
const PACKET_TIME_MAX: Duration = Duration::from_micros(500);
/// Maximum time per unit for which the clock is read once for several units: so many that reading it costs little, but
/// so few that slower units are soon noticed.
const STRETCHED_BELOW: Duration = Duration::from_micros(1);
const STRETCH_MAX: usize = 16;
/// Number of packets between queries of a resource's free memory.
const ASK_MEMORY_EVERY: u64 = 64;

/// Serves `resource` until the allocator is shut down or the resource is retired.
pub(crate) fn drive<W: Work>(shared: &Arc<AllocatorState<W>>, id: ResourceId, resource: &mut dyn Resource<W>) {
    let lane = &shared.lanes[id.index()];
    lane.post.man();
    let mut next = shared.with_core(|core, now, out| core.next(now, id, out));
    loop {
        next = match next {
            Next::Packet(packet) => serve(shared, id, resource, packet),
            Next::Recover(evicted) => {
                let outcome = recover(shared, id, || {
                    evicted.into_iter().for_each(|data| quietly(|| resource.evict(data)));
                    resource.recover()
                });
                shared.with_core(|core, now, out| {
                    core.recovered(now, id, outcome, out);
                    core.next(now, id, out)
                })
            }
            Next::Wait(until) => {
                lane.post.wait(until.map(|until| until.since(shared.now())));
                shared.with_core(|core, now, out| core.next(now, id, out))
            }
            Next::End => return,
        };
    }
}

/// Does a packet. Returns the next step.
fn serve<W: Work>(
    shared: &AllocatorState<W>,
    id: ResourceId,
    resource: &mut dyn Resource<W>,
    packet: DrawnPacket<UnitPayload<W>>,
) -> Next<UnitPayload<W>> {
    let DrawnPacket { sequence, mut units, evicted, deadline } = packet;
    let lane = &shared.lanes[id.index()];
    for data in evicted {
        quietly(|| resource.evict(data));
    }
    let works = take_works(&mut units);
    lock(&lane.ledger).enter(sequence, units);
    shared.alarm.set(deadline);
    let sent = shared.now();
    let (attempts, busy) = perform(resource, works);
    // Settled before: the packet took so long that its units were given to others
    let Some(units) = lock(&lane.ledger).settle(sequence) else {
        drop(attempts);
        shared.set_end(id, LaneEnd::AtWork);
        return shared.with_core(|core, now, out| {
            core.landed(now, id, sequence, crate::policy::core::PacketLanding::default(), out);
            core.next(now, id, out)
        });
    };
    let mut settled = shared.sort(id, units, attempts, sent);
    settled.landing.busy = Some(busy);
    let ran_out = matches!(settled.landing.fault, Some((Fault::OutOfMemory, _)));
    let memory_free = if ran_out || sequence % ASK_MEMORY_EVERY == 0 {
        catch_unwind(AssertUnwindSafe(|| resource.memory_free())).unwrap_or(None)
    } else {
        None
    };
    let (landed, next) = shared.land(id, sequence, settled, |core, now, out| {
        if let Some(bytes) = memory_free {
            core.set_memory_free(id, bytes);
        }
        core.next(now, id, out)
    });
    for data in landed.into_iter().flat_map(|landed| landed.evicted) {
        quietly(|| resource.evict(data));
    }
    next
}

/// Does works one after the other, up to the first failure. Returns each attempt with its time, and the total time.
fn perform<W: Work>(resource: &mut dyn Resource<W>, works: Vec<W>) -> (Vec<(Attempt<W>, Duration)>, Duration) {
    let mut attempts = Vec::with_capacity(works.len());
    let started = Instant::now();
    let (mut before, mut stretch, mut stop) = (started, 1, false);
    let mut timed = 0;
    let mut works = works.into_iter();
    while !stop && let Some(work) = works.next() {
        let attempt = match catch_unwind(AssertUnwindSafe(|| resource.perform(work))) {
            Ok(Ok(output)) => Attempt::Done(output),
            Ok(Err(Failed { work, reason })) => {
                let out_of_memory = catch_unwind(AssertUnwindSafe(|| resource.is_out_of_memory()));
                let fault = if matches!(out_of_memory, Ok(true)) { Fault::OutOfMemory } else { Fault::Refused };
                Attempt::Failed { fault, reason, work: Some(work) }
            }
            Err(panic) => Attempt::Failed { fault: Fault::Died, reason: panic_message(&*panic), work: None },
        };
        stop = !matches!(attempt, Attempt::Done(_));
        attempts.push((attempt, Duration::ZERO));
        if stop || attempts.len() - timed >= stretch || works.len() == 0 {
            let now = Instant::now();
            let each = (now - before) / (attempts.len() - timed) as u32;
            attempts[timed..].iter_mut().for_each(|(_, busy)| *busy = each);
            stretch = if each < STRETCHED_BELOW { (2 * stretch).min(STRETCH_MAX) } else { 1 };
            stop |= now - started > PACKET_TIME_MAX;
            (before, timed) = (now, attempts.len());
        }
    }
    attempts.extend(works.map(|work| (Attempt::Untouched(work), Duration::ZERO)));
    (attempts, before - started)
}

/// Takes the works out, to move them to the resource; their backups stay.
pub(crate) fn take_works<W: Work>(units: &mut [Unit<UnitPayload<W>>]) -> Vec<W> {
    let take = |unit: &mut Unit<UnitPayload<W>>| {
        let work = unit.load.work.take()?;
        unit.load.work = catch_unwind(AssertUnwindSafe(|| work.backup())).unwrap_or(None);
        Some(work)
    };
    let mut works = Vec::with_capacity(units.len());
    works.extend(units.iter_mut().filter_map(take));
    works
}

/// Asks a resource to recover; a panic counts as a failure. Shutdown does not wait for the thread meanwhile, nor after
/// a failure.
pub(crate) fn recover<W: Work>(
    shared: &AllocatorState<W>,
    id: ResourceId,
    recover: impl FnOnce() -> Result<(), String>,
) -> Result<(), String> {
    shared.set_end(id, LaneEnd::Over);
    let outcome = catch_unwind(AssertUnwindSafe(recover)).unwrap_or_else(|panic| Err(panic_message(&*panic)));
    if outcome.is_ok() {
        shared.set_end(id, LaneEnd::AtWork);
    }
    outcome
}

/// Calls a function and swallows its panic, so that the thread continues.
pub(crate) fn quietly(call: impl FnOnce()) {
    let _ = catch_unwind(AssertUnwindSafe(call));
}

fn panic_message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("panicked: {}", text.unwrap_or("(no message)"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Primitive, VirtualCpu};

    /// Lasts at least so long.
    struct SleepFor(Duration);

    impl Work for SleepFor {
        type Output = ();
        fn primitive(&self) -> Primitive {
            Primitive::PixelBlock
        }
        fn size(&self) -> u64 {
            1
        }
    }

    fn naps(micros: impl Iterator<Item = u64>) -> (Vec<(Attempt<SleepFor>, Duration)>, Duration) {
        let mut lanes = VirtualCpu::lanes(1, |nap: SleepFor| {
            let start = Instant::now();
            while start.elapsed() < nap.0 {}
        });
        perform(&mut *lanes[0], micros.map(|micros| SleepFor(Duration::from_micros(micros))).collect())
    }

    #[test]
    fn the_time_of_a_packet_is_that_of_its_units_and_long_ones_have_their_own() {
        let (attempts, busy) = naps([0; 100].into_iter().chain([50, 0, 0]));
        assert_eq!(attempts.len(), 103);
        let times: Vec<_> = attempts.iter().map(|(_, busy)| *busy).collect();
        let sum: Duration = times.iter().sum();
        assert!(busy.abs_diff(sum) < Duration::from_nanos(103), "{busy:?} and {sum:?} differ by more than rounding");
        assert!(sum >= Duration::from_micros(50));
        let (attempts, _) = naps([60, 60, 0].into_iter());
        assert!(attempts[..2].iter().all(|(_, busy)| *busy >= Duration::from_micros(60)), "long ones are timed alone");
    }

    #[test]
    fn a_packet_that_takes_too_long_comes_back_with_what_is_left_of_it() {
        let (attempts, _) = naps([600; 3].into_iter());
        let done: Vec<_> = attempts.iter().map(|(attempt, _)| matches!(attempt, Attempt::Done(()))).collect();
        assert_eq!(done, [true, false, false]);
    }
}
