//! Encoding of surfaces as words: a head per kind, then the parameters.

use bottega_render::bsdf::fresnel::IOR_MAX;
use bottega_render::bsdf::precomputed::CoverBoundary;
use bottega_render::flat::Portable;
use bottega_scene::{
    Coated, CoatedBase, Conductor, Dielectric, Distribution, Facets, InnerReflection, Layered, Plastic, Principled,
    RoughnessScale, ScalarParam, Shadowing, Spectrum, Surface,
};

use super::covers::{add_cover, is_smooth, is_textured};
use super::features::Features;
use super::writer::Writer;
use crate::shared::materials::*;

/// Writes a surface and returns its place; 0: nothing scatters.
pub(super) fn add_surface(writer: &mut Writer<'_>, surface: &Surface) -> u32 {
    if depth(surface) > BLEND_DEPTH_MAX {
        writer.missing.push(format!("more than {BLEND_DEPTH_MAX} blends within each other"));
        return 0;
    }
    writer.features = writer.features.with(features(surface));
    match surface {
        Surface::Null | Surface::Unlit(_) => 0,
        Surface::Diffuse(it) => {
            let params =
                DiffuseParams { reflectance: writer.color(&it.reflectance), roughness: writer.scalar(&it.roughness) };
            writer.record(&PlainHead { kind: kind::<DiffuseParams>(SURFACE_DIFFUSE) }, &params)
        }
        Surface::DiffuseTransmission { reflectance, transmittance } => {
            let params = TranslucentParams {
                reflectance: writer.color(reflectance),
                transmittance: writer.color(transmittance),
            };
            writer.record(&PlainHead { kind: kind::<TranslucentParams>(SURFACE_TRANSLUCENT) }, &params)
        }
        Surface::Conductor(it) => {
            let (params, facets) = (conductor_params(writer, it), bits(&it.facets));
            writer.record(&ConductorHead { kind: kind::<ConductorParams>(SURFACE_CONDUCTOR), facets }, &params)
        }
        Surface::Dielectric(it) => add_dielectric(writer, it),
        Surface::Blend { weight, surfaces } => {
            let [first, second] = surfaces.each_ref().map(|part| add_surface(writer, part));
            let params = BlendParams { weight: writer.scalar(weight) };
            writer.record(&BlendHead { kind: kind::<BlendParams>(SURFACE_BLEND), first, second }, &params)
        }
        // Scenes with a sum are declined as a whole: its first part stands for it
        Surface::Sum(surfaces) => add_surface(writer, &surfaces[0]),
        Surface::Plastic(it) => add_plastic(writer, it),
        Surface::Coated(it) => add_coated(writer, it),
        Surface::Principled(it) => add_principled(writer, it),
        Surface::Layered(it) => add_layered(writer, it),
        Surface::Hair(_) => {
            writer.missing.push("hair".into());
            0
        }
        Surface::Varnished(_) => {
            writer.missing.push("varnish".into());
            0
        }
        Surface::Phong(_) | Surface::Ward(_) => {
            writer.missing.push("highlights of Phong and Ward".into());
            0
        }
        Surface::Measured(_) => {
            writer.missing.push("measured materials".into());
            0
        }
    }
}

/// Returns the first word of a record: the kind, and the number of parameters of type `P`.
fn kind<P: Portable>(kind: u32) -> u32 {
    kind | (P::WORDS / Param::WORDS) << SURFACE_COUNT_SHIFT
}

fn add_dielectric(writer: &mut Writer<'_>, it: &Dielectric) -> u32 {
    let params = DielectricParams {
        reflectance: writer.color(&it.reflectance),
        transmittance: writer.color(&it.transmittance),
        roughness_x: writer.scalar(&it.facets.roughness[0]),
        roughness_y: writer.scalar(&it.facets.roughness[1]),
    };
    let (kind, facets) = (kind::<DielectricParams>(SURFACE_DIELECTRIC), bits(&it.facets));
    writer.record(&DielectricHead { kind, facets, eta: sound_eta(it.eta), thin: it.thin }, &params)
}

fn add_plastic(writer: &mut Writer<'_>, it: &Plastic) -> u32 {
    let eta = sound_eta(it.eta);
    let inner = match it.inner {
        InnerReflection::Linear => PLASTIC_LINEAR,
        InnerReflection::Nonlinear => PLASTIC_NONLINEAR,
        InnerReflection::Lost => PLASTIC_LOST,
    };
    let cover = if it.inner == InnerReflection::Lost || is_smooth(&it.facets) {
        0
    } else {
        add_cover(&mut writer.words, &it.facets, &[boundary(&it.facets, eta, 0.0, true)], 0)
    };
    let params = PlasticParams {
        diffuse: writer.color(&it.diffuse),
        specular: writer.color(&it.specular),
        roughness_x: writer.scalar(&it.facets.roughness[0]),
        roughness_y: writer.scalar(&it.facets.roughness[1]),
    };
    let (kind, facets) = (kind::<PlasticParams>(SURFACE_PLASTIC), bits(&it.facets));
    writer.record(&PlasticHead { kind, facets, eta, inner, cover }, &params)
}

