//! Film, filter, sampler and integrator: render hints and exposure.

use glam::{DMat3, DVec3};

use super::context::Context;
use super::needless::Directive;
use super::world::{Entity, PbrtWorld};
use crate::color::Spectrum;
use crate::hints::{FilmFilter, RenderHints};
use crate::import::text_place::{ImportResult, TextPlace};
use crate::integrator::{IntegratorHint, PhotonHints, TransportPaths};
use crate::spectrum::color_space::{ColorSpace, white_balance};
use crate::text::shortened;

/// The resolution without a film.
const RESOLUTION: [i64; 2] = [1280, 720];

/// Maximal side of a picture, in pixels.
const SIDE_MAX: i64 = 1 << 20;

/// The response of the sensor. It is folded into the lights, which gives the same picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exposure {
    matrix: DMat3,
}

impl Exposure {
    /// Applies the exposure to the colour of a light.
    pub(super) fn apply(&self, color: Spectrum) -> Spectrum {
        (self.matrix * color.as_dvec3()).max(DVec3::ZERO).as_vec3()
    }
}

impl PbrtWorld {
    /// Returns the render settings of the file.
    pub(super) fn hints(&self, context: &mut Context<'_>) -> ImportResult<RenderHints> {
        let (resolution, crop) = self.film_size(context)?;
        Ok(RenderHints {
            resolution: Some(resolution),
            crop,
            samples: Some(self.samples(context)?),
            max_depth: Some(self.max_depth(context)?),
            integrator: self.integrator_hint(context, resolution, crop)?,
            filter: Some(self.pixel_filter(context)?),
            sample_max: self.sample_max()?,
            ..RenderHints::default()
        })
    }

    /// Reports unused parameters of the film, after all users have read theirs.
    pub(super) fn report_film(&self, context: &mut Context<'_>) {
        if let Some(film) = &self.film {
            context.report_unused(Directive::Film, &film.kind, &film.params);
        }
    }

    /// Returns columns and rows, and the crop window.
    fn film_size(&self, context: &mut Context<'_>) -> ImportResult<([u32; 2], Option<[u32; 4]>)> {
        let plain = Entity::plain("rgb");
        let film = self.film.as_ref().unwrap_or(&plain);
        let params = &film.params;
        let mut resolution = [0; 2];
        for (side, (name, default)) in
            resolution.iter_mut().zip(["xresolution", "yresolution"].into_iter().zip(RESOLUTION))
        {
            let pixels = params.integer(name)?.unwrap_or(default);
            if !(1..=SIDE_MAX).contains(&pixels) {
                let problem = format!("`{name}` is {pixels}; it must be from 1 to {SIDE_MAX}");
                return Err(params.place_of(name).fault(problem).into());
            }
            *side = pixels as u32;
        }
        let [width, height] = resolution;
        let mut bounds = None;
        if let Some(pixels) = params.integers("pixelbounds") {
            let &[x0, x1, y0, y1] = pixels else {
                return Err(params.place_of("pixelbounds").fault("`pixelbounds` has not four values").into());
            };
            bounds = Some(("pixelbounds", [x0, x1, y0, y1]));
        }
        if let Some(shares) = params.floats("cropwindow") {
            let &[x0, x1, y0, y1] = shares else {
                return Err(params.place_of("cropwindow").fault("`cropwindow` has not four values").into());
            };
            let edge = |share: f64, size: u32| (share.clamp(0.0, 1.0) * f64::from(size)).ceil();
            let (x, y) = (
                (edge(x0.min(x1), width), edge(x0.max(x1), width)),
                (edge(y0.min(y1), height), edge(y0.max(y1), height)),
            );
            bounds = Some(("cropwindow", [x.0, x.1, y.0, y.1]));
        }
        let crop = match bounds {
            None => None,
            Some((name, [x0, x1, y0, y1])) => {
                let clamp = |edge: f64, size: u32| edge.clamp(0.0, f64::from(size)) as u32;
                let (x0, x1, y0, y1) = (clamp(x0, width), clamp(x1, width), clamp(y0, height), clamp(y1, height));
                if x1 <= x0 || y1 <= y0 {
                    return Err(params.place_of(name).fault(format!("`{name}` leaves no pixel")).into());
                }
                Some([x0, y0, x1 - x0, y1 - y0])
            }
        };
        match film.kind.as_str() {
            "rgb" => {}
            "gbuffer" => {
                params.mark_reported(&["coordinatesystem"]);
                let message = "the film \"gbuffer\" is written without its layers: request them with `--layers`";
                context.unsupported(film.at, message);
            }
            "spectral" => {
                params.mark_reported(&["nbuckets", "lambdamin", "lambdamax"]);
                context.unsupported(film.at, "the film \"spectral\" is an RGB film: its buckets are left out");
            }
            kind => context.unsupported(
                film.at,
                format!("the film \"{}\" is unknown; it is read as an RGB film", shortened(kind)),
            ),
        }
        if params.color_space() != ColorSpace::Srgb {
            context.warn(film.at, "the picture is written in linear Rec. 709, not in the colour space of the film");
        }
        Ok((resolution, crop))
    }

