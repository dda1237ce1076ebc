//! Tests of packaged files against the schemas of their consumers.

#[cfg(test)]
#[allow(clippy::print_stdout, reason = "what was skipped, and why, is read from what tests print")]
mod tests {
    use std::{fs, process::Command};

    use super::super::{components::components, sbom::bill};
    use crate::{bars::root, python};

    #[test]
    fn manifests_templates_and_the_bill_of_materials_follow_their_schemas() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("bill.json");
        let bill = bill(&components().expect("cargo metadata runs"));
        fs::write(&file, bill.to_string()).expect("a file");
        let mut modules = Command::new(python::interpreter());
        modules.args(["-c", "import kubernetes_validate, openjd, cyclonedx, jsonschema"]);
        if !modules.output().is_ok_and(|output| output.status.success()) {
            println!(
                "skipped: no Python with kubernetes-validate, openjd-cli and cyclonedx-python-lib; `cargo xtask test` installs them"
            );
            return;
        }
        let mut check = Command::new(python::interpreter());
        check.arg(root().join("packaging/check.py")).arg(&file);
        let output = check.output().expect("Python runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}
