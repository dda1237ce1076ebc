//! Limits of requests: how many, how large, and how long they may take.

use std::{
    collections::HashMap,
    net::IpAddr,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

/// Connections at once; more are closed as they come.
pub(crate) const CONNECTIONS_MAX: usize = 512;
/// Streams of events at once; more are answered 503.
pub const EVENT_STREAMS_MAX: usize = 64;
/// Questions to the farm under way at once.
pub(crate) const QUESTIONS_MAX: usize = 16;
/// Jobs that are looked through at once, before they are asked for.
pub(crate) const SUBMISSIONS_MAX: usize = 1;
/// Pictures that were sent to be compared; the oldest one goes.
pub(crate) const SENT_PICTURES_MAX: usize = 2;
/// Bytes of each.
pub(crate) const SENT_PICTURE_BYTES_MAX: usize = 64 << 20;
/// So long for comparing two pictures.
pub(crate) const COMPARISON_TIME: Duration = Duration::from_secs(120);
/// Scenes that are looked around in at once; more are answered 503.
pub(crate) const VIEWPORTS_MAX: usize = 4;
/// A viewport of which nobody asks for so long is closed.
pub(crate) const VIEWPORT_IDLE: Duration = Duration::from_secs(20);
/// So long one waits for something new of a viewport.
pub(crate) const FRAME_TIME: Duration = Duration::from_secs(5);
/// Bytes of a body of JSON.
pub const JSON_BYTES_MAX: usize = 1 << 20;
/// Bytes of all headers of a request.
pub(crate) const HEADER_BYTES_MAX: usize = 16 << 10;
/// So long a client may take for the headers of a request; so long it may say nothing between two.
pub(crate) const HEADERS_TIME: Duration = Duration::from_secs(10);
/// So long for a body of JSON, and for a piece of a file.
pub(crate) const JSON_TIME: Duration = Duration::from_secs(15);
pub(crate) const PIECE_TIME: Duration = Duration::from_secs(120);
/// So long one may not take any byte that is told it.
pub(crate) const WRITE_TIME: Duration = Duration::from_secs(20);
/// So long is waited for the farm.
pub(crate) const ANSWER_TIME: Duration = Duration::from_secs(30);
/// So long for looking through a scene.
pub(crate) const SUBMISSION_TIME: Duration = Duration::from_secs(300);

/// Questions a second of one address, and how many at once after a pause.
const QUESTIONS: TempoLimit = TempoLimit { per_second: 200.0, burst: 600.0 };
/// Tokens that are none.
const WRONG_TOKENS: TempoLimit = TempoLimit { per_second: 5.0, burst: 40.0 };
/// Addresses that are remembered.
const ADDRESSES_MAX: usize = 4096;

#[derive(Clone, Copy, Debug)]
struct TempoLimit {
    per_second: f64,
    burst: f64,
}

/// What kind of thing is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum TempoKind {
    /// A question.
    Question,
    /// A token that is none.
    WrongToken,
}

/// Counts what each address asks: a bucket that drains.
#[derive(Debug, Default)]
pub(crate) struct Tempo {
    buckets: Mutex<HashMap<(IpAddr, TempoKind), (f64, Instant)>>,
}

impl Tempo {
    /// Counts one more. `false`: it is too many.
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
