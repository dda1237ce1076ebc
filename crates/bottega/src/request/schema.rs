//! The JSON Schema of requests: all fields, their documentation and their defaults.

use serde_json::Value;

use super::Request;

impl Request {
    /// Returns the JSON Schema of requests, for editors and other programs.
    pub fn schema() -> schemars::Schema {
        schemars::schema_for!(Self)
    }

    /// Returns the fields of a request, those of its sections by their path, in the order of the schema.
    pub fn fields() -> Vec<RequestField> {
        let schema = Self::schema();
        let mut fields = Vec::new();
        collect(schema.as_value(), schema.as_value(), "", &mut fields);
        fields
    }
}

/// A field of a request, as its schema describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct RequestField {
    /// Path of the field, such as `film.size`.
    pub path: String,
    /// The documentation, in sentences.
    pub description: String,
    /// The default; `null`: none.
    pub default: Value,
}

/// Appends the fields of an object, those of sections in place of the section.
fn collect(schema: &Value, object: &Value, path: &str, fields: &mut Vec<RequestField>) {
    for (name, field) in object["properties"].as_object().into_iter().flatten() {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        let target = target(schema, field);
        if target["properties"].is_object() {
            collect(schema, target, &path, fields);
            continue;
        }
        let text = field["description"].as_str().unwrap_or_default();
        let description = text.split_whitespace().collect::<Vec<_>>().join(" ");
        fields.push(RequestField { path, description, default: field["default"].clone() });
    }
}

/// Returns the schema of a field, or of the type that it refers to; `None`: there is no such field.
pub(super) fn field_schema<'a>(schema: &'a Value, path: &str) -> Option<&'a Value> {
    path.split('.').try_fold(schema, |object, name| Some(target(schema, object["properties"].get(name)?)))
}

/// Returns the type that a field refers to, or the field itself. An optional section refers to its type, too.
fn target<'a>(schema: &'a Value, field: &'a Value) -> &'a Value {
    let cases = field["anyOf"].as_array().into_iter().flatten();
    let named = std::iter::once(field).chain(cases).find_map(|case| case["$ref"].as_str());
    let found = named.and_then(|name| schema.pointer(name.trim_start_matches('#')));
    found.unwrap_or(field)
}
