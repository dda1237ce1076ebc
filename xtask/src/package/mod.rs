//! Packages: a tarball, a `.deb`, the licences of all that is compiled in, and the bill of materials.

mod components;
mod deb;
mod licences;
mod sbom;
mod schemas;
mod stage;
mod tools;

use std::{fs, path::PathBuf, process::Command};

use anyhow::{Result, ensure};

use self::tools::{VERSION, call};
use crate::{bars::root, cargo};

/// Options of `cargo xtask package`.
#[derive(clap::Args)]
pub(crate) struct PackageArgs {
    /// Pack this program; without it the one of the profile `dist` is built first.
    #[arg(long, value_name = "PATH")]
    program: Option<PathBuf>,
    /// Folder of the packages.
    #[arg(long, value_name = "FOLDER", default_value = "target/packages")]
    out: PathBuf,
    /// Try the .deb in a bare Debian: install it, paint, read the man page, remove it. Only as root; installs mmdebstrap.
    #[arg(long = "try")]
    is_tried: bool,
}

/// Builds the packages.
///
/// # Errors
/// The program does not compile or run, a licence has no text, or a tool (`tar`, `gzip`, `dpkg-deb`) is missing or fails.
pub(crate) fn package(args: &PackageArgs) -> Result<()> {
    let program = match &args.program {
        Some(program) => program.clone(),
        None => {
            call(
                cargo::command().args(["build", "--profile", "dist", "--package", "bottega-cli"]).current_dir(root()),
            )?;
            root().join("target/dist/bottega")
        }
    };
    ensure!(program.is_file(), "there is no program `{}`", program.display());
    let out = root().join(&args.out);
    fs::create_dir_all(&out)?;
    let components = components::components()?;
    let licences = licences::text(&components)?;
    fs::write(out.join("THIRD-PARTY-LICENCES.txt"), &licences)?;
    let bill = serde_json::to_string_pretty(&sbom::bill(&components))?;
    fs::write(out.join(format!("bottega-{VERSION}.cdx.json")), bill + "\n")?;
    println!(
        "{} crates are compiled in; their licences and the bill of materials are in {}",
        components.len(),
        out.display()
    );
    let stage = stage::Stage { folder: out.join("root"), out };
    stage.fill(&program, &licences)?;
    println!("{}", stage.tarball()?.display());
    let package = deb::build(&stage)?;
    println!("{}", package.display());
    if args.is_tried {
        let script = root().join("packaging/debian/try.sh");
        call(Command::new("bash").arg(script).arg(&package).arg(root().join("scenes/cornell-box.glb")))?;
    }
    Ok(())
}
