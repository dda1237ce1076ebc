//! Surfaces as words: the records that `surface.wgsl` reads.

use bottega_render::bsdf::precomputed::CoverBoundary;
use bottega_scene::{
    Coated, CoatedBase, ColorParam, Conductor, Distribution, Facets, InnerReflection, Layered, Plastic, Principled,
    RoughnessScale, ScalarParam, Shadowing, Spectrum, Surface,
};

use super::covers::{add_cover, is_smooth, is_textured};
use super::encode::Writer;
use super::features::Features;
use super::words::Words;

/// The kinds, as in the shader.
#[derive(Clone, Copy)]
enum Kind {
    Diffuse = 1,
    Translucent,
    Conductor,
    Dielectric,
    Plastic,
    Coated,
    Principled,
    Layered,
    Blend,
}

/// Most blends within blends.
const DEPTH_MAX: u32 = 64;

/// Greatest number of events within a coat that are followed.
const EVENTS_MAX: u32 = 1000;

/// A parameter of either type.
enum Param<'a> {
    Color(&'a ColorParam),
    Scalar(&'a ScalarParam),
    /// A colour, and the handle of a texture or 0.
    Handle(Spectrum, u32),
}

/// Writes a surface and returns its place; 0: nothing scatters.
pub(super) fn add_surface(writer: &mut Writer<'_>, surface: &Surface) -> u32 {
    if depth(surface) > DEPTH_MAX {
        writer.missing.push(format!("more than {DEPTH_MAX} blends within each other"));
        return 0;
    }
    use Param::{Color, Scalar};
    writer.features = writer.features.with(features(surface));
    match surface {
        Surface::Null | Surface::Unlit(_) => 0,
        Surface::Diffuse(it) => add(writer, Kind::Diffuse, &[], vec![Color(&it.reflectance), Scalar(&it.roughness)]),
        Surface::DiffuseTransmission { reflectance, transmittance } => {
            add(writer, Kind::Translucent, &[], vec![Color(reflectance), Color(transmittance)])
        }
        Surface::Conductor(it) => add(writer, Kind::Conductor, &[bits(&it.facets)], conductor_params(it)),
        Surface::Dielectric(it) => {
            let own = [bits(&it.facets), sound_eta(it.eta).to_bits(), u32::from(it.thin)];
            let mut params = vec![Color(&it.reflectance), Color(&it.transmittance)];
            params.extend(it.facets.roughness.iter().map(Scalar));
            add(writer, Kind::Dielectric, &own, params)
        }
        Surface::Blend { weight, surfaces } => {
            let parts = surfaces.each_ref().map(|part| add_surface(writer, part));
            add(writer, Kind::Blend, &parts, vec![Scalar(weight)])
        }
        Surface::Plastic(it) => add_plastic(writer, it),
        Surface::Coated(it) => add_coated(writer, it),
        Surface::Principled(it) => {
            let own = [u32::from(it.thin), sound_eta(it.eta).to_bits()];
            add(writer, Kind::Principled, &own, principled_params(it))
        }
        Surface::Layered(it) => add_layered(writer, it),
    }
}

/// Writes a record; `own`: up to seven words of the kind's own.
fn add(writer: &mut Writer<'_>, kind: Kind, own: &[u32], params: Vec<Param<'_>>) -> u32 {
    let mut record = Words::default();
    record.word(kind as u32 | (params.len() as u32) << 8);
    own.iter().for_each(|&word| record.word(word));
    record.fill_to(8);
    for param in params {
        match param {
            Param::Color(color) => writer.color(&mut record, color),
            Param::Scalar(scalar) => writer.scalar(&mut record, scalar),
            Param::Handle(factor, handle) => {
                record.color(factor);
                record.word(handle);
            }
        }
    }
    let place = writer.words.place() as u32;
    writer.words.0.append(&mut record.0);
    place
}

fn add_plastic(writer: &mut Writer<'_>, it: &Plastic) -> u32 {
    let eta = sound_eta(it.eta);
    let inner = match it.inner {
        InnerReflection::Linear => 0,
        InnerReflection::Nonlinear => 1,
        InnerReflection::Lost => 2,
    };
    let cover = if it.inner == InnerReflection::Lost || is_smooth(&it.facets) {
        0
    } else {
        add_cover(&mut writer.words, &it.facets, &[boundary(&it.facets, eta, 0.0, true)], 0)
    };
    let mut params = vec![Param::Color(&it.diffuse), Param::Color(&it.specular)];
    params.extend(it.facets.roughness.iter().map(Param::Scalar));
    let own = [bits(&it.facets), eta.to_bits(), inner, cover];
    add(writer, Kind::Plastic, &own, params)
}

fn boundary(facets: &Facets, eta: f32, thickness: f32, is_plastic: bool) -> CoverBoundary {
    CoverBoundary { distribution: facets.distribution, shadowing: facets.shadowing, eta, thickness, is_plastic }
}

fn add_coated(writer: &mut Writer<'_>, it: &Coated) -> u32 {
    let eta = sound_eta(it.eta);
    let mut params = vec![Param::Color(&it.albedo), Param::Scalar(&it.thickness), Param::Scalar(&it.g)];
    params.extend(it.facets.roughness.iter().map(Param::Scalar));
    let (is_metal, base_bits) = match &it.base {
        CoatedBase::Diffuse(diffuse) => {
            params.push(Param::Color(&diffuse.reflectance));
            (false, 0)
        }
        CoatedBase::Conductor(conductor) => {
            params.extend(conductor_params(conductor));
            (true, bits(&conductor.facets))
        }
    };
    // Where the layer does not scatter, a matte base has a closed form.
    let may_be_clear = it.albedo.factor.max_element() <= 0.0 || it.albedo.texture.is_some();
    let cover = if !is_metal && may_be_clear { add_coat(writer, it, eta) } else { 0 };
    let own = [bits(&it.facets), eta.to_bits(), it.max_depth.min(EVENTS_MAX), cover, u32::from(is_metal), base_bits];
    add(writer, Kind::Coated, &own, params)
}

/// The cover of a clear coat, for all the thickness that it can have.
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
    // Nodes in eighths of an octave from where next to nothing is absorbed.
    const FIRST: i32 = -80;
    let last = if most > 0.0 { (8.0 * most.log2()).ceil() as i32 } else { FIRST };
    let nodes = (FIRST..=last.max(FIRST)).map(|step| (0.125 * step as f32).exp2());
    let boundaries: Vec<_> = std::iter::once(0.0).chain(nodes).map(of).collect();
    add_cover(&mut writer.words, &it.facets, &boundaries, FIRST)
}

