//! A bandwidth limit: data is delayed as on a slower cable.

use std::{
    io::{self, Read, Write},
    ops::RangeInclusive,
    thread,
    time::{Duration, Instant},
};

/// The time that a piece occupies the cable, in seconds, and the bounds of a piece's size.
const PIECE_TIME: f64 = 0.005;
const PIECE_BYTES: RangeInclusive<usize> = 1 << 10..=16 << 10;
/// The maximum oversleeping that is compensated.
const LATENESS_MAX: Duration = Duration::from_micros(300);

/// One direction of a connection with a bandwidth limit.
pub(crate) struct Throttled<S> {
    inner: S,
    /// Bytes per second; `None`: unlimited.
    bandwidth: Option<f64>,
    /// The time at which all data sent so far has passed the cable.
    free_at: Instant,
}

impl<S> Throttled<S> {
    pub(crate) fn new(inner: S, bandwidth: Option<f64>) -> Self {
        Self { inner, bandwidth, free_at: Instant::now() }
    }

    fn most(&self, bytes: usize) -> usize {
        let piece =
            |bandwidth: f64| ((bandwidth * PIECE_TIME) as usize).clamp(*PIECE_BYTES.start(), *PIECE_BYTES.end());
        self.bandwidth.map_or(bytes, |bandwidth| bytes.min(piece(bandwidth)))
    }

    fn passed(&mut self, bytes: usize) {
        let Some(bandwidth) = self.bandwidth else { return };
        let now = Instant::now();
        let begun = self.free_at.max(now.checked_sub(LATENESS_MAX).unwrap_or(now));
        self.free_at = begun + Duration::from_secs_f64((bytes as f64 / bandwidth).min(60.0));
        thread::sleep(self.free_at.saturating_duration_since(now));
    }
}

impl<S: Read> Read for Throttled<S> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let most = self.most(buffer.len());
        let read = self.inner.read(&mut buffer[..most])?;
        self.passed(read);
        Ok(read)
    }
}

impl<S: Write> Write for Throttled<S> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        let piece = &buffer[..self.most(buffer.len())];
        self.passed(piece.len()); // Data arrives when it has passed completely.
        self.inner.write_all(piece)?;
        Ok(piece.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}