fn boundary(facets: &Facets, eta: f32, thickness: f32, is_plastic: bool) -> CoverBoundary {
    CoverBoundary { distribution: facets.distribution, shadowing: facets.shadowing, eta, thickness, is_plastic }
}

fn add_coated(writer: &mut Writer<'_>, it: &Coated) -> u32 {
    let eta = sound_eta(it.eta);
    let coat = CoatedParams {
        albedo: writer.color(&it.albedo),
        thickness: writer.scalar(&it.thickness),
        g: writer.scalar(&it.g),
        roughness_x: writer.scalar(&it.facets.roughness[0]),
        roughness_y: writer.scalar(&it.facets.roughness[1]),
    };
    let head = CoatedHead {
        kind: kind::<OverDiffuse>(SURFACE_COATED),
        facets: bits(&it.facets),
        eta,
        max_depth: it.max_depth.min(COATED_EVENTS_MAX),
        cover: 0,
        is_metal: false,
        base_facets: 0,
    };
    match &it.base {
        CoatedBase::Diffuse(diffuse) => {
            let base = writer.color(&diffuse.reflectance);
            // If the layer does not scatter, a matte base has a closed form.
            let may_be_clear = it.albedo.factor.max_element() <= 0.0 || it.albedo.texture.is_some();
            let cover = if may_be_clear { add_coat(writer, it, eta) } else { 0 };
            writer.record(&CoatedHead { cover, ..head }, &OverDiffuse { coat, base })
        }
        CoatedBase::Conductor(conductor) => {
            let base = conductor_params(writer, conductor);
            let kind = kind::<OverConductor>(SURFACE_COATED);
            let head = CoatedHead { kind, is_metal: true, base_facets: bits(&conductor.facets), ..head };
            writer.record(&head, &OverConductor { coat, base })
        }
    }
}

/// Writes the cover of a clear coat, for every thickness that it can have.
fn add_coat(writer: &mut Writer<'_>, it: &Coated, eta: f32) -> u32 {
    let of = |thickness: f32| boundary(&it.facets, eta, thickness, false);
    let Some((map, _)) = &it.thickness.texture else {
        let thickness = it.thickness.factor;
        let thickness = if thickness > 0.0 { thickness.min(100.0) } else { 0.0 };
        return add_cover(&mut writer.words, &it.facets, &[of(thickness)], 0);
    };
    if is_textured(&it.facets) {
        writer.missing.push("clear coats whose thickness and roughness are both textures".into());
        return 0;
    }
    let image = &writer.scene.images[map.image.0 as usize];
    let (width, height) = image.size();
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let most = texels.fold(0.0_f32, |most, (x, y)| most.max(image.texel(x, y).max_element()));
    let most = (it.thickness.factor * most).clamp(0.0, 100.0);
    // The first step of thickness: absorption is negligible below it.
    const FIRST: i32 = -80;
    let last = if most > 0.0 { (COVER_STEPS_PER_OCTAVE * most.log2()).ceil() as i32 } else { FIRST };
    let nodes = (FIRST..=last.max(FIRST)).map(|step| (step as f32 / COVER_STEPS_PER_OCTAVE).exp2());
    let boundaries: Vec<_> = std::iter::once(0.0).chain(nodes).map(of).collect();
    add_cover(&mut writer.words, &it.facets, &boundaries, FIRST)
}

fn add_principled(writer: &mut Writer<'_>, it: &Principled) -> u32 {
    let params = PrincipledParams {
        base_color: writer.color(&it.base_color),
        roughness: writer.scalar(&it.roughness),
        anisotropic: writer.scalar(&it.anisotropic),
        metallic: writer.scalar(&it.metallic),
        spec_trans: writer.scalar(&it.spec_trans),
        spec_tint: writer.scalar(&it.spec_tint),
        sheen: writer.scalar(&it.sheen),
        sheen_tint: writer.scalar(&it.sheen_tint),
        flatness: writer.scalar(&it.flatness),
        clearcoat: writer.scalar(&it.clearcoat),
        clearcoat_gloss: writer.scalar(&it.clearcoat_gloss),
        diff_trans: writer.scalar(&it.diff_trans),
    };
    let kind = kind::<PrincipledParams>(SURFACE_PRINCIPLED);
    writer.record(&PrincipledHead { kind, thin: it.thin, eta: sound_eta(it.eta) }, &params)
}

