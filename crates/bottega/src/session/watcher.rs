//! Watchers of the work.

use bottega_agents::Time;
use bottega_farm::FarmMessage;

use crate::events::Event;

/// Sees a picture being painted. All methods are called from threads that paint, and must return soon.
pub trait Watcher: Send + Sync {
    /// Something has happened.
    fn told(&self, event: Event);

    /// An agent sends a message to others.
    fn message(&self, _now: Time, _message: &FarmMessage) {}

    /// There is a new preview: the bytes of a PNG file.
    fn previewed(&self, _png: Vec<u8>) {}

    /// Nothing is painted any more; what comes now follows the painting.
    fn painted(&self) {}
}

/// A watcher that looks away.
impl Watcher for () {
    fn told(&self, _event: Event) {}
}

/// A function that is told the events.
impl<F: Fn(Event) + Send + Sync> Watcher for F {
    fn told(&self, event: Event) {
        self(event);
    }
}
