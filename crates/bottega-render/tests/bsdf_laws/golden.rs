//! The same numbers as other renderers, material by material.

use std::collections::BTreeMap;

use bottega_scene::{
    Conductor, Dielectric, Distribution, Facets, InnerReflection, Material, Plastic, Principled, Shadowing, Spectrum,
    Surface,
};
use glam::Vec3;

use crate::bsdf_laws::support::bsdf_of;

/// wo, wi, and f |cos| by channel: printed by Mitsuba 3.9 (`golden/ask_mitsuba.py`).
fn rows() -> BTreeMap<String, Vec<[f32; 9]>> {
    serde_json::from_str(include_str!("golden/mitsuba.json")).unwrap()
}

fn facets(distribution: Distribution, u: f32, v: f32) -> Facets {
    Facets { distribution, roughness: [u.into(), v.into()], shadowing: Shadowing::Separable, ..Facets::default() }
}

fn color(r: f32, g: f32, b: f32) -> bottega_scene::ColorParam {
    Spectrum::new(r, g, b).into()
}

fn gold(facets: Facets, reflectance: Spectrum) -> Surface {
    let (eta, k) = (color(0.143, 0.375, 1.442), color(3.983, 2.386, 1.603));
    Surface::Conductor(Conductor { eta, k, reflectance: reflectance.into(), facets })
}

fn dielectric(eta: f32, facets: Facets, reflectance: Spectrum, transmittance: Spectrum) -> Surface {
    let (reflectance, transmittance) = (reflectance.into(), transmittance.into());
    Surface::Dielectric(Dielectric { eta, reflectance, transmittance, facets, thin: false })
}

/// Compares all rows of a material. The tolerance is that of single precision on both sides; rough plastic also has
/// integrals that both compute, by different nodes.
fn check(name: &str, surface: Surface) {
    let material = Material::from(surface);
    for row in &rows()[name] {
        let [wo, wi, expected] = [0, 3, 6].map(|i| Vec3::new(row[i], row[i + 1], row[i + 2]));
        // Ours is seen from above: turned about x.
        let front = wo.z > 0.0;
        let turned = |w: Vec3| if front { w } else { Vec3::new(w.x, -w.y, -w.z) };
        let value = bsdf_of(&material, front).eval(turned(wo), turned(wi)) * wi.z.abs();
        let off = (value - expected).abs().max_element();
        let tolerance = if name.starts_with("roughplastic") { 2e-3 } else { 1e-3 };
        assert!(off <= tolerance * expected.max_element() + 1e-6, "{name} {wo} {wi}: {value} instead of {expected}");
    }
}

const GGX: Distribution = Distribution::Ggx;
const BECKMANN: Distribution = Distribution::Beckmann;
const WHITE: Spectrum = Spectrum::ONE;

#[test]
fn matte_is_as_in_mitsuba() {
    check("diffuse", Surface::matte(Spectrum::new(0.7, 0.3, 0.1)));
}

#[test]
fn metal_is_as_in_mitsuba() {
    check("conductor_ggx", gold(facets(GGX, 0.3, 0.3), WHITE));
    check("conductor_ggx_stretched", gold(facets(GGX, 0.1, 0.5), Spectrum::new(0.9, 0.8, 0.5)));
    check("conductor_beckmann", gold(facets(BECKMANN, 0.2, 0.2), WHITE));
    check("conductor_beckmann_stretched", gold(facets(BECKMANN, 0.4, 0.15), WHITE));
    let mirror = Conductor {
        eta: Spectrum::ZERO.into(),
        k: Spectrum::ZERO.into(),
        reflectance: WHITE.into(),
        facets: facets(GGX, 0.5, 0.5),
    };
    check("mirror_rough", Surface::Conductor(mirror));
}

