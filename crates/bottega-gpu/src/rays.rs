//! The resource that answers batches of rays of a scene on a GPU.

use std::time::Duration;

use bottega_hra::{Failed, Link, Primitive, PrimitiveSet, RayQuery, RayWork, Resource, ResourceDescriptor};
use bottega_kernels::{Hit, InstanceGeometry, MeshGeometry, Ray, SphereGeometry};
use bottega_render::SceneGeometry;
use bottega_scene::{AlphaMode, Scene};
use wgpu::Adapter;

use crate::adapter::{AdapterInfo, AdapterKind, choose};
use crate::context::binding_limit;
use crate::device::{Device, TILE_MAX};
use crate::error::GpuError;
use crate::geometry::Geometry;

/// Options of [`GpuRays`].
#[derive(Clone, Debug, PartialEq)]
pub struct GpuOptions {
    /// Part of the name of the adapter to use. `None`: the best GPU, never a software adapter.
    pub adapter: Option<String>,
    /// The maximum number of rays per dispatch; larger batches are split. Bounds the memory of a batch, about 72 bytes per ray on
    /// the device, and the duration of a dispatch, which drivers limit.
    pub tile_rays: usize,
    /// The timeout of a dispatch; after it the device counts as lost.
    pub timeout: Duration,
    /// `true`: cut-out surfaces are treated as opaque. `false`: scenes that have any are refused.
    pub ignore_alpha: bool,
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self { adapter: None, tile_rays: 1 << 20, timeout: Duration::from_secs(30), ignore_alpha: false }
    }
}

/// A scene's shapes on a GPU, with queries for closest hits and for occlusion.
///
/// Agrees with the CPU's kernels up to rounding, not bit for bit: `t` to about 10⁻⁵; hit or miss except for rays that graze an
/// edge. A hit on a sphere lies within 2 · 10⁻⁷ of the radius from its surface, where the CPU computes in double precision.
/// Origins and shapes farther out than 10¹² are never hit.
#[derive(Debug)]
pub struct GpuRays {
    adapter: Adapter,
    info: AdapterInfo,
    geometry: Geometry,
    tile_rays: usize,
    timeout: Duration,
    /// The open device. `None`: the last one failed, and the next call opens it again.
    device: Option<Device>,
}

impl GpuRays {
    /// Puts the shapes of `scene` on a GPU. `Hit::instance` indexes [`Scene::instances`].
    ///
    /// # Errors
    /// [`GpuError::AlphaTested`]: a material is not opaque, or a mesh consists of curves, and [`GpuOptions::ignore_alpha`] is
    /// `false`; or those of [`Self::from_geometry`].
    pub fn new(scene: &Scene, options: &GpuOptions) -> Result<Self, GpuError> {
        if let Some(material) = cut_out(scene).filter(|_| !options.ignore_alpha) {
            return Err(GpuError::AlphaTested(material));
        }
        let SceneGeometry { meshes, instances, spheres } = SceneGeometry::of(scene);
        Self::from_geometry(&meshes, &instances, &spheres, options)
    }

