//! The C interface of Open Image Denoise, and a safe wrapper.
//!
//! Unsafe: functions of a library found at run time are called with the types that its header declares
//! (`OpenImageDenoise/oidn.h`, 1.4 and 2.x). Soundness: symbols are looked up once and kept as long as the library, which is
//! never unloaded (its threads may outlive its last call); each device and filter is released by its owner; images are borrowed
//! as long as the filter with their addresses exists.
#![allow(unsafe_code)]

use std::{
    ffi::{CStr, c_char, c_int, c_void},
    ops::ControlFlow,
    path::Path,
    ptr,
};

use bottega_image::Picture;

use crate::{DenoiseError, exposure::exposure};

/// The device type `OIDN_DEVICE_TYPE_CPU`.
const DEVICE_CPU: c_int = 1;
/// The pixel format `OIDN_FORMAT_FLOAT3`.
const FORMAT_FLOAT3: c_int = 3;
/// The error code `OIDN_ERROR_NONE`.
const ERROR_NONE: c_int = 0;
/// The error code `OIDN_ERROR_CANCELLED`.
const ERROR_CANCELLED: c_int = 6;
/// The oldest supported version: the first with `cleanAux` and `inputScale`.
const OLDEST: c_int = 10_400;

type Handle = *mut c_void;
type Monitor = extern "C" fn(*mut c_void, f64) -> bool;

/// The functions of the library that are called.
#[derive(Clone, Copy, Debug)]
struct OidnFunctions {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    set_device_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    get_device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    commit_device: unsafe extern "C" fn(Handle),
    get_device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize),
    set_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    set_float: unsafe extern "C" fn(Handle, *const c_char, f32),
    set_monitor: unsafe extern "C" fn(Handle, Monitor, *mut c_void),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
}

/// The loaded library.
#[derive(Clone, Debug)]
pub(crate) struct Library {
    functions: OidnFunctions,
    version: c_int,
}

impl Library {
    /// Loads the library from a file, or by a name from the system's search path.
    pub(crate) fn open(path: &Path) -> Result<Self, DenoiseError> {
        let unfit = |problem: String| DenoiseError::Unfit { path: path.to_owned(), problem };
        // SAFETY: the user or the system names this file as the library, and is trusted that its initializers are sound.
        let library = unsafe { libloading::Library::new(path) }.map_err(|error| {
            if path.is_file() { unfit(error.to_string()) } else { DenoiseError::NotFound { tried: error.to_string() } }
        })?;
        let functions = OidnFunctions::of(&library).map_err(|error| unfit(error.to_string()))?;
        // The library is never unloaded, so `functions` stay valid, and so do its threads.
        std::mem::forget(library);
        let mut loaded = Self { functions, version: 0 };
        // Only a device knows the version.
        let version = loaded.device(1)?.int(c"version");
        if version < OLDEST {
            return Err(unfit(format!("it says that its version is {version}")));
        }
        loaded.version = version;
        Ok(loaded)
    }

    /// Returns the version as 10000 · major + 100 · minor + patch.
    pub(crate) fn version(&self) -> c_int {
        self.version
    }

    /// Makes a device that computes with `threads` CPU threads.
    pub(crate) fn device(&self, threads: usize) -> Result<OidnDevice, DenoiseError> {
        let functions = self.functions;
        // SAFETY: called as declared; the handle is checked before it is used.
        let handle = unsafe { (functions.new_device)(DEVICE_CPU) };
        let device = OidnDevice { functions, handle };
        if handle.is_null() {
            return Err(device.error().unwrap_or_else(|| DenoiseError::Failed("it has no device".to_owned())));
        }
        let threads = c_int::try_from(threads).unwrap_or(0);
        // SAFETY: the device is alive, and the name ends with a zero.
        unsafe {
            (functions.set_device_int)(handle, c"numThreads".as_ptr(), threads);
            (functions.commit_device)(handle);
        }
        device.check().map(|()| device)
    }
}

impl OidnFunctions {
    fn of(library: &libloading::Library) -> Result<Self, libloading::Error> {
        // SAFETY: each symbol has the type that the header declares for its name. Functions renamed in 2.0 have the same type
        // under both names.
        unsafe {
            Ok(Self {
                new_device: *library.get(b"oidnNewDevice\0")?,
                set_device_int: *library.get(b"oidnSetDeviceInt\0").or_else(|_| library.get(b"oidnSetDevice1i\0"))?,
                get_device_int: *library.get(b"oidnGetDeviceInt\0").or_else(|_| library.get(b"oidnGetDevice1i\0"))?,
                commit_device: *library.get(b"oidnCommitDevice\0")?,
                get_device_error: *library.get(b"oidnGetDeviceError\0")?,
                release_device: *library.get(b"oidnReleaseDevice\0")?,
                new_filter: *library.get(b"oidnNewFilter\0")?,
                set_image: *library.get(b"oidnSetSharedFilterImage\0")?,
                set_bool: *library.get(b"oidnSetFilterBool\0").or_else(|_| library.get(b"oidnSetFilter1b\0"))?,
                set_float: *library.get(b"oidnSetFilterFloat\0").or_else(|_| library.get(b"oidnSetFilter1f\0"))?,
                set_monitor: *library.get(b"oidnSetFilterProgressMonitorFunction\0")?,
                commit_filter: *library.get(b"oidnCommitFilter\0")?,
                execute_filter: *library.get(b"oidnExecuteFilter\0")?,
                release_filter: *library.get(b"oidnReleaseFilter\0")?,
            })
        }
    }
}

/// The images that a filter reads and writes.
pub(crate) struct Images<'a> {
    /// The image that is denoised in place.
    main: &'a mut Picture,
    /// The library's name for `main`.
    name: &'static CStr,
    /// The auxiliary images, with the library's names for them.
    guides: Vec<(&'static CStr, &'a Picture)>,
    /// True if the auxiliary images are free of noise.
    are_clean: bool,
}

