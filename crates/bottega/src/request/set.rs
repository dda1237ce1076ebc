//! One field of a request, set by its path.

use serde_json::Value;

use super::{Request, RequestError};

impl Request {
    /// The same request with one field set.
    ///
    /// - `field`: the path, such as `film.size` or `scene.defines.spp`.
    /// - `value`: JSON; what is no JSON is taken as text. `null` is the field's absence.
    ///
    /// # Errors
    /// There is no such field, or the value is not allowed there.
    pub fn with(&self, field: &str, value: &str) -> Result<Self, RequestError> {
        let plain = || Value::String(value.to_owned());
        let json = serde_json::from_str(value);
        match json {
            Err(_) => self.with_value(field, plain()),
            // A number where text is wanted is text: a camera may be called 2.
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
