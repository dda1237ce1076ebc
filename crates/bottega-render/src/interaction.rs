//! Surface interactions: from the kernel's hit to the shading record of a point.

mod curve;
mod emission;
mod mesh;
mod moving;
mod opacity;
mod query;
mod relief;
mod sphere;

use bottega_kernels::Hit;
use bottega_scene::{
    ColorParam, FacingCurves, Material, Relief, ReliefRule, ReliefSource, Scene, Spectrum, Sphere, Surface, TextureMap,
};
use glam::{Affine3A, Mat3, Vec2, Vec3, Vec4};
use std::f32::consts::PI;

use curve::CurveSurface;
pub(crate) use emission::{emitted, emitted_by_sphere, material_of, shines};
use mesh::{TriangleShape, derivatives, footprint, interpolate, lift_off_facets, tangent_at, uvs_at};
pub(crate) use mesh::{request_triangle, request_vertices};
pub(crate) use moving::place_at;
pub(crate) use opacity::{opacity_at, opacity_of, opacity_of_sphere};
pub use query::ASKS_AS_SHADOW;
pub(crate) use query::{SurfaceQuery, is_there};
use relief::{bumped_normal, mapped_normal};
use sphere::sphere_uv;

use crate::{
    bsdf::{LiftedNormal, anisotropy_at},
    camera::RayCone,
    mapping::{MappingPoint, TexturePlace},
    sampling::orthonormal_basis,
    surfaces::{PreparedMaterial, Surfaces},
};

/// Distance of a new ray's origin from the surface, relative to the magnitudes from which the point was computed: 64
/// units in the last place. The kernel's own offset depends on the position alone, and is too small in the middle of a
/// large triangle around the world's origin.
pub const CLEARANCE: f32 = 64.0 / 8_388_608.0;
/// Distance of a new ray's origin from the surface, relative to the extent of the triangle: 16 units in the last place.
/// The intersection test of a ray along the triangle has an error of a few of them; more lets light leak under objects on
/// the triangle.
pub const EXTENT_CLEARANCE: f32 = 16.0 / 8_388_608.0;
/// Least cosine between `wo` and the shading normal.
pub const COSINE_MIN: f32 = 1e-3;

/// A point of a surface, seen from a direction.
#[derive(Debug)]
pub(crate) struct Interaction {
    /// Position in world space, on the surface.
    pub(crate) p: Vec3,
    /// Origin of rays that stay on the side of `wo`: above the facets of a curved surface, which avoids shadow terminator
    /// artifacts. Equal to `p` for flat surfaces and for those that transmit light.
    pub(crate) p_outside: Vec3,
    /// Distance from the surface at which new rays start, so that they do not hit it again.
    clearance: f32,
    /// Geometric normal, unit length, on the front side.
    pub(crate) ng: Vec3,
    /// Shading frame: x, y, z = tangent, bitangent, normal; the normal is on the side of `wo`.
    pub(crate) frame: [Vec3; 3],
    /// Normal of the clear coat in the shading frame, on the side of `wo`.
    pub(crate) coat_normal: Vec3,
    /// Perturbation of the shading normal; `None` where it does not darken the light.
    pub(crate) lifted: Option<LiftedNormal>,
    /// Direction back along the ray, unit length.
    pub(crate) wo: Vec3,
    /// `true`: `wo` is on the front side.
    pub(crate) front: bool,
    /// Both sets of texture coordinates.
    pub(crate) uvs: [Vec2; 2],
    /// Interpolated vertex colour; white without vertex colours.
    pub(crate) color: Vec4,
    /// `true`: there are vertex colours.
    pub(crate) is_colored: bool,
    /// Width of texture lookups in texture coordinates.
    pub(crate) footprint: f32,
    /// Width of the beam in scene units; 0 without textures.
    beam: f32,
    /// Index of the material.
    pub(crate) material: u32,
    /// The hit that the point was computed from.
    pub(crate) hit: Hit,
}

