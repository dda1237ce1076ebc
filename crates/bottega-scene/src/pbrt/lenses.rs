//! Lenses of pbrt's camera `realistic`: a file of surfaces, the diagonal of the film and the plane in focus.

use std::path::Path;

use super::context::Context;
use super::params::Params;
use super::world::PbrtWorld;
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::lenses::{LENS_SURFACES_MAX, LensDescription, LensSurface, LensSystem};
use crate::text::{column, decode, shortened};

/// Metres in a millimetre, the unit of the file, of the film and of openings. Scenes are in metres.
const MILLIMETRE: f64 = 1e-3;

impl PbrtWorld {
    /// Reads the lenses of the camera `realistic`, in focus at its distance.
    ///
    /// - `scale`: scene units in a unit of the camera.
    pub(super) fn lenses(
        &self,
        context: &mut Context<'_>,
        params: &Params,
        at: TextPlace,
        scale: f64,
    ) -> ImportResult<LensSystem> {
        let Some(name) = params.text("lensfile")? else {
            return Err(at.fault("the camera \"realistic\" has no `lensfile`").into());
        };
        let place = params.place_of("lensfile");
        let location = context.resources.locate(name, &context.place(place))?;
        let bytes = context.resources.read(&location)?;
        let mut surfaces = surfaces_of(location.path(), &bytes, context.resources.budget(), MILLIMETRE * scale)?;

        // Close the stop as far as the camera asks for
        let diameter = params.float("aperturediameter")?.unwrap_or(1.0) * MILLIMETRE * scale;
        let wanted = (0.5 * diameter) as f32;
        for stop in surfaces.iter_mut().filter(|surface| surface.radius == 0.0) {
            if wanted > stop.aperture_radius {
                let message = "`aperturediameter` is larger than the stop of the lenses, which stays wide open";
                context.warn(params.place_of("aperturediameter"), message);
            }
            stop.aperture_radius = stop.aperture_radius.min(wanted);
        }
        if let Some(shape) = params.text("aperture")? {
            let message = format!("the shape \"{}\" of the stop is replaced by a circle", shortened(shape));
            context.unsupported(params.place_of("aperture"), message);
        }

        let film = self.film.as_ref().map(|film| film.params.float("diagonal")).transpose()?.flatten().unwrap_or(35.0);
        let film_diagonal = (film * MILLIMETRE * scale) as f32;
        let focus = params.float("focusdistance")?.unwrap_or(10.0) * scale;
        let description = LensDescription { surfaces, film_diagonal, focus_distance: Some(focus as f32) };
        LensSystem::new(description).map_err(|problem| place.fault(problem.to_string()).into())
    }
}

/// Reads a file of lenses: a line per surface, from the scene to the film, of radius, thickness, refractive index and
/// diameter of the opening. `#` starts a comment.
///
/// - `path`: for errors.
/// - `unit`: scene units in a unit of the file.
fn surfaces_of(path: &Path, bytes: &[u8], budget: &MemoryBudget, unit: f64) -> Result<Vec<LensSurface>, SceneError> {
    let text = decode(path, bytes, budget)?.text;
    let mut surfaces = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> = line.split_whitespace().take(5).collect();
        let Some(first) = words.first() else { continue };
        let invalid = |word: &str, problem: String| SceneError::Text {
            path: path.into(),
            line: number + 1,
            column: column(line.as_bytes(), word.as_bytes()),
            problem,
        };
        let [radius, thickness, eta, diameter] = words[..] else {
            let problem = "a line of lenses holds four numbers: radius, thickness, refractive index and diameter";
            return Err(invalid(first, problem.into()));
        };
        if surfaces.len() == LENS_SURFACES_MAX {
            return Err(invalid(first, format!("more than {LENS_SURFACES_MAX} surfaces")));
        }
        let parse = |word: &str| {
            let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| invalid(word, format!("`{}` is not a number", shortened(word))))
        };
        let length = |word: &str| parse(word).map(|value| (value * unit) as f32);
        let eta = match parse(eta)? {
            // That of the air around a stop
            0.0 => 1.0,
            eta => eta as f32,
        };
        surfaces.push(LensSurface {
            radius: length(radius)?,
            thickness: length(thickness)?,
            eta,
            aperture_radius: 0.5 * length(diameter)?,
        });
    }
    Ok(surfaces)
}
