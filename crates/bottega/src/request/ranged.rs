//! The check of a number's range.

use std::{fmt::Display, ops::RangeInclusive};

use super::InvalidField;

/// A number of a request, or an optional one.
pub(super) trait Ranged<T> {
    /// Checks that the number, if there is one, lies within a range, ends included.
    ///
    /// # Errors
    /// It does not.
    fn check(&self, section: &str, field: &str, range: RangeInclusive<T>) -> Result<(), InvalidField>;
}

/// Checks that a value lies within a range, ends included.
///
/// # Errors
/// It does not.
pub(super) fn within<T: PartialOrd + Display + Copy>(
    field: &str,
    value: T,
    range: RangeInclusive<T>,
) -> Result<(), InvalidField> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(InvalidField::new(field, value, format!("from {} to {} is allowed", range.start(), range.end())))
}

/// Implements the check for types of numbers.
macro_rules! ranged {
    ($($number:ty),*) => {
        $(
            impl Ranged<$number> for $number {
                fn check(&self, section: &str, field: &str, range: RangeInclusive<$number>) -> Result<(), InvalidField> {
                    within(&format!("{section}.{field}"), *self, range)
                }
            }

            impl Ranged<$number> for Option<$number> {
                fn check(&self, section: &str, field: &str, range: RangeInclusive<$number>) -> Result<(), InvalidField> {
                    self.map_or(Ok(()), |number| number.check(section, field, range))
                }
            }
        )*
    };
}

ranged!(u8, u16, u32, u64, f32, f64);
