//! Import of Mitsuba's materials.

use bottega_scene::{
    AlphaMode, Back, Distribution, Facets, Hair, InnerReflection, Material, Phong, Pigment, ReliefRule, ReliefSource,
    Shadowing, Strand, Surface, Ward, WardVariant, Wrap,
};
use glam::{Vec2, Vec3};

use crate::mitsuba::support::{Folder, bare, read, read_old, silent, warnings};

fn material(bsdf: &str) -> Material {
    let loaded = silent(&format!("<shape type='rectangle'>{bsdf}</shape>"));
    loaded.scene.materials[0].clone()
}

fn old_material(bsdf: &str) -> Material {
    let loaded = read_old(&format!("<shape type='rectangle'>{bsdf}</shape>"));
    assert_eq!(warnings(&loaded), Vec::<String>::new(), "{bsdf}");
    loaded.scene.materials[0].clone()
}

#[test]
fn a_bsdf_is_black_behind_unless_it_is_two_sided_or_transmits() {
    assert_eq!(material("<bsdf type='diffuse'/>").back, Back::Black);
    assert_eq!(material("<bsdf type='twosided'><bsdf type='diffuse'/></bsdf>").back, Back::Same);
    assert_eq!(material("<bsdf type='dielectric'/>").back, Back::Same);
    assert_eq!(material("<bsdf type='principled'/>").back, Back::Black);
    let spec_trans = "<bsdf type='principled'><float name='spec_trans' value='1'/></bsdf>";
    assert_eq!(material(spec_trans).back, Back::Same);
    let two = "<bsdf type='twosided'><bsdf type='diffuse'/><bsdf type='plastic'/></bsdf>";
    assert!(matches!(material(two).back, Back::Other(surface) if matches!(*surface, Surface::Plastic(_))));
}

#[test]
fn defaults_are_those_of_mitsuba() {
    let Surface::Dielectric(glass) = material("<bsdf type='roughdielectric'/>").surface else { panic!() };
    assert!((glass.eta - 1.504_183_3).abs() < 1e-6);
    let (distribution, shadowing) = (Distribution::Beckmann, Shadowing::Separable);
    assert_eq!(glass.facets, Facets { distribution, shadowing, ..Facets::from(0.1) });
    let Surface::Plastic(plastic) = material("<bsdf type='plastic'/>").surface else { panic!() };
    assert!((plastic.eta - 1.489_587_3).abs() < 1e-6);
    assert_eq!((plastic.diffuse.factor, plastic.inner), (Vec3::splat(0.5), InnerReflection::Linear));
    let Surface::Plastic(rough) = material("<bsdf type='pplastic'/>").surface else { panic!() };
    assert_eq!((rough.inner, rough.facets), (InnerReflection::Lost, glass.facets));
    let Surface::Principled(principled) = material("<bsdf type='principled'/>").surface else { panic!() };
    assert_eq!(
        (principled.eta, principled.roughness.factor, principled.base_color.factor),
        (1.5, 0.5, Vec3::splat(0.5))
    );
    let Surface::Conductor(mirror) = material("<bsdf type='conductor'/>").surface else { panic!() };
    assert_eq!((mirror.eta.factor, mirror.k.factor), (Vec3::ZERO, Vec3::ZERO));
    let Surface::Hair(hair) = material("<bsdf type='hair'/>").surface else { panic!() };
    let pigment = Pigment::Melanin { eumelanin: 1.3.into(), pheomelanin: 0.2.into() };
    let eta = 1.55 / 1.000_277;
    assert_eq!(*hair, Hair { pigment, eta, strand: Strand::AlongV, ..Hair::default() });
}