impl Interaction {
    /// Computes the point that a ray hit.
    ///
    /// - `origin`, `direction`: the ray; the direction has unit length.
    /// - `cone`: width and spread of the ray's cone at the hit.
    #[inline(always)]
    pub(crate) fn new(surfaces: &Surfaces, hit: &Hit, origin: Vec3, direction: Vec3, cone: RayCone) -> Self {
        match hit.sphere() {
            Some(sphere) => {
                let sphere = &surfaces.scene().spheres[sphere as usize];
                Self::on_sphere(surfaces, sphere, hit, origin, direction, cone)
            }
            None => match &surfaces.mesh(hit.instance).curves {
                None => Self::on_still_triangle(surfaces, hit, direction, cone),
                Some(curves) => {
                    let world_from_object = &surfaces.scene().instances[hit.instance as usize].world_from_object;
                    Self::on_curve(surfaces, curves, world_from_object, hit, (origin, direction), cone)
                }
            },
        }
    }

    fn on_sphere(
        surfaces: &Surfaces,
        sphere: &Sphere,
        hit: &Hit,
        origin: Vec3,
        direction: Vec3,
        cone: RayCone,
    ) -> Self {
        let scene = surfaces.scene();
        let ng = (origin + hit.t * direction - sphere.center).normalize_or(-direction);
        let (material, known) = surfaces.material(sphere.material);
        let uv = if known.is_textured { sphere_uv(sphere, ng) } else { Vec2::ZERO };
        // u makes one turn around the equator
        let footprint = if known.is_textured { cone.width / (2.0 * PI * sphere.radius) } else { 0.0 };
        let p = sphere.center + sphere.radius * ng;
        let point = Self {
            p,
            p_outside: p,
            clearance: CLEARANCE * (sphere.center.abs().max_element() + sphere.radius),
            ng,
            frame: [Vec3::ZERO; 3],
            coat_normal: Vec3::Z,
            lifted: None,
            wo: -direction,
            front: direction.dot(ng) < 0.0,
            uvs: [uv; 2],
            color: Vec4::ONE,
            is_colored: false,
            footprint,
            beam: if known.is_textured { cone.width } else { 0.0 },
            material: sphere.material,
            hit: *hit,
        };
        let pole = sphere.world_from_object * Vec3::Y;
        let equator = sphere.world_from_object * Vec3::X;
        let along = pole.cross(ng);
        let sides = UvFrame {
            tangent: |_| (along.normalize_or(equator), 1.0),
            derivatives: |_| {
                // u runs once around the axis, v from pole to pole; at the poles u has no derivative
                let sine = along.length();
                (sine > 1e-6).then(|| {
                    let (turn, down) = (2.0 * PI * sphere.radius, PI * sphere.radius / sine);
                    [along * turn, (ng * pole.dot(ng) - pole) * down]
                })
            },
        };
        point.framed(scene, material, known, ng, &sides)
    }

    /// Returns the first set of texture coordinates, also where the material has no textures; 0 without any.
    ///
    /// - `time`: time of the ray, from 0 to 1.
    pub(crate) fn first_uv(&self, surfaces: &Surfaces, time: f32) -> Vec2 {
        let Some(index) = self.hit.sphere() else {
            let mesh = surfaces.mesh(self.hit.instance);
            let triangle = |mesh: &bottega_scene::Mesh| mesh.triangles[self.hit.primitive as usize];
            return match mesh.curves {
                Some(_) => self.uvs[0],
                None => uvs_at(mesh, triangle(mesh), self.hit.u, self.hit.v)[0],
            };
        };
        let moved = surfaces.moved_sphere(index, time);
        sphere_uv(moved.as_ref().unwrap_or(&surfaces.scene().spheres[index as usize]), self.ng)
    }

    #[cold]
    #[inline(never)]
    fn on_curve(
        surfaces: &Surfaces,
        curves: &FacingCurves,
        world_from_object: &Affine3A,
        hit: &Hit,
        ray: (Vec3, Vec3),
        cone: RayCone,
    ) -> Self {
        let scene = &**surfaces.scene();
        let material_index = surfaces.material_of(hit.instance);
        let (material, known) = surfaces.material(material_index);
        let CurveSurface { p, normal, tangent, uv, stretch, clearance } =
            CurveSurface::new(curves, world_from_object, hit, ray);
        let point = Self {
            p,
            p_outside: p,
            clearance: CLEARANCE * p.abs().max_element() + clearance,
            ng: normal,
            frame: [Vec3::ZERO; 3],
            coat_normal: Vec3::Z,
            lifted: None,
            wo: -ray.1,
            front: true,
            uvs: [uv; 2],
            color: Vec4::ONE,
            is_colored: false,
            footprint: if known.is_textured { cone.width / stretch } else { 0.0 },
            beam: if known.is_textured { cone.width } else { 0.0 },
            material: material_index,
            hit: *hit,
        };
        let sides = UvFrame { tangent: |_| (tangent, 1.0), derivatives: |_| None };
        point.framed(scene, material, known, normal, &sides)
    }

