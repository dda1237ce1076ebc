//! The modules of a crate, parsed from its sources: what each defines, imports and mentions.
//!
//! A module here is a file; the contents of `mod name { … }` belong to the file around it. Code for tests only is left out
//! (`#[cfg(test)]`, `#[test]`).

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use proc_macro2::{TokenStream, TokenTree};
use syn::{
    Attribute, ImplItem, Item, ItemMod, ItemUse, Meta, TraitItem, UseTree, Visibility,
    visit::{self, Visit},
};

/// The segments of a path: `crate`, `image`, `Film`.
pub(crate) type Segments = Vec<String>;

/// A function that returns the text of a file; `None`: the file does not exist.
pub(crate) type ReadFile<'a> = &'a dyn Fn(&Path) -> Option<String>;

/// A `use`, or one branch of it.
#[derive(Clone, Debug)]
pub(crate) struct Import {
    /// The imported path; for a glob, the path before the star.
    pub(crate) path: Segments,
    /// The local name; `None`: a glob.
    pub(crate) name: Option<String>,
    /// `true`: a re-export, visible to other modules.
    pub(crate) is_reexport: bool,
    pub(crate) line: usize,
}

/// A path in code outside of a `use`.
#[derive(Clone, Debug)]
pub(crate) struct Mention {
    pub(crate) path: Segments,
    pub(crate) line: usize,
}

/// A scope with its own names: a file, or a `mod name { … }` in it.
#[derive(Debug)]
pub(crate) struct Scope {
    /// The full path: `crate::image::film`.
    pub(crate) name: String,
    pub(crate) file: PathBuf,
    /// The enclosing scope.
    pub(crate) parent: Option<usize>,
    /// The scope of the file that contains this one.
    pub(crate) module: usize,
    pub(crate) children: BTreeMap<String, usize>,
    /// The names of all definitions except modules.
    pub(crate) items: BTreeSet<String>,
    /// Structs, enums, unions, traits and type aliases defined here, with their lines.
    pub(crate) types: Vec<(String, usize)>,
    pub(crate) imports: Vec<Import>,
    pub(crate) mentions: Vec<Mention>,
}

/// A crate: its scopes, the root first.
#[derive(Debug, Default)]
pub(crate) struct Modules {
    pub(crate) scopes: Vec<Scope>,
}

impl Modules {
    /// Reads a crate from its root, `src/lib.rs` or `src/main.rs`.
    pub(crate) fn read(root: &Path, read_file: ReadFile<'_>) -> Result<Self> {
        let folder = root.parent().context("a root without a folder")?.to_owned();
        let mut reader = Reader { modules: Self::default(), read_file };
        reader.file("crate".to_owned(), root.to_owned(), &folder, None)?;
        Ok(reader.modules)
    }

    /// Resolves a path in a scope. `None`: an item of another crate, a local name, or a method.
    pub(crate) fn resolve(&self, scope: usize, path: &[String]) -> Option<Meaning> {
        self.resolve_once(scope, path, &mut BTreeSet::new())
    }

    /// `visiting`: the names being resolved, because imports may form circles.
    fn resolve_once(&self, scope: usize, path: &[String], visiting: &mut BTreeSet<(usize, String)>) -> Option<Meaning> {
        let mut rest = path.iter().map(String::as_str).peekable();
        let mut at = match *rest.peek()? {
            "crate" => {
                rest.next();
                0
            }
            "self" => {
                rest.next();
                scope
            }
            "super" => scope,
            first => {
                rest.next();
                match self.look_up(scope, first, visiting)? {
                    Meaning::Module(module) => module,
                    defined @ Meaning::Item(_) => return Some(defined),
                }
            }
        };
        while rest.next_if_eq(&"super").is_some() {
            at = self.scopes[at].parent?;
        }
        for name in rest {
            match self.look_up(at, name, visiting) {
                Some(Meaning::Module(module)) => at = module,
                Some(defined) => return Some(defined),
                // The item comes from a macro, or is not in the text: attribute it to the module.
                None => return Some(Meaning::Item(at)),
            }
        }
        Some(Meaning::Module(at))
    }

    fn look_up(&self, scope: usize, name: &str, visiting: &mut BTreeSet<(usize, String)>) -> Option<Meaning> {
        if !visiting.insert((scope, name.to_owned())) {
            return None;
        }
        let names = &self.scopes[scope];
        if let Some(&child) = names.children.get(name) {
            return Some(Meaning::Module(child));
        }
        if names.items.contains(name) {
            return Some(Meaning::Item(scope));
        }
        let named = names.imports.iter().filter(|import| import.name.as_deref() == Some(name));
        if let Some(found) = named.into_iter().find_map(|import| self.resolve_once(scope, &import.path, visiting)) {
            return Some(found);
        }
        let globs = names.imports.iter().filter(|import| import.name.is_none());
        globs.into_iter().find_map(|glob| match self.resolve_once(scope, &glob.path, visiting)? {
            Meaning::Module(module) => self.look_up(module, name, visiting),
            Meaning::Item(_) => None,
        })
    }
}

