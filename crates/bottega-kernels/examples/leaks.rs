//! `cargo xtask leaks`: rays from inside closed meshes, none of which may get out.
#![allow(clippy::print_stdout)]

#[path = "../tests/support/mod.rs"]
mod support;

use std::process::ExitCode;

use support::leaks;

fn main() -> ExitCode {
    let rays = std::env::args().nth(1).and_then(|n| n.parse::<f64>().ok()).unwrap_or(1e7);
    let report = match leaks(rays as u64) {
        Ok(report) => report,
        Err(error) => {
            println!("{error}");
            return ExitCode::FAILURE;
        }
    };
    for row in &report {
        println!("{:<50} {:>12} rays {:>6} leaks", row.mesh, row.rays, row.leaks);
    }
    let (rays, leaks) = report.iter().fold((0, 0), |sum, row| (sum.0 + row.rays, sum.1 + row.leaks));
    println!("{rays} rays, {leaks} leaks");
    if leaks == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
