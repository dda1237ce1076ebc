//! A test against circles between the files over which the methods of one type are spread.
//!
//! A file with an `impl` block of a type depends on the file of another such block if it calls a method of that block:
//! `self.method()`, `Self::function()`, `Type::function()`. If such calls run both ways, neither file can be read without
//! the other, and the type should be split into values with their own fields. The table [`KNOWN`] may only shrink.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use anyhow::Result;
use proc_macro2::{Delimiter, Ident, TokenStream, TokenTree};
use syn::{
    Expr, ExprMethodCall, ImplItem, Item, ItemImpl, Type,
    visit::{self, Visit},
};

use crate::{
    circles::knots,
    modules::{Meaning, Modules, ReadFile, attributes, is_for_tests},
};

/// The types whose files still call each other in circles: crate, type, and the number of files in circles.
const KNOWN: [(&str, &str, usize); 7] = [
    ("bottega-agents", "Gateway", 3),
    ("bottega-cluster", "JobBoard", 2),
    ("bottega-fuzzy", "Parser", 2),
    ("bottega-hra", "AllocatorState", 2),
    ("bottega-render", "GatherPath", 5),
    ("bottega-render", "Lights", 2),
    ("bottega-render", "Path", 2),
];

/// A type: the scope that defines it, and its name.
type TypeId = (usize, String);

/// The methods of a type in one file.
#[derive(Default)]
struct Methods {
    defined: BTreeSet<String>,
    /// The called ones, each with the line of its first call.
    called: BTreeMap<String, usize>,
}

/// The methods of all types of a crate, by type, then by file.
type MethodsByFile = BTreeMap<TypeId, BTreeMap<usize, Methods>>;

/// A type whose files call each other in circles.
struct Circle {
    type_name: String,
    /// Number of files in circles.
    files: usize,
    /// The calls between them, one per line.
    calls: String,
}

/// Reads the methods of a crate from its root.
fn circles(root: &Path, read_file: ReadFile<'_>) -> Result<Vec<Circle>> {
    let modules = Modules::read(root, read_file)?;
    let mut methods = MethodsByFile::new();
    for (scope, module) in modules.scopes.iter().enumerate().filter(|(scope, module)| module.module == *scope) {
        let text = read_file(&module.file).unwrap_or_default();
        collect(&modules, scope, &syn::parse_file(&text)?.items, &mut methods);
    }
    Ok(methods.iter().filter_map(|(id, files)| circle_of(&modules, id, files)).collect())
}

/// Collects the methods in a scope's items, and in its inner modules.
fn collect(modules: &Modules, scope: usize, items: &[Item], methods: &mut MethodsByFile) {
    for item in items.iter().filter(|item| !is_for_tests(attributes(item))) {
        match item {
            Item::Mod(inner) => {
                let child = modules.scopes[scope].children.get(&inner.ident.to_string());
                if let (Some((_, items)), Some(&child)) = (&inner.content, child) {
                    collect(modules, child, items, methods);
                }
            }
            Item::Impl(block) => {
                if let Some((id, name)) = self_type(modules, scope, block) {
                    let file = modules.scopes[scope].module;
                    read_block(block, &name, methods.entry(id).or_default().entry(file).or_default());
                }
            }
            _ => {}
        }
    }
}

/// Returns the type of an `impl` block, and its name there. `None`: a type of another crate.
fn self_type(modules: &Modules, scope: usize, block: &ItemImpl) -> Option<(TypeId, String)> {
    let Type::Path(path) = &*block.self_ty else { return None };
    let segments: Vec<String> = path.path.segments.iter().map(|segment| segment.ident.to_string()).collect();
    let name = segments.last()?.clone();
    match modules.resolve(scope, &segments)? {
        Meaning::Item(definition) => Some(((definition, name.clone()), name)),
        Meaning::Module(_) => None,
    }
}

fn read_block(block: &ItemImpl, type_name: &str, methods: &mut Methods) {
    for item in &block.items {
        let ImplItem::Fn(function) = item else { continue };
        if !is_for_tests(&function.attrs) {
            methods.defined.insert(function.sig.ident.to_string());
            Calls { type_name, found: &mut methods.called }.visit_block(&function.block);
        }
    }
}

/// A visitor that collects the methods that code calls on its own type: `self.name()`, `Self::name` and `Type::name`.
struct Calls<'a> {
    type_name: &'a str,
    /// The names, each with the line of its first call.
    found: &'a mut BTreeMap<String, usize>,
}

impl Calls<'_> {
    fn add(&mut self, name: &Ident) {
        self.found.entry(name.to_string()).or_insert(name.span().start().line);
    }

    fn is_own_type(&self, name: &Ident) -> bool {
        name == "Self" || name == self.type_name
    }

    /// Searches the unparsed arguments of a macro.
    fn visit_tokens(&mut self, tokens: TokenStream) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let is_punct =
            |at: usize, wanted: char| matches!(tokens.get(at), Some(TokenTree::Punct(it)) if it.as_char() == wanted);
        for (at, token) in tokens.iter().enumerate() {
            match token {
                TokenTree::Group(group) => self.visit_tokens(group.stream()),
                TokenTree::Ident(word) if word == "self" && is_punct(at + 1, '.') => {
                    let called = [tokens.get(at + 2), tokens.get(at + 3)];
                    if let [Some(TokenTree::Ident(name)), Some(TokenTree::Group(group))] = called
                        && group.delimiter() == Delimiter::Parenthesis
                    {
                        self.add(name);
                    }
                }
                TokenTree::Ident(word) if self.is_own_type(word) && is_punct(at + 1, ':') && is_punct(at + 2, ':') => {
                    if let Some(TokenTree::Ident(name)) = tokens.get(at + 3) {
                        self.add(name);
                    }
                }
                _ => {}
            }
        }
    }
}

