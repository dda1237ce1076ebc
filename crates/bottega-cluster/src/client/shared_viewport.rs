//! A viewport of this process whose samples come from the free machines of a farm, too.

use std::{
    collections::BTreeMap,
    mem,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak,
        mpsc::{self, Receiver, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

use bottega::{
    StopSwitch,
    scene::Scene,
    session::Reporter,
    viewport::{Viewport, ViewportFollower, ViewportLook},
};
use bottega_agents::driver::nats::{LIVE_BYTES_MAX, LiveSubscription};
use bottega_scene::{RenderHints, save_scene};
use schemars::JsonSchema;
use serde::Serialize;

use crate::{
    build::build,
    client::transfer::{self, SentPieces},
    error::Error,
    files::sent_files::SentFiles,
    job::board::JobBoard,
    names::{fresh_number, host_name},
    viewport::{
        call::{CALL_EVERY, CALLS, CalledLook, HelperNotice, ViewportCall, frames_channel},
        frame::{FrameBand, HelperMessage, decode},
    },
};

/// The most bytes per second that all helpers of a viewport send together.
const BYTES_PER_SECOND: u64 = 48 << 20;
/// The most bytes per second of one helper.
const HELPER_BYTES_PER_SECOND: u64 = 12 << 20;
/// Time without a message after which a helper counts as gone.
const HELPER_LASTS: Duration = Duration::from_secs(6);
/// The time for which a state of the scene must be unchanged before it is sent, so that not each step of a drag is.
const SETTLES: Duration = Duration::from_millis(250);
/// The time over which rates are measured.
const RATE_TIME: Duration = Duration::from_secs(3);
/// Largest number of messages that wait to be merged; more are lost.
const WAITING_MAX: usize = 256;

/// A machine that renders samples for a viewport.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ViewportMachine {
    /// The name of its process.
    pub name: String,
    /// Number of samples per second, summed over pixels, over the last 3 s.
    pub samples_per_second: f64,
    /// Bytes per second that it sends, over the last 3 s.
    pub bytes_per_second: f64,
    /// The reason why it does not help; none: it helps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

/// A viewport whose samples free machines of a farm also render, until it is dropped.
pub struct SharedViewport {
    share: Arc<ViewportShare>,
    _frames: LiveSubscription,
}

/// The state that the viewport's rendering thread, the sender of scenes and the receiver of samples share.
struct ViewportShare {
    board: JobBoard,
    /// The unique number of the viewport.
    number: u64,
    state: Mutex<ShareState>,
    /// Notified when there is another look, a helper lacks the scene, or the viewport is closed.
    changed: Condvar,
}

#[derive(Default)]
struct ShareState {
    look: Option<ViewportLook>,
    /// True if the look has all its samples.
    rests: bool,
    /// True if the look has ended and another one has not begun.
    is_moving: bool,
    /// True if the machines must hear of that now.
    is_call_due: bool,
    /// When the scene of the look changed last.
    scene_changed: Option<Instant>,
    sent: Option<SentScene>,
    /// The number of states sent so far.
    states: u64,
    /// True if a helper says that the farm does not have the scene any more.
    is_lacking: bool,
    helpers: BTreeMap<String, Helper>,
    /// The last place given to a helper.
    last_place: u32,
    problem: Option<String>,
    is_over: bool,
}

/// A state of the scene that the farm has.
struct SentScene {
    scene: Arc<Scene>,
    state: u64,
    files: SentFiles,
}

struct Helper {
    place: u32,
    heard: Instant,
    refused: Option<String>,
    /// Time, samples of pixels and bytes of each message of the last seconds.
    recent: Vec<(Instant, u64, u64)>,
}

/// Lets the free machines of a farm render samples of a viewport, until the returned value is dropped.
///
/// # Errors
/// This machine is a guest, or a thread cannot be started.
pub fn share_viewport(viewport: &Arc<Viewport>, board: &JobBoard) -> Result<SharedViewport, Error> {
    board.refuse_guests()?;
    let (number, state) = (fresh_number(), Mutex::default());
    let share = Arc::new(ViewportShare { board: board.clone(), number, state, changed: Condvar::new() });
    let (sender, messages) = mpsc::sync_channel::<Vec<u8>>(WAITING_MAX);
    let frames = board.uplink.live().listen(&frames_channel(number), move |bytes| {
        if sender.try_send(bytes.to_vec()).is_err() {
            tracing::debug!("samples of a helper were lost: too many are waiting");
        }
    });
    let shared = SharedViewport { share: Arc::clone(&share), _frames: frames };
    let start = |name: &str, work: Box<dyn FnOnce() + Send>| {
        let started = thread::Builder::new().name(name.to_owned()).spawn(work);
        started.map(drop).map_err(|error| Error::failed(format!("cannot start a thread: {error}"), "try again"))
    };
    let (merging, weak) = (Arc::clone(&share), Arc::downgrade(viewport));
    start("viewport-merge", Box::new(move || merging.merge(&weak, &messages)))?;
    let sending = Arc::clone(&share);
    start("viewport-send", Box::new(move || sending.send_scenes()))?;
    viewport.follow(Box::new(Follower(share)));
    Ok(shared)
}

impl SharedViewport {
    /// Returns the machines that help, and those that cannot, in the order of their names.
    pub fn machines(&self) -> Vec<ViewportMachine> {
        let now = Instant::now();
        let state = self.share.state();
        state.helpers.iter().map(|(name, helper)| helper.view(name, now)).collect()
    }

    /// Returns the reason why the scene cannot be sent, so that no machine helps, as text for the user; `None`: there is no such
    /// reason.
    pub fn problem(&self) -> Option<String> {
        self.share.state().problem.clone()
    }
}

impl Drop for SharedViewport {
    fn drop(&mut self) {
        self.share.state().is_over = true;
        self.share.changed.notify_all();
        self.share.call();
    }
}

/// Hands the looks of a viewport on.
struct Follower(Arc<ViewportShare>);

impl ViewportFollower for Follower {
    fn ends_before(&self, next: u64) {
        {
            let mut state = self.0.state();
            let has_ended = state.look.as_ref().is_some_and(|look| look.number < next);
            if !has_ended || state.is_moving || state.rests {
                return;
            }
            (state.is_moving, state.is_call_due) = (true, true);
        }
        // The thread that wants another look must not wait for a message.
        self.0.changed.notify_all();
    }

    fn begins(&self, look: ViewportLook) {
        {
            let mut state = self.0.state();
            if state.look.as_ref().is_none_or(|before| !Arc::ptr_eq(&before.scene, &look.scene)) {
                state.scene_changed = Some(Instant::now());
            }
            (state.look, state.rests, state.is_moving) = (Some(look), false, false);
        }
        self.0.call();
        self.0.changed.notify_all();
    }

    fn rests(&self, look: u64) {
        {
            let mut state = self.0.state();
            state.rests = state.look.as_ref().is_some_and(|current| current.number == look);
        }
        self.0.call();
    }
}

impl ViewportShare {
    fn state(&self) -> MutexGuard<'_, ShareState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends the call of the viewport to all machines.
    fn call(&self) {
        // Send while the state is locked, so that calls arrive in the order of the states
        let mut state = self.state();
        state.helpers.retain(|_, helper| helper.heard.elapsed() < HELPER_LASTS || helper.refused.is_some());
        let helping = state.helpers.iter().filter(|(_, helper)| helper.refused.is_none());
        let places: BTreeMap<String, u32> = helping.map(|(name, helper)| (name.clone(), helper.place)).collect();
        let senders = places.len().max(1) as u64;
        let call = ViewportCall {
            viewport: self.number,
            host: host_name(),
            version: build().identity().to_owned(),
            look: state.called(),
            is_moving: state.is_moving,
            places,
            bytes_per_second: (BYTES_PER_SECOND / senders).min(HELPER_BYTES_PER_SECOND),
            is_over: state.is_over,
        };
        let bytes = serde_json::to_vec(&call).unwrap_or_default();
        if bytes.len() > LIVE_BYTES_MAX {
            let problem = "the scene has too many files or is too large to be shown by a farm";
            state.problem = Some(problem.to_owned());
            return;
        }
        self.board.uplink.live().send(CALLS, bytes);
    }

    /// Receives messages of helpers until the viewport is closed.
    fn merge(&self, viewport: &Weak<Viewport>, messages: &Receiver<Vec<u8>>) {
        loop {
            if self.state().is_over {
                return;
            }
            match messages.recv_timeout(CALL_EVERY) {
                Ok(bytes) => {
                    let Some(viewport) = viewport.upgrade() else { return };
                    match decode(&bytes) {
                        Some(HelperMessage::Notice(notice)) => self.hear(notice),
                        Some(HelperMessage::Band(band)) => self.take(&viewport, &band, bytes.len() as u64),
                        None => tracing::debug!("cannot read a message of a helper"),
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Notes what a helper says of itself, and gives it a place.
    fn hear(&self, notice: HelperNotice) {
        let is_new = {
            let mut state = self.state();
            if notice.leaves && notice.refuses.is_none() {
                state.helpers.remove(&notice.name).is_some()
            } else {
                state.is_lacking |= notice.lacks_scene;
                let (is_added, helper) = state.helper(&notice.name);
                helper.refused = notice.refuses;
                is_added
            }
        };
        if is_new {
            self.call();
        }
        self.changed.notify_all();
    }

    /// Adds samples of a helper to the viewport.
    fn take(&self, viewport: &Viewport, band: &FrameBand, bytes: u64) {
        let is_added = viewport.add(&band.samples);
        let now = Instant::now();
        let mut state = self.state();
        let helper = state.helper(&band.name).1;
        let samples = if is_added { band.samples.rect.area() * u64::from(band.samples.samples) } else { 0 };
        helper.recent.push((now, samples, bytes));
        helper.recent.retain(|(at, ..)| now.duration_since(*at) < RATE_TIME);
    }

    /// Sends each state of the scene, and repeats the call, until the viewport is closed.
    fn send_scenes(&self) {
        let me = format!("{}-viewport-{:06x}", host_name(), self.number & 0xff_ffff);
        // Chunks are kept while the viewport needs them.
        let mut kept: Option<SentPieces<'_>> = None;
        loop {
            let next = {
                let is_content =
                    |state: &mut ShareState| !state.is_over && !state.is_call_due && state.unsent().is_none();
                let waited = self.changed.wait_timeout_while(self.state(), CALL_EVERY, is_content);
                let mut state = waited.unwrap_or_else(PoisonError::into_inner).0;
                if state.is_over {
                    return;
                }
                if mem::take(&mut state.is_call_due) {
                    drop(state);
                    self.call();
                    continue;
                }
                let unsent = state.unsent();
                state.is_lacking = false;
                unsent.map(|scene| (scene, state.scene_changed.map_or(SETTLES, |at| at.elapsed())))
            };
            match next {
                None => self.call(),
                Some((_, age)) if age < SETTLES && kept.is_some() => thread::sleep(SETTLES - age),
                Some((scene, _)) => match self.send(&scene, &me) {
                    Ok((files, pieces)) => {
                        kept = Some(pieces);
                        let mut state = self.state();
                        state.states += 1;
                        let number = state.states;
                        (state.sent, state.problem) = (Some(SentScene { scene, state: number, files }), None);
                        drop(state);
                        self.call();
                    }
                    Err(error) => {
                        tracing::warn!(error = %error.error_chain(), "the machines of the farm do not help the viewport");
                        self.state().problem = Some(error.error_chain());
                        thread::sleep(CALL_EVERY);
                    }
                },
            }
        }
    }

    /// Sends a scene to the farm.
    fn send<'kept>(&'kept self, scene: &Scene, me: &'kept str) -> Result<(SentFiles, SentPieces<'kept>), Error> {
        let folder = tempfile::tempdir().map_err(|source| Error::write(std::env::temp_dir(), source))?;
        let file = folder.path().join("viewport.bottega");
        save_scene(&file, scene, &RenderHints::default()).map_err(bottega::Error::from)?;
        let (files, pieces) = SentFiles::read(&file, &[], None)?;
        let sent = transfer::send(&pieces, &self.board, me, &StopSwitch::new(), &Reporter::new(Arc::new(())))?;
        Ok((files, sent))
    }
}

impl ShareState {
    /// Returns the look for a call; `None`: there is nothing to do, or its scene is not sent yet.
    fn called(&self) -> Option<CalledLook> {
        let look = self.look.as_ref().filter(|_| !self.rests && !self.is_moving)?;
        let sent = self.sent.as_ref().filter(|sent| Arc::ptr_eq(&sent.scene, &look.scene))?;
        Some(CalledLook {
            number: look.number,
            request: look.request.clone(),
            camera: look.camera.clone(),
            state: sent.state,
            scene: sent.files.clone(),
        })
    }

    /// Returns the scene that must be sent; `None`: the farm has it.
    fn unsent(&self) -> Option<Arc<Scene>> {
        let scene = &self.look.as_ref()?.scene;
        let is_there = self.sent.as_ref().is_some_and(|sent| Arc::ptr_eq(&sent.scene, scene)) && !self.is_lacking;
        (!is_there).then(|| Arc::clone(scene))
    }

    /// Returns a helper, and true if it is new.
    fn helper(&mut self, name: &str) -> (bool, &mut Helper) {
        let is_new = !self.helpers.contains_key(name);
        self.last_place += u32::from(is_new);
        let place = self.last_place;
        let heard = Instant::now();
        let new = || Helper { place, heard, refused: None, recent: Vec::new() };
        let helper = self.helpers.entry(name.to_owned()).or_insert_with(new);
        helper.heard = heard;
        (is_new, helper)
    }
}

impl Helper {
    fn view(&self, name: &str, now: Instant) -> ViewportMachine {
        let recent = || self.recent.iter().filter(|(at, ..)| now.duration_since(*at) < RATE_TIME);
        // Over the time since the first of them, so that a helper that has just begun has its rate.
        let first = recent().map(|(at, ..)| now.duration_since(*at)).max().unwrap_or_default();
        let seconds = first.as_secs_f64().max(0.25);
        let rate = |sum: u64| sum as f64 / seconds;
        ViewportMachine {
            name: name.to_owned(),
            samples_per_second: rate(recent().map(|(_, samples, _)| samples).sum()),
            bytes_per_second: rate(recent().map(|(.., bytes)| bytes).sum()),
            refused: self.refused.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_is_sent_when_it_is_new_and_when_the_farm_has_lost_it() {
        let scene = Arc::new(Scene::default());
        let camera = bottega_scene::Camera::default();
        let request = bottega::Request::new("a scene in memory");
        let look = ViewportLook { number: 3, request, scene: Arc::clone(&scene), camera };
        let mut state = ShareState::default();
        assert!(state.unsent().is_none(), "nothing is shown");
        state.look = Some(look);
        assert!(state.unsent().is_some() && state.called().is_none(), "nobody can load it yet");
        let files = SentFiles::at_farm(Vec::new(), None);
        state.sent = Some(SentScene { scene, state: 1, files });
        assert!(state.unsent().is_none() && state.called().is_some_and(|called| called.number == 3));
        state.is_lacking = true;
        assert!(state.unsent().is_some());
        state.rests = true;
        assert!(state.called().is_none(), "it has all samples");
    }
}
