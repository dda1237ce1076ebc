//! Texture coordinates by position in the world ([`Scene::mappings`]).

use std::f32::consts::{FRAC_1_PI, PI};

use bottega_kernels::math;
use bottega_scene::{Mapping, MappingKind, Scene, TextureMap, Uvs, is_within_dot};
use glam::{Mat3, Vec2, Vec3};

/// A point in the world with the width of its beam: the input of mappings.
#[derive(Clone, Copy, Debug, Default)]
pub struct MappingPoint {
    /// Position in world space.
    pub p: Vec3,
    /// Normal of the surface at the point, unit length.
    pub normal: Vec3,
    /// Width of the beam in scene units; 0 for unfiltered lookups.
    pub beam: f32,
    /// Cosine between the beam and the normal.
    pub cosine: f32,
}

impl MappingPoint {
    /// Returns a point with a beam of width 0.
    pub(crate) fn sharp(p: Vec3) -> Self {
        Self { p, ..Self::default() }
    }
}

/// A point with the texture coordinates of its surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TexturePlace {
    /// Both sets of texture coordinates of the surface.
    pub(crate) uvs: [Vec2; 2],
    /// Position, for textures that are mapped by position.
    pub(crate) mapping_point: MappingPoint,
}

impl Uvs for TexturePlace {
    #[inline(always)]
    fn of(&self, scene: &Scene, map: &TextureMap, footprint: f32) -> (Vec2, f32) {
        match map.mapping(scene) {
            None => self.uvs.of(scene, map, footprint),
            Some(mapping) => mapped(mapping, self.uvs[0], &self.mapping_point, footprint > 0.0),
        }
    }
}

/// Returns the coordinates of a point, and the width of its beam in texture coordinates.
#[cold]
fn mapped(mapping: &Mapping, surface_uv: Vec2, mapping_point: &MappingPoint, is_wide: bool) -> (Vec2, f32) {
    let uv = uv_of(mapping, surface_uv, mapping_point);
    if !is_wide || mapping_point.beam <= 0.0 {
        return (uv, 0.0);
    }
    // Area in texture coordinates per unit area of the surface. The beam's oblique cross-section is represented by the
    // geometric mean of its axes
    let [u, v] = gradients(mapping, mapping_point);
    (
        uv,
        mapping_point.beam * (u.cross(v).dot(mapping_point.normal) / mapping_point.cosine.abs().max(0.01)).abs().sqrt(),
    )
}

/// Returns the coordinates of a position. Undefined ones (at a pole, at the centre of a sphere) are 0.
fn uv_of(mapping: &Mapping, surface_uv: Vec2, mapping_point: &MappingPoint) -> Vec2 {
    let place = mapping.mapping_from_world;
    let q = place.transform_point3(mapping_point.p);
    let turns = || 0.5 * FRAC_1_PI * math::atan2(q.y, q.x);
    let uv = match mapping.kind {
        MappingKind::Planar => Vec2::new(q.x, 1.0 - q.y),
        MappingKind::Spherical => {
            let theta = math::atan2(q.truncate().length(), q.z);
            let turns = turns();
            Vec2::new(theta * FRAC_1_PI, 1.0 - if turns < 0.0 { turns + 1.0 } else { turns })
        }
        MappingKind::Cylindrical => Vec2::new(0.5 + turns(), 1.0 - q.z),
        MappingKind::Cells => Vec2::new(q.x, 1.0 - (q.y + q.z.floor())),
        MappingKind::Noise(noise) => on_ramp(noise.value(q, octaves(mapping, mapping_point))),
        MappingKind::Veins { octaves: sum, variation } => {
            let (fbm, _) = sum.fbm_and_gradient(q, octaves(mapping, mapping_point));
            on_ramp(0.5 + 0.5 * math::sin(q.y + variation * fbm))
        }
        MappingKind::Dots { on_surface } => {
            let at = if on_surface { place.transform_point3(surface_uv.extend(0.0)) } else { q };
            on_ramp(f32::from(u8::from(is_within_dot(at.x, at.y))))
        }
        MappingKind::Facing => on_ramp(place.transform_vector3(mapping_point.normal).z.abs()),
    };
    if uv.is_finite() { uv } else { Vec2::ZERO }
}

/// Returns the coordinates of a value on the ramp of a mapping.
fn on_ramp(value: f32) -> Vec2 {
    Vec2::new(value, 0.5)
}