#[test]
fn hair_absorbs_by_its_pigments_or_its_coefficient() {
    let hair = |inner: &str| match material(&format!("<bsdf type='hair'>{inner}</bsdf>")).surface {
        Surface::Hair(hair) => *hair,
        other => panic!("{other:?}"),
    };
    let blond = hair("<float name='eumelanin' value='0.3'/><float name='longitudinal_roughness' value='0.1'/>");
    let pigment = Pigment::Melanin { eumelanin: 0.3.into(), pheomelanin: 0.2.into() };
    assert_eq!((blond.pigment, blond.beta_m.factor, blond.beta_n.factor), (pigment, 0.1, 0.3));
    let dyed = hair(
        "<rgb name='sigma_a' value='0.2 0.4 0.6'/><float name='scale' value='2'/><float name='scale_tilt' value='-3'/>
        <float name='int_ior' value='1.5'/><float name='ext_ior' value='1'/><float name='azimuthal_roughness' value='.4'/>",
    );
    assert_eq!(dyed.pigment, Pigment::SigmaA(Vec3::new(0.4, 0.8, 1.2).into()));
    assert_eq!((dyed.eta, dyed.alpha, dyed.beta_n.factor), (1.5, -3.0, 0.4));
    for (inner, reason) in [
        ("<float name='eumelanin' value='1'/><rgb name='sigma_a' value='1'/>", "not both"),
        ("<float name='azimuthal_roughness' value='1.1'/>", "from 0 to 1"),
        ("<float name='scale_tilt' value='100'/>", "from -90 to 90"),
        ("<float name='pheomelanin' value='-1'/>", "below 0"),
    ] {
        let scene = format!("<shape type='rectangle'><bsdf type='hair'>{inner}</bsdf></shape>");
        let error = Folder::new().scene(&scene).load(&bare()).unwrap_err().to_string();
        assert!(error.contains(reason), "{inner}: {error}");
    }
}

#[test]
fn highlights_of_phong_and_ward_are_read() {
    let Surface::Phong(phong) = old_material("<bsdf type='phong'/>").surface else { panic!() };
    let (diffuse, specular) = (Vec3::splat(0.5).into(), Vec3::splat(0.2).into());
    assert_eq!(phong, Phong { diffuse, specular, exponent: 30.0.into() });
    let ward = "<bsdf type='ward'><string name='variant' value='ward-duer'/><float name='alphaU' value='0.2'/>
        <rgb name='specularReflectance' value='0.1, 0.2, 0.3'/></bsdf>";
    let Surface::Ward(ward) = old_material(ward).surface else { panic!() };
    let (diffuse, specular) = (Vec3::splat(0.5).into(), Vec3::new(0.1, 0.2, 0.3).into());
    assert_eq!(ward, Ward { diffuse, specular, roughness: [0.2.into(), 0.1.into()], variant: WardVariant::Duer });
}

#[test]
fn coatings_lie_on_each_part_of_what_they_cover() {
    let coating = "<bsdf type='coating'><rgb name='sigmaA' value='0.1, 0.2, 0.4'/><float name='thickness' value='2'/>
        <bsdf type='roughconductor'/></bsdf>";
    let coated = old_material(coating);
    let Surface::Varnished(varnished) = &coated.surface else { panic!("{coated:?}") };
    assert!((varnished.eta - 1.504_183_3).abs() < 1e-6, "{}", varnished.eta);
    assert_eq!(varnished.absorption.factor, Vec3::new(0.2, 0.4, 0.8));
    assert!(varnished.facets.is_smooth() && matches!(varnished.base, Surface::Conductor(_)));
    // From behind only the coating reflects
    let Back::Other(back) = &coated.back else { panic!("{:?}", coated.back) };
    assert!(matches!(&**back, Surface::Varnished(back) if back.base == Surface::matte(Vec3::ZERO)));
    let blend = "<bsdf type='twosided'><bsdf type='roughcoating'><float name='alpha' value='0.3'/>
        <bsdf type='blendbsdf'><float name='weight' value='0.25'/><bsdf type='diffuse'/><bsdf type='phong'/></bsdf>
        </bsdf></bsdf>";
    let blended = old_material(blend);
    assert_eq!(blended.back, Back::Same);
    let Surface::Blend { weight, surfaces } = blended.surface else { panic!() };
    assert_eq!(weight.factor, 0.25);
    for part in surfaces.iter() {
        let Surface::Varnished(varnished) = part else { panic!("{part:?}") };
        assert_eq!(varnished.facets.roughness[0].factor, 0.3);
    }
    let glass = "<shape type='rectangle'><bsdf type='coating'><bsdf type='dielectric'/></bsdf></shape>";
    let loaded = read_old(glass);
    assert!(matches!(loaded.scene.materials[0].surface, Surface::Dielectric(_)));
    let warnings = warnings(&loaded);
    assert!(warnings.iter().any(|warning| warning.contains("left out: it lies on another coating")), "{warnings:?}");
}

#[test]
fn a_mask_within_a_mask_counts() {
    let masks = "<bsdf type='mask'><float name='opacity' value='0.5'/><bsdf type='mask'>
        <float name='opacity' value='0.6'/><bsdf type='diffuse'/></bsdf></bsdf>";
    let masked = material(masks);
    assert!((masked.opacity.factor - 0.3).abs() < 1e-6 && masked.alpha_mode == AlphaMode::Blend, "{masked:?}");
    assert!(matches!(masked.surface, Surface::Diffuse(_)));
}

