//! Bindings to Embree 4 as a reference, if its shared library is found: loaded at run time, never linked.
//!
//! The declarations are those of the public headers `rtcore_*.h` of Embree 4.3 and later. `RTCRayHit` has more room than 4.4
//! uses, so that a library built with more instance levels does not write beyond it.
#![allow(unsafe_code)]

use std::{
    ffi::{CString, c_char, c_int, c_uint, c_void},
    mem::MaybeUninit,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicIsize, Ordering},
    },
    time::{Duration, Instant},
};

use bottega_kernels::Ray;
use libloading::Library;

use super::kernel::RayKernel;
use crate::scenes::BenchScene;

/// The environment variable that names the library.
const VARIABLE: &str = "BOTTEGA_EMBREE";

type Handle = *mut c_void;

const TRIANGLES: c_int = 0;
const INDEX_BUFFER: c_int = 0;
const VERTEX_BUFFER: c_int = 1;
const UINT3: c_int = 0x5003;
const FLOAT3: c_int = 0x9003;
const ROBUST: c_int = 1 << 2;

/// `RTCRay` of Embree 4: a ray, with its layout in C.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RtcRay {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

/// `RTCRayHit`: the ray, then normal, u, v, and numbers.
#[repr(C, align(16))]
struct RtcRayHit {
    ray: RtcRay,
    normal: [f32; 3],
    uv: [f32; 2],
    primitive: u32,
    geometry: u32,
    instances: [MaybeUninit<u32>; 17],
}

impl RtcRay {
    fn new(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.to_array(),
            t_near: ray.t_min,
            direction: ray.direction.to_array(),
            time: 0.0,
            t_far: ray.t_max,
            mask: u32::MAX,
            id: 0,
            flags: 0,
        }
    }
}

/// The functions in use; valid as long as the library is held.
struct EmbreeFunctions {
    new_device: unsafe extern "C" fn(*const c_char) -> Handle,
    release_device: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle) -> c_int,
    monitor: unsafe extern "C" fn(Handle, Option<unsafe extern "C" fn(Handle, isize, bool) -> bool>, Handle),
    new_scene: unsafe extern "C" fn(Handle) -> Handle,
    release_scene: unsafe extern "C" fn(Handle),
    scene_quality: unsafe extern "C" fn(Handle, c_int),
    scene_flags: unsafe extern "C" fn(Handle, c_int),
    commit_scene: unsafe extern "C" fn(Handle),
    new_geometry: unsafe extern "C" fn(Handle, c_int) -> Handle,
    release_geometry: unsafe extern "C" fn(Handle),
    new_buffer: unsafe extern "C" fn(Handle, c_int, c_uint, c_int, usize, usize) -> *mut c_void,
    geometry_quality: unsafe extern "C" fn(Handle, c_int),
    commit_geometry: unsafe extern "C" fn(Handle),
    attach: unsafe extern "C" fn(Handle, Handle) -> c_uint,
    intersect: unsafe extern "C" fn(Handle, *mut RtcRayHit, *const c_void),
    occluded: unsafe extern "C" fn(Handle, *mut RtcRay, *const c_void),
    _library: Library,
}

impl EmbreeFunctions {
    fn load(path: &Path) -> Result<Self, libloading::Error> {
        // SAFETY: loading runs the library's initializers; the user who names a library trusts it. The types of the functions are
        // those of Embree's headers.
        unsafe {
            let library = Library::new(path)?;
            macro_rules! get {
                ($name:literal) => {
                    *library.get(concat!($name, "\0").as_bytes())?
                };
            }
            Ok(Self {
                new_device: get!("rtcNewDevice"),
                release_device: get!("rtcReleaseDevice"),
                device_error: get!("rtcGetDeviceError"),
                monitor: get!("rtcSetDeviceMemoryMonitorFunction"),
                new_scene: get!("rtcNewScene"),
                release_scene: get!("rtcReleaseScene"),
                scene_quality: get!("rtcSetSceneBuildQuality"),
                scene_flags: get!("rtcSetSceneFlags"),
                commit_scene: get!("rtcCommitScene"),
                new_geometry: get!("rtcNewGeometry"),
                release_geometry: get!("rtcReleaseGeometry"),
                new_buffer: get!("rtcSetNewGeometryBuffer"),
                geometry_quality: get!("rtcSetGeometryBuildQuality"),
                commit_geometry: get!("rtcCommitGeometry"),
                attach: get!("rtcAttachGeometry"),
                intersect: get!("rtcIntersect1"),
                occluded: get!("rtcOccluded1"),
                _library: library,
            })
        }
    }
}