/// The target of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// A scope.
    Module(usize),
    /// A definition in a scope.
    Item(usize),
}

struct Reader<'a> {
    modules: Modules,
    read_file: ReadFile<'a>,
}

impl Reader<'_> {
    /// Reads a file and the files of its modules, which lie in `folder`.
    fn file(&mut self, name: String, file: PathBuf, folder: &Path, parent: Option<usize>) -> Result<usize> {
        let text = (self.read_file)(&file).with_context(|| format!("cannot read {}", file.display()))?;
        let parsed = syn::parse_file(&text).with_context(|| format!("cannot parse {}", file.display()))?;
        let scope = self.add(name, file, parent, None);
        self.items(scope, &parsed.items, folder)?;
        Ok(scope)
    }

    fn add(&mut self, name: String, file: PathBuf, parent: Option<usize>, module: Option<usize>) -> usize {
        let scope = self.modules.scopes.len();
        self.modules.scopes.push(Scope {
            name,
            file,
            parent,
            module: module.unwrap_or(scope),
            children: BTreeMap::new(),
            items: BTreeSet::new(),
            types: Vec::new(),
            imports: Vec::new(),
            mentions: Vec::new(),
        });
        scope
    }

    fn items(&mut self, scope: usize, items: &[Item], folder: &Path) -> Result<()> {
        for item in items.iter().filter(|item| !is_for_tests(attributes(item))) {
            if let Item::Mod(module) = item {
                self.module(scope, module, folder)?;
                continue;
            }
            let names = &mut self.modules.scopes[scope];
            if let Some((name, line, is_type)) = defined(item) {
                if is_type {
                    names.types.push((name.clone(), line));
                }
                names.items.insert(name);
            }
            if let Item::Use(item) = item {
                let is_reexport = !matches!(item.vis, Visibility::Inherited);
                names.imports.extend(imports(item, is_reexport));
            } else {
                Mentions { scope: names }.visit_item(item);
            }
        }
        Ok(())
    }

    fn module(&mut self, parent: usize, module: &ItemMod, folder: &Path) -> Result<()> {
        let name = module.ident.to_string();
        let path = format!("{}::{name}", self.modules.scopes[parent].name);
        let folder_of_children = folder.join(&name);
        let child = if let Some((_, items)) = &module.content {
            let (file, owner) = (self.modules.scopes[parent].file.clone(), self.modules.scopes[parent].module);
            let child = self.add(path, file, Some(parent), Some(owner));
            self.items(child, items, &folder_of_children)?;
            child
        } else {
            if module.attrs.iter().any(|attribute| attribute.path().is_ident("path")) {
                bail!("{path} has an attribute `path`, which is not followed");
            }
            let files = [folder.join(format!("{name}.rs")), folder_of_children.join("mod.rs")];
            let file = files.into_iter().find(|file| (self.read_file)(file).is_some());
            let file = file.with_context(|| format!("{path} has no file in {}", folder.display()))?;
            self.file(path, file, &folder_of_children, Some(parent))?
        };
        self.modules.scopes[parent].children.insert(name, child);
        Ok(())
    }
}

/// Returns the name that an item defines, its line, and `true` if it is a type.
fn defined(item: &Item) -> Option<(String, usize, bool)> {
    let (ident, is_type) = match item {
        Item::Const(item) => (&item.ident, false),
        Item::Enum(item) => (&item.ident, true),
        Item::Fn(item) => (&item.sig.ident, false),
        Item::Macro(item) => (item.ident.as_ref()?, false),
        Item::Static(item) => (&item.ident, false),
        Item::Struct(item) => (&item.ident, true),
        Item::Trait(item) => (&item.ident, true),
        Item::Type(item) => (&item.ident, true),
        Item::Union(item) => (&item.ident, true),
        _ => return None,
    };
    Some((ident.to_string(), ident.span().start().line, is_type))
}

