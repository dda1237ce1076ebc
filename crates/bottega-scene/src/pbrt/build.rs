//! Building of the scene: materials of shapes, reading of mesh files, placement of objects.

use std::collections::{BTreeMap, BTreeSet};

use glam::{Affine3A, DAffine3, Vec2, Vec3};
use rayon::prelude::*;

use super::context::Context;
use super::film::Exposure;
use super::light::{Emission, Lights, emission, mean_luminance};
use super::material::Materials;
use super::medium::Media;
use super::needless::Directive;
use super::place::{JoinedMeshes, baked, moving_sphere, scaling, with_own_corners};
use super::shape::geometry::Geometry;
use super::shape::sphere_mesh;
use super::texture::PbrtTextures;
use super::transform::{axes_and_scale, rounded};
use super::world::{Alpha, PbrtWorld, PlacedShape, ShapeDisplacement};
use crate::displacement::{Displacement, DisplacementSpace};
use crate::emission::EmissionProfile;
use crate::error::SceneError;
use crate::hints::RenderHints;
use crate::import::path::TransformPath;
use crate::import::placed_meshes::{MIRROR, PlacedMeshes};
use crate::import::text_place::{ImportResult, TextPlace};
use crate::material::{AlphaMode, Back, Material, ReliefSource};
use crate::medium::MediumId;
use crate::mesh_file::ply;
use crate::model::{Instance, Mesh, Scene, Sphere};
use crate::param::ScalarParam;
use crate::resource::Location;
use crate::surface::Surface;

/// Meshes with fewer triangles are joined with others of the same material: a file may describe each of a million
/// triangles as a shape.
const SMALL: usize = 256;

/// The key of a scene material; shapes with equal keys share it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct SharedMaterialKey {
    material: usize,
    /// Index of the area light, and if its power matters, bits of the area and the number of primitives.
    light: Option<(usize, Option<(u64, usize)>)>,
    media: [Option<MediumId>; 2],
    /// Name of the alpha texture, or bits of the number.
    alpha: Option<Result<String, u64>>,
    /// Name of the displacement texture, and bits of the edge's length.
    displacement: Option<(String, u64)>,
    /// `true`: for a sphere whose inside is its front.
    inside_out: bool,
}

/// The key of a mesh from a PLY file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct PlyKey {
    name: String,
    material: u32,
    reversed: bool,
}

/// A part of the scene that can be placed repeatedly.
enum PlaceablePart {
    Mesh { mesh: u32, world_from_mesh: TransformPath, at: TextPlace },
    Sphere { radius: f64, world_from_sphere: TransformPath, material: u32, tessellated_material: u32, at: TextPlace },
}

/// The scene under construction.
pub(super) struct SceneBuilder<'c, 'a, 'w> {
    context: &'c mut Context<'a>,
    world: &'w PbrtWorld,
    textures: PbrtTextures<'a, 'w>,
    materials: Materials<'w>,
    media: Media<'w>,
    exposure: Exposure,
    scene: Scene,
    material_of: BTreeMap<SharedMaterialKey, u32>,
    /// Materials whose emission needs the mean of a picture.
    by_power: Vec<u32>,
    /// Mesh files, and the number of scene meshes still to be made of each.
    files: BTreeMap<String, (Option<Mesh>, usize)>,
    ply_meshes: BTreeMap<PlyKey, u32>,
    placed: PlacedMeshes,
}

impl<'c, 'a, 'w> SceneBuilder<'c, 'a, 'w> {
    /// Makes a builder for the contents of a file.
    pub(super) fn new(context: &'c mut Context<'a>, world: &'w PbrtWorld) -> ImportResult<Self> {
        let exposure = world.exposure(context)?;
        Ok(Self {
            textures: PbrtTextures::new(world, context),
            materials: Materials::new(world),
            media: Media::new(world, exposure),
            exposure,
            context,
            world,
            scene: Scene::default(),
            material_of: BTreeMap::new(),
            by_power: Vec::new(),
            files: BTreeMap::new(),
            ply_meshes: BTreeMap::new(),
            placed: PlacedMeshes::new(world.origin),
        })
    }

