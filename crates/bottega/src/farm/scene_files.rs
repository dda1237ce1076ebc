//! The files of a scene, by their contents: sent once, kept by each machine that got them.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

use bottega_agents::driver::nats::NatsBlobs;
use bottega_scene::SceneFile;
use serde::{Deserialize, Serialize};

use super::{
    cache::Cache,
    chunks::{self, Contents},
};
use crate::error::CliError;

/// The name of a folder that stands for one of those that references lead out of.
pub(super) const WITHIN: &str = "in";
/// Files of a scene at most.
const FILES_MAX: usize = 1 << 16;

/// A file of a scene: its name in the scene's folder, and what is in it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SentFile {
    /// Relative to the folder of the scene; may lead out of it by `..`.
    name: String,
    contents: Contents,
}

/// All files of a scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SceneFiles {
    /// The scene file first.
    files: Vec<SentFile>,
    /// The picture that lights it, if it is no file of the scene.
    environment: Option<SentFile>,
}

impl SceneFiles {
    /// Puts the files where the farm can read them; those that are there already stay.
    pub(crate) fn send(
        scene: &Path,
        files: &[SceneFile],
        environment: Option<&Path>,
        blobs: &NatsBlobs,
    ) -> Result<Self, CliError> {
        let name = scene.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let mut sent = vec![send(name, scene, blobs)?];
        for file in files {
            if Path::new(&file.name).is_absolute() {
                return Err(CliError::failed(
                    format!("the scene refers to `{}` by an absolute path", file.name),
                    "other machines have no such file: copy it beside the scene and refer to it by a relative path",
                ));
            }
            sent.push(send(file.name.clone(), &file.path, blobs)?);
        }
        let environment = environment.map(|path| {
            let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
            send(name, path, blobs)
        });
        Ok(Self { files: sent, environment: environment.transpose()? })
    }

    /// Brings the files to this machine, below `cache`. Returns the scene file and the picture that lights it.
    pub(crate) fn fetch(&self, cache: &Cache, store: &NatsBlobs) -> Result<(PathBuf, Option<PathBuf>), CliError> {
        if self.files.is_empty() || self.files.len() > FILES_MAX {
            return Err(CliError::failed(
                "the work names no scene, or too many files",
                "who leads it is of another mind",
            ));
        }
        let all = || self.files.iter().chain(&self.environment);
        let mut hasher = blake3::Hasher::new();
        all().for_each(|file| _ = hasher.update(format!("{}\n{}\n", file.name, file.contents.hash).as_bytes()));
        // As deep as references lead out of the scene's folder, so that none leads out of this one.
        let depth = all().map(|file| leading_out(&file.name)).max().unwrap_or(0);
        let root = cache.scene(hasher.finalize().to_hex().as_str());
        let folder = (0..depth).fold(root.clone(), |folder, _| folder.join(WITHIN));
        // Other processes of this machine may fetch the same.
        let _alone = cache.lock()?;
        for file in all() {
            let path = file.below(&root, &folder)?;
            if !chunks::holds(&path, &file.contents) {
                cache.remove(&path);
                chunks::fetch(&file.name, &file.contents, cache, store)?;
                place(&cache.file(&file.contents.hash), &path)?;
            }
            Cache::touch(&path);
        }
        let in_use: Vec<PathBuf> = all().map(|file| cache.file(&file.contents.hash)).collect();
        cache.trim(&root, &in_use);
        let scene = self.files[0].below(&root, &folder)?;
        let environment = self.environment.as_ref().map(|file| file.below(&root, &folder)).transpose()?;
        Ok((scene, environment))
    }
}

impl SceneFiles {
    /// The names of all pieces in the store.
    pub(super) fn blobs(&self) -> impl Iterator<Item = String> {
        self.files.iter().chain(&self.environment).flat_map(|file| file.contents.blobs())
    }
}

fn leading_out(name: &str) -> usize {
    Path::new(name).components().take_while(|part| *part == Component::ParentDir).count()
}

fn send(name: String, path: &Path, store: &NatsBlobs) -> Result<SentFile, CliError> {
    Ok(SentFile { name, contents: chunks::send(path, store)? })
}

impl SentFile {
    /// Where the file goes; nowhere but below `root`, whatever its name.
    fn below(&self, root: &Path, folder: &Path) -> Result<PathBuf, CliError> {
        let mut path = folder.to_owned();
        for part in Path::new(&self.name).components() {
            match part {
                Component::Normal(part) => path.push(part),
                Component::ParentDir => _ = path.pop(),
                Component::CurDir => {}
                Component::RootDir | Component::Prefix(_) => path = PathBuf::new(),
            }
            if !path.starts_with(root) {
                return Err(CliError::failed(
                    format!("a file of the scene is called `{}`, which leads out of its folder", self.name),
                    "who leads the work is of another mind, or is not to be trusted",
                ));
            }
        }
        Ok(path)
    }
}

/// Writes a file that is there as a whole or not at all.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let wrong = |source| CliError::Write { path: path.to_owned(), source };
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(wrong)?;
    let part = path.with_extension(format!("part-{}", std::process::id()));
    fs::write(&part, bytes).and_then(|()| fs::rename(&part, path)).map_err(wrong)
}

/// Puts a kept file into a scene's folder, without a copy where the file system can.
fn place(kept: &Path, path: &Path) -> Result<(), CliError> {
    let wrong = |source| CliError::Write { path: path.to_owned(), source };
    fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).map_err(wrong)?;
    fs::hard_link(kept, path).or_else(|_| fs::copy(kept, path).map(|_| ())).map_err(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_file_leads_out_of_the_folder_of_its_scene() {
        let (root, folder) = (Path::new("/cache/scenes/1"), Path::new("/cache/scenes/1/in"));
        let contents: Contents = serde_json::from_str(r#"{"hash":"","chunks":[]}"#).unwrap();
        let file = |name: &str| SentFile { name: name.to_owned(), contents: contents.clone() }.below(root, folder);
        assert_eq!(file("a/b.ply").unwrap(), Path::new("/cache/scenes/1/in/a/b.ply"));
        assert_eq!(file("../b.ply").unwrap(), Path::new("/cache/scenes/1/b.ply"));
        for wrong in ["../../b.ply", "/etc/passwd", "../../../etc/passwd", "a/../../../x"] {
            assert!(file(wrong).is_err(), "{wrong}");
        }
    }
}