/// The library, loaded.
#[derive(Clone)]
pub(crate) struct Embree(Arc<EmbreeFunctions>);

/// The quality settings of Embree's build.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EmbreeSetting {
    /// `RTC_BUILD_QUALITY_MEDIUM`, its default: binned.
    Medium,
    /// `RTC_BUILD_QUALITY_HIGH`: with spatial splits.
    High,
    /// `RTC_BUILD_QUALITY_HIGH` with `RTC_SCENE_FLAG_ROBUST`, which leaves the splits out.
    Robust,
}

impl EmbreeSetting {
    /// All settings, in the order of their declaration.
    pub(crate) const ALL: [Self; 3] = [Self::Medium, Self::High, Self::Robust];

    fn name(self) -> &'static str {
        match self {
            Self::Medium => "Embree medium",
            Self::High => "Embree high",
            Self::Robust => "Embree robust",
        }
    }
}

impl Embree {
    /// Loads the library that [`VARIABLE`] names, or one in the site-packages of a Python environment (`VIRTUAL_ENV`), where `pip
    /// install embreex` puts it. The error message contains the remedy.
    pub(crate) fn find() -> Result<Self, String> {
        let hint = format!("set {VARIABLE} to libembree4.so (`pip install embreex` brings one)");
        let named = std::env::var_os(VARIABLE).map(PathBuf::from);
        let path = named.or_else(in_site_packages).ok_or_else(|| format!("Embree 4 was not found: {hint}"))?;
        let load = |error| format!("{} cannot be loaded ({error}): {hint}", path.display());
        EmbreeFunctions::load(&path).map(|functions| Self(Arc::new(functions))).map_err(load)
    }

    /// Builds over a scene with this many threads.
    pub(crate) fn build(
        &self,
        scene: &BenchScene,
        setting: EmbreeSetting,
        threads: usize,
    ) -> Result<EmbreeScene, String> {
        let f = &*self.0;
        let config = CString::new(format!("threads={threads},isa=avx2")).unwrap_or_default();
        let quality = if setting == EmbreeSetting::Medium { 1 } else { 2 };
        let (positions, triangles) = (&scene.positions, &scene.triangles);
        // SAFETY: the calls are in the order required by Embree's manual, each handle is released once (scene and device when the
        // `EmbreeScene` is dropped); the buffers that Embree creates hold `count` elements of 12 bytes.
        let peer = unsafe {
            let device = (f.new_device)(config.as_ptr());
            if device.is_null() {
                return Err(format!("Embree makes no device (error {})", (f.device_error)(device)));
            }
            let bytes = Box::new(AtomicIsize::new(0));
            (f.monitor)(device, Some(count_bytes), std::ptr::from_ref(&*bytes).cast_mut().cast());
            let handle = (f.new_scene)(device);
            let mut peer =
                EmbreeScene { embree: self.clone(), device, scene: handle, setting, bytes, build_time: Duration::ZERO };
            (f.scene_quality)(handle, quality);
            (f.scene_flags)(handle, if setting == EmbreeSetting::Robust { ROBUST } else { 0 });
            let geometry = (f.new_geometry)(device, TRIANGLES);
            let vertices = (f.new_buffer)(geometry, VERTEX_BUFFER, 0, FLOAT3, 12, positions.len());
            let indices = (f.new_buffer)(geometry, INDEX_BUFFER, 0, UINT3, 12, triangles.len());
            if vertices.is_null() || indices.is_null() {
                (f.release_geometry)(geometry);
                return Err(format!("Embree has no room for the mesh (error {})", (f.device_error)(device)));
            }
            std::ptr::copy_nonoverlapping(positions.as_ptr().cast::<u8>(), vertices.cast(), positions.len() * 12);
            std::ptr::copy_nonoverlapping(triangles.as_ptr().cast::<u8>(), indices.cast(), triangles.len() * 12);
            (f.geometry_quality)(geometry, quality);
            (f.commit_geometry)(geometry);
            (f.attach)(handle, geometry);
            (f.release_geometry)(geometry);
            let start = Instant::now();
            (f.commit_scene)(handle);
            peer.build_time = start.elapsed();
            peer
        };
        // SAFETY: the device lives as long as `peer`.
        match unsafe { (f.device_error)(peer.device) } {
            0 => Ok(peer),
            error => Err(format!("Embree reports error {error}")),
        }
    }
}

