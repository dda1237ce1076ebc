//! Work and resources that the tests drive.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, Once};
use std::time::Duration;

use bottega_hra::{Failed, HraConfig, Link, Primitive, PrimitiveSet, Resource, ResourceDescriptor, Work, WorkUnit};

/// Work that doubles a number.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Job {
    pub(crate) number: u64,
    pub(crate) primitive: Primitive,
    pub(crate) has_backup: bool,
}

impl Work for Job {
    type Output = u64;
    fn primitive(&self) -> Primitive {
        self.primitive
    }
    fn size(&self) -> u64 {
        1 + self.number % 7
    }
    fn payload_bytes(&self) -> u64 {
        8
    }
    fn backup(&self) -> Option<Self> {
        self.has_backup.then(|| self.clone())
    }
}

#[allow(clippy::needless_pass_by_value, reason = "work moves in")]
pub(crate) fn double(job: Job) -> u64 {
    2 * job.number
}

pub(crate) fn unit(number: u64, primitive: Primitive) -> WorkUnit<Job> {
    WorkUnit::new(Job { number, primitive, has_backup: true }, number)
}

/// A resource that calls a closure.
pub(crate) struct Custom<F> {
    pub(crate) name: &'static str,
    pub(crate) primitives: PrimitiveSet,
    pub(crate) perform: F,
}

impl<F> Resource<Job> for Custom<F>
where
    F: FnMut(Job) -> Result<u64, Failed<Job>> + Send,
{
    fn descriptor(&self) -> ResourceDescriptor {
        ResourceDescriptor {
            name: self.name.to_owned(),
            primitives: self.primitives,
            memory_bytes: None,
            link: Link::LOCAL,
        }
    }
    fn perform(&mut self, job: Job) -> Result<u64, Failed<Job>> {
        (self.perform)(job)
    }
}

pub(crate) fn custom<F>(name: &'static str, primitives: PrimitiveSet, perform: F) -> Box<dyn Resource<Job>>
where
    F: FnMut(Job) -> Result<u64, Failed<Job>> + Send + 'static,
{
    Box::new(Custom { name, primitives, perform })
}

/// A gate at which lanes wait until it is opened.
#[derive(Clone, Default)]
pub(crate) struct Gate(Arc<(Mutex<bool>, Condvar)>);

impl Gate {
    pub(crate) fn open(&self) {
        *self.0.0.lock().unwrap() = true;
        self.0.1.notify_all();
    }
    pub(crate) fn pass(&self) {
        let mut open = self.0.0.lock().unwrap();
        while !*open {
            open = self.0.1.wait(open).unwrap();
        }
    }
}

/// Short pauses, so that tests of failure are quick.
pub(crate) fn quick() -> HraConfig {
    HraConfig {
        pause_min: Duration::from_micros(100),
        pause_max: Duration::from_millis(1),
        max_failures: u32::MAX,
        ..HraConfig::default()
    }
}

/// Runs `body`; fails if it has not ended after half a minute, as in a deadlock.
pub(crate) fn within_reason<T: Send + 'static>(body: impl FnOnce() -> T + Send + 'static) -> T {
    let (sender, receiver): (Sender<T>, Receiver<T>) = channel();
    let thread = std::thread::spawn(move || {
        let _ = sender.send(body());
    });
    match receiver.recv_timeout(Duration::from_secs(30)) {
        Ok(value) => value,
        Err(std::sync::mpsc::RecvTimeoutError::Timeout) => panic!("deadlock: not ended after 30 s"),
        Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => match thread.join() {
            Err(panic) => std::panic::resume_unwind(panic),
            Ok(()) => unreachable!("the body ended without a value"),
        },
    }
}

/// Keeps injected panics out of the log, so that real ones are seen.
pub(crate) fn hush_injected_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let loud = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !info.payload().downcast_ref::<&str>().is_some_and(|message| message.contains("injected")) {
                loud(info);
            }
        }));
    });
}