fn add_layered(writer: &mut Writer<'_>, it: &Layered) -> u32 {
    let none = ScalarParam::from(0.0);
    let (film, stretch) = (it.iridescence.as_ref(), it.anisotropy.as_ref());
    let strength = Spectrum::splat(stretch.map_or(0.0, |stretch| stretch.strength));
    let params = LayeredParams {
        base_color: writer.color(&it.base_color),
        specular_color: writer.color(&it.specular_color),
        through_color: writer.color(&it.diffuse_transmission_color),
        sheen_color: writer.color(&it.sheen_color),
        metallic: writer.scalar(&it.metallic),
        roughness: writer.scalar(&it.roughness),
        specular: writer.scalar(&it.specular),
        transmission: writer.scalar(&it.transmission),
        diffuse_transmission: writer.scalar(&it.diffuse_transmission),
        coat: writer.scalar(&it.coat),
        coat_roughness: writer.scalar(&it.coat_roughness),
        sheen_roughness: writer.scalar(&it.sheen_roughness),
        film: writer.scalar(film.map_or(&none, |film| &film.factor)),
        film_thickness: writer.channel(Spectrum::ONE, film.and_then(|film| film.thickness_texture.as_ref())),
        anisotropy: writer.mapped(strength, stretch.and_then(|stretch| stretch.texture.as_ref())),
    };
    let within = |ior: f32| if ior > 1.0 { ior.min(IOR_MAX) } else { 1.0 };
    let [film_least, film_most] = film.map_or([0.0; 2], |film| film.thickness);
    let head = LayeredHead {
        kind: kind::<LayeredParams>(SURFACE_LAYERED),
        thin: it.thin,
        ior: if it.ior == 0.0 { 0.0 } else { within(it.ior) },
        dispersion: if it.dispersion > 0.0 { it.dispersion.min(20.0) } else { 0.0 },
        film_ior: film.map_or(1.0, |film| within(film.ior)),
        film_least,
        film_most,
    };
    writer.record(&head, &params)
}

fn conductor_params(writer: &mut Writer<'_>, it: &Conductor) -> ConductorParams {
    ConductorParams {
        eta: writer.color(&it.eta),
        k: writer.color(&it.k),
        reflectance: writer.color(&it.reflectance),
        roughness_x: writer.scalar(&it.facets.roughness[0]),
        roughness_y: writer.scalar(&it.facets.roughness[1]),
    }
}

/// Returns the flags of facets: distribution, shadowing and the scale of roughness.
fn bits(facets: &Facets) -> u32 {
    let scale = match facets.scale {
        RoughnessScale::Alpha => FACETS_ALPHA,
        RoughnessScale::SquareRoot => FACETS_SQUARE_ROOT,
        RoughnessScale::Square => FACETS_SQUARE,
    };
    let beckmann = if facets.distribution == Distribution::Beckmann { FACETS_BECKMANN } else { 0 };
    let separable = if facets.shadowing == Shadowing::Separable { FACETS_SEPARABLE } else { 0 };
    beckmann | separable | scale << FACETS_SCALE_SHIFT
}

/// Clamps an index of refraction to a range in which the formulas are finite.
fn sound_eta(eta: f32) -> f32 {
    if eta > 0.05 { eta.min(20.0) } else { 1.0 }
}

/// Returns the features that one surface uses, without those of its parts.
fn features(surface: &Surface) -> Features {
    let facets = |facets: &Facets| {
        Features::default().with_if(facets.distribution == Distribution::Beckmann, Features::BECKMANN)
    };
    // A coat may lie on metal.
    let stack = Features::STACK.with(Features::CONDUCTOR);
    match surface {
        Surface::Null | Surface::Unlit(_) | Surface::Blend { .. } | Surface::Sum(_) => Features::default(),
        // Scenes with these are declined as a whole
        Surface::Hair(_) | Surface::Varnished(_) | Surface::Phong(_) | Surface::Ward(_) | Surface::Measured(_) => {
            Features::default()
        }
        Surface::Diffuse(_) | Surface::DiffuseTransmission { .. } => Features::default(),
        Surface::Conductor(it) => facets(&it.facets).with(Features::CONDUCTOR),
        Surface::Dielectric(it) => facets(&it.facets).with(Features::DIELECTRIC),
        Surface::Plastic(it) => facets(&it.facets).with(Features::PLASTIC),
        Surface::Coated(it) => match &it.base {
            CoatedBase::Conductor(base) => facets(&it.facets).with(facets(&base.facets)).with(stack),
            CoatedBase::Diffuse(_) => {
                let scatters = it.albedo.factor.max_element() > 0.0;
                facets(&it.facets).with(Features::PLASTIC).with_if(scatters, stack)
            }
        },
        Surface::Principled(_) => Features::PRINCIPLED,
        Surface::Layered(it) => Features::LAYERED
            .with_if(it.iridescence.is_some(), Features::FILM)
            .with_if(it.coat.factor > 0.0, Features::COAT)
            .with_if(it.sheen_color.factor.max_element() > 0.0, Features::SHEEN),
    }
}

fn depth(surface: &Surface) -> u32 {
    match surface {
        Surface::Blend { surfaces, .. } | Surface::Sum(surfaces) => 1 + surfaces.iter().map(depth).max().unwrap_or(0),
        _ => 0,
    }
}
