//! Comparisons of pictures: of jobs, and of files that clients send.

use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use axum::http::StatusCode;
use bottega::{Error, difference::Difference};
use bottega_image::{Canvas, ColorMap, ImageError, Picture, ReadLimits, ToneMap, read_image_bytes};
use tokio::sync::Semaphore;

use crate::{
    limits::SENT_PICTURES_MAX,
    problem::Problem,
    source::{PictureFile, ShownFarm},
};

/// The pictures that clients have sent, and the last comparison.
pub(crate) struct Comparisons {
    state: Mutex<ComparedState>,
    /// The permit of the one comparison that may run: comparing takes much memory.
    pub(crate) alone: Arc<Semaphore>,
}

#[derive(Default)]
struct ComparedState {
    last: u32,
    sent: VecDeque<(u32, Arc<PictureFile>)>,
    /// The last comparison, with the digests of both files: clients ask for figures and map one after the other.
    compared: Option<([blake3::Hash; 2], Arc<ComparedPictures>)>,
}

/// The difference of two pictures.
pub(crate) struct ComparedPictures {
    size: (u32, u32),
    pub(crate) difference: Difference,
}

impl Default for Comparisons {
    fn default() -> Self {
        Self { state: Mutex::default(), alone: Arc::new(Semaphore::new(1)) }
    }
}

impl Comparisons {
    /// Keeps a picture that a client has sent, in place of the oldest one if there are too many. Returns its number and its size
    /// in pixels.
    ///
    /// # Errors
    /// The bytes are not a picture that can be read.
    pub(crate) fn keep(&self, bytes: Vec<u8>) -> Result<(u32, (u32, u32)), Problem> {
        let size = read("the picture", &bytes)?.size();
        let mut state = self.state();
        state.last += 1;
        let number = state.last;
        if state.sent.len() >= SENT_PICTURES_MAX {
            state.sent.pop_front();
        }
        state.sent.push_back((number, Arc::new(PictureFile { name: format!("picture {number}"), bytes })));
        Ok((number, size))
    }

    /// Returns a sent picture as a PNG file for display.
    ///
    /// # Errors
    /// There is no such picture, or it cannot be encoded.
    pub(crate) fn shown(&self, number: u32) -> Result<Vec<u8>, Problem> {
        let file = self.sent(number)?;
        if file.bytes.starts_with(b"\x89PNG") {
            return Ok(file.bytes.clone());
        }
        let picture = read(&file.name, &file.bytes)?;
        Canvas::of_picture(&picture, 0.0, ToneMap::Agx).to_png().map_err(|error| unread(&file.name, &error))
    }

    /// Compares the picture of a job with another one. Returns their difference.
    ///
    /// - `other`: `job-2`, or `picture-1` for a sent picture.
    ///
    /// # Errors
    /// A picture is missing or unreadable, or the pictures differ in size.
    pub(crate) fn compare(
        &self,
        farm: &dyn ShownFarm,
        job: u32,
        other: &str,
    ) -> Result<Arc<ComparedPictures>, Problem> {
        let first = farm.picture(job)?;
        let other = match other.split_once('-').map(|(kind, number)| (kind, number.parse::<u32>())) {
            Some(("job", Ok(number))) => Arc::new(farm.picture(number)?),
            Some(("picture", Ok(number))) => self.sent(number)?,
            _ => {
                let remedy = "name another job, `job-2`, or a picture that was sent, `picture-1`";
                return Err(Problem::unknown(format!("`{other}` is not a picture"), remedy));
            }
        };
        let digests = [&first.bytes, &other.bytes].map(|bytes| blake3::hash(bytes));
        if let Some((_, known)) = self.state().compared.as_ref().filter(|(of, _)| *of == digests) {
            return Ok(Arc::clone(known));
        }
        let (picture, reference) = (read(&first.name, &first.bytes)?, read(&other.name, &other.bytes)?);
        let difference = Difference::between(&picture, &reference).map_err(|error| comparison_problem(&error))?;
        let compared = Arc::new(ComparedPictures { size: picture.size(), difference });
        self.state().compared = Some((digests, Arc::clone(&compared)));
        Ok(compared)
    }

    fn sent(&self, number: u32) -> Result<Arc<PictureFile>, Problem> {
        let state = self.state();
        let found = state.sent.iter().find(|(known, _)| *known == number).map(|(_, file)| Arc::clone(file));
        found.ok_or_else(|| Problem::unknown(format!("there is no picture {number}"), "send it: POST /api/pictures"))
    }

    fn state(&self) -> MutexGuard<'_, ComparedState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ComparedPictures {
    /// Returns FLIP of each pixel in false colors, as a PNG file.
    pub(crate) fn flip_map(&self) -> Result<Vec<u8>, Problem> {
        let (width, height) = self.size;
        let map = Canvas::heat_map(width, height, &self.difference.flip_map, 1.0, ColorMap::Inferno);
        map.to_png().map_err(|error| unread("the map", &error))
    }
}

fn read(name: &str, bytes: &[u8]) -> Result<Picture, Problem> {
    read_image_bytes(name, bytes, ReadLimits::default()).map(|file| file.picture).map_err(|error| unread(name, &error))
}

fn unread(name: &str, error: &ImageError) -> Problem {
    let detail = format!("{name} cannot be used: {error}");
    Problem::new(StatusCode::UNPROCESSABLE_ENTITY, detail, "PNG, OpenEXR and Radiance are read")
}

fn comparison_problem(error: &Error) -> Problem {
    Problem::new(StatusCode::UNPROCESSABLE_ENTITY, error.error_chain(), error.remedy().unwrap_or_default())
}
