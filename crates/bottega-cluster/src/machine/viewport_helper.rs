//! A free machine that renders samples for somebody's viewport.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use bottega::viewport::{ViewportSampler, ViewportSamples};
use bottega_scene::{LoadOptions, Scene};

use crate::{
    build::build,
    error::Error,
    files::cache::Cache,
    job::presence::Presence,
    machine::{member::Member, prepared_job::WorkerDevices},
    names::host_name,
    server::patience::meanwhile,
    viewport::{
        call::{CalledLook, HELPER_SAMPLES, HelperNotice, PLACES_MAX, ViewportCall, frames_channel},
        calls::HeardCalls,
        frame::{encode_frame, encode_notice, frame_bytes},
    },
};

/// Target times of the first step and of the longest ones. When a machine dies, its last step is lost.
const STEP_TIME: Duration = Duration::from_millis(250);
const STEP_TIME_MAX: Duration = Duration::from_secs(2);
/// Share of the time since a look began that a step takes: few samples per step cost more time each, and a view that is fine
/// already changes little by a frame.
const STEP_SHARE: f64 = 0.3;
/// Interval of checks whether the machine is still free.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Longest time to wait for a call.
const CALL_WAIT: Duration = Duration::from_millis(500);
/// Head start of the owner's process on the same computer: its first pixels come first.
const HEAD_START: Duration = Duration::from_millis(150);

/// A machine that helps a viewport.
pub(crate) struct ViewportHelper<'a> {
    pub(crate) member: &'a Member,
    pub(crate) cache: &'a Cache,
    pub(crate) own: &'a WorkerDevices,
    pub(crate) calls: &'a HeardCalls,
    /// The number of the viewport.
    pub(crate) viewport: u64,
}

/// The prepared scene of a viewport, and its state.
struct PreparedView {
    state: u64,
    scene: Arc<Scene>,
    /// The look that `sampler` is prepared for.
    look: u64,
    sampler: ViewportSampler,
}

/// The samples of the current look.
struct LookProgress {
    look: Option<u64>,
    begun: Instant,
    done: u32,
    /// Number of samples of the next step.
    step: u32,
}

