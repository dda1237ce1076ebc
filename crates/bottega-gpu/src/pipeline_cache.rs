//! Compiled kernels, kept from one run to the next, because a driver takes seconds to compile them.
//!
//! Unsafe: a driver trusts data that it is said to have written. Data read from a file is therefore checked against the digest
//! written with it, is given only to the kind of device that the file is named by, and wgpu compares driver and version.
#![allow(unsafe_code)]

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use wgpu::{Adapter, Features, PipelineCacheDescriptor};

use crate::context::Context;

/// The maximum size of a file; larger files were not written by this crate.
const BYTES_MAX: u64 = 256 << 20;

/// The kernels that a driver has compiled, and the file that keeps them.
#[derive(Debug)]
pub(crate) struct PipelineCache {
    file: Option<KernelFile>,
}

/// Compiled kernels of one adapter, and their file.
#[derive(Debug)]
struct KernelFile {
    path: PathBuf,
    cache: wgpu::PipelineCache,
    digest: Option<blake3::Hash>,
}

/// Returns the features that a device must be opened with so that its kernels can be kept.
pub(crate) fn features(adapter: &Adapter) -> Features {
    adapter.features() & Features::PIPELINE_CACHE
}

impl PipelineCache {
    /// Opens the kernels kept in `folder` for this adapter. Keeps nothing without a folder, or if the driver has no pipeline
    /// cache.
    pub(crate) fn open(context: &Context, adapter: &Adapter, folder: Option<&Path>) -> Self {
        Self { file: folder.and_then(|folder| KernelFile::open(context, adapter, folder)) }
    }

    /// Returns the cache to create pipelines with.
    pub(crate) fn get(&self) -> Option<&wgpu::PipelineCache> {
        self.file.as_ref().map(|file| &file.cache)
    }

    /// Writes newly compiled kernels to the file, if there are any. If writing fails they are compiled again in the next run.
    pub(crate) fn keep(&self) {
        let Some(file) = &self.file else { return };
        let Some(data) = file.cache.get_data() else { return };
        let digest = blake3::hash(&data);
        if file.digest == Some(digest) {
            return;
        }
        _ = file.path.parent().map(fs::create_dir_all);
        _ = bottega_image::write_whole(&file.path, &[digest.as_bytes(), data.as_slice()].concat());
    }
}

impl KernelFile {
    fn open(context: &Context, adapter: &Adapter, folder: &Path) -> Option<Self> {
        if !context.device.features().contains(Features::PIPELINE_CACHE) {
            return None;
        }
        let path = folder.join(wgpu::util::pipeline_cache_key(&adapter.get_info())?);
        let read = read(&path);
        let descriptor = PipelineCacheDescriptor {
            label: Some("kernels"),
            data: read.as_ref().map(|(_, data)| data.as_slice()),
            fallback: true,
        };
        // SAFETY: the data, if any, has the digest of what `get_data` returned on such a device.
        let cache = unsafe { context.device.create_pipeline_cache(&descriptor) };
        Some(Self { path, cache, digest: read.map(|(digest, _)| digest) })
    }
}

/// Reads the data that [`PipelineCache::keep`] wrote; `None`: there is no file, or its digest does not match.
fn read(path: &Path) -> Option<(blake3::Hash, Vec<u8>)> {
    let mut bytes = Vec::new();
    File::open(path).ok()?.take(BYTES_MAX).read_to_end(&mut bytes).ok()?;
    let (digest, data) = bytes.split_first_chunk::<{ blake3::OUT_LEN }>()?;
    let digest = blake3::Hash::from_bytes(*digest);
    (blake3::hash(data) == digest).then(|| (digest, data.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_data_is_not_given_to_a_driver() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cache");
        assert_eq!(read(&file), None);
        let data = b"kernels".as_slice();
        let whole = [blake3::hash(data).as_bytes(), data].concat();
        fs::write(&file, &whole).unwrap();
        assert_eq!(read(&file).unwrap().1, data);
        for length in 0..whole.len() {
            fs::write(&file, &whole[..length]).unwrap();
            assert_eq!(read(&file), None, "{length} bytes of it");
        }
        for place in 0..whole.len() {
            let mut changed = whole.clone();
            changed[place] ^= 1;
            fs::write(&file, &changed).unwrap();
            assert_eq!(read(&file), None, "byte {place} changed");
        }
    }
}