    /// Puts shapes on a GPU, with the arguments and the numbering of [`bottega_kernels::Accel::build`].
    ///
    /// # Errors
    /// There is no such adapter, it cannot be opened, or the device is lost; the shapes are larger than it can bind or
    /// store; or an index of a vertex or a mesh is out of range ([`GpuError::Invalid`]).
    pub fn from_geometry(
        meshes: &[MeshGeometry<'_>],
        instances: &[InstanceGeometry],
        spheres: &[SphereGeometry],
        options: &GpuOptions,
    ) -> Result<Self, GpuError> {
        let (adapter, info) = choose(options.adapter.as_deref())?;
        let limit = binding_limit(&adapter);
        let geometry = Geometry::build(meshes, instances, spheres, limit, &info.name)?;
        let device = Some(Device::new(&adapter, &info, &geometry, options.timeout)?);
        // A ray has 32 bytes, and the array of a dispatch must not exceed the limit.
        let tile_rays = options.tile_rays.clamp(1, TILE_MAX).min((limit / 32).max(1) as usize);
        Ok(Self { adapter, info, geometry, tile_rays, timeout: options.timeout, device })
    }

    /// Returns the description of the chosen adapter.
    pub fn adapter(&self) -> &AdapterInfo {
        &self.info
    }

    /// Returns the size of the shapes and their tree on the device, in bytes.
    pub fn memory_bytes(&self) -> u64 {
        (size_of_val(&*self.geometry.nodes) + size_of_val(&*self.geometry.shapes)) as u64
    }

    /// Returns the closest hit of each ray, in the order of `rays`; [`Hit::NONE`] for a ray that hits nothing.
    ///
    /// # Errors
    /// The device is lost, does not answer in time, refuses a command, or cannot be opened again after an error. The next call
    /// opens it again.
    pub fn intersect(&mut self, rays: &[Ray]) -> Result<Vec<Hit>, GpuError> {
        let tile = self.tile_rays;
        let outcome = self.device()?.intersect(rays, tile);
        self.device.take_if(|_| outcome.is_err());
        outcome
    }

    /// Returns `true` for each ray that hits anything, in the order of `rays`.
    ///
    /// # Errors
    /// As for [`Self::intersect`].
    pub fn occluded(&mut self, rays: &[Ray]) -> Result<Vec<bool>, GpuError> {
        let tile = self.tile_rays;
        let outcome = self.device()?.occluded(rays, tile);
        self.device.take_if(|_| outcome.is_err());
        outcome
    }

    /// Measures the kernel alone, over at most [`GpuOptions::tile_rays`] rays that are on the device. Returns the number of rays
    /// per second.
    ///
    /// - `any`: `true` measures occlusion, `false` closest hits.
    /// - `passes`: the number of timed passes over the rays.
    ///
    /// # Errors
    /// The device is lost, does not answer in time, refuses a command, or cannot be opened again after an error.
    pub fn rate(&mut self, rays: &[Ray], any: bool, passes: u32) -> Result<f64, GpuError> {
        let rays = &rays[..rays.len().min(self.tile_rays)];
        let time = self.device()?.time(rays, any, passes)?;
        Ok(rays.len() as f64 / time.as_secs_f64().max(1e-9))
    }

    /// Returns the device; opens it again if the last one failed.
    fn device(&mut self) -> Result<&mut Device, GpuError> {
        let device = match self.device.take() {
            Some(device) => device,
            None => Device::new(&self.adapter, &self.info, &self.geometry, self.timeout)?,
        };
        Ok(self.device.insert(device))
    }
}

/// Returns the name of a material, or kind of shape, that cuts out parts of a surface in the scene.
fn cut_out(scene: &Scene) -> Option<String> {
    let used = scene.instances.iter().filter_map(|instance| scene.meshes.get(instance.mesh as usize));
    if let Some(curves) = used.clone().find(|mesh| mesh.curves.is_some()) {
        return Some(curves.name.clone());
    }
    let instances = scene.instances.iter().filter(|instance| (instance.mesh as usize) < scene.meshes.len());
    let used = instances.map(|it| scene.material_of(it)).chain(scene.spheres.iter().map(|sphere| sphere.material));
    used.filter_map(|material| scene.materials.get(material as usize))
        .find(|material| material.alpha_mode != AlphaMode::Opaque)
        .map(|material| material.name.clone())
}

impl<W: RayWork> Resource<W> for GpuRays {
    fn descriptor(&self) -> ResourceDescriptor {
        // Typical values of the bus of each kind; the allocator learns the actual cost per unit.
        let (latency_us, bandwidth) = match self.info.kind {
            AdapterKind::Discrete | AdapterKind::Virtual | AdapterKind::Other => (50, 12e9),
            AdapterKind::Integrated | AdapterKind::Software => (20, 20e9),
        };
        ResourceDescriptor {
            name: self.info.name.clone(),
            primitives: PrimitiveSet::from([Primitive::Intersect, Primitive::Occluded]),
            memory_bytes: None,
            link: Link { latency: Duration::from_micros(latency_us), bandwidth },
        }
    }