impl ViewportHelper<'_> {
    /// Renders samples until the viewport is closed, or `is_wanted_elsewhere` returns true.
    ///
    /// # Errors
    /// This machine cannot render the scene. The owner knows.
    pub(crate) fn help(&self, is_wanted_elsewhere: &(dyn Fn() -> bool + Sync)) -> Result<(), Error> {
        let Member { board, activity, .. } = self.member;
        let viewing = activity.view();
        let attend = || board.attend(&Presence { takes_orders: true, ..self.member.presence(None) });
        attend();
        let is_called_away = AtomicBool::new(false);
        let mut ticks = 0_u32;
        let watch = || {
            ticks += 1;
            if ticks.is_multiple_of(10) {
                attend();
            }
            if is_wanted_elsewhere() {
                is_called_away.store(true, Ordering::Relaxed);
                self.calls.leave();
            }
        };
        let is_free = || !is_called_away.load(Ordering::Relaxed);
        let helped = meanwhile(LOOK_EVERY, watch, || self.follow(&is_free));
        drop(viewing);
        let refuses = helped.as_ref().err().map(Error::error_chain_with_remedy);
        self.tell(HelperNotice { refuses, leaves: true, ..HelperNotice::default() });
        helped
    }

    /// Follows the calls of the viewport.
    fn follow(&self, is_free: &dyn Fn() -> bool) -> Result<(), Error> {
        let mut prepared: Option<PreparedView> = None;
        let mut progress = LookProgress { look: None, begun: Instant::now(), done: 0, step: 1 };
        while is_free() {
            let Some(call) = self.calls.get(self.viewport) else { return Ok(()) };
            if call.version != build().identity() {
                return Err(other_build());
            }
            let (Some(look), Some(&place)) = (&call.look, call.places.get(&self.member.name)) else {
                if call.look.is_some() {
                    self.tell(HelperNotice::default());
                } else if !call.is_moving && self.calls.open().is_some() {
                    // This viewport has all its samples, and another one does not.
                    return Ok(());
                }
                self.calls.wait(self.viewport, &call, CALL_WAIT);
                continue;
            };
            if self.calls.is_needed_elsewhere(&call, &self.member.name) {
                return Ok(());
            }
            // Prepare the scene, or only the look
            if prepared.as_ref().is_none_or(|open| (open.state, open.look) != (look.state, look.number)) {
                prepared = self.prepare(prepared.take(), look)?;
            }
            let Some(PreparedView { sampler, .. }) = &prepared else { continue };
            if progress.look != Some(look.number) {
                progress = LookProgress { look: Some(look.number), begun: Instant::now(), done: 0, step: 1 };
                if call.host == host_name() {
                    thread::sleep(HEAD_START);
                }
            }
            let most = look.request.goal.samples.unwrap_or(1).min(HELPER_SAMPLES);
            if progress.done >= most {
                self.calls.wait(self.viewport, &call, CALL_WAIT);
                continue;
            }
            // Render a step, and send it
            let first = place.min(PLACES_MAX) * HELPER_SAMPLES + progress.done;
            let count = progress.step.min(most - progress.done);
            let end = sampler.end()?;
            if !self.calls.begin(self.viewport, look.number, &end) {
                continue;
            }
            let begun = Instant::now();
            if let Some(samples) = sampler.render(look.number, first..first + count, &end)? {
                let took = begun.elapsed();
                self.send(&call, &samples);
                progress.done += count;
                let target = step_time(progress.begun.elapsed()).max(sending_time(&call, &samples));
                progress.step = next_step(count, took, target);
            } else {
                tracing::debug!(look = look.number, "the renderer has dropped the step");
            }
        }
        Ok(())
    }

    /// Prepares a look. `None`: the farm does not have its scene any more; the owner will send it again.
    fn prepare(&self, before: Option<PreparedView>, look: &CalledLook) -> Result<Option<PreparedView>, Error> {
        let CalledLook { number, request, camera, state, .. } = look;
        let mut request = request.clone();
        self.own.apply(&mut request);
        if let Some(PreparedView { scene, sampler, .. }) = before.filter(|before| before.state == *state) {
            let sampler = sampler.look(&request, camera.clone())?;
            return Ok(Some(PreparedView { state: *state, scene, look: *number, sampler }));
        }
        let (file, _) = match look.scene.fetch(self.cache, self.member.board.uplink.blobs()) {
            Ok(fetched) => fetched,
            Err(error) => {
                tracing::debug!(%error, "the scene of a viewport is missing");
                self.tell(HelperNotice { lacks_scene: true, ..HelperNotice::default() });
                thread::sleep(CALL_WAIT);
                return Ok(None);
            }
        };
        let options = LoadOptions { allow_outside: false, ..LoadOptions::default() };
        let loaded = bottega_scene::load(&file, &options).map_err(bottega::Error::from)?;
        let scene = Arc::new(loaded.scene);
        let sampler = ViewportSampler::open(&request, Arc::clone(&scene), camera.clone())?;
        Ok(Some(PreparedView { state: *state, scene, look: *number, sampler }))
    }

    fn send(&self, call: &ViewportCall, samples: &ViewportSamples) {
        let channel = frames_channel(call.viewport);
        for band in encode_frame(&self.member.name, samples) {
            self.member.board.uplink.live().send(&channel, band);
        }
    }

    fn tell(&self, notice: HelperNotice) {
        let notice = HelperNotice { name: self.member.name.clone(), ..notice };
        self.member.board.uplink.live().send(&frames_channel(self.viewport), encode_notice(&notice));
    }
}

/// Returns the time that a step should take.
///
/// - `since`: time since the look began.
fn step_time(since: Duration) -> Duration {
    since.mul_f64(STEP_SHARE).clamp(STEP_TIME, STEP_TIME_MAX)
}

/// Returns the time that sending a frame takes within the bandwidth.
fn sending_time(call: &ViewportCall, samples: &ViewportSamples) -> Duration {
    Duration::from_secs_f64(frame_bytes(&samples.rect) as f64 / call.bytes_per_second.max(1) as f64)
}

/// Returns the number of samples of the next step.
fn next_step(count: u32, took: Duration, target: Duration) -> u32 {
    let fitting = f64::from(count) * target.as_secs_f64() / took.as_secs_f64().max(1e-6);
    (fitting as u32).clamp(1, 4 * count)
}

/// Returns the error for a viewport of another build.
fn other_build() -> Error {
    Error::failed(
        format!("the viewport belongs to another build than this machine's, {}", build().description()),
        "install the same version on all machines: only the same build renders samples of the same picture",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_grow_until_they_take_their_time() {
        let seconds = Duration::from_secs_f64;
        assert_eq!(next_step(1, seconds(0.001), STEP_TIME), 4, "by a factor of four");
        assert_eq!(next_step(8, seconds(0.5), STEP_TIME), 4);
        assert_eq!(next_step(1, seconds(9.0), STEP_TIME), 1);
        let times = [0.0, 2.0, 60.0].map(|since| step_time(seconds(since)));
        assert_eq!(times, [STEP_TIME, seconds(0.6), STEP_TIME_MAX]);
    }
}
