//! Assembly of the BSDF shaders for the features that a scene uses.

use super::features::Features;

/// The shader files and the feature that needs each; `None`: always included.
const FILES: [(Option<Features>, &str); 26] = [
    (None, include_str!("../wgsl/math.wgsl")),
    (None, include_str!("../wgsl/bsdf/warp.wgsl")),
    (None, include_str!("../wgsl/bsdf/frame.wgsl")),
    (None, include_str!("../wgsl/image/lookup.wgsl")),
    (None, include_str!("../wgsl/material.wgsl")),
    (None, include_str!("../wgsl/interaction/relief.wgsl")),
    (None, include_str!("../wgsl/bsdf/unevenness.wgsl")),
    (None, include_str!("../wgsl/bsdf/fresnel.wgsl")),
    (None, include_str!("../wgsl/bsdf/ggx.wgsl")),
    (Some(Features::BECKMANN), include_str!("../wgsl/bsdf/beckmann.wgsl")),
    (None, include_str!("../wgsl/bsdf/microfacet.wgsl")),
    (None, include_str!("../wgsl/bsdf/scattering.wgsl")),
    (None, include_str!("../wgsl/bsdf/matte.wgsl")),
    (Some(Features::CONDUCTOR), include_str!("../wgsl/bsdf/conductor.wgsl")),
    (Some(Features::DIELECTRIC), include_str!("../wgsl/bsdf/dielectric.wgsl")),
    (Some(Features::PLASTIC), include_str!("../wgsl/bsdf/cover.wgsl")),
    (Some(Features::PLASTIC), include_str!("../wgsl/bsdf/plastic.wgsl")),
    (Some(Features::STACK), include_str!("../wgsl/bsdf/coated.wgsl")),
    (Some(Features::PRINCIPLED), include_str!("../wgsl/bsdf/principled.wgsl")),
    (Some(Features::LAYERED), include_str!("../wgsl/bsdf/tables.wgsl")),
    (Some(Features::LAYERED), LAYERS),
    (Some(Features::LAYERED), include_str!("../wgsl/bsdf/interface.wgsl")),
    (Some(Features::LAYERED), include_str!("../wgsl/bsdf/params.wgsl")),
    (Some(Features::LAYERED), include_str!("../wgsl/bsdf/base.wgsl")),
    (Some(Features::LAYERED), include_str!("../wgsl/bsdf/layered.wgsl")),
    (None, include_str!("../wgsl/bsdf/surface.wgsl")),
];

const LAYERS: &str = concat!(
    include_str!("../wgsl/bsdf/film.wgsl"),
    include_str!("../wgsl/bsdf/sheen.wgsl"),
    include_str!("../wgsl/bsdf/coat.wgsl")
);

/// Returns the shader source for `features`: constants and functions only. Omits files that no feature needs, and with them the
/// lines that call them: lines that open and close an `if` of the feature's constant.
pub(crate) fn source(features: Features) -> String {
    let absent: Vec<_> = features.missing().map(|name| format!("if {name} {{")).collect();
    let calls_nothing = |line: &&str| {
        let is_whole = line.matches('{').count() == line.matches('}').count();
        !(is_whole && absent.iter().any(|guard| line.contains(guard.as_str())))
    };
    let files = FILES.iter().filter(|(needed_by, _)| needed_by.is_none_or(|needed_by| features.has_some_of(needed_by)));
    let lines = files.flat_map(|(_, file)| file.lines()).filter(calls_nothing);
    lines.fold(features.constants(), |source, line| source + line + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks that naga accepts the source together with the declarations that its users add.
    fn check(features: Features) {
        let source = [
            crate::shared::source(),
            "@group(0) @binding(0) var<storage, read> material_words: array<u32>;\n",
            "@group(0) @binding(1) var<storage, read> texture_words: array<u32>;\n",
            &source(features),
        ]
        .concat();
        let module = wgpu::naga::front::wgsl::parse_str(&source)
            .unwrap_or_else(|error| panic!("{features:?}: {}", error.emit_to_string(&source)));
        let mut validator = wgpu::naga::valid::Validator::new(Default::default(), Default::default());
        validator.validate(&module).unwrap_or_else(|error| panic!("{features:?}: {}", error.emit_to_string(&source)));
    }

    #[test]
    fn any_features_make_a_shader() {
        let stack = Features::STACK.with(Features::CONDUCTOR);
        let alone = [
            Features::default(),
            Features::TEXTURES,
            Features::BECKMANN,
            Features::CONDUCTOR,
            Features::DIELECTRIC,
            Features::PLASTIC,
            stack,
            Features::PRINCIPLED,
            Features::LAYERED,
            Features::LAYERED.with(Features::FILM),
            Features::LAYERED.with(Features::COAT),
            Features::LAYERED.with(Features::SHEEN),
        ];
        for one in alone {
            alone.iter().for_each(|&other| check(one.with(other)));
        }
        check(Features::ALL);
    }

    #[test]
    fn unused_features_are_left_out() {
        let matte = source(Features::default());
        assert!(
            !matte.contains("stack_walk")
                && !matte.contains("layered_eval_pdf(")
                && matte.contains("lambert_eval_pdf(")
        );
        let layered = source(Features::LAYERED);
        assert!(layered.contains("layered_eval_pdf(b, wi)") && !layered.contains("principled_eval_pdf("));
    }
}
