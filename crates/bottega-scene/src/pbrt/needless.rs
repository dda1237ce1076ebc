//! pbrt parameters that have no effect here.

use crate::needless::{NeedlessParameters, Reason};

/// A directive with parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Directive {
    Camera,
    Film,
    Filter,
    Sampler,
    Integrator,
    Shape,
    Material,
    Texture,
    Light,
    Medium,
}

const fn row(
    kind: Directive,
    of: &'static [&'static str],
    names: &'static [&'static str],
    reason: Reason,
) -> NeedlessParameters<Directive> {
    NeedlessParameters { kind, of, names, reason }
}

/// The table by directive, types and names.
pub(super) const NEEDLESS: &[NeedlessParameters<Directive>] = &[
    row(Directive::Film, &[], &["filename", "savefp16"], Reason::Storage),
    row(Directive::Film, &[], &["diagonal"], Reason::Meaningless),
    row(Directive::Sampler, &[], &["seed", "randomization", "jitter"], Reason::Estimate),
    row(Directive::Integrator, &[], &["lightsampler", "samplebsdf", "rrthreshold", "seed"], Reason::Estimate),
    row(
        Directive::Integrator,
        &["mlt"],
        &["bootstrapsamples", "chains", "mutationsperpixel", "largestepprobability", "sigma"],
        Reason::Estimate,
    ),
    row(Directive::Shape, &["trianglemesh", "bilinearmesh"], &["faceIndices"], Reason::Meaningless),
    row(Directive::Shape, &["bilinearmesh"], &["emissionfilename"], Reason::Estimate),
    row(Directive::Shape, &["loopsubdiv"], &["scheme"], Reason::Meaningless),
    row(Directive::Shape, &["curve"], &["splitdepth"], Reason::Estimate),
    row(Directive::Texture, &["imagemap"], &["maxanisotropy"], Reason::Estimate),
    row(Directive::Material, &["coateddiffuse", "coatedconductor", "subsurface"], &["nsamples"], Reason::Estimate),
];

#[cfg(test)]
mod tests {
    use super::NEEDLESS;

    #[test]
    fn the_manual_names_all_of_them() {
        crate::needless::check_manual(NEEDLESS, 1);
    }
}
