//! Interactions: a point on a surface, from the kernel's hit to the shading record.

mod curve;
mod mesh;
mod relief;

use bottega_kernels::{Hit, Ray, math};
use bottega_scene::{
    ColorParam, FacingCurves, Material, Relief, ReliefRule, ReliefSource, Scene, Spectrum, Sphere, Surface, TextureMap,
};
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::PI;

use curve::{CurveSurface, meeting};
use mesh::{derivatives, footprint, interpolate, lift_off_facets, tangent_at, uvs_at};
pub(crate) use mesh::{request_triangle, request_vertices};
use relief::{bumped_normal, mapped_normal};

use crate::{
    bsdf::{LiftedNormal, anisotropy_at},
    camera::RayCone,
    mapping::{Spot, TexturePlace},
    sampling::orthonormal_basis,
    surfaces::{PreparedMaterial, Surfaces},
};

/// Distance that a new ray keeps from the surface, relative to the sizes of the numbers that its place was computed
/// from: 64 units in the last place. The kernel's own step goes by the place alone, and is too small in the middle of
/// a large triangle that lies around the origin.
pub const CLEARANCE: f32 = 64.0 / 8_388_608.0;
/// The same, relative to the extent of a triangle: 16 units in the last place. The test of a ray that leaves along the
/// triangle is off by some of them; more would let light under what stands on it.
pub const EXTENT_CLEARANCE: f32 = 16.0 / 8_388_608.0;
/// Least cosine between `wo` and the shading normal.
pub const COSINE_MIN: f32 = 1e-3;

/// A point of a surface, seen from a direction.
#[derive(Debug)]
pub(crate) struct Interaction {
    /// World space, on the surface.
    pub(crate) p: Vec3,
    /// Where rays start that stay on the side of `wo`: above the facets of a curved surface, so that these do not
    /// shade themselves. Equal to `p` for a flat surface and for one that lets light through.
    pub(crate) p_outside: Vec3,
    /// How far off the surface a new ray must start so that it does not meet it again.
    clearance: f32,
    /// Geometric normal, unit length, on the front side.
    pub(crate) ng: Vec3,
    /// Shading frame: x, y, z = tangent, bitangent, normal; the normal is on the side of `wo`.
    pub(crate) frame: [Vec3; 3],
    /// Normal of the clear coat in the shading frame, on the side of `wo`.
    pub(crate) coat_normal: Vec3,
    /// How a relief turned the frame, where that takes something from the light.
    pub(crate) lifted: Option<LiftedNormal>,
    /// Back along the ray, unit length.
    pub(crate) wo: Vec3,
    /// Whether `wo` is on the front side.
    pub(crate) front: bool,
    /// Texture coordinates of the surface.
    pub(crate) uvs: [Vec2; 2],
    /// Interpolated vertex color; white where there is none.
    pub(crate) color: Vec4,
    /// Whether there are vertex colors.
    pub(crate) is_colored: bool,
    /// Width of texture lookups.
    pub(crate) footprint: f32,
    /// Width of the beam in scene units; 0 where nothing is looked up.
    beam: f32,
    /// Index of the material.
    pub(crate) material: u32,
    /// The hit.
    pub(crate) hit: Hit,
}

impl Interaction {
    /// Reconstructs the point that a ray hit.
    ///
    /// - `origin`, `direction`: the ray; unit length.
    /// - `cone`: its width at the hit.
    #[inline(always)]
    pub(crate) fn new(surfaces: &Surfaces, hit: &Hit, origin: Vec3, direction: Vec3, cone: RayCone) -> Self {
        match hit.sphere() {
            Some(sphere) => Self::on_sphere(surfaces, sphere, hit, origin, direction, cone),
            None => match &surfaces.mesh(hit.instance).curves {
                None => Self::on_triangle(surfaces, hit, direction, cone),
                Some(curves) => Self::on_curve(surfaces, curves, hit, (origin, direction), cone),
            },
        }
    }