#[test]
fn rough_glass_is_as_in_mitsuba() {
    check("dielectric_ggx", dielectric(1.5, facets(GGX, 0.3, 0.3), WHITE, WHITE));
    let (reflectance, transmittance) = (Spectrum::new(0.9, 0.5, 0.2), Spectrum::new(0.3, 0.6, 0.9));
    check("dielectric_beckmann", dielectric(1.8, facets(BECKMANN, 0.4, 0.4), reflectance, transmittance));
    check("dielectric_stretched", dielectric(1.0 / 1.33, facets(GGX, 0.5, 0.2), WHITE, WHITE));
}

#[test]
fn plastic_is_as_in_mitsuba() {
    use InnerReflection::{Linear, Lost, Nonlinear};
    let plastic = |eta, diffuse, specular: Spectrum, inner, facets| {
        Surface::Plastic(Plastic { eta, diffuse, specular: specular.into(), inner, facets })
    };
    let red = color(0.7, 0.3, 0.1);
    check("plastic", plastic(1.49, red.clone(), WHITE, Linear, Facets::smooth()));
    check("plastic_nonlinear", plastic(1.9, red.clone(), WHITE, Nonlinear, Facets::smooth()));
    check("roughplastic_beckmann", plastic(1.49, red.clone(), WHITE, Linear, facets(BECKMANN, 0.1, 0.1)));
    let blue = Spectrum::new(0.5, 0.7, 0.9);
    let orange = color(0.9, 0.5, 0.1);
    check("roughplastic_ggx", plastic(1.7, orange.clone(), blue, Nonlinear, facets(GGX, 0.35, 0.35)));
    check("pplastic", plastic(1.49, red, WHITE, Lost, facets(BECKMANN, 0.1, 0.1)));
    check("pplastic_stretched", plastic(1.7, orange, blue, Lost, facets(GGX, 0.4, 0.2)));
}

fn principled() -> Principled {
    Principled {
        base_color: color(0.7, 0.3, 0.1),
        roughness: 0.4.into(),
        anisotropic: 0.0.into(),
        metallic: 0.0.into(),
        spec_trans: 0.0.into(),
        eta: eta_of_specular(0.5),
        spec_tint: 0.0.into(),
        sheen: 0.0.into(),
        sheen_tint: 0.0.into(),
        flatness: 0.0.into(),
        clearcoat: 0.0.into(),
        clearcoat_gloss: 0.0.into(),
        diff_trans: 0.0.into(),
        thin: false,
    }
}

/// Mitsuba's other way to tell the index of refraction.
fn eta_of_specular(specular: f32) -> f32 {
    2.0 / (1.0 - (0.08 * specular).sqrt()) - 1.0
}

#[test]
fn principled_is_as_in_mitsuba() {
    let check = |name, surface: Principled| check(name, Surface::Principled(Box::new(surface)));
    check("principled", principled());
    check(
        "principled_metal",
        Principled {
            metallic: 0.8.into(),
            anisotropic: 0.7.into(),
            eta: eta_of_specular(0.6),
            spec_tint: 0.4.into(),
            ..principled()
        },
    );
    check(
        "principled_cloth",
        Principled {
            sheen: 0.8.into(),
            sheen_tint: 0.5.into(),
            flatness: 0.6.into(),
            clearcoat: 0.9.into(),
            clearcoat_gloss: 0.3.into(),
            eta: 1.4,
            ..principled()
        },
    );
    check(
        "principled_glass",
        Principled {
            spec_trans: 0.7.into(),
            eta: 1.5,
            metallic: 0.1.into(),
            spec_tint: 0.3.into(),
            anisotropic: 0.3.into(),
            ..principled()
        },
    );
    check(
        "principledthin",
        Principled {
            spec_trans: 0.6.into(),
            diff_trans: 0.7.into(),
            eta: 1.33,
            spec_tint: 0.3.into(),
            anisotropic: 0.5.into(),
            sheen: 0.5.into(),
            sheen_tint: 0.6.into(),
            flatness: 0.4.into(),
            thin: true,
            ..principled()
        },
    );
}
