//! The files of a scene, by content hash: sent once, and cached by each machine that fetches them.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

use bottega_agents::driver::nats::NatsBlobs;
use bottega_scene::SceneFile;
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    files::{
        cache::Cache,
        chunks::{self, Contents},
        pieces::Pieces,
    },
};

/// The most files of a scene.
const FILES_MAX: usize = 1 << 16;

/// A file of a scene: its name and its contents.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SentFile {
    /// The path relative to the scene's folder; may leave it by `..`.
    name: String,
    contents: Contents,
}

/// The files of a scene as a job names them: their names and digests.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SentFiles {
    /// The files, the scene file first.
    files: Vec<SentFile>,
    /// The environment map, if it is not a file of the scene.
    environment: Option<SentFile>,
}

impl SentFiles {
    /// Reads the files. Returns their names and digests, and the chunks to send.
    ///
    /// # Errors
    /// A file cannot be read, or the scene refers to one by an absolute path.
    pub(crate) fn read(scene: &Path, files: &[SceneFile], environment: Option<&Path>) -> Result<(Self, Pieces), Error> {
        let mut pieces = Pieces::default();
        let mut add = |name: String, path: &Path| Ok::<_, Error>(SentFile { name, contents: pieces.add(path)? });
        let name = scene.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let mut read = vec![add(name, scene)?];
        for file in files {
            if Path::new(&file.name).is_absolute() {
                return Err(Error::failed(
                    format!("the scene refers to `{}` by an absolute path", file.name),
                    "other machines have no such file: copy it beside the scene and refer to it by a relative path",
                ));
            }
            read.push(add(file.name.clone(), &file.path)?);
        }
        let environment = environment.map(|path| {
            let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            add(name, path)
        });
        let environment = environment.transpose()?;
        Ok((Self { files: read, environment }, pieces))
    }

    /// Returns files whose chunks the farm has already.
    ///
    /// - `files`: the files with their names relative to the scene's folder, the scene file first.
    /// - `environment`: the environment map, if it is not a file of the scene.
    pub(crate) fn at_farm(files: Vec<(String, Contents)>, environment: Option<(String, Contents)>) -> Self {
        let sent = |(name, contents)| SentFile { name, contents };
        Self { files: files.into_iter().map(sent).collect(), environment: environment.map(sent) }
    }

    /// Fetches the files into `cache`. Returns the paths of the scene file and of the environment map; `None`: the environment
    /// map is a file of the scene, or there is none.
    ///
    /// # Errors
    /// The farm does not answer, the list of files is invalid, a file is not on the farm or has another digest, or the cache
    /// cannot be written.
    pub fn fetch(&self, cache: &Cache, store: &NatsBlobs) -> Result<(PathBuf, Option<PathBuf>), Error> {
        if self.files.is_empty() || self.files.len() > FILES_MAX {
            return Err(Error::failed(
                "the work names no scene, or too many files",
                "its leader has another version of Bottega: install the same version on all machines",
            ));
        }
        // Identify the scene by the names and hashes of its files
        let all = || self.files.iter().chain(&self.environment);
        let mut hasher = blake3::Hasher::new();
        all().for_each(|file| _ = hasher.update(format!("{}\n{}\n", file.name, file.contents.hash).as_bytes()));
        // Nest the scene as deep as its references leave its folder, so that none leaves the cache entry.
        let depth = all().map(|file| leading_out(&file.name)).max().unwrap_or(0);
        let root = cache.scene(hasher.finalize().to_hex().as_str());
        let folder = (0..depth).fold(root.clone(), |folder, _| folder.join(INNER));
        // Other processes of this machine may fetch the same files.
        let _alone = cache.lock()?;
        // Fetch missing files
        for file in all() {
            let path = file.below(&root, &folder)?;
            if !chunks::holds(&path, &file.contents) {
                cache.remove(&path);
                chunks::fetch(&file.name, &file.contents, cache, store)?;
                place(&cache.file(&file.contents.hash), &path)?;
            }
            Cache::touch(&path);
        }
        // Remove old files from the cache
        let in_use: Vec<PathBuf> = all().map(|file| cache.file(&file.contents.hash)).collect();
        cache.trim(&root, &in_use);
        let scene = self.files[0].below(&root, &folder)?;
        let environment = self.environment.as_ref().map(|file| file.below(&root, &folder)).transpose()?;
        Ok((scene, environment))
    }
}

/// The name of the nested folders, one for each level by which references leave the scene's folder.
const INNER: &str = "in";

impl SentFiles {
    /// Returns the folder that contains all files of a fetched scene.
    pub(crate) fn root_of(scene: &Path) -> PathBuf {
        let mut folders = scene.ancestors().skip(1);
        folders.find(|folder| !folder.ends_with(INNER)).unwrap_or(Path::new(".")).to_owned()
    }