/// Finds `libembree4*.so*` below the site-packages of the active environment.
fn in_site_packages() -> Option<PathBuf> {
    let entries = |folder: PathBuf| std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let lib = PathBuf::from(std::env::var_os("VIRTUAL_ENV")?).join("lib");
    let libraries = entries(lib).flat_map(|python| entries(python.join("site-packages/embreex.libs")));
    let mut found: Vec<PathBuf> = libraries
        .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("libembree4")))
        .collect();
    found.sort();
    found.pop()
}

/// Counts the bytes that Embree allocates and frees.
unsafe extern "C" fn count_bytes(counter: Handle, bytes: isize, _post: bool) -> bool {
    // SAFETY: the counter lives until the device is released.
    let counter = unsafe { &*counter.cast::<AtomicIsize>() };
    counter.fetch_add(bytes, Ordering::Relaxed);
    true
}

/// A scene of Embree.
pub(crate) struct EmbreeScene {
    embree: Embree,
    device: Handle,
    scene: Handle,
    setting: EmbreeSetting,
    bytes: Box<AtomicIsize>,
    build_time: Duration,
}

impl Drop for EmbreeScene {
    fn drop(&mut self) {
        // SAFETY: both handles are valid and not used again.
        unsafe {
            (self.embree.0.release_scene)(self.scene);
            (self.embree.0.release_device)(self.device);
        }
    }
}

impl RayKernel for EmbreeScene {
    fn name(&self) -> String {
        self.setting.name().to_owned()
    }

    fn closest(&self, rays: &[Ray]) -> (usize, f64) {
        let intersect = self.embree.0.intersect;
        let mut result = (0, 0.0);
        for ray in rays {
            let ray = RtcRay::new(ray);
            let mut hit = RtcRayHit {
                ray,
                normal: [0.0; 3],
                uv: [0.0; 2],
                primitive: u32::MAX,
                geometry: u32::MAX,
                instances: [MaybeUninit::uninit(); 17],
            };
            // SAFETY: the scene is committed; the structure is aligned to 16 and large enough; a null pointer is allowed for
            // arguments.
            unsafe { intersect(self.scene, &raw mut hit, std::ptr::null()) };
            if hit.geometry != u32::MAX {
                result = (result.0 + 1, result.1 + f64::from(hit.ray.t_far));
            }
        }
        result
    }

    fn any(&self, rays: &[Ray]) -> usize {
        let occluded = self.embree.0.occluded;
        let is_hit = |ray: &&Ray| {
            let mut ray = RtcRay::new(ray);
            // SAFETY: as in `closest`.
            unsafe { occluded(self.scene, &raw mut ray, std::ptr::null()) };
            ray.t_far == f32::NEG_INFINITY
        };
        rays.iter().filter(is_hit).count()
    }

    fn build_time(&self) -> Duration {
        self.build_time
    }

    /// Returns the bytes of the tree, and of the vertices and indices that its leaves refer to.
    fn bytes(&self) -> usize {
        self.bytes.load(Ordering::Relaxed).max(0) as usize
    }
}
