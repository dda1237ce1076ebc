//! A spelling test of pages, by `typos`.

#[cfg(test)]
#[allow(clippy::print_stdout, reason = "what was skipped, and why, is read from what tests print")]
mod tests {
    use std::process::{Command, Stdio};

    use crate::{bars::root, python};

    #[test]
    fn pages_are_spelled_as_dictionaries_have_it() {
        let own = python::program("typos");
        let program = [own.as_os_str(), "typos".as_ref()].into_iter().find(|program| {
            let mut command = Command::new(program);
            command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
            command.status().is_ok_and(|status| status.success())
        });
        let Some(program) = program else {
            println!("skipped: there is no `typos`; `cargo xtask test` installs it");
            return;
        };
        let mut command = Command::new(program);
        // The words of this project are in `_typos.toml`.
        command.args([
            "--format",
            "brief",
            "docs",
            "packaging",
            "scenes/README.md",
            "README.md",
            "ARCHITECTURE.md",
            "CHANGELOG.md",
        ]);
        let output = command.current_dir(root()).output().expect("typos runs");
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "\n{said}{}", String::from_utf8_lossy(&output.stderr));
    }
}
