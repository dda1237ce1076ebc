//! Setting one field of a request by its path.

use serde_json::Value;

use super::{Request, RequestError, schema::field_schema};

impl Request {
    /// Returns the request with one field changed.
    ///
    /// - `field`: path of the field, such as `film.size` or `scene.defines.spp`.
    /// - `value`: JSON; any other text is taken as a string. `null` removes an optional field. The values of a list may be
    ///   written with commas between them: `640,480`.
    ///
    /// # Errors
    /// There is no such field, or the value is not allowed there.
    pub fn with(&self, field: &str, value: &str) -> Result<Self, RequestError> {
        let plain = || Value::String(value.to_owned());
        match serde_json::from_str(value) {
            Ok(json @ (Value::Array(_) | Value::Null)) => self.with_value(field, json),
            _ if is_list(field) => self.with_list(field, value),
            Err(_) => self.with_value(field, plain()),
            // A number is accepted for a string, since a camera may be called 2
            Ok(json @ (Value::Number(_) | Value::Bool(_))) => {
                self.with_value(field, json).or_else(|error| self.with_value(field, plain()).map_err(|_| error))
            }
            Ok(json) => self.with_value(field, json),
        }
    }

    /// Sets a list from its values with commas between them: each is JSON, or else a string.
    fn with_list(&self, field: &str, values: &str) -> Result<Self, RequestError> {
        let text = |value: &str| Value::String(value.trim().to_owned());
        let json = |value: &str| serde_json::from_str(value).unwrap_or_else(|_| text(value));
        let list = |value: &dyn Fn(&str) -> Value| Value::Array(values.split(',').map(value).collect());
        self.with_value(field, list(&json)).or_else(|error| self.with_value(field, list(&text)).map_err(|_| error))
    }

    fn with_value(&self, field: &str, value: Value) -> Result<Self, RequestError> {
        let mut tree = self.to_value()?;
        let mut place = &mut tree;
        let mut parts = field.split('.').peekable();
        let mut path = String::new();
        while let Some(part) = parts.next() {
            // Replace a word by the object that other values of a choice are, as in `work.bands.pixels`
            if place.is_null() || place.is_string() && is_choice(&path) {
                *place = Value::Object(serde_json::Map::new());
            }
            let Value::Object(members) = place else {
                return Err(RequestError::Text {
                    field: field.to_owned(),
                    problem: format!("there is no such field: `{part}` would be in a value that has no fields"),
                });
            };
            place = members.entry(part).or_insert(Value::Null);
            path = if path.is_empty() { part.to_owned() } else { format!("{path}.{part}") };
            if parts.peek().is_none() {
                *place = value;
                return Self::from_value(tree);
            }
        }
        Self::from_value(tree)
    }
}

/// Returns true if the value of a field is a list.
fn is_list(field: &str) -> bool {
    schema_of(field).is_some_and(|found| match &found["type"] {
        Value::Array(types) => types.iter().any(|name| name == "array"),
        name => name == "array",
    })
}

/// Returns true if the value of a field is a word or an object.
fn is_choice(field: &str) -> bool {
    schema_of(field).is_some_and(|found| found["oneOf"].is_array())
}

/// Returns the schema of a field; `None`: there is no such field.
fn schema_of(field: &str) -> Option<Value> {
    field_schema(Request::schema().as_value(), field).cloned()
}
