//! A reader that measures the receiving rate.

use std::{
    io::{self, BufRead, BufReader, Read},
    time::{Duration, Instant},
};

/// The bytes that arrived immediately after others, and the time that they took. Their quotient is the bandwidth of the path
/// (packet train dispersion), independent of the latency.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Receipt {
    pub(crate) timed_bytes: u64,
    pub(crate) time: Duration,
}

/// A reader that records the arrival times of bytes.
pub(crate) struct TimedReader<R> {
    inner: R,
    /// The time at which the last bytes of the train arrived.
    last: Option<Instant>,
    receipt: Receipt,
}

impl<R: Read> TimedReader<R> {
    pub(crate) fn buffered(inner: R, capacity: usize) -> BufReader<Self> {
        BufReader::with_capacity(capacity, Self { inner, last: None, receipt: Receipt::default() })
    }
}

/// Starts a frame: waits for its first bytes and measures the rest.
///
/// # Errors
/// The connection ended.
pub(crate) fn begin<R: Read>(reader: &mut BufReader<TimedReader<R>>) -> io::Result<()> {
    let timed = reader.get_mut();
    timed.receipt = Receipt::default();
    // If the previous read already returned bytes of this frame, continue its train; otherwise its start is unknown.
    if reader.buffer().is_empty() {
        reader.get_mut().last = None;
        reader.fill_buf()?;
    }
    Ok(())
}

/// Returns the receipt of the frame that was read.
pub(crate) fn receipt<R: Read>(reader: &BufReader<TimedReader<R>>) -> Receipt {
    reader.get_ref().receipt
}

impl<R: Read> Read for TimedReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(buffer)?;
        let now = Instant::now();
        if let Some(last) = self.last.replace(now) {
            self.receipt.timed_bytes += read as u64;
            self.receipt.time += now - last;
        }
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    /// A reader that returns this many bytes at a time, each after a delay.
    struct Slow(usize);

    impl Read for Slow {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            thread::sleep(Duration::from_millis(4));
            let read = buffer.len().min(self.0);
            buffer[..read].fill(1);
            Ok(read)
        }
    }

    #[test]
    fn the_bandwidth_is_that_of_the_bytes_after_the_first() {
        let mut reader = TimedReader::buffered(Slow(1000), 8192);
        for _ in 0..2 {
            thread::sleep(Duration::from_millis(50)); // Idle time that must not count.
            begin(&mut reader).unwrap();
            reader.read_exact(&mut [0; 5000]).unwrap();
            let Receipt { timed_bytes, time } = receipt(&reader);
            assert_eq!(timed_bytes, 4000);
            assert!((Duration::from_millis(16)..Duration::from_millis(45)).contains(&time), "{time:?}");
        }
    }
}
