//! Workers that wait for the next picture of a scene: loading a scene takes some engines longer than a frame.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use super::{
    error::EngineFault,
    locate::LocatedEngine,
    session::{SceneRequest, Session},
};

/// Longest time for which a worker waits.
const WAITS: Duration = Duration::from_secs(30);
/// Largest number of workers that wait.
const WAITING_MAX: usize = 4;

/// The workers of this process that wait.
static IDLE: Mutex<IdleSessions> = Mutex::new(IdleSessions { keepers: 0, waiting: Vec::new() });

struct IdleSessions {
    /// Number of [`KeptEngines`] alive.
    keepers: usize,
    waiting: Vec<IdleSession>,
}

struct IdleSession {
    /// The identity of its engine.
    engine: String,
    session: Session,
    since: Instant,
}

/// A guard: while it exists, workers wait up to 30 s for another picture of their scene. It is held by those who render one
/// picture after another: animations, and machines of a farm.
#[derive(Debug)]
pub struct KeptEngines(());

impl KeptEngines {
    /// Returns a guard: workers wait from now on, until the last guard is dropped.
    pub fn begin() -> Self {
        idle().keepers += 1;
        Self(())
    }
}

impl Drop for KeptEngines {
    fn drop(&mut self) {
        let ended = {
            let mut idle = idle();
            idle.keepers -= 1;
            if idle.keepers == 0 { std::mem::take(&mut idle.waiting) } else { Vec::new() }
        };
        // Their processes end outside of the lock.
        drop(ended);
    }
}

fn idle() -> MutexGuard<'static, IdleSessions> {
    IDLE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps the session of a picture that is done, or ends it.
pub(super) fn keep(engine: &LocatedEngine, session: Session) {
    if !session.can_wait() {
        return;
    }
    let ended = {
        let mut idle = idle();
        if idle.keepers == 0 || idle.waiting.len() >= WAITING_MAX {
            Some(session)
        } else {
            idle.waiting.push(IdleSession { engine: engine.identity(), session, since: Instant::now() });
            None
        }
    };
    if ended.is_some() {
        return;
    }
    let reaper = thread::Builder::new().name("idle-engine".to_owned()).spawn(|| {
        thread::sleep(WAITS);
        drop(taken(|waiting| waiting.since.elapsed() >= WAITS));
    });
    if let Err(error) = reaper {
        tracing::debug!(%error, "a worker waits until the end");
    }
}

/// Takes waiting sessions out of the list.
fn taken(is_meant: impl Fn(&IdleSession) -> bool) -> Vec<IdleSession> {
    let mut idle = idle();
    idle.waiting.extract_if(.., |waiting| is_meant(waiting)).collect()
}

impl Session {
    /// Opens a scene with a worker that waits and may read the same files, or else with a new one. Other workers that wait end,
    /// because two scenes may not fit in memory.
    ///
    /// # Errors
    /// A new worker is needed, and [`Session::open`] fails.
    pub fn open_again(engine: &Arc<LocatedEngine>, request: &SceneRequest) -> Result<Self, EngineFault> {
        let (identity, mut found) = (engine.identity(), None);
        for waiting in taken(|_| true) {
            if found.is_none() && waiting.engine == identity && waiting.session.reads_for(request) {
                found = Some(waiting.session);
            }
        }
        if let Some(mut session) = found {
            match session.reopen(engine, request) {
                Ok(()) => return Ok(session),
                Err(fault) => tracing::debug!(%fault, "a worker that waited does not open the scene"),
            }
        }
        Self::open(engine, request)
    }
}
