//! A test of the order of the folders inside of crates: a folder uses only those before it.
//!
//! A folder is a module of the crate's root with files of its own. Files of the root and the front of a folder (`mod.rs`, or
//! `name.rs` beside it) stand outside of the order; [`circles`](crate::circles) keeps them out of circles.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use crate::{
    bars::root,
    circles::{Graph, read_file, roots},
};

/// The folders of a crate, the lowest first.
const ORDER: &[(&str, &[&str])] = &[
    ("bottega-agents", &["wire", "protocol", "file_store", "platform", "gateway", "driver"]),
    (
        "bottega-cli",
        &["notifications", "cli", "config", "platform", "simulate", "rules", "engines", "analyze", "farm", "manual"],
    ),
    ("bottega-web", &["routes"]),
];

/// Returns the folder of the crate's root that a module lies in. `None`: the module is a file of the root, or a folder's front.
fn folder_of<'a>(module: &'a str, folders: &[&str]) -> Option<&'a str> {
    let mut parts = module.split("::").skip(1);
    let (name, _) = parts.next().zip(parts.next())?;
    folders.contains(&name).then_some(name)
}

/// Returns the names of the folders of a crate's root.
fn folders(graph: &Graph) -> Vec<String> {
    // Modules with a file of their own, below a module of the root
    let files = graph.modules.scopes.iter().enumerate().filter(|(index, scope)| scope.module == *index);
    let names = files.filter_map(|(_, scope)| {
        let mut parts = scope.name.split("::").skip(1);
        let (name, _) = parts.next().zip(parts.next())?;
        Some(name.to_owned())
    });
    let names: BTreeSet<String> = names.collect();
    names.into_iter().collect()
}

/// Returns the uses of a folder that is not before the one that uses it, each with its place.
fn problems(graph: &Graph, order: &[&str], repository: &Path) -> Vec<String> {
    let place: BTreeMap<&str, usize> = order.iter().enumerate().map(|(place, name)| (*name, place)).collect();
    let scopes = &graph.modules.scopes;
    let mut found = Vec::new();
    for (from, edges) in &graph.edges {
        for (to, reason) in edges {
            let folders = (folder_of(&scopes[*from].name, order), folder_of(&scopes[*to].name, order));
            let (Some(user), Some(used)) = folders else { continue };
            if place[used] > place[user] {
                let file = scopes[*from].file.strip_prefix(repository).unwrap_or(&scopes[*from].file).display();
                found.push(format!("{user} uses {used}: {file}:{}: `{}`", reason.line, reason.path));
            }
        }
    }
    found
}

#[test]
fn folders_use_only_those_before_them() {
    let repository = root();
    let roots: BTreeMap<String, _> = roots(&repository).into_iter().collect();
    let mut wrong = Vec::new();
    for (name, order) in ORDER {
        let graph = Graph::read(&roots[*name], &read_file).unwrap_or_else(|error| panic!("{name}: {error:#}"));
        let mut named: Vec<&str> = order.to_vec();
        named.sort_unstable();
        if folders(&graph) != named {
            wrong.push(format!("{name} has the folders {:?}, and the table has {named:?}", folders(&graph)));
        }
        wrong.extend(problems(&graph, order, &repository).into_iter().map(|problem| format!("{name}: {problem}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_folder_that_uses_a_later_one_is_found() {
    let files = BTreeMap::from([
        ("/c/src/lib.rs", "mod low; mod high;"),
        ("/c/src/low.rs", "mod a;"),
        ("/c/src/low/a.rs", "use crate::high::b::B; pub struct A(B);"),
        ("/c/src/high.rs", "pub mod b;"),
        ("/c/src/high/b.rs", "pub struct B;"),
    ]);
    let read = |path: &Path| files.get(path.to_str()?).map(|text| (*text).to_owned());
    let graph = Graph::read(Path::new("/c/src/lib.rs"), &read).expect("modules");
    assert_eq!(folders(&graph), ["high", "low"]);
    assert_eq!(problems(&graph, &["high", "low"], Path::new("/c")), [""; 0]);
    let found = problems(&graph, &["low", "high"], Path::new("/c"));
    assert!(found[0].starts_with("low uses high: src/low/a.rs:1"), "{found:?}");
}
