//! The crates that are compiled into the program.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
};

use anyhow::{Context, Result, ensure};
use cargo_metadata::{CargoOpt, DependencyKind, MetadataCommand, Package, PackageId, TargetKind};

use crate::bars::root;

/// The target system of packages.
const TARGET: &str = "x86_64-unknown-linux-gnu";
/// The crate of the program.
pub(super) const PROGRAM: &str = "bottega-cli";

/// A crate that is compiled into the program.
pub(super) struct Component {
    pub(super) package: Package,
    /// The crates that it uses, as `name@version`.
    pub(super) uses: Vec<String>,
    /// SHA-256 of its archive, for crates of a registry.
    pub(super) checksum: Option<String>,
}

impl Component {
    /// Returns the id by which components refer to each other.
    pub(super) fn reference(&self) -> String {
        reference(&self.package)
    }

    /// True if the crate is not part of this workspace.
    pub(super) fn is_foreign(&self) -> bool {
        self.package.source.is_some()
    }

    /// Returns its licence as an SPDX expression. Old crates write `/` for `OR`.
    pub(super) fn expression(&self) -> String {
        let said = self.package.license.clone().unwrap_or_default();
        said.split('/').map(str::trim).collect::<Vec<_>>().join(" OR ")
    }
}

fn reference(package: &Package) -> String {
    format!("{}@{}", package.name, package.version)
}

/// Returns the crates in the program: its dependencies for the target system, without those only used to build, test or generate
/// code.
pub(super) fn components() -> Result<Vec<Component>> {
    let mut command = MetadataCommand::new();
    command.current_dir(root()).features(CargoOpt::SomeFeatures(Vec::new()));
    command.other_options(vec!["--filter-platform".to_owned(), TARGET.to_owned(), "--locked".to_owned()]);
    let metadata = command.exec().context("cargo metadata fails")?;
    let graph = metadata.resolve.as_ref().context("cargo metadata resolves nothing")?;
    let nodes: BTreeMap<&PackageId, _> = graph.nodes.iter().map(|node| (&node.id, node)).collect();
    let packages: BTreeMap<&PackageId, &Package> = metadata.packages.iter().map(|it| (&it.id, it)).collect();
    let checksums = checksums()?;
    let start = metadata.packages.iter().find(|package| package.name.as_str() == PROGRAM).context("the program")?;
    let mut seen: BTreeSet<&PackageId> = BTreeSet::from([&start.id]);
    let mut open = vec![&start.id];
    let mut all = Vec::new();
    while let Some(id) = open.pop() {
        let package = packages[id];
        let is_linked =
            |id: &PackageId| !packages[id].targets.iter().any(|it| it.kind.contains(&TargetKind::ProcMacro));
        let used =
            nodes[id].deps.iter().filter(|used| used.dep_kinds.iter().any(|it| it.kind == DependencyKind::Normal));
        let used: Vec<&PackageId> = used.map(|used| &used.pkg).filter(|id| is_linked(id)).collect();
        open.extend(used.iter().copied().filter(|id| seen.insert(id)));
        let uses = used.iter().map(|id| reference(packages[id])).collect();
        let checksum = checksums.get(&reference(package)).cloned();
        all.push(Component { package: package.clone(), uses, checksum });
    }
    all.sort_by_key(Component::reference);
    ensure!(all.len() > 50, "only {} crates: cargo metadata has changed", all.len());
    Ok(all)
}

/// Returns SHA-256 by `name@version`, from the lock file.
fn checksums() -> Result<BTreeMap<String, String>> {
    let text = fs::read_to_string(root().join("Cargo.lock")).context("cannot read Cargo.lock")?;
    let value = |block: &str, key: &str| {
        let start = format!("{key} = \"");
        block.lines().find_map(|line| Some(line.strip_prefix(&start)?.trim_end_matches('"').to_owned()))
    };
    let blocks = text.split("[[package]]").skip(1);
    let entry = |block: &str| {
        Some((format!("{}@{}", value(block, "name")?, value(block, "version")?), value(block, "checksum")?))
    };
    Ok(blocks.filter_map(entry).collect())
}
