//! All tests, checks and bars of external engines.

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::Args;
use tempfile::TempDir;

use crate::{
    bars::{self, BarRow},
    cargo::cargo,
    needs,
    run_head::head,
};

/// All engines that have a worker, the large ones last.
const ENGINES: [&str; 4] = ["povray", "mitsuba", "luxcore", "cycles"];
/// The number of engines that are small downloads.
const SMALL: usize = 2;

/// Options of `cargo xtask engines`.
#[derive(Args)]
pub(crate) struct EnginesArgs {
    /// Cycles and LuxCore, too: a gigabyte from PyPI. An engine or a scene that cannot be had is a failure then.
    #[arg(long)]
    all: bool,
    /// These engines only.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Only the bars, not the tests and the checks of workers.
    #[arg(long)]
    bars: bool,
    /// The program whose pictures are held to the bars; default: built now.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Print the table as one JSON object; what else there is to say goes to stderr.
    #[arg(long)]
    json: bool,
}

/// Runs tests, checks and bars; returns an error if any of them fails.
pub(crate) fn engines(args: &EnginesArgs) -> Result<()> {
    needs::install(args.all);
    let variables = needs::variables();
    let environment: Vec<_> = variables.iter().map(|(name, value)| (*name, value.as_os_str())).collect();
    let mut rows = Vec::new();
    if !args.bars {
        let words = ["test", "--quiet", "--package", "bottega-cli", "--test", "tests", "engines::"];
        rows.push(BarRow::check("all", "tests", cargo(&words, &environment)));
    }
    let program = match &args.program {
        Some(program) => program.canonicalize()?,
        None => {
            cargo(&["build", "--quiet", "--package", "bottega-cli"], &[])?;
            bars::root().join("target/debug/bottega")
        }
    };
    let head = head(&program)?;
    let logs = TempDir::new()?.keep();
    let count = if args.all || !args.only.is_empty() { ENGINES.len() } else { SMALL };
    let wanted = |engine: &&str| args.only.is_empty() || args.only.iter().any(|only| only == engine);
    for engine in ENGINES.into_iter().take(count).filter(wanted) {
        match bars::is_here(&program, engine) {
            Ok(()) => {}
            Err(error) if args.all => {
                rows.push(BarRow::check(engine, "installed", Err(error)));
                continue;
            }
            Err(error) => {
                eprintln!("LEFT OUT: {error:#}");
                continue;
            }
        }
        if !args.bars {
            eprintln!("+ check_worker.py {engine}");
            let log = logs.join(format!("{engine}.log"));
            rows.push(BarRow::check(engine, "worker", bars::check_worker(engine, &log)));
        }
        eprintln!("+ bars of {engine}");
        rows.extend(bars::hold(&program, engine, args.all));
    }
    bars::print(&head, &rows, args.json);
    let failed = rows.iter().filter(|row| !row.passes()).count();
    ensure!(failed == 0, "{failed} of {} fail; logs of the checks are in {}", rows.len(), logs.display());
    Ok(std::fs::remove_dir_all(logs)?)
}
