//! A cable that is slower than it is: what passes is held up as long as it would take.

use std::{
    io::{self, Read, Write},
    thread,
    time::{Duration, Instant},
};

/// Bytes that pass at once.
const BYTES_AT_ONCE: usize = 16 << 10;

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
        if self.bandwidth.is_some() { bytes.min(BYTES_AT_ONCE) } else { bytes }
    }

    fn passed(&mut self, bytes: usize) {
        let Some(bandwidth) = self.bandwidth else { return };
        let now = Instant::now();
        self.free_at = self.free_at.max(now) + Duration::from_secs_f64((bytes as f64 / bandwidth).min(60.0));
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
        let written = self.inner.write(&buffer[..self.most(buffer.len())])?;
        self.passed(written);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}
