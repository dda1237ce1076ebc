//! One name for one thing: a type's name is declared in one module, two at most.

use std::collections::BTreeMap;

use crate::{circles, modules::Modules};

/// How many modules may declare a type of one name.
const MODULES_MAX: usize = 2;

/// Names that more modules declare today, and how many. A number may only go down.
const OFTEN: &[(&str, usize)] = &[
    ("Answer", 4),
    ("Batch", 3),
    ("Curve", 3),
    ("Device", 3),
    ("Done", 3),
    ("Drawn", 3),
    ("Entry", 5),
    ("Error", 3),
    ("Faults", 3),
    ("Functions", 3),
    ("Keeper", 4),
    ("Kind", 5),
    ("Known", 4),
    ("Lane", 3),
    ("Layer", 3),
    ("Member", 3),
    ("Node", 6),
    ("Outcome", 5),
    ("Pace", 3),
    ("Part", 4),
    ("Peer", 3),
    ("Place", 5),
    ("Progress", 5),
    ("Random", 3),
    ("Record", 3),
    ("Report", 3),
    ("Seen", 3),
    ("Shape", 3),
    ("Shared", 5),
    ("Sides", 3),
    ("Source", 3),
    ("State", 4),
    ("Step", 3),
    ("Tally", 3),
    ("Term", 3),
    ("Tree", 3),
    ("Wanted", 3),
    ("Watch", 4),
    ("Way", 3),
    ("Window", 3),
    ("Worker", 3),
];

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
        let mut problems = Vec::new();
        for (name, places) in &declared {
            let known = OFTEN.iter().find(|(known, _)| known == name);
            let most = known.map_or(MODULES_MAX, |(_, count)| *count);
            if places.len() > most {
                problems.push(format!(
                    "`{name}` is declared {} times, {most} at most:\n  {}",
                    places.len(),
                    places.join("\n  ")
                ));
            } else if known.is_some() && places.len() < most {
                problems
                    .push(format!("`{name}` is declared only {} times now: say so in OFTEN ({most})", places.len()));
            }
        }
        for (name, _) in OFTEN.iter().filter(|(name, _)| !declared.contains_key(*name)) {
            problems.push(format!("OFTEN names `{name}`, which nothing declares"));
        }
        assert!(problems.is_empty(), "{}", problems.join("\n"));
    }
}
