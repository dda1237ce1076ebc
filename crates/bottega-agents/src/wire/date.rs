//! Date-times in FIPA's format.

use std::{fmt, time::Duration};

use super::error::{WireError, bad_value};
use crate::Time;

/// A date-time such as `20261121T101500000Z`. Stored as written: it may be local time, or relative (`+…`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DateTime(String);

impl DateTime {
    /// Parses `[+]YYYYMMDDThhmmssmmm[letter]`; some platforms write `Z` for the `T`.
    ///
    /// # Errors
    /// The text has another format, or a field is out of range.
    pub fn parse(text: &str) -> Result<Self, WireError> {
        let bad = || bad_value("date-time", text);
        let relative = text.starts_with('+');
        let fields = text.strip_prefix('+').unwrap_or(text).as_bytes();
        let (fields, suffix) = fields.split_at_checked(18).ok_or_else(bad)?;
        let is_suffix = match suffix {
            [] => true,
            [letter] => letter.is_ascii_alphabetic(),
            _ => false,
        };
        let digits = |range: std::ops::Range<usize>| {
            fields[range]
                .iter()
                .try_fold(0_u32, |sum, byte| byte.is_ascii_digit().then(|| sum * 10 + u32::from(byte - b'0')))
        };
        let (month, day) = (digits(4..6).ok_or_else(bad)?, digits(6..8).ok_or_else(bad)?);
        let in_bounds = digits(0..4).is_some()
            && (relative || (1..=12).contains(&month) && (1..=31).contains(&day))
            && digits(9..11).is_some_and(|hours| hours < 24)
            && digits(11..13).is_some_and(|minutes| minutes < 60)
            && digits(13..15).is_some_and(|seconds| seconds < 61)
            && digits(15..18).is_some();
        if in_bounds && is_suffix && matches!(fields[8], b'T' | b'Z') { Ok(Self(text.to_owned())) } else { Err(bad()) }
    }

    /// Returns the date-time as written.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for DateTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

const SECONDS_A_DAY: u64 = 86_400;

/// The calendar of a platform: converts its time to dates and back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Calendar {
    unix_at_start: Duration,
}

impl Calendar {
    /// Makes the calendar of a platform that started this long after the beginning of 1970 (UTC).
    pub fn new(unix_at_start: Duration) -> Self {
        Self { unix_at_start }
    }

    /// Returns a moment as a date-time in UTC, truncated to milliseconds.
    pub fn date(self, time: Time) -> DateTime {
        let unix = self.unix_at_start.saturating_add(time.elapsed());
        let (days, seconds) = (unix.as_secs() / SECONDS_A_DAY, unix.as_secs() % SECONDS_A_DAY);
        let (year, month, day) = date_of_days(days);
        let (hour, minute, second, millis) = (seconds / 3600, seconds / 60 % 60, seconds % 60, unix.subsec_millis());
        // The format has four digits
        let year = year.min(9999);
        DateTime(format!("{year:04}{month:02}{day:02}T{hour:02}{minute:02}{second:02}{millis:03}Z"))
    }

    /// Returns the moment of a date-time; a relative one counts from `now`. A date-time without a zone is read as UTC,
    /// since the writer's zone is unknown, and so is one with any other letter than `Z`. One before the start of the
    /// platform gives [`Time::ZERO`].
    pub fn time(self, now: Time, date: &DateTime) -> Time {
        let (relative, text) = match date.0.strip_prefix('+') {
            Some(text) => (true, text),
            None => (false, date.0.as_str()),
        };
        // `DateTime` has checked that these are digits
        let field = |range: std::ops::Range<usize>| text[range].bytes().fold(0, |sum, b| sum * 10 + u64::from(b & 15));
        let (year, month, day) = (field(0..4), field(4..6), field(6..8));
        let in_day = field(9..11) * 3600 + field(11..13) * 60 + field(13..15);
        let millis = Duration::from_millis(field(15..18));
        if relative {
            // Years and months of a span have no fixed length: use 365 and 30 days
            let days = year * 365 + month * 30 + day;
            return now + (Duration::from_secs(days * SECONDS_A_DAY + in_day) + millis);
        }
        let unix = Duration::from_secs(days_of_date(year, month, day) * SECONDS_A_DAY + in_day) + millis;
        Time::since_start(unix.saturating_sub(self.unix_at_start))
    }
}

/// Days since 1970-01-01; zero for earlier dates. Counted in eras of 400 years that begin in March, so that the leap
/// day is the last of its year (after Howard Hinnant).
fn days_of_date(year: u64, month: u64, day: u64) -> u64 {
    let year = year - u64::from(month <= 2 && year > 0);
    let (era, of_era) = (year / 400, year % 400);
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    (era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year).saturating_sub(719_468)
}

fn date_of_days(days: u64) -> (u64, u64, u64) {
    let days = days + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let shifted = (5 * of_year + 2) / 153;
    let day = of_year - (153 * shifted + 2) / 5 + 1;
    let month = (shifted + 2) % 12 + 1;
    (era * 400 + year + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_calendar_knows_leap_years_and_comes_back_to_the_same_moment() {
        let calendar = Calendar::default();
        for (unix, date) in [
            (0, "19700101T000000000Z"),
            (951_782_400, "20000229T000000000Z"),
            (1_795_227_948, "20261121T022548000Z"),
            (4_107_542_399, "21000228T235959000Z"),
            (4_107_542_400, "21000301T000000000Z"),
        ] {
            let time = Time::since_start(Duration::from_secs(unix));
            assert_eq!(calendar.date(time).as_str(), date);
            assert_eq!(calendar.time(Time::ZERO, &DateTime::parse(date).unwrap()), time);
        }
        for day in (0..80_000).map(|day| day * SECONDS_A_DAY) {
            let time = Time::since_start(Duration::from_secs(day));
            assert_eq!(calendar.time(Time::ZERO, &calendar.date(time)), time);
        }
        let later = Calendar::new(Duration::from_secs(100));
        let in_a_minute = DateTime::parse("+00000000T000100000").unwrap();
        let now = Time::since_start(Duration::from_secs(5));
        assert_eq!(later.time(now, &in_a_minute), now + Duration::from_secs(60));
        assert_eq!(later.date(now).as_str(), "19700101T000145000Z");
        assert_eq!(later.time(now, &DateTime::parse("19700101T000000000").unwrap()), Time::ZERO);
        // The least and the greatest that can be written.
        for odd in ["00000101T000000000", "99991231T235960999", "+99999999T235959999"] {
            later.time(now, &DateTime::parse(odd).unwrap());
        }
    }

    #[test]
    fn both_middles_suffixes_and_relative_times_are_read_and_nothing_else() {
        for good in ["20261121T022548103", "20261121Z022548103", "20261121T022548103Z", "+00000000T000010000"] {
            assert_eq!(DateTime::parse(good).unwrap().as_str(), good);
        }
        for bad in [
            "",
            "2026-11-21T02:00:00Z",
            "20261321T022548103",
            "20261121T252548103",
            "20261121T022548103ZZ",
            "20261121x022548103",
            "2026112éT02254810",
            "20261121T0225481",
        ] {
            assert!(DateTime::parse(bad).is_err(), "{bad}");
        }
    }
}