    fn on_sphere(surfaces: &Surfaces, index: u32, hit: &Hit, origin: Vec3, direction: Vec3, cone: RayCone) -> Self {
        let scene = surfaces.scene();
        let sphere = &scene.spheres[index as usize];
        let ng = (origin + hit.t * direction - sphere.center).normalize_or(-direction);
        let (material, known) = surfaces.material(sphere.material);
        let uv = if known.is_textured { sphere_uv(sphere, ng) } else { Vec2::ZERO };
        // One turn of u around the equator.
        let footprint = if known.is_textured { cone.width / (2.0 * PI * sphere.radius) } else { 0.0 };
        let p = sphere.center + sphere.radius * ng;
        let mut point = Self {
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
                // u goes once around the axis, v from pole to pole; at these nothing goes along u.
                let sine = along.length();
                (sine > 1e-6).then(|| {
                    let (turn, down) = (2.0 * PI * sphere.radius, PI * sphere.radius / sine);
                    [along * turn, (ng * pole.dot(ng) - pole) * down]
                })
            },
        };
        point.set_frames(scene, material, known, ng, &sides);
        point
    }

    #[cold]
    #[inline(never)]
    fn on_curve(surfaces: &Surfaces, curves: &FacingCurves, hit: &Hit, ray: (Vec3, Vec3), cone: RayCone) -> Self {
        let scene = &**surfaces.scene();
        let material_index = surfaces.mesh(hit.instance).material;
        let (material, known) = surfaces.material(material_index);
        let CurveSurface { p, normal, tangent, uv, stretch, clearance } = CurveSurface::new(scene, curves, hit, ray);
        let mut point = Self {
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
        point.set_frames(scene, material, known, normal, &sides);
        point
    }

    #[inline(always)]
    fn on_triangle(surfaces: &Surfaces, hit: &Hit, direction: Vec3, cone: RayCone) -> Self {
        let scene = &**surfaces.scene();
        let instance = &scene.instances[hit.instance as usize];
        let known_instance = surfaces.instance(hit.instance);
        let mesh = &scene.meshes[instance.mesh as usize];
        let triangle = mesh.triangles[hit.primitive as usize];
        let (u, v) = (hit.u, hit.v);
        let [p0, p1, p2] = triangle.map(|vertex| mesh.positions[vertex as usize]);
        let (e1, e2) = (p1 - p0, p2 - p0);
        let local = p0 + e1 * u + e2 * v;
        let to_normal = known_instance.world_from_normal;
        // Twice the area, along the normal.
        let area_vector = to_normal * e1.cross(e2);
        let ng = area_vector.normalize_or(-direction);
        let p = instance.world_from_object.transform_point3(local);
        let (material, known) = surfaces.material(mesh.material);
        // Rounding errors of the hit and of the next test are relative to the size of the triangle and to the place.
        let extent = e1.abs().max(e2.abs()).max_element() * known_instance.scale;
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
            material: mesh.material,
            hit: *hit,
        };
        if known.is_textured {
            point.uvs = uvs_at(mesh, triangle, u, v);
            point.beam = cone.width;
            point.footprint = footprint(mesh, triangle, area_vector.length(), cone.width, direction.dot(ng));
        }
        let mut ns = ng;
        if !mesh.normals.is_empty() {
            let normals = triangle.map(|vertex| mesh.normals[vertex as usize]);
            let smooth = normals[0] * (1.0 - u - v) + normals[1] * u + normals[2] * v;
            ns = (to_normal * smooth).normalize_or(ng);
            if !known.transmits {
                let lift = lift_off_facets(local, &[p0, p1, p2], &normals, [1.0 - u - v, u, v], point.front);
                point.p_outside = p + instance.world_from_object.transform_vector3(lift);
            }
        }
        let sides = UvFrame {
            tangent: |uv_set| {
                let (tangent, sign) = tangent_at(mesh, triangle, u, v, uv_set);
                (instance.world_from_object.transform_vector3(tangent), sign)
            },
            derivatives: |uv_set| {
                let derivatives = derivatives(mesh, triangle, uv_set)?;
                Some(derivatives.map(|along| instance.world_from_object.transform_vector3(along)))
            },
        };
        point.set_frames(scene, material, known, ns, &sides);
        point
    }

    /// Makes the shading frame and the coat's normal from the smooth normal `ns` and the maps of normals and heights.
    #[inline(always)]
    fn set_frames<T, D>(
        &mut self,
        scene: &Scene,
        material: &Material,
        known: &PreparedMaterial,
        ns: Vec3,
        sides: &UvFrame<T, D>,
    ) where
        T: Fn(u8) -> (Vec3, f32),
        D: Fn(u8) -> Option<[Vec3; 2]>,
    {
        if !known.needs_tangents {
            return self.set_frame(ns);
        }
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
        match &material.relief {
            None => self.set_frame(ns),
            Some(Relief { source, rule: ReliefRule::Bent }) => self.set_frame(lifted(self, source, self.footprint)),
            Some(Relief { source, rule: ReliefRule::Mitsuba { turns, shadows, mirrored } }) => {
                // Mitsuba filters no textures, and what a relief does is far from linear in what it is.
                let normal = lifted(self, source, 0.0);
                lifted_by_mitsuba = Some((self.set_lifted_frame(ns, normal, *turns, *mirrored), *shadows));
            }
        }
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
                // The base's normal map is not the coat's (KHR_materials_clearcoat).
                let map = layered.coat_normal.as_ref();
                let coat = map.map_or(ns, |(map, scale)| mapped(self, (map, *scale), self.footprint));
                self.coat_normal = self.to_local(if coat.dot(self.wo) < 0.0 { -coat } else { coat });
            }
        } else {
            self.turn_frame(tangent);
        }
        self.lifted = lifted_by_mitsuba.map(|(without, shadows)| LiftedNormal::new(self.to_local(without), shadows));
    }

    /// Makes the shading frame around `normal`, which a relief lifted off `ns`. Returns the normal without relief on the
    /// side of `wo`.
    ///
    /// - `turns`: a normal turned away from `wo` is tilted to the other side of `ns` (Schüssler et al. 2017,
    ///   Microfacet-Based Normal Mapping for Robust Monte Carlo Path Tracing, where this is the facet beside); else
    ///   nothing is seen of it.
    /// - `mirrored`: on the back it is tilted to where it is on the front.
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

    /// Turns the frame about its normal until x is as near to `tangent` as it can be.
    fn turn_frame(&mut self, tangent: Vec3) {
        let n = self.frame[2];
        if let Some(s) = (tangent - n * n.dot(tangent)).try_normalize() {
            self.frame = [s, n.cross(s), n];
        }
    }

    /// Makes the shading frame around `ns`, which may be on either side: turned to that of `wo`, and bent so that `wo`
    /// sees it.
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

    /// Where it is, as mappings of textures ask.
    #[inline(always)]
    pub(crate) fn spot(&self) -> Spot {
        Spot { p: self.p, normal: self.ng, beam: self.beam, cosine: self.wo.dot(self.ng) }
    }

    /// Where its textures are looked up.
    #[inline(always)]
    pub(crate) fn texture_place(&self) -> TexturePlace {
        TexturePlace { uvs: self.uvs, spot: self.spot() }
    }

    /// What an unlit surface of that colour shows: like every base colour, none above 1, whatever the vertices say.
    #[inline(always)]
    pub(crate) fn unlit(&self, scene: &Scene, color: &ColorParam) -> Spectrum {
        (color.eval(scene, self.texture_place(), self.footprint) * self.color.truncate()).min(Spectrum::ONE)
    }

    /// A world-space direction in the shading frame.
    #[inline(always)]
    pub(crate) fn to_local(&self, w: Vec3) -> Vec3 {
        Vec3::new(w.dot(self.frame[0]), w.dot(self.frame[1]), w.dot(self.frame[2]))
    }

    /// A direction of the shading frame in world space.
    #[inline(always)]
    pub(crate) fn to_world(&self, w: Vec3) -> Vec3 {
        self.frame[0] * w.x + self.frame[1] * w.y + self.frame[2] * w.z
    }

    /// Whether a direction is on the side of `wo` of the real surface.
    #[inline(always)]
    pub(crate) fn is_reflection(&self, wi: Vec3) -> bool {
        (wi.dot(self.ng) > 0.0) == self.front
    }

    /// Where a ray starts that leaves in direction `wi`.
    #[inline(always)]
    pub(crate) fn ray_origin(&self, wi: Vec3) -> Vec3 {
        let p = if self.is_reflection(wi) { self.p_outside } else { self.p };
        p + self.ng * self.clearance.copysign(wi.dot(self.ng))
    }
}

