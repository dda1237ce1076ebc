//! Declarations of the types and constants that Rust and WGSL share.

use std::borrow::Cow;
use std::fmt::Write as _;

use bottega_render::flat::{FieldPlace, Record};

/// The value of a shared constant.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    U32(u32),
    F32(f32),
    /// A vector of floats.
    Floats(Cow<'static, [f32]>),
    /// A vector of words.
    Words(Cow<'static, [u32]>),
}

/// A constant of the shaders.
#[derive(Clone, Debug)]
pub(crate) struct Constant {
    pub(crate) name: Cow<'static, str>,
    pub(crate) docs: &'static [&'static str],
    pub(crate) value: Value,
}

impl Constant {
    /// Returns the constant's WGSL declaration, with its documentation as comments.
    pub(crate) fn wgsl(&self) -> String {
        let docs = self.docs.iter().map(|line| format!("//{line}\n")).collect::<String>();
        let (name, value) = (&self.name, &self.value);
        let list = |numbers: Vec<String>| numbers.join(", ");
        let (type_name, value) = match value {
            Value::U32(number) => ("u32".to_owned(), format!("{number}u")),
            Value::F32(number) => ("f32".to_owned(), format!("{number:?}f")),
            Value::Floats(numbers) => {
                let type_name = format!("vec{}<f32>", numbers.len());
                let value = list(numbers.iter().map(|number| format!("{number:?}f")).collect());
                (type_name.clone(), format!("{type_name}({value})"))
            }
            Value::Words(numbers) => {
                let type_name = format!("vec{}<u32>", numbers.len());
                let value = list(numbers.iter().map(|number| format!("{number}u")).collect());
                (type_name.clone(), format!("{type_name}({value})"))
            }
        };
        format!("{docs}const {name}: {type_name} = {value};\n")
    }
}

/// Declares constants for both languages, and a table of them.
macro_rules! constants {
    (@value u32 $name:ident) => { $crate::shared::declare::Value::U32($name) };
    (@value f32 $name:ident) => { $crate::shared::declare::Value::F32($name) };
    (@value [f32; $n:literal] $name:ident) => {
        $crate::shared::declare::Value::Floats(::std::borrow::Cow::Borrowed(&$name))
    };
    (@value [u32; $n:literal] $name:ident) => {
        $crate::shared::declare::Value::Words(::std::borrow::Cow::Borrowed(&$name))
    };
    (
        $(#[$about:meta])* $table:ident;
        $( $(#[doc = $doc:literal])* $name:ident: $type:tt = $value:expr; )*
    ) => {
        $( $(#[doc = $doc])* pub(crate) const $name: $type = $value; )*

        $(#[$about])*
        pub(in crate::shared) const $table: &[$crate::shared::declare::Constant] = &[$(
            $crate::shared::declare::Constant {
                name: ::std::borrow::Cow::Borrowed(stringify!($name)),
                docs: &[$($doc),*],
                value: $crate::shared::declare::constants!(@value $type $name),
            }
        ),*];
    };
}
pub(super) use constants;

/// The places of a record's fields: a constant per field, `PREFIX_FIELD`.
#[derive(Debug)]
pub(crate) struct Layout {
    prefix: &'static str,
    fields: &'static [FieldPlace],
    /// The unit of the places, in words.
    unit: u32,
    /// The size of the record in words; `None`: shaders do not need it.
    words: Option<u32>,
}

impl Layout {
    /// Declares places in words, and the size of the record.
    pub(crate) const fn of<R: Record>(prefix: &'static str) -> Self {
        Self { prefix, fields: R::FIELDS, unit: 1, words: Some(R::WORDS) }
    }

    /// Declares places in multiples of `unit` words.
    pub(crate) const fn counted<R: Record>(prefix: &'static str, unit: u32) -> Self {
        Self { prefix, fields: R::FIELDS, unit, words: None }
    }

    pub(crate) fn constants(&self) -> impl Iterator<Item = Constant> {
        let constant = |name: &str, number: u32| Constant {
            name: format!("{}_{}", self.prefix, name.to_uppercase()).into(),
            docs: &[],
            value: Value::U32(number),
        };
        let words = self.words.map(|words| constant("words", words));
        self.fields.iter().map(move |field| constant(field.name, field.first / self.unit)).chain(words)
    }
}

/// A type of both languages.
pub(crate) trait SharedType {
    /// The name of the type in WGSL.
    const NAME: &'static str;
}

impl SharedType for u32 {
    const NAME: &'static str = "u32";
}

impl SharedType for f32 {
    const NAME: &'static str = "f32";
}

impl SharedType for [u32; 2] {
    const NAME: &'static str = "vec2<u32>";
}

impl SharedType for glam::Vec3 {
    const NAME: &'static str = "vec3<f32>";
}

/// A struct of both languages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DeclaredType {
    pub(crate) name: &'static str,
    pub(crate) fields: &'static [DeclaredField],
    /// The size in bytes.
    #[cfg(test)]
    pub(crate) size: usize,
}

/// A field of a struct of both languages.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DeclaredField {
    pub(crate) name: &'static str,
    pub(crate) type_name: &'static str,
    /// The offset in bytes.
    #[cfg(test)]
    pub(crate) offset: usize,
}

impl DeclaredType {
    pub(crate) fn wgsl(&self) -> String {
        let mut text = format!("struct {} {{\n", self.name);
        for DeclaredField { name, type_name, .. } in self.fields {
            let _ = writeln!(text, "    {name}: {type_name},");
        }
        text + "}\n"
    }
}

/// Declares a struct for both languages that is copied to buffers byte by byte.
macro_rules! buffer_struct {
    ($(#[$attribute:meta])* struct $name:ident {
        $( $(#[$field_attribute:meta])* $field:ident: $type:ty ),* $(,)?
    }) => {
        $(#[$attribute])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, ::bytemuck::Pod, ::bytemuck::Zeroable)]
        pub(crate) struct $name { $( $(#[$field_attribute])* pub(crate) $field: $type ),* }

        impl $name {
            pub(in crate::shared) const DECLARED: $crate::shared::declare::DeclaredType = $crate::shared::declare::DeclaredType {
                name: stringify!($name),
                fields: &[$( $crate::shared::declare::DeclaredField {
                    name: stringify!($field),
                    type_name: <$type as $crate::shared::declare::SharedType>::NAME,
                    #[cfg(test)]
                    offset: ::std::mem::offset_of!($name, $field),
                } ),*],
                #[cfg(test)]
                size: size_of::<$name>(),
            };
        }
    };
}
pub(super) use buffer_struct;
