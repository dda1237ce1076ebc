//! Vectors and matrices as lists of numbers in serialized values; matrices column by column.

use glam::{Affine2, Affine3A, Mat3, Quat, Vec2, Vec3};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A value made of a fixed number of `f32`.
pub(crate) trait NumberArray: Sized {
    type Array: Serialize + for<'de> Deserialize<'de>;

    fn to_numbers(&self) -> Self::Array;

    fn from_numbers(numbers: Self::Array) -> Self;
}

/// Implements [`NumberArray`] by the names of two of the type's methods.
macro_rules! numbers {
    ($($kind:ty: $count:literal, $to:ident, $from:expr;)*) => {
        $(impl NumberArray for $kind {
            type Array = [f32; $count];

            fn to_numbers(&self) -> Self::Array {
                self.$to()
            }

            fn from_numbers(numbers: Self::Array) -> Self {
                $from(numbers)
            }
        })*
    };
}

numbers! {
    Vec2: 2, to_array, Vec2::from_array;
    Vec3: 3, to_array, Vec3::from_array;
    Quat: 4, to_array, Quat::from_array;
    Mat3: 9, to_cols_array, |numbers| Mat3::from_cols_array(&numbers);
    Affine2: 6, to_cols_array, |numbers| Affine2::from_cols_array(&numbers);
    Affine3A: 12, to_cols_array, |numbers| Affine3A::from_cols_array(&numbers);
}

impl NumberArray for [Vec3; 2] {
    type Array = [[f32; 3]; 2];

    fn to_numbers(&self) -> Self::Array {
        self.map(|vector| vector.to_array())
    }

    fn from_numbers(numbers: Self::Array) -> Self {
        numbers.map(Vec3::from_array)
    }
}

/// Serializes a value as its numbers, for `#[serde(with = "crate::numbers")]`.
pub(crate) fn serialize<T: NumberArray, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
    value.to_numbers().serialize(serializer)
}

/// Reads a value from its numbers.
pub(crate) fn deserialize<'de, T: NumberArray, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    T::Array::deserialize(deserializer).map(T::from_numbers)
}

/// A number that may be infinite, which is `null` in a serialized value.
pub(crate) mod maybe_infinite {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(value: &f32, serializer: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f32, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f32::INFINITY))
    }
}