    /// Builds the scene. The geometry is taken out of `shapes` and `objects`.
    pub(super) fn build(
        mut self,
        shapes: Vec<PlacedShape>,
        mut objects: BTreeMap<String, Vec<PlacedShape>>,
    ) -> ImportResult<(Scene, RenderHints)> {
        let hints = self.world.hints(self.context)?;
        self.world.report_film(self.context);
        let media = &self.world.camera_media;
        let medium = self.media.find(self.context, media.outside.as_deref(), media.at)?;
        let resolution = hints.resolution.unwrap_or([1; 2]);
        let camera = self.world.camera(self.context, resolution, medium)?;
        self.scene.cameras.push(camera);
        let used: BTreeSet<&str> = self.world.instances.iter().map(|instance| instance.name.as_str()).collect();
        objects.retain(|name, _| used.contains(name.as_str()));
        self.read_files(shapes.iter().chain(objects.values().flatten()))?;

        for part in self.parts(shapes)? {
            self.place(&part, &TransformPath::still(DAffine3::IDENTITY))?;
        }
        let mut parts_of = BTreeMap::new();
        for (name, shapes) in objects {
            parts_of.insert(name, self.parts(shapes)?);
        }
        for instance in &self.world.instances {
            let Some(parts) = parts_of.get(&instance.name) else {
                let problem = format!("there is no object \"{}\"", crate::text::shortened(&instance.name));
                return Err(instance.at.fault(problem).into());
            };
            let bytes = parts.len() * (size_of::<Instance>() + size_of::<Sphere>());
            self.context.take(instance.at, bytes)?;
            for part in parts {
                self.place(part, &instance.world_from_instance)?;
            }
        }
        let lights = Lights::new(self.context, &mut self.textures, self.world, self.exposure)?;
        if self.world.ignores_media()
            && self.scene.leave_out_media()
            && let Some(integrator) = &self.world.integrator
        {
            let message = format!("the integrator \"{}\" does not support media: they are left out", integrator.kind);
            self.context.warn(integrator.at, message);
        }
        self.finish(lights).map(|scene| (scene, hints))
    }

    fn finish(mut self, lights: Lights) -> ImportResult<Scene> {
        for light in &self.world.area_lights {
            self.context.report_unused(Directive::Light, &light.kind, &light.params);
        }
        self.scene.media = self.media.list;
        let (images, mappings) = self.textures.load(self.context)?;
        (self.scene.images, self.scene.mappings) = (images.into(), mappings);
        for material in self.by_power {
            let emission = &mut self.scene.materials[material as usize].emission;
            if let Some(map) = &emission.texture {
                let mean = mean_luminance(&self.scene.images[map.image.0 as usize]);
                emission.factor *= if mean > 0.0 { (1.0 / mean) as f32 } else { 0.0 };
            }
        }
        lights.finish(self.context, &mut self.scene)?;
        if self.scene.has_motion() {
            self.scene.shutter = self.world.shutter()?;
        }
        Ok(self.scene)
    }