    /// Returns the maximal value of a channel of a sample.
    fn sample_max(&self) -> ImportResult<Option<f32>> {
        let Some(film) = &self.film else { return Ok(None) };
        let Some(most) = film.params.float("maxcomponentvalue")? else { return Ok(None) };
        positive(most, film.params.place_of("maxcomponentvalue")).map(Some)
    }

    /// Returns the response of the sensor: exposure time, ISO number, white balance.
    pub(super) fn exposure(&self, context: &mut Context<'_>) -> ImportResult<Exposure> {
        let plain = (Entity::plain("rgb"), Entity::plain("perspective"));
        let film = self.film.as_ref().unwrap_or(&plain.0);
        let camera = &self.camera.as_ref().unwrap_or(&plain.1).params;
        let shutter = camera.float("shutterclose")?.unwrap_or(1.0) - camera.float("shutteropen")?.unwrap_or(0.0);
        if shutter.is_nan() || shutter <= 0.0 {
            return Err(camera.place_of("shutterclose").fault("the shutter closes before it opens").into());
        }
        let params = &film.params;
        let iso = params.float("iso")?.unwrap_or(100.0);
        // Early versions of pbrt-v4 have a separate exposure time.
        let seconds = params.float("exposuretime")?.unwrap_or(1.0);
        let ratio = shutter * seconds * iso / 100.0;
        if !(1e-18..1e18).contains(&ratio) {
            return Err(params.place_of("iso").fault(format!("the exposure {ratio:e} is out of reach")).into());
        }
        let sensor = params.text("sensor")?.unwrap_or("cie1931");
        if sensor != "cie1931" {
            let message = format!(
                "the sensor \"{}\" sees as the standard observer does; colours may differ slightly",
                shortened(sensor)
            );
            context.unsupported(params.place_of("sensor"), message);
        }
        let mut matrix = DMat3::from_diagonal(DVec3::splat(ratio));
        let kelvin = params.float("whitebalance")?.unwrap_or(0.0);
        if kelvin > 0.0 {
            if kelvin < 1000.0 {
                let problem = format!("no light is balanced to white at {kelvin} K; 0 leaves the colours alone");
                return Err(params.place_of("whitebalance").fault(problem).into());
            }
            matrix = white_balance(kelvin) * matrix;
            context.warn(
                params.place_of("whitebalance"),
                "the colours of the lights are balanced, instead of the picture's",
            );
        }
        Ok(Exposure { matrix })
    }

    fn samples(&self, context: &mut Context<'_>) -> ImportResult<u32> {
        let Some(sampler) = &self.sampler else { return Ok(16) };
        let params = &sampler.params;
        let samples = if sampler.kind == "stratified" {
            params.integer("xsamples")?.unwrap_or(4).saturating_mul(params.integer("ysamples")?.unwrap_or(4))
        } else {
            params.integer("pixelsamples")?.unwrap_or(16)
        };
        context.report_unused(Directive::Sampler, &sampler.kind, params);
        u32::try_from(samples).ok().filter(|&samples| samples > 0).ok_or_else(|| {
            let problem = format!("{samples} samples per pixel: at least 1 is needed");
            params.place_of("pixelsamples").fault(problem).into()
        })
    }

    /// Returns the maximal depth. pbrt counts as we do: 0 is emission, 1 direct light.
    fn max_depth(&self, context: &mut Context<'_>) -> ImportResult<u32> {
        let plain = Entity::plain("volpath");
        let integrator = self.integrator.as_ref().unwrap_or(&plain);
        let params = &integrator.params;
        let depth = params.integer("maxdepth")?.unwrap_or(5);
        match integrator.kind.as_str() {
            kind if follows(kind).is_some() => {}
            "ao" | "function" => {
                let message = format!(
                    "the integrator \"{}\" is not supported; paths are traced from the camera",
                    integrator.kind
                );
                context.unsupported(integrator.at, message);
            }
            kind => {
                let message =
                    format!("the integrator \"{}\" is unknown; paths are traced from the camera", shortened(kind));
                context.unsupported(integrator.at, message);
            }
        }
        for (name, usual, message) in [
            ("regularize", false, "materials keep their roughness on all bounces, though `regularize` is true"),
            ("visualizestrategies", false, "no pictures of single strategies are written"),
            ("visualizeweights", false, "no pictures of single strategies are written"),
            ("samplelights", true, "lights without extent shine, though `samplelights` is false"),
        ] {
            if params.bool(name)?.is_some_and(|given| given != usual) {
                context.unsupported(params.place_of(name), message);
            }
        }
        if integrator.kind == "ao" {
            params.mark_reported(&["cossample", "maxdistance"]);
        }
        if integrator.kind == "sppm" {
            // Mark as read: the integrator hint uses them.
            params.integer("photonsperiteration")?;
            params.float("radius")?;
        }
        context.report_unused(Directive::Integrator, &integrator.kind, params);
        u32::try_from(depth).map_err(|_| params.place_of("maxdepth").fault("`maxdepth` is negative").into())
    }