#[test]
fn metals_are_known_by_name_and_by_number() {
    let gold = "<bsdf type='roughconductor'><string name='material' value='Au'/><string name='distribution' value='ggx'/><float name='alpha_v' value='0.3'/></bsdf>";
    let Surface::Conductor(gold) = material(gold).surface else { panic!() };
    // Values of Mitsuba 3.9 in scalar_rgb.
    assert!((gold.eta.factor - Vec3::new(0.143_036, 0.375_307, 1.442_05)).length() < 2e-3, "{}", gold.eta.factor);
    assert!((gold.k.factor - Vec3::new(3.983, 2.385_56, 1.603_36)).length() < 1e-2, "{}", gold.k.factor);
    assert_eq!(gold.facets.distribution, Distribution::Ggx);
    assert_eq!((gold.facets.roughness[0].factor, gold.facets.roughness[1].factor), (0.1, 0.3));
    let numbers = "<bsdf type='conductor'><rgb name='eta' value='1 2 3'/><rgb name='k' value='4'/></bsdf>";
    let Surface::Conductor(numbers) = material(numbers).surface else { panic!() };
    assert_eq!((numbers.eta.factor, numbers.k.factor), (Vec3::new(1.0, 2.0, 3.0), Vec3::splat(4.0)));
}

#[test]
fn masks_blends_and_reliefs_wrap_their_inner_materials() {
    let mask = material(
        "<bsdf type='mask'><float name='opacity' value='0.25'/><bsdf type='twosided'><bsdf type='diffuse'/></bsdf></bsdf>",
    );
    assert_eq!((mask.alpha_mode, mask.opacity.factor, mask.back), (AlphaMode::Blend, 0.25, Back::Same));
    let blend = material(
        "<bsdf type='blendbsdf'><float name='weight' value='0.3'/><bsdf type='diffuse'/><bsdf type='conductor'/></bsdf>",
    );
    let Surface::Blend { weight, surfaces } = blend.surface else { panic!() };
    assert_eq!(weight.factor, 0.3);
    assert!(matches!(surfaces.as_ref(), [Surface::Diffuse(_), Surface::Conductor(_)]));
    assert_eq!(blend.back, Back::Black);
    let bump = material(
        "<bsdf type='bumpmap'><float name='scale' value='3'/><texture name='arbitrary' type='checkerboard'/><bsdf type='diffuse'/></bsdf>",
    );
    let relief = bump.relief.unwrap();
    assert!(matches!(relief.source, ReliefSource::Heights(height) if height.factor == 3.0 && height.texture.is_some()));
    assert_eq!(relief.rule, ReliefRule::Mitsuba { turns: true, shadows: true, mirrored: false });
    let bump = material(
        "<bsdf type='twosided'><bsdf type='bumpmap'><boolean name='flip_invalid_normals' value='false'/><boolean name='use_shadowing_function' value='false'/><texture name='arbitrary' type='checkerboard'/><bsdf type='diffuse'/></bsdf></bsdf>",
    );
    let rule = ReliefRule::Mitsuba { turns: false, shadows: false, mirrored: true };
    assert_eq!((bump.relief.unwrap().rule, bump.back), (rule, Back::Same));
}

#[test]
fn mixtures_of_the_old_line_leave_a_rest_that_absorbs() {
    let loaded = read_old(
        "<shape type='rectangle'><bsdf type='mixturebsdf'><string name='weights' value='0.25, 0.25'/><bsdf type='diffuse'/><bsdf type='conductor'/></bsdf></shape>",
    );
    let Surface::Blend { weight, surfaces } = &loaded.scene.materials[0].surface else { panic!() };
    assert_eq!(weight.factor, 0.5);
    assert!(matches!(&surfaces[0], Surface::Blend { weight, .. } if weight.factor == 0.5));
    assert_eq!(surfaces[1], Surface::matte(Vec3::ZERO));
}

