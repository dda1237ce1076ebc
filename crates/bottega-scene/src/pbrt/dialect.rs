//! Detection of pbrt-v3 files.

use super::params::UPGRADE;
use super::token::Token;
use crate::import::text_place::{TextFault, TextPlace};

/// Directives and types that exist only in pbrt-v3 or earlier.
const OLD: &[(&str, &[&str])] = &[
    ("Texture type", &["color"]),
    ("directive", &["Renderer", "SurfaceIntegrator", "VolumeIntegrator", "Volume", "SearchPath"]),
    ("Film", &["image"]),
    ("Sampler", &["lowdiscrepancy", "02sequence", "maxmindist", "random", "bestcandidate", "adaptive"]),
    ("Integrator", &["directlighting", "whitted"]),
    ("Camera", &["environment"]),
    ("Shape", &["cone", "hyperboloid", "paraboloid", "heightfield", "nurbs"]),
    ("AreaLightSource", &["area"]),
    ("Material", OLD_MATERIALS),
    ("MakeNamedMaterial", OLD_MATERIALS),
    ("MakeNamedMedium", &["heterogeneous"]),
];

const OLD_MATERIALS: &[&str] = &[
    "matte",
    "plastic",
    "glass",
    "metal",
    "mirror",
    "uber",
    "substrate",
    "translucent",
    "disney",
    "fourier",
    "kdsubsurface",
    "shinymetal",
];

/// Returns an error for a directive or type of pbrt-v3.
pub(super) fn check(directive: &str, kind: &str, at: TextPlace) -> Result<(), TextFault> {
    let is_old = OLD.iter().any(|(old, kinds)| *old == directive && kinds.contains(&kind));
    if is_old { Err(old_version(at, directive, kind)) } else { Ok(()) }
}

/// Makes the error for a pbrt-v3 file.
fn old_version(at: TextPlace, what: &str, name: &str) -> TextFault {
    at.fault(format!("{what} \"{name}\" is of pbrt-v3, and pbrt-v4 differs in much; {UPGRADE}"))
}

/// Returns true if an option may change the picture.
pub(super) fn option_matters(name: &str, value: &Token<'_>) -> bool {
    let name: String = name.chars().filter(|c| *c != '_' && *c != '-').flat_map(char::to_lowercase).collect();
    let is_false = matches!(value, Token::Word(word) | Token::Text(word) if word == "false");
    let changes = matches!(
        name.as_str(),
        "disablepixeljitter" | "disabletexturefiltering" | "forcediffuse" | "displacementedgescale"
    );
    // Known options without effect concern noise, statistics and hardware.
    let is_known = matches!(
        name.as_str(),
        "disablewavelengthjitter"
            | "msereferenceimage"
            | "msereferenceout"
            | "seed"
            | "pixelstats"
            | "wavefront"
            | "rendercoordsys"
            | "quiet"
    );
    (changes && !is_false) || !(changes || is_known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_without_effect_are_not_reported() {
        let on = Token::Word("true".into());
        assert!(!option_matters("seed", &Token::Word("7".into())));
        assert!(option_matters("disablePixelJitter", &on));
        assert!(!option_matters("disable_pixel_jitter", &Token::Word("false".into())));
        assert!(option_matters("nonsense", &on));
    }
}