/// How texture coordinates lie on a surface, for each set of them.
struct UvFrame<T, D> {
    /// The tangent of increasing u, and the sign of its bitangent.
    tangent: T,
    /// How the point moves with u and with v; `None` where they do not tell.
    derivatives: D,
}

/// Texture coordinates on a sphere: u around +y, v from the upper pole down.
fn sphere_uv(sphere: &Sphere, n: Vec3) -> Vec2 {
    let n = sphere.world_from_object.inverse() * n;
    let u = 0.5 + math::atan2(n.x, n.z) / (2.0 * PI);
    Vec2::new(u, math::acos(n.y) / PI)
}

/// What a sphere emits where `n` is its outward normal.
#[inline(always)]
pub(crate) fn emitted_by_sphere(scene: &Scene, sphere: &Sphere, n: Vec3, footprint: f32) -> Spectrum {
    let emission = &scene.materials[sphere.material as usize].emission;
    if emission.texture.is_none() {
        return emission.factor;
    }
    emission.eval(scene, [sphere_uv(sphere, n); 2], footprint)
}

/// What a triangle emits at barycentric coordinates.
#[inline(always)]
pub(crate) fn emitted(scene: &Scene, instance: u32, triangle: u32, b: (f32, f32), footprint: f32) -> Spectrum {
    let mesh = &scene.meshes[scene.instances[instance as usize].mesh as usize];
    let emission = &scene.materials[mesh.material as usize].emission;
    if emission.texture.is_none() {
        return emission.factor;
    }
    emission.eval(scene, uvs_at(mesh, mesh.triangles[triangle as usize], b.0, b.1), footprint)
}

