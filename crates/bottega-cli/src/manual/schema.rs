//! The manual's page of all fields of a request, from its JSON Schema.

use std::fmt::Write;

use serde_json::{Map, Value};

const HEAD: &str = "<!-- Made by `cargo xtask manual`; do not edit. -->

# Fields of a request

`bottega request schema` prints the JSON Schema that this page is made from. [Requests](../requests.md) explains them, with the option of
each field. `null` and a field that is left out mean the same.
";

/// Returns the page on requests: a section for the request and for each kind of object in it.
pub(super) fn reference(schema: &Value) -> String {
    let mut page = HEAD.to_owned();
    // Writing to a `String` cannot fail.
    _ = write!(page, "\n## Request\n\n");
    write_type(&mut page, schema);
    for (name, inner) in schema["$defs"].as_object().into_iter().flatten() {
        _ = write!(page, "\n## {name}\n\n");
        write_type(&mut page, inner);
    }
    page
}

fn write_type(page: &mut String, schema: &Value) {
    if let Some(text) = schema["description"].as_str() {
        _ = write!(page, "{text}\n\n");
    }
    let cases = ["oneOf", "anyOf"].into_iter().find_map(|key| schema[key].as_array());
    if let Some(fields) = schema["properties"].as_object() {
        page.push_str("| field | type | default | what |\n|---|---|---|---|\n");
        for (name, field) in fields {
            _ = writeln!(page, "| `{name}` | {} | {} | {} |", kind(field), default(field), cell(field));
        }
    } else if let Some(cases) = cases {
        page.push_str("| value | what |\n|---|---|\n");
        for case in cases {
            _ = writeln!(page, "| {} | {} |", kind(case), cell(case));
        }
    } else {
        _ = writeln!(page, "{}", kind(schema));
    }
}

/// Returns the type of a field's value.
fn kind(field: &Value) -> String {
    if let Some(name) = field["$ref"].as_str() {
        let name = name.rsplit('/').next().unwrap_or(name);
        return format!("[{name}](#{})", name.to_ascii_lowercase());
    }
    if let Some(cases) = ["oneOf", "anyOf"].into_iter().find_map(|key| field[key].as_array()) {
        let kinds: Vec<String> = cases.iter().filter(|case| case["type"] != "null").map(kind).collect();
        return kinds.join(", ");
    }
    if let Some(value) = field.get("const") {
        return format!("`{value}`");
    }
    if let Some(values) = field["enum"].as_array() {
        let values: Vec<String> = values.iter().map(|value| format!("`{value}`")).collect();
        return values.join(", ");
    }
    let types: Vec<&str> = match &field["type"] {
        Value::String(name) => vec![name],
        Value::Array(names) => names.iter().filter_map(Value::as_str).filter(|name| *name != "null").collect(),
        _ => Vec::new(),
    };
    match types.as_slice() {
        ["array"] => array(field),
        ["object"] => object(field),
        ["integer" | "number"] => format!("{}{}", types[0], range(field)),
        [] => "anything".to_owned(),
        _ => types.join(" or "),
    }
}

fn array(field: &Value) -> String {
    if let Some(parts) = field["prefixItems"].as_array() {
        return format!("`[` {} `]`", parts.iter().map(kind).collect::<Vec<_>>().join(", "));
    }
    match (field["minItems"].as_u64(), field["maxItems"].as_u64()) {
        (Some(least), Some(most)) if least == most => format!("{least} × {}", kind(&field["items"])),
        _ => format!("list of {}", kind(&field["items"])),
    }
}

fn object(field: &Value) -> String {
    let fields = field["properties"].as_object().map(Map::iter).into_iter().flatten();
    let fields: Vec<String> = fields.map(|(name, inner)| format!("`{name}`: {}", kind(inner))).collect();
    match (fields.is_empty(), field.get("additionalProperties")) {
        (true, Some(inner)) if inner.is_object() => format!("object of {}", kind(inner)),
        (true, _) => "object".to_owned(),
        (false, _) => format!("`{{` {} `}}`", fields.join(", ")),
    }
}

fn range(field: &Value) -> String {
    let least = field["minimum"].as_f64().map(|bound| format!("from {bound}"));
    let above = field["exclusiveMinimum"].as_f64().map(|bound| format!("above {bound}"));
    let most = field["maximum"].as_f64().map(|bound| format!("to {bound}"));
    let parts: Vec<String> = [least, above, most].into_iter().flatten().collect();
    if parts.is_empty() { String::new() } else { format!(" {}", parts.join(" ")) }
}

/// Returns the default; for a section, its fields have their own.
fn default(field: &Value) -> String {
    match field.get("default") {
        None | Some(Value::Null) => "none".to_owned(),
        Some(Value::Object(fields)) if !fields.is_empty() => "as its fields".to_owned(),
        Some(value) => format!("`{value}`"),
    }
}

/// Formats the description as one cell of a table.
fn cell(field: &Value) -> String {
    let text = field["description"].as_str().unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn fields_say_what_may_stand_in_them() {
        assert_eq!(kind(&json!({"type": ["integer", "null"], "minimum": 1, "maximum": 9})), "integer from 1 to 9");
        assert_eq!(
            kind(&json!({"anyOf": [{"$ref": "#/$defs/FrameOptions"}, {"type": "null"}]})),
            "[FrameOptions](#frameoptions)"
        );
        assert_eq!(kind(&json!({"type": "array", "items": {"type": "string"}})), "list of string");
        assert_eq!(default(&json!({"default": ["auto"]})), "`[\"auto\"]`");
    }

    #[test]
    fn every_section_of_a_request_is_there() {
        let page = reference(bottega::Request::schema().as_value());
        for name in ["## SceneOptions", "## GoalOptions", "| `samples` |", "[GoalOptions](#goaloptions)"] {
            assert!(page.contains(name), "{name}: {page}");
        }
        // Every schema construct is translated; none appears verbatim.
        assert!(!page.contains("anything") && !page.contains("$ref"), "{page}");
    }
}
