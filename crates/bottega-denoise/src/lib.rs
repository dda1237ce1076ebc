//! Removes what noise is left in a picture, by Intel's Open Image Denoise.
//!
//! For whole pictures alone: a zone that is denoised by itself knows nothing of its neighbours, and its edges would show.
//! The decision that shaped it: the library is no part of the program but found where it is installed and loaded when it is
//! wanted, so whoever wants none needs none. It runs on the processors, and is told how bright the picture is, so that a picture does not depend on whose they are.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | pictures in, pictures out | `src/lib.rs` |
//! | where the library is found | `src/find.rs` |
//! | its C interface | `src/library.rs` |
//! | how bright a picture is as a whole | `src/exposure.rs` |
//! | why a picture is not denoised | `src/error.rs` |

mod error;
mod exposure;
mod find;
mod library;

use std::ops::ControlFlow;

use bottega_image::{Aov, Film, Picture};

pub use error::DenoiseError;
pub use find::{VARIABLE, install_hint};
use library::{Images, Library};

/// The layer that keeps the color as it was.
pub const NOISY: &str = "noisy";

/// A denoiser, ready for pictures. Clones use the same library.
#[derive(Clone, Debug)]
pub struct Denoiser {
    library: Library,
}

/// How a denoiser takes the layers that help it: these have noise themselves, of lenses and edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuideUse {
    /// Each is denoised first, and then taken as clean: for a picture that is finished.
    Denoised,
    /// As they were painted, in a third of the time: for a picture that is painted on.
    AsPainted,
}

/// A picture without noise.
#[derive(Debug)]
pub struct Denoised {
    /// The film with the new color, and the one that it had as the layer [`NOISY`].
    pub film: Film,
    /// What helped to tell noise from texture.
    pub guides: Vec<Aov>,
}

impl Denoiser {
    /// Finds the library: where the variable [`VARIABLE`] says, else where the system has its libraries.
    ///
    /// # Errors
    /// It is not there, or is something else.
    pub fn load() -> Result<Self, DenoiseError> {
        find::library().map(|library| Self { library })
    }

    /// The library's version.
    pub fn version(&self) -> String {
        let version = self.library.version();
        format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
    }

    /// Denoises the color of a film, with the help of its albedo and its normals where it has them.
    ///
    /// - `use_guides`: how these are taken.
    /// - `threads`: processors to use.
    /// - `progress`: is told the share that is done, now and then; may end it.
    ///
    /// # Errors
    /// The library fails, or `progress` has ended it.
    pub fn denoise(
        &self,
        film: &Film,
        use_guides: GuideUse,
        threads: usize,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Denoised, DenoiseError> {
        let device = self.library.device(threads)?;
        let size = film.to_picture().size();
        let mut color = film.to_picture();
        let mut albedo = layer(film, Aov::Albedo);
        // The library knows normals only as a help beside albedo.
        let mut normal = layer(film, Aov::Normal).filter(|_| albedo.is_some());
        let are_clean = use_guides == GuideUse::Denoised;
        let passes = 1 + usize::from(are_clean && albedo.is_some()) + usize::from(are_clean && normal.is_some());
        let mut passes_done = 0;
        let mut run = |images: Images<'_>, done: &mut usize| {
            let mut told = |share: f64| progress((*done as f64 + share.clamp(0.0, 1.0)) / passes as f64);
            device.filter(size, images, &mut told)?;
            *done += 1;
            Ok::<(), DenoiseError>(())
        };
        if let Some(albedo) = albedo.as_mut().filter(|_| are_clean) {
            run(Images::albedo(albedo), &mut passes_done)?;
        }
        if let Some(normal) = normal.as_mut().filter(|_| are_clean) {
            run(Images::normal(normal), &mut passes_done)?;
        }
        let guides = [(Aov::Albedo, albedo.is_some()), (Aov::Normal, normal.is_some())];
        run(Images::color(&mut color, albedo.as_ref(), normal.as_ref(), are_clean), &mut passes_done)?;
        let guides = guides.into_iter().filter_map(|(aov, is_there)| is_there.then_some(aov)).collect();
        Ok(Denoised { film: film.with_color(&color, NOISY)?, guides })
    }
}

/// A layer as a picture, if the film keeps it.
fn layer(film: &Film, aov: Aov) -> Option<Picture> {
    let rect = film.rect();
    film.layout().offset(aov)?;
    Some(Picture::from_fn(rect.width(), rect.height(), |x, y| film.aov(aov, rect.x0 + x, rect.y0 + y)))
}
