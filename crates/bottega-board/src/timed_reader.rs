//! A reader that measures how fast bytes come.

use std::{
    io::{self, BufRead, BufReader, Read},
    time::{Duration, Instant},
};

/// Bytes that came closely after others, and the time in which they came. Together they tell the bandwidth of what is between (the
/// dispersion of a train of packets), however long the first of them was under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Receipt {
    pub(crate) timed_bytes: u64,
    pub(crate) time: Duration,
}

/// Bytes with the times at which they came.
pub(crate) struct TimedReader<R> {
    inner: R,
    /// When the last bytes of the train came.
    last: Option<Instant>,
    receipt: Receipt,
}

impl<R: Read> TimedReader<R> {
    pub(crate) fn buffered(inner: R, capacity: usize) -> BufReader<Self> {
        BufReader::with_capacity(capacity, Self { inner, last: None, receipt: Receipt::default() })
    }
}

/// What is to come now is one frame: waits for its first bytes and measures the rest.
///
/// # Errors
/// The connection ended.
pub(crate) fn begin<R: Read>(reader: &mut BufReader<TimedReader<R>>) -> io::Result<()> {
    let timed = reader.get_mut();
    timed.receipt = Receipt::default();
    // Where bytes of it came with the frame before they follow that one; else nobody knows since when it is under way.
    if reader.buffer().is_empty() {
        reader.get_mut().last = None;
        reader.fill_buf()?;
    }
    Ok(())
}

/// The receipt of the frame that was read.
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

    /// Gives so many bytes at a time, each after a while.
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
            thread::sleep(Duration::from_millis(50)); // Nothing is under way: that does not count.
            begin(&mut reader).unwrap();
            reader.read_exact(&mut [0; 5000]).unwrap();
            let Receipt { timed_bytes, time } = receipt(&reader);
            assert_eq!(timed_bytes, 4000);
            assert!((Duration::from_millis(16)..Duration::from_millis(45)).contains(&time), "{time:?}");
        }
    }
}
