//! Mitsuba parameters that have no effect here.

use super::document::Class;
use crate::needless::{NeedlessParameters, Reason};

const fn row(
    kind: Class,
    of: &'static [&'static str],
    names: &'static [&'static str],
    reason: Reason,
) -> NeedlessParameters<Class> {
    NeedlessParameters { kind, of, names, reason }
}

/// The table by class, plugins and names, in snake case.
pub(super) const NEEDLESS: &[NeedlessParameters<Class>] = &[
    row(Class::Sampler, &[], &[], Reason::Estimate),
    row(Class::Sensor, &[], &["srf"], Reason::Spectra),
    row(
        Class::Sensor,
        &["perspective", "perspective_rdist"],
        &["focus_distance", "aperture_radius"],
        Reason::Meaningless,
    ),
    row(Class::Film, &[], &["file_format", "component_format", "banner", "attach_log", "variable"], Reason::Storage),
    row(Class::Film, &[], &["compensate", "sample_border", "high_quality_edges"], Reason::Estimate),
    row(
        Class::Integrator,
        &[],
        &[
            "rr_depth",
            "strict_normals",
            "samples_per_pass",
            "block_size",
            "timeout",
            "max_error",
            "p_value",
            "max_sample_factor",
        ],
        Reason::Estimate,
    ),
    row(
        Class::Integrator,
        &["direct", "photonmapper", "ppm", "sppm"],
        &["emitter_samples", "bsdf_samples", "shading_samples", "luminaire_samples"],
        Reason::Estimate,
    ),
    row(
        Class::Integrator,
        &["photonmapper", "ppm", "sppm"],
        &[
            "direct_samples",
            "glossy_samples",
            "volume_photons",
            "volume_lookup_size",
            "granularity",
            "alpha",
            "global_photons",
            "caustic_photons",
            "caustic_lookup_radius",
            "gather_locally",
            "auto_cancel_gathering",
        ],
        Reason::Estimate,
    ),
    row(Class::Texture, &["bitmap"], &["format", "accel", "max_anisotropy", "cache"], Reason::Storage),
    row(Class::Emitter, &["envmap"], &["mis_compensation", "cache"], Reason::Estimate),
    row(Class::Emitter, &[], &["sampling_weight", "shadow_map_resolution"], Reason::Estimate),
    row(Class::Emitter, &["sky", "sun", "sunsky"], &["resolution"], Reason::Estimate),
    row(Class::Bsdf, &["roughdiffuse"], &["use_fast_approx"], Reason::Estimate),
    row(
        Class::Bsdf,
        &["roughconductor", "roughdielectric", "roughplastic", "pplastic", "roughcoating"],
        &["sample_visible"],
        Reason::Estimate,
    ),
    row(
        Class::Bsdf,
        &["principled", "principledthin"],
        &[
            "diffuse_reflectance_sampling_rate",
            "main_specular_sampling_rate",
            "clearcoat_sampling_rate",
            "specular_reflectance_sampling_rate",
            "diffuse_transmittance_sampling_rate",
            "specular_transmittance_sampling_rate",
        ],
        Reason::Estimate,
    ),
    row(Class::Bsdf, &["conductor", "roughconductor"], &["ext_eta"], Reason::Meaningless),
    row(
        Class::Bsdf,
        &["polarizer", "circular", "retarder"],
        &["theta", "delta", "polarizing", "left_handed"],
        Reason::Spectra,
    ),
    row(Class::Medium, &[], &["sample_emitters", "has_spectral_extinction", "step_size", "method"], Reason::Estimate),
    row(Class::Volume, &["gridvolume"], &["raw", "accel"], Reason::Storage),
    row(Class::Shape, &[], &["silhouette_sampling_weight"], Reason::Estimate),
    row(Class::Shape, &["obj", "ply", "serialized"], &["compress", "collapse", "load_visibility"], Reason::Storage),
];

#[cfg(test)]
mod tests {
    use super::NEEDLESS;

    #[test]
    fn the_manual_names_all_of_them() {
        crate::needless::check_manual(NEEDLESS, 0);
    }
}