    /// Returns the name of the scene file.
    pub(crate) fn scene_name(&self) -> &str {
        self.files.first().map_or("", |file| &file.name)
    }

    /// Returns the name of the environment map, if it is not a file of the scene.
    pub(crate) fn environment_name(&self) -> Option<&str> {
        self.environment.as_ref().map(|file| &*file.name)
    }

    /// Returns the files with `light` as environment map: the file of the same name among them; without an environment map if
    /// `light` is `None`. `None`: no file has that name.
    pub(crate) fn lit_by(self, light: Option<&Path>) -> Option<Self> {
        let environment = match light {
            Some(light) => {
                let mut all = self.environment.iter().chain(&self.files);
                Some(all.find(|file| Path::new(&file.name).file_name() == light.file_name())?.clone())
            }
            None => None,
        };
        Some(Self { environment, ..self })
    }

    /// Returns the names of the files, relative to the scene's folder, the scene file first.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|file| &*file.name)
    }

    /// Returns the names of all chunks in the store.
    pub(crate) fn blobs(&self) -> impl Iterator<Item = String> {
        self.files.iter().chain(&self.environment).flat_map(|file| file.contents.blobs())
    }
}

fn leading_out(name: &str) -> usize {
    Path::new(name).components().take_while(|part| *part == Component::ParentDir).count()
}

impl SentFile {
    /// Returns the path of the file, which is always below `root`.
    ///
    /// # Errors
    /// Its name leads out of `root`.
    fn below(&self, root: &Path, folder: &Path) -> Result<PathBuf, Error> {
        let mut path = folder.to_owned();
        for part in Path::new(&self.name).components() {
            match part {
                Component::Normal(part) => path.push(part),
                Component::ParentDir => _ = path.pop(),
                Component::CurDir => {}
                Component::RootDir | Component::Prefix(_) => path = PathBuf::new(),
            }
            if !path.starts_with(root) {
                return Err(Error::failed(
                    format!("a file of the scene is called `{}`, a path outside of the scene's folder", self.name),
                    "its leader has another version of Bottega, or cannot be trusted",
                ));
            }
        }
        Ok(path)
    }
}

/// Places a cached file into a scene's folder, as a hard link if the file system supports it, or else as a copy.
fn place(kept: &Path, path: &Path) -> Result<(), Error> {
    let write_error = |source| Error::write(path.to_owned(), source);
    fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).map_err(write_error)?;
    fs::hard_link(kept, path).or_else(|_| fs::copy(kept, path).map(|_| ())).map_err(write_error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_below_the_root_may_be_read() {
        for (scene, root) in
            [("/cache/scenes/1/in/in/a.glb", "/cache/scenes/1"), ("/cache/scenes/1/a.glb", "/cache/scenes/1")]
        {
            assert_eq!(SentFiles::root_of(Path::new(scene)), Path::new(root));
        }
    }

    #[test]
    fn another_picture_of_the_same_files_is_lit_by_one_of_them_or_by_none() {
        let contents: Contents = serde_json::from_str(r#"{"hash":"","chunks":[]}"#).unwrap();
        let sent = |light: Option<&str>| {
            let files = ["room.gltf", "textures/sky.hdr"].map(|name| (name.to_owned(), contents.clone())).into();
            SentFiles::at_farm(files, light.map(|name| (name.to_owned(), contents.clone())))
        };
        let lit = |files: SentFiles, light: Option<&str>| {
            files.lit_by(light.map(Path::new)).map(|files| files.environment_name().map(str::to_owned))
        };
        assert_eq!(lit(sent(Some("noon.hdr")), Some("/home/anna/noon.hdr")), Some(Some("noon.hdr".to_owned())));
        assert_eq!(lit(sent(Some("noon.hdr")), None), Some(None));
        assert_eq!(lit(sent(None), Some("sky.hdr")), Some(Some("textures/sky.hdr".to_owned())));
        assert_eq!(lit(sent(None), Some("noon.hdr")), None);
    }

    #[test]
    fn no_file_leads_out_of_the_folder_of_its_scene() {
        let (root, folder) = (Path::new("/cache/scenes/1"), Path::new("/cache/scenes/1/in"));
        let contents: Contents = serde_json::from_str(r#"{"hash":"","chunks":[]}"#).unwrap();
        let file = |name: &str| SentFile { name: name.to_owned(), contents: contents.clone() }.below(root, folder);
        assert_eq!(file("a/b.ply").unwrap(), Path::new("/cache/scenes/1/in/a/b.ply"));
        assert_eq!(file("../b.ply").unwrap(), Path::new("/cache/scenes/1/b.ply"));
        for write_error in ["../../b.ply", "/etc/passwd", "../../../etc/passwd", "a/../../../x"] {
            assert!(file(write_error).is_err(), "{write_error}");
        }
    }
}
