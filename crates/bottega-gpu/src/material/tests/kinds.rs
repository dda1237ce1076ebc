//! Random surfaces of each kind.

use bottega_scene::{
    Anisotropy, Channel, Coated, CoatedBase, ColorParam, Conductor, Dielectric, Diffuse, Distribution, Facets,
    InnerReflection, Iridescence, Layered, Plastic, Principled, RoughnessScale, ScalarParam, Shadowing, Spectrum,
    Surface,
};

use super::numbers::Numbers;

/// A kind: its name, and a function that makes one with textures among this number of images.
pub(super) type SurfaceKind = (&'static str, fn(&mut Numbers, u32) -> Surface);

/// The kind whose values and samples are random walks.
pub(super) const WALKED: &str = "coat that is walked through";

pub(super) const KINDS: &[SurfaceKind] = &[
    ("diffuse", |n, images| Surface::Diffuse(diffuse(n, images))),
    ("translucent", |n, images| Surface::DiffuseTransmission {
        reflectance: n.color_param(images),
        transmittance: n.color_param(images),
    }),
    ("conductor", |n, images| Surface::Conductor(conductor(n, images))),
    ("dielectric", |n, images| {
        Surface::Dielectric(Dielectric {
            eta: eta(n),
            reflectance: n.color_param(images),
            transmittance: n.color_param(images),
            facets: facets(n, images),
            thin: n.chance(0.3),
        })
    }),
    ("plastic", |n, images| {
        Surface::Plastic(Plastic {
            eta: n.pick(&[1.5, 1.3, 1.9, 0.8]),
            diffuse: n.color_param(images),
            specular: n.color_param(images),
            inner: n.pick(&[InnerReflection::Linear, InnerReflection::Nonlinear, InnerReflection::Lost]),
            facets: few_facets(n, images),
        })
    }),
    ("clear coat", |n, images| {
        let mut surface = coated(n, images);
        surface.albedo = Spectrum::ZERO.into();
        surface.base = CoatedBase::Diffuse(diffuse(n, images));
        Surface::Coated(Box::new(surface))
    }),
    (WALKED, |n, images| {
        let mut surface = coated(n, images);
        surface.albedo.factor = if n.chance(0.5) { Spectrum::ZERO } else { n.color() };
        if matches!(surface.base, CoatedBase::Diffuse(_)) {
            surface.albedo = (n.color() + 0.01).into();
        }
        Surface::Coated(Box::new(surface))
    }),
    ("principled", |n, images| principled(n, images, false)),
    ("principled sheet", |n, images| principled(n, images, true)),
    ("layered base", |n, images| {
        let mut it = layered(n, images);
        (it.coat, it.sheen_color, it.iridescence) = (0.0.into(), Spectrum::ZERO.into(), None);
        (it.transmission, it.diffuse_transmission) = (0.0.into(), 0.0.into());
        it.into()
    }),
    ("layered glass", |n, images| {
        let mut it = layered(n, images);
        (it.coat, it.sheen_color, it.iridescence) = (0.0.into(), Spectrum::ZERO.into(), None);
        (it.transmission, it.metallic) = (n.pick(&[1.0, 0.6]).into(), n.pick(&[0.0, 0.3]).into());
        it.dispersion = 0.0;
        it.into()
    }),
    ("layered prism", |n, images| {
        let mut it = layered(n, images);
        (it.coat, it.sheen_color, it.iridescence) = (0.0.into(), Spectrum::ZERO.into(), None);
        (it.transmission, it.thin) = (n.pick(&[1.0, 0.6]).into(), false);
        it.dispersion = n.within(0.1, 4.0);
        it.into()
    }),
    ("layered cloth", |n, images| {
        let mut it = layered(n, images);
        (it.coat, it.iridescence, it.transmission) = (0.0.into(), None, 0.0.into());
        it.into()
    }),
    ("layered varnish", |n, images| {
        let mut it = layered(n, images);
        (it.sheen_color, it.iridescence) = (Spectrum::ZERO.into(), None);
        it.into()
    }),
    ("layered film", |n, images| {
        let mut it = layered(n, images);
        (it.coat, it.sheen_color) = (0.0.into(), Spectrum::ZERO.into());
        it.into()
    }),
    ("layered", |n, images| layered(n, images).into()),
    ("blend", |n, images| blend(n, images, 3)),
];

/// Like [`facets`], but with few boundaries, because their curves take long to compute.
fn few_facets(n: &mut Numbers, images: u32) -> Facets {
    let mut facets = facets(n, images);
    for roughness in &mut facets.roughness {
        // Textures need all curves of a boundary.
        if facets.distribution == Distribution::Beckmann || facets.shadowing == Shadowing::Separable {
            roughness.texture = None;
        }
    }
    facets
}

fn coated(n: &mut Numbers, images: u32) -> Coated {
    let base = if n.chance(0.5) {
        CoatedBase::Diffuse(diffuse(n, images))
    } else {
        CoatedBase::Conductor(conductor(n, images))
    };
    let facets = few_facets(n, images);
    let mut thickness = n.pick(&[0.0, 0.01, 0.3, 1.5]).into();
    if facets.roughness.iter().any(|it| it.texture.is_some()) {
        thickness = 0.3.into();
    }
    Coated {
        eta: n.pick(&[1.5, 1.3]),
        facets,
        thickness,
        albedo: n.color_param(images),
        g: n.scalar_param(images, -0.8, 0.8),
        max_depth: n.pick(&[1, 2, 10, 64]),
        base,
    }
}

fn principled(n: &mut Numbers, images: u32, thin: bool) -> Surface {
    let unit = |n: &mut Numbers| n.scalar_param(images, 0.0, 1.0);
    Surface::Principled(Box::new(Principled {
        base_color: n.color_param(images),
        roughness: unit(n),
        anisotropic: unit(n),
        metallic: unit(n),
        spec_trans: unit(n),
        eta: n.within(1.1, 2.5),
        spec_tint: unit(n),
        sheen: unit(n),
        sheen_tint: unit(n),
        flatness: unit(n),
        clearcoat: unit(n),
        clearcoat_gloss: unit(n),
        diff_trans: n.scalar_param(images, 0.0, 2.0),
        thin,
    }))
}

fn layered(n: &mut Numbers, images: u32) -> Layered {
    let unit = |n: &mut Numbers| n.scalar_param(images, 0.0, 1.0);
    let often_none = |n: &mut Numbers| if n.chance(0.5) { 0.0.into() } else { unit(n) };
    Layered {
        metallic: often_none(n),
        transmission: often_none(n),
        diffuse_transmission: often_none(n),
        coat: often_none(n),
        base_color: n.color_param(images),
        roughness: n.scalar_param(images, 0.0, 1.0),
        anisotropy: n.chance(0.4).then(|| Anisotropy {
            strength: n.next(),
            rotation: n.within(-3.0, 3.0),
            texture: n.chance(0.3).then(|| n.map(images)),
        }),
        ior: n.pick(&[1.5, 1.0, 1.33, 2.4, 0.0, 4.0]),
        dispersion: n.pick(&[0.0, 0.0, 1.0]),
        specular: n.scalar_param(images, 0.0, 1.0),
        specular_color: ColorParam { factor: n.color() * 2.0, ..n.color_param(images) },
        diffuse_transmission_color: n.color_param(images),
        subsurface: None,
        thin: n.chance(0.4),
        iridescence: n.chance(0.5).then(|| Iridescence {
            factor: n.scalar_param(images, 0.0, 1.0),
            ior: n.within(1.0, 2.0),
            thickness: [n.within(0.0, 200.0), n.within(200.0, 1200.0)],
            thickness_texture: n.chance(0.5).then(|| (n.map(images), Channel::G)),
        }),
        coat_roughness: ScalarParam { texture: None, ..n.scalar_param(images, 0.0, 1.0) },
        coat_normal: None,
        sheen_color: if n.chance(0.5) { Spectrum::ZERO.into() } else { n.color_param(images) },
        sheen_roughness: n.scalar_param(images, 0.0, 1.0),
    }
}

fn diffuse(n: &mut Numbers, images: u32) -> Diffuse {
    let roughness = if n.chance(0.5) { 0.0.into() } else { n.scalar_param(images, 0.0, 1.5) };
    Diffuse { reflectance: n.color_param(images), roughness }
}

fn eta(n: &mut Numbers) -> f32 {
    match n.below(4) {
        0 => 1.5,
        1 => n.within(0.5, 1.0),
        2 => 1.0005,
        _ => n.within(1.0, 3.0),
    }
}

pub(super) fn facets(n: &mut Numbers, images: u32) -> Facets {
    if n.chance(0.15) {
        return Facets::smooth();
    }
    let first = n.scalar_param(images, 0.0, 1.0);
    let second = if n.chance(0.5) { first.clone() } else { n.scalar_param(images, 0.0, 1.0) };
    Facets {
        distribution: n.pick(&[Distribution::Ggx, Distribution::Beckmann]),
        shadowing: n.pick(&[Shadowing::Correlated, Shadowing::Separable]),
        roughness: [first, second],
        scale: n.pick(&[RoughnessScale::Alpha, RoughnessScale::SquareRoot, RoughnessScale::Square]),
    }
}

fn conductor(n: &mut Numbers, images: u32) -> Conductor {
    let is_mirror = n.chance(0.2);
    let index = |most: f32, n: &mut Numbers| {
        let mut color = n.color_param(images);
        color.factor = if is_mirror { Spectrum::ZERO } else { color.factor * most };
        color
    };
    Conductor { eta: index(3.0, n), k: index(5.0, n), reflectance: n.color_param(images), facets: facets(n, images) }
}

fn blend(n: &mut Numbers, images: u32, depth: u32) -> Surface {
    let part = |n: &mut Numbers| {
        if depth > 0 && n.chance(0.5) {
            return blend(n, images, depth - 1);
        }
        let (_, make) = KINDS[n.below(KINDS.len() as u32 - 1) as usize];
        make(n, images)
    };
    let surfaces = Box::new([part(n), part(n)]);
    Surface::Blend { weight: n.scalar_param(images, 0.0, 1.0), surfaces }
}