    #[inline(always)]
    fn on_still_triangle(surfaces: &Surfaces, hit: &Hit, direction: Vec3, cone: RayCone) -> Self {
        let scene = &**surfaces.scene();
        let instance = &scene.instances[hit.instance as usize];
        let known_instance = surfaces.instance(hit.instance);
        let mesh = &scene.meshes[instance.mesh as usize];
        let triangle = mesh.triangles[hit.primitive as usize];
        let pose = TrianglePose {
            world_from_object: &instance.world_from_object,
            world_from_normal: known_instance.world_from_normal,
            scale: known_instance.scale,
            corners: triangle.map(|vertex| mesh.positions[vertex as usize]),
            normals: || triangle.map(|vertex| mesh.normals[vertex as usize]),
        };
        Self::on_triangle(surfaces, &pose, hit, direction, cone)
    }

    #[inline(always)]
    fn on_triangle<N: Fn() -> [Vec3; 3]>(
        surfaces: &Surfaces,
        pose: &TrianglePose<'_, N>,
        hit: &Hit,
        direction: Vec3,
        cone: RayCone,
    ) -> Self {
        let scene = &**surfaces.scene();
        let instance = &scene.instances[hit.instance as usize];
        let mesh = &scene.meshes[instance.mesh as usize];
        let triangle = mesh.triangles[hit.primitive as usize];
        let (u, v) = (hit.u, hit.v);
        let [p0, p1, p2] = pose.corners;
        let (e1, e2) = (p1 - p0, p2 - p0);
        let local = p0 + e1 * u + e2 * v;
        let to_normal = pose.world_from_normal;
        // Twice the area, along the normal
        let area_vector = to_normal * e1.cross(e2);
        let ng = area_vector.normalize_or(-direction);
        let p = pose.world_from_object.transform_point3(local);
        let material_index = scene.material_of(instance);
        let (material, known) = surfaces.material(material_index);
        // Rounding errors of this hit and of the next test are relative to the triangle's size and to its position
        let extent = e1.abs().max(e2.abs()).max_element() * pose.scale;
        let mut point = Self {
            p,
            p_outside: p,
            clearance: CLEARANCE * p.abs().max_element() + EXTENT_CLEARANCE * extent,
            ng,
            frame: [Vec3::ZERO; 3],
            coat_normal: Vec3::Z,
            lifted: None,
            wo: -direction,
            front: direction.dot(ng) < 0.0,
            uvs: [Vec2::ZERO; 2],
            color: interpolate(&mesh.colors, triangle, u, v).unwrap_or(Vec4::ONE),
            is_colored: !mesh.colors.is_empty(),
            footprint: 0.0,
            beam: 0.0,
            material: material_index,
            hit: *hit,
        };
        // Look up texture coordinates and footprint
        if known.is_textured {
            point.uvs = uvs_at(mesh, triangle, u, v);
            point.beam = cone.width;
            point.footprint = footprint(mesh, triangle, area_vector.length(), cone.width, direction.dot(ng));
        }
        // Interpolate the normal, and lift the origin of rays off the facets
        let mut ns = ng;
        if !mesh.normals.is_empty() {
            let normals = (pose.normals)();
            let smooth = normals[0] * (1.0 - u - v) + normals[1] * u + normals[2] * v;
            ns = (to_normal * smooth).normalize_or(ng);
            if !known.transmits {
                let lift = lift_off_facets(local, &[p0, p1, p2], &normals, [1.0 - u - v, u, v], point.front);
                point.p_outside = p + pose.world_from_object.transform_vector3(lift);
            }
        }
        let sides = UvFrame {
            tangent: |uv_set| {
                let shape = TriangleShape { triangle, corners: pose.corners };
                let (tangent, sign) = tangent_at(mesh, &shape, u, v, uv_set);
                (pose.world_from_object.transform_vector3(tangent), sign)
            },
            derivatives: |uv_set| {
                let shape = TriangleShape { triangle, corners: pose.corners };
                let derivatives = derivatives(mesh, &shape, uv_set)?;
                Some(derivatives.map(|along| pose.world_from_object.transform_vector3(along)))
            },
        };
        point.framed(scene, material, known, ns, &sides)
    }

