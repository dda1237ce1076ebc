//! Setting one field of a request by its path.

use serde_json::Value;

use super::{Request, RequestError};

impl Request {
    /// Returns the request with one field changed.
    ///
    /// - `field`: path of the field, such as `film.size` or `scene.defines.spp`.
    /// - `value`: JSON; any other text is taken as a string. `null` removes an optional field.
    ///
    /// # Errors
    /// There is no such field, or the value is not allowed there.
    pub fn with(&self, field: &str, value: &str) -> Result<Self, RequestError> {
        let plain = || Value::String(value.to_owned());
        let json = serde_json::from_str(value);
        match json {
            Err(_) => self.with_value(field, plain()),
            // A number is accepted for a string, since a camera may be called 2
            Ok(json @ (Value::Number(_) | Value::Bool(_))) => {
                self.with_value(field, json).or_else(|error| self.with_value(field, plain()).map_err(|_| error))
            }
            Ok(json) => self.with_value(field, json),
        }
    }

    fn with_value(&self, field: &str, value: Value) -> Result<Self, RequestError> {
        let mut tree = self.to_value()?;
        let mut place = &mut tree;
        let mut parts = field.split('.').peekable();
        while let Some(part) = parts.next() {
            if place.is_null() {
                *place = Value::Object(serde_json::Map::new());
            }
            let Value::Object(members) = place else {
                return Err(RequestError::Text {
                    field: field.to_owned(),
                    problem: format!("there is no such field: `{part}` would be in a value that has no fields"),
                });
            };
            place = members.entry(part).or_insert(Value::Null);
            if parts.peek().is_none() {
                *place = value;
                return Self::from_value(tree);
            }
        }
        Self::from_value(tree)
    }
}
