//! A test against circular dependencies between the modules of a crate.
//!
//! A module is a file. It depends on another one if its code names something that the other one *defines*, wherever the name was
//! imported from: a path through a parent or the crate's root that only re-exports leads to the definition. So:
//!
//! - `mod child;` and `pub use child::Thing;` alone make no parent depend on its child; using `Thing` in its own code does.
//! - A child that uses a type, function or constant defined in its parent's file depends on the parent. If the parent uses the
//!   child as well, what both need belongs into a file of its own.
//! - A private `use` counts even where its name does not appear again, since it may be a trait's.
//! - Code for tests only does not count.
//!
//! Uses without a path are not detected: methods and fields of a type, and traits called through a value. Files over which the
//! methods of one type are spread are checked by [`method_circles`](crate::method_circles).

use std::{
    collections::{BTreeMap, VecDeque},
    fs,
    path::{Path, PathBuf},
};

use anyhow::Result;

use crate::modules::{Meaning, Modules, ReadFile};

/// The reason why a module depends on another one: the place of a name.
#[derive(Clone, Debug)]
pub(crate) struct Reason {
    pub(crate) line: usize,
    pub(crate) path: String,
}

/// Dependencies between modules, by the index of their scopes.
pub(crate) type Edges = BTreeMap<usize, BTreeMap<usize, Reason>>;

/// The modules of a crate, and their dependencies.
pub(crate) struct Graph {
    pub(crate) modules: Modules,
    pub(crate) edges: Edges,
}

impl Graph {
    pub(crate) fn read(root: &Path, read_file: ReadFile<'_>) -> Result<Self> {
        let modules = Modules::read(root, read_file)?;
        let edges = edges(&modules);
        Ok(Self { modules, edges })
    }

    /// Returns the edges of the shortest circle through a module.
    fn circle(&self, start: usize) -> Vec<(usize, usize)> {
        let mut came_from: BTreeMap<usize, usize> = BTreeMap::new();
        let mut queue = VecDeque::from([start]);
        while let Some(module) = queue.pop_front() {
            for &to in self.edges.get(&module).into_iter().flat_map(BTreeMap::keys) {
                if came_from.contains_key(&to) {
                    continue;
                }
                came_from.insert(to, module);
                queue.push_back(to);
            }
        }
        let (mut path, mut at) = (Vec::new(), start);
        while let Some(&before) = came_from.get(&at) {
            path.push((before, at));
            at = before;
            if at == start {
                break;
            }
        }
        path.reverse();
        path
    }

    /// Describes a group by its shortest circle, one line per edge, with the place.
    fn describe(&self, knot: &[usize], root: &Path) -> String {
        let circles = knot.iter().map(|&module| self.circle(module));
        let shortest = circles.min_by_key(Vec::len).unwrap_or_default();
        let mut text = format!("a knot of {} modules; its shortest circle:\n", knot.len());
        for (from, to) in shortest {
            let (scope, reason) = (&self.modules.scopes[from], &self.edges[&from][&to]);
            let file = scope.file.strip_prefix(root).unwrap_or(&scope.file).display();
            let other = &self.modules.scopes[to].name;
            text += &format!("  {} → {other}: {file}:{}: `{}`\n", scope.name, reason.line, reason.path);
        }
        text
    }
}

/// Returns the groups of nodes that all depend on one another, the largest first.
pub(crate) fn knots<R>(edges: &BTreeMap<usize, BTreeMap<usize, R>>) -> Vec<Vec<usize>> {
    let reached: BTreeMap<usize, Vec<usize>> = edges.keys().map(|&from| (from, reached(edges, from))).collect();
    let is_mutual = |a: usize, b: usize| {
        let leads = |from: usize, to: usize| reached.get(&from).is_some_and(|reached| reached.contains(&to));
        leads(a, b) && leads(b, a)
    };
    let mut knots: Vec<Vec<usize>> = Vec::new();
    for &node in edges.keys().filter(|&&node| is_mutual(node, node)) {
        match knots.iter_mut().find(|knot| is_mutual(knot[0], node)) {
            Some(knot) => knot.push(node),
            None => knots.push(vec![node]),
        }
    }
    knots.sort_by_key(|knot| std::cmp::Reverse(knot.len()));
    knots
}

/// Returns all direct and indirect dependencies of a node; includes itself if it is in a circle.
fn reached<R>(edges: &BTreeMap<usize, BTreeMap<usize, R>>, from: usize) -> Vec<usize> {
    let (mut found, mut next) = (Vec::new(), vec![from]);
    while let Some(node) = next.pop() {
        for &to in edges.get(&node).into_iter().flat_map(BTreeMap::keys) {
            if !found.contains(&to) {
                found.push(to);
                next.push(to);
            }
        }
    }
    found
}

fn edges(modules: &Modules) -> Edges {
    let mut edges = Edges::new();
    for (index, scope) in modules.scopes.iter().enumerate() {
        let mut add = |path: &[String], line: usize| {
            let Some(Meaning::Item(definition)) = modules.resolve(index, path) else { return };
            let to = modules.scopes[definition].module;
            if to != scope.module {
                let reason = Reason { line, path: path.join("::") };
                edges.entry(scope.module).or_default().entry(to).or_insert(reason);
            }
        };
        for import in scope.imports.iter().filter(|import| !import.is_reexport) {
            add(&import.path, import.line);
        }
        for mention in &scope.mentions {
            add(&mention.path, mention.line);
        }
    }
    edges
}