/// Returns the number of octaves of noise that a beam resolves: finer ones are narrower than two of its widths.
fn octaves(mapping: &Mapping, mapping_point: &MappingPoint) -> f32 {
    let area = mapping_point.beam * mapping_point.beam / mapping_point.cosine.abs().max(0.01);
    let linear = mapping.mapping_from_world.matrix3;
    let scale = (0..3).map(|axis| linear.col(axis).length_squared()).sum::<f32>() / 3.0;
    if area * scale > 0.0 { -1.0 - 0.5 * math::log2(area * scale) } else { f32::INFINITY }
}

/// Returns the gradients of u and v in world space; 0 where they are discontinuous.
pub(crate) fn gradients(mapping: &Mapping, mapping_point: &MappingPoint) -> [Vec3; 2] {
    let q = mapping.mapping_from_world.transform_point3(mapping_point.p);
    let (rho_squared, r_squared) = (q.truncate().length_squared(), q.length_squared());
    let rho = rho_squared.sqrt();
    let turn = Vec3::new(-q.y, q.x, 0.0) / (2.0 * PI * rho_squared);
    let own = match mapping.kind {
        MappingKind::Planar | MappingKind::Cells => [Vec3::X, Vec3::NEG_Y],
        MappingKind::Spherical => {
            let theta = Vec3::new(q.x * q.z / rho, q.y * q.z / rho, -rho) / (PI * r_squared);
            [theta, -turn]
        }
        MappingKind::Cylindrical => [turn, Vec3::NEG_Z],
        MappingKind::Noise(noise) => [noise.gradient(q, octaves(mapping, mapping_point)), Vec3::ZERO],
        MappingKind::Veins { octaves: sum, variation } => {
            let (fbm, slope) = sum.fbm_and_gradient(q, octaves(mapping, mapping_point));
            [(Vec3::Y + variation * slope) * (0.5 * math::cos(q.y + variation * fbm)), Vec3::ZERO]
        }
        MappingKind::Dots { .. } | MappingKind::Facing => [Vec3::ZERO; 2],
    };
    let world_from_gradient = Mat3::from(mapping.mapping_from_world.matrix3).transpose();
    own.map(|own| world_from_gradient * own).map(|it| if it.is_finite() { it } else { Vec3::ZERO })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bottega_kernels::Ray;
    use bottega_scene::{
        AlphaMode, Channel, Image, ImageId, Material, Mesh, Noise, Octaves, Relief, ScalarParam, Spectrum, Surface,
        TextureMap, Wrap,
    };
    use glam::{Affine3A, Quat};

    use super::*;
    use crate::camera::RayCone;
    use crate::interaction::{Interaction, SurfaceQuery, is_there};
    use crate::prepare::{PrepareOptions, PreparedScene};

    const KINDS: [MappingKind; 4] =
        [MappingKind::Planar, MappingKind::Spherical, MappingKind::Cylindrical, MappingKind::Cells];

    const OCTAVES: Octaves = Octaves { count: 8, roughness: 0.5 };
    const RAMPS: [MappingKind; 6] = [
        MappingKind::Noise(Noise::Fbm(OCTAVES)),
        MappingKind::Noise(Noise::Turbulence(OCTAVES)),
        MappingKind::Noise(Noise::Waves),
        MappingKind::Veins { octaves: OCTAVES, variation: 0.2 },
        MappingKind::Dots { on_surface: true },
        MappingKind::Facing,
    ];

    #[test]
    fn a_ramp_shows_noise_dots_and_slopes() {
        let at = |kind, surface_uv, normal| {
            let mapping_point = MappingPoint { p: Vec3::new(0.3, 0.7, 0.2), normal, ..MappingPoint::default() };
            let (uv, width) = mapped(&plain(kind), surface_uv, &mapping_point, true);
            assert_eq!((uv.y, width), (0.5, 0.0));
            uv.x
        };
        let noise = at(RAMPS[0], Vec2::ZERO, Vec3::Z);
        assert!((noise - 0.161_819).abs() < 1e-5, "{noise}");
        let veins = at(RAMPS[3], Vec2::ZERO, Vec3::Z);
        assert!((veins - (0.5 + 0.5 * (0.7 + 0.2 * 0.161_819_f32).sin())).abs() < 1e-5, "{veins}");
        let dots = [Vec2::new(-4.72, 0.8), Vec2::new(-2.34, 1.87)].map(|uv| at(RAMPS[4], uv, Vec3::Z));
        assert_eq!(dots, [1.0, 0.0]);
        let facing = at(RAMPS[5], Vec2::ZERO, Vec3::new(0.6, 0.0, -0.8));
        assert!((facing - 0.8).abs() < 1e-6, "{facing}");
    }

    #[test]
    fn a_wide_beam_sees_fewer_octaves() {
        let mapping = plain(RAMPS[0]);
        let wide = MappingPoint { p: Vec3::new(0.3, 0.7, 0.2), normal: Vec3::Z, beam: 0.125, cosine: 1.0 };
        let two = Noise::Fbm(Octaves { count: 2, roughness: 0.5 }).value(wide.p, f32::INFINITY);
        assert!((uv_of(&mapping, Vec2::ZERO, &wide).x - two).abs() < 1e-6);
    }

    #[test]
    fn a_bump_of_noise_leans_as_the_noise_rises() {
        let bumped = |height: ScalarParam| Material { relief: Some(Relief::heights(height)), ..Material::default() };
        let noise = Noise::Fbm(Octaves { count: 3, roughness: 0.5 });
        // A ramp from −4 to 4
        let ramp = Image::from_numbers("ramp", 2, 1, vec![[-4.0; 3], [4.0; 3]]);
        let picture_from_uv = glam::Affine2::from_cols_array(&[1.0 / 16.0, 0.0, 0.0, 1.0, 0.5, 0.0]);
        let prepared = laid(plain(MappingKind::Noise(noise)), ramp, false, |height| {
            let (map, channel) = height.texture.expect("a map");
            let map = TextureMap { picture_from_uv, wrap_u: Wrap::Clamp, ..map };
            bumped(ScalarParam { factor: 0.5, texture: Some((map, channel)) })
        });
        let normal = point(&prepared, Vec3::new(0.3, 0.7, 3.0), Vec3::NEG_Z).frame[2];
        let slope = 0.5 * noise.gradient(Vec3::new(0.3, 0.7, 0.0), f32::INFINITY);
        let expected = Vec3::new(-slope.x, -slope.y, 1.0).normalize();
        assert!((normal - expected).length() < 1e-3, "{normal} {expected}");
    }

    fn plain(kind: MappingKind) -> Mapping {
        Mapping { kind, mapping_from_world: Affine3A::IDENTITY }
    }

    #[test]
    fn coordinates_are_those_that_pbrt_gives() {
        // s and t at points where both are known
        let cases = [
            (MappingKind::Planar, Vec3::new(0.25, -2.0, 7.0), Vec2::new(0.25, -2.0)),
            (MappingKind::Spherical, Vec3::new(0.0, 0.0, 3.0), Vec2::new(0.0, 0.0)),
            (MappingKind::Spherical, Vec3::new(0.0, 2.0, 0.0), Vec2::new(0.5, 0.25)),
            (MappingKind::Spherical, Vec3::new(0.0, -1.0, -1.0), Vec2::new(0.75, 0.75)),
            (MappingKind::Cylindrical, Vec3::new(5.0, 0.0, 4.0), Vec2::new(0.5, 4.0)),
            (MappingKind::Cylindrical, Vec3::new(0.0, -5.0, -1.5), Vec2::new(0.25, -1.5)),
            (MappingKind::Cells, Vec3::new(0.25, 0.5, 2.75), Vec2::new(0.25, 2.5)),
            (MappingKind::Cells, Vec3::new(-0.25, 0.5, -0.25), Vec2::new(-0.25, -0.5)),
        ];
        for (kind, p, st) in cases {
            let uv = uv_of(&plain(kind), Vec2::ZERO, &MappingPoint::sharp(p));
            assert!((uv - Vec2::new(st.x, 1.0 - st.y)).length() < 1e-6, "{kind:?} {p}: {uv}");
        }
    }

    #[test]
    fn coordinates_grow_as_their_gradients_say() {
        let place = Affine3A::from_scale_rotation_translation(
            Vec3::new(0.5, 2.0, 1.5),
            Quat::from_rotation_x(0.7),
            Vec3::new(0.3, -0.2, 0.1),
        );
        for kind in KINDS {
            let mapping = Mapping { kind, mapping_from_world: place };
            for p in [Vec3::new(1.0, 2.0, 3.0), Vec3::new(-2.0, 0.5, 0.7), Vec3::new(0.4, -3.0, -1.0)] {
                let uv_at = |p: Vec3| uv_of(&mapping, Vec2::ZERO, &MappingPoint::sharp(p));
                let [u, v] = gradients(&mapping, &MappingPoint::sharp(p));
                for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                    const STEP: f32 = 1e-2;
                    let grown = (uv_at(p + axis * STEP) - uv_at(p - axis * STEP)) / (2.0 * STEP);
                    let expected = Vec2::new(u.dot(axis), v.dot(axis));
                    assert!((grown - expected).length() < 2e-3, "{kind:?} {p} {axis}: {grown} {expected}");
                }
            }
        }
    }

    #[test]
    fn a_beam_covers_as_much_of_a_picture_as_of_the_surface() {
        // On a sphere of radius 2, at its equator: once around in v, from pole to pole in u.
        let mapping_point = MappingPoint { p: Vec3::new(2.0, 0.0, 0.0), normal: Vec3::X, beam: 0.1, cosine: 0.25 };
        let (_, width) = mapped(&plain(MappingKind::Spherical), Vec2::ZERO, &mapping_point, true);
        let expected = 0.2 / (2.0 * PI * 2.0 * PI * 2.0).sqrt();
        assert!((width / expected - 1.0).abs() < 1e-5, "{width} {expected}");
        assert_eq!(mapped(&plain(MappingKind::Spherical), Vec2::ZERO, &mapping_point, false).1, 0.0);
    }

    /// A material with a mapped picture, on a square of four units in the plane z = 0 without texture coordinates, or on
    /// a sphere of radius 2 around the origin.
    fn laid(
        mapping: Mapping,
        image: Image,
        on_sphere: bool,
        material: impl Fn(ScalarParam) -> Material,
    ) -> PreparedScene {
        let map = TextureMap { uv_set: bottega_scene::SURFACE_UV_SETS, ..TextureMap::new(ImageId(0)) };
        let param = ScalarParam { factor: 1.0, texture: Some((map, Channel::R)) };
        let mut scene = Scene {
            images: vec![image].into(),
            mappings: vec![mapping],
            materials: vec![material(param)],
            ..Scene::default()
        };
        if on_sphere {
            scene.push_sphere(Vec3::ZERO, 2.0, 0);
        } else {
            let quad = Mesh::quad(Vec3::new(-2.0, -2.0, 0.0), 4.0 * Vec3::X, 4.0 * Vec3::Y);
            scene.push_surface(Mesh { uvs: Default::default(), ..quad });
        }
        PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap()
    }

    /// Heights that rise by one between the edges of the picture, along u.
    fn slope() -> Image {
        let texels = (0..64 * 64).map(|i| [(i % 64) as f32 / 64.0; 3]).collect();
        Image::from_linear_rgb("slope", 64, 64, texels)
    }

    fn point(prepared: &PreparedScene, origin: Vec3, direction: Vec3) -> Interaction {
        let hit = prepared.accel().intersect(&Ray::new(origin, direction));
        Interaction::new(prepared, &hit, origin, direction, RayCone { width: 0.0, spread: 0.0 })
    }

    #[test]
    fn a_bump_leans_away_from_where_it_rises_in_space() {
        let bumped = |height: ScalarParam| Material { relief: Some(Relief::heights(height)), ..Material::default() };
        // u grows by one over two units along (3, 4) / 5.
        let along = Quat::from_rotation_z(-(0.8_f32).asin());
        let mapping = Mapping {
            kind: MappingKind::Planar,
            mapping_from_world: Affine3A::from_scale_rotation_translation(Vec3::splat(0.5), along, Vec3::splat(0.2)),
        };
        let prepared = laid(mapping, slope(), false, bumped);
        let normal = point(&prepared, Vec3::new(0.1, 0.2, 3.0), Vec3::NEG_Z).frame[2];
        let expected = Vec3::new(-0.3, -0.4, 1.0).normalize();
        assert!((normal - expected).length() < 1e-3, "{normal}");
        // On a sphere θ grows by π over a length of π radii, so u by 1 / 2π per unit at its equator, downwards
        let prepared = laid(plain(MappingKind::Spherical), slope(), true, bumped);
        let normal = point(&prepared, Vec3::new(5.0, 0.0, 0.0), Vec3::NEG_X).frame[2];
        let expected = Vec3::new(1.0, 0.0, 0.5 * FRAC_1_PI).normalize();
        assert!((normal - expected).length() < 1e-3, "{normal}");
    }

    #[test]
    fn a_surface_is_there_where_a_picture_in_space_says() {
        // The left half is transparent
        let half = || Image::from_linear_rgb("half", 2, 1, vec![[0.0; 3], [1.0; 3]]);
        let masked = |opacity: ScalarParam| Material { opacity, alpha_mode: AlphaMode::Blend, ..Material::default() };
        for (kind, on_sphere, origin, there) in [
            (MappingKind::Planar, false, Vec3::new(0.25, 0.3, 5.0), false),
            (MappingKind::Planar, false, Vec3::new(0.75, 0.3, 5.0), true),
            // Above the equator θ is below π / 2.
            (MappingKind::Spherical, true, Vec3::new(0.3, 0.3, 5.0), false),
            (MappingKind::Spherical, true, Vec3::new(0.3, 0.3, -5.0), true),
            // φ above 0 is the right half.
            (MappingKind::Cylindrical, true, Vec3::new(0.3, -5.0, 0.1), false),
            (MappingKind::Cylindrical, true, Vec3::new(0.3, 5.0, 0.1), true),
        ] {
            let prepared = laid(plain(kind), half(), on_sphere, masked);
            let axis = if origin.y.abs() > 1.0 { Vec3::Y } else { Vec3::Z };
            // Longer than unit length, like shadow rays
            let ray = Ray::new(origin, -2.0 * axis * origin.dot(axis).signum());
            let hit = prepared.accel().intersect(&ray);
            assert!(!hit.is_none());
            assert_eq!(is_there(&prepared, &ray, 0.0, &hit, SurfaceQuery::Path, |_| 0.5), there, "{kind:?} {origin}");
        }
    }

    #[test]
    fn lights_have_the_coordinates_of_their_surface() {
        let mut scene = Scene {
            images: vec![slope()].into(),
            mappings: vec![plain(MappingKind::Planar)],
            materials: vec![Material::emitter(Spectrum::ONE)],
            ..Scene::default()
        };
        let map = |uv_set| TextureMap { uv_set, ..TextureMap::new(ImageId(0)) };
        scene.materials[0].emission.texture = Some(map(2));
        assert!(scene.validate().unwrap_err().to_string().contains("emission"));
        // An unlit surface is not a light
        let color = bottega_scene::ColorParam { factor: Spectrum::ONE, texture: Some(map(2)) };
        scene.materials[0] = Surface::Unlit(color).into();
        scene.validate().unwrap();
        let color = bottega_scene::ColorParam { factor: Spectrum::ONE, texture: Some(map(3)) };
        scene.materials[0] = Surface::Unlit(color).into();
        assert!(scene.validate().unwrap_err().to_string().contains("coordinates"));
        scene.materials.clear();
        scene.mappings[0].mapping_from_world.translation.x = f32::NAN;
        assert!(scene.validate().unwrap_err().to_string().contains("mappings[0]"));
    }

    #[test]
    fn everything_has_coordinates() {
        let singular = Affine3A { matrix3: glam::Mat3A::ZERO, translation: glam::Vec3A::ZERO };
        let huge = Affine3A::from_scale(Vec3::splat(1e30));
        for kind in KINDS.into_iter().chain(RAMPS) {
            for mapping_from_world in [Affine3A::IDENTITY, singular, huge] {
                let mapping = Mapping { kind, mapping_from_world };
                for p in [Vec3::ZERO, Vec3::Z, Vec3::NEG_Z, Vec3::splat(1e18), Vec3::splat(-1e-30)] {
                    let mapping_point = MappingPoint { p, normal: Vec3::Y, beam: 1.0, cosine: 0.0 };
                    let (uv, width) = mapped(&mapping, Vec2::ZERO, &mapping_point, true);
                    let color = slope().eval(&TextureMap::new(ImageId(0)), uv, width);
                    assert!(uv.is_finite() && color.is_finite(), "{kind:?} {p}: {uv} {width} {color}");
                }
            }
        }
    }
}
