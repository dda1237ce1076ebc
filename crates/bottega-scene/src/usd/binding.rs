//! Bindings of materials: direct, by collection, and inherited (UsdShadeMaterialBindingAPI).

use std::rc::Rc;

use openusd::sdf::Path;
use openusd::usd::Prim;

use super::source::{STILL, StageSource};

/// Purposes of bindings, in the order in which they are looked for: those of final pictures, then those of all pictures.
const PURPOSES: [&str; 2] = ["full", ""];

/// Most collections that include each other.
const DEPTH_MAX: u32 = 16;

/// The bindings of a prim and of its ancestors, outermost first.
#[derive(Clone, Default)]
pub(super) struct Bindings(Vec<Rc<Vec<Binding>>>);

/// A binding at one prim.
struct Binding {
    purpose: String,
    material: Path,
    /// `true`: it overrides those of descendants.
    is_strong: bool,
    /// The collection that must include a prim; `None`: the prim's descendants are bound.
    collection: Option<Collection>,
}

/// The included and excluded paths of a collection.
struct Collection {
    includes: Vec<Path>,
    excludes: Vec<Path>,
    expands: bool,
}

impl Collection {
    fn has(&self, path: &Path) -> bool {
        let depth = |list: &[Path], expands: bool| {
            let is_in = |root: &&Path| *root == path || expands && path.has_prefix(root);
            list.iter().filter(is_in).map(Path::prim_element_count).max()
        };
        // The nearest ancestor decides
        match (depth(&self.includes, self.expands), depth(&self.excludes, true)) {
            (Some(included), Some(excluded)) => included > excluded,
            (included, None) => included.is_some(),
            (None, Some(_)) => false,
        }
    }
}

impl Bindings {
    /// Returns the bindings with those of a child.
    pub(super) fn with(&self, source: &StageSource<'_>, prim: &Prim) -> Self {
        let own = read(source, prim);
        let mut list = self.0.clone();
        if !own.is_empty() {
            list.push(Rc::new(own));
        }
        Self(list)
    }

    /// Returns the path of the material that is bound to a prim.
    pub(super) fn material(&self, path: &Path) -> Option<Path> {
        PURPOSES.iter().find_map(|purpose| {
            let mut found: Option<&Binding> = None;
            for level in &self.0 {
                let applies = |binding: &&Binding| {
                    binding.purpose == *purpose && binding.collection.as_ref().is_none_or(|it| it.has(path))
                };
                // Collections come first in the list of a prim
                let here = level.iter().find(applies);
                if let Some(here) = here
                    && found.is_none_or(|outer| !outer.is_strong)
                {
                    found = Some(here);
                }
            }
            found.map(|binding| binding.material.clone())
        })
    }
}

/// Reads the bindings of a prim, collections first.
fn read(source: &StageSource<'_>, prim: &Prim) -> Vec<Binding> {
    const NAME: &str = "material:binding";
    let mut bindings = Vec::new();
    let names = source.or_warn(prim.path().as_str(), prim.property_names());
    for name in names.iter().map(openusd::tf::Token::as_str).filter(|name| name.starts_with(NAME)) {
        let parts: Vec<&str> = name[NAME.len()..].split(':').skip(1).collect();
        let (purpose, is_collection) = match parts[..] {
            [] => ("", false),
            [purpose] if purpose != "collection" => (purpose, false),
            ["collection", _] => ("", true),
            ["collection", purpose, _] => (purpose, true),
            _ => continue,
        };
        let targets = source.targets(prim, name);
        let strength = source.metadata(prim.relationship(name.to_owned()).path(), "bindMaterialAs");
        let binding = |material: &Path, collection| Binding {
            purpose: purpose.to_owned(),
            material: material.prim_path(),
            is_strong: strength.as_deref() == Some("strongerThanDescendants"),
            collection,
        };
        match (&targets[..], is_collection) {
            ([material], false) => bindings.push(binding(material, None)),
            ([collection, material], true) => {
                let read = read_collection(source, collection, DEPTH_MAX);
                bindings.push(binding(material, Some(read)));
            }
            ([], _) => {}
            _ => source.unsupported(
                &format!("{}.{name}", prim.path()),
                "has not the targets that a binding has; it is left out",
            ),
        }
    }
    bindings.sort_by_key(|binding| binding.collection.is_none());
    bindings
}

/// Reads a collection by the path of its property.
fn read_collection(source: &StageSource<'_>, path: &Path, depth: u32) -> Collection {
    let prim = source.stage.prim(path.prim_path());
    let name = path.property_suffix().trim_start_matches('.').to_owned();
    let rule = source.text(&prim, &format!("{name}:expansionRule"), STILL);
    let mut collection = Collection {
        includes: Vec::new(),
        excludes: source.targets(&prim, &format!("{name}:excludes")),
        expands: rule.as_deref() != Some("explicitOnly"),
    };
    if source.boolean(&prim, &format!("{name}:includeRoot"), STILL) == Some(true) {
        collection.includes.push(Path::abs_root());
    }
    for target in source.targets(&prim, &format!("{name}:includes")) {
        if !target.is_property_path() {
            collection.includes.push(target);
        } else if depth > 0 {
            let inner = read_collection(source, &target, depth - 1);
            collection.includes.extend(inner.includes);
            collection.excludes.extend(inner.excludes);
        }
    }
    if source.value(&prim, &format!("{name}:membershipExpression"), STILL).is_some() {
        source.unsupported(path.as_str(), "the expression of a collection is left out");
    }
    collection
}