/// Returns the roots of all crates: the name of the crate, and the file.
pub(crate) fn roots(repository: &Path) -> Vec<(String, PathBuf)> {
    let crates = fs::read_dir(repository.join("crates")).expect("the crates");
    let mut folders: Vec<PathBuf> = crates.map(|entry| entry.expect("a crate").path()).collect();
    folders.push(repository.join("xtask"));
    folders.sort();
    let name = |folder: &Path| folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let roots =
        folders.iter().flat_map(|folder| ["src/lib.rs", "src/main.rs"].map(|root| (name(folder), folder.join(root))));
    roots.filter(|(_, root)| root.is_file()).collect()
}

/// Returns the text of a file.
pub(crate) fn read_file(path: &Path) -> Option<String> {
    fs::read_to_string(path).ok()
}

mod tests {
    use super::*;
    use crate::bars::root;

    #[test]
    fn no_modules_stand_in_circles() {
        let repository = root();
        let mut problems = String::new();
        for (name, root) in roots(&repository) {
            let graph = Graph::read(&root, &read_file).unwrap_or_else(|error| panic!("{name}: {error:#}"));
            for knot in knots(&graph.edges) {
                problems += &format!("{name}: {}", graph.describe(&knot, &repository));
            }
        }
        assert!(problems.is_empty(), "modules that depend on one another:\n{problems}");
    }

    /// Returns the dependencies of a crate that consists of some files.
    fn graph(files: &[(&str, &str)]) -> Graph {
        let read_file = |path: &Path| {
            let found = files.iter().find(|(name, _)| Path::new("src").join(name) == path);
            found.map(|(_, text)| (*text).to_owned())
        };
        Graph::read(Path::new("src/lib.rs"), &read_file).expect("a crate")
    }

    fn described(files: &[(&str, &str)]) -> Vec<String> {
        let graph = graph(files);
        knots(&graph.edges).iter().map(|knot| graph.describe(knot, Path::new("src"))).collect()
    }

    const ROOT: (&str, &str) = ("lib.rs", "mod a;\nmod b;\npub use a::A;\npub use b::B;");

    #[test]
    fn a_circle_is_reported_with_its_places() {
        let found = described(&[
            ROOT,
            ("a.rs", "use crate::B;\npub struct A(B);"),
            ("b.rs", "pub struct B;\n\nfn f() { crate::a::A::new(); }"),
        ]);
        let expected = "a knot of 2 modules; its shortest circle:\n  \
            crate::a → crate::b: a.rs:1: `crate::B`\n  crate::b → crate::a: b.rs:3: `crate::a::A::new`\n";
        assert_eq!(found, [expected]);
    }

    #[test]
    fn who_re_exports_is_no_part_of_a_circle() {
        // Both children use what the root only re-exports, and the root itself uses neither.
        assert_eq!(described(&[ROOT, ("a.rs", "pub struct A;"), ("b.rs", "use super::A;\npub struct B(A);")]), [""; 0]);
        let uses_it = ("lib.rs", "mod a;\npub use a::A;\npub struct B(A);");
        assert_eq!(described(&[uses_it, ("a.rs", "pub struct A;")]), [""; 0]);
        assert_eq!(described(&[uses_it, ("a.rs", "pub struct A(Box<crate::B>);")]).len(), 1);
    }

    #[test]
    fn a_child_depends_on_the_file_of_its_parent_for_what_that_defines() {
        let parent = ("a.rs", "mod child;\nfn helper() {}\npub struct A;\nfn f() { child::run(); }");
        let root = ("lib.rs", "mod a;");
        let child = |text| described(&[root, parent, ("a/child.rs", text)]).len();
        assert_eq!(child("pub fn run() {}"), 0);
        assert_eq!(child("pub fn run() { super::helper(); }"), 1);
        assert_eq!(child("use super::*;\npub fn run() { helper(); }"), 1);
        assert_eq!(child("use super::*;\npub fn run() { other(); }"), 0);
        assert_eq!(child("pub fn run() { assert!(super::helper() == ()); }"), 1);
        assert_eq!(child("/// [`helper`](super::helper)\npub fn run() { self.super_helper(); }"), 0);
        assert_eq!(child("#[derive(Error)]\n#[error(\"{}\", super::helper())]\npub struct E;\npub fn run() {}"), 1);
    }

    #[test]
    fn tests_may_know_everything() {
        let root = ("lib.rs", "mod a;\nmod b;");
        let b = ("b.rs", "use crate::a::A;\npub struct B(A);");
        let a = |text| described(&[root, ("a.rs", text), b]).len();
        assert_eq!(a("pub struct A;\n#[cfg(test)]\nmod tests { use crate::b::B; fn f(_: B) {} }"), 0);
        assert_eq!(a("pub struct A;\n#[cfg(test)]\nuse crate::b::B;\n#[test]\nfn f() { crate::b::B; }"), 0);
        assert_eq!(a("pub struct A;\nmod inner { use crate::b::B; fn f(_: B) {} }"), 1);
        assert_eq!(a("pub struct A;\n#[cfg(not(test))]\nuse crate::b::B;"), 1);
    }
}