/// How opaque a triangle is at barycentric coordinates.
pub(crate) fn opacity_at(scene: &Scene, instance: u32, triangle: u32, b: (f32, f32)) -> f32 {
    let instance = &scene.instances[instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let vertices = mesh.triangles[triangle as usize];
    let alpha = interpolate(&mesh.colors, vertices, b.0, b.1).map_or(1.0, |color| color.w);
    let material = &scene.materials[mesh.material as usize];
    let uvs = uvs_at(mesh, vertices, b.0, b.1);
    let is_mapped = material.opacity.texture.as_ref().is_some_and(|(map, _)| map.mapping(scene).is_some());
    if !is_mapped {
        return material.opacity_at(scene, uvs, 0.0, alpha);
    }
    let local = interpolate(&mesh.positions, vertices, b.0, b.1).unwrap_or_default();
    let spot = Spot::sharp(instance.world_from_object.transform_point3(local));
    material.opacity_at(scene, TexturePlace { uvs, spot }, 0.0, alpha)
}

/// How opaque a sphere is at a place on it.
///
/// - `from_center`: from its middle to the place.
pub(crate) fn opacity_of_sphere(scene: &Scene, sphere: &Sphere, from_center: Vec3) -> f32 {
    let material = &scene.materials[sphere.material as usize];
    let uv = sphere_uv(sphere, from_center.normalize_or(Vec3::Y));
    let spot = Spot::sharp(sphere.center + from_center);
    material.opacity_at(scene, TexturePlace { uvs: [uv; 2], spot }, 0.0, 1.0)
}

/// The bit by which a surface has another number for a shadow ray than for a path.
pub const ASKS_AS_SHADOW: u32 = 1 << 31;

/// What a ray that asks whether surfaces are there looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SurfaceQuery {
    /// The first surface that a path from the camera meets.
    Camera,
    /// The surface that a path meets next.
    Path,
    /// Whether a light is seen. It must not hear what the segment heard that led to the place: both may cross one surface.
    Shadow,
}