    /// Reads all mesh files, in parallel.
    fn read_files<'s>(&mut self, shapes: impl Iterator<Item = &'s PlacedShape>) -> ImportResult<()> {
        let mut locations: BTreeMap<&str, &Location> = BTreeMap::new();
        for shape in shapes {
            if let Geometry::Ply(location) = &shape.geometry {
                locations.insert(&location.name, location);
            }
        }
        let resources = self.context.resources;
        let read = |location: &Location| -> Result<Mesh, SceneError> {
            let bytes = resources.read(location)?;
            let read = ply::read(location.path(), &bytes, resources.budget());
            let mut mesh = resources.attribute(location, read)?;
            mesh.colors = Vec::new();
            mesh.flip_v();
            mesh.face_normals();
            Ok(mesh)
        };
        let list: Vec<(&str, &Location)> = locations.into_iter().collect();
        let meshes: Vec<Result<Mesh, SceneError>> = list.par_iter().map(|(_, location)| read(location)).collect();
        for ((name, _), mesh) in list.into_iter().zip(meshes) {
            self.files.insert(name.into(), (Some(mesh?), 0));
        }
        Ok(())
    }

    /// Makes parts from shapes with their materials, and joins small ones.
    fn parts(&mut self, shapes: Vec<PlacedShape>) -> ImportResult<Vec<PlaceablePart>> {
        // Find the materials first: they determine how often each file is used.
        let mut materials = Vec::with_capacity(shapes.len());
        for shape in &shapes {
            let material = self.material(shape, false)?;
            let inside_out = matches!(shape.geometry, Geometry::Sphere { .. }) && shape.reverse_orientation;
            let own = if inside_out { self.material(shape, true)? } else { material };
            if let Geometry::Ply(location) = &shape.geometry {
                let key = self.ply_key(shape, location, material);
                if !self.ply_meshes.contains_key(&key)
                    && let Some((_, uses)) = self.files.get_mut(&location.name)
                {
                    self.ply_meshes.insert(key, u32::MAX);
                    *uses += 1;
                }
            }
            materials.push((material, own));
        }
        let mut joined = JoinedMeshes::default();
        let mut parts = Vec::new();
        for (shape, (material, own)) in shapes.into_iter().zip(materials) {
            let at = shape.at;
            match shape.geometry {
                Geometry::Sphere { radius } => parts.push(PlaceablePart::Sphere {
                    radius,
                    world_from_sphere: shape.world_from_object,
                    material: own,
                    tessellated_material: material,
                    at,
                }),
                Geometry::Ply(ref location) => {
                    let key = self.ply_key(&shape, location, material);
                    let mesh = self.ply_mesh(&key, at)?;
                    parts.push(PlaceablePart::Mesh { mesh, world_from_mesh: shape.world_from_object, at });
                }
                Geometry::Mesh { mesh, .. } => {
                    let mesh = self.dressed(*mesh, material, shape.reverse_orientation, at)?;
                    if mesh.triangles.is_empty() {
                        continue;
                    }
                    // The width of a curve is measured in its own space.
                    let transform = shape.world_from_object.first();
                    let keeps_space = mesh.curves.is_some() && scaling(&transform).is_none();
                    let moves = !shape.world_from_object.is_still();
                    if mesh.triangles.len() < SMALL && !keeps_space && !moves {
                        let mesh = baked(self.context, mesh, &transform, at)?;
                        if let Some(full) = joined.add(mesh, at) {
                            let mesh = self.scene.push_mesh(full);
                            let world_from_mesh = TransformPath::still(DAffine3::IDENTITY);
                            parts.push(PlaceablePart::Mesh { mesh, world_from_mesh, at });
                        }
                    } else {
                        let mesh = self.scene.push_mesh(mesh);
                        parts.push(PlaceablePart::Mesh { mesh, world_from_mesh: shape.world_from_object, at });
                    }
                }
            }
        }
        for (mesh, at) in joined.finish() {
            let (mesh, world_from_mesh) = (self.scene.push_mesh(mesh), TransformPath::still(DAffine3::IDENTITY));
            parts.push(PlaceablePart::Mesh { mesh, world_from_mesh, at });
        }
        Ok(parts)
    }

    fn ply_key(&self, shape: &PlacedShape, location: &Location, material: u32) -> PlyKey {
        PlyKey { name: location.name.clone(), material, reversed: shape.reverse_orientation }
    }

    /// Returns the scene mesh of a file and a material.
    fn ply_mesh(&mut self, key: &PlyKey, at: TextPlace) -> ImportResult<u32> {
        if let Some(&mesh) = self.ply_meshes.get(key)
            && mesh != u32::MAX
        {
            return Ok(mesh);
        }
        let mesh = match self.files.get_mut(&key.name) {
            Some((mesh, uses)) => {
                *uses = uses.saturating_sub(1);
                // Objects are placed later and may need it again.
                if *uses == 0 && self.world.instances.is_empty() { mesh.take() } else { mesh.clone() }
            }
            None => None,
        };
        let mut mesh = mesh.unwrap_or_default();
        self.context.take(at, mesh.memory_bytes())?;
        mesh.name = key.name.clone();
        let mesh = self.dressed(mesh, key.material, key.reversed, at)?;
        let mesh = self.scene.push_mesh(mesh);
        self.ply_meshes.insert(key.clone(), mesh);
        Ok(mesh)
    }

    /// Finishes a mesh: sets its material, flips its front, and drops attributes that the material does not need.
    fn dressed(&mut self, mut mesh: Mesh, material: u32, reversed: bool, at: TextPlace) -> ImportResult<Mesh> {
        if reversed {
            mesh.turn_over();
        }
        mesh.material = material;
        let material = &self.scene.materials[material as usize];
        let (textured, stretched) = (!material.textures().is_empty(), material.needs_tangents());
        if !stretched {
            mesh.tangents = Vec::new();
        }
        if mesh.curves.is_some() || !textured && !stretched {
            mesh.uvs = Default::default();
        } else if mesh.uvs[0].is_empty() {
            self.context.take(at, mesh.triangles.len() * 3 * (size_of::<Vec3>() * 2 + size_of::<Vec2>()))?;
            mesh = with_own_corners(&mesh);
        }
        Ok(mesh)
    }

    /// Returns the material of a shape.
    fn material(&mut self, shape: &PlacedShape, inside_out: bool) -> ImportResult<u32> {
        let material = self.materials.find(&shape.material)?;
        let look = self.materials.look(self.context, &mut self.textures, material)?;
        let mut light = shape.area_light;
        if light.is_some() && look.surface == Surface::Null {
            self.context.warn(shape.at, "a light whose material is \"interface\" does not shine, as in pbrt");
            light = None;
        }
        let power = match light {
            Some(light) => self.world.area_lights[light].params.float("power")?.is_some_and(|power| power > 0.0),
            None => false,
        };
        let (area, primitive_count) = if power { self.area(shape) } else { (1.0, 1) };
        let media = self.media.interface(self.context, &shape.media)?;
        let key = SharedMaterialKey {
            material,
            light: light.map(|light| (light, power.then_some((area.to_bits(), primitive_count)))),
            media,
            alpha: shape.alpha.as_ref().map(|alpha| match alpha {
                Alpha::Constant(alpha) => Err(alpha.to_bits()),
                Alpha::Texture(name, _) => Ok(name.to_string()),
            }),
            displacement: shape.displacement.as_ref().map(|it| (it.texture.to_string(), it.edge.to_bits())),
            inside_out,
        };
        if let Some(&material) = self.material_of.get(&key) {
            return Ok(material);
        }
        let opacity: ScalarParam = match &shape.alpha {
            None => 1.0.into(),
            Some(Alpha::Constant(alpha)) => (alpha.clamp(0.0, 1.0) as f32).into(),
            Some(Alpha::Texture(name, at)) => self.textures.named_scalar(self.context, name, *at)?,
        };
        let displacement = match &shape.displacement {
            None => None,
            Some(ShapeDisplacement { texture, at, edge }) => Some(Displacement {
                space: DisplacementSpace::World,
                edge: Some(*edge as f32),
                ..Displacement::heights(self.textures.named_scalar(self.context, texture, *at)?)
            }),
        };
        let is_opaque = opacity.texture.is_none() && opacity.factor >= 1.0;
        let is_nowhere = opacity.texture.is_none() && opacity.factor <= 0.0;
        let emission = match light {
            Some(light) => {
                let entity = &self.world.area_lights[light];
                Some(emission(self.context, &mut self.textures, entity, self.exposure, area, primitive_count)?)
            }
            None => None,
        };
        let by_power = emission.as_ref().is_some_and(|emission| emission.by_power);
        let (emission, emission_sides) = match emission {
            Some(Emission { color, sides, .. }) => (color, sides),
            None => Default::default(),
        };
        let mut material = Material {
            culls_back: false,
            name: look.name,
            surface: look.surface,
            back: Back::Same,
            opacity,
            alpha_mode: match light {
                _ if is_opaque => AlphaMode::Opaque,
                Some(_) if is_nowhere => AlphaMode::Absent,
                _ => AlphaMode::Blend,
            },
            emission,
            emission_sides,
            emission_profile: EmissionProfile::Diffuse,
            relief: look.relief,
            displacement,
            interior: media[0],
            exterior: media[1],
            see_through: false,
        };
        if inside_out {
            turn_inside_out(&mut material);
        }
        if !is_sound(&material) {
            let at = self.world.materials[key.material].at;
            return Err(at
                .fault("a number of this material, or of its light, is negative or exceeds all bounds")
                .into());
        }
        let index = self.scene.push_material(material);
        self.context.take(shape.at, size_of::<Material>())?;
        if by_power {
            self.by_power.push(index);
        }
        self.material_of.insert(key, index);
        Ok(index)
    }

    /// Returns the area of a shape in world space, and the number of its primitives.
    fn area(&self, shape: &PlacedShape) -> (f64, usize) {
        let of_mesh = |mesh: &Mesh| -> f64 {
            let linear = shape.world_from_object.first().matrix3;
            let area = |&triangle: &[u32; 3]| {
                let [a, b, c] = triangle.map(|vertex| linear * mesh.positions[vertex as usize].as_dvec3());
                0.5 * (b - a).cross(c - a).length()
            };
            mesh.triangles.iter().map(area).sum()
        };
        match &shape.geometry {
            Geometry::Mesh { mesh, primitive_count } => (of_mesh(mesh), *primitive_count),
            Geometry::Ply(location) => match self.files.get(&location.name) {
                Some((Some(mesh), _)) => (of_mesh(mesh), mesh.triangles.len()),
                _ => (0.0, 1),
            },
            Geometry::Sphere { radius } => {
                let (_, scale) = axes_and_scale(&shape.world_from_object.first());
                // Exact for uniform scales.
                let scale = scale.element_product().abs().powf(2.0 / 3.0);
                (4.0 * std::f64::consts::PI * radius * radius * scale, 1)
            }
        }
    }

    /// Places a part of the scene.
    fn place(&mut self, part: &PlaceablePart, world_from_parent: &TransformPath) -> ImportResult<()> {
        match part {
            PlaceablePart::Mesh { mesh, world_from_mesh, at } => {
                self.place_mesh(*mesh, &world_from_parent.of(world_from_mesh), *at)
            }
            PlaceablePart::Sphere { radius, world_from_sphere, material, tessellated_material, at } => {
                let world_from_sphere = world_from_parent.of(world_from_sphere);
                let (&radius, &material, &tessellated_material, &at) = (radius, material, tessellated_material, at);
                match moving_sphere(radius, &world_from_sphere, self.needs_azimuth(material)) {
                    Some(sphere) => self.scene.spheres.push(Sphere { material, ..sphere }),
                    None => {
                        let mut mesh = sphere_mesh(radius);
                        self.context.take(at, mesh.memory_bytes())?;
                        // Inside-out materials are for analytic spheres only.
                        let reversed = material != tessellated_material;
                        mesh = self.dressed(mesh, tessellated_material, reversed, at)?;
                        let mesh = self.scene.push_mesh(mesh);
                        self.place_mesh(mesh, &world_from_sphere, at)?;
                    }
                }
                Ok(())
            }
        }
    }

    fn needs_azimuth(&self, material: u32) -> bool {
        let material = &self.scene.materials[material as usize];
        !material.textures().is_empty() || material.needs_tangents()
    }

    fn place_mesh(&mut self, mesh: u32, world_from_mesh: &TransformPath, at: TextPlace) -> ImportResult<()> {
        let center = self.placed.center(&mut self.scene, mesh, |warning| self.context.warn(at, warning));
        let path = &world_from_mesh.after(&DAffine3::from_translation(center));
        let Ok(mut world_from_object) = rounded(&path.first(), at) else {
            if !path.is_still() {
                self.context.warn(at, "the shape is flat at first, so it stands still");
            }
            return self.place_flattened(mesh, &path.first(), at);
        };
        let mut motion = path.motion(DAffine3::as_affine3a);
        let mut mesh = mesh;
        if world_from_object.matrix3.determinant() < 0.0 {
            let context = &*self.context;
            mesh = self.placed.mirrored(&mut self.scene, mesh, |bytes| context.take(at, bytes))?;
            let mirror = Affine3A::from_scale(MIRROR.as_vec3());
            world_from_object *= mirror;
            motion.iter_mut().for_each(|key| key.transform *= mirror);
        }
        let is_empty = self.scene.meshes[mesh as usize].positions.is_empty();
        if !is_empty && !self.placed.is_placeable(&self.scene, mesh, &world_from_object) {
            return Err(at.fault("the shape is out of reach, or scaled too much").into());
        }
        self.context.take(at, size_of_val(&*motion))?;
        if motion.iter().any(|key| !self.placed.is_placeable(&self.scene, mesh, &key.transform)) {
            let problem = "the moving shape becomes flat, mirrored or too large, so it stays where it starts";
            self.context.unsupported(at, problem);
            motion.clear();
        }
        self.scene.instances.push(Instance { motion, ..Instance::new(mesh, world_from_object) });
        Ok(())
    }

    /// Places a mesh that its transformation flattens, as a mesh of its own.
    fn place_flattened(&mut self, mesh: u32, world_from_mesh: &DAffine3, at: TextPlace) -> ImportResult<()> {
        self.context.warn(at, "the transformation in force here makes the shape flat; it is used without its normals");
        let original = &self.scene.meshes[mesh as usize];
        self.context.take(at, original.memory_bytes())?;
        let mut flat = original.clone();
        (flat.normals, flat.tangents, flat.curves) = (Vec::new(), Vec::new(), None);
        for position in &mut flat.positions {
            *position = world_from_mesh.transform_point3(position.as_dvec3()).as_vec3();
        }
        let mesh = self.scene.push_mesh(flat);
        self.place_mesh(mesh, &TransformPath::still(DAffine3::IDENTITY), at)
    }
}

/// Returns true if all parameters of a material are finite and not negative.
fn is_sound(material: &Material) -> bool {
    let (colors, scalars) = material.surface.params();
    let is_sound = |factor: f32| factor.is_finite() && factor >= 0.0;
    colors.into_iter().chain([&material.emission]).all(|color| color.factor.to_array().into_iter().all(is_sound))
        && scalars.into_iter().chain([&material.opacity]).all(|scalar| is_sound(scalar.factor))
        && match material.relief.as_ref().map(|relief| &relief.source) {
            Some(ReliefSource::Heights(height)) => height.factor.is_finite(),
            _ => true,
        }
}

/// Swaps the inside and outside of a material.
fn turn_inside_out(material: &mut Material) {
    material.turn_sides();
    fn turn(surface: &mut Surface) {
        match surface {
            Surface::Dielectric(dielectric) if !dielectric.thin => dielectric.eta = 1.0 / dielectric.eta,
            Surface::Blend { surfaces, .. } | Surface::Sum(surfaces) => surfaces.iter_mut().for_each(turn),
            _ => {}
        }
    }
    turn(&mut material.surface);
}
