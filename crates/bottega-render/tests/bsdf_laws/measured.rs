//! Measured materials: their samples, energy, and values against Mitsuba's.

use std::path::Path;

use bottega_render::bsdf::{Bsdf, TransportMode};
use bottega_scene::{Material, Measured, Spectrum, Surface};
use glam::Vec3;

use crate::bsdf_laws::chi_square;
use crate::bsdf_laws::energy::measured_albedo;
use crate::bsdf_laws::support::{Uniform, at, bsdf_of};

/// Isotropic by RGB; with the symmetry of a half turn, by wavelengths; with two planes of symmetry, absolute.
const NAMES: [&str; 3] = ["copper", "brushed", "velvet"];

/// The files that `bottega-scene/tests/measured/data/make.py` writes.
fn data(name: &str) -> std::path::PathBuf {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    if name == "copper.bsdf" {
        return crates.join("../scenes/models/measured.bsdf");
    }
    crates.join("bottega-scene/tests/measured/data").join(name)
}

fn bsdf(name: &str) -> Bsdf<'static> {
    let measured = Measured::read(&data(&format!("{name}.bsdf")), 1 << 20).unwrap();
    bsdf_of(&Material::from(Surface::Measured(measured.into())), true)
}

#[test]
fn values_and_densities_are_those_of_mitsuba() {
    let text = std::fs::read_to_string(data("values.txt")).unwrap();
    let bsdfs = NAMES.map(bsdf);
    let (mut count, mut worst) = (0, [0.0_f32; 2]);
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (name, numbers) = line.split_once(' ').unwrap();
        let numbers: Vec<f32> = numbers.split(' ').map(|number| number.parse().unwrap()).collect();
        let [wo, wi, expected] = [0, 3, 6].map(|first| Vec3::from_slice(&numbers[first..]));
        let index = NAMES.iter().position(|known| *known == name).unwrap();
        let (value, pdf) = bsdfs[index].eval_pdf(wo.normalize(), wi.normalize());
        let off = (value - expected).abs().max_element() / expected.max_element().max(1e-3);
        let pdf_off = (pdf - numbers[9]).abs() / numbers[9].max(1e-3);
        worst = [worst[0].max(off), worst[1].max(pdf_off)];
        assert!(off < 1e-3 && pdf_off < 1e-3, "{line}: {value} {pdf}");
        count += 1;
    }
    eprintln!("{count} values within {:e}, densities within {:e}", worst[0], worst[1]);
    assert_eq!(count, 108);
}

#[test]
fn isotropic_materials_are_drawn_by_their_density() {
    chi_square::check_each(NAMES[0], &[1.0], |_| bsdf(NAMES[0]));
}

#[test]
fn anisotropic_materials_are_drawn_by_their_density() {
    for name in &NAMES[1..] {
        chi_square::check_each(name, &[1.0], |_| bsdf(name));
    }
}

#[test]
fn measured_materials_scatter_no_more_than_they_receive() {
    for name in NAMES {
        let bsdf = bsdf(name).with_mode(TransportMode::Importance);
        for (seed, cos) in [0.98, 0.6, 0.25, 0.05].into_iter().enumerate() {
            let (mean, error) = measured_albedo(&bsdf, at(cos, 1.0), 4000, seed as u64);
            let excess = mean - Spectrum::ONE - 4.0 * error;
            assert!(excess.max_element() < 2e-3, "{name} {cos}: {mean} ± {error}");
            // The estimate leaves out what is lost at the horizon
            if name != "velvet" && cos > 0.2 {
                let off = bsdf.albedo(at(cos, 1.0)) - mean;
                assert!(off.abs().max_element() < 0.05, "{name} {cos}: {mean} {off}");
            }
        }
    }
}

#[test]
fn samples_of_measured_materials_have_the_weight_of_their_value_and_density() {
    let mut uniform = Uniform::new(25);
    for bsdf in NAMES.map(bsdf) {
        for _ in 0..2000 {
            let wo = at(10f32.powf(-5.0 * uniform.next()), 6.3 * uniform.next());
            let Some(sample) = bsdf.sample(wo, uniform.next(), uniform.pair()) else { continue };
            assert!((sample.wi.length() - 1.0).abs() < 1e-4 && sample.wi.z > 0.0, "{sample:?}");
            assert!(sample.weight().is_finite() && sample.value.min_element() >= 0.0, "{sample:?}");
            assert_eq!(bsdf.eval_pdf(wo, sample.wi), (sample.value, sample.pdf));
        }
        assert_eq!(bsdf.eval_pdf(Vec3::Z, -Vec3::Z), (Spectrum::ZERO, 0.0));
        let edges = [[0.0, 0.0], [1.0_f32.next_down(), 0.0], [0.0, 1.0_f32.next_down()], [0.5, 1.0_f32.next_down()]];
        for (wo, u) in [Vec3::Z, Vec3::X, Vec3::new(1.0, 0.0, 1e-6)].into_iter().flat_map(|wo| edges.map(|u| (wo, u))) {
            assert!(bsdf.sample(wo, 0.5, u).is_none_or(|sample| sample.weight().is_finite()), "{wo} {u:?}");
        }
    }
}
