//! The OpenAPI document of the API, made from the table of routes and their types.

use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

use crate::{
    problem::Problem,
    route::{Route, RouteAnswer, RouteBody},
};

/// Returns the routes as an OpenAPI 3.1 document.
pub(crate) fn document(routes: &[Route]) -> Value {
    let settings = SchemaSettings::draft2020_12().with(|settings| {
        settings.definitions_path = "/components/schemas".into();
        settings.meta_schema = None;
    });
    let mut generator = settings.into_generator();
    let problem = generator.subschema_for::<Problem>();
    let mut paths: Map<String, Value> = Map::new();
    for route in routes {
        let description = operation(route, &mut generator);
        paths.entry(route.path).or_insert_with(|| json!({}))[route.method] = description;
    }
    let schemas = generator.take_definitions(true);
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "Bottega",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "The farm for browsers and other programs. Errors are RFC 9457 problems. Routes that change something need \
                a token that steers; the others take one that sees, too. This document and the schema of requests need none.",
        },
        "security": [{ "bearer": [] }, { "cookie": [] }],
        "paths": paths,
        "components": {
            "schemas": schemas,
            "responses": {
                "Problem": {
                    "description": "The reason for the failure.",
                    "content": { "application/problem+json": { "schema": problem } },
                },
            },
            "securitySchemes": {
                "bearer": { "type": "http", "scheme": "bearer" },
                "cookie": { "type": "apiKey", "in": "cookie", "name": "bottega_PORT" },
            },
        },
    })
}

fn operation(route: &Route, generator: &mut schemars::SchemaGenerator) -> Value {
    let content = match route.answer {
        RouteAnswer::Json(schema) => json!({ "application/json": { "schema": schema(generator) } }),
        RouteAnswer::Media(kind) => json!({ kind: {} }),
        RouteAnswer::Nothing => json!({}),
    };
    let mut done = json!({ "description": "Done." });
    if !matches!(route.answer, RouteAnswer::Nothing) {
        done["content"] = content;
    }
    let parameter = |name: &str| {
        let schema = if ["id", "from", "zone", "viewport", "picture"].contains(&name) {
            json!({ "type": "integer", "minimum": 0 })
        } else {
            json!({ "type": "string" })
        };
        json!({ "name": name, "in": "path", "required": true, "schema": schema })
    };
    let parameters: Vec<Value> = parameters(route.path).map(parameter).collect();
    let mut described = json!({
        "operationId": name(route),
        "summary": route.summary,
        "x-role": if route.is_open { "none" } else { route.role.word() },
        "parameters": parameters,
        "responses": { route.status.as_str(): done, "default": { "$ref": "#/components/responses/Problem" } },
    });
    if route.is_open {
        described["security"] = json!([]);
    }
    let body = match route.taken {
        RouteBody::Nothing => return described,
        RouteBody::Json(schema) => json!({ "application/json": { "schema": schema(generator) } }),
        RouteBody::Bytes => json!({ "application/octet-stream": {} }),
    };
    described["requestBody"] = json!({ "required": true, "content": body });
    described
}

fn parameters(path: &str) -> impl Iterator<Item = &str> {
    path.split('/').filter_map(|part| part.strip_prefix('{')?.strip_suffix('}'))
}

/// Returns the unique name of a route, such as `get_jobs_zones`.
fn name(route: &Route) -> String {
    let parts = route.path.split('/').filter(|part| !part.is_empty() && *part != "api");
    let words = parts.map(|part| match part.strip_prefix('{').and_then(|part| part.strip_suffix('}')) {
        Some(parameter) => format!("by_{parameter}"),
        None => part.replace('.', "_"),
    });
    std::iter::once(route.method.to_owned()).chain(words).collect::<Vec<_>>().join("_")
}