/// Returns the attributes of an item.
pub(crate) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::ExternCrate(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::ForeignMod(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::TraitAlias(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Union(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

/// True if these attributes restrict an item to tests.
pub(crate) fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        Meta::Path(path) => path.is_ident("test"),
        Meta::List(list) if list.path.is_ident("cfg") => {
            let tokens: Vec<String> = words(list.tokens.clone()).into_iter().flat_map(|mention| mention.path).collect();
            tokens.iter().any(|word| word == "test") && !tokens.iter().any(|word| word == "not" || word == "any")
        }
        _ => false,
    })
}

/// Returns the branches of a `use`.
fn imports(item: &ItemUse, is_reexport: bool) -> Vec<Import> {
    fn walk(tree: &UseTree, path: &[String], is_reexport: bool, found: &mut Vec<Import>) {
        let mut add = |ident: &proc_macro2::Ident, name: Option<String>| {
            let mut path = path.to_vec();
            // `use image::{self}` names the module.
            if ident != "self" || path.is_empty() {
                path.push(ident.to_string());
            }
            let name = name.or_else(|| path.last().cloned());
            found.push(Import { path, name, is_reexport, line: ident.span().start().line });
        };
        match tree {
            UseTree::Path(branch) => {
                let mut path = path.to_vec();
                path.push(branch.ident.to_string());
                walk(&branch.tree, &path, is_reexport, found);
            }
            UseTree::Name(leaf) => add(&leaf.ident, None),
            UseTree::Rename(leaf) => add(&leaf.ident, Some(leaf.rename.to_string())),
            UseTree::Glob(glob) => {
                let line = glob.star_token.spans[0].start().line;
                found.push(Import { path: path.to_vec(), name: None, is_reexport, line });
            }
            UseTree::Group(group) => group.items.iter().for_each(|tree| walk(tree, path, is_reexport, found)),
        }
    }
    let mut found = Vec::new();
    if item.leading_colon.is_none() {
        walk(&item.tree, &[], is_reexport, &mut found);
    }
    found
}

/// A visitor that collects the paths in code.
struct Mentions<'a> {
    scope: &'a mut Scope,
}

impl<'ast> Visit<'ast> for Mentions<'_> {
    fn visit_item(&mut self, item: &'ast Item) {
        if !is_for_tests(attributes(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item(&mut self, item: &'ast ImplItem) {
        let attributes: &[Attribute] = match item {
            ImplItem::Const(item) => &item.attrs,
            ImplItem::Fn(item) => &item.attrs,
            ImplItem::Type(item) => &item.attrs,
            ImplItem::Macro(item) => &item.attrs,
            _ => &[],
        };
        if !is_for_tests(attributes) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_trait_item(&mut self, item: &'ast TraitItem) {
        let attributes: &[Attribute] = match item {
            TraitItem::Const(item) => &item.attrs,
            TraitItem::Fn(item) => &item.attrs,
            TraitItem::Type(item) => &item.attrs,
            TraitItem::Macro(item) => &item.attrs,
            _ => &[],
        };
        if !is_for_tests(attributes) {
            visit::visit_trait_item(self, item);
        }
    }

    /// A `use` in a function counts for the whole module; its name is unique there.
    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        self.scope.imports.extend(imports(item, false));
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            let segments: Segments = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
            let line = path.segments.first().map_or(0, |segment| segment.ident.span().start().line);
            self.scope.mentions.push(Mention { path: segments, line });
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        self.visit_path(&call.path);
        self.scope.mentions.extend(words(call.tokens.clone()));
    }

    /// Attributes may contain paths, such as the arguments of `#[error(…)]`.
    fn visit_attribute(&mut self, attribute: &'ast Attribute) {
        if let Meta::List(list) = &attribute.meta {
            self.scope.mentions.extend(words(list.tokens.clone()).into_iter().filter(|word| word.path.len() > 1));
        }
    }
}

/// Returns the paths in unparsed tokens: words joined by `::`, except fields and methods.
fn words(tokens: TokenStream) -> Vec<Mention> {
    let mut found: Vec<Mention> = Vec::new();
    // The path that another segment continues, and the number of colons since.
    let (mut open, mut colons, mut is_field): (Option<usize>, u32, bool) = (None, 0, false);
    for token in tokens {
        let word = match token {
            TokenTree::Ident(ident) => ident,
            TokenTree::Punct(punct) if punct.as_char() == ':' => {
                colons += 1;
                continue;
            }
            TokenTree::Punct(punct) => {
                // After one dot follows a field or a method, after two the end of a range.
                (open, colons, is_field) = (None, 0, punct.as_char() == '.' && !is_field);
                continue;
            }
            TokenTree::Group(group) => {
                found.extend(words(group.stream()));
                (open, colons, is_field) = (None, 0, false);
                continue;
            }
            TokenTree::Literal(_) => {
                (open, colons, is_field) = (None, 0, false);
                continue;
            }
        };
        match open {
            Some(path) if colons == 2 => found[path].path.push(word.to_string()),
            // A path that starts with `::` belongs to another crate.
            _ if colons == 2 || is_field => open = None,
            _ => {
                open = Some(found.len());
                found.push(Mention { path: vec![word.to_string()], line: word.span().start().line });
            }
        }
        (colons, is_field) = (0, false);
    }
    found
}