impl<'a> Images<'a> {
    /// Makes the images for denoising the color, with the auxiliary images that exist.
    pub(crate) fn color(
        color: &'a mut Picture,
        albedo: Option<&'a Picture>,
        normal: Option<&'a Picture>,
        are_clean: bool,
    ) -> Self {
        let guides = [(c"albedo", albedo), (c"normal", normal)];
        let guides: Vec<_> = guides.into_iter().filter_map(|(name, picture)| Some((name, picture?))).collect();
        let are_clean = are_clean && !guides.is_empty();
        Self { main: color, name: c"color", guides, are_clean }
    }

    /// Makes the images for denoising the albedo alone.
    pub(crate) fn albedo(albedo: &'a mut Picture) -> Self {
        Self { main: albedo, name: c"albedo", guides: Vec::new(), are_clean: false }
    }

    /// Makes the images for denoising the normals alone.
    pub(crate) fn normal(normal: &'a mut Picture) -> Self {
        Self { main: normal, name: c"normal", guides: Vec::new(), are_clean: false }
    }
}

/// A device of the library.
#[derive(Debug)]
pub(crate) struct OidnDevice {
    functions: OidnFunctions,
    handle: Handle,
}

impl OidnDevice {
    /// Denoises `images.main` in place. Panics if the images differ in size.
    pub(crate) fn filter(
        &self,
        size: (u32, u32),
        images: Images<'_>,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<(), DenoiseError> {
        let Images { main, name, guides, are_clean } = images;
        assert!(main.size() == size && guides.iter().all(|(_, guide)| guide.size() == size), "pictures of one size");
        let functions = self.functions;
        // SAFETY: the device is alive.
        let filter = Filter { functions, handle: unsafe { (functions.new_filter)(self.handle, c"RT".as_ptr()) } };
        if filter.handle.is_null() {
            return Err(self.error().unwrap_or_else(|| DenoiseError::Failed("it has no filter".to_owned())));
        }
        let (width, height) = (size.0 as usize, size.1 as usize);
        let image = |name: &CStr, data: *mut c_void| {
            // SAFETY: `data` points to `width * height` pixels of three floats, as asserted above, which outlive `filter`.
            unsafe {
                (functions.set_image)(filter.handle, name.as_ptr(), data, FORMAT_FLOAT3, width, height, 0, 0, 0);
            }
        };
        let is_color = name == c"color";
        let scale = if is_color { exposure(main) } else { 1.0 };
        // Input and output share one address: the library can work in place.
        let data = main.data.as_mut_ptr().cast::<c_void>();
        image(name, data);
        image(c"output", data);
        for (name, guide) in &guides {
            // The library only reads images that are not the output.
            image(name, guide.data.as_ptr().cast_mut().cast());
        }
        let mut monitor = ProgressSink { tell: progress };
        // SAFETY: the filter is alive; `monitor` and the images outlive its execution, which this waits for.
        unsafe {
            if is_color {
                (functions.set_bool)(filter.handle, c"hdr".as_ptr(), true);
                (functions.set_bool)(filter.handle, c"cleanAux".as_ptr(), are_clean);
                (functions.set_float)(filter.handle, c"inputScale".as_ptr(), scale);
            }
            (functions.set_monitor)(filter.handle, on_progress, ptr::from_mut(&mut monitor).cast());
            (functions.commit_filter)(filter.handle);
            self.check()?;
            (functions.execute_filter)(filter.handle);
        }
        drop(filter);
        self.check()
    }

    fn int(&self, name: &CStr) -> c_int {
        // SAFETY: the device is alive, and the name ends with a zero.
        unsafe { (self.functions.get_device_int)(self.handle, name.as_ptr()) }
    }

    fn check(&self) -> Result<(), DenoiseError> {
        self.error().map_or(Ok(()), Err)
    }

    /// Returns the last error on this thread, if any.
    fn error(&self) -> Option<DenoiseError> {
        let mut message: *const c_char = ptr::null();
        // SAFETY: the handle is that of a device, or null, which the library accepts for errors without a device.
        let code = unsafe { (self.functions.get_device_error)(self.handle, &raw mut message) };
        match code {
            ERROR_NONE => None,
            ERROR_CANCELLED => Some(DenoiseError::Cancelled),
            code if message.is_null() => Some(DenoiseError::Failed(format!("error {code}"))),
            _ => {
                // SAFETY: the library gives a text that ends with a zero and lives until the next call.
                let message = unsafe { CStr::from_ptr(message) };
                Some(DenoiseError::Failed(message.to_string_lossy().into_owned()))
            }
        }
    }
}

impl Drop for OidnDevice {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: made by `Library::device`, released once.
            unsafe { (self.functions.release_device)(self.handle) }
        }
    }
}

/// A filter of a device.
struct Filter {
    functions: OidnFunctions,
    handle: Handle,
}

impl Drop for Filter {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: made by `OidnDevice::filter`, released once.
            unsafe { (self.functions.release_filter)(self.handle) }
        }
    }
}

/// The receiver of progress.
struct ProgressSink<'a> {
    tell: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
}

/// Receives progress from the library; returning false cancels denoising.
extern "C" fn on_progress(user: *mut c_void, share: f64) -> bool {
    // SAFETY: `user` is the address of a `ProgressSink` given by `OidnDevice::filter`, which lives while the filter runs; the
    // library calls from one thread at a time. A panic here ends the process, since unwinding must not cross the library.
    let progress = unsafe { &mut *user.cast::<ProgressSink<'_>>() };
    (progress.tell)(share).is_continue()
}
