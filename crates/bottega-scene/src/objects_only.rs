//! Deserialization of JSON and TOML from other programs that rejects lists in place of objects.
//!
//! The readers that serde derives also accept a list for a struct, with its members in order: `["a.bin", 10]` for
//! `{"uri": "a.bin", "byteLength": 10}`. None of the supported formats allows that. [`ObjectsOnly`] around a
//! deserializer rejects it at any depth; everything else is unchanged.

use std::fmt;

use serde::de::{
    Deserialize, DeserializeSeed, Deserializer, EnumAccess, Error, MapAccess, SeqAccess, Unexpected, VariantAccess,
    Visitor,
};

/// A deserializer that rejects a list in place of a struct, at any depth; everything else is unchanged.
#[derive(Debug)]
pub struct ObjectsOnly<D>(pub D);

/// Deserializes a whole JSON text in which structs are objects, not lists.
///
/// # Errors
/// The text is not JSON of this type, has a list in place of a struct, or has more behind it.
pub fn from_json<'de, T: Deserialize<'de>>(json: &'de [u8]) -> serde_json::Result<T> {
    let mut deserializer = serde_json::Deserializer::from_slice(json);
    let value = T::deserialize(ObjectsOnly(&mut deserializer))?;
    deserializer.end()?;
    Ok(value)
}

/// Forwards `deserialize_*` methods, with their arguments before the visitor.
macro_rules! forward {
    ($($method:ident($($argument:ident: $type:ty),*);)*) => {
        $(fn $method<V: Visitor<'de>>(self, $($argument: $type,)* visitor: V) -> Result<V::Value, D::Error> {
            self.0.$method($($argument,)* ForwardedVisitor::<V, false>(visitor))
        })*
    };
}

