//! A test of the layers of crates: the table of ARCHITECTURE.md.

#[cfg(test)]
const LAYERS: &[(&str, &[&str])] = &[
    ("bottega-platform", &[]),
    ("bottega-image", &["bottega-platform"]),
    ("bottega-scene", &["bottega-image"]),
    ("bottega-fuzzy", &[]),
    ("bottega-kernels", &[]),
    ("bottega-hra", &["bottega-kernels"]),
    ("bottega-render", &["bottega-scene", "bottega-kernels", "bottega-hra", "bottega-image"]),
    (
        "bottega-gpu",
        &["bottega-kernels", "bottega-hra", "bottega-scene", "bottega-image", "bottega-render", "bottega-platform"],
    ),
    ("bottega-board", &["bottega-kernels", "bottega-hra", "bottega-render"]),
    ("bottega-agents", &[]),
    ("bottega-build", &[]),
    ("bottega-denoise", &["bottega-image"]),
    (
        "bottega-engines",
        &["bottega-render", "bottega-scene", "bottega-image", "bottega-hra", "bottega-kernels", "bottega-platform"],
    ),
    ("bottega-farm", &["bottega-agents", "bottega-fuzzy", "bottega-engines", "bottega-image"]),
    (
        "bottega",
        &[
            "bottega-platform",
            "bottega-image",
            "bottega-scene",
            "bottega-fuzzy",
            "bottega-hra",
            "bottega-gpu",
            "bottega-render",
            "bottega-agents",
            "bottega-board",
            "bottega-build",
            "bottega-denoise",
            "bottega-engines",
            "bottega-farm",
        ],
    ),
    (
        "bottega-cluster",
        &[
            "bottega-platform",
            "bottega",
            "bottega-agents",
            "bottega-build",
            "bottega-engines",
            "bottega-farm",
            "bottega-image",
            "bottega-scene",
        ],
    ),
    ("bottega-web", &["bottega", "bottega-cluster", "bottega-image"]),
    ("bottega-python", &["bottega", "bottega-cluster", "bottega-image"]),
    (
        "bottega-cli",
        &[
            "bottega-platform",
            "bottega-image",
            "bottega-scene",
            "bottega-fuzzy",
            "bottega-board",
            "bottega-gpu",
            "bottega-render",
            "bottega-agents",
            "bottega-engines",
            "bottega-farm",
            "bottega",
            "bottega-cluster",
            "bottega-web",
        ],
    ),
    (
        "bottega-bench",
        &[
            "bottega-platform",
            "bottega-image",
            "bottega-scene",
            "bottega-kernels",
            "bottega-hra",
            "bottega-gpu",
            "bottega-render",
            "bottega-agents",
            "bottega-build",
            "bottega-engines",
            "bottega-farm",
            "bottega",
            "bottega-cluster",
        ],
    ),
    ("xtask", &["bottega-image", "bottega-platform"]),
];

#[cfg(test)]
mod tests {
    use cargo_metadata::{DependencyKind, MetadataCommand};

    use super::LAYERS;

    #[test]
    fn crates_depend_downwards_only() {
        let metadata = MetadataCommand::new().no_deps().exec().expect("cargo metadata runs");
        for package in metadata.workspace_packages() {
            let name = package.name.as_str();
            let (_, allowed) = LAYERS
                .iter()
                .find(|(layer, _)| *layer == name)
                .unwrap_or_else(|| panic!("{name} is not in the table of layers: add it there and in ARCHITECTURE.md"));
            for used in &package.dependencies {
                let is_ours = used.name.starts_with("bottega");
                assert!(
                    !is_ours || used.kind == DependencyKind::Development || allowed.contains(&used.name.as_str()),
                    "{name} must not know {}: see ARCHITECTURE.md, Layers",
                    used.name
                );
            }
        }
    }

    #[test]
    fn the_program_that_measures_is_a_part_of_nothing() {
        const MEASURES: &str = "bottega-bench";
        let metadata = MetadataCommand::new().no_deps().exec().expect("cargo metadata runs");
        let packages = metadata.workspace_packages();
        assert!(packages.iter().any(|package| package.name == MEASURES), "it has another name");
        for package in packages {
            let knows_it = package.dependencies.iter().any(|used| used.name == MEASURES);
            assert!(!knows_it, "{} depends on {MEASURES}", package.name);
        }
    }

    #[test]
    fn the_table_names_only_crates_above() {
        for (index, (name, allowed)) in LAYERS.iter().enumerate() {
            for used in *allowed {
                let above = LAYERS[..index].iter().any(|(layer, _)| layer == used);
                assert!(above, "{name} may only use crates above it in the table, not {used}");
            }
        }
    }
}
