//! The reference results of an independent fuzzy library.

use std::{path::Path, process::Command};

use anyhow::{Context, Result, ensure};

/// The version of the library whose results are in the repository.
const LIBRARY: &str = "pyfuzzylite==8.0.6";

/// Regenerates `crates/bottega-fuzzy/tests/data`; takes some minutes.
///
/// - `python`: a Python 3 that has the library.
pub(crate) fn fuzzy_reference(python: &str) -> Result<()> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/bottega-fuzzy/tests/data/reference.py");
    let has_library = Command::new(python)
        .args(["-c", "import fuzzylite"])
        .output()
        .with_context(|| format!("cannot start {python}; name another one by --python"))?;
    ensure!(
        has_library.status.success(),
        "{python} has no fuzzylite: make an environment (python3 -m venv ENV; ENV/bin/pip install {LIBRARY}) and name it \
         by --python ENV/bin/python"
    );
    let status = Command::new(python).arg(script).status().with_context(|| format!("cannot start {python}"))?;
    ensure!(status.success(), "the library did not evaluate all cases");
    Ok(())
}
