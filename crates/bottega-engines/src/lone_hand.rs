//! Shared preparation done by one machine alone, with its time.

use std::{
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use bottega_render::{RenderError, Sharing};

/// A [`Sharing`] that computes all parts itself and measures the time that a farm could have shared.
#[derive(Debug, Default)]
pub struct LoneHand(Mutex<SharedTime>);

/// The amount of work that the machines of a picture can share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SharedTime {
    /// Wall time of all parts.
    pub time: Duration,
    /// Number of stages: each waits for the one before.
    pub stages: u32,
}

impl LoneHand {
    /// Returns the amount of work done so far.
    pub fn so_far(&self) -> SharedTime {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Sharing for LoneHand {
    fn share(
        &self,
        _stage: u32,
        parts: u32,
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Vec<Vec<u8>>, RenderError> {
        let begun = Instant::now();
        let found = (0..parts).map(perform).collect();
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.time += begun.elapsed();
        known.stages += 1;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_parts_are_done_in_their_order_and_their_time_is_known() {
        let alone = LoneHand::default();
        let mut slowly = |part: u32| {
            std::thread::sleep(Duration::from_millis(2));
            Ok(vec![part as u8])
        };
        assert_eq!(alone.share(0, 3, &mut slowly).ok(), Some(vec![vec![0], vec![1], vec![2]]));
        assert!(alone.share(1, 2, &mut |_| Err(RenderError::Left)).is_err());
        let SharedTime { time, stages } = alone.so_far();
        assert!(time >= Duration::from_millis(6) && stages == 2, "{time:?} {stages}");
    }
}