impl<'de, D: Deserializer<'de>> Deserializer<'de> for ObjectsOnly<D> {
    type Error = D::Error;

    forward! {
        deserialize_any(); deserialize_bool(); deserialize_i8(); deserialize_i16(); deserialize_i32(); deserialize_i64();
        deserialize_i128(); deserialize_u8(); deserialize_u16(); deserialize_u32(); deserialize_u64(); deserialize_u128();
        deserialize_f32(); deserialize_f64(); deserialize_char(); deserialize_str(); deserialize_string();
        deserialize_bytes(); deserialize_byte_buf(); deserialize_option(); deserialize_unit(); deserialize_seq();
        deserialize_map(); deserialize_identifier(); deserialize_ignored_any();
        deserialize_unit_struct(name: &'static str);
        deserialize_newtype_struct(name: &'static str);
        deserialize_tuple(length: usize);
        deserialize_tuple_struct(name: &'static str, length: usize);
        deserialize_enum(name: &'static str, variants: &'static [&'static str]);
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, D::Error> {
        self.0.deserialize_struct(name, fields, ForwardedVisitor::<V, true>(visitor))
    }

    fn is_human_readable(&self) -> bool {
        self.0.is_human_readable()
    }
}

/// A visitor that passes nested values through [`ObjectsOnly`].
struct ForwardedVisitor<V, const IS_STRUCT: bool>(V);

macro_rules! visit {
    ($($method:ident: $type:ty;)*) => {
        $(fn $method<E: Error>(self, value: $type) -> Result<V::Value, E> {
            self.0.$method(value)
        })*
    };
}

impl<'de, V: Visitor<'de>, const IS_STRUCT: bool> Visitor<'de> for ForwardedVisitor<V, IS_STRUCT> {
    type Value = V::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if IS_STRUCT { f.write_str("an object") } else { self.0.expecting(f) }
    }

    visit! {
        visit_bool: bool; visit_i8: i8; visit_i16: i16; visit_i32: i32; visit_i64: i64; visit_i128: i128; visit_u8: u8;
        visit_u16: u16; visit_u32: u32; visit_u64: u64; visit_u128: u128; visit_f32: f32; visit_f64: f64; visit_char: char;
        visit_str: &str; visit_borrowed_str: &'de str; visit_string: String; visit_bytes: &[u8];
        visit_borrowed_bytes: &'de [u8]; visit_byte_buf: Vec<u8>;
    }

    fn visit_none<E: Error>(self) -> Result<V::Value, E> {
        self.0.visit_none()
    }

    fn visit_unit<E: Error>(self) -> Result<V::Value, E> {
        self.0.visit_unit()
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<V::Value, D::Error> {
        self.0.visit_some(ObjectsOnly(deserializer))
    }

    fn visit_newtype_struct<D: Deserializer<'de>>(self, deserializer: D) -> Result<V::Value, D::Error> {
        self.0.visit_newtype_struct(ObjectsOnly(deserializer))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<V::Value, A::Error> {
        if IS_STRUCT {
            return Err(Error::invalid_type(Unexpected::Seq, &"an object"));
        }
        self.0.visit_seq(InnerAccess(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, members: A) -> Result<V::Value, A::Error> {
        self.0.visit_map(InnerAccess(members))
    }

    fn visit_enum<A: EnumAccess<'de>>(self, variant: A) -> Result<V::Value, A::Error> {
        self.0.visit_enum(InnerAccess(variant))
    }
}

/// Access to the values within a list, map or enum, which pass through [`ObjectsOnly`].
struct InnerAccess<A>(A);

/// The seed of a nested value.
struct Inner<S>(S);

impl<'de, S: DeserializeSeed<'de>> DeserializeSeed<'de> for Inner<S> {
    type Value = S::Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<S::Value, D::Error> {
        self.0.deserialize(ObjectsOnly(deserializer))
    }
}

impl<'de, A: SeqAccess<'de>> SeqAccess<'de> for InnerAccess<A> {
    type Error = A::Error;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, A::Error> {
        self.0.next_element_seed(Inner(seed))
    }

    fn size_hint(&self) -> Option<usize> {
        self.0.size_hint()
    }
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for InnerAccess<A> {
    type Error = A::Error;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, A::Error> {
        self.0.next_key_seed(Inner(seed))
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, A::Error> {
        self.0.next_value_seed(Inner(seed))
    }

    fn size_hint(&self) -> Option<usize> {
        self.0.size_hint()
    }
}

impl<'de, A: EnumAccess<'de>> EnumAccess<'de> for InnerAccess<A> {
    type Error = A::Error;
    type Variant = InnerAccess<A::Variant>;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, Self::Variant), A::Error> {
        let (value, variant) = self.0.variant_seed(Inner(seed))?;
        Ok((value, InnerAccess(variant)))
    }
}

impl<'de, A: VariantAccess<'de>> VariantAccess<'de> for InnerAccess<A> {
    type Error = A::Error;

    fn unit_variant(self) -> Result<(), A::Error> {
        self.0.unit_variant()
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, A::Error> {
        self.0.newtype_variant_seed(Inner(seed))
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, A::Error> {
        self.0.tuple_variant(length, ForwardedVisitor::<V, false>(visitor))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, A::Error> {
        self.0.struct_variant(fields, ForwardedVisitor::<V, true>(visitor))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[derive(Debug, PartialEq, serde::Deserialize)]
    struct Part {
        name: String,
        sizes: [f32; 2],
        inner: Option<Box<Part>>,
        #[serde(default)]
        all: Vec<Part>,
        #[serde(default)]
        named: BTreeMap<String, Kind>,
    }

    #[derive(Debug, PartialEq, serde::Deserialize)]
    enum Kind {
        Plain,
        Number(f32),
        Pair(f32, f32),
        Whole { part: Part },
    }

    #[test]
    fn ordinary_objects_are_read_unchanged() {
        let json = r#"{"name": "a", "sizes": [1, 2], "inner": {"name": "b", "sizes": [0.5, -1], "inner": null},
            "all": [{"name": "c", "sizes": [0, 0]}],
            "named": {"x": "Plain", "y": {"Number": 2}, "z": {"Pair": [1, 2]},
                "w": {"Whole": {"part": {"name": "d", "sizes": [3, 4]}}}}}"#;
        let plain: Part = serde_json::from_str(json).unwrap();
        assert_eq!(from_json::<Part>(json.as_bytes()).unwrap(), plain);
        let value: serde_json::Value = serde_json::from_str(json).unwrap();
        assert_eq!(Part::deserialize(ObjectsOnly(value)).unwrap(), plain);
        assert!(from_json::<Part>(format!("{json} 1").as_bytes()).is_err());
    }

    #[test]
    fn a_list_is_not_an_object_at_any_depth() {
        for json in [
            r#"["a", [1, 2], null, [], {}]"#,
            r#"{"name": "a", "sizes": [1, 2], "inner": ["b", [1, 2], null, [], {}]}"#,
            r#"{"name": "a", "sizes": [1, 2], "all": [["b", [1, 2], null, [], {}]]}"#,
            r#"{"name": "a", "sizes": [1, 2], "named": {"w": {"Whole": {"part": ["b", [1, 2], null, [], {}]}}}}"#,
            r#"{"name": "a", "sizes": [1, 2], "named": {"w": {"Whole": [{"name": "b", "sizes": [1, 2]}]}}}"#,
        ] {
            assert!(serde_json::from_str::<Part>(json).is_ok(), "{json}");
            let error = from_json::<Part>(json.as_bytes()).unwrap_err().to_string();
            assert!(error.contains("expected an object at line 1 column"), "{json}: {error}");
        }
    }
}