impl SurfaceQuery {
    /// What a path asks for that has had so many vertices.
    #[inline(always)]
    pub(crate) fn of_vertex(self, vertices: u32) -> Self {
        if self == Self::Path && vertices == 0 { Self::Camera } else { self }
    }

    /// A surface's number, another one where a sphere is left than where it is entered.
    fn number_of(self, hit: &Hit, is_left: bool) -> u64 {
        let asked = if self == Self::Shadow { u64::from(ASKS_AS_SHADOW) } else { 0 };
        u64::from(hit.instance) << 32 | u64::from(hit.primitive) ^ asked ^ u64::from(is_left)
    }
}

/// The material of what is hit.
pub(crate) fn material_of(surfaces: &Surfaces, hit: &Hit) -> u32 {
    let scene = surfaces.scene();
    match hit.sphere() {
        Some(sphere) => scene.spheres[sphere as usize].material,
        None => scene.meshes[scene.instances[hit.instance as usize].mesh as usize].material,
    }
}

/// Whether what is hit emits light, on whichever side.
pub(crate) fn shines(surfaces: &Surfaces, hit: &Hit) -> bool {
    surfaces.material(material_of(surfaces, hit)).1.shines
}

/// Whether a candidate hit is there. `chance` is asked for a number in [0, 1) where the surface is half transparent, and told
/// the number of the surface: equal ones must get equal answers.
pub(crate) fn is_there(
    surfaces: &Surfaces,
    ray: &Ray,
    hit: &Hit,
    asks: SurfaceQuery,
    chance: impl FnOnce(u64) -> f32,
) -> bool {
    if asks == SurfaceQuery::Camera && surfaces.culls_backs() && is_culled(surfaces.scene(), ray, hit) {
        return false;
    }
    let (opacity, is_left) = opacity_of(surfaces, ray, hit);
    opacity >= 1.0 || (opacity > 0.0 && chance(asks.number_of(hit, is_left)) < opacity)
}

/// Whether a candidate hit is the back of a surface through which the camera sees from there.
fn is_culled(scene: &Scene, ray: &Ray, hit: &Hit) -> bool {
    if let Some(sphere) = hit.sphere() {
        let sphere = &scene.spheres[sphere as usize];
        let ng = ray.origin + hit.t * ray.direction - sphere.center;
        return scene.materials[sphere.material as usize].culls_back && ng.dot(ray.direction) > 0.0;
    }
    let instance = &scene.instances[hit.instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    if !scene.materials[mesh.material as usize].culls_back {
        return false;
    }
    let corner = |vertex: u32| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]);
    let [a, b, c] = mesh.triangles[hit.primitive as usize].map(corner);
    (b - a).cross(c - a).dot(ray.direction) > 0.0
}

/// The probability with which a candidate hit is there, and whether it is where a ray leaves a ball.
pub(crate) fn opacity_of(surfaces: &Surfaces, ray: &Ray, hit: &Hit) -> (f32, bool) {
    let scene = &**surfaces.scene();
    let sphere = hit.sphere().map(|sphere| &scene.spheres[sphere as usize]);
    let material = match sphere {
        Some(sphere) => sphere.material,
        None => {
            let mesh = surfaces.mesh(hit.instance);
            if let Some(curves) = &mesh.curves
                && meeting(scene, curves, hit, (ray.origin, ray.direction), ray.t_max).is_none()
            {
                return (0.0, false);
            }
            mesh.material
        }
    };
    let known = surfaces.material(material).1;
    if !known.has_opacity || known.is_null {
        return (if known.is_null { 0.0 } else { 1.0 }, false);
    }
    match sphere {
        Some(sphere) => {
            let ng = ray.origin + hit.t * ray.direction - sphere.center;
            (opacity_of_sphere(scene, sphere, ng), ng.dot(ray.direction) > 0.0)
        }
        None => (opacity_at(scene, hit.instance, hit.primitive, (hit.u, hit.v)), false),
    }
}

#[cfg(test)]
mod tests;