    fn perform(&mut self, work: W) -> Result<W::Output, Failed<W>> {
        let outcome = match work.query() {
            Some(RayQuery::Intersect(rays)) => self.intersect(rays).map(RayReply::Hits),
            Some(RayQuery::Occluded(rays)) => self.occluded(rays).map(RayReply::Occlusion),
            None => return Err(Failed { work, reason: "not a batch of rays".to_owned() }),
        };
        match outcome {
            Ok(RayReply::Hits(hits)) => Ok(work.hits(hits)),
            Ok(RayReply::Occlusion(occluded)) => Ok(work.occlusion(occluded)),
            Err(error) => Err(Failed { work, reason: error.to_string() }),
        }
    }

    fn recover(&mut self) -> Result<(), String> {
        self.device().map(|_| ()).map_err(|error| error.to_string())
    }
}

enum RayReply {
    Hits(Vec<Hit>),
    Occlusion(Vec<bool>),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adapters;
    use bottega_hra::Work;
    use bottega_scene::{Material, Mesh, Sphere};
    use glam::Vec3;

    #[derive(Debug)]
    struct Batch(Vec<Ray>);

    impl Work for Batch {
        type Output = Vec<Hit>;
        fn primitive(&self) -> Primitive {
            Primitive::Intersect
        }
        fn size(&self) -> u64 {
            self.0.len() as u64
        }
    }

    impl RayWork for Batch {
        fn query(&self) -> Option<RayQuery<'_>> {
            (!self.0.is_empty()).then_some(RayQuery::Intersect(&self.0))
        }
        fn hits(self, hits: Vec<Hit>) -> Vec<Hit> {
            hits
        }
        fn occlusion(self, _: Vec<bool>) -> Vec<Hit> {
            Vec::new()
        }
    }

    fn one_sphere() -> Scene {
        Scene {
            spheres: vec![Sphere {
                center: Vec3::ZERO,
                radius: 1.0,
                world_from_object: glam::Quat::IDENTITY,
                material: 0,
                visibility: bottega_scene::Visibility::ALL,
                motion: Vec::new(),
            }],
            materials: vec![Material { name: "leaf".into(), ..Material::default() }],
            ..Scene::default()
        }
    }

    fn gpu() -> Option<GpuRays> {
        let name = adapters().first().map(|adapter| adapter.name.clone());
        if name.is_none() {
            eprintln!("skipped: no Vulkan adapter; install a driver, or Mesa's llvmpipe");
        }
        let options = GpuOptions { adapter: Some(name?), ..GpuOptions::default() };
        Some(GpuRays::new(&one_sphere(), &options).expect("an adapter that is there gives a device"))
    }

    fn batch() -> Batch {
        Batch(vec![Ray::new(Vec3::new(0.0, 0.0, -3.0), Vec3::Z)])
    }

    #[test]
    fn a_lost_device_returns_its_work_and_is_opened_again() {
        let Some(mut gpu) = gpu() else { return };
        gpu.device.as_ref().unwrap().lose();
        let failed = gpu.perform(batch()).unwrap_err();
        assert_eq!(failed.work.0, batch().0);
        Resource::<Batch>::recover(&mut gpu).unwrap();
        let hits = gpu.perform(batch()).unwrap();
        assert!((hits[0].t - 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_command_that_wgpu_refuses_is_a_failure_not_a_panic() {
        let Some(mut gpu) = gpu() else { return };
        gpu.device.as_ref().unwrap().misuse();
        let failed = gpu.perform(batch()).unwrap_err();
        assert!(failed.reason.starts_with("the device refused a command"), "{}", failed.reason);
        assert!(gpu.perform(failed.work).is_ok());
    }

    #[test]
    fn work_without_rays_is_returned() {
        let Some(mut gpu) = gpu() else { return };
        assert_eq!(gpu.perform(Batch(Vec::new())).unwrap_err().reason, "not a batch of rays");
    }

    #[test]
    fn cut_out_surfaces_that_are_in_the_scene_are_noticed() {
        let mut scene = one_sphere();
        assert_eq!(cut_out(&scene), None);
        scene.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        assert_eq!(cut_out(&scene), Some("leaf".into()));
        scene.spheres.clear();
        scene.meshes.push(Mesh::default());
        assert_eq!(cut_out(&scene), None, "a mesh that no instance places is not in the scene");
    }
}
