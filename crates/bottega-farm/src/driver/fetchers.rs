//! A small pool of threads that fetch tiles from other machines, which may be thousands per second.

use std::{
    collections::VecDeque,
    io,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
};

/// The most tiles fetched in parallel.
const THREADS_MAX: usize = 16;

type Job = Box<dyn FnOnce() + Send>;

/// The thread pool. Its threads end when this is dropped and their current jobs are done.
#[derive(Default)]
pub(super) struct Fetchers(Arc<Inner>);

#[derive(Default)]
struct Inner {
    state: Mutex<FetchState>,
    changed: Condvar,
}

#[derive(Default)]
struct FetchState {
    jobs: VecDeque<Job>,
    threads: usize,
    idle: usize,
    is_over: bool,
}

impl Inner {
    fn lock(&self) -> MutexGuard<'_, FetchState> {
        // Jobs run without the lock.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        let mut state = self.lock();
        while !state.is_over {
            if let Some(job) = state.jobs.pop_front() {
                drop(state);
                job();
                state = self.lock();
            } else {
                state.idle += 1;
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
                state.idle -= 1;
            }
        }
    }
}

impl Fetchers {
    /// Runs a job on a thread of the pool, as soon as one is free.
    ///
    /// # Errors
    /// No thread is free, and none can be started. Then the job is dropped.
    pub(super) fn begin(&self, job: impl FnOnce() + Send + 'static) -> io::Result<()> {
        let mut state = self.0.lock();
        state.jobs.push_back(Box::new(job));
        if state.idle < state.jobs.len() && state.threads < THREADS_MAX {
            let inner = Arc::clone(&self.0);
            match thread::Builder::new().name("fetch".to_owned()).spawn(move || inner.work()) {
                Ok(_) => state.threads += 1,
                Err(error) if state.threads == 0 => {
                    let job = state.jobs.pop_back();
                    drop(state);
                    drop(job);
                    return Err(error);
                }
                // Existing threads will run it.
                Err(_) => {}
            }
        }
        drop(state);
        self.0.changed.notify_one();
        Ok(())
    }
}

impl Drop for Fetchers {
    fn drop(&mut self) {
        self.0.lock().is_over = true;
        self.0.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc, time::Duration};

    use super::*;

    #[test]
    fn many_jobs_are_done_by_few_threads_and_one_that_waits_holds_up_nobody() {
        let fetchers = Fetchers::default();
        let (release, wait) = mpsc::channel::<()>();
        fetchers
            .begin(move || {
                // The job ends when the sender is dropped.
                _ = wait.recv();
            })
            .unwrap();
        let (done, is_done) = mpsc::channel();
        for i in 0..1000 {
            let done = done.clone();
            fetchers.begin(move || done.send((i, thread::current().id())).unwrap()).unwrap();
        }
        let all: Vec<_> = (0..1000).map(|_| is_done.recv_timeout(Duration::from_secs(60)).unwrap()).collect();
        let mut jobs: Vec<i32> = all.iter().map(|(job, _)| *job).collect();
        jobs.sort_unstable();
        assert_eq!(jobs, (0..1000).collect::<Vec<_>>());
        assert!(fetchers.0.lock().threads <= THREADS_MAX);
        drop(release);
    }
}
