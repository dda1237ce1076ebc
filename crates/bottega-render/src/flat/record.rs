//! Records of 32-bit words: one declaration for the writer and for the offsets of fields on a device.

use glam::{Mat3, Vec2, Vec3, Vec4};

/// A value that is written as a fixed number of 32-bit words.
pub trait Portable {
    /// Number of words of the value.
    const WORDS: u32;
    /// Appends the words of the value.
    fn put(&self, words: &mut Vec<u32>);
}

/// A [`Portable`] struct of consecutive named fields; declared by [`record!`](crate::record).
pub trait Record: Portable {
    /// Names and offsets of its fields, in order.
    const FIELDS: &'static [FieldPlace];
}

/// The name of a field of a record, and its offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldPlace {
    /// Name of the field.
    pub name: &'static str,
    /// Offset in words from the start of the record.
    pub first: u32,
}

/// Returns the names and offsets of consecutive fields, given their names and numbers of words.
pub const fn places<const N: usize>(fields: [(&'static str, u32); N]) -> [FieldPlace; N] {
    let mut places = [FieldPlace { name: "", first: 0 }; N];
    let (mut index, mut first) = (0, 0);
    while index < N {
        places[index] = FieldPlace { name: fields[index].0, first };
        first += fields[index].1;
        index += 1;
    }
    places
}

/// Returns the offset of the field with a name, in words from the start of its record.
///
/// # Panics
///
/// If there is no such field: in a constant, this is a compile error.
pub const fn place_of(fields: &[FieldPlace], name: &str) -> u32 {
    let mut index = 0;
    while index < fields.len() {
        if is_same(fields[index].name.as_bytes(), name.as_bytes()) {
            return fields[index].first;
        }
        index += 1;
    }
    panic!("no such field")
}

const fn is_same(a: &[u8], b: &[u8]) -> bool {
    let mut index = 0;
    while index < a.len() && index < b.len() && a[index] == b[index] {
        index += 1;
    }
    index == a.len() && index == b.len()
}

/// Declares a struct as a [`Record`]. With `in N`, the record is padded with zeros to N words.
///
/// ```
/// bottega_render::record! {
///     /// A ball.
///     pub struct Ball in 4 {
///         /// Its middle.
///         pub center: glam::Vec2,
///         pub material: u32,
///     }
/// }
/// use bottega_render::flat::{Portable, Record, place_of};
/// const MATERIAL: u32 = place_of(Ball::FIELDS, "material");
/// let mut words = Vec::new();
/// Ball { center: glam::Vec2::ZERO, material: 7 }.put(&mut words);
/// assert_eq!((words, MATERIAL, Ball::WORDS), (vec![0, 0, 7, 0], 2, 4));
/// ```
#[macro_export]
macro_rules! record {
    ($(#[$attribute:meta])* $visible:vis struct $name:ident $(in $words:literal)? {
        $( $(#[$field_attribute:meta])* $field_visible:vis $field:ident: $type:ty ),* $(,)?
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        $visible struct $name { $( $(#[$field_attribute])* $field_visible $field: $type ),* }

        impl $crate::flat::Record for $name {
            const FIELDS: &'static [$crate::flat::FieldPlace] = &$crate::flat::places(
                [$( (stringify!($field), <$type as $crate::flat::Portable>::WORDS) ),*]);
        }

        impl $crate::flat::Portable for $name {
            const WORDS: u32 = {
                let own = 0 $( + <$type as $crate::flat::Portable>::WORDS )*;
                $( assert!(own <= $words, "the record is longer than it may be"); let own = $words; )?
                own
            };
            fn put(&self, words: &mut Vec<u32>) {
                let start = words.len();
                $( $crate::flat::Portable::put(&self.$field, words); )*
                words.resize(start + <Self as $crate::flat::Portable>::WORDS as usize, 0);
            }
        }
    };
}

impl Portable for u32 {
    const WORDS: u32 = 1;
    fn put(&self, words: &mut Vec<u32>) {
        words.push(*self);
    }
}

impl Portable for i32 {
    const WORDS: u32 = 1;
    fn put(&self, words: &mut Vec<u32>) {
        words.push(self.cast_unsigned());
    }
}

impl Portable for bool {
    const WORDS: u32 = 1;
    fn put(&self, words: &mut Vec<u32>) {
        words.push(u32::from(*self));
    }
}

impl Portable for f32 {
    const WORDS: u32 = 1;
    fn put(&self, words: &mut Vec<u32>) {
        words.push(self.to_bits());
    }
}

impl<T: Portable, const N: usize> Portable for [T; N] {
    const WORDS: u32 = T::WORDS * N as u32;
    fn put(&self, words: &mut Vec<u32>) {
        self.iter().for_each(|part| part.put(words));
    }
}

impl Portable for Vec2 {
    const WORDS: u32 = 2;
    fn put(&self, words: &mut Vec<u32>) {
        self.to_array().put(words);
    }
}

impl Portable for Vec3 {
    const WORDS: u32 = 3;
    fn put(&self, words: &mut Vec<u32>) {
        self.to_array().put(words);
    }
}

impl Portable for Vec4 {
    const WORDS: u32 = 4;
    fn put(&self, words: &mut Vec<u32>) {
        self.to_array().put(words);
    }
}

/// Column-major.
impl Portable for Mat3 {
    const WORDS: u32 = 9;
    fn put(&self, words: &mut Vec<u32>) {
        self.to_cols_array().put(words);
    }
}