    /// Returns the integrator that the file names.
    fn integrator_hint(
        &self,
        context: &Context<'_>,
        resolution: [u32; 2],
        crop: Option<[u32; 4]>,
    ) -> ImportResult<Option<IntegratorHint>> {
        let Some(integrator) = &self.integrator else { return Ok(None) };
        let Some(mut follows) = follows(&integrator.kind) else { return Ok(None) };
        if let TransportPaths::Photons(hints) = &mut follows {
            let params = &integrator.params;
            // By default there are as many photons as pixels.
            let [width, height] = crop.map_or(resolution, |[_, _, width, height]| [width, height]);
            let pixels = u64::from(width) * u64::from(height);
            let count = match params.integer("photonsperiteration")?.unwrap_or(-1) {
                given if given > 0 => given.unsigned_abs(),
                _ => pixels,
            };
            hints.count = Some(u32::try_from(count).unwrap_or(u32::MAX));
            hints.radius = Some(positive(params.float("radius")?.unwrap_or(1.0), params.place_of("radius"))?);
        }
        let place = context.place(integrator.at);
        Ok(Some(IntegratorHint { name: integrator.kind.clone(), place, follows }))
    }

    fn pixel_filter(&self, context: &mut Context<'_>) -> ImportResult<FilmFilter> {
        let plain = Entity::plain("gaussian");
        let filter = self.filter.as_ref().unwrap_or(&plain);
        let params = &filter.params;
        let default_radius = match filter.kind.as_str() {
            "box" => 0.5,
            "gaussian" => 1.5,
            "sinc" => 4.0,
            _ => 2.0,
        };
        let (x, y) =
            (params.float("xradius")?.unwrap_or(default_radius), params.float("yradius")?.unwrap_or(default_radius));
        let radius = 0.5 * (x + y);
        if !(x > 0.0 && y > 0.0 && radius <= 64.0) {
            return Err(params.place_of("xradius").fault("a filter's radius must be above 0, and at most 64").into());
        }
        if x != y {
            context.unsupported(params.place_of("xradius"), format!("the filter is as wide as it is high: {radius}"));
        }
        let radius = radius as f32;
        let result = match filter.kind.as_str() {
            "box" => FilmFilter::Box { radius },
            "triangle" => FilmFilter::Tent { radius },
            "gaussian" => FilmFilter::Gaussian {
                radius,
                sigma: positive(params.float("sigma")?.unwrap_or(0.5), params.place_of("sigma"))?,
            },
            "mitchell" => {
                let third = 1.0 / 3.0;
                let (b, c) = (params.float("B")?.unwrap_or(third), params.float("C")?.unwrap_or(third));
                if [b, c].iter().any(|number| !(0.0..=1.0).contains(number)) {
                    return Err(filter.at.fault("`B` and `C` of a filter are from 0 to 1").into());
                }
                FilmFilter::Mitchell { radius, b: b as f32, c: c as f32 }
            }
            kind => {
                if kind == "sinc" {
                    params.mark_reported(&["tau"]);
                }
                let message =
                    format!("the filter \"{}\" is replaced by that of Mitchell and Netravali", shortened(kind));
                context.unsupported(filter.at, message);
                FilmFilter::Mitchell { radius: 2.0, b: 1.0 / 3.0, c: 1.0 / 3.0 }
            }
        };
        context.report_unused(Directive::Filter, &filter.kind, params);
        Ok(result)
    }
}

impl PbrtWorld {
    /// Returns true if the integrator of the file ignores media.
    pub(super) fn ignores_media(&self) -> bool {
        let kind = self.integrator.as_ref().map_or("volpath", |integrator| integrator.kind.as_str());
        matches!(kind, "path" | "simplepath" | "randomwalk" | "lightpath" | "sppm")
    }
}

/// Returns the transport paths of an integrator; `None` if it is not light transport, or unknown.
fn follows(kind: &str) -> Option<TransportPaths> {
    Some(match kind {
        "path" | "volpath" => TransportPaths::Paths { is_ours: true },
        "simplepath" | "simplevolpath" | "randomwalk" => TransportPaths::Paths { is_ours: false },
        "bdpt" | "mlt" | "lightpath" => TransportPaths::BothEnds,
        "sppm" => TransportPaths::Photons(PhotonHints::default()),
        _ => return None,
    })
}

/// Converts to a normal positive single-precision number.
fn positive(number: f64, at: TextPlace) -> ImportResult<f32> {
    let rounded = number as f32;
    if rounded.is_normal() && rounded > 0.0 { Ok(rounded) } else { Err(at.fault("it must be above 0").into()) }
}
