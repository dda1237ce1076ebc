//! Pictures against an independent renderer. The references lie in the folder that `BOTTEGA_SCENES` names.

use std::path::{Path, PathBuf};

use crate::program::support::{succeed, text};
use bottega_image::Picture;

/// Side of the blocks of pixels whose means are compared.
const BLOCK: u32 = 32;

/// Tolerance of a channel's mean beyond noise: the rounding of the reference's values,
/// and its own noise.
const MEAN_MARGIN: f64 = 0.002;

fn reference(name: &str) -> Option<Picture> {
    let Some(folder) = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from) else {
        eprintln!("skipped: set BOTTEGA_SCENES to the folder of the reference pictures");
        return None;
    };
    Some(bottega_image::read_picture(folder.join(name)).expect("a reference picture"))
}

fn painted(scene: &Path, seed: u32, more: &[&str]) -> Picture {
    let folder = tempfile::tempdir().expect("a folder");
    let (output, seed) = (folder.path().join("picture.exr"), seed.to_string());
    let mut arguments = vec!["render", text(scene), "-o", text(&output), "--quiet", "--filter", "box", "--seed", &seed];
    arguments.extend(more);
    succeed(&arguments);
    bottega_image::read_picture(&output).expect("a picture")
}

/// Means of blocks of pixels, by channel.
fn blocks(picture: &Picture) -> Vec<[f64; 3]> {
    let (columns, rows) = (picture.width / BLOCK, picture.height / BLOCK);
    let mean = |bx: u32, by: u32| {
        let mut sum = [0.0; 3];
        for y in by * BLOCK..(by + 1) * BLOCK {
            for x in bx * BLOCK..(bx + 1) * BLOCK {
                for (sum, value) in sum.iter_mut().zip(picture.pixel(x, y)) {
                    *sum += f64::from(value);
                }
            }
        }
        sum.map(|sum| sum / f64::from(BLOCK * BLOCK))
    };
    (0..rows).flat_map(|by| (0..columns).map(move |bx| (bx, by))).map(|(bx, by)| mean(bx, by)).collect()
}

/// Compares block by block, with the noise known from several seeds, and as a whole.
fn agrees(pictures: &[Picture], reference: &Picture) {
    let painted: Vec<Vec<[f64; 3]>> = pictures.iter().map(blocks).collect();
    let reference = blocks(reference);
    let (n, count) = (pictures.len() as f64, reference.len());
    for channel in 0..3 {
        let mut z_squared = Vec::new();
        let (mut sum, mut expected, mut variance_of_sum) = (0.0, 0.0, 0.0);
        for block in 0..count {
            let values: Vec<f64> = painted.iter().map(|picture| picture[block][channel]).collect();
            let mean = values.iter().sum::<f64>() / n;
            let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0) / n;
            let margin = (MEAN_MARGIN * reference[block][channel]).powi(2);
            z_squared.push((mean - reference[block][channel]).powi(2) / (variance + margin));
            sum += mean;
            expected += reference[block][channel];
            variance_of_sum += variance;
        }
        let off = (sum / expected - 1.0).abs();
        let allowed = MEAN_MARGIN + 4.0 * variance_of_sum.sqrt() / expected;
        assert!(allowed < 0.005, "too noisy to tell: {allowed}");
        assert!(off < allowed, "channel {channel}: the mean is off by {off}, allowed is {allowed}");
        // By Student's t with few degrees of freedom single blocks may be far off; most must not be.
        z_squared.sort_by(f64::total_cmp);
        let ninth_decile = z_squared[count * 9 / 10];
        assert!(
            ninth_decile < 9.0,
            "channel {channel}: a tenth of the blocks is off by over {} σ",
            ninth_decile.sqrt()
        );
    }
}

#[test]
fn a_diffuse_box_agrees_with_mitsuba() {
    let Some(reference) = reference("peers/reference/ref_a_cornell.exr") else { return };
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes/diffuse-box.glb");
    let settings = ["--size", "512x512", "--spp", "2", "--max-depth", "17", "--env", "0,0,0"];
    let pictures: Vec<Picture> = (0..4).map(|seed| painted(&scene, seed, &settings)).collect();
    agrees(&pictures, &reference);
}