    /// Computes the shading frame and the coat's normal from the smooth normal `ns` and the normal and bump maps.
    ///
    /// Takes and returns the point by value: what is only read and written here stays in registers elsewhere.
    #[inline(always)]
    fn framed<T, D>(
        mut self,
        scene: &Scene,
        material: &Material,
        known: &PreparedMaterial,
        ns: Vec3,
        sides: &UvFrame<T, D>,
    ) -> Self
    where
        T: Fn(u8) -> (Vec3, f32),
        D: Fn(u8) -> Option<[Vec3; 2]>,
    {
        if known.needs_tangents {
            return self.framed_by_tangents(scene, material, ns, sides);
        }
        self.set_frame(ns);
        self
    }

    /// Computes the frame of a material that depends on the directions of the texture coordinates.
    #[inline(never)]
    fn framed_by_tangents<T, D>(mut self, scene: &Scene, material: &Material, ns: Vec3, sides: &UvFrame<T, D>) -> Self
    where
        T: Fn(u8) -> (Vec3, f32),
        D: Fn(u8) -> Option<[Vec3; 2]>,
    {
        let mapped = |point: &Self, map: (&TextureMap, f32), footprint: f32| {
            mapped_normal(scene, map, point.texture_place(), footprint, ns, (sides.tangent)(map.0.uv_set))
        };
        let lifted = |point: &Self, source: &ReliefSource, footprint: f32| match source {
            ReliefSource::Normals(map, scale) => mapped(point, (map, *scale), footprint),
            ReliefSource::Heights(height) => {
                bumped_normal(scene, height, point.texture_place(), footprint, ns, &sides.derivatives)
            }
        };
        let mut lifted_by_mitsuba = None;
        // Apply the normal or bump map
        match &material.relief {
            None => self.set_frame(ns),
            Some(Relief { source, rule: ReliefRule::Bent }) => self.set_frame(lifted(&self, source, self.footprint)),
            Some(Relief { source, rule: ReliefRule::Mitsuba { turns, shadows, mirrored } }) => {
                // Like Mitsuba, do not filter: the effect of a relief is far from linear in the texture
                let normal = lifted(&self, source, 0.0);
                lifted_by_mitsuba = Some((self.set_lifted_frame(ns, normal, *turns, *mirrored), *shadows));
            }
        }
        // Align the frame with the tangent, for anisotropy
        let (tangent, sign) = (sides.tangent)(0);
        if let Surface::Layered(layered) = &material.surface {
            self.turn_frame(match &layered.anisotropy {
                None => tangent,
                Some(anisotropy) => {
                    let (_, way) = anisotropy_at(scene, anisotropy, self.texture_place(), self.footprint);
                    let along = (tangent - ns * ns.dot(tangent)).normalize_or_zero();
                    along * way.x + ns.cross(along) * (sign * way.y)
                }
            });
            if layered.coat.factor > 0.0 {
                // The normal map of the base does not apply to the coat (KHR_materials_clearcoat)
                let map = layered.coat_normal.as_ref();
                let coat = map.map_or(ns, |(map, scale)| mapped(&self, (map, *scale), self.footprint));
                self.coat_normal = self.to_local(if coat.dot(self.wo) < 0.0 { -coat } else { coat });
            }
        } else if material.surface.has_strands_along_v() {
            // Along a fibre, which a curve knows itself
            self.turn_frame((sides.derivatives)(0).map_or(tangent, |[_, along_v]| along_v));
        } else {
            self.turn_frame(tangent);
        }
        self.lifted = lifted_by_mitsuba.map(|(without, shadows)| LiftedNormal::new(self.to_local(without), shadows));
        self
    }

    /// Sets the shading frame around `normal`, which a relief perturbed from `ns`. Returns the unperturbed normal on the
    /// side of `wo`.
    ///
    /// - `turns`: `true`: a normal that faces away from `wo` is mirrored at `ns` (Schüssler et al. 2017, Microfacet-Based
    ///   Normal Mapping for Robust Monte Carlo Path Tracing, where this is the neighbouring facet); `false`: it scatters
    ///   nothing.
    /// - `mirrored`: `true`: on the back, the normal is tilted as on the front.
    fn set_lifted_frame(&mut self, ns: Vec3, normal: Vec3, turns: bool, mirrored: bool) -> Vec3 {
        self.set_frame(ns);
        let without = self.frame[2];
        let tilted_back = |n: Vec3| without * (2.0 * n.dot(without)) - n;
        let mut n = if (ns.dot(self.ng) < 0.0) == self.front { -normal } else { normal };
        if mirrored && !self.front {
            n = tilted_back(n);
        }
        if turns && n.dot(self.wo) <= 0.0 {
            n = tilted_back(n);
        }
        let (s, t) = orthonormal_basis(n);
        self.frame = [s, t, n];
        without
    }

