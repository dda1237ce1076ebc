//! Images like the paper's figures 4 and 5: photon mapping, the paper's agents, and five times their difference, side by side.

use std::path::Path;

use bottega_image::Picture;

use super::{
    drawings::{difference, write_png},
    report::AlaReport,
    ways::MethodResult,
};
use crate::error::Error;

/// Writes `figure-4.png` (without indirect light) and `figure-5.png` (with all light), and both again with our own agents.
///
/// # Errors
/// A file cannot be written.
pub(super) fn write(folder: &Path, report: &AlaReport) -> Result<(), Error> {
    let [photons, of_the_paper, ours] = &report.without_indirect[..] else { return Ok(()) };
    let row = |name: &str, photons: &MethodResult, agents: &MethodResult| {
        let [a, b] = [&photons.picture, &agents.picture];
        write_png(folder, name, &beside(&[a, b, &difference(a, b)]))
    };
    row("figure-4.png", photons, of_the_paper)?;
    row("figure-4-our-agents.png", photons, ours)?;
    let agents: Vec<&MethodResult> = report.others.iter().filter(|result| result.agents.is_some()).collect();
    let ([of_the_paper, ours], Some(photons)) = (&agents[..], report.four_maps()) else { return Ok(()) };
    row("figure-5.png", photons, of_the_paper)?;
    row("figure-5-our-agents.png", photons, ours)
}

/// Joins images of one size side by side.
fn beside(pictures: &[&Picture]) -> Picture {
    let (width, height) = pictures.first().map_or((0, 0), |first| (first.width, first.height));
    let rows = (0..height as usize).flat_map(|y| {
        let row = y * width as usize..(y + 1) * width as usize;
        pictures.iter().flat_map(move |picture| picture.data[row.clone()].iter().copied())
    });
    Picture { width: width * pictures.len() as u32, data: rows.collect(), ..*pictures[0] }
}