#[test]
fn colors_come_in_many_ways() {
    let reflectance = |property: &str| {
        let Surface::Diffuse(diffuse) = material(&format!("<bsdf type='diffuse'>{property}</bsdf>")).surface else {
            panic!()
        };
        diffuse.reflectance.factor
    };
    assert_eq!(reflectance("<rgb name='reflectance' value='0.1, 0.2, 0.3'/>"), Vec3::new(0.1, 0.2, 0.3));
    assert_eq!(reflectance("<spectrum name='reflectance' value='0.25'/>"), Vec3::splat(0.25));
    assert_eq!(reflectance("<float name='reflectance' value='0.25'/>"), Vec3::splat(0.25));
    // Values of Mitsuba 3.9 in scalar_rgb.
    let spectrum = reflectance("<spectrum name='reflectance' value='400:0.1, 500:0.2, 600:0.8, 700:0.9'/>");
    assert!((spectrum - Vec3::new(0.958_689, 0.446_356, 0.105_71)).length() < 2e-3, "{spectrum}");
    let loaded =
        read("<shape type='sphere'><bsdf type='diffuse'><rgb name='reflectance' value='1.5 -1 0.5'/></bsdf></shape>");
    assert!(warnings(&loaded)[0].contains("out of range"), "{:?}", warnings(&loaded));
}

#[test]
fn pictures_are_laid_out_as_the_file_says() {
    let bitmap =
        "<bsdf type='diffuse'><texture name='reflectance' type='bitmap'><string name='filename' value='a.bmp'/>
        <string name='wrap_mode' value='mirror'/><string name='filter_type' value='nearest'/>
        <transform name='to_uv'><scale x='2' y='3'/><translate x='0.5'/></transform></texture></bsdf>";
    let folder = Folder::new().scene(&format!("<shape type='rectangle'>{bitmap}</shape>"));
    let loaded = folder.load(&bare()).unwrap();
    // The picture is missing: magenta replaces it, with a warning.
    assert!(warnings(&loaded)[0].contains("a.bmp"), "{:?}", warnings(&loaded));
    let Surface::Diffuse(diffuse) = &loaded.scene.materials[0].surface else { panic!() };
    let map = diffuse.reflectance.texture.as_ref().unwrap();
    assert_eq!((map.wrap_u, map.smooth), (Wrap::Mirror, false));
    assert_eq!(map.picture_from_uv.transform_point2(Vec2::ONE), Vec2::new(2.5, 3.0));
}

#[test]
fn a_checkerboard_begins_with_its_first_color() {
    let loaded = silent(
        "<shape type='rectangle'><bsdf type='diffuse'><texture name='reflectance' type='checkerboard'>
            <rgb name='color0' value='1 0 0'/><rgb name='color1' value='0 0 1'/>
            <transform name='to_uv'><scale x='2' y='2'/></transform></texture></bsdf></shape>",
    );
    let Surface::Diffuse(diffuse) = &loaded.scene.materials[0].surface else { panic!() };
    let at = |u: f32, v: f32| diffuse.reflectance.eval(&loaded.scene, [Vec2::new(u, v); 2], 0.0);
    assert_eq!((at(0.1, 0.1), at(0.3, 0.1), at(0.3, 0.3)), (Vec3::X, Vec3::Z, Vec3::X));
}

#[test]
fn media_lie_where_light_goes_through() {
    let medium = "<medium name='interior' type='homogeneous'><rgb name='sigma_t' value='1 2 3'/><float name='albedo' value='0.5'/><float name='scale' value='2'/><phase type='hg'><float name='g' value='0.7'/></phase></medium>";
    let loaded =
        silent(&format!("<shape type='cube'><bsdf type='null'/>{medium}</shape><shape type='cube'>{medium}</shape>"));
    let medium = &loaded.scene.media[0];
    assert_eq!((medium.scattering, medium.absorption), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 3.0)));
    assert_eq!(medium.g, 0.7);
    assert!(loaded.scene.materials[0].interior.is_some());
    // The inside of opaque objects is not seen.
    assert!(loaded.scene.materials[1].interior.is_none());
    let old = read_old(
        "<shape type='cube'><bsdf type='null'/><medium name='interior' type='homogeneous'><rgb name='sigmaS' value='3'/><rgb name='sigmaA' value='1'/></medium></shape>",
    );
    assert!((old.scene.media[0].scattering - Vec3::splat(3.0)).length() < 1e-6);
}