    /// Rotates the frame about its normal until x is as close to `tangent` as possible.
    fn turn_frame(&mut self, tangent: Vec3) {
        let n = self.frame[2];
        if let Some(s) = (tangent - n * n.dot(tangent)).try_normalize() {
            self.frame = [s, n.cross(s), n];
        }
    }

    /// Sets the shading frame around `ns`, which may be on either side: flips it to the side of `wo`, and bends it so
    /// that it is visible from `wo`.
    #[inline(always)]
    fn set_frame(&mut self, ns: Vec3) {
        let upright = if ns.dot(self.ng) < 0.0 { -ns } else { ns };
        let mut n = if self.front { upright } else { -upright };
        let cosine = n.dot(self.wo);
        if cosine < COSINE_MIN {
            n = (n + self.wo * (COSINE_MIN - cosine)).normalize();
        }
        let (s, t) = orthonormal_basis(n);
        self.frame = [s, t, n];
    }

    /// Returns the point as input of texture mappings.
    #[inline(always)]
    pub(crate) fn mapping_point(&self) -> MappingPoint {
        MappingPoint { p: self.p, normal: self.ng, beam: self.beam, cosine: self.wo.dot(self.ng) }
    }

    /// Returns the point as input of texture lookups.
    #[inline(always)]
    pub(crate) fn texture_place(&self) -> TexturePlace {
        TexturePlace { uvs: self.uvs, mapping_point: self.mapping_point() }
    }

    /// Returns the radiance of an unlit surface of that colour: at most 1 per channel, like every base colour, including
    /// vertex colours.
    #[inline(always)]
    pub(crate) fn unlit(&self, scene: &Scene, color: &ColorParam) -> Spectrum {
        (color.eval(scene, self.texture_place(), self.footprint) * self.color.truncate()).min(Spectrum::ONE)
    }

    /// Transforms a direction from world space into the shading frame.
    #[inline(always)]
    pub(crate) fn to_local(&self, w: Vec3) -> Vec3 {
        Vec3::new(w.dot(self.frame[0]), w.dot(self.frame[1]), w.dot(self.frame[2]))
    }

    /// Transforms a direction from the shading frame into world space.
    #[inline(always)]
    pub(crate) fn to_world(&self, w: Vec3) -> Vec3 {
        self.frame[0] * w.x + self.frame[1] * w.y + self.frame[2] * w.z
    }

    /// Returns true if a direction is on the side of `wo` of the geometric surface.
    #[inline(always)]
    pub(crate) fn is_reflection(&self, wi: Vec3) -> bool {
        (wi.dot(self.ng) > 0.0) == self.front
    }

    /// Returns the geometric normal on the side of `wo`.
    #[inline(always)]
    pub(crate) fn facing_ng(&self) -> Vec3 {
        if self.front { self.ng } else { -self.ng }
    }

    /// Returns the origin of a ray that leaves in direction `wi`.
    #[inline(always)]
    pub(crate) fn ray_origin(&self, wi: Vec3) -> Vec3 {
        let p = if self.is_reflection(wi) { self.p_outside } else { self.p };
        p + self.ng * self.clearance.copysign(wi.dot(self.ng))
    }
}

/// A triangle as it is at a time.
struct TrianglePose<'a, N> {
    world_from_object: &'a Affine3A,
    /// See [`PreparedInstance`](crate::surfaces::PreparedInstance).
    world_from_normal: Mat3,
    scale: f32,
    /// Corners in object space.
    corners: [Vec3; 3],
    /// Returns the normals of the corners in object space; called only if the mesh has normals.
    normals: N,
}

/// The parametrization of a surface by texture coordinates, as functions of the coordinate set.
struct UvFrame<T, D> {
    /// Returns the tangent of increasing u, and the sign of its bitangent.
    tangent: T,
    /// Returns the derivatives of the point by u and by v; `None` if they are undefined.
    derivatives: D,
}

#[cfg(test)]
mod tests;
