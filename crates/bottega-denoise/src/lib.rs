//! Denoising of pictures by Intel's Open Image Denoise.
//!
//! Denoises whole pictures only: zones denoised separately show seams at their edges. The decision that shaped the crate: the
//! library is not linked, but found and loaded at run time, so that the program runs without it. It runs on the CPU and gets
//! the exposure from this crate, so that the result does not depend on the machine.
//!
//! # Modules
//!
//! | subject | where |
//! |---|---|
//! | denoising of films | `src/lib.rs` |
//! | search for the library | `src/find.rs` |
//! | its C interface | `src/library.rs` |
//! | exposure of a picture | `src/exposure.rs` |
//! | errors | `src/error.rs` |

mod error;
mod exposure;
mod find;
mod library;

use std::ops::ControlFlow;

use bottega_image::{Aov, Film, Picture};

pub use error::DenoiseError;
pub use find::{VARIABLE, install_hint};
use library::{Images, Library};

/// Name of the layer that keeps the noisy color.
pub const NOISY: &str = "noisy";

/// A denoiser, ready for pictures. Clones share the library.
#[derive(Clone, Debug)]
pub struct Denoiser {
    library: Library,
}

/// The use of the auxiliary layers (albedo, normals), which are noisy themselves because of lenses and edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuideUse {
    /// Each layer is denoised first and then used as clean: for finished pictures.
    Denoised,
    /// The noisy layers are used directly, in a third of the time: for previews.
    AsPainted,
}

/// A denoised picture, with the layers that guided the denoiser.
#[derive(Debug)]
pub struct Denoised {
    /// The film with the denoised color; its noisy color is the layer [`NOISY`].
    pub film: Film,
    /// The auxiliary layers that were used.
    pub guides: Vec<Aov>,
}

impl Denoiser {
    /// Loads the library: from the place in the environment variable [`VARIABLE`], else from the system's search path.
    ///
    /// # Errors
    /// The library is not found, is not Open Image Denoise 1.4 or newer, or cannot open the CPU as a device.
    pub fn load() -> Result<Self, DenoiseError> {
        find::library().map(|library| Self { library })
    }

    /// Returns the version of the library, as `major.minor.patch`.
    pub fn version(&self) -> String {
        let version = self.library.version();
        format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100)
    }

    /// Denoises the color of a film, using its albedo and, together with that, its normals, if it has them. Returns a film with
    /// the denoised color.
    ///
    /// - `use_guides`: use of albedo and normals.
    /// - `threads`: number of CPU threads.
    /// - `progress`: called now and then with the share done, 0 to 1; can cancel denoising.
    ///
    /// # Errors
    /// The library fails, `progress` has cancelled, or the film cannot take the layer [`NOISY`].
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
        // The library uses normals only together with albedo
        let mut normal = layer(film, Aov::Normal).filter(|_| albedo.is_some());
        let are_clean = use_guides == GuideUse::Denoised;
        let passes = 1 + usize::from(are_clean && albedo.is_some()) + usize::from(are_clean && normal.is_some());
        let mut passes_done = 0;
        let mut run = |images: Images<'_>, done: &mut usize| {
            let mut pass_progress = |share: f64| progress((*done as f64 + share.clamp(0.0, 1.0)) / passes as f64);
            device.filter(size, images, &mut pass_progress)?;
            *done += 1;
            Ok::<(), DenoiseError>(())
        };
        // Denoise the auxiliary layers
        if let Some(albedo) = albedo.as_mut().filter(|_| are_clean) {
            run(Images::albedo(albedo), &mut passes_done)?;
        }
        if let Some(normal) = normal.as_mut().filter(|_| are_clean) {
            run(Images::normal(normal), &mut passes_done)?;
        }
        // Denoise the color, guided by the auxiliary layers
        let guides = [(Aov::Albedo, albedo.is_some()), (Aov::Normal, normal.is_some())];
        run(Images::color(&mut color, albedo.as_ref(), normal.as_ref(), are_clean), &mut passes_done)?;
        let guides = guides.into_iter().filter_map(|(aov, is_there)| is_there.then_some(aov)).collect();
        Ok(Denoised { film: film.with_color(&color, NOISY)?, guides })
    }
}

/// Returns a layer as a picture; `None`: the film does not have it.
fn layer(film: &Film, aov: Aov) -> Option<Picture> {
    let rect = film.rect();
    film.layout().offset(aov)?;
    Some(Picture::from_fn(rect.width(), rect.height(), |x, y| film.aov(aov, rect.x0 + x, rect.y0 + y)))
}