fn principled_params(it: &Principled) -> Vec<Param<'_>> {
    let scalars = [
        &it.roughness,
        &it.anisotropic,
        &it.metallic,
        &it.spec_trans,
        &it.spec_tint,
        &it.sheen,
        &it.sheen_tint,
        &it.flatness,
        &it.clearcoat,
        &it.clearcoat_gloss,
        &it.diff_trans,
    ];
    std::iter::once(Param::Color(&it.base_color)).chain(scalars.map(Param::Scalar)).collect()
}

fn add_layered(writer: &mut Writer<'_>, it: &Layered) -> u32 {
    let none = ScalarParam::from(0.0);
    let film = it.iridescence.as_ref();
    let mut params = [&it.base_color, &it.specular_color, &it.diffuse_transmission_color, &it.sheen_color]
        .map(Param::Color)
        .into_iter()
        .collect::<Vec<_>>();
    let scalars = [
        &it.metallic,
        &it.roughness,
        &it.specular,
        &it.transmission,
        &it.diffuse_transmission,
        &it.coat,
        &it.coat_roughness,
        &it.sheen_roughness,
        film.map_or(&none, |film| &film.factor),
    ];
    params.extend(scalars.map(Param::Scalar));
    let share = film.and_then(|film| film.thickness_texture.as_ref());
    params.push(Param::Handle(Spectrum::ONE, share.map_or(0, |(map, channel)| writer.textures.scalar(map, *channel))));
    let stretch = it.anisotropy.as_ref();
    let map = stretch.and_then(|stretch| stretch.texture.as_ref());
    let strength = Spectrum::splat(stretch.map_or(0.0, |stretch| stretch.strength));
    params.push(Param::Handle(strength, map.map_or(0, |map| writer.textures.color(map))));
    let within = |ior: f32| if ior > 1.0 { ior.min(IOR_MAX) } else { 1.0 };
    let ior = if it.ior == 0.0 { 0.0 } else { within(it.ior) };
    let dispersion = if it.dispersion > 0.0 { it.dispersion.min(20.0) } else { 0.0 };
    let [least, most] = film.map_or([0.0; 2], |film| film.thickness);
    let numbers = [ior, dispersion, film.map_or(1.0, |film| within(film.ior)), least, most];
    let mut own = vec![u32::from(it.thin)];
    own.extend(numbers.map(f32::to_bits));
    add(writer, Kind::Layered, &own, params)
}

/// Largest index of refraction that the layered surface tells from larger ones.
const IOR_MAX: f32 = 5.0;

fn conductor_params(it: &Conductor) -> Vec<Param<'_>> {
    let mut params = vec![Param::Color(&it.eta), Param::Color(&it.k), Param::Color(&it.reflectance)];
    params.extend(it.facets.roughness.iter().map(Param::Scalar));
    params
}

/// Distribution, shadowing and what roughness means, as in `facets.wgsl`.
fn bits(facets: &Facets) -> u32 {
    let scale = match facets.scale {
        RoughnessScale::Alpha => 0,
        RoughnessScale::SquareRoot => 1,
        RoughnessScale::Square => 2,
    };
    u32::from(facets.distribution == Distribution::Beckmann)
        | u32::from(facets.shadowing == Shadowing::Separable) << 1
        | scale << 2
}

/// An index of refraction that formulas can bear.
fn sound_eta(eta: f32) -> f32 {
    if eta > 0.05 { eta.min(20.0) } else { 1.0 }
}

/// What one surface asks of the shaders, but for its parts.
fn features(surface: &Surface) -> Features {
    let facets = |facets: &Facets| {
        Features::default().with_if(facets.distribution == Distribution::Beckmann, Features::BECKMANN)
    };
    // Metal may lie below a coat.
    let stack = Features::STACK.with(Features::CONDUCTOR);
    match surface {
        Surface::Null | Surface::Unlit(_) | Surface::Blend { .. } => Features::default(),
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
        Surface::Blend { surfaces, .. } => 1 + surfaces.iter().map(depth).max().unwrap_or(0),
        _ => 0,
    }
}
