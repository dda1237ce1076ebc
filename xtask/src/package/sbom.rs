//! The software bill of materials, as CycloneDX 1.6.

use serde_json::{Value, json};

use super::{
    components::{Component, PROGRAM},
    tools::VERSION,
};

/// Returns the bill: the crates in the program, and their dependencies.
pub(super) fn bill(components: &[Component]) -> Value {
    let (program, parts): (Vec<&Component>, Vec<&Component>) =
        components.iter().partition(|component| component.package.name.as_str() == PROGRAM);
    let program: Vec<Value> = program.iter().map(|it| entry(it, "application")).collect();
    let parts: Vec<Value> = parts.iter().map(|it| entry(it, "library")).collect();
    let dependencies: Vec<Value> =
        components.iter().map(|it| json!({"ref": it.reference(), "dependsOn": it.uses})).collect();
    json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": program.first(),
            "tools": {"components": [{"type": "application", "name": "cargo xtask package", "version": VERSION}]},
        },
        "components": parts,
        "dependencies": dependencies,
    })
}

fn entry(component: &Component, kind: &str) -> Value {
    let package = &component.package;
    let mut entry = json!({
        "type": kind,
        "bom-ref": component.reference(),
        "name": package.name.as_str(),
        "version": package.version.to_string(),
        "licenses": [{"expression": component.expression()}],
        "scope": "required",
    });
    if component.is_foreign() {
        entry["purl"] = json!(format!("pkg:cargo/{}@{}", package.name, package.version));
    }
    if let Some(checksum) = &component.checksum {
        entry["hashes"] = json!([{"alg": "SHA-256", "content": checksum}]);
    }
    if let Some(address) = &package.repository {
        entry["externalReferences"] = json!([{"type": "vcs", "url": address}]);
    }
    entry
}

/// Checks that each component occurs once, has a licence, and that its dependencies are listed.
#[cfg(test)]
pub(super) fn check(bill: &Value) {
    let text = |value: &Value| value.as_str().expect("text").to_owned();
    let program = &bill["metadata"]["component"];
    let all: Vec<&Value> = bill["components"].as_array().expect("a list").iter().chain([program]).collect();
    let mut names: Vec<String> = all.iter().map(|entry| text(&entry["bom-ref"])).collect();
    names.sort();
    let count = names.len();
    names.dedup();
    assert_eq!(names.len(), count);
    for entry in &all {
        assert!(!text(&entry["licenses"][0]["expression"]).is_empty(), "{entry}");
        assert!(entry.get("purl").is_none() || entry["hashes"][0]["content"].as_str().is_some_and(|it| it.len() == 64));
    }
    for dependency in bill["dependencies"].as_array().expect("a list") {
        let used = dependency["dependsOn"].as_array().expect("a list");
        assert!(used.iter().chain([&dependency["ref"]]).all(|name| names.contains(&text(name))), "{dependency}");
    }
}
