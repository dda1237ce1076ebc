//! A test for unique names: a type's name may be declared in one module, two at most.

use std::collections::BTreeMap;

use crate::{circles, modules::Modules};

/// The maximum number of modules that declare a type of the same name.
const MODULES_MAX: usize = 2;

/// The error type of a crate is called `Error`, as usual in Rust.
const ONE_A_CRATE: &str = "Error";

mod tests {
    use super::*;
    use crate::bars::root;

    #[test]
    fn no_name_of_a_type_is_declared_in_more_than_two_modules() {
        let repository = root();
        let mut declared: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for (name, root) in circles::roots(&repository) {
            let modules = Modules::read(&root, &circles::read_file).unwrap_or_else(|error| panic!("{name}: {error:#}"));
            for scope in &modules.scopes {
                let file = scope.file.strip_prefix(&repository).unwrap_or(&scope.file).display();
                for (name, line) in &scope.types {
                    declared.entry(name.clone()).or_default().push(format!("{file}:{line}"));
                }
            }
        }
        let problems: Vec<String> = declared
            .iter()
            .filter(|(name, places)| *name != ONE_A_CRATE && places.len() > MODULES_MAX)
            .map(|(name, places)| {
                format!(
                    "`{name}` is declared {} times, {MODULES_MAX} at most:\n  {}",
                    places.len(),
                    places.join("\n  ")
                )
            })
            .collect();
        assert!(problems.is_empty(), "{}", problems.join("\n"));
    }
}
