//! The limits of requests: number, size and time.

use std::{
    collections::HashMap,
    net::IpAddr,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

/// Largest number of connections; further ones are closed.
pub(crate) const CONNECTIONS_MAX: usize = 512;
/// Largest number of event streams; further ones get status 503.
pub const EVENT_STREAMS_MAX: usize = 64;
/// Largest number of concurrent calls to the farm.
pub(crate) const QUESTIONS_MAX: usize = 16;
/// Largest number of submissions examined at the same time.
pub(crate) const SUBMISSIONS_MAX: usize = 1;
/// Number of sent pictures kept for comparison; the oldest one is dropped.
pub(crate) const SENT_PICTURES_MAX: usize = 2;
/// Largest size of a sent picture, in bytes.
pub(crate) const SENT_PICTURE_BYTES_MAX: usize = 64 << 20;
/// Time limit for comparing two pictures.
pub(crate) const COMPARISON_TIME: Duration = Duration::from_secs(120);
/// Largest number of viewports; further ones get status 503.
pub(crate) const VIEWPORTS_MAX: usize = 4;
/// Time without requests after which a viewport is closed.
pub(crate) const VIEWPORT_IDLE: Duration = Duration::from_secs(20);
/// Longest time that a request waits for a new frame of a viewport.
pub(crate) const FRAME_TIME: Duration = Duration::from_secs(5);
/// Largest JSON body of a request, in bytes; a larger one gets status 413.
pub const JSON_BYTES_MAX: usize = 1 << 20;
/// Largest size of all headers of a request, in bytes.
pub(crate) const HEADER_BYTES_MAX: usize = 16 << 10;
/// Time limit for the headers of a request, and for idle connections between requests.
pub(crate) const HEADERS_TIME: Duration = Duration::from_secs(10);
/// Time limit for a JSON body.
pub(crate) const JSON_TIME: Duration = Duration::from_secs(15);
/// Time limit for a piece of a file.
pub(crate) const PIECE_TIME: Duration = Duration::from_secs(120);
/// Longest time that a write may block because the client does not read.
pub(crate) const WRITE_TIME: Duration = Duration::from_secs(20);
/// Time limit for an answer of the farm.
pub(crate) const ANSWER_TIME: Duration = Duration::from_secs(30);
/// Time limit for examining a submission.
pub(crate) const SUBMISSION_TIME: Duration = Duration::from_secs(300);

/// Rate limit of requests per address: per second, and in a burst.
const QUESTIONS: TempoLimit = TempoLimit { per_second: 200.0, burst: 600.0 };
/// Rate limit of wrong tokens per address.
const WRONG_TOKENS: TempoLimit = TempoLimit { per_second: 5.0, burst: 40.0 };
/// Largest number of addresses remembered.
const ADDRESSES_MAX: usize = 4096;

/// A rate limit: sustained rate per second, and size of a burst.
#[derive(Clone, Copy, Debug)]
struct TempoLimit {
    per_second: f64,
    burst: f64,
}

/// The kind of event that is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum TempoKind {
    /// A request with a valid token, or to an open route.
    Question,
    /// A request with a wrong token.
    WrongToken,
}

/// Rate limiters of all addresses (leaky buckets).
#[derive(Debug, Default)]
pub(crate) struct Tempo {
    buckets: Mutex<HashMap<(IpAddr, TempoKind), (f64, Instant)>>,
}

impl Tempo {
    /// Counts an event. Returns false if the limit is exceeded.
    pub(crate) fn take(&self, address: IpAddr, what: TempoKind, now: Instant) -> bool {
        let pace = match what {
            TempoKind::Question => QUESTIONS,
            TempoKind::WrongToken => WRONG_TOKENS,
        };
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        if buckets.len() >= ADDRESSES_MAX {
            buckets.retain(|_, (_, at)| now.duration_since(*at) < Duration::from_secs(10));
        }
        let (level, at) = buckets.entry((address, what)).or_insert((0.0, now));
        *level = (*level - now.duration_since(*at).as_secs_f64() * pace.per_second).max(0.0);
        *at = now;
        if *level + 1.0 > pace.burst {
            return false;
        }
        *level += 1.0;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_asks_too_much_is_turned_away_until_a_while_has_passed() {
        let (tempo, now) = (Tempo::default(), Instant::now());
        let one = IpAddr::from([10, 0, 0, 1]);
        let taken = || (0..2000).filter(|_| tempo.take(one, TempoKind::Question, now)).count();
        assert_eq!((taken(), taken()), (600, 0));
        assert!(tempo.take(IpAddr::from([10, 0, 0, 2]), TempoKind::Question, now), "another address");
        assert!(tempo.take(one, TempoKind::WrongToken, now), "another count");
        assert!(tempo.take(one, TempoKind::Question, now + Duration::from_secs(1)));
    }
}