impl<'ast> Visit<'ast> for Calls<'_> {
    fn visit_expr_method_call(&mut self, call: &'ast ExprMethodCall) {
        if let Expr::Path(receiver) = &*call.receiver
            && receiver.path.is_ident("self")
        {
            self.add(&call.method);
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let segments: Vec<&Ident> = path.segments.iter().map(|segment| &segment.ident).collect();
        if let [.., of, name] = &segments[..]
            && self.is_own_type(of)
        {
            self.add(name);
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.visit_tokens(call.tokens.clone());
    }
}

/// Returns the circles between the files of a type.
fn circle_of(modules: &Modules, (_, name): &TypeId, files: &BTreeMap<usize, Methods>) -> Option<Circle> {
    let mut edges: BTreeMap<usize, BTreeMap<usize, (String, usize)>> = BTreeMap::new();
    for (&from, methods) in files {
        for (called, &line) in methods.called.iter().filter(|(called, _)| !methods.defined.contains(*called)) {
            let definition = files.iter().find(|(_, other)| other.defined.contains(called));
            if let Some((&to, _)) = definition {
                edges.entry(from).or_default().entry(to).or_insert((called.clone(), line));
            }
        }
    }
    let knots = knots(&edges);
    let mut calls = String::new();
    for knot in &knots {
        for &from in knot {
            for (&to, (called, line)) in edges[&from].iter().filter(|(to, _)| knot.contains(to)) {
                let [from, to] = [from, to].map(|scope| &modules.scopes[scope].name);
                calls += &format!("  {from}:{line} → {to}: `{called}`\n");
            }
        }
    }
    let files = knots.iter().map(Vec::len).sum();
    (files > 0).then(|| Circle { type_name: name.clone(), files, calls })
}

mod tests {
    use super::*;
    use crate::{
        bars::root,
        circles::{read_file, roots},
    };

    #[test]
    fn no_more_types_than_are_known_have_files_that_call_each_other_in_circles() {
        let (mut found, mut described) = (Vec::new(), String::new());
        for (name, root) in roots(&root()) {
            let circles = circles(&root, &read_file).unwrap_or_else(|error| panic!("{name}: {error:#}"));
            for Circle { type_name, files, calls } in circles {
                described += &format!("(\"{name}\", \"{type_name}\", {files}),\n{calls}");
                found.push((name.clone(), type_name, files));
            }
        }
        found.sort();
        let known: Vec<_> = KNOWN.iter().map(|&(name, of, files)| (name.to_owned(), of.to_owned(), files)).collect();
        assert!(
            found == known,
            "the circles are not those in the table `KNOWN`, which may only shrink; found:\n{described}"
        );
    }

    /// Returns the number of files in circles of a crate that consists of some files.
    fn files_in_circles(files: &[(&str, &str)]) -> usize {
        let read_file = |path: &Path| {
            let found = files.iter().find(|(name, _)| Path::new("src").join(name) == path);
            found.map(|(_, text)| (*text).to_owned())
        };
        circles(Path::new("src/lib.rs"), &read_file).expect("a crate").iter().map(|circle| circle.files).sum()
    }

    #[test]
    fn files_that_call_each_other_s_methods_are_a_circle() {
        let root = ("lib.rs", "mod a;\nmod b;\npub struct M { a: u8 }");
        let b = ("b.rs", "use crate::M;\nimpl M { fn b(&self) { self.a(); } }");
        let a = |text| files_in_circles(&[root, ("a.rs", text), b]);
        assert_eq!(a("impl crate::M { fn a(&self) { self.b(); } }"), 2);
        assert_eq!(a("use super::*;\nimpl M { fn a(&self) { Self::b(self); } }"), 2);
        assert_eq!(a("use super::M;\nimpl M { fn a(&self) { call(M::b); } }"), 2);
        assert_eq!(a("use super::M;\nimpl M { fn a(&self) { assert!(x, \"{}\", self.b()); } }"), 2);
        assert_eq!(
            a("use super::M;\nimpl Clone for M { fn clone(&self) -> M { self.b() } }\nimpl M { fn a(&self) {} }"),
            2
        );
    }

    #[test]
    fn fields_other_types_and_tests_are_in_no_circle() {
        let root = ("lib.rs", "mod a;\nmod b;\npub struct M { b: u8 }\npub struct N;");
        let b = ("b.rs", "use crate::M;\nimpl M { fn b(&self) { self.a(); } }");
        let a = |text| files_in_circles(&[root, ("a.rs", text), b]);
        assert_eq!(a("use super::M;\nimpl M { fn a(&self) { self.b + self.c(); } }"), 0);
        assert_eq!(a("use super::M;\nimpl M { fn a(&self) { self.n.b(); self.b(); } fn b(&self) {} }"), 0);
        assert_eq!(a("use super::*;\nimpl N { fn n(&self) { self.b(); } }\nimpl M { fn a(&self) {} }"), 0);
        assert_eq!(a("use super::M;\nimpl M { fn a(&self) {} #[cfg(test)] fn c(&self) { self.b(); } }"), 0);
        assert_eq!(
            a(
                "use super::M;\nimpl M { fn a(&self) {} }\n#[cfg(test)]\nmod tests { impl super::M { fn c(&self) { self.b(); } } }"
            ),
            0
        );
    }
}
