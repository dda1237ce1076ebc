//! A cable that is slower than it is: what passes is held up as long as it would take.

use std::{
    io::{self, Read, Write},
    ops::RangeInclusive,
    thread,
    time::{Duration, Instant},
};

/// How long pieces occupy the cable, and the bounds of what passes at once.
const PIECE_TIME: f64 = 0.005;
const PIECE_BYTES: RangeInclusive<usize> = 1 << 10..=16 << 10;
/// Whoever sleeps wakes up late: what was lost by that is made up for, if it was no longer ago.
const LATENESS_MAX: Duration = Duration::from_micros(300);

/// One direction of a connection, with a bound on what passes in a second.
pub(crate) struct Throttled<S> {
    inner: S,
    /// Bytes a second; `None`: as many as there are.
    bandwidth: Option<f64>,
    /// When what has passed would be through.
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
        self.passed(piece.len()); // It is there when it is through.
        self.inner.write_all(piece)?;
        Ok(piece.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}
