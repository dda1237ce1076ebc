//! The watcher of a job.

use bottega_agents::Time;
use bottega_farm::FarmMessage;
use bottega_image::Tile;

use crate::events::Event;

/// The receiver of the events of a job. The methods are called from rendering threads and must return quickly.
pub trait Watcher: Send + Sync {
    /// Receives an event of the job.
    fn event(&self, event: Event);

    /// Receives a message that an agent sends; `_now`: time since the start of the job.
    fn message(&self, _now: Time, _message: &FarmMessage) {}

    /// Receives a new preview: the bytes of a PNG file.
    fn previewed(&self, _png: Vec<u8>) {}

    /// Receives the pixels of a rectangle with all samples taken there so far. Called with previews.
    fn tile(&self, _tile: &Tile) {}

    /// Called when rendering has ended; later events report the steps after it.
    fn painted(&self) {}
}

/// A watcher that ignores all events.
impl Watcher for () {
    fn event(&self, _event: Event) {}
}

/// A function that is called with each event.
impl<F: Fn(Event) + Send + Sync> Watcher for F {
    fn event(&self, event: Event) {
        self(event);
    }
}