#[test]
fn scattering_and_absorption_vary_each_by_its_own_grid() {
    let grid = |values: [f32; 2]| {
        let mut bytes = b"VOL\x03".to_vec();
        [1i32, 2, 1, 1, 1].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        [0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes
    };
    let volume = |name: &str| {
        format!("<volume type='gridvolume' name='sigma_{name}'><string name='filename' value='{name}.vol'/></volume>")
    };
    let coefficients = |absorption: &str| {
        let medium = format!(
            "<medium name='interior' type='heterogeneous'>{}{absorption}<float name='scale' value='2'/></medium>",
            volume("s")
        );
        let folder = Folder::new()
            .scene(&format!("<shape type='cube'><bsdf type='null'/>{medium}</shape>"))
            .with("s.vol", grid([1.0, 3.0]))
            .with("a.vol", grid([0.5, 0.0]));
        let loaded = folder.load(&bare()).unwrap();
        assert_eq!(warnings(&loaded), Vec::<String>::new());
        let medium = loaded.scene.media[0].clone();
        let at = |x: f32| medium.coefficients(medium.variation.as_ref().unwrap(), Vec3::new(x, 0.5, 0.5));
        [0.25, 0.75].map(|x| (at(x).absorption.x, at(x).scattering.x))
    };
    assert_eq!(coefficients(&volume("a")), [(1.0, 2.0), (0.0, 6.0)]);
    assert_eq!(coefficients("<float name='sigma_a' value='0.25'/>"), [(0.5, 2.0), (0.5, 6.0)]);
}

#[test]
fn nothing_in_part_is_a_clear_sheet() {
    let sheet = Surface::clear_sheet(Vec3::ONE.into());
    let blend = material(
        "<bsdf type='blendbsdf'><float name='weight' value='0.6'/><bsdf type='null'/><bsdf type='diffuse'/></bsdf>",
    );
    let Surface::Blend { weight, surfaces } = &blend.surface else { panic!("{:?}", blend.surface) };
    assert_eq!((weight.factor, &surfaces[0]), (0.6, &sheet));
    let Back::Other(back) = &blend.back else { panic!("{:?}", blend.back) };
    let Surface::Blend { surfaces, .. } = back.as_ref() else { panic!("{back:?}") };
    assert_eq!(surfaces.as_ref(), &[sheet.clone(), Surface::matte(Vec3::ZERO)]);
    for (plugin, share) in [("polarizer", 0.5), ("circular", 0.5), ("retarder", 1.0)] {
        let found = material(&format!("<bsdf type='{plugin}'><float name='theta' value='30'/></bsdf>"));
        assert_eq!(found.surface, Surface::clear_sheet(Vec3::splat(share).into()), "{plugin}");
    }
    let seen_through = |integrator: &str| {
        let text = format!("<integrator type='{integrator}'/><shape type='rectangle'><bsdf type='polarizer'/></shape>");
        silent(&text).scene.materials[0].is_seen_through()
    };
    assert!(seen_through("volpath") && !seen_through("path"));
}

#[test]
fn lamps_under_masks_are_met_everywhere() {
    let lamp = "<emitter type='area'><rgb name='radiance' value='1 2 3'/></emitter>";
    for bsdf in
        ["<bsdf type='mask'><float name='opacity' value='0.3'/><bsdf type='diffuse'/></bsdf>", "<bsdf type='null'/>"]
    {
        let loaded = silent(&format!("<shape type='rectangle'>{bsdf}{lamp}</shape>"));
        let material = &loaded.scene.materials[0];
        assert_eq!((material.alpha_mode, material.emission.factor), (AlphaMode::Opaque, Vec3::new(1.0, 2.0, 3.0)));
        assert!(material.transmits(), "{:?}", material.surface);
    }
}

#[test]
fn missing_pictures_are_replaced_by_their_use() {
    let bitmap = |name: &str| {
        format!(
            "<texture type='bitmap' name='{name}'><boolean name='raw' value='true'/><string name='filename' value='none.png'/></texture>"
        )
    };
    let texel = |bsdf: String| {
        let loaded = read(&format!("<shape type='rectangle'>{bsdf}</shape>"));
        assert!(warnings(&loaded)[0].contains("none.png"), "{:?}", warnings(&loaded));
        loaded.scene.images[0]
            .eval(&bottega_scene::TextureMap::new(bottega_scene::ImageId(0)), Vec2::ZERO, 0.0)
            .truncate()
    };
    let color = texel(format!("<bsdf type='diffuse'>{}</bsdf>", bitmap("reflectance")));
    assert_eq!(color, Vec3::new(1.0, 0.0, 1.0));
    let number = texel(format!("<bsdf type='mask'>{}<bsdf type='diffuse'/></bsdf>", bitmap("opacity")));
    assert_eq!(number, Vec3::ONE);
    let normal = texel(format!("<bsdf type='normalmap'>{}<bsdf type='diffuse'/></bsdf>", bitmap("normalmap")));
    assert!((normal - Vec3::new(0.5, 0.5, 1.0)).length() < 0.005, "{normal}");
}
