//! Moments as FIPA writes them.

use std::fmt;

use super::{WireError, bad_value};

/// A moment: `20261121T101500000Z`. Kept as it was written: it may be local time, or relative (`+…`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DateTime(String);

impl DateTime {
    /// Reads `[+]YYYYMMDDThhmmssmmm[letter]`; some platforms write `Z` for the `T`.
    ///
    /// # Errors
    /// It is not of this form, or a field lies outside of its bounds.
    pub fn parse(text: &str) -> Result<Self, WireError> {
        let bad = || bad_value("date-time", text);
        let relative = text.starts_with('+');
        let fields = text.strip_prefix('+').unwrap_or(text).as_bytes();
        let (fields, zone) = fields.split_at_checked(18).ok_or_else(bad)?;
        let zone_ok = match zone {
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
        if in_bounds && zone_ok && matches!(fields[8], b'T' | b'Z') { Ok(Self(text.to_owned())) } else { Err(bad()) }
    }

    /// As written.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for DateTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_middles_zones_and_relative_times_are_read_and_nothing_else() {
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
